//! A probe that is replaced is no change of the machine.

use nalgebra::Vector3;
use pkm_core::estimation::{Alarm, Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, TipReading};
use pkm_core::tables::reference::MACHINE_F64;
use pkm_tests::{cases, seeded};

use super::estimation::{TIP_M, Truth, drives};

/// By how much more than the old probe the new one reads.
const MORE: f64 = 0.01;

/// What is learned of a healthy machine when its probe is replaced after 100 of 300 readings, with the alarms after all of them.
fn replaced<const N: usize>(settings: &EstimatorSettings<N>) -> (Estimator<f64, N>, [Option<Alarm>; N]) {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let mut estimator = Estimator::<f64, N>::new(settings).expect("settings");
    for n in 0..300 {
        let (touch, readings) = truth.touch(&mut rng, 0, 600 * n);
        let gain = if n < 100 { 1.0 } else { 1.0 + MORE };
        let readings = readings.map(|r| TipReading { read: r.read * gain, ..r });
        let _ = estimator.learn(&MACHINE_F64, None, &touch, &readings);
    }
    let alarms = estimator.alarms();
    (estimator, alarms)
}

fn with_gain(settings: &EstimatorSettings<6>) -> EstimatorSettings<7> {
    let gain = AmplitudeSettings {
        amplitude: Amplitude::GAIN,
        accepted: 0.0,
        deviation: 0.01,
        drift_per_day: 1e-4,
        least: -0.1,
        most: 0.1,
        rate_per_s: 1.0,
        alarm: 0.005,
    };
    let amplitudes = std::array::from_fn(|n| settings.amplitudes.get(n).copied().unwrap_or(gain));
    EstimatorSettings { amplitudes, model_share: settings.model_share }
}

#[test]
fn a_new_probe_with_another_gain_passes_for_no_change_of_the_machine() {
    for _ in 0..cases(2) {
        let (_, blamed) = replaced(&drives());
        assert!(blamed.iter().any(Option::is_some), "without a gain it passes for one");

        let (mut estimator, [machine @ .., probe]) = replaced(&with_gain(&drives()));
        assert_eq!(machine, [None; 6]);
        let probe = probe.expect("an alarm of the probe");
        assert!((probe.change - MORE).abs() < 4.0 * probe.deviation && probe.deviation < 0.1 * MORE, "{probe:?}");

        // the tip is compensated as before
        estimator.follow(1e9);
        let (touch, _) = Truth::new(&mut seeded()).touch(&mut seeded(), 0, 0);
        let at_a = touch.wrench.moved_to_a(TIP_M);
        let sensitivities = MACHINE_F64.sensitivities(&touch.pose, &at_a, &estimator.amplitudes()).expect("reached");
        let tip_m: Vector3<f64> = estimator.tip(&sensitivities, TIP_M).deflection.seen_at(TIP_M).translation_m;
        let loaded = MACHINE_F64.stiffness(&touch.pose).unwrap().factor().unwrap().deflection(&at_a).unwrap();
        assert!(tip_m.norm() < 0.2 * MORE * loaded.seen_at(TIP_M).translation_m.norm(), "{tip_m:e}");
    }
}

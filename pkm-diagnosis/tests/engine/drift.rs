//! Drifts of zeros within series, against readings that were made with and without.

use pkm_diagnosis::drift::drifts;
use pkm_diagnosis::{Observations, Reading, Rules};

use crate::support::{CHANNELS, micro, observations, reading};

/// Poses, loads of each.
const POSES: usize = 12;
const LOADS: usize = 16;

/// Two series at every pose, in each of which the same loads are read; `drift` in m a reading is that of a pose's series.
fn two_series(rng: &mut fastrand::Rng, softer: f64, mut drift: impl FnMut(usize, usize) -> f64) -> Observations {
    let mut readings: Vec<Reading> = Vec::new();
    for pose in 0..POSES {
        for repeat in 0..2 {
            let rates: Vec<f64> = (0..CHANNELS).map(|_| drift(pose, repeat)).collect();
            let zeros: Vec<f64> = (0..CHANNELS).map(|_| micro(rng)).collect();
            for load in 0..LOADS {
                // of both signs, and in no order
                let deflection = 30e-6 * f64::from(load as u32 * 7 % 16) - 225e-6;
                let observed = std::array::from_fn(|c| {
                    let grown = deflection * (1.0 + softer * repeat as f64);
                    Some(grown + zeros[c] + rates[c] * load as f64 + micro(rng))
                });
                readings.push(reading(pose * LOADS + load, pose * 2 + repeat, observed));
            }
        }
    }
    observations((0..POSES * LOADS).map(|condition| condition / LOADS).collect(), readings)
}

#[test]
fn a_drift_is_told_with_its_size() {
    let mut rng = fastrand::Rng::with_seed(7);
    let of = two_series(&mut rng, 0.0, |_, repeat| if repeat == 1 { 0.3e-6 } else { 0.0 });
    let found = drifts(&of, &Rules::DEFAULT);
    assert_eq!(found.iter().map(|d| d.channel).collect::<Vec<_>>(), (0..CHANNELS).collect::<Vec<_>>());
    for d in found {
        assert!(d.is_common && (d.change / (0.3e-6 * (LOADS - 1) as f64) - 1.0).abs() < 0.15, "{d:?}");
        assert!(d.series == POSES && (d.over_noise - 4.5).abs() < 1.0, "{d:?}");
    }
}

#[test]
fn drifts_that_differ_from_series_to_series_are_told() {
    let mut rng = fastrand::Rng::with_seed(8);
    let mut signs = fastrand::Rng::with_seed(9);
    let of = two_series(&mut rng, 0.0, |_, _| 0.3 * micro(&mut signs));
    let found = drifts(&of, &Rules::DEFAULT);
    assert!(found.len() == CHANNELS && found.iter().all(|d| !d.is_common), "{found:?}");
    // each is against another that drifts as well
    let expected = 0.3e-6 * 2.0_f64.sqrt() * (LOADS - 1) as f64;
    assert!(found.iter().all(|d| d.change > 0.5 * expected && d.change < 1.7 * expected), "{found:?}");
}

#[test]
fn repeats_within_a_series_tell_a_drift_too() {
    let mut rng = fastrand::Rng::with_seed(10);
    for rate in [0.0, 0.2e-6] {
        let mut readings = Vec::new();
        for pose in 0..POSES {
            for n in 0..2 * LOADS {
                let deflection = 30e-6 * f64::from((n % LOADS) as u32 * 7 % 16) - 225e-6;
                let observed = std::array::from_fn(|_| Some(deflection + rate * n as f64 + micro(&mut rng)));
                readings.push(reading(pose * LOADS + n % LOADS, pose, observed));
            }
        }
        let of = observations((0..POSES * LOADS).map(|condition| condition / LOADS).collect(), readings);
        let found = drifts(&of, &Rules::DEFAULT);
        assert_eq!(found.len(), if rate > 0.0 { CHANNELS } else { 0 }, "{found:?}");
        let change = 0.2e-6 * (2 * LOADS - 1) as f64;
        assert!(found.iter().all(|d| (d.change / change - 1.0).abs() < 0.15), "{found:?}");
    }
}

#[test]
fn noise_zeros_and_a_machine_that_got_softer_are_no_drift() {
    for seed in 0..200 {
        let mut rng = fastrand::Rng::with_seed(100 + seed);
        let softer = if seed % 2 == 0 { 0.0 } else { 0.02 };
        let found = drifts(&two_series(&mut rng, softer, |_, _| 0.0), &Rules::DEFAULT);
        assert!(found.is_empty(), "seed {seed}: {found:?}");
    }
}

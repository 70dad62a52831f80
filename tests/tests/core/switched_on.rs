//! What must hold of a compensator whatever its settings and readings.

use fastrand::Rng;
use nalgebra::{SVector, Vector2, Vector3};
use pkm_core::compensator::{
    CarriedWeight, Compensator, CompensatorSettings, Fault, Offset, OutsideBox, Reading, Weight,
};
use pkm_core::tables::reference::{PARAMETERS, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{
    Configuration, CorrectionTable, FiveAxis, Machine, MachineParameters, Model, Pose, Scalar, TemperatureRise, Wrench,
};
use pkm_tests::{between, cases, seeded};

/// With friction and growth, so that history and temperatures count.
fn parameters() -> MachineParameters {
    let effects = PARAMETERS.effects.with("friction-hysteresis", [2e-6, 0.0, 50.0]).unwrap();
    let effects = effects.with("thermal-expansion", [11e-6, 14e-6, 0.0]).unwrap();
    MachineParameters { effects, ..PARAMETERS }
}

/// A setting in its range, on a border in one of three cases.
fn pick(rng: &mut Rng, least: f64, most: f64) -> f64 {
    match rng.usize(0..6) {
        0 => least,
        1 => most,
        _ => between(rng, least.max(1e-7 * most).ln(), most.ln()).exp().clamp(least, most),
    }
}

/// Any that are accepted.
fn settings(rng: &mut Rng) -> CompensatorSettings {
    let max_force_n = pick(rng, 1e-3, 1e9);
    let max_moment_nm = pick(rng, 1e-3, 1e9);
    let period_s = pick(rng, 1e-6, 1.0);
    let (max_screw_m, max_wrist_rad) = (pick(rng, 1e-9, 0.01), pick(rng, 1e-9, 0.1));
    let slowest = |most: f64| 1.000001e-6 * most / period_s;
    CompensatorSettings {
        period_s,
        gain: pick(rng, 0.0, 1.0),
        filter_s: pick(rng, 0.0, (1e5 * period_s).min(10.0)),
        dead_band_n: pick(rng, 0.0, max_force_n),
        dead_band_nm: pick(rng, 0.0, max_moment_nm),
        max_force_n,
        max_moment_nm,
        hold_s: pick(rng, 0.0, 10.0),
        stuck_s: pick(rng, 0.0, 1000.0),
        max_screw_m,
        max_wrist_rad,
        screw_rate_m_per_s: pick(rng, slowest(max_screw_m), 1.0),
        wrist_rate_rad_per_s: pick(rng, slowest(max_wrist_rad), 10.0),
        outside_box: [OutsideBox::Hold, OutsideBox::Fade, OutsideBox::Extrapolate][rng.usize(0..3)],
    }
}

fn whatever(rng: &mut Rng) -> f64 {
    let any = [0.0, -0.0, 1.0, -1e3, 1e9, 1e300, f64::MAX, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, 1e-40];
    any[rng.usize(0..any.len())]
}

/// What a controller and its sensors say in a period.
struct Place {
    pose: [f64; 3],
    beta: [f64; 2],
    wrench: [f64; 6],
    rise: [f64; 4],
}

/// The next period: now and then a jump, or no number at all.
fn period(rng: &mut Rng, at: &mut Place) {
    if rng.u8(..) < 10 {
        at.pose = [between(rng, -0.5, 0.5), between(rng, -0.5, 0.5), between(rng, 0.45, 0.6)];
        at.beta = [between(rng, -1.3, 1.3), between(rng, -1.3, 1.3)];
    }
    if rng.u8(..) < 3 {
        at.pose[rng.usize(0..3)] = whatever(rng);
    }
    if rng.u8(..) < 3 {
        at.beta[rng.usize(0..2)] = whatever(rng);
    }
    let size = 10_f64.powf(between(rng, -2.0, 4.0));
    if rng.u8(..) < 200 {
        at.wrench = [1.0, 1.0, 1.0, 0.05, 0.05, 0.05].map(|w| w * between(rng, -size, size));
    }
    if rng.u8(..) < 20 {
        at.wrench[rng.usize(0..6)] = whatever(rng);
    }
    at.rise = at.rise.map(|r| r + between(rng, -0.1, 0.1));
    if rng.u8(..) < 5 {
        at.rise = [0; 4].map(|_| between(rng, -100.0, 100.0));
    }
    if rng.u8(..) < 20 {
        at.rise[rng.usize(0..4)] = whatever(rng);
    }
}

/// A period, of three screws or five axes.
trait Runs<T: Scalar, const N: usize> {
    fn go(&mut self, table: &CorrectionTable<'_, T>, five: &FiveAxis<'_, T>, at: &Place, enabled: bool)
    -> Offset<T, N>;

    /// Has it carry weights, where they have a reference.
    fn carry(&mut self, table: &CorrectionTable<'_, T>, five: &FiveAxis<'_, T>, at: &Place, weights: &[Weight<T>; 2]);
}

fn weights<T: Scalar>(rng: &mut Rng) -> [Weight<T>; 2] {
    let size = pick(rng, 1.0, 3e4);
    [(); 2].map(|()| Weight {
        force_n: Vector3::from_fn(|_, _| T::from_f64(between(rng, -size, size))),
        centre_m: Vector3::from_fn(|_, _| T::from_f64(between(rng, -5.0, 5.0))),
    })
}

const TIP_M: [f64; 3] = [0.01, -0.02, 0.3];

fn reading<T: Scalar>(at: &Place, enabled: bool) -> Reading<T> {
    let n = |v: f64| T::from_f64(v);
    let [a, b, c, platforms_k] = at.rise.map(n);
    Reading {
        enabled,
        wrench: Wrench::from_vector(at.wrench.map(n).into()),
        rise: TemperatureRise { limbs_k: [a, b, c], platforms_k },
    }
}

fn pose<T: Scalar>(at: &Place) -> Pose<T> {
    let [theta_rad, sigma_rad, z0_m] = at.pose.map(T::from_f64);
    Pose { theta_rad, sigma_rad, z0_m }
}

impl<T: Scalar> Runs<T, 3> for Compensator<T, 3> {
    fn go(
        &mut self,
        table: &CorrectionTable<'_, T>,
        five: &FiveAxis<'_, T>,
        at: &Place,
        enabled: bool,
    ) -> Offset<T, 3> {
        let (model, tip_m) = (Model::new(five.machine, table), TIP_M.map(T::from_f64).into());
        self.update(&model, &pose(at), tip_m, &reading(at, enabled))
    }

    fn carry(&mut self, table: &CorrectionTable<'_, T>, five: &FiveAxis<'_, T>, at: &Place, weights: &[Weight<T>; 2]) {
        let (model, tip_m) = (Model::new(five.machine, table), TIP_M.map(T::from_f64).into());
        self.set_weight(CarriedWeight::<T, 3>::new(&model, &weights[0], &pose(at), tip_m).ok());
    }
}

impl<T: Scalar> Runs<T, 5> for Compensator<T, 5> {
    fn go(
        &mut self,
        table: &CorrectionTable<'_, T>,
        five: &FiveAxis<'_, T>,
        at: &Place,
        enabled: bool,
    ) -> Offset<T, 5> {
        let beta_rad = Vector2::new(T::from_f64(at.beta[0]), T::from_f64(at.beta[1]));
        let (model, stands) = (Model::new(five.machine, table), Configuration { pose: pose(at), beta_rad });
        self.update(&model, five.wrist, &stands, &reading(at, enabled))
    }

    fn carry(&mut self, table: &CorrectionTable<'_, T>, five: &FiveAxis<'_, T>, at: &Place, weights: &[Weight<T>; 2]) {
        let beta_rad = Vector2::new(T::from_f64(at.beta[0]), T::from_f64(at.beta[1]));
        let zeroed_at = Configuration { pose: pose(at), beta_rad };
        let (model, [platform, tool]) = (Model::new(five.machine, table), weights);
        self.set_weight(CarriedWeight::<T, 5>::new(&model, five.wrist, platform, tool, &zeroed_at).ok());
    }
}

/// Finite, within both limits, the same bits again, and back to zero when it is switched off.
fn holds<T: Scalar, const N: usize>(rng: &mut Rng, table: &CorrectionTable<'_, T>, five: &FiveAxis<'_, T>)
where
    Compensator<T, N>: Runs<T, N>,
{
    for case in 0..cases(100) {
        let s = settings(rng);
        let mut c = Compensator::<T, N>::new(&s).unwrap();
        let eps = if size_of::<T>() == 4 { 1e-6 } else { 1e-14 };
        let limit = |i: usize| {
            if i < 3 { (s.max_screw_m, s.screw_rate_m_per_s) } else { (s.max_wrist_rad, s.wrist_rate_rad_per_s) }
        };
        let mut at = Place { pose: [0.1, -0.05, 0.53], beta: [0.3, -0.2], wrench: [0.0; 6], rise: [0.0; 4] };
        let mut last = SVector::<f64, N>::zeros();
        for _ in 0..150 {
            period(rng, &mut at);
            if rng.u8(..) < 5 {
                c.carry(table, five, &at, &weights(rng));
            }
            let enabled = rng.u8(..) > 4;
            let mut twin = c;
            let now = c.go(table, five, &at, enabled);
            let again = twin.go(table, five, &at, enabled);
            assert_eq!(format!("{now:?}{c:?}"), format!("{again:?}{twin:?}"));
            let joints = now.joints.map(T::to_f64);
            for i in 0..N {
                let (largest, rate) = limit(i);
                assert!(joints[i].is_finite() && joints[i].abs() <= largest * (1.0 + eps), "{case} {s:?} {joints:?}");
                let step = (joints[i] - last[i]).abs();
                assert!(
                    step <= rate * s.period_s * (1.0 + eps) + 1.01 * eps * joints[i].abs().max(last[i].abs()),
                    "{case} {s:?} {joints:?} {last:?}"
                );
            }
            last = joints;
        }
        // back to zero in no more periods than the rate limit asks; where none is a fraction of the last place, some more
        let way = (0..N).map(|i| last[i].abs() / (limit(i).1 * s.period_s)).fold(0.0, f64::max);
        let more = if size_of::<T>() == 4 { 1.1 } else { 1.000001 };
        for _ in 0..(more * way) as usize + 3 {
            c.go(table, five, &at, false);
        }
        let left = c.joints().map(T::to_f64);
        assert!(left.iter().all(|o| *o == 0.0), "{case} stuck: {s:?} {left:?} from {last:?} after {way}");
    }
}

#[test]
fn whatever_comes() {
    let mut rng = seeded();
    let double = Machine::<f64>::new(&parameters()).unwrap();
    let single = Machine::<f32>::new(&parameters()).unwrap();
    let five = FiveAxis { machine: &double, wrist: &WRIST_F64 };
    let five_32 = FiveAxis { machine: &single, wrist: &WRIST_F32 };
    holds::<f64, 3>(&mut rng, &TABLE_F64, &five);
    holds::<f64, 5>(&mut rng, &TABLE_F64, &five);
    holds::<f32, 3>(&mut rng, &TABLE_F32, &five_32);
    holds::<f32, 5>(&mut rng, &TABLE_F32, &five_32);
}

/// Of the tests of temperatures.
const PERIOD_S: f64 = 0.01;

fn growing() -> Machine<f64> {
    Machine::<f64>::new(&parameters()).unwrap()
}

fn at_once() -> Compensator<f64, 3> {
    let settings = CompensatorSettings {
        period_s: PERIOD_S,
        screw_rate_m_per_s: 1.0,
        max_screw_m: 0.01,
        stuck_s: 0.0,
        filter_s: 0.0,
        ..CompensatorSettings::DEFAULT
    };
    Compensator::new(&settings).unwrap()
}

fn at(compensator: &mut Compensator<f64, 3>, machine: &Machine<f64>, rise_k: f64) -> Offset<f64, 3> {
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    let reading = Reading { enabled: true, wrench: Wrench::ZERO, rise: rise_k.into() };
    compensator.update(&Model::new(machine, &TABLE_F64), &pose, Vector3::new(0.01, -0.02, 0.3), &reading)
}

/// A sensor says what it was reset to, or garbage, until its first conversion.
#[test]
fn a_wrong_first_reading_is_not_believed_for_minutes() {
    let machine = growing();
    let right = at(&mut at_once(), &machine, 5.0);
    for wrong_periods in [1, 75] {
        let mut compensator = at_once();
        for _ in 0..wrong_periods {
            at(&mut compensator, &machine, 65.0);
        }
        let mut periods = 0;
        while at(&mut compensator, &machine, 5.0 + 0.1 * f64::from(periods % 2)).fault.is_some() {
            periods += 1;
            assert!(periods <= 101, "the right temperature is refused");
        }
        assert_eq!(at(&mut compensator, &machine, 5.0).joints, right.joints);
    }
}

/// The same reading after a minute is a sensor that has failed.
#[test]
fn a_jump_later_on_is_no_first_reading() {
    let (machine, mut compensator) = (growing(), at_once());
    for _ in 0..1200 {
        assert_eq!(at(&mut compensator, &machine, 5.0).fault, None);
    }
    for _ in 0..2000 {
        assert_eq!(at(&mut compensator, &machine, 65.0).fault, Some(Fault::TemperatureLost));
    }
}

/// A line that opens behind a filter, or a converter that drifts: no single step is large.
#[test]
fn a_temperature_that_runs_away_is_lost() {
    let machine = growing();
    for step_k in [0.9, 0.05, 0.005] {
        let mut compensator = at_once();
        for _ in 0..3000 {
            assert_eq!(at(&mut compensator, &machine, 5.0).fault, None);
        }
        let before = at(&mut compensator, &machine, 5.0).joints;
        let mut rise_k = 5.0;
        let mut found = None;
        while rise_k < 60.0 {
            rise_k += step_k;
            let offset = at(&mut compensator, &machine, rise_k);
            if offset.fault.is_some() {
                found = found.or(Some(rise_k));
            }
        }
        let found = found.expect("it is believed");
        assert!(found <= 5.0 + 3.1, "{step_k} K a period: found at {found} K");
        let grown = (at(&mut compensator, &machine, 65.0).joints - before).amax();
        assert!(grown < 3.1 * 14e-6, "{grown:e}");
    }
    // as fast as a machine may get warm
    let mut compensator = at_once();
    for period in 0..20_000 {
        let noise = 0.4 * f64::from(period % 3 - 1);
        let rise_k = 5.0 + 0.1 * PERIOD_S * f64::from(period) + noise;
        assert_eq!(at(&mut compensator, &machine, rise_k).fault, None, "{period}");
    }
}

#[test]
fn a_time_that_is_not_zero_is_one_period_at_least() {
    let machine = Machine::<f64>::new(&parameters()).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    let wrench = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
    let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
    for (stuck_s, periods) in [(0.4, 1), (1.0, 1), (3.0, 3)] {
        let settings = CompensatorSettings { period_s: 1.0, stuck_s, ..CompensatorSettings::DEFAULT };
        let mut c = Compensator::<f64, 3>::new(&settings).unwrap();
        let faults: Vec<_> = (0..6)
            .map(|_| {
                c.update(&Model::new(&machine, &TABLE_F64), &pose, Vector3::new(0.0, 0.0, 0.3), &reading)
                    .fault
                    .is_some()
            })
            .collect();
        assert_eq!(faults.iter().position(|f| *f), Some(periods), "{stuck_s}: {faults:?}");
    }
}

/// In f32, slower than its resolution: an offset that never comes back.
#[test]
fn what_f32_cannot_follow_is_refused() {
    let d = CompensatorSettings::DEFAULT;
    let slow = [
        (
            CompensatorSettings { period_s: 1e-6, max_screw_m: 0.01, screw_rate_m_per_s: 1e-4, ..d },
            "screw_rate_m_per_s",
        ),
        (
            CompensatorSettings { period_s: 1e-6, max_wrist_rad: 0.1, wrist_rate_rad_per_s: 1e-3, ..d },
            "wrist_rate_rad_per_s",
        ),
        (CompensatorSettings { period_s: 1e-6, filter_s: 10.0, ..d }, "filter_s"),
    ];
    for (settings, name) in slow {
        assert_eq!(settings.check().map_err(|e| e.setting), Err(name));
    }
    // the slowest that there is comes back
    let machine = Machine::<f32>::new(&parameters()).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    let settings = CompensatorSettings {
        period_s: 1e-3,
        max_screw_m: 1e-5,
        screw_rate_m_per_s: 1e-8,
        filter_s: 0.0,
        stuck_s: 0.0,
        ..d
    };
    let mut c = Compensator::<f32, 3>::new(&settings).unwrap();
    let wrench = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
    let mut period = |enabled| {
        c.update(
            &Model::new(&machine, &TABLE_F32),
            &pose,
            Vector3::new(0.0, 0.0, 0.3),
            &Reading { enabled, wrench, rise: 0.0.into() },
        )
        .joints
    };
    for _ in 0..30_000 {
        period(true);
    }
    let there = period(true).amax();
    assert!((there / 3e-7 - 1.0).abs() < 0.05, "{there:e}");
    for _ in 0..31_500 {
        period(false);
    }
    assert_eq!(period(false), Vector3::zeros());
}

//! The uncertainty of a table's deflections against derivatives by differences of the dense inverse, and the gate that it makes.

use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Fault, Known, Offset, Reading, Weight};
use pkm_core::correction::{TableError, TableUncertainty, UNCERTAINTY_COLUMNS, UNCERTAINTY_ENTRIES};
use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, TipReading, Touch};
use pkm_core::machine::MachineParameters;
use pkm_core::nalgebra::{Matrix3, Matrix6, Vector2, Vector3, Vector6};
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, UNCERTAINTY_F32, UNCERTAINTY_F64, WRIST_F64,
};
use pkm_core::{Configuration, CycleError, FiveAxis, Machine, Model, Pose, StiffnessError, Wrench};

use crate::compensator::MODEL;

const KNOWN: Model<'static, f64> = MODEL.with_uncertainty(&UNCERTAINTY_F64);
const TIP_M: Vector3<f64> = Vector3::new(0.03, -0.02, 0.3);
/// ° and mm.
const POSES: [[f64; 3]; 4] = [[0.0, 0.0, 530.0], [11.0, -9.0, 550.0], [-14.0, 14.0, 505.0], [17.0, -17.0, 570.0]];

fn pose([theta_deg, sigma_deg, z0_mm]: [f64; 3]) -> Pose<f64> {
    Pose { theta_rad: theta_deg.to_radians(), sigma_rad: sigma_deg.to_radians(), z0_m: z0_mm / 1e3 }
}

fn push() -> Wrench<f64> {
    Wrench { force_n: Vector3::new(120.0, -50.0, -400.0), moment_nm: Vector3::new(2.0, -8.0, 5.0) }
}

/// Numbers of an uncertainty of no table's, and what they mean entry by entry: the independent changes of S, before v.
fn numbers() -> ([f64; 4], f64, [[f64; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS]) {
    let columns = std::array::from_fn(|r| std::array::from_fn(|k| ((7 * r + 3 * k) as f64 * 1.3).sin()));
    ([1e-4, 3e-4, 2e-4, 5e-4], 0.3, columns)
}

fn changes() -> Vec<Matrix6<f64>> {
    let (_, rest, columns) = numbers();
    let mut all = Vec::new();
    for column in columns {
        let mut entries = column.iter();
        let mut s = Matrix6::zeros();
        for i in 0..6 {
            for j in 0..=i {
                s[(i, j)] = *entries.next().unwrap();
                s[(j, i)] = s[(i, j)];
            }
        }
        all.push(s);
    }
    for i in 0..6 {
        for j in 0..=i {
            let mut s = Matrix6::zeros();
            s[(i, j)] = if i == j { rest } else { rest / 2f64.sqrt() };
            s[(j, i)] = s[(i, j)];
            all.push(s);
        }
    }
    all
}

fn spread(pose: &Pose<f64>) -> f64 {
    let (spread, ..) = numbers();
    let (middle, half) = ([0.0, 0.0, 0.53], [15f64.to_radians(), 15f64.to_radians(), 0.03]);
    let at = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
    spread[0] + (0..3).map(|k| spread[k + 1] * ((at[k] - middle[k]) / half[k]).powi(8)).sum::<f64>()
}

/// Motion of the tip by a dense inverse of the stiffness.
fn tip_motion(k: &Matrix6<f64>) -> Vector3<f64> {
    let arm = Matrix3::new(0.0, -TIP_M.z, TIP_M.y, TIP_M.z, 0.0, -TIP_M.x, -TIP_M.y, TIP_M.x, 0.0);
    let (force, moment) = (push().force_n, push().moment_nm + arm * push().force_n);
    let load = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
    let d = k.try_inverse().unwrap() * load;
    d.fixed_rows::<3>(0) - arm * d.fixed_rows::<3>(3)
}

#[test]
fn it_is_the_linear_propagation_of_the_covariance() {
    let (s, rest, columns) = numbers();
    let known = TableUncertainty::<f64>::new(s, rest, columns).unwrap();
    for at in POSES.map(pose) {
        let factor = TABLE_F64.factor_form(&MACHINE_F64, &at).unwrap().factor;
        let found = TABLE_F64.tip_uncertainty(&known, &factor, &at, &push(), TIP_M).unwrap().variance_m2;
        let stiff = TABLE_F64.stiffness_u95(&known, &factor, &at);
        let f = factor.lower();
        let (mut tip, mut principal) = (Vector3::<f64>::zeros(), Vector6::<f64>::zeros());
        for change in changes() {
            // central differences of K = F (I + S)⁻¹ Fᵀ
            let h = 1e-5;
            let k = |h: f64| f * (Matrix6::identity() + change * h).try_inverse().unwrap() * f.transpose();
            let (more, less) = (k(h), k(-h));
            tip += ((tip_motion(&more) - tip_motion(&less)) / (2.0 * h)).map(|d| d * d);
            principal += ((more.diagonal() - less.diagonal()) / (2.0 * h)).map(|d| d * d);
        }
        for (found, expected) in found.iter().zip(&(tip * spread(&at))) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} is not {expected}");
        }
        for (found, expected) in stiff.iter().zip(&principal) {
            let expected = 1.96 * (expected * spread(&at)).sqrt();
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} is not {expected}");
        }
    }
}

/// `checks/gtc/propagate.py` works these out with GTC 1.5.1 from PyPI, from the committed table's numbers.
#[test]
fn gtc_agrees() {
    for (at, expected_um) in POSES.map(pose).into_iter().zip(GTC_U95_UM) {
        let factor = TABLE_F64.factor_form(&MACHINE_F64, &at).unwrap().factor;
        let found = TABLE_F64.tip_uncertainty(&UNCERTAINTY_F64, &factor, &at, &push(), TIP_M).unwrap().u95_m() * 1e6;
        for (found, expected) in found.iter().zip(expected_um) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} is not {expected} at {at:?}");
        }
    }
}

/// Along u, v, w.
const GTC_U95_UM: [[f64; 3]; 4] = [
    [0.04759713147568446, 0.13085738449979187, 0.012135720027768469],
    [0.11822109510217069, 0.3522634802644666, 0.14159510531658648],
    [0.6169260800945928, 1.0193459986293738, 0.7016398199965217],
    [1.0425320613940323, 2.531292684160033, 1.6708631892438646],
];

#[test]
fn f32_is_near_f64() {
    for at in POSES {
        let exact = TABLE_F64.cycle_known(&MACHINE_F64, &UNCERTAINTY_F64, &pose(at), &push(), TIP_M).unwrap();
        let Pose { theta_rad, sigma_rad, z0_m } = pose(at);
        let there = Pose { theta_rad: theta_rad as f32, sigma_rad: sigma_rad as f32, z0_m: z0_m as f32 };
        let wrench = Wrench { force_n: push().force_n.cast(), moment_nm: push().moment_nm.cast() };
        let found = TABLE_F32.cycle_known(&MACHINE_F32, &UNCERTAINTY_F32, &there, &wrench, TIP_M.cast()).unwrap();
        for (found, exact) in found.uncertainty.variance_m2.iter().zip(&exact.uncertainty.variance_m2) {
            assert!((f64::from(*found) / exact - 1.0).abs() < 1e-3, "{found} is not {exact}");
        }
    }
}

#[test]
fn no_more_is_compensated_than_is_known() {
    let at = pose(POSES[1]);
    let plain = TABLE_F64.cycle(&MACHINE_F64, &at, &push(), TIP_M).unwrap();
    let sure = TABLE_F64.cycle_known(&MACHINE_F64, &UNCERTAINTY_F64, &at, &push(), TIP_M).unwrap();
    assert_eq!((sure.cycle, sure.share), (plain, 1.0));
    // a table that may be off by 10 standard deviations of 100 %
    let (s, rest, columns) = numbers();
    let unsure = TableUncertainty::<f64>::new(s.map(|s| s * 1e4), rest, columns).unwrap();
    let known = TABLE_F64.cycle_known(&MACHINE_F64, &unsure, &at, &push(), TIP_M).unwrap();
    let moved = plain.deflection.seen_at(TIP_M).translation_m.norm();
    let expected = moved / known.uncertainty.u95_m().norm();
    assert!(known.share < 0.9 && (known.share / expected - 1.0).abs() < 1e-12, "{} is not {expected}", known.share);
    assert_eq!(known.cycle.deflection, plain.deflection);
    let part = MACHINE_F64.compensated(&at, &plain.deflection, TIP_M).unwrap().lengths.q_m - plain.lengths.q_m;
    let commanded = known.cycle.compensated.lengths.q_m - known.cycle.lengths.q_m;
    assert!((commanded - part * known.share).amax() < 1e-3 * part.amax());
}

/// Follows its load at once and wholly.
const DIRECT: CompensatorSettings = CompensatorSettings {
    gain: 1.0,
    filter_s: 0.0,
    dead_band_n: 0.0,
    dead_band_nm: 0.0,
    screw_rate_m_per_s: 1.0,
    wrist_rate_rad_per_s: 10.0,
    ..CompensatorSettings::DEFAULT
};

fn reading() -> Reading<f64> {
    Reading { enabled: true, wrench: push(), rise: 0.0.into() }
}

/// A first period of a compensator that compensates no more than is known.
fn known_offset<const N: usize>(model: &Model<'_, f64, N>, at: &Pose<f64>, reading: &Reading<f64>) -> Offset<f64, 3> {
    Compensator::<f64, 3>::new(&DIRECT).unwrap().update(model, at, TIP_M, reading)
}

#[test]
fn a_compensator_compensates_no_more_than_is_known() {
    let at = pose(POSES[1]);
    let plain = known_offset(&MODEL, &at, &reading());
    assert_eq!((plain.known, plain.fault), (None, None));
    // a table that knows the deflection is compensated as without it
    let sure = known_offset(&KNOWN, &at, &reading());
    let cycle = TABLE_F64.cycle_known(&MACHINE_F64, &UNCERTAINTY_F64, &at, &push(), TIP_M).unwrap();
    assert_eq!(sure.known, Some(Known { uncertainty: cycle.uncertainty, share: 1.0 }));
    assert_eq!(sure.joints, plain.joints);
    // one that does not is compensated as the cycle says
    let (s, rest, columns) = numbers();
    let unsure = TableUncertainty::<f64>::new(s.map(|s| s * 1e4), rest, columns).unwrap();
    let cycle = TABLE_F64.cycle_known(&MACHINE_F64, &unsure, &at, &push(), TIP_M).unwrap();
    let part = known_offset(&MODEL.with_uncertainty(&unsure), &at, &reading());
    assert!(cycle.share < 0.9);
    assert_eq!(part.known, Some(Known { uncertainty: cycle.uncertainty, share: cycle.share }));
    let commanded = cycle.cycle.compensated.lengths.q_m - cycle.cycle.lengths.q_m;
    assert!((part.joints - commanded).amax() < 1e-15);
    // five axes have a tip elsewhere, and the same gate
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let stands = Configuration { pose: at, beta_rad: Vector2::new(0.3, -0.2) };
    let of_five = |known| {
        let mut compensator = Compensator::<f64, 5>::new(&DIRECT).unwrap();
        compensator.update(&MODEL.with_uncertainty(known), five.wrist, &stands, &reading())
    };
    let (whole, part) = (of_five(&UNCERTAINTY_F64), of_five(&unsure));
    let (sure, share) = (whole.known.unwrap(), part.known.unwrap().share);
    let moved_m = five.deflection(Some(&TABLE_F64), &stands, &push()).unwrap().translation_m;
    let expected = moved_m.norm() / part.known.unwrap().uncertainty.u95_m().norm();
    assert!(sure.share == 1.0 && share < 0.9 && (share / expected - 1.0).abs() < 1e-12, "{share} is not {expected}");
    assert!((part.joints - whole.joints * share).amax() < 1e-3 * whole.joints.amax());
}

/// Learns one amplitude, of which nothing is known but its deviation.
fn of(amplitude: Amplitude, deviation: f64) -> Estimator<f64, 1> {
    let own = AmplitudeSettings {
        amplitude,
        accepted: 0.0,
        deviation,
        drift_per_day: 0.0,
        least: -20.0 * deviation,
        most: 20.0 * deviation,
        rate_per_s: deviation,
        alarm: 0.03 * deviation,
    };
    Estimator::new(&EstimatorSettings { amplitudes: [own], model_share: 0.0 }).unwrap()
}

/// Learns warmth beyond what sensors say.
fn of_warmth() -> Estimator<f64, 1> {
    of(Amplitude::RISE, 3.0)
}

/// The reference machine, of steel.
fn of_steel() -> Machine<f64> {
    let effects = PARAMETERS.effects.with("thermal-expansion", [11e-6, 11e-6, 0.0]).unwrap();
    Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap()
}

/// After twenty readings of a machine that is so much warmer than its sensors say, under a force along w.
fn warm(machine: &Machine<f64>, rise_k: f64, force_n: f64) -> Estimator<f64, 1> {
    let (mut learned, pose) = (of_warmth(), pose(POSES[0]));
    for n in 0..20 {
        let wrench = Wrench { force_n: Vector3::new(0.0, 0.0, force_n), ..Wrench::ZERO };
        let loaded = machine.deflection(Some(&TABLE_F64), &pose, &wrench.moved_to_a(TIP_M), &Wrench::ZERO).unwrap();
        let moved = loaded.plus(&machine.thermal_deflection(&pose, rise_k).unwrap());
        let read = moved.seen_at(TIP_M).translation_m.z + 1e-9 * f64::from(n % 3);
        let reading = TipReading { direction: Vector6::ith(2, 1.0), read, deviation: 1e-7 };
        let touch = Touch { time_s: 600 * n, pose, tip_m: TIP_M, wrench, rise_k: 0.0 };
        learned.learn(machine, Some(&TABLE_F64), &touch, &[reading]).expect("taken in");
    }
    learned.follow(1e3);
    learned
}

/// Warmth is found whichever way the load goes: growth against a load is no reversed probe.
#[test]
fn growth_against_the_load_is_learned() {
    let machine = of_steel();
    for force_n in [400.0, -400.0] {
        let [(rise_k, _)] = warm(&machine, 5.0, force_n).values();
        assert!((rise_k - 5.0).abs() < 0.02, "{rise_k}");
    }
}

#[test]
fn growth_that_was_learned_is_compensated_as_growth_that_is_read() {
    let (machine, at, stands) =
        (of_steel(), pose(POSES[1]), Configuration { pose: pose(POSES[1]), beta_rad: Vector2::new(0.3, -0.2) });
    let learned = warm(&machine, 5.0, 400.0);
    let [applied_k] = learned.applied();
    assert!(applied_k > 4.99);
    let five = FiveAxis { machine: &machine, wrist: &WRIST_F64 };
    let little = Weight { force_n: Vector3::new(1e-9, 0.0, 0.0), centre_m: Vector3::zeros() };
    for gain in [0.7, 0.0] {
        for wrench in [Wrench::ZERO, push()] {
            let cold = Reading { enabled: true, wrench, rise: 0.0.into() };
            let warm = Reading { rise: applied_k.into(), ..cold };
            let settings = CompensatorSettings { gain, ..DIRECT };
            let three = || Compensator::<f64, 3>::new(&settings).unwrap();
            let read = three().update(&Model::new(&machine, &TABLE_F64), &at, TIP_M, &warm).joints;
            let found = three().update(&Model::new(&machine, &TABLE_F64).with_learned(&learned), &at, TIP_M, &cold);
            assert!((found.joints - read).amax() < 1e-12 && read.amax() > 20e-6, "{found:?} {read:?}");
            let mut carrying = three();
            carrying.set_weight(Some(
                CarriedWeight::<f64, 3>::new(&Model::new(&machine, &TABLE_F64), &little, &at, TIP_M).unwrap(),
            ));
            let carried = carrying.update(&Model::new(&machine, &TABLE_F64).with_learned(&learned), &at, TIP_M, &cold);
            assert!((carried.joints - read).amax() < 1e-12);
            let of_five = || Compensator::<f64, 5>::new(&settings).unwrap();
            let read = of_five().update(&Model::new(five.machine, &TABLE_F64), five.wrist, &stands, &warm).joints;
            let found = of_five()
                .update(&Model::new(five.machine, &TABLE_F64).with_learned(&learned), five.wrist, &stands, &cold)
                .joints;
            assert!((found - read).amax() < 1e-12 && read.amax() > 20e-6);
        }
    }
}

/// The loop gain is never above its setting: what is not known of the growth takes nothing off the load's share, and so gives it no slope.
#[test]
fn unknown_growth_takes_no_share_of_the_load() {
    let (machine, at) = (of_steel(), pose(POSES[1]));
    let unread = of_warmth();
    let mut last = 0.0;
    for step in 1..=40 {
        let wrench = Wrench { force_n: Vector3::new(10.0 * f64::from(step), 0.0, 0.0), ..Wrench::ZERO };
        let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
        let three = || Compensator::<f64, 3>::new(&DIRECT).unwrap();
        let plain = three().update(&Model::new(&machine, &TABLE_F64), &at, TIP_M, &reading).joints;
        let found = three().update(&Model::new(&machine, &TABLE_F64).with_learned(&unread), &at, TIP_M, &reading);
        let known = found.known.unwrap();
        assert_eq!((found.joints, known.share), (plain, 1.0));
        last = plain.amax();
    }
    assert!(last > 10e-6);
}

#[test]
fn a_table_and_what_was_learned_are_doubted_together() {
    let at = pose(POSES[1]);
    let learned = of(Amplitude::compliance(Place::Body { limb: 1 }, Motion::Axial).unwrap(), 1e-9);
    let together = known_offset(&KNOWN.with_learned(&learned), &at, &reading()).known.unwrap();
    let of_table = known_offset(&KNOWN, &at, &reading()).known.unwrap();
    let alone = known_offset(&MODEL.with_learned(&learned), &at, &reading()).known.unwrap();
    let sum = of_table.uncertainty.variance_m2 + alone.uncertainty.variance_m2;
    assert!(alone.uncertainty.variance_m2.amax() > 0.0);
    assert!((together.uncertainty.variance_m2 - sum).amax() <= 1e-15 * sum.amax());
}

#[test]
fn nothing_is_known_where_nothing_is_compensated() {
    let at = pose(POSES[1]);
    let off = Reading { enabled: false, ..reading() };
    assert_eq!(known_offset(&KNOWN, &at, &off).known, None);
    let outside = known_offset(&KNOWN, &pose(POSES[3]), &reading());
    assert_eq!((outside.known, outside.fault), (None, Some(Fault::OutsideBox)));
    let nowhere = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: f64::NAN };
    assert_eq!(known_offset(&KNOWN, &nowhere, &reading()).known, None);
    // an uncertainty that overflows is a fault
    let (_, rest, columns) = numbers();
    let endless = TableUncertainty::<f64>::new([f64::MAX; 4], rest, columns.map(|c| c.map(|x| x * 1e200))).unwrap();
    let found = known_offset(&MODEL.with_uncertainty(&endless), &at, &reading());
    assert_eq!((found.known, found.fault), (None, Some(StiffnessError::NotFinite.into())));
}

#[test]
fn what_is_no_uncertainty_is_refused() {
    let (s, rest, columns) = numbers();
    let new = |s, rest, columns| TableUncertainty::<f64>::new(s, rest, columns).err();
    let refused = Some(TableError::Uncertainty);
    assert_eq!(new(s, rest, columns), None);
    assert_eq!(new([-1e-9, 0.0, 0.0, 0.0], rest, columns), refused);
    assert_eq!(new([0.0, 0.0, 0.0, f64::INFINITY], rest, columns), refused);
    assert_eq!(new(s, f64::NAN, columns), refused);
    let mut bad = columns;
    bad[3][20] = f64::NAN;
    assert_eq!(new(s, rest, bad), refused);
    let at = pose(POSES[0]);
    let factor = TABLE_F64.factor_form(&MACHINE_F64, &at).unwrap().factor;
    let nowhere = Wrench { force_n: Vector3::new(f64::NAN, 0.0, 0.0), ..push() };
    let found = TABLE_F64.tip_uncertainty(&UNCERTAINTY_F64, &factor, &at, &nowhere, TIP_M);
    assert_eq!(found, Err(StiffnessError::NotFinite));
    let found = TABLE_F64.cycle_known(&MACHINE_F64, &UNCERTAINTY_F64, &at, &nowhere, TIP_M);
    assert!(matches!(found, Err(CycleError::Correction(_))));
}

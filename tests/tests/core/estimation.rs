//! The estimator against batch fits, and against machines that change: their truth is the dense structural matrix, which knows no
//! amplitude.

use fastrand::Rng;
use nalgebra::{Cholesky, DMatrix, DVector, SVector, U6, Vector2, Vector3, Vector6};
use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::effects::{Effects, Motion, Place};
use pkm_core::estimation::{
    Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, EstimatorSettingsError, Refusal, Slot, StateError,
    TipReading, Touch, newest, state_bytes,
};
use pkm_core::kinematics::platform_axes;
use pkm_core::machine::{BodyKind, MachineParameters};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F64, WRIST_F64};
use pkm_core::{
    Configuration, Deflection, Domain, FiveAxis, JointValues, Machine, Model, Pose, Scalar, ScrewLengths, Wrench,
};
use pkm_tests::{between, cases, keep_worst, random_parameters, random_pose, seeded, structural_stiffness};

use crate::compensator::MODEL;

/// Every amplitude but the temperature, with its names as an element.
fn compliances() -> Vec<(Amplitude, &'static str, &'static str)> {
    let limbs = [1, 2, 3].map(|limb| (Place::Body { limb }, &[Motion::Axial][..]));
    let places = limbs.into_iter().chain([Place::Base, Place::Tool].map(|place| (place, &place.motions()[..6])));
    let all = places.flat_map(|(place, motions)| motions.iter().map(move |motion| (place, *motion)));
    all.map(|(place, motion)| {
        (Amplitude::compliance(place, motion).expect("one"), place.name().expect("a name"), motion.name())
    })
    .collect()
}

fn random_wrench(rng: &mut Rng) -> Wrench<f64> {
    Wrench::from_vector(Vector6::from_fn(|i, _| between(rng, -1.0, 1.0) * if i < 3 { 500.0 } else { 50.0 }))
}

/// A normal number.
fn normal(rng: &mut Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}

fn narrow_pose(pose: &Pose<f64>) -> Pose<f32> {
    Pose { theta_rad: pose.theta_rad as f32, sigma_rad: pose.sigma_rad as f32, z0_m: pose.z0_m as f32 }
}

fn narrow_wrench(wrench: &Wrench<f64>) -> Wrench<f32> {
    Wrench::from_vector(wrench.to_vector().map(|component| component as f32))
}

#[test]
fn sensitivities_are_those_of_elements_of_any_size() {
    let mut rng = seeded();
    let mut worst = 0.0;
    for _ in 0..cases(200) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).expect("a machine");
        let pose = random_pose(&mut rng, &machine, parameters.geometry.b1_m, 0.1);
        let wrench = random_wrench(&mut rng);
        let before = machine.stiffness(&pose).unwrap().factor().unwrap().deflection(&wrench).unwrap().to_vector();
        for (amplitude, place, motion) in compliances() {
            let [moved] = machine.sensitivities(&pose, &wrench, &[amplitude]).unwrap();
            // as soft as the machine itself
            let softer = 1e-8;
            let effects = Effects::NONE.with_element(place, motion, "constant", [softer]).expect("an element");
            let changed = Machine::<f64>::new(&MachineParameters { effects, ..parameters }).expect("a machine");
            let after = changed.stiffness(&pose).unwrap().factor().unwrap().deflection(&wrench).unwrap().to_vector();
            let off = after - before - moved.to_vector() * softer;
            let size = |d: &Vector6<f64>| d.fixed_rows::<3>(0).norm() + d.fixed_rows::<3>(3).norm();
            keep_worst(&mut worst, size(&off) / size(&after));
        }
    }
    println!("worst {worst:.1e}");
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn sensitivities_in_f32_are_near_those_in_f64() {
    let mut rng = seeded();
    let amplitudes = compliances();
    let mut worst = 0.0;
    for _ in 0..cases(1000) {
        let pose = box_pose(&mut rng);
        let wrench = random_wrench(&mut rng);
        for (amplitude, ..) in &amplitudes {
            let [double] = MACHINE_F64.sensitivities(&pose, &wrench, &[*amplitude]).unwrap();
            let [single] =
                MACHINE_F32.sensitivities(&narrow_pose(&pose), &narrow_wrench(&wrench), &[*amplitude]).unwrap();
            let [double, single] = [double.to_vector(), single.to_vector().map(f64::from)];
            // a load that hardly loads the amplitude leaves nothing but rounding
            let most = MACHINE_F64.sensitivities(&pose, &Wrench::from_vector(Vector6::repeat(500.0)), &[*amplitude]);
            let size = double.amax().max(0.01 * most.unwrap()[0].to_vector().amax());
            keep_worst(&mut worst, (double - single).amax() / size);
        }
    }
    println!("worst {worst:.1e}");
    assert!(worst < 1e-4, "{worst:e}");
}

fn box_pose(rng: &mut Rng) -> Pose<f64> {
    Pose {
        theta_rad: between(rng, -0.25, 0.25),
        sigma_rad: between(rng, -0.25, 0.25),
        z0_m: between(rng, 0.505, 0.555),
    }
}

pub const TIP_M: Vector3<f64> = Vector3::new(0.01, -0.02, 0.3);

/// An amplitude whose size nothing bounds.
fn free(amplitude: Amplitude, deviation: f64) -> AmplitudeSettings {
    AmplitudeSettings {
        amplitude,
        accepted: 0.0,
        deviation,
        drift_per_day: 0.0,
        least: -900.0 * deviation,
        most: 900.0 * deviation,
        rate_per_s: deviation,
        alarm: 0.25 * deviation,
    }
}

/// The drives of three limbs, and the base in three directions.
fn six(deviation: f64) -> [AmplitudeSettings; 6] {
    let all = compliances();
    [0, 1, 2, 3, 4, 5].map(|n| free(all[n].0, deviation))
}

fn reading(axis: usize, read: f64, deviation: f64) -> TipReading<f64> {
    let mut direction = Vector6::zeros();
    direction[axis] = 1.0;
    TipReading { direction, read, deviation }
}

/// A dense Kalman filter of numbers in their own units.
struct Dense {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Dense {
    fn absorb(&mut self, row: &DVector<f64>, read: f64, deviation: f64) {
        let gain = &self.covariance * row / ((row.transpose() * &self.covariance * row)[0] + deviation * deviation);
        self.mean += &gain * (read - row.dot(&self.mean));
        self.covariance -= &gain * row.transpose() * &self.covariance.clone();
    }
}

#[test]
fn it_is_the_kalman_filter_and_its_u95_is_that_of_linear_propagation() {
    let mut rng = seeded();
    let mut worst = [0.0; 3];
    for _ in 0..cases(50) {
        let mut amplitudes = six(1e-9);
        amplitudes.iter_mut().for_each(|own| own.drift_per_day = 1e-10 * rng.f64());
        let settings = EstimatorSettings { amplitudes, model_share: 0.0 };
        let mut estimator = Estimator::<f64, 6>::new(&settings).unwrap();
        let mut single = Estimator::<f32, 6>::new(&settings).unwrap();
        let mut dense = Dense { mean: DVector::zeros(6), covariance: DMatrix::identity(6, 6) * 1e-18 };
        let truth = DVector::from_fn(6, |_, _| 1e-9 * normal(&mut rng));
        let names = estimator.amplitudes();
        let mut drifted_at = [0; 6];
        for day in 0..100_u32 {
            let (pose, wrench) = (box_pose(&mut rng), random_wrench(&mut rng));
            let at_a = wrench.moved_to_a(TIP_M);
            let moved = MACHINE_F64.sensitivities(&pose, &at_a, &names).unwrap();
            let rows = [0, 1, 2]
                .map(|axis| DVector::from_iterator(6, moved.iter().map(|m| m.seen_at(TIP_M).translation_m[axis])));
            let k_m = TABLE_F64.factor_form(&MACHINE_F64, &pose).unwrap().factor;
            let known = k_m.deflection(&at_a).unwrap().seen_at(TIP_M).translation_m;
            let read = [0, 1, 2].map(|axis| known[axis] + rows[axis].dot(&truth) + 1e-6 * normal(&mut rng));
            let touch = Touch { time_s: 86_400 * day, pose, tip_m: TIP_M, wrench, rise_k: 0.0 };
            let readings = [0, 1, 2].map(|axis| reading(axis, read[axis], 1e-6));
            let learned = estimator.learn(&MACHINE_F64, Some(&TABLE_F64), &touch, &readings).unwrap();
            // with what is predicted in f64, so that it is the filter's rounding that is seen
            let predicted = narrow(&k_m.deflection(&at_a).unwrap());
            let touch = Touch {
                time_s: touch.time_s,
                pose: narrow_pose(&pose),
                tip_m: TIP_M.map(|component| component as f32),
                wrench: narrow_wrench(&wrench),
                rise_k: 0.0,
            };
            let readings = readings.map(|r| TipReading {
                direction: r.direction.map(|component| component as f32),
                read: r.read as f32,
                deviation: r.deviation as f32,
            });
            single.absorb(&touch, &predicted, &moved.map(|moved| narrow(&moved)), &readings).unwrap();
            // they take turns
            if day > 0 {
                let turn = day as usize % 6;
                let own = &settings.amplitudes[turn];
                let room = own.deviation.powi(2) - dense.covariance[(turn, turn)];
                let drift = own.drift_per_day.powi(2) * f64::from(day - drifted_at[turn]);
                dense.covariance[(turn, turn)] += drift.min(room.max(0.0));
                drifted_at[turn] = day;
            }
            (0..3).for_each(|axis| dense.absorb(&rows[axis], read[axis] - known[axis], 1e-6));
            // it counts as unknown again after a change, which the dense one does not know
            assert!(!learned.changed.contains(&true));
        }
        for (n, (value, deviation)) in estimator.values().into_iter().enumerate() {
            keep_worst(&mut worst[0], (value - dense.mean[n]).abs() / 1e-9);
            keep_worst(&mut worst[0], (deviation - dense.covariance[(n, n)].sqrt()).abs() / 1e-9);
        }
        for ((value, deviation), (double, known)) in single.values().into_iter().zip(estimator.values()) {
            keep_worst(&mut worst[1], (value - double).abs().max((deviation - known).abs()) / 1e-9);
        }
        // GUM: u² = J P Jᵀ, its J by differences of the machine itself; and what is known and not compensated, squared
        estimator.follow(0.3);
        let left =
            DVector::from_iterator(6, dense.mean.iter().zip(estimator.applied()).map(|(mean, used)| mean - used));
        let (pose, wrench) = (box_pose(&mut rng), random_wrench(&mut rng));
        let at_a = wrench.moved_to_a(TIP_M);
        let moved = MACHINE_F64.sensitivities(&pose, &at_a, &names).unwrap();
        let tip = estimator.tip(&moved, TIP_M);
        for axis in 0..3 {
            let row = DVector::from_iterator(
                6,
                compliances().iter().take(6).map(|(_, place, motion)| {
                    let at = |c: f64| {
                        let effects = Effects::NONE.with_element(place, motion, "constant", [c]).unwrap();
                        let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
                        let factor = machine.stiffness(&pose).unwrap().factor().unwrap();
                        factor.deflection(&at_a).unwrap().seen_at(TIP_M).translation_m[axis]
                    };
                    (at(1e-9) - at(-1e-9)) / 2e-9
                }),
            );
            let u95 = 1.96 * ((row.transpose() * &dense.covariance * &row)[0] + row.dot(&left).powi(2)).sqrt();
            keep_worst(&mut worst[2], (tip.u95_m()[axis] / u95 - 1.0).abs());
        }
    }
    println!("f64 {:.1e}, f32 {:.1e}, u95 {:.1e}", worst[0], worst[1], worst[2]);
    assert!(worst[0] < 1e-9 && worst[1] < 1e-3 && worst[2] < 1e-6, "{worst:?}");
}

fn narrow(d: &Deflection<f64>) -> Deflection<f32> {
    Deflection::from_vector(d.to_vector().map(|component| component as f32))
}

/// Truth of a machine at some places: the structural matrix, which knows no amplitude.
pub struct Truth {
    poses: Vec<Pose<f64>>,
    /// By what limb is worn, none first: factors of the stiffness at each pose.
    factors: [Vec<Cholesky<f64, U6>>; 4],
}

/// Stiffness of a worn drive, as a share of the declared one.
const WORN: f64 = 0.9;

/// Axial compliance of a limb's platform joint, which stands for its drive.
fn drive_m_per_n(limb: usize) -> f64 {
    1.0 / PARAMETERS.limbs[limb].platform_joint.linear_n_per_m[2]
}

impl Truth {
    pub fn new(rng: &mut Rng) -> Self {
        let poses: Vec<_> = (0..40).map(|_| box_pose(rng)).collect();
        let factors = std::array::from_fn(|state| {
            let mut parameters = PARAMETERS;
            if state > 0 {
                parameters.limbs[state - 1].platform_joint.linear_n_per_m[2] *= WORN;
            }
            let factor = |pose| structural_stiffness(&parameters, pose).cholesky().expect("a stiffness");
            poses.iter().map(factor).collect()
        });
        Self { poses, factors }
    }

    /// What a load at the tip moves it by; `worn` is 0 or the number of a limb.
    fn moved(&self, worn: usize, place: usize, wrench: &Wrench<f64>) -> Vector3<f64> {
        let moved = self.factors[worn][place].solve(&wrench.moved_to_a(TIP_M).to_vector());
        Deflection::from_vector(moved).seen_at(TIP_M).translation_m
    }

    /// A press of up to 1 kN along each axis, read by three gauges.
    pub fn touch(&self, rng: &mut Rng, worn: usize, time_s: u32) -> (Touch<f64>, [TipReading<f64>; 3]) {
        let place = rng.usize(..self.poses.len());
        let force_n = Vector3::from_fn(|_, _| between(rng, -1e3, 1e3));
        let wrench = Wrench { force_n, moment_nm: Vector3::zeros() };
        let seen = self.moved(worn, place, &wrench);
        let readings = [0, 1, 2].map(|axis| reading(axis, seen[axis] + NOISE_M * normal(rng), NOISE_M));
        (Touch { time_s, pose: self.poses[place], tip_m: TIP_M, wrench, rise_k: 0.0 }, readings)
    }
}

/// Of a gauge.
const NOISE_M: f64 = 0.3e-6;

/// The drives of the three limbs, and the tool along three axes. A drive may be 20 % softer or stiffer, the others by as much.
pub fn drives() -> EstimatorSettings<6> {
    let all = compliances();
    let amplitudes = [0, 1, 2, 9, 10, 11].map(|n| {
        let compliance = drive_m_per_n(n % 3);
        AmplitudeSettings {
            drift_per_day: 0.002 * compliance,
            alarm: 0.05 * compliance,
            least: -compliance,
            most: 10.0 * compliance,
            ..free(all[n].0, 0.2 * compliance)
        }
    });
    EstimatorSettings { amplitudes, model_share: 0.0 }
}

#[test]
fn a_drive_that_is_a_tenth_softer_is_found_within_thirty_readings() {
    let runs = cases(200).max(100);
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let (mut found, mut first) = (0, Vec::new());
    for run in 0..runs {
        let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
        let limb = run % 3;
        for n in 0..230 {
            let worn = if n < 200 { 0 } else { limb + 1 };
            let (touch, readings) = truth.touch(&mut rng, worn, 600 * n);
            let _ = estimator.learn(&MACHINE_F64, None, &touch, &readings);
            let alarms = estimator.alarms();
            if alarms == [None; 6] {
                continue;
            }
            assert!(n >= 200, "false alarm {alarms:?}");
            // of the drive, and of nothing else
            if (0..6).all(|n| alarms[n].is_some() == (n == limb)) {
                found += 1;
                first.push(n - 199);
            } else {
                println!("run {run}: limb {limb} {alarms:?}");
            }
            break;
        }
    }
    first.sort_unstable();
    println!("{found} of {runs}, after readings {first:?}");
    assert!(found * 100 >= 95 * runs);
}

/// What [`Estimator::absorb`] takes for loads at some places, worked out once.
struct Known {
    touch: Touch<f64>,
    predicted: Deflection<f64>,
    sensitivities: [Deflection<f64>; 6],
}

fn known_loads(rng: &mut Rng, truth: &Truth, count: usize) -> Vec<Known> {
    let names = drives().amplitudes.map(|own| own.amplitude);
    let load = |_| {
        let (touch, _) = truth.touch(rng, 0, 0);
        let at_a = touch.wrench.moved_to_a(TIP_M);
        let predicted = MACHINE_F64.stiffness(&touch.pose).unwrap().factor().unwrap().deflection(&at_a).unwrap();
        let sensitivities = MACHINE_F64.sensitivities(&touch.pose, &at_a, &names).unwrap();
        Known { touch, predicted, sensitivities }
    };
    (0..count).map(load).collect()
}

impl Known {
    /// What a change of the amplitudes moves the tip by.
    fn moved(&self, change: &[f64; 6]) -> Vector3<f64> {
        let each = self.sensitivities.iter().zip(change);
        each.map(|(moved, change)| moved.seen_at(TIP_M).translation_m * *change).sum()
    }

    fn readings(&self, rng: &mut Rng, change: &[f64; 6]) -> [TipReading<f64>; 3] {
        let seen = self.predicted.seen_at(TIP_M).translation_m + self.moved(change);
        [0, 1, 2].map(|axis| reading(axis, seen[axis] + NOISE_M * normal(rng), NOISE_M))
    }
}

/// An estimator reads, with the amplitudes changed as they are given reading by reading. `each` is told whether it found a change.
fn read_through(
    rng: &mut Rng,
    loads: &[Known],
    changes: &[[f64; 6]],
    mut each: impl FnMut(usize, &Estimator<f64, 6>, bool),
) {
    let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
    for (n, change) in changes.iter().enumerate() {
        let load = rng.choice(loads).expect("one");
        let touch = Touch { time_s: 600 * n as u32, ..load.touch };
        let readings = load.readings(rng, change);
        let outcome = estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings);
        each(n, &estimator, outcome.is_ok_and(|learned| learned.changed.contains(&true)));
    }
}

#[test]
fn every_amplitude_that_has_changed_has_its_alarm_and_no_other() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let compliance = drive_m_per_n(0);
    for _ in 0..cases(20) {
        // a drive softer, the tool's holder stiffer
        let mut change = [0.0; 6];
        (change[1], change[4]) = (0.3 * compliance, -0.2 * compliance);
        let mut last = [None; 6];
        let changes = [&[[0.0; 6]; 60][..], &[change; 100]].concat();
        read_through(&mut rng, &loads, &changes, |n, estimator, _| {
            last = estimator.alarms();
            assert!(n >= 60 || last == [None; 6], "{last:?}");
        });
        for (n, alarm) in last.iter().enumerate() {
            assert_eq!(alarm.is_some(), change[n] != 0.0, "{n}: {last:?}");
            assert!(alarm.is_none_or(|alarm| alarm.change * change[n] > 0.0), "{alarm:?}");
        }
    }
}

#[test]
fn an_alarm_counts_its_readings_from_the_one_that_has_shown_it() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let compliance = drive_m_per_n(0);
    let worn = |share: f64| [0.0, share * compliance, 0.0, 0.0, 0.0, 0.0];
    // it wears at once, and once more while the alarm stands
    let changes = [&[worn(0.0); 60][..], &[worn(0.3); 40], &[worn(0.8); 40]].concat();
    let (mut shown, mut shown_again, mut seen) = (0, false, 0);
    read_through(&mut rng, &loads, &changes, |n, estimator, has_found| {
        let [_, alarm, ..] = estimator.alarms();
        shown_again |= n > 100 && has_found;
        if shown == 0 && estimator.changed_at()[1] > 0 {
            (shown, seen) = (estimator.readings(), n);
        }
        if let Some(alarm) = alarm {
            assert_eq!(alarm.readings, estimator.readings() - shown + 1, "reading {n}, shown at {seen}");
        }
    });
    assert!((60..80).contains(&seen) && shown_again);
    // there from the beginning: since the first
    let mut last = None;
    read_through(&mut rng, &loads, &[worn(0.3); 60], |_, estimator, _| {
        assert_eq!(estimator.changed_at(), [0; 6]);
        last = estimator.alarms()[1];
    });
    assert_eq!(last.map(|alarm| alarm.readings), Some(60));
}

#[test]
fn a_million_healthy_readings_raise_no_alarm() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
    let count = cases(1_000_000);
    let (mut refused, mut changes) = (0, 0);
    for n in 0..count {
        let load = rng.choice(&loads).expect("one");
        let touch = Touch { time_s: 600 * n as u32, ..load.touch };
        let readings = load.readings(&mut rng, &[0.0; 6]);
        match estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings) {
            Ok(learned) => changes += usize::from(learned.changed.contains(&true)),
            Err(refusal) => {
                assert_eq!(refusal, Refusal::Unexpected);
                refused += 1;
            }
        }
        assert_eq!(estimator.alarms(), [None; 6], "reading {n}");
    }
    println!("of {count}: {refused} refused, {changes} changes");
    assert!(refused <= 2 && changes <= 2, "{refused} {changes}");
}

#[test]
fn it_follows_a_drift_nearly_as_well_as_a_fit_of_the_last_two_hundred_readings() {
    const LAST: usize = 200;
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let settings = drives();
    let mut estimator = Estimator::<f64, 6>::new(&settings).unwrap();
    let mut change = [0.0; 6];
    // rows in deviations of the settings and of the noise
    let mut rows: Vec<(DVector<f64>, f64)> = Vec::new();
    let (mut own, mut batch) = (0.0, 0.0);
    for n in 0..cases(3000).max(1000) {
        let load = rng.choice(&loads).expect("one");
        let touch = Touch { time_s: 14_400 * n as u32, ..load.touch };
        for (change, of) in change.iter_mut().zip(&settings.amplitudes) {
            *change += of.drift_per_day * (14_400.0_f64 / 86_400.0).sqrt() * normal(&mut rng);
        }
        let readings = load.readings(&mut rng, &change);
        estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings).expect("taken in");
        let seen = load.predicted.seen_at(TIP_M).translation_m;
        for (axis, reading) in readings.iter().enumerate() {
            let weights = load.sensitivities.iter().zip(&settings.amplitudes);
            let weights = weights.map(|(moved, of)| moved.seen_at(TIP_M).translation_m[axis] * of.deviation / NOISE_M);
            rows.push((DVector::from_iterator(6, weights), (reading.read - seen[axis]) / NOISE_M));
        }
        if n < LAST || n % 10 > 0 {
            continue;
        }
        let (mut normal_matrix, mut right) = (DMatrix::identity(6, 6), DVector::zeros(6));
        for (row, beyond) in &rows[rows.len() - 3 * LAST..] {
            normal_matrix += row * row.transpose();
            right += row * *beyond;
        }
        let fitted = normal_matrix.cholesky().expect("definite").solve(&right);
        let values = estimator.values();
        let error = |value: &dyn Fn(usize) -> f64| {
            let off: [f64; 6] = std::array::from_fn(|n| value(n) - change[n]);
            loads.iter().step_by(10).map(|load| load.moved(&off).norm_squared()).sum::<f64>()
        };
        own += error(&|n| values[n].0);
        batch += error(&|n| fitted[n] * settings.amplitudes[n].deviation);
    }
    let ratio = (own / batch).sqrt();
    println!("error over that of the fit: {ratio:.2}");
    assert!(ratio < 2.0);
}

/// 400 days with a probing each: the nut of limb 2 wears until its drive has lost 30 % of its stiffness, and on day 250 the tool's
/// holder is put in loosely.
#[test]
fn over_a_life_it_is_never_worse_than_a_frozen_table() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
    let mut worst: f64 = 0.0;
    let (mut learned, mut frozen) = (0.0, 0.0);
    for season in 0..20 {
        let [mut own, mut none] = [0.0; 2];
        for day in 20 * season..20 * season + 20 {
            let share = 1.0 - 0.3 * f64::from(day) / 400.0;
            let mut change = [0.0; 6];
            change[1] = drive_m_per_n(1) * (1.0 / share - 1.0);
            change[3] = if day >= 250 { 3e-9 } else { 0.0 };
            let load = rng.choice(&loads).expect("one");
            let touch = Touch { time_s: 86_400 * day, ..load.touch };
            let readings = load.readings(&mut rng, &change);
            let _ = estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings);
            estimator.follow(86_400.0);
            for load in loads.iter().step_by(20) {
                let tip = estimator.tip(&load.sensitivities, TIP_M).deflection.seen_at(TIP_M).translation_m;
                let moved = load.moved(&change);
                own += (moved - tip).norm_squared();
                none += moved.norm_squared();
            }
        }
        if season > 0 {
            worst = worst.max((own / none).sqrt());
        }
        learned += own;
        frozen += none;
    }
    let ratio = (learned / frozen).sqrt();
    println!("error over that of the frozen table: {ratio:.2}, worst twenty days {worst:.2}");
    assert!(worst < 1.02 && ratio < 0.5);
}

/// Readings of any machine: each in place, load and size of its own, with a change of the machine now and then.
fn random_learning<T: Scalar>(
    rng: &mut Rng,
    run: usize,
    mut judge: impl FnMut(&EstimatorSettings<6>, [&Estimator<T, 6>; 2], f64),
) {
    let wide = |rng: &mut Rng| 10.0_f64.powf(between(rng, -1.5, 1.0));
    let mut settings = EstimatorSettings { amplitudes: six(1e-9), model_share: 0.0 };
    for own in &mut settings.amplitudes {
        own.accepted = 1e-9 * normal(rng);
        own.least = own.accepted - 1e-9 * wide(rng);
        own.most = own.accepted + 1e-9 * wide(rng);
        own.rate_per_s = 1e-9 * wide(rng);
        // within reach
        own.alarm = 0.09 * (own.most - own.accepted).max(own.accepted - own.least) * wide(rng);
        own.drift_per_day = 1e-10 * wide(rng);
    }
    let mut estimator = Estimator::<T, 6>::new(&settings).expect("in their ranges");
    let mut truth = DVector::zeros(6);
    for n in 0..60_u32 {
        if n % 20 == 0 {
            truth = DVector::from_fn(6, |_, _| 5e-9 * normal(rng));
        }
        let (pose, wrench) = (box_pose(rng), random_wrench(rng));
        let at_a = wrench.moved_to_a(TIP_M);
        let moved = MACHINE_F64.sensitivities(&pose, &at_a, &estimator.amplitudes()).expect("inside the box");
        let readings = [0, 1, 2].map(|axis| {
            let of = |m: &Deflection<f64>| m.seen_at(TIP_M).translation_m[axis];
            let read = moved.iter().zip(truth.iter()).map(|(m, x)| of(m) * x).sum::<f64>() + 1e-6 * normal(rng);
            let reading = reading(axis, read, 1e-6);
            TipReading {
                direction: reading.direction.map(T::from_f64),
                read: T::from_f64(reading.read),
                deviation: T::from_f64(reading.deviation),
            }
        });
        let to = |d: &Deflection<f64>| Deflection::from_vector(d.to_vector().map(T::from_f64));
        let touch = Touch {
            time_s: 3600 * n,
            pose: Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::ONE },
            tip_m: TIP_M.map(T::from_f64),
            wrench: Wrench::ZERO,
            rise_k: T::ZERO,
        };
        let _ = estimator.absorb(&touch, &Deflection::ZERO, &moved.each_ref().map(to), &readings);
        for _ in 0..5 {
            let before = estimator;
            let period_s = 10.0_f64.powf(between(rng, -4.0, 0.0)) + 1e-3 * run as f64;
            estimator.follow(T::from_f64(period_s));
            judge(&settings, [&before, &estimator], period_s);
        }
    }
}

/// Values stay where physics allows them to be; compensation goes to its target by no more than its rate, and not beyond it.
fn stays_within_its_settings<T: Scalar>(rounding: f64) {
    let mut rng = seeded();
    let (mut at_a_limit, mut at_the_rate, mut new, mut gated) = (0, 0, 0, [0; 2]);
    for run in 0..cases(100) {
        random_learning::<T>(&mut rng, run % 3, |settings, [before, after], period_s| {
            let values = after.values();
            let (targets, from, to) = (after.targets(), before.applied(), after.applied());
            for (n, own) in settings.amplitudes.iter().enumerate() {
                let (value, deviation) = values[n];
                let off = rounding * own.deviation.max(value.abs());
                assert!(value >= own.least - off && value <= own.most + off, "{value:e} of {own:?}");
                at_a_limit += usize::from(value <= own.least + off || value >= own.most - off);
                // what is worth compensating
                let change = value - own.accepted;
                let doubt = 4.0 * (deviation.powi(2) + (own.alarm / 5.0).powi(2));
                let worth = if change.powi(2) > doubt { change - doubt / change } else { 0.0 };
                // before the fifth reading, and the fifth after a change that came at once, no more is compensated than before
                let since = u64::from(after.readings()) + 1 - u64::from(after.changed_at()[n].max(1));
                let (is_new, had) = (since < 5, before.targets()[n]);
                let expected = if is_new { worth.clamp(had.min(0.0), had.max(0.0)) } else { worth };
                assert!((targets[n] - expected).abs() <= 10.0 * off, "{:e} for {expected:e} of {own:?}", targets[n]);
                new += usize::from(is_new && expected != worth);
                gated[usize::from(worth != 0.0)] += 1;
                // how fast
                let (step, way) = (to[n] - from[n], targets[n] - from[n]);
                let most = own.rate_per_s * period_s;
                assert!(step.abs() <= most * (1.0 + rounding) + off, "{step:e} in {period_s} s of {own:?}");
                let expected = way.clamp(-most, most);
                assert!((step - expected).abs() <= off + rounding * most, "{step:e} for {expected:e} of {own:?}");
                at_the_rate += usize::from(way.abs() > most);
            }
        });
    }
    println!("at a limit {at_a_limit}, at the rate {at_the_rate}, new {new}, withheld and compensated {gated:?}");
    assert!(at_a_limit > 100 && at_the_rate > 100 && new > 10 && gated.iter().all(|count| *count > 100));
}

#[test]
fn values_and_their_compensation_stay_within_the_settings_in_f64() {
    stays_within_its_settings::<f64>(1e-12);
}

#[test]
fn values_and_their_compensation_stay_within_the_settings_in_f32() {
    stays_within_its_settings::<f32>(1e-6);
}

#[test]
fn u95_covers_what_its_name_says() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let settings = drives();
    let (mut within, mut of_best, mut all) = (0, 0, 0);
    for _ in 0..cases(300) {
        let mut estimator = Estimator::<f64, 6>::new(&settings).unwrap();
        let change = settings.amplitudes.map(|of| of.deviation * normal(&mut rng));
        for n in 0..rng.u32(1..30) {
            let load = rng.choice(&loads).expect("one");
            let touch = Touch { time_s: 60 * n, ..load.touch };
            let readings = load.readings(&mut rng, &change);
            let _ = estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings);
        }
        estimator.follow(1e9);
        for load in loads.iter().step_by(40) {
            let tip = estimator.tip(&load.sensitivities, TIP_M);
            let off = load.moved(&change) - tip.deflection.seen_at(TIP_M).translation_m;
            within += (0..3).filter(|axis| off[*axis].abs() <= tip.u95_m()[*axis]).count();
            // by the best values, with what is known and not compensated
            let amplitudes = estimator.values().into_iter().zip(estimator.applied()).zip(&load.sensitivities);
            let left = amplitudes.fold(Vector3::zeros(), |sum, (((value, _), used), moved)| {
                sum + moved.seen_at(TIP_M).translation_m * (value - used)
            });
            let variance_m2 = tip.variance_m2 - left.component_mul(&left);
            let covers = |axis: &usize| (off - left)[*axis].powi(2) <= 1.96_f64.powi(2) * variance_m2[*axis];
            of_best += (0..3).filter(covers).count();
            all += 3;
        }
    }
    let [of_best, within] = [of_best, within].map(|count| count as f64 / f64::from(all));
    println!("covered {:.1} % of {all}, of the best values' errors {:.1} %", 100.0 * within, 100.0 * of_best);
    assert!((0.93..=0.97).contains(&of_best) && within >= of_best);
}

#[test]
fn bad_readings_between_good_ones_teach_nothing_in_either_arithmetic() {
    for lesson in pkm_faults::lessons() {
        assert!(lesson.result.is_ok(), "{lesson}");
    }
}

/// An estimator that has read a little, and the next reading.
pub fn at_work() -> (Estimator<f64, 6>, Touch<f64>, [TipReading<f64>; 3]) {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
    for n in 1..20 {
        let (touch, readings) = truth.touch(&mut rng, 0, 600 * n);
        estimator.learn(&MACHINE_F64, None, &touch, &readings).expect("taken in");
    }
    let (touch, readings) = truth.touch(&mut rng, 0, 12_000);
    (estimator, touch, readings)
}

#[test]
fn what_is_refused_moves_no_amplitude() {
    let (before, touch, readings) = at_work();
    let refused = |touch: &Touch<f64>, readings: &[TipReading<f64>]| {
        let mut estimator = before;
        let refusal = estimator.learn(&MACHINE_F64, None, touch, readings).unwrap_err();
        assert_eq!((estimator.values(), estimator.readings()), (before.values(), before.readings()), "{refusal:?}");
        refusal
    };
    let with = |change: &dyn Fn(&mut TipReading<f64>)| {
        let mut readings = readings;
        readings.iter_mut().for_each(change);
        readings
    };
    for nan in [f64::NAN, f64::INFINITY] {
        assert_eq!(refused(&touch, &with(&|r| r.read = nan)), Refusal::NotFinite);
        assert_eq!(refused(&touch, &with(&|r| r.deviation = nan)), Refusal::NotFinite);
        assert_eq!(refused(&touch, &with(&|r| r.direction[2] = nan)), Refusal::NotFinite);
        let lost = Touch { wrench: Wrench { force_n: Vector3::repeat(nan), ..touch.wrench }, ..touch };
        assert!(matches!(refused(&lost, &readings), Refusal::Model(_)));
        let lost = Touch { tip_m: Vector3::repeat(nan), ..touch };
        assert!(matches!(refused(&lost, &readings), Refusal::Model(_)));
        assert!(matches!(refused(&Touch { rise_k: nan, ..touch }, &readings), Refusal::Model(_)));
    }
    assert_eq!(refused(&touch, &with(&|r| r.deviation = 0.0)), Refusal::NotFinite);
    assert_eq!(refused(&touch, &[]), Refusal::Components);
    assert_eq!(refused(&touch, &[readings[0]; 7]), Refusal::Components);
    assert_eq!(refused(&Touch { time_s: 11_399, ..touch }, &readings), Refusal::Backwards);
    let light = Touch { wrench: Wrench { force_n: Vector3::new(0.01, 0.0, 0.0), ..Wrench::ZERO }, ..touch };
    assert_eq!(refused(&light, &with(&|r| r.read = 0.0)), Refusal::NotExcited);
    assert_eq!(refused(&touch, &with(&|r| r.read = -r.read)), Refusal::WrongSign);
    let reversed = Touch { wrench: Wrench::from_vector(-touch.wrench.to_vector()), ..touch };
    assert_eq!(refused(&reversed, &readings), Refusal::WrongSign);
    assert_eq!(refused(&touch, &with(&|r| r.read += r.read.signum() * 1e-4)), Refusal::Unexpected);
    let far = Touch { pose: Pose { z0_m: 5.0, ..touch.pose }, ..touch };
    assert!(matches!(refused(&far, &readings), Refusal::Model(_)));

    // as it is, it is taken in, and four times more; then the probe is stuck
    let mut estimator = before;
    for _ in 0..4 {
        estimator.learn(&MACHINE_F64, None, &touch, &readings).expect("taken in");
    }
    for _ in 0..300 {
        assert_eq!(estimator.learn(&MACHINE_F64, None, &touch, &readings), Err(Refusal::Stuck));
    }
    // or one of its components
    let mut estimator = before;
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let stuck = (0..400).filter(|n| {
        let (touch, mut readings) = truth.touch(&mut rng, 0, 12_000 + 600 * n);
        readings[0].read = 20e-6;
        estimator.learn(&MACHINE_F64, None, &touch, &readings) == Err(Refusal::Stuck)
    });
    assert!(stuck.count() > 350);
}

/// A channel that was never connected reads 0, which is no more what it read before than another number.
#[test]
fn a_dead_channel_is_found_as_late_whatever_it_reads() {
    let found_at = |dead: f64| {
        let mut rng = seeded();
        let truth = Truth::new(&mut rng);
        let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
        (0..20).position(|n| {
            let (touch, mut readings) = truth.touch(&mut rng, 0, 600 * n);
            readings[0].read = dead;
            estimator.learn(&MACHINE_F64, None, &touch, &readings) == Err(Refusal::Stuck)
        })
    };
    assert_eq!(found_at(0.0), found_at(1e-9));
    assert!(found_at(0.0) >= Some(4), "{:?}", found_at(0.0));
}

#[test]
fn a_reading_outside_the_box_is_taken_in_and_said_to_be_there() {
    let (_, touch, _) = at_work();
    let at_a = touch.wrench.moved_to_a(touch.tip_m);
    let domain = |theta_rad: f64| {
        let pose = Pose { theta_rad, ..touch.pose };
        let k_m = TABLE_F64.factor_form(&MACHINE_F64, &pose).unwrap().factor;
        let moved = k_m.deflection(&at_a).unwrap().seen_at(touch.tip_m).translation_m;
        let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
        let readings = [0, 1, 2].map(|axis| reading(axis, moved[axis], 1e-6));
        estimator.learn(&MACHINE_F64, Some(&TABLE_F64), &Touch { pose, ..touch }, &readings).expect("taken in").domain
    };
    assert_eq!([0.2, 0.3].map(domain), [Some(Domain::Inside), Some(Domain::Outside)]);
}

/// Neither what was learned nor an alarm goes because a sensor says what no change explains, however often.
#[test]
fn a_broken_sensor_teaches_nothing() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
    // a drive has become softer, and is known to have
    let change = [0.3 * drive_m_per_n(0), 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut read = |estimator: &mut Estimator<f64, 6>, n: usize, off_m: f64| {
        let load = rng.choice(&loads).expect("one");
        let touch = Touch { time_s: 600 * n as u32, ..load.touch };
        let readings = load.readings(&mut rng, &change).map(|r| TipReading { read: r.read + off_m, ..r });
        estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings)
    };
    for n in 0..100 {
        read(&mut estimator, n, 0.0).expect("taken in");
    }
    assert!(estimator.alarms()[0].is_some() && estimator.targets()[0] > 0.0);
    let known = |e: &Estimator<f64, 6>| (e.values(), e.targets(), e.alarms(), e.changed_at(), e.readings());
    let before = known(&estimator);
    let mut unexpected = 0;
    for n in 100..300 {
        let refusal = read(&mut estimator, n, 30e-6).expect_err("refused");
        assert!(matches!(refusal, Refusal::Unexpected | Refusal::WrongSign), "{refusal:?}");
        assert_eq!(known(&estimator), before);
        unexpected += u32::from(refusal == Refusal::Unexpected);
    }
    assert!(unexpected >= 100 && estimator.refused() == 200, "{unexpected}");
    // a sensor that is mended teaches again, and the errors before it pass for no change
    let learned = read(&mut estimator, 300, 0.0).expect("taken in");
    assert!(!learned.changed.contains(&true) && estimator.refused() == 0);
}

/// One channel of a probe is dead, or has its sign reversed, on a machine that has not changed: no amplitude has an alarm, and
/// nothing is compensated that was not before.
#[test]
fn a_dead_or_reversed_channel_is_no_change_of_the_machine() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let loads = known_loads(&mut rng, &truth, 400);
    let mut healthy = Estimator::<f64, 6>::new(&drives()).unwrap();
    for n in 0..80 {
        let load = rng.choice(&loads).expect("one");
        let readings = load.readings(&mut rng, &[0.0; 6]);
        healthy
            .absorb(&Touch { time_s: 600 * n, ..load.touch }, &load.predicted, &load.sensitivities, &readings)
            .expect("taken in");
    }
    assert_eq!((healthy.alarms(), healthy.targets()), ([None; 6], [0.0; 6]));
    let (mut taken, mut wrong) = (0, Vec::new());
    for axis in 0..3 {
        for n in 0..26 {
            let mut estimator = healthy;
            let value = 1e-6 * (10.0 * f64::from(n) - 120.0) / 2.0;
            for reading in 80..160 {
                let load = rng.choice(&loads).expect("one");
                let mut readings = load.readings(&mut rng, &[0.0; 6]);
                readings[axis].read = if n < 25 { value } else { -readings[axis].read };
                let touch = Touch { time_s: 600 * reading, ..load.touch };
                taken += u32::from(estimator.absorb(&touch, &load.predicted, &load.sensitivities, &readings).is_ok());
            }
            if estimator.alarms() != [None; 6] || estimator.targets() != [0.0; 6] {
                wrong.push((axis, n));
            }
        }
    }
    assert!(wrong.is_empty() && taken > 0, "{taken}: {wrong:?}");
}

#[test]
fn settings_are_checked() {
    let check = |change: &dyn Fn(&mut EstimatorSettings<6>)| {
        let mut settings = drives();
        change(&mut settings);
        Estimator::<f64, 6>::new(&settings).map(|_| ()).unwrap_err()
    };
    type Error = EstimatorSettingsError;
    assert_eq!(check(&|s| s.amplitudes[2].amplitude = s.amplitudes[0].amplitude), Error::Twice { amplitude: 3 });
    // a limb yields along its axis alike wherever it does
    let joint = Amplitude::compliance(Place::PlatformJoint { limb: 1 }, Motion::Axial).unwrap();
    assert_eq!(check(&|s| s.amplitudes[1].amplitude = joint), Error::Twice { amplitude: 2 });
    assert_eq!(check(&|s| s.model_share = 1.1), Error::ModelShare);
    assert_eq!(check(&|s| s.model_share = f64::NAN), Error::ModelShare);
    let wrong = |setting| Error::Amplitude { amplitude: 2, setting };
    for value in [0.0, -1e-9, f64::NAN, f64::INFINITY] {
        assert_eq!(check(&|s| s.amplitudes[1].deviation = value), wrong("deviation"));
        assert_eq!(check(&|s| s.amplitudes[1].alarm = value), wrong("alarm"));
        assert_eq!(check(&|s| s.amplitudes[1].rate_per_s = value), wrong("rate_per_s"));
    }
    assert_eq!(check(&|s| s.amplitudes[1].drift_per_day = -1e-12), wrong("drift_per_day"));
    assert_eq!(check(&|s| s.amplitudes[1].least = 1e-12), wrong("least"));
    assert_eq!(check(&|s| s.amplitudes[1].most = -1e-12), wrong("most"));
    // an alarm that could never be
    let unreachable = |s: &mut EstimatorSettings<6>| {
        let own = &mut s.amplitudes[1];
        own.alarm = (own.most - own.accepted).max(own.accepted - own.least);
    };
    assert_eq!(check(&unreachable), wrong("alarm"));
    let none = EstimatorSettings::<0> { amplitudes: [], model_share: 0.0 };
    assert_eq!(Estimator::<f64, 0>::new(&none).map(|_| ()), Err(Error::Count));
    let rise = EstimatorSettings { amplitudes: [free(Amplitude::RISE, 1.0)], model_share: 0.0 };
    assert!(Estimator::<f32, 1>::new(&rise).is_ok());
}

#[test]
fn what_is_known_ages_by_the_drift_that_is_allowed() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
    let prior = drives().amplitudes.map(|own| own.deviation);
    assert_eq!((estimator.began_s(), estimator.deviations_at(1_000_000_000)), (0, prior));
    for n in 0..20 {
        let (touch, readings) = truth.touch(&mut rng, 0, 5_000 + 600 * n);
        estimator.learn(&MACHINE_F64, None, &touch, &readings).expect("taken in");
    }
    // what is refused is no news
    let (touch, readings) = truth.touch(&mut rng, 0, 90_000);
    let spikes = readings.map(|r| TipReading { read: r.read + r.read.signum() * 1e-4, ..r });
    assert!(estimator.learn(&MACHINE_F64, None, &touch, &spikes).is_err());
    assert_eq!((estimator.began_s(), estimator.time_s()), (5_000, 16_400));
    let later = |days: u32| estimator.deviations_at(16_400 + 86_400 * days);
    for n in 0..6 {
        let (own, (_, known)) = (&drives().amplitudes[n], estimator.values()[n]);
        // their last turns were within the last six readings
        let least = known.hypot(own.drift_per_day * 5.0_f64.sqrt());
        let most = known.hypot(own.drift_per_day * (5.0_f64 + 6.0 * 600.0 / 86_400.0).sqrt());
        assert!(later(5)[n] >= least * (1.0 - 1e-12) && later(5)[n] <= most * (1.0 + 1e-12));
        assert!(
            (later(20_000)[n] - own.deviation).abs() < 1e-12 * own.deviation,
            "no more than was unknown at the start"
        );
    }
    let mut slot = [0; SLOT];
    estimator.save(1, 1, &mut slot).unwrap();
    let mut restored = Estimator::<f64, 6>::new(&drives()).unwrap();
    restored.restore(1, &slot).unwrap();
    assert_eq!((restored.began_s(), restored.deviations_at(90_000)), (5_000, estimator.deviations_at(90_000)));
}

const SLOT: usize = state_bytes(6);

#[test]
fn a_power_cut_at_any_byte_leaves_the_last_whole_state() {
    let machine = MACHINE_F64.checksum();
    let (first, touch, readings) = at_work();
    let mut second = first;
    second.learn(&MACHINE_F64, None, &touch, &readings).expect("taken in");
    second.follow(1.0);
    let (mut a, mut b, erased) = ([0; SLOT], [0; SLOT], [0xff; SLOT]);
    assert_eq!(newest(6, &erased, &erased), None);
    first.save(machine, 7, &mut a).unwrap();
    second.save(machine, 8, &mut b).unwrap();
    assert_eq!(newest(6, &a, &erased), Some((Slot::A, 7)));
    assert_eq!(newest(6, &a, &b), Some((Slot::B, 8)));
    let load = |slot: &[u8]| {
        let mut estimator = Estimator::<f64, 6>::new(&drives()).unwrap();
        let fresh = estimator;
        let restored = estimator.restore(machine, slot);
        assert!(restored.is_ok() || estimator == fresh, "a slot that is refused changes nothing");
        restored.map(|()| estimator)
    };
    assert_eq!(load(&b).unwrap().values(), second.values());
    // and all that it will say: it goes on the same
    let (mut other, mut loaded) = (second, load(&b).unwrap());
    for n in 0..30 {
        let touch = Touch { time_s: 13_000 + 600 * n, ..touch };
        let readings = readings.map(|r| TipReading { read: r.read * (1.0 + 1e-3 * f64::from(n)), ..r });
        assert_eq!(
            other.learn(&MACHINE_F64, None, &touch, &readings),
            loaded.learn(&MACHINE_F64, None, &touch, &readings)
        );
        other.follow(0.1);
        loaded.follow(0.1);
        assert_eq!((other.values(), other.applied()), (loaded.values(), loaded.applied()));
    }

    // the save over an older state, or over erased memory, ends at any byte
    let mut older = [0; SLOT];
    first.save(machine, 6, &mut older).unwrap();
    for cut in 0..SLOT {
        for rest in [&older, &erased] {
            let mut torn = *rest;
            torn[..cut].copy_from_slice(&b[..cut]);
            assert_eq!(newest(6, &a, &torn), Some((Slot::A, 7)), "cut at {cut}");
            assert_eq!(newest(6, &torn, &a), Some((Slot::B, 7)), "cut at {cut}");
        }
    }
    for bit in 0..8 * SLOT {
        let mut flipped = b;
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(load(&flipped), Err(StateError::NotWhole));
    }
    // numbers go round
    first.save(machine, u32::MAX, &mut a).unwrap();
    second.save(machine, 0, &mut b).unwrap();
    assert_eq!(newest(6, &a, &b), Some((Slot::B, 0)));
}

#[test]
fn a_state_of_another_machine_or_of_other_amplitudes_is_refused() {
    let (estimator, ..) = at_work();
    let mut slot = [0; SLOT];
    estimator.save(1, 1, &mut slot).unwrap();
    let load = |settings: &EstimatorSettings<6>, machine| {
        let before = Estimator::<f64, 6>::new(settings).unwrap();
        let mut after = before;
        let outcome = after.restore(machine, &slot);
        assert!(outcome.is_ok() || after == before, "a state that is refused moves nothing");
        outcome
    };
    assert!(load(&drives(), 1).is_ok());
    assert_eq!(load(&drives(), 2), Err(StateError::Other));
    let mut others = drives();
    others.amplitudes.swap(0, 1);
    assert_eq!(load(&others, 1), Err(StateError::Other));
    let mut units = drives();
    units.amplitudes[0].deviation *= 2.0;
    assert_eq!(load(&units, 1), Err(StateError::Other));
    assert_eq!({ estimator }.restore(1, &slot[..SLOT - 1]), Err(StateError::TooShort));
    // under narrower bounds than it was saved under
    let mut narrow = drives();
    narrow.amplitudes[0].most = 1e-3 * narrow.amplitudes[0].deviation;
    let mut bounded = Estimator::<f64, 6>::new(&narrow).unwrap();
    bounded.restore(1, &slot).unwrap();
    assert!(estimator.values()[0].0 > narrow.amplitudes[0].most, "the case is none");
    assert!(bounded.values()[0].0 <= narrow.amplitudes[0].most * (1.0 + 1e-12));
    assert_eq!(estimator.save(1, 1, &mut [0; SLOT - 1]), Err(StateError::TooShort));
}

#[test]
fn a_period_that_is_none_moves_nothing() {
    let (mut estimator, ..) = at_work();
    let applied = estimator.applied();
    assert_ne!(applied, estimator.targets());
    for period_s in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e3, 0.0] {
        estimator.follow(period_s);
        assert_eq!(estimator.applied(), applied, "{period_s}");
    }
}

/// A clock that was wrong once shows: by readings that are all refused.
#[test]
fn readings_behind_a_clock_that_was_wrong_are_counted() {
    let (mut estimator, touch, readings) = at_work();
    estimator.learn(&MACHINE_F64, None, &Touch { time_s: u32::MAX, ..touch }, &readings).expect("taken in");
    for n in 0..20 {
        let touch = Touch { time_s: 12_600 + 600 * n, ..touch };
        assert_eq!(estimator.learn(&MACHINE_F64, None, &touch, &readings), Err(Refusal::Backwards));
    }
    assert_eq!(estimator.refused(), 20);
}

/// The tip under a load, compensated by a table of the machine as it was: what remains is what was learned or was not.
#[test]
fn a_compensator_uses_what_was_learned_and_no_more_than_is_known() {
    let mut rng = seeded();
    let truth = Truth::new(&mut rng);
    let mut steady = drives();
    steady.amplitudes.iter_mut().for_each(|own| own.drift_per_day = 0.0);
    let mut estimator = Estimator::<f64, 6>::new(&steady).unwrap();
    let settings = CompensatorSettings {
        gain: 1.0,
        filter_s: 0.0,
        dead_band_n: 0.0,
        dead_band_nm: 0.0,
        stuck_s: 0.0,
        screw_rate_m_per_s: 1.0,
        wrist_rate_rad_per_s: 10.0,
        ..CompensatorSettings::DEFAULT
    };
    let pose = truth.poses[0];
    let push = Wrench { force_n: Vector3::new(300.0, -200.0, -800.0), ..Wrench::ZERO };
    let offset = |estimator: &Estimator<f64, 6>, wrench: Wrench<f64>| {
        let mut compensator = Compensator::<f64, 3>::new(&settings).unwrap();
        let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
        let offset = compensator.update(&MODEL.with_learned(estimator), &pose, TIP_M, &reading);
        assert_eq!(offset.fault, None);
        offset.joints
    };
    let plain = {
        let mut compensator = Compensator::<f64, 3>::new(&settings).unwrap();
        let reading = Reading { enabled: true, wrench: push, rise: 0.0.into() };
        compensator.update(&MODEL, &pose, TIP_M, &reading).joints
    };
    // before anything is known the deflection is greater than what is unknown of it: all of it is compensated
    assert!((offset(&estimator, push) - plain).amax() < 1e-15);
    // what is unknown of it is made greater than the deflection
    let mut doubtful = drives();
    doubtful.amplitudes.iter_mut().for_each(|own| own.deviation *= 1000.0);
    let doubtful = Estimator::<f64, 6>::new(&doubtful).unwrap();
    let share = offset(&doubtful, push).norm() / plain.norm();
    assert!(share < 0.2, "{share}");

    for n in 0..3000 {
        let (touch, readings) = truth.touch(&mut rng, 1, 600 * n);
        let _ = estimator.learn(&MACHINE_F64, None, &touch, &readings);
    }
    assert!((offset(&estimator, push) - plain).amax() < 1e-15, "it follows with its rate");
    estimator.follow(1e9);
    // what the worn drive adds to the deflection, by K_p of the two machines
    let mut worn = PARAMETERS;
    worn.limbs[0].platform_joint.linear_n_per_m[2] *= WORN;
    let worn = Machine::<f64>::new(&worn).unwrap();
    let at_a = push.moved_to_a(TIP_M);
    let added = [&worn, &MACHINE_F64].map(|machine| {
        let factor = machine.stiffness(&pose).unwrap().factor().unwrap();
        factor.deflection(&at_a).unwrap().seen_at(TIP_M).translation_m
    });
    // the screws take the tip back by as much
    let tip_at = |lengths: Vector3<f64>| {
        let pose = MACHINE_F64.forward(&ScrewLengths { q_m: lengths }).unwrap();
        let turn = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
        Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m) + turn * TIP_M
    };
    let lengths = MACHINE_F64.inverse(&pose).unwrap().q_m;
    let moved = tip_at(lengths + offset(&estimator, push)) - tip_at(lengths + plain);
    let turn = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
    let wear = turn * (added[0] - added[1]);
    let off = (moved + wear).norm() / wear.norm();

    // five axes take the same way
    let configuration = Configuration { pose, beta_rad: Vector2::new(0.3, -0.2) };
    let [five, five_worn] = [&MACHINE_F64, &worn].map(|machine| FiveAxis { machine, wrist: &WRIST_F64 });
    let reading = Reading { enabled: true, wrench: push, rise: 0.0.into() };
    let of_five = |estimator: Option<&Estimator<f64, 6>>| {
        let mut compensator = Compensator::<f64, 5>::new(&settings).unwrap();
        let offset = match estimator {
            Some(learned) => compensator.update(
                &Model::new(five.machine, &TABLE_F64).with_learned(learned),
                five.wrist,
                &configuration,
                &reading,
            ),
            None => compensator.update(&Model::new(five.machine, &TABLE_F64), five.wrist, &configuration, &reading),
        };
        assert_eq!(offset.fault, None);
        offset.joints
    };
    let plain = of_five(None);
    let fresh = Estimator::<f64, 6>::new(&drives()).unwrap();
    assert!((of_five(Some(&fresh)) - plain).amax() < 1e-15);
    assert!(of_five(Some(&doubtful)).norm() < 0.3 * plain.norm());
    let deflection = |five: &FiveAxis<'_, f64>| five.deflection(None, &configuration, &push).unwrap().translation_m;
    let wear = deflection(&five_worn) - deflection(&five);
    let joints = five.joints(&configuration).unwrap();
    let tip_at = |offset: SVector<f64, 5>| {
        let lengths = ScrewLengths { q_m: joints.lengths.q_m + offset.fixed_rows::<3>(0) };
        let joints = JointValues { lengths, beta_rad: joints.beta_rad + offset.fixed_rows::<2>(3) };
        five.forward(&joints).unwrap().1.tip_m
    };
    let moved = tip_at(of_five(Some(&estimator))) - tip_at(plain);
    let off_five = (moved + wear).norm() / wear.norm();
    println!("off by {off:.3} and {off_five:.3} of what the wear takes");
    assert!(off < 0.1 && off_five < 0.1);
}

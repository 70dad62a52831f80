//! A force sensor, the machine and a stiff workpiece in a loop with the compensator.

use std::collections::VecDeque;

use fastrand::Rng;
use nalgebra::{Matrix3, SVector, Vector2, Vector3};
use pkm_core::compensator::{
    CarriedWeight, Compensator, CompensatorSettings, Fault, Limit, LoopGain, Offset, Reading, Weight,
};
use pkm_core::kinematics::platform_axes;
use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64, WRIST_F64};
use pkm_core::{Configuration, FiveAxis, JointValues, Pose, ScrewLengths, StiffnessError, StiffnessFactor, Wrench};
use pkm_tests::{between, cases, first, seeded};

use crate::compensator::MODEL;

const FIVE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };

const TIP_M: Vector3<f64> = Vector3::new(0.01, -0.02, 0.3);
const PERIODS: usize = 1000;
const PERIOD_S: f64 = CompensatorSettings::DEFAULT.period_s;

/// Compliance of the tip in A-uvw, with the contact's force at the tip.
fn tip_compliance(factor: &StiffnessFactor<f64>, tip: Vector3<f64>) -> Matrix3<f64> {
    let column = |i: usize| {
        let mut push = Wrench::ZERO;
        push.force_n[i] = 1.0;
        factor.deflection(&push.moved_to_a(tip)).unwrap().seen_at(tip).translation_m
    };
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

fn tip_of(pose: &Pose<f64>) -> Vector3<f64> {
    let axes = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
    Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m) + axes * TIP_M
}

/// What lies between an offset that is asked for and one that is there: so many periods, then a first-order lag.
#[derive(Clone, Copy, Debug)]
struct Servo {
    periods: usize,
    lag_s: f64,
}

const IDEAL: Servo = Servo { periods: 0, lag_s: 0.0 };
/// A bandwidth of 32 Hz, and two periods on the way.
const SLOW: Servo = Servo { periods: 2, lag_s: 0.005 };

/// A tip that a program holds `pressed` into a workpiece; how the tip's offset, in the axes of the wrench, moves in the second half of
/// a run, where it ends, whether the largest offset holds it there, and a fault that there was.
struct Run {
    moves: f64,
    end: Vector3<f64>,
    is_limited: bool,
    fault: Option<Fault>,
}

/// `update` is a period of the compensator, `tip_at` where offsets of the joints take the tip; `contact` is what the workpiece says to
/// the tip, in N/m.
fn run<const JOINTS: usize>(
    rng: &mut Rng,
    servo: Servo,
    (compliance, contact, pressed): (&Matrix3<f64>, &Matrix3<f64>, Vector3<f64>),
    mut update: impl FnMut(&Reading<f64>) -> Offset<f64, JOINTS>,
    tip_at: impl Fn(&SVector<f64, JOINTS>) -> Vector3<f64>,
) -> Run {
    let equilibrium = (Matrix3::identity() + contact * compliance).try_inverse().unwrap() * contact;
    let share = PERIOD_S / (PERIOD_S + servo.lag_s);
    let mut on_the_way = VecDeque::from(vec![SVector::zeros(); servo.periods]);
    let (mut joints, mut offset) = (SVector::zeros(), Vector3::zeros());
    let (mut low, mut high) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    let (mut is_limited, mut fault) = (false, None);
    for period in 0..PERIODS {
        // on the tip, against where it is pressed
        let force = -equilibrium * (pressed + offset);
        let mut noise = || Vector3::from_fn(|_, _| between(rng, -4.0, 4.0));
        let wrench = Wrench { force_n: force + noise(), moment_nm: noise() * 0.05 };
        let asked = update(&Reading { enabled: true, wrench, rise: 0.0.into() });
        fault = fault.or(asked.fault);
        on_the_way.push_back(asked.joints);
        joints += (on_the_way.pop_front().unwrap() - joints) * share;
        offset = tip_at(&joints);
        if period >= PERIODS / 2 {
            (low, high) = (low.inf(&offset), high.sup(&offset));
            is_limited |= asked.limit == Limit::Size;
        }
    }
    Run { moves: (high - low).max(), end: offset, is_limited, fault }
}

fn run_screws(
    rng: &mut Rng,
    (settings, servo): (&CompensatorSettings, Servo),
    pose: &Pose<f64>,
    at: (&Matrix3<f64>, &Matrix3<f64>, Vector3<f64>),
) -> Run {
    let mut compensator = Compensator::<f64, 3>::new(settings).unwrap();
    let lengths = MACHINE_F64.inverse(pose).unwrap().q_m;
    let (from, axes) = (tip_of(pose), platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos()));
    let tip_at = |offset: &Vector3<f64>| {
        axes.transpose() * (tip_of(&MACHINE_F64.forward(&ScrewLengths { q_m: lengths + offset }).unwrap()) - from)
    };
    let update = |reading: &_| compensator.update(&MODEL, pose, TIP_M, reading);
    run(rng, servo, at, update, tip_at)
}

fn run_five(
    rng: &mut Rng,
    (settings, servo): (&CompensatorSettings, Servo),
    stands: &Configuration<f64>,
    at: (&Matrix3<f64>, &Matrix3<f64>, Vector3<f64>),
) -> Run {
    let mut compensator = Compensator::<f64, 5>::new(settings).unwrap();
    let (frame, joints) = (FIVE.frame(stands).unwrap(), FIVE.joints(stands).unwrap());
    let tip_at = |offset: &SVector<f64, 5>| {
        let q_m = joints.lengths.q_m + offset.fixed_rows::<3>(0);
        let beta_rad = joints.beta_rad + offset.fixed_rows::<2>(3);
        let (_, tool) = FIVE.forward(&JointValues { lengths: ScrewLengths { q_m }, beta_rad }).unwrap();
        frame.axes.transpose() * (tool.tip_m - frame.tip_m)
    };
    let update = |reading: &_| compensator.update(&MODEL, &WRIST_F64, stands, reading);
    run(rng, servo, at, update, tip_at)
}

/// Shares of what noise, and noise with dead band, may do to the loop at rest: how far the offset moves, and how far from where the
/// loop gain says it ends. Of so many runs, some may end at the largest offset instead.
#[derive(Default)]
struct Worst {
    shares: [f64; 2],
    runs: usize,
    limited: usize,
}

impl Worst {
    /// Contacts of 1e6 N/m to 1e8 N/m, all around the tip and against a wall of any direction, with a load of `size_n`.
    fn press(
        &mut self,
        rng: &mut Rng,
        (factor, tip): (&StiffnessFactor<f64>, Vector3<f64>),
        size_n: f64,
        settings: &CompensatorSettings,
        run: impl Fn(&mut Rng, (&Matrix3<f64>, &Matrix3<f64>, Vector3<f64>)) -> Run,
    ) {
        let compliance = &tip_compliance(factor, tip);
        for stiffness in [1e6, 1e7, 1e8] {
            let normal = Vector3::from([0; 3].map(|_| between(rng, -1.0, 1.0))).normalize();
            for contact in [Matrix3::identity() * stiffness, normal * normal.transpose() * stiffness] {
                let loop_matrix =
                    compliance * (Matrix3::identity() + contact * compliance).try_inverse().unwrap() * contact;
                let pressed = normal * size_n / (compliance.try_inverse().unwrap() * loop_matrix * normal).norm();
                // but for the dead band: offset = γ C f, with C f = loop_matrix (pressed + offset)
                let gain = settings.gain;
                let settled =
                    (Matrix3::identity() - gain * loop_matrix).try_inverse().unwrap() * loop_matrix * pressed * gain;
                let Run { moves, end, is_limited, fault } = run(rng, (compliance, &contact, pressed));
                let LoopGain { compliance_m_per_n, loop_gain } = LoopGain::new(factor, tip, stiffness, gain).unwrap();
                // what a force of the dead band's size, or of the noise's, does to the loop at rest
                let unit = gain * compliance_m_per_n / (1.0 - loop_gain);
                assert_eq!(fault, None);
                self.runs += 1;
                self.shares[0] = self.shares[0].max(moves / (4.0 * unit));
                let noise = (4.0 + settings.dead_band_n) * unit;
                if is_limited {
                    self.limited += 1;
                    assert!(end.norm() < settled.norm() + noise, "{end:?} is held beyond {settled:?}");
                } else {
                    self.shares[1] = self.shares[1].max((end - settled).norm() / noise);
                }
            }
        }
    }

    /// One run may end at the largest offset, and one of so many.
    fn judge(&self, poses: usize, one_in: usize) {
        let Self { shares: [moves, off], runs, limited } = self;
        println!(
            "{poses} poses, {runs} runs: of the loop's answer to the noise, the offset moves by {moves:.2}; of that and the dead band, it \
             ends within {off:.2}, but for {limited} at the largest offset"
        );
        assert!(*moves < 1.0 && *off < 1.0 && *limited <= 1 + runs / one_in);
    }
}

/// Half the filter, and the default.
fn both_filters() -> [CompensatorSettings; 2] {
    [CompensatorSettings { filter_s: 0.01, ..CompensatorSettings::DEFAULT }, CompensatorSettings::DEFAULT]
}

/// θ, σ in rad and Z0 in m, all over the box: its corners, points of edges, faces and the inside on a grid, then at random.
fn poses_of_the_box(rng: &mut Rng, random: usize) -> Vec<Pose<f64>> {
    let steps = if cases(100) < 100 { 1 } else { 3_usize };
    let at = |[i, j, k]: [f64; 3]| Pose { theta_rad: 0.2617 * i, sigma_rad: 0.2617 * j, z0_m: 0.53 + 0.03 * k };
    let grid = |n: usize| 2.0 * (n % (steps + 1)) as f64 / steps as f64 - 1.0;
    let mut poses: Vec<_> =
        (0..(steps + 1).pow(3)).map(|n| at([grid(n), grid(n / (steps + 1)), grid(n / (steps + 1).pow(2))])).collect();
    poses.extend((0..random).map(|_| at([0; 3].map(|_| between(rng, -1.0, 1.0)))));
    poses
}

/// Stable at every pose of the box for contacts of 1e6 N/m to 1e8 N/m, all around the tip or against a wall, and at rest where
/// the loop gain says; with drives that follow at once, and with slow ones.
#[test]
fn a_force_sensor_on_a_stiff_workpiece_is_stable() {
    let mut rng = seeded();
    let mut worst = Worst::default();
    let poses = poses_of_the_box(&mut rng, cases(200));
    for pose in &poses {
        let factor = TABLE_F64.factor_form(&MACHINE_F64, pose).unwrap().factor;
        for (settings, servo) in
            both_filters().iter().zip([IDEAL, SLOW]).chain(both_filters().iter().zip([SLOW, IDEAL]))
        {
            worst.press(&mut rng, (&factor, TIP_M), 400.0, settings, |rng, at| {
                run_screws(rng, (settings, servo), pose, at)
            });
        }
    }
    worst.judge(poses.len(), 1000);
}

/// The same of five axes, with the wrist anywhere that its margin from singularities allows.
#[test]
fn a_force_sensor_at_the_wrist_is_stable() {
    let mut rng = seeded();
    let mut worst = Worst::default();
    let poses = poses_of_the_box(&mut rng, cases(200));
    for pose in &poses {
        let stands = first(|| {
            let beta_rad = Vector2::new(between(&mut rng, -1.57, 1.57), between(&mut rng, -1.57, 1.57));
            let stands = Configuration { pose: *pose, beta_rad };
            (FIVE.normalised_determinant(&stands).ok()? >= 0.1).then_some(stands)
        });
        let at_a = TABLE_F64.factor_form(&MACHINE_F64, pose).unwrap().factor.stiffness();
        let factor = FIVE.tip_stiffness(&at_a, &stands).unwrap().factor().unwrap();
        let settings = &CompensatorSettings::DEFAULT;
        worst.press(&mut rng, (&factor, Vector3::zeros()), 100.0, settings, |rng, at| {
            run_five(rng, (settings, SLOW), &stands, at)
        });
    }
    worst.judge(poses.len(), 80);
}

/// A weight is no part of the loop: it moves to its own offset, and the loop is as fast and as still about it, with the same noise.
#[test]
fn a_weight_leaves_the_loop_as_it_is() {
    let mut rng = seeded();
    let settings = CompensatorSettings { max_screw_m: 5e-3, ..CompensatorSettings::DEFAULT };
    let zero = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
    let force_n = Vector3::new(600.0, -150.0, -480.0);
    let weight = Weight { force_n, centre_m: Vector3::new(0.02, -0.01, 0.1) };
    let carried = CarriedWeight::<f64, 3>::new(&MODEL, &weight, &zero, TIP_M).unwrap();
    for pose in poses_of_the_box(&mut rng, 4).iter().step_by(7) {
        let compliance = &tip_compliance(&TABLE_F64.factor_form(&MACHINE_F64, pose).unwrap().factor, TIP_M);
        let (from, axes) = (tip_of(pose), platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos()));
        let lengths = MACHINE_F64.inverse(pose).unwrap().q_m;
        let at = |offset: &Vector3<f64>| {
            axes.transpose() * (tip_of(&MACHINE_F64.forward(&ScrewLengths { q_m: lengths + offset }).unwrap()) - from)
        };
        let mut alone = Compensator::<f64, 3>::new(&settings).unwrap();
        alone.set_weight(Some(carried));
        let unloaded = Reading { enabled: true, wrench: Wrench::ZERO, rise: 0.0.into() };
        (0..PERIODS).for_each(|_| _ = alone.update(&MODEL, pose, TIP_M, &unloaded));
        // the real weight takes the tip to where it belongs
        let sags = at(&alone.joints());
        for stiffness in [1e6, 1e7, 1e8] {
            let contact = Matrix3::identity() * stiffness;
            let pressed = Vector3::new(10e-6, -5e-6, 40e-6);
            let seed = rng.u64(..);
            let [without, with] = [None, Some(carried)].map(|weight| {
                let mut compensator = Compensator::<f64, 3>::new(&settings).unwrap();
                compensator.set_weight(weight);
                let sags = if weight.is_some() { sags } else { Vector3::zeros() };
                let update = |reading: &_| compensator.update(&MODEL, pose, TIP_M, reading);
                run(&mut Rng::with_seed(seed), SLOW, (compliance, &contact, pressed), update, |o| at(o) - sags)
            });
            assert_eq!((without.fault, with.fault, with.is_limited), (None, None, false));
            let size = without.end.norm();
            assert!((with.end - without.end).norm() < 5e-3 * size, "{:?} {:?}", with.end, without.end);
            assert!((with.moves - without.moves).abs() < 5e-2 * without.moves.max(1e-3 * size));
        }
    }
}

/// The test of the test: a table twice as soft as the machine at a gain of 1 is unstable, as the loop gain says, and the largest
/// offset is what keeps it.
#[test]
fn a_loop_gain_above_one_ends_at_the_limit() {
    let mut rng = seeded();
    let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
    let factor = TABLE_F64.factor_form(&MACHINE_F64, &pose).unwrap().factor;
    let compliance = tip_compliance(&factor, TIP_M);
    let contact = Matrix3::identity() * 1e8;
    let pressed = Vector3::new(0.0, 0.0, 20e-6);
    let ends = [1.0, 0.4].map(|gain| {
        let settings = CompensatorSettings { gain, screw_rate_m_per_s: 0.1, ..CompensatorSettings::DEFAULT };
        run_screws(&mut rng, (&settings, IDEAL), &pose, (&(0.5 * compliance), &contact, pressed)).end.norm()
    });
    assert!(ends[0] > 0.3e-3 && ends[0] < 1.5e-3, "{ends:?}");
    assert!(ends[1] < 0.2e-3, "{ends:?}");
    let stiffer = LoopGain::new(&factor, TIP_M, 1e8, 1.0).unwrap().loop_gain;
    assert!(2.0 * stiffer > 1.0 && 2.0 * 0.4 * stiffer < 1.0);
}

#[test]
fn the_loop_gain_is_that_of_the_softest_direction() {
    let mut rng = seeded();
    for _ in 0..cases(1000) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let pose = Pose { theta_rad: within(0.26), sigma_rad: within(0.26), z0_m: 0.53 + within(0.03) };
        let tip = Vector3::new(within(0.2), within(0.2), 0.3 + within(0.2));
        let factor = TABLE_F64.factor_form(&MACHINE_F64, &pose).unwrap().factor;
        let softest = tip_compliance(&factor, tip).symmetric_eigenvalues().max();
        let contact = 10_f64.powf(7.0 + within(1.0));
        let found = LoopGain::new(&factor, tip, contact, 0.8).unwrap();
        assert!((found.compliance_m_per_n / softest - 1.0).abs() < 1e-12);
        let stiffer = contact * softest;
        assert!((found.loop_gain - 0.8 * stiffer / (1.0 + stiffer)).abs() < 1e-12);
        assert!(found.loop_gain < 0.8);
    }
    let factor = MACHINE_F64.stiffness(&Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 }).unwrap().factor().unwrap();
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        assert_eq!(LoopGain::new(&factor, TIP_M, bad, 0.7), Err(StiffnessError::NotFinite));
        assert!(bad == -1.0 || LoopGain::new(&factor, Vector3::new(0.0, 0.0, bad), 1e7, 0.7).is_err());
    }
}

/// What docs/commissioning.md says: under a known load a gauge at the tip reads 1 − γ (1 − dead band/F) of what it reads without the
/// compensation, and with the sensor's sign reversed as much more as it should read less; the offsets rest within their limits both times,
/// so that nothing else tells.
#[test]
fn a_gauge_at_the_tip_tells_a_reversed_sign() {
    let mut rng = seeded();
    let load_n = 200.0;
    for pose in &poses_of_the_box(&mut rng, cases(50)) {
        let factor = TABLE_F64.factor_form(&MACHINE_F64, pose).unwrap().factor;
        let (compliance, from) = (tip_compliance(&factor, TIP_M), tip_of(pose));
        let (lengths, axes) =
            (MACHINE_F64.inverse(pose).unwrap().q_m, platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos()));
        for (axis, gain) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 0.2), (axis, 0.7)]) {
            let along = Vector3::ith(axis, 1.0);
            let off = compliance[(axis, axis)] * load_n;
            let read = |sign: f64| {
                let settings = CompensatorSettings { gain, max_screw_m: 2e-3, ..CompensatorSettings::DEFAULT };
                let mut compensator = Compensator::<f64, 3>::new(&settings).unwrap();
                let wrench = Wrench { force_n: along * (sign * load_n), moment_nm: Vector3::zeros() };
                let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
                let asked = (0..PERIODS / 2).map(|_| compensator.update(&MODEL, pose, TIP_M, &reading)).last().unwrap();
                assert_eq!((asked.fault, asked.limit), (None, Limit::None), "{pose:?}, {along:?}, {gain}");
                let there = MACHINE_F64.forward(&ScrewLengths { q_m: lengths + asked.joints }).unwrap();
                off + (axes.transpose() * (tip_of(&there) - from))[axis]
            };
            let share = gain * (1.0 - CompensatorSettings::DEFAULT.dead_band_n / load_n);
            let [right, reversed] = [read(1.0), read(-1.0)].map(|on| on / off);
            assert!((right - (1.0 - share)).abs() < 0.01, "{pose:?}, {along:?}, {gain}: {right}");
            assert!((reversed - (1.0 + share)).abs() < 0.01, "{pose:?}, {along:?}, {gain}: {reversed}");
        }
    }
}

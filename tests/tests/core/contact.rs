//! A force sensor, the machine and a stiff workpiece in a loop with the compensator.

use fastrand::Rng;
use nalgebra::{Matrix3, Vector3};
use pkm_core::compensator::{Compensator, CompensatorSettings, LoopGain, Reading};
use pkm_core::kinematics::platform_axes;
use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64};
use pkm_core::{Pose, ScrewLengths, StiffnessError, StiffnessFactor, Wrench};
use pkm_tests::{between, cases, seeded};

const TIP_M: Vector3<f64> = Vector3::new(0.01, -0.02, 0.3);
const PERIODS: usize = 1000;

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

/// A tip that a program holds `pressed` into a workpiece; how the tip's offset, in A-uvw, moves in the second half of a run, and
/// where it ends.
struct Run {
    moves: f64,
    end: Vector3<f64>,
}

fn run(
    rng: &mut Rng,
    settings: &CompensatorSettings,
    pose: &Pose<f64>,
    compliance: &Matrix3<f64>,
    contact: &Matrix3<f64>,
    pressed: Vector3<f64>,
) -> Run {
    let mut compensator = Compensator::<f64, 3>::new(settings).unwrap();
    let lengths = MACHINE_F64.inverse(pose).unwrap().q_m;
    let (from, axes) = (tip_of(pose), platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos()));
    let into_a = axes.transpose();
    let equilibrium = (Matrix3::identity() + contact * compliance).try_inverse().unwrap() * contact;
    let mut offset = Vector3::zeros();
    let (mut low, mut high) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    for period in 0..PERIODS {
        // on the tip, against where it is pressed
        let force = -equilibrium * (pressed + offset);
        let mut noise = || Vector3::from_fn(|_, _| between(rng, -4.0, 4.0));
        let wrench = Wrench { force_n: force + noise(), moment_nm: noise() * 0.05 };
        let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
        let joints = compensator.update(&TABLE_F64, &MACHINE_F64, pose, TIP_M, &reading).joints;
        let q_m = lengths + joints;
        offset = into_a * (tip_of(&MACHINE_F64.forward(&ScrewLengths { q_m }).unwrap()) - from);
        if period >= PERIODS / 2 {
            (low, high) = (low.inf(&offset), high.sup(&offset));
        }
    }
    Run { moves: (high - low).max(), end: offset }
}

/// Stable at every pose of the box for contacts of 1e6 N/m to 1e8 N/m, all around the tip or against a wall, and at rest where
/// the loop gain says.
#[test]
fn a_force_sensor_on_a_stiff_workpiece_is_stable() {
    let mut rng = seeded();
    let settings = CompensatorSettings { filter_s: 0.01, ..CompensatorSettings::DEFAULT };
    let mut worst = [0.0_f64; 2];
    let steps = if cases(100) < 100 { 1 } else { 3 };
    let grid = |i: usize, centre: f64, half: f64| centre + half * (2.0 * i as f64 / steps as f64 - 1.0);
    for n in 0..(steps + 1_usize).pow(3) {
        let (i, j, k) = (n % (steps + 1), n / (steps + 1) % (steps + 1), n / (steps + 1).pow(2));
        let pose = Pose { theta_rad: grid(i, 0.0, 0.2617), sigma_rad: grid(j, 0.0, 0.2617), z0_m: grid(k, 0.53, 0.03) };
        let factor = TABLE_F64.factor_form(&MACHINE_F64, &pose).unwrap().factor;
        let compliance = tip_compliance(&factor, TIP_M);
        for stiffness in [1e6, 1e7, 1e8] {
            let normal = Vector3::from([0; 3].map(|_| between(&mut rng, -1.0, 1.0))).normalize();
            for contact in [Matrix3::identity() * stiffness, normal * normal.transpose() * stiffness] {
                let loop_matrix =
                    compliance * (Matrix3::identity() + contact * compliance).try_inverse().unwrap() * contact;
                let pressed = normal * 400.0 / (compliance.try_inverse().unwrap() * loop_matrix * normal).norm();
                // but for the dead band: offset = γ C f, with C f = loop_matrix (pressed + offset)
                let settled = |gain: f64| {
                    (Matrix3::identity() - gain * loop_matrix).try_inverse().unwrap() * loop_matrix * pressed * gain
                };
                for settings in [settings, CompensatorSettings::DEFAULT] {
                    let Run { moves, end } = run(&mut rng, &settings, &pose, &compliance, &contact, pressed);
                    let LoopGain { compliance_m_per_n, loop_gain } =
                        LoopGain::new(&factor, TIP_M, stiffness, settings.gain).unwrap();
                    // what a force of the dead band's size, or of the noise's, does to the loop at rest
                    let unit = settings.gain * compliance_m_per_n / (1.0 - loop_gain);
                    worst[0] = worst[0].max(moves / (4.0 * unit));
                    let off = (end - settled(settings.gain)).norm();
                    worst[1] = worst[1].max(off / ((4.0 + settings.dead_band_n) * unit));
                }
            }
        }
    }
    println!(
        "of the loop's answer to the noise, the offset moves by {:.2}; of that and the dead band, it ends within {:.2}",
        worst[0], worst[1]
    );
    assert!(worst[0] < 1.0 && worst[1] < 1.0, "{worst:?}");
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
        run(&mut rng, &settings, &pose, &(0.5 * compliance), &contact, pressed).end.norm()
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

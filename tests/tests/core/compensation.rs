//! The compensated tip against the loaded model in space, and the refusals.

use fastrand::Rng;
use nalgebra::{Rotation3, Vector3};
use pkm_core::machine::BodyKind;
use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS, TABLE_F64};
use pkm_core::{
    CompensationError, CycleError, Deflection, KinematicsError, Machine, MachineParameters, Pose, StiffnessError,
    Wrench,
};
use pkm_tests::single::Region;
use pkm_tests::{cases, keep_worst, random_parameters, random_pose, seeded};

/// A point of the displaced moving platform in B-xyz.
fn placed(pose: &Pose<f64>, deflection: Option<&Deflection<f64>>, mut tip: Vector3<f64>) -> Vector3<f64> {
    let a = Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m);
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), pose.theta_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pose.sigma_rad);
    if let Some(d) = deflection {
        tip += d.translation_m + d.rotation_rad.cross(&tip);
    }
    a + turn * tip
}

/// Residual displacement of the tip when the load acts at the compensated pose, relative to it. `deflection` is
/// the loaded model.
fn left(
    machine: &Machine<f64>,
    pose: &Pose<f64>,
    tip: Vector3<f64>,
    deflection: impl Fn(&Pose<f64>) -> Deflection<f64>,
) -> f64 {
    let wanted = placed(pose, None, tip);
    let bent = deflection(pose);
    let displaced = (placed(pose, Some(&bent), tip) - wanted).norm();
    let compensated = machine.compensated(pose, &bent, tip).unwrap();
    assert_eq!(machine.inverse(&compensated.pose), Ok(compensated.lengths));
    let there = compensated.pose;
    (placed(&there, Some(&deflection(&there)), tip) - wanted).norm() / displaced
}

/// The greatest such part over many cases, and how far it is from half under half the load, as second order has it.
#[derive(Default)]
struct Worst {
    left: f64,
    from_half: f64,
}

impl Worst {
    fn keep(
        &mut self,
        machine: &Machine<f64>,
        pose: &Pose<f64>,
        tip: Vector3<f64>,
        wrench: &Wrench<f64>,
        deflection: impl Fn(&Pose<f64>, &Wrench<f64>) -> Deflection<f64>,
    ) {
        let [whole, half] = [1.0, 0.5].map(|s| left(machine, pose, tip, |pose| deflection(pose, &times(wrench, s))));
        keep_worst(&mut self.left, whole);
        keep_worst(&mut self.from_half, (2.0 * half / whole - 1.0).abs());
    }

    fn assert(&self, machines: &str) {
        let Self { left, from_half } = self;
        println!("{machines}: {left:.1e} of the displacement is left; {from_half:.1e} from half under half the load");
        assert!(*left <= 1e-3, "{left:e}");
        assert!(*from_half <= 0.05, "{from_half:e}");
    }
}

fn times(wrench: &Wrench<f64>, s: f64) -> Wrench<f64> {
    Wrench { force_n: wrench.force_n * s, moment_nm: wrench.moment_nm * s }
}

fn random_wrench(rng: &mut Rng, force: f64, moment: f64) -> Wrench<f64> {
    let mut three = |size: f64| Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0));
    Wrench { force_n: three(force), moment_nm: three(moment) }
}

#[test]
fn the_loaded_tip_stands_where_the_unloaded_one_would() {
    let mut rng = seeded();
    let mut worst = Worst::default();
    for _ in 0..cases(10_000) {
        let mut within = |half: f64| half * (2.0 * rng.f64() - 1.0);
        let pose = Pose { theta_rad: within(0.26), sigma_rad: within(0.26), z0_m: 0.53 + within(0.03) };
        let tip = Vector3::new(within(0.05), within(0.05), 0.3 + within(0.1));
        let wrench = random_wrench(&mut rng, 50.0, 5.0);
        let deflection = |pose: &Pose<f64>, wrench: &Wrench<f64>| {
            TABLE_F64.cycle(&MACHINE_F64, pose, wrench, tip).unwrap().deflection
        };
        worst.keep(&MACHINE_F64, &pose, tip, &wrench, deflection);
    }
    worst.assert("reference machine, table");
}

#[test]
fn what_is_left_on_random_machines_is_of_second_order() {
    let mut rng = seeded();
    let mut worst = Worst::default();
    for _ in 0..cases(10_000) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.2);
        let l = pose.z0_m / pose.theta_rad.cos();
        let mut part = |low: f64, high: f64| l * (low + (high - low) * rng.f64());
        // ahead in the direction of BA
        let (aside, ahead) = (part(-0.2, 0.2), part(0.5, 2.0));
        let (sin, cos) = pose.sigma_rad.sin_cos();
        let tip = Vector3::new(part(-0.2, 0.2), aside * cos + ahead * sin, ahead * cos - aside * sin);
        let deflection = |pose: &Pose<f64>, wrench: &Wrench<f64>| {
            machine.stiffness(pose).unwrap().factor().unwrap().deflection(&wrench.moved_to_a(tip)).unwrap()
        };
        let wrench = random_wrench(&mut rng, 1.0, l);
        let moved = deflection(&pose, &wrench).seen_at(tip).translation_m.norm();
        worst.keep(&machine, &pose, tip, &times(&wrench, 2.5e-6 * l / moved), deflection);
    }
    worst.assert("random machines");
}

/// The cycle is its parts: with load-dependent effects too, and for another tip, another displacement.
#[test]
fn a_cycle_is_its_parts() {
    let effects = PARAMETERS.effects.with("clearance", [1e-5, 50.0, 0.0]).unwrap();
    let effects = effects.with("geometry-a2", [1e-4]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    let wrench = Wrench { force_n: Vector3::new(100.0, -50.0, -400.0), moment_nm: Vector3::new(2.0, -8.0, 5.0) };
    let tip = Vector3::new(0.01, -0.02, 0.3);
    let cycle = TABLE_F64.cycle(&machine, &pose, &wrench, tip).unwrap();
    let at_a = wrench.moved_to_a(tip);
    let beyond = machine.load_dependent_deflection(&pose, &at_a, &Wrench::ZERO).unwrap();
    let corrected = TABLE_F64.factor_form(&machine, &pose).unwrap();
    assert!(beyond.translation_m.z != 0.0);
    assert_eq!(cycle.lengths, machine.inverse(&pose).unwrap());
    assert_eq!(cycle.corrected, corrected);
    assert_eq!(cycle.deflection, corrected.factor.deflection(&at_a).unwrap().plus(&beyond));
    assert_eq!(cycle.compensated, machine.compensated(&pose, &cycle.deflection, tip).unwrap());
}

#[test]
fn refusals_are_typed() {
    let pose = Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.53 };
    let tip = Vector3::new(0.0, 0.0, 0.3);
    let small = Deflection { translation_m: Vector3::repeat(1e-5), rotation_rad: Vector3::repeat(1e-5) };
    let compensated = |deflection: &Deflection<f64>, tip| MACHINE_F64.compensated(&pose, deflection, tip);
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(compensated(&small, Vector3::new(0.0, bad, 0.3)), Err(CompensationError::NotFinite));
        let broken = Deflection { rotation_rad: Vector3::new(0.0, bad, 0.0), ..small };
        assert_eq!(compensated(&broken, tip), Err(CompensationError::NotFinite));
    }
    // the tip in the plane of A (determinant 1e-3 of L² at 0.53 mm), and in that of B
    let l = pose.z0_m / pose.theta_rad.cos();
    for w in [0.0, 9e-4 * l, -9e-4 * l, -l, -0.9995 * l] {
        assert_eq!(compensated(&small, Vector3::new(0.1, 0.1, w)), Err(CompensationError::Singular), "{w}");
    }
    for w in [1.1e-3 * l, -1.2e-3 * l, 0.3] {
        assert!(compensated(&small, Vector3::new(0.1, 0.1, w)).is_ok(), "{w}");
    }
    // a hundredth of |AB| is the most that is made up for, however it comes about
    let sunk = |m: f64| Deflection { translation_m: Vector3::new(0.0, 0.0, -m), rotation_rad: Vector3::zeros() };
    let turned = |rad: f64| Deflection { rotation_rad: Vector3::new(rad, 0.0, 0.0), translation_m: Vector3::zeros() };
    assert!(compensated(&sunk(0.00999 * l), tip).is_ok() && compensated(&turned(0.00999 * l / 0.3), tip).is_ok());
    for far in [sunk(0.01001 * l), turned(0.01001 * l / 0.3), sunk(-0.5), sunk(1e200)] {
        assert_eq!(compensated(&far, tip), Err(CompensationError::TooFar), "{far:?}");
    }
    let error = KinematicsError::OutOfTravel { limb: 1 };
    let reached = |z0_m: &f64| MACHINE_F64.inverse(&Pose { z0_m: *z0_m, ..pose }).is_ok();
    let last = (0..).map(|mm| 0.53 + 1e-3 * f64::from(mm)).take_while(reached).last().unwrap();
    let beyond = MACHINE_F64.compensated(&Pose { z0_m: last, ..pose }, &sunk(2e-3), tip);
    assert_eq!(beyond, Err(CompensationError::Kinematics(error)));

    let push = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), moment_nm: Vector3::zeros() };
    let cycle = |pose: &Pose<f64>, wrench: &Wrench<f64>, tip| TABLE_F64.cycle(&MACHINE_F64, pose, wrench, tip);
    let far = Pose { z0_m: 0.9, ..pose };
    assert_eq!(cycle(&far, &push, tip), Err(error.into()));
    let broken = Wrench { force_n: Vector3::repeat(f64::NAN), ..push };
    assert_eq!(cycle(&pose, &broken, tip), Err(StiffnessError::NotFinite.into()));
    assert_eq!(cycle(&pose, &push, Vector3::zeros()), Err(CycleError::Compensation(CompensationError::Singular)));
    // a load in millinewtons, or a sensor's full scale
    let crash = Wrench { force_n: Vector3::new(4e5, 0.0, 0.0), ..push };
    assert_eq!(cycle(&pose, &crash, tip), Err(CycleError::Compensation(CompensationError::TooFar)));
}

#[test]
fn a_cycle_in_single_precision() {
    let mut rng = seeded();
    for region in [Region::Box, Region::Machines, Region::Wide, Region::Edge] {
        let mut found: [Vec<f64>; 4] = Default::default();
        let mut of_condition = 0.0_f64;
        for _ in 0..cases(10_000) {
            let case = region.draw(&mut rng);
            let bound = Region::bound(case.condition);
            let Some(errors) = case.errors else {
                assert!(bound >= 1.0, "{region:?}: f32 refuses {case:?}");
                continue;
            };
            let length_m = if region == Region::Box { 1.0 } else { case.longest_screw_m };
            let relative = errors.relative_to(length_m);
            for (found, error) in found.iter_mut().zip(relative) {
                found.push(error);
            }
            assert!(errors.lengths_m <= Region::LENGTHS * case.longest_screw_m, "{region:?}: {case:?}");
            if bound < 1.0 {
                keep_worst(&mut of_condition, errors.k_m / bound);
                keep_worst(&mut of_condition, errors.deflection / bound);
                assert!(of_condition <= 1.0, "{region:?}: {case:?}");
            }
        }
        let [worst, most] = [1.0, 0.99].map(|share| {
            found.each_mut().map(|errors| {
                errors.sort_by(f64::total_cmp);
                errors[((errors.len() - 1) as f64 * share) as usize]
            })
        });
        println!("f32 cycle, {region:?}: worst {worst:?}, 99 % {most:?}, {of_condition:.2} of what κ allows");
        let within = |errors: [f64; 4], bounds: [f64; 4]| errors.iter().zip(bounds).all(|(e, b)| *e <= b);
        match region {
            Region::Box => assert!(within(worst, Region::IN_BOX), "{worst:?}"),
            Region::Machines => assert!(within(most, Region::MOST_MACHINES), "{most:?}"),
            Region::Wide | Region::Edge => {}
        }
    }
}

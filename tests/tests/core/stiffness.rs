//! Basic stiffness against the dense 24×24 of Eq. 8.

use nalgebra::{Matrix6, Vector3};
use pkm_core::effects::Effects;
use pkm_core::machine::{BodyKind, MachineParameters, Travel};
use pkm_core::tables::reference::PARAMETERS;
use pkm_core::{Deflection, Machine, Pose, Stiffness, StiffnessError, Wrench};
use pkm_tests::single::narrow_pose;
use pkm_tests::{cases, keep_worst, random_parameters, random_pose, scaled_difference, seeded, structural_stiffness};

#[test]
fn transmitted_wrenches_equal_the_structural_matrix() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for n in 0..cases(10_000) {
        let kind = if n % 2 == 0 { BodyKind::Beam } else { BodyKind::Diagonal };
        let parameters = random_parameters(&mut rng, kind);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.05);
        let k = machine.stiffness(&pose).unwrap();
        let reference = structural_stiffness(&parameters, &pose);
        keep_worst(&mut worst, scaled_difference(&k.matrix(), &reference));
        assert!(k.factor().is_ok(), "not positive definite at {pose:?} of {parameters:?}");
        assert!(worst <= 1e-13, "{worst:e} at {pose:?} of {parameters:?}");
    }
    println!("K_p against 24x24: {worst:.1e}");
}

/// Wrenches, compliance and frames of single limbs: their sum is K_p, an axial force acts along B_i A_i through both joints.
#[test]
fn transmitted_wrenches_one_by_one_make_up_the_structural_matrix() {
    let mut rng = seeded();
    for n in 0..cases(2_000) {
        let kind = if n % 2 == 0 { BodyKind::Beam } else { BodyKind::Diagonal };
        let parameters = random_parameters(&mut rng, kind);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.05);
        let t = machine.transmission(&pose).unwrap();
        let h = t.wrenches;
        let d = nalgebra::SMatrix::<f64, 8, 8>::from_fn(|i, j| t.compliance[(i.max(j), i.min(j))]);
        let k = h * d.cholesky().unwrap().solve(&h.transpose());
        let difference = scaled_difference(&k, &structural_stiffness(&parameters, &pose));
        assert!(difference <= 1e-11, "{difference:e} at {pose:?} of {parameters:?}");
        let lengths = machine.inverse(&pose).unwrap().q_m;
        for (limb, first) in t.limbs.iter().zip([0, 3, 6]) {
            let [base, platform] = limb.joints_m;
            let along = platform - base;
            let w = t.wrenches.column(first);
            let (force, moment) = (w.fixed_rows::<3>(0), w.fixed_rows::<3>(3));
            assert!((along.norm() - limb.length_m).abs() < 1e-12 && lengths.as_slice().contains(&limb.length_m));
            assert!((along / limb.length_m - force).norm() < 1e-12);
            assert!((moment - platform.cross(&force)).norm() < 1e-12);
            assert!((limb.axes[1].column(2) - force).norm() < 1e-12);
        }
    }
}

/// A machine seen in a mirror has limbs 1 and 2 exchanged and the other σ; one of another size has the stiffness of that size.
#[test]
fn mirrored_and_scaled_machines_have_mirrored_and_scaled_stiffness() {
    let mut rng = seeded();
    let mut worst = [0.0_f64; 2];
    for n in 0..cases(10_000) {
        let kind = if n % 2 == 0 { BodyKind::Beam } else { BodyKind::Diagonal };
        let parameters = random_parameters(&mut rng, kind);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.05);
        let k = machine.stiffness(&pose).unwrap().matrix();

        let mut mirrored = parameters;
        mirrored.limbs.swap(0, 1);
        let there = Pose { sigma_rad: -pose.sigma_rad, ..pose };
        let found = Machine::<f64>::new(&mirrored).unwrap().stiffness(&there).unwrap().matrix();
        let sign = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
        let expected = Matrix6::from_fn(|i, j| sign[i] * k[(i, j)] * sign[j]);
        keep_worst(&mut worst[0], scaled_difference(&found, &expected));

        // Young's modulus stays; a length in place of 1 in N/m, a volume in N·m/rad
        let s = 0.1 * 100_f64.powf(rng.f64());
        let mut scaled = parameters;
        let g = &mut scaled.geometry;
        for length in [&mut g.a1_m, &mut g.a2_m, &mut g.b1_m, &mut g.b2_m] {
            *length *= s;
        }
        for limb in &mut scaled.limbs {
            for joint in [&mut limb.base_joint, &mut limb.platform_joint] {
                joint.linear_n_per_m = joint.linear_n_per_m.map(|k| k * s);
                joint.angular_nm_per_rad = joint.angular_nm_per_rad.map(|k| k * s.powi(3));
            }
            for tube in [&mut limb.body.rod, &mut limb.body.screw] {
                (tube.outer_m, tube.inner_m) = (tube.outer_m * s, tube.inner_m * s);
            }
        }
        let there = Pose { z0_m: pose.z0_m * s, ..pose };
        let found = Machine::<f64>::new(&scaled).unwrap().stiffness(&there).unwrap().matrix();
        let size = |i: usize| if i < 3 { 1.0 } else { s };
        let expected = Matrix6::from_fn(|i, j| size(i) * k[(i, j)] * size(j) * s);
        keep_worst(&mut worst[1], scaled_difference(&found, &expected));
    }
    println!("mirrored {:.1e}, scaled {:.1e}", worst[0], worst[1]);
    assert!(worst.iter().all(|w| *w <= 1e-12), "{worst:?}");
}

/// Worst scaled difference of f32 from f64 over random machines with the given effects.
fn single_precision(effects: Effects) -> f64 {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for n in 0..cases(10_000) {
        let kind = if n % 2 == 0 { BodyKind::Beam } else { BodyKind::Diagonal };
        let parameters = MachineParameters { effects, ..random_parameters(&mut rng, kind) };
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.05);
        let narrow = narrow_pose(&pose);
        let k = Machine::<f32>::new(&parameters).unwrap().stiffness(&narrow).unwrap().matrix();
        keep_worst(&mut worst, scaled_difference(&k.cast(), &machine.stiffness(&pose).unwrap().matrix()));
    }
    worst
}

#[test]
fn single_precision_stays_near_double() {
    let basic = single_precision(Effects::NONE);
    let in_series = Effects::NONE.with("base-compliance", [1e-9, 1e-6, 1e-9]);
    let in_series = in_series.and_then(|e| e.with("wrist-compliance", [1e-9, 1e-6, 0.0])).unwrap();
    let in_series = single_precision(in_series);
    let preload = Effects::NONE.with("preload", [100.0, 50.0, 0.0]);
    let beside = preload.and_then(|e| e.with("platform-offset", [5e-3, -5e-3, 0.0])).unwrap();
    let beside = single_precision(beside);
    println!("f32 K_p against f64: {basic:.1e}, in series {in_series:.1e}, preload and offset {beside:.1e}");
    assert!(basic <= 2e-5, "{basic:e}");
    assert!(in_series <= 1e-3, "{in_series:e}");
    assert!(beside <= 2e-5, "{beside:e}");
}

#[test]
fn single_precision_with_wrong_sizes_stays_near_double_in_the_box() {
    let mut effects = Effects::NONE;
    for (id, error) in [("geometry-a1", 3e-4), ("geometry-a2", -1e-3), ("geometry-b1", -2e-4), ("geometry-b2", 1e-3)] {
        effects = effects.with(id, [error, 0.0, 0.0]).unwrap();
    }
    let parameters = MachineParameters { effects, ..pkm_core::tables::reference::PARAMETERS };
    let (double, single) = (Machine::<f64>::new(&parameters).unwrap(), Machine::<f32>::new(&parameters).unwrap());
    let mut rng = seeded();
    let mut within = |middle: f64, half: f64| middle + half * (2.0 * rng.f64() - 1.0);
    let mut worst = 0.0_f64;
    for _ in 0..cases(10_000) {
        let pose = Pose { theta_rad: within(0.0, 0.26), sigma_rad: within(0.0, 0.26), z0_m: within(0.53, 0.03) };
        let narrow = narrow_pose(&pose);
        let k = single.stiffness(&narrow).unwrap().matrix().cast::<f64>();
        keep_worst(&mut worst, scaled_difference(&k, &double.stiffness(&pose).unwrap().matrix()));
    }
    println!("f32 K_p with wrong sizes against f64: {worst:.1e}");
    assert!(worst <= 2e-5, "{worst:e}");
}

#[test]
fn deflection_solves_the_stiffness() {
    let mut rng = seeded();
    for _ in 0..cases(1000) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.1);
        let k = machine.stiffness(&pose).unwrap();
        let wrench = Wrench { force_n: Vector3::new(100.0, -50.0, 700.0), moment_nm: Vector3::new(3.0, 20.0, -8.0) };
        let d = k.factor().unwrap().deflection(&wrench).unwrap();
        let x = d.to_vector();
        let load = wrench.to_vector();
        for (row, f) in k.matrix().row_iter().zip(&load) {
            let sum: f64 = row.iter().zip(&x).map(|(k, x)| k * x).sum();
            let size: f64 = row.iter().zip(&x).map(|(k, x)| (k * x).abs()).sum();
            assert!((sum - f).abs() <= 1e-12 * size, "{sum} instead of {f}");
        }
        // by virtual work, whatever point the load is given at
        let at = Vector3::new(0.1, -0.2, 0.3);
        let seen = d.seen_at(at);
        let moved = wrench.moved_to_a(at);
        let work = |w: &Wrench<f64>, d: &Deflection<f64>| w.to_vector().dot(&d.to_vector());
        let (there, here) = (work(&wrench, &seen), work(&moved, &d));
        assert!((there - here).abs() <= 1e-9 * there.abs().max(here.abs()), "{there} {here}");
    }
}

#[test]
fn failures_are_typed() {
    let mut k = Matrix6::identity();
    let factor = Stiffness::from_lower(&k).factor().unwrap();
    let mut above = k;
    above[(0, 5)] = f64::NAN;
    assert_eq!(Stiffness::from_lower(&above).factor(), Ok(factor));
    let wrench = Wrench { force_n: Vector3::new(f64::NAN, 0.0, 0.0), moment_nm: Vector3::zeros() };
    assert_eq!(factor.deflection(&wrench), Err(StiffnessError::NotFinite));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut indefinite = k;
        indefinite[(4, 4)] = bad;
        let result = Stiffness::from_lower(&indefinite).factor();
        assert_eq!(result, Err(StiffnessError::NotPositiveDefinite), "{bad}");
    }
    k[(5, 0)] = 2.0;
    assert_eq!(Stiffness::from_lower(&k).factor(), Err(StiffnessError::NotPositiveDefinite));
    // platforms so small that squares of their levers are no numbers of f32
    let mut parameters = PARAMETERS;
    let g = &mut parameters.geometry;
    (g.a1_m, g.a2_m, g.b1_m, g.b2_m) = (1e-28, 1e-28, 1e-28, 1e-28);
    parameters.travel = Travel { min_m: [0.1; 3], max_m: [10.0; 3] };
    let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 1.0 };
    let slim = Machine::<f32>::new(&parameters).unwrap();
    assert_eq!(slim.stiffness(&pose), Err(StiffnessError::NotPositiveDefinite));
}

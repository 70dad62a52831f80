//! Inverse and forward kinematics on random machines, against geometry in space and check points.

use nalgebra::Vector3;
use pkm_core::machine::BodyKind;
use pkm_core::tables::reference;
use pkm_core::{KinematicsError, Machine, Pose, ScrewLengths};
use pkm_tests::{cases, distance, keep_worst, random_parameters, random_pose, seeded, space};

const MACHINES: usize = 100_000;

#[test]
fn forward_and_inverse_undo_each_other_on_random_machines() {
    let mut rng = seeded();
    let (mut worst_pose, mut worst_lengths, mut worst_geometry) = (0.0_f64, 0.0_f64, 0.0_f64);
    for _ in 0..cases(MACHINES) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let pose = random_pose(&mut rng, &machine, size, 0.05);
        let lengths = machine.inverse(&pose).unwrap();
        let points = space(&parameters.geometry, &pose);
        for i in 0..3 {
            let q = f64::from(distance(&points.platform[i], &points.base[i]));
            keep_worst(&mut worst_geometry, (lengths.q_m[i] / q - 1.0).abs());
        }
        // the working mode for every one: another assembly would be far from `pose`
        let back = machine.forward(&lengths).unwrap_or_else(|e| panic!("{e} at {pose:?} of {parameters:?}"));
        let l = pose.z0_m / pose.theta_rad.cos();
        for error in [back.theta_rad - pose.theta_rad, back.sigma_rad - pose.sigma_rad, (back.z0_m - pose.z0_m) / l] {
            keep_worst(&mut worst_pose, error.abs());
        }
        let again = machine.inverse(&back).unwrap();
        for i in 0..3 {
            keep_worst(&mut worst_lengths, (again.q_m[i] / lengths.q_m[i] - 1.0).abs());
        }
    }
    println!("FK(IK) {worst_pose:.1e}, IK(FK) {worst_lengths:.1e}, IK against space {worst_geometry:.1e}");
    assert!(worst_pose <= 1e-12, "FK(IK) differs by {worst_pose:e}");
    assert!(worst_lengths <= 1e-12, "IK(FK) differs by {worst_lengths:e}");
    assert!(worst_geometry <= 1e-12, "IK differs from space by {worst_geometry:e}");
}

#[test]
fn sine_and_cosine_in_f32() {
    let mut worst = 0.0_f64;
    let right_angle = core::f32::consts::FRAC_PI_2;
    let steps = cases(1_000_000) as i32;
    for n in -steps..=steps {
        let angle = right_angle * n as f32 / steps as f32;
        let (sin, cos) = <f32 as pkm_core::Scalar>::sin_cos(angle);
        for (found, exact) in [(sin, f64::from(angle).sin()), (cos, f64::from(angle).cos())] {
            let unit = f64::from((exact.abs() as f32).next_up()) - f64::from(exact.abs() as f32);
            keep_worst(&mut worst, (f64::from(found) - exact).abs() / unit);
        }
    }
    println!("f32 sine and cosine: {worst:.2} units in the last place");
    assert!(worst <= 1.5, "{worst}");
    let beyond = <f32 as pkm_core::Scalar>::sin_cos(2.0);
    assert_eq!(beyond, (2.0_f64.sin() as f32, 2.0_f64.cos() as f32));
    assert!(<f32 as pkm_core::Scalar>::sin_cos(f32::NAN).0.is_nan());
}

#[test]
fn forward_in_f32_returns_the_pose() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(MACHINES / 10) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.2);
        let narrow = Machine::<f32>::new(&parameters).unwrap();
        let q = machine.inverse(&pose).unwrap().q_m.map(|q| q as f32);
        let back = narrow.forward(&ScrewLengths { q_m: q }).unwrap();
        keep_worst(&mut worst, (f64::from(back.theta_rad) - pose.theta_rad).abs());
        keep_worst(&mut worst, (f64::from(back.sigma_rad) - pose.sigma_rad).abs());
        keep_worst(&mut worst, (f64::from(back.z0_m) - pose.z0_m).abs() * pose.theta_rad.cos() / pose.z0_m);
    }
    println!("f32 FK {worst:.1e}");
    assert!(worst <= 1e-4, "f32 FK differs by {worst:e}");
}

#[test]
fn jacobian_is_the_derivative_of_inverse() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(1000) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let g = parameters.geometry;
        let pose = random_pose(&mut rng, &machine, g.a1_m + g.b1_m, 0.1);
        let jacobian = machine.jacobian(&pose).unwrap();
        let moved = |column: usize, by: f64| {
            let mut p = pose;
            *[&mut p.theta_rad, &mut p.sigma_rad, &mut p.z0_m][column] += by;
            machine.inverse(&p).unwrap().q_m
        };
        let l = pose.z0_m / pose.theta_rad.cos();
        for column in 0..3 {
            let step = if column == 2 { 1e-6 * l } else { 1e-6 };
            let (ahead, behind) = (moved(column, step), moved(column, -step));
            for limb in 0..3 {
                let numeric = (ahead[limb] - behind[limb]) / (2.0 * step);
                let unit = if column == 2 { 1.0 } else { l };
                keep_worst(&mut worst, (jacobian[(limb, column)] - numeric).abs() / unit);
            }
        }
        // the Jacobian's determinant for (θ, σ, L), L = Z0 / cos θ
        let q = machine.inverse(&pose).unwrap().q_m;
        let (st, ct) = pose.theta_rad.sin_cos();
        let (ss, cs) = pose.sigma_rad.sin_cos();
        let expected = 2.0 * g.a1_m * g.b2_m * (l * l * cs - g.a1_m * g.b1_m * ss * ss) * (l * ct - g.a2_m * st)
            / (q[0] * q[1] * q[2])
            / ct;
        let determinant = jacobian.determinant();
        assert!((determinant / expected - 1.0).abs() < 1e-9, "determinant {determinant}, expected {expected}");
    }
    assert!(worst <= 1e-7, "Jacobian differs from central differences by {worst:e}");
}

#[test]
fn refusals_are_typed() {
    let mut parameters = random_parameters(&mut fastrand::Rng::with_seed(1), BodyKind::Beam);
    parameters.geometry = pkm_core::machine::Geometry { a1_m: 0.18, a2_m: 0.22, b1_m: 0.35, b2_m: 0.38 };
    let wide = Machine::<f64>::new(&parameters).unwrap();
    parameters.travel = pkm_core::machine::Travel { min_m: [0.42; 3], max_m: [0.77; 3] };
    let machine = Machine::<f64>::new(&parameters).unwrap();
    let pose = |theta_rad: f64, sigma_rad: f64, z0_m: f64| Pose { theta_rad, sigma_rad, z0_m };

    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for p in [pose(bad, 0.0, 0.5), pose(0.0, bad, 0.5), pose(0.0, 0.0, bad)] {
            assert_eq!(machine.inverse(&p), Err(KinematicsError::NotFinite));
            assert_eq!(machine.jacobian(&p), Err(KinematicsError::NotFinite));
        }
        let q = ScrewLengths { q_m: Vector3::new(0.5, bad, 0.5) };
        assert_eq!(machine.forward(&q), Err(KinematicsError::NotFinite));
    }
    assert_eq!(machine.inverse(&pose(0.0, 0.0, 0.9)), Err(KinematicsError::OutOfTravel { limb: 1 }));
    // an end of travel that is as good as none leaves the other one where it is
    parameters.travel.max_m = [1e9; 3];
    let endless = Machine::<f64>::new(&parameters).unwrap();
    let low = pose(0.0, 0.0, 0.38);
    let margin_m = endless.travel_margin_m(&wide.inverse(&low).unwrap()).unwrap();
    assert!(margin_m.0 < -1e-3, "{margin_m:?}");
    assert_eq!(endless.inverse(&low), Err(KinematicsError::OutOfTravel { limb: margin_m.1 }));
    parameters.travel.max_m = [1e3; 3];
    let single = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.38_f32 };
    let error = Machine::<f32>::new(&parameters).unwrap().inverse(&single).map(|_| ());
    assert_eq!(error, Err(KinematicsError::OutOfTravel { limb: margin_m.1 }));
    assert_eq!(machine.inverse(&pose(0.0, 0.0, -0.5)), Err(KinematicsError::Unreachable));
    assert_eq!(machine.inverse(&pose(1.6, 0.0, 0.5)), Err(KinematicsError::Unreachable));
    // limb 3 in line with B–A3: tan θ = L / a2
    let theta = (0.5_f64 / 0.22).atan();
    let singular = |theta: f64| wide.inverse(&pose(theta, 0.0, 0.5 * theta.cos()));
    assert_eq!(singular(theta), Err(KinematicsError::Singular));
    assert!(singular(theta - 0.01).is_ok());
    assert_eq!(singular(theta + 0.01), Err(KinematicsError::Unreachable));
    // limbs 1 and 2: L² cos σ = a1 b1 sin² σ
    let sigma = 1.2_f64;
    let l = (0.18 * 0.35 * sigma.sin().powi(2) / sigma.cos()).sqrt();
    assert_eq!(wide.inverse(&pose(0.0, sigma, l)), Err(KinematicsError::Singular));
    assert!(wide.inverse(&pose(0.0, sigma, 1.02 * l)).is_ok());
    // lengths within travel that don't close
    let open = ScrewLengths { q_m: Vector3::new(0.42, 0.77, 0.5) };
    assert_eq!(machine.forward(&open), Err(KinematicsError::Unreachable));
    let long = ScrewLengths { q_m: Vector3::new(0.5, 0.5, 0.78) };
    assert_eq!(machine.forward(&long), Err(KinematicsError::OutOfTravel { limb: 3 }));
    parameters.travel.max_m[0] = 1e20;
    let endless = Machine::<f64>::new(&parameters).unwrap();
    let negative = ScrewLengths { q_m: Vector3::new(0.57, -0.57, 0.52) };
    assert_eq!(endless.forward(&negative), Err(KinematicsError::OutOfTravel { limb: 2 }));
}

#[test]
fn travel_margin_names_the_nearest_limit() {
    let mut parameters = random_parameters(&mut fastrand::Rng::with_seed(2), BodyKind::Beam);
    parameters.travel = pkm_core::machine::Travel { min_m: [0.42; 3], max_m: [0.77; 3] };
    let machine = Machine::<f64>::new(&parameters).unwrap();
    let (margin, limb) = machine.travel_margin_m(&ScrewLengths { q_m: Vector3::new(0.5, 0.6, 0.76) }).unwrap();
    assert!((margin - 0.01).abs() < 1e-12 && limb == 3, "{margin} {limb}");
    let (margin, limb) = machine.travel_margin_m(&ScrewLengths { q_m: Vector3::new(0.4, 0.6, 0.76) }).unwrap();
    assert!((margin + 0.02).abs() < 1e-12 && limb == 1, "{margin} {limb}");
    for limb in 0..3 {
        let mut q_m = Vector3::new(0.5, 0.6, 0.7);
        q_m[limb] = f64::NAN;
        assert_eq!(machine.travel_margin_m(&ScrewLengths { q_m }), Err(KinematicsError::NotFinite), "limb {limb}");
    }
}

/// Rounding is allowed for by each limb's own length: a long limb 1 must not let the others out of their travel.
#[test]
fn each_limb_has_the_slack_of_its_own_length() {
    let mut parameters = reference::PARAMETERS;
    parameters.travel.max_m = [1e3, 0.6, 0.77];
    let machine = Machine::<f32>::new(&parameters).unwrap();
    let at = |q2: f32| machine.forward(&ScrewLengths { q_m: Vector3::new(0.59, q2, 0.55) });
    assert!(at(0.6).is_ok() && at(0.600_004).is_ok());
    assert_eq!(at(0.6001), Err(KinematicsError::OutOfTravel { limb: 2 }));
}

//! A set follows from its seed, shows what it is meant to show, and its λ is what it says.

use super::*;

#[test]
fn everything_follows_from_the_seed() {
    for kind in [Kind::None, Kind::Two, Kind::Declared, Kind::Outside, Kind::LoadErrors] {
        let [a, b] = [0, 1].map(|_| Set::new(kind, 7, &SetOptions::default()).unwrap());
        assert_eq!((a.truth(), a.readings), (b.truth(), b.readings));
    }
    let [a, b] = [7, 8].map(|seed| Set::new(Kind::None, seed, &SetOptions::default()).unwrap());
    assert_ne!(a.readings[0], b.readings[0]);
}

#[test]
fn every_effect_can_be_made_and_reaches_lambda() {
    for spec in LISTED.iter().chain([&effects::COUPLING]).chain(&OUTSIDE).chain(&FORMS) {
        let conditions = SetOptions { effect: Some(spec.id.to_owned()), lambda: Some(60.0), ..SetOptions::default() };
        let is_among = |list: &[Spec]| list.iter().any(|s| s.id == spec.id);
        let kind = match spec {
            _ if is_among(&OUTSIDE) => Kind::Outside,
            _ if is_among(&FORMS) => Kind::Forms,
            _ => Kind::One,
        };
        let set = Set::new(kind, 3, &conditions).unwrap();
        assert!(set.readings.iter().chain(&set.held.values).all(|d| d.norm() < 0.02), "{}", spec.id);
        // all stiffnesses together take a gain of the load; a telescope is never a plain rod
        let range = match spec.id {
            "load-gain" => 1.0..60.0,
            "telescopic-limb" => 20.0..1000.0,
            _ => 25.0..150.0,
        };
        assert!(range.contains(&set.lambda), "{}: {}", spec.id, set.lambda);
    }
}

#[test]
fn noise_is_white_with_unit_variance_once_whitened() {
    let mut rng = Random::new(5);
    let rows = plan(&mut rng, 12, &LAYOUTS[0], false, false);
    let mut readings = vec![Vector6::zeros(); rows.len()];
    noise(&rows, &mut readings, &mut rng);
    let z = whitened(&rows, &readings, true);
    let n = z.len() as f64;
    assert!((z.norm_squared() / n - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
    // the zero of a series is no longer in it: neighbours are independent
    let product: f64 = (0..z.len() - 6).map(|i| z[i] * z[i + 6]).sum::<f64>() / n;
    assert!(product.abs() < 4.0 / n.sqrt(), "{product}");
}

#[test]
fn lambda_of_a_change_of_stiffness_is_what_the_prior_leaves() {
    let m = Machine::reference();
    let world = World::new(m.clone(), m.clone(), Vec::new());
    let mut rng = Random::new(1);
    let poses = [Pose([0.1, 0.05, 0.52]), Pose([-0.1, 0.1, 0.55])];
    let rows = plan(&mut rng, 2, &LAYOUTS[0], false, false);
    let tuning = Tuning::new(&world, &poses, &rows, true);
    let by_one_sd = tuning.jacobian.column(2).into_owned();
    // AᵀA (AᵀA + 1)⁻¹, below 1: re-identification by one sd costs 1 at most
    let expected = (tuning.jacobian.tr_mul(&tuning.jacobian) * &tuning.inner)[(2, 2)];
    assert!((tuning.lambda(&by_one_sd) / expected - 1.0).abs() < 1e-6 && expected < 1.0);
}

#[test]
fn held_out_poses_beyond_the_box_are_within_travel() {
    let mut rng = Random::new(2);
    let machine = Machine::random(&mut rng);
    let HeldOut { poses, rows, zones, .. } = held_out(&mut rng, &machine, 0.2, true, false, 1);
    assert_eq!((rows.len(), zones.iter().filter(|z| **z == "beyond").count()), (104, 40));
    assert!(poses.iter().all(|p| machine.reaches(p)));
    let beyond = |p: &Pose| p.0[0].abs() > 0.2 || p.0[1].abs() > 0.2 || (p.0[2] - 0.53).abs() > 0.03;
    assert!(poses[8..16].iter().all(beyond) && !poses[..8].iter().any(beyond));
}

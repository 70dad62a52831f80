//! Forms that are nobody's: compliances without any formula, laws that no effect of the contract has.

use nalgebra::{Matrix6, Vector6};

use crate::Random;
use crate::effects::{Effect, Needs, Spec, spec};

/// Physics in other forms than the contract's, at places that are known.
pub const FORMS: [Spec; 11] = [
    spec("form-base-mount", 1, (0.05, 30.0), Needs::Nothing), // nm/N
    spec("form-base-feet", 1, (0.05, 30.0), Needs::Nothing),
    spec("form-platform-bores", 1, (0.05, 30.0), Needs::Nothing),
    spec("form-platform-ribs", 1, (0.05, 20.0), Needs::Nothing), // tip compliance of an arm, nm/N
    spec("form-tool", 1, (0.05, 30.0), Needs::Nothing),
    spec("form-base-joint", 1, (0.1, 60.0), Needs::Nothing),
    spec("form-platform-joint", 1, (0.1, 60.0), Needs::Nothing),
    spec("form-screw", 4, (0.1, 40.0), Needs::Nothing), // nm/N at its worst length
    spec("form-load", 4, (0.1, 40.0), Needs::Levels),   // nm/N near no load
    spec("form-warm-joints", 2, (0.01, 3.0), Needs::Temperature), // % per K
    spec("form-sensor", 3, (0.002, 20.0), Needs::Nothing), // %
];

/// The limb that has an effect alone.
pub fn limb(e: &Effect) -> usize {
    ((1.5 * (e.shape[7] + 1.0)) as usize).min(2)
}

/// Where a form may rightly be found: a housing that yields at one joint is part of the plate that holds it.
pub fn places_of(id: &str, e: &Effect) -> Option<Vec<String>> {
    let own = |parts: &[&str]| parts.iter().map(|p| format!("limb.{}.{p}", limb(e) + 1)).collect::<Vec<String>>();
    let chain = ["base_joint", "body", "platform_joint"];
    let all = |parts: &[&str]| {
        (1..=3).flat_map(|i| parts.iter().map(move |p| format!("limb.{i}.{p}"))).collect::<Vec<String>>()
    };
    let with = |place: &str, mut others: Vec<String>| {
        others.push(place.to_owned());
        others
    };
    Some(match id {
        "form-base-mount" => vec!["base".into()],
        "form-base-feet" => vec!["base".into()],
        "form-platform-bores" | "form-platform-ribs" => vec!["moving_platform".into()],
        "form-tool" => vec!["tool".into()],
        "form-base-joint" => with("base", own(&["base_joint"])),
        "form-platform-joint" => with("moving_platform", own(&["platform_joint"])),
        "form-screw" if e.variant < 2 => all(&chain),
        "form-screw" | "form-load" => own(&chain),
        "form-warm-joints" => all(&chain),
        "form-sensor" => vec!["sensor".into(), "load".into()],
        _ => return None,
    })
}

/// A compliance with no preferred direction, whose main directions differ up to some tenfold; rotations weigh as over a
/// lever of a quarter of a metre.
pub fn compliance(e: &Effect, part: usize) -> Matrix6<f64> {
    let mut rng = Random::new(e.shape[part % 7].to_bits() ^ part as u64);
    let root = Matrix6::from_fn(|_, _| rng.normal());
    let scale = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 4.0, 4.0, 4.0));
    scale * (root * root.transpose() / 6.0 + Matrix6::identity() * 0.02) * scale * (e.amplitude * 1e-9)
}

/// The stiffness of it.
pub fn stiffness(e: &Effect, part: usize) -> Matrix6<f64> {
    compliance(e, part).cholesky().expect("positive definite by the identity in it").inverse()
}

/// What a screw or its nut gives more at a length, m/N.
pub fn screw(e: &Effect, index: usize, q: f64) -> f64 {
    if e.variant >= 2 && index != limb(e) {
        return 0.0;
    }
    let x = (q - 0.56) / 0.1 + 0.5 * e.shape[index];
    let c = e.amplitude * 1e-9;
    match e.variant % 2 {
        // a worn stretch
        0 => c / (1.0 + 4.0 * x * x),
        // a support that lets go
        _ => c / (1.0 + (-4.0 * x).exp()),
    }
}

/// What a limb grows more under a tension, m.
pub fn growth(e: &Effect, index: usize, n: f64) -> f64 {
    if index != limb(e) {
        return 0.0;
    }
    let (c, n0) = (e.amplitude * 1e-9, 150.0 * e.share(0));
    match e.variant {
        // stiffer and stiffer
        0 => c * n0 * (n / n0).asinh(),
        // soft under tension alone
        1 => 0.5 * c * (n + (n * n + n0 * n0).sqrt() - n0),
        // softer beyond a force
        2 => c * n * n.abs() / (n.abs() + 3.0 * n0),
        // stiff in the middle, as two springs that part
        _ => c * (n - n0 * (n / n0).atan()),
    }
}

/// What a sensor makes of a deflection.
pub fn sensed(e: &Effect, d: &Vector6<f64>) -> Vector6<f64> {
    let size = Vector6::new(20e-6, 20e-6, 20e-6, 80e-6, 80e-6, 80e-6);
    let relative = d.component_div(&size);
    let changed = match e.variant {
        // every channel reads a little of the others
        0 => Matrix6::from_fn(|i, j| 0.3 * e.shape[(i + 3 * j) % 8]) * relative,
        // a scale that bends to one side
        1 => relative.map(|x| x * x / (1.0 + 0.2 * x.abs())),
        // and to both
        _ => relative.map(|x| x * x.abs() / (2.0 + x.abs())),
    };
    d + changed.component_mul(&size) * (e.amplitude * 1e-2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compliances_are_positive_and_differ_between_parts() {
        let mut rng = Random::new(3);
        for spec in FORMS {
            let e = Effect::random(&spec, &mut rng);
            let [a, b] = [0, 1].map(|part| compliance(&e, part));
            assert!(a.symmetric_eigenvalues().min() > 0.0 && (a - b).norm() > 0.1 * a.norm());
            assert!((a * stiffness(&e, 0) - Matrix6::identity()).norm() < 1e-9);
        }
    }

    #[test]
    fn a_limb_grows_with_its_tension_and_one_limb_alone() {
        let mut rng = Random::new(4);
        let mut e = Effect::random(&FORMS[8], &mut rng);
        for variant in 0..4 {
            e.variant = variant;
            let own = limb(&e);
            let at = |n: f64| growth(&e, own, n);
            assert!((-20..20).all(|k| at(50.0 * f64::from(k) + 50.0) >= at(50.0 * f64::from(k))), "form {variant}");
            assert!(at(0.0).abs() < 1e-15 && growth(&e, (own + 1) % 3, 500.0) == 0.0, "form {variant}");
        }
    }
}

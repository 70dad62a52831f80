//! Two diagnoses of one machine compared, such as before and after a repair: what changed beyond uncertainty.

use pkm_diagnosis::student;
use serde::Serialize;

use super::estimates::COVERAGE;
use crate::files::verified::{Diagnosed, Finding, Quantity};

/// Largest probability that any of the changes that are named is nothing but noise.
const MAX_FAMILY_P: f64 = 0.01;

/// Change of one stiffness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// `limb.N.axial` or `k11` … `k66`.
    pub quantity: String,
    /// For people.
    pub what: String,
    /// `N/m` or `N·m/rad`.
    pub unit: String,
    /// As identified the first time.
    pub before: f64,
    /// As identified the second time.
    pub after: f64,
    /// After over before, less 1.
    pub change_percent: f64,
    /// One standard deviation of that.
    pub standard_uncertainty_percent: f64,
    /// Times `k`: 95 %.
    pub expanded_uncertainty_percent: f64,
    /// Coverage factor.
    pub k: f64,
    /// Of the noise of both; none where it counts as known.
    pub degrees_of_freedom: Option<f64>,
    /// Probability of as great a change by noise alone.
    pub p: f64,
    /// Probability that the change has this sign.
    pub probability: f64,
    /// `softer`, `stiffer`, or `unchanged` where noise may have done it.
    pub verdict: &'static str,
}

/// What became of a finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fate {
    /// Effect at its place, or key of a declared value.
    pub finding: String,
    /// `gone`, `new`, `stronger`, `weaker` or `unchanged`.
    pub verdict: &'static str,
    /// Of the place, when it was found last; none of a declared value.
    pub probability: Option<f64>,
    /// For people.
    pub text: String,
}

/// The comparison.
#[derive(Serialize)]
pub struct Verification {
    /// `changed` or `unchanged`.
    pub verdict: &'static str,
    /// Limbs first.
    pub changes: Vec<Change>,
    /// Effects and declared values that were found in either.
    pub findings: Vec<Fate>,
    /// What to keep in mind.
    pub doubts: Vec<String>,
}

/// Compares one quantity. Errors of the declared values stand in both diagnoses and go out of the difference as far as both lean
/// on them: with posterior covariances C and gradients g, in units of the priors, the difference has the variance
/// gᵀCg + g'ᵀC'g' − 2 (Cg)·(C'g').
fn change(before: &Quantity, after: &Quantity, dof: [Option<f64>; 2], count: usize) -> Change {
    let (a, b) = (before.standard_uncertainty, after.standard_uncertainty);
    let in_common: f64 = before.shared.iter().zip(&after.shared).map(|(a, b)| a * b).sum();
    let deviation = (a * a + b * b - 2.0 * in_common).max(0.0).sqrt();
    let dof = student::effective_dof(&[(a * a, dof[0]), (b * b, dof[1])]);
    let k = student::coverage_factor(COVERAGE, dof);
    let change = (after.identified / before.identified).ln();
    let ratio = change.exp();
    // two equal documents differ by nothing, and nothing is certain of that
    let p = if change == 0.0 { 1.0 } else { student::two_sided_p(change / deviation, dof) };
    let verdict = match change {
        _ if p * count as f64 > MAX_FAMILY_P => "unchanged",
        _ if change < 0.0 => "softer",
        _ => "stiffer",
    };
    Change {
        quantity: after.quantity.clone(),
        what: after.what.clone(),
        unit: after.unit.clone(),
        before: before.identified,
        after: after.identified,
        change_percent: 100.0 * change.exp_m1(),
        standard_uncertainty_percent: 100.0 * ratio * deviation,
        expanded_uncertainty_percent: 100.0 * ratio * k * deviation,
        k,
        degrees_of_freedom: dof,
        p,
        probability: 1.0 - 0.5 * p,
        verdict,
    }
}

fn name(f: &Finding) -> String {
    format!("{} at {} ({})", f.id, f.place, f.law)
}

/// What became of an effect that both diagnoses found: by the parameter that changed most.
fn both(before: &Finding, after: &Finding, dof: [Option<f64>; 2]) -> Fate {
    let parameters = before.parameters.iter().filter_map(|(name, a)| Some((name, a, after.parameters.get(name)?)));
    let changes = parameters.map(|(name, a, b)| {
        let variances = [a.stderr, b.stderr].map(|s| s * s);
        let deviation = (variances[0] + variances[1]).sqrt();
        let dof = student::effective_dof(&[(variances[0], dof[0]), (variances[1], dof[1])]);
        let change = b.value - a.value;
        let p = if change == 0.0 { 1.0 } else { student::two_sided_p(change / deviation, dof) };
        (p, format!("{name} from {:.3e} to {:.3e}", a.value, b.value), b.value.abs() > a.value.abs())
    });
    let count = before.parameters.len().max(1) as f64;
    let most = changes.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|c| c.0 * count <= MAX_FAMILY_P);
    let finding = name(after);
    let (verdict, text) = match most {
        Some((p, what, grew)) => {
            (if grew { "stronger" } else { "weaker" }, format!("{finding} has changed: {what}, p = {p:.1e}"))
        }
        None => ("unchanged", format!("{finding} is in both, and no parameter of it changed beyond its uncertainty")),
    };
    Fate { finding, verdict, probability: Some(after.probability), text }
}

fn fates(before: &Diagnosed, after: &Diagnosed) -> Vec<Fate> {
    let dof = [before, after].map(|d| d.uncertainty.degrees_of_freedom);
    let is_same = |a: &Finding, b: &Finding| name(a) == name(b);
    let mut fates = Vec::new();
    for f in &before.effects {
        fates.push(match after.effects.iter().find(|o| is_same(f, o)) {
            Some(other) => both(f, other, dof),
            None => {
                let text =
                    format!("{} was found before, probability {:.2}, and is found no more", name(f), f.probability);
                Fate { finding: name(f), verdict: "gone", probability: Some(f.probability), text }
            }
        });
    }
    for f in after.effects.iter().filter(|f| before.effects.iter().all(|o| !is_same(f, o))) {
        let text = format!("{} is new, probability {:.2}", name(f), f.probability);
        fates.push(Fate { finding: name(f), verdict: "new", probability: Some(f.probability), text });
    }
    let has = |d: &Diagnosed, key: &str| d.declared_value_findings.iter().any(|f| f.parameter == key);
    let mut of_declared = |from: &Diagnosed, other: &Diagnosed, verdict: &'static str, how: &str| {
        for f in from.declared_value_findings.iter().filter(|f| !has(other, &f.parameter)) {
            let text = format!("{} {how} ({})", f.parameter, f.inspect);
            fates.push(Fate { finding: f.parameter.clone(), verdict, probability: None, text });
        }
    };
    of_declared(before, after, "gone", "differed from its declared value before, and does no more");
    of_declared(after, before, "new", "differs from its declared value, and did not before");
    fates
}

fn doubts(before: &Diagnosed, after: &Diagnosed) -> Vec<String> {
    let mut doubts = Vec::new();
    if before.data_sha256 == after.data_sha256 {
        doubts.push("both diagnoses are of the same readings: they say nothing of a change".to_owned());
    }
    for (when, d) in [("before", before), ("after", after)] {
        if d.measurement.verdict != "sound" {
            doubts.push(format!(
                "the measurement {when} is {}: what it says of the machine may be an error of the readings",
                d.measurement.verdict
            ));
        }
        if d.model.verdict == "not_good_enough" {
            doubts.push(format!(
                "the model {when} leaves more than noise ({}): its stiffnesses are farther off than their uncertainties say",
                d.verdict
            ));
        }
    }
    doubts
}

/// Compares two diagnoses of one machine.
pub fn verify(before: &Diagnosed, after: &Diagnosed) -> Verification {
    let dof = [before, after].map(|d| d.uncertainty.degrees_of_freedom);
    let pairs: Vec<(&Quantity, &Quantity)> = (before.condition.quantities.iter())
        .filter_map(|a| Some((a, after.condition.quantities.iter().find(|b| b.quantity == a.quantity)?)))
        .collect();
    let changes: Vec<Change> = pairs.iter().map(|(a, b)| change(a, b, dof, pairs.len())).collect();
    let findings = fates(before, after);
    let is_changed =
        changes.iter().map(|c| c.verdict).chain(findings.iter().map(|f| f.verdict)).any(|v| v != "unchanged");
    Verification {
        verdict: if is_changed { "changed" } else { "unchanged" },
        changes,
        findings,
        doubts: doubts(before, after),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    fn quantity(identified: f64, standard_uncertainty: f64, shared: Vec<f64>) -> Quantity {
        Quantity {
            quantity: "k11".into(),
            what: String::new(),
            unit: "N/m".into(),
            declared: 1e8,
            identified,
            standard_uncertainty,
            expanded_uncertainty: 2.0 * standard_uncertainty,
            declared_uncertainty: 0.1,
            state: "as_declared".into(),
            shared,
        }
    }

    fn normal(rng: &mut fastrand::Rng) -> f64 {
        (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
    }

    /// One linear machine measured twice, thousands of times: the standard deviation of the difference of both estimates is the one
    /// that is stated, which it would not be without what both have in common.
    #[test]
    fn a_difference_is_as_uncertain_as_simulation_says() {
        let mut rng = fastrand::Rng::with_seed(3);
        let design = |rng: &mut fastrand::Rng, rows: usize| DMatrix::from_fn(rows, 3, |_, _| 0.4 * normal(rng));
        let designs = [design(&mut rng, 4), design(&mut rng, 9)];
        let gradient = DVector::from_vec(vec![0.1, 0.08, -0.05]);
        let covariances = designs.each_ref().map(|a| (a.tr_mul(a) + DMatrix::identity(3, 3)).try_inverse().unwrap());
        let stated = covariances.each_ref().map(|c| {
            let shared = c * &gradient;
            quantity(1e8, gradient.dot(&shared).sqrt(), shared.iter().copied().collect())
        });
        let said = change(&stated[0], &stated[1], [None; 2], 1).standard_uncertainty_percent / 100.0;
        let (mut sum, runs) = (0.0, 20_000);
        for _ in 0..runs {
            let truth = DVector::from_fn(3, |_, _| normal(&mut rng));
            let mut estimate = |n: usize| {
                let a = &designs[n];
                let read = a * &truth + DVector::from_fn(a.nrows(), |_, _| normal(&mut rng));
                gradient.dot(&(&covariances[n] * a.tr_mul(&read)))
            };
            sum += (estimate(1) - estimate(0)).powi(2);
        }
        let found = (sum / f64::from(runs)).sqrt();
        assert!((said / found - 1.0).abs() < 0.02, "{said} instead of {found}");
        let alone = stated[0].standard_uncertainty.hypot(stated[1].standard_uncertainty);
        assert!(alone > 1.1 * found, "{alone} {found}");
    }

    #[test]
    fn a_change_must_be_more_than_noise_and_have_its_sign() {
        let before = quantity(1e8, 0.01, vec![0.0]);
        let of = |after: f64, dof, count| change(&before, &quantity(after, 0.01, vec![0.0]), [dof; 2], count);
        // 9 % at a standard deviation of 1.4 %
        let softer = of(0.91e8, None, 9);
        assert_eq!(softer.verdict, "softer");
        assert!((softer.change_percent + 9.0).abs() < 1e-9 && softer.probability > 0.999_999);
        assert_eq!(of(1.1e8, None, 9).verdict, "stiffer");
        assert_eq!(of(1.02e8, None, 9).verdict, "unchanged");
        // as many standard deviations are less with two degrees of freedom each
        assert_eq!(of(1.06e8, None, 1).verdict, "stiffer");
        assert_eq!(of(1.06e8, Some(2.0), 1).verdict, "unchanged");
        let same = of(1e8, None, 9);
        assert_eq!((same.verdict, same.p), ("unchanged", 1.0));
    }
}

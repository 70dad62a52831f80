//! Two diagnoses of one machine compared, such as before and after a repair: what changed beyond uncertainty.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::student;
use serde::Serialize;

use super::estimates::COVERAGE;
use crate::files::verified::{Condition, Diagnosed, Finding, Quantity};

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
    /// The first time, held to the declared value by nothing but what is known of the second.
    pub before: f64,
    /// The second time, the same way.
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

/// Standard deviation of a change, in units of what is known of the declared value: a part that wears or is replaced may become
/// several times softer or stiffer. A prior that held either machine to the declared values would pull a change toward nothing, and
/// no uncertainty would say so.
const CHANGE_SD: f64 = 10.0;

/// Both machines by the readings of both, in deviations from the declared values. The diagnoses' own prior is taken off: each has
/// the information C⁻¹ − 1 of its readings alone. Before and after are p + Δ and p + Δ', with p ~ N(0, 1) as declared and changes Δ ~
/// N(0, [`CHANGE_SD`]²).
struct Joint {
    /// How far each is from where its own diagnosis has it.
    moved: [DVector<f64>; 2],
    /// Of both, one after the other.
    covariance: DMatrix<f64>,
    /// Of each by its own diagnosis.
    precisions: [DMatrix<f64>; 2],
}

impl Joint {
    /// None where a covariance is none.
    fn new(both: [&Condition; 2]) -> Option<Self> {
        let n = both[0].deviations.len();
        let precision =
            |c: &Condition| DMatrix::from_fn(n, n, |i, j| c.deviation_covariance[i][j]).cholesky().map(|c| c.inverse());
        let precisions = [precision(both[0])?, precision(both[1])?];
        let own = both.map(|c| DVector::from_column_slice(&c.deviations));
        let one = 1.0 + CHANGE_SD * CHANGE_SD;
        let (diagonal, off) = (one / (one * one - 1.0), -1.0 / (one * one - 1.0));
        let mut information = DMatrix::zeros(2 * n, 2 * n);
        let mut right = DVector::zeros(2 * n);
        for (k, (precision, own)) in precisions.iter().zip(&own).enumerate() {
            let readings = precision + DMatrix::identity(n, n) * (diagonal - 1.0);
            information.view_mut((k * n, k * n), (n, n)).copy_from(&readings);
            right.rows_mut(k * n, n).copy_from(&(precision * own));
        }
        for i in 0..n {
            information[(i, n + i)] = off;
            information[(n + i, i)] = off;
        }
        let covariance = information.cholesky()?.inverse();
        let found = &covariance * right;
        let moved = [0, 1].map(|k| found.rows(k * n, n) - &own[k]);
        Some(Self { moved, covariance, precisions })
    }

    /// ln of a quantity before and after, and the standard deviations that each brings to the difference, one by one and together.
    /// What no declared value takes part in is uncertain for itself.
    fn quantity(&self, both: [&Quantity; 2]) -> ([f64; 2], [f64; 2], f64) {
        let shared = both.map(|q| DVector::from_column_slice(&q.shared));
        let slopes = [0, 1].map(|k| &self.precisions[k] * &shared[k]);
        let rest = [0, 1].map(|k| (both[k].standard_uncertainty.powi(2) - shared[k].dot(&slopes[k])).max(0.0));
        let values = [0, 1].map(|k| both[k].identified.ln() + slopes[k].dot(&self.moved[k]));
        let n = slopes[0].len();
        let own = |k: usize| slopes[k].dot(&(self.covariance.view((k * n, k * n), (n, n)) * &slopes[k])) + rest[k];
        let cross = slopes[0].dot(&(self.covariance.view((0, n), (n, n)) * &slopes[1]));
        let variances = [own(0), own(1)];
        (values, variances.map(f64::sqrt), (variances[0] + variances[1] - 2.0 * cross).max(0.0).sqrt())
    }
}

/// Compares one quantity.
fn change(joint: &Joint, both: [&Quantity; 2], dof: [Option<f64>; 2], count: usize) -> Change {
    let ([before, after], [a, b], deviation) = joint.quantity(both);
    let dof = student::effective_dof(&[(a * a, dof[0]), (b * b, dof[1])]);
    let k = student::coverage_factor(COVERAGE, dof);
    let change = after - before;
    let ratio = change.exp();
    let p = student::two_sided_p(change / deviation, dof);
    let verdict = match change {
        _ if p * count as f64 > MAX_FAMILY_P => "unchanged",
        _ if change < 0.0 => "softer",
        _ => "stiffer",
    };
    let [_, second] = both;
    Change {
        quantity: second.quantity.clone(),
        what: second.what.clone(),
        unit: second.unit.clone(),
        before: before.exp(),
        after: after.exp(),
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
        let what = match d.model.verdict.as_str() {
            "good_enough" => continue,
            "in_doubt" => "is in doubt",
            _ => "leaves more than noise",
        };
        doubts.push(format!(
            "the model {when} {what} ({}): its stiffnesses may be farther off than their uncertainties say",
            d.verdict
        ));
    }
    doubts
}

/// Compares two diagnoses of one machine; none where one has a covariance that is none.
pub fn verify(before: &Diagnosed, after: &Diagnosed) -> Option<Verification> {
    let dof = [before, after].map(|d| d.uncertainty.degrees_of_freedom);
    let pairs: Vec<(&Quantity, &Quantity)> = (before.condition.quantities.iter())
        .filter_map(|a| Some((a, after.condition.quantities.iter().find(|b| b.quantity == a.quantity)?)))
        .collect();
    let joint = Joint::new([&before.condition, &after.condition])?;
    let changes: Vec<Change> = pairs.iter().map(|(a, b)| change(&joint, [a, b], dof, pairs.len())).collect();
    let findings = fates(before, after);
    let is_changed =
        changes.iter().map(|c| c.verdict).chain(findings.iter().map(|f| f.verdict)).any(|v| v != "unchanged");
    Some(Verification {
        verdict: if is_changed { "changed" } else { "unchanged" },
        changes,
        findings,
        doubts: doubts(before, after),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal(rng: &mut fastrand::Rng) -> f64 {
        (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
    }

    /// A linear machine of three declared values under a design of readings with noise 1, and one quantity of it.
    struct Linear {
        design: DMatrix<f64>,
        gradient: DVector<f64>,
    }

    impl Linear {
        fn new(rng: &mut fastrand::Rng, rows: usize, size: f64) -> Self {
            let design = DMatrix::from_fn(rows, 3, |_, _| size * normal(rng));
            Self { design, gradient: DVector::from_vec(vec![0.1, 0.08, -0.05]) }
        }

        /// What a diagnosis under the declared prior says of a machine with these deviations.
        fn diagnosed(&self, truth: &DVector<f64>, noise: impl FnMut(usize, usize) -> f64) -> (Condition, Quantity) {
            let a = &self.design;
            let covariance = (a.tr_mul(a) + DMatrix::identity(3, 3)).try_inverse().unwrap();
            let read = a * truth + DVector::from_fn(a.nrows(), noise);
            let found = &covariance * a.tr_mul(&read);
            let shared = &covariance * &self.gradient;
            let standard_uncertainty = self.gradient.dot(&shared).sqrt();
            let quantity = Quantity {
                quantity: "k11".into(),
                what: String::new(),
                unit: "N/m".into(),
                declared: 1e8,
                identified: 1e8 * self.gradient.dot(&found).exp(),
                standard_uncertainty,
                expanded_uncertainty: 2.0 * standard_uncertainty,
                declared_uncertainty: 0.1,
                state: "as_declared".into(),
                shared: shared.iter().copied().collect(),
            };
            let condition = Condition {
                quantities: Vec::new(),
                shared_with: Vec::new(),
                deviations: found.iter().copied().collect(),
                deviation_covariance: covariance.row_iter().map(|r| r.iter().copied().collect()).collect(),
            };
            (condition, quantity)
        }
    }

    fn compared(both: &[(Condition, Quantity); 2], dof: Option<f64>, count: usize) -> Change {
        let joint = Joint::new([&both[0].0, &both[1].0]).unwrap();
        change(&joint, [&both[0].1, &both[1].1], [dof; 2], count)
    }

    /// Thousands of machines that differ from what is declared, and change, as the priors say: the change that is found is off by
    /// the standard deviation that is stated.
    #[test]
    fn a_change_is_as_uncertain_as_simulation_says() {
        let mut rng = fastrand::Rng::with_seed(3);
        let designs = [Linear::new(&mut rng, 4, 0.4), Linear::new(&mut rng, 9, 0.4)];
        let (mut sum, mut said, runs) = (0.0, 0.0, 5000);
        for _ in 0..runs {
            let declared = DVector::from_fn(3, |_, _| normal(&mut rng));
            let truths = [0, 1].map(|_| &declared + DVector::from_fn(3, |_, _| CHANGE_SD * normal(&mut rng)));
            let both = [0, 1].map(|k| designs[k].diagnosed(&truths[k], |_, _| normal(&mut rng)));
            let joint = Joint::new([&both[0].0, &both[1].0]).unwrap();
            let ([before, after], _, deviation) = joint.quantity([&both[0].1, &both[1].1]);
            let truth = designs[0].gradient.dot(&(&truths[1] - &truths[0]));
            sum += (after - before - truth).powi(2);
            said = deviation;
        }
        let found = (sum / f64::from(runs)).sqrt();
        assert!((said / found - 1.0).abs() < 0.03, "{said} instead of {found}");
    }

    /// Ten standard deviations of the declared prior, which pulls each diagnosis by itself a third of the way back.
    #[test]
    fn a_large_change_is_not_pulled_toward_nothing() {
        let mut rng = fastrand::Rng::with_seed(5);
        let design = Linear::new(&mut rng, 12, 0.5);
        let truths = [DVector::from_vec(vec![-10.0, 0.0, 0.0]), DVector::zeros(3)];
        let both = truths.map(|t| design.diagnosed(&t, |_, _| 0.0));
        let truth = 100.0 * 1.0_f64.exp_m1();
        let plain = 100.0 * (both[1].1.identified / both[0].1.identified - 1.0);
        assert!(plain < 0.8 * truth, "{plain}");
        let found = compared(&both, None, 9);
        assert!((found.change_percent - truth).abs() < 0.03 * truth, "{} instead of {truth}", found.change_percent);
        assert_eq!(found.verdict, "stiffer");
    }

    #[test]
    fn a_change_must_be_more_than_noise_and_have_its_sign() {
        let mut rng = fastrand::Rng::with_seed(7);
        let design = Linear::new(&mut rng, 300, 0.8);
        let of = |sds: f64, dof, count| {
            let both = |size: f64| {
                let truths = [DVector::zeros(3), &design.gradient * (size / design.gradient.norm_squared())];
                compared(&truths.map(|t| design.diagnosed(&t, |_, _| 0.0)), dof, count)
            };
            let deviation = 0.01 * both(0.0).standard_uncertainty_percent;
            both(sds * deviation)
        };
        let softer = of(-6.0, None, 9);
        assert_eq!(softer.verdict, "softer");
        assert!(softer.probability > 0.999_999 && softer.change_percent < 0.0);
        assert_eq!(of(6.0, None, 9).verdict, "stiffer");
        assert_eq!(of(1.4, None, 9).verdict, "unchanged");
        // as many standard deviations are less with two degrees of freedom each
        assert_eq!(of(4.2, None, 1).verdict, "stiffer");
        assert_eq!(of(4.2, Some(2.0), 1).verdict, "unchanged");
    }
}

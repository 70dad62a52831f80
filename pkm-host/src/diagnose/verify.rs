//! Two diagnoses of one machine compared, such as before and after a repair: what changed beyond uncertainty.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::student;
use serde::Serialize;

use super::estimates::COVERAGE;
use super::fates::{Fate, fates};
use crate::files::verified::{Condition, Diagnosed, Quantity};

/// Verdict where the readings of one side are not what they are taken for: what makes up for them says nothing of the machine.
pub const INCONCLUSIVE: &str = "inconclusive";

/// Of a measurement that is not to be relied on.
const UNSOUND: &str = "unsound";

/// Largest probability that any of the changes that are named is nothing but noise.
pub const MAX_FAMILY_P: f64 = 0.01;

/// Change of one stiffness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// `limb.N.axial` or `k11` … `k66`.
    pub quantity: String,
    /// For people.
    pub what: String,
    /// `N/m` or `N·m/rad`.
    pub unit: String,
    /// The first time, by the readings of both.
    pub before: f64,
    /// The second time, likewise.
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
    /// `softer`, `stiffer`, or `unchanged` where noise may have done it; `inconclusive` where all is.
    pub verdict: &'static str,
}

/// The comparison.
#[derive(Serialize)]
pub struct Verification {
    /// `changed` or `unchanged`, or `inconclusive` beside a measurement that is unsound.
    pub verdict: &'static str,
    /// Limbs first.
    pub changes: Vec<Change>,
    /// Effects and declared values that were found in either; none where nothing is concluded.
    pub findings: Vec<Fate>,
    /// What to keep in mind.
    pub caveats: Vec<String>,
}

/// Standard deviation of a part that has changed, in units of what is known of the declared value: worn or replaced, it may be several
/// times softer or stiffer. A prior that held either machine to the declared values would pull a change toward nothing, and no
/// uncertainty would say so.
const CHANGE_SD: f64 = 10.0;

/// The same of parts that have not: a per cent where the declared value is known to ten.
const DRIFT_SD: f64 = 0.1;

/// Most declared values that have changed.
const MAX_CHANGED: usize = 4;

/// What the readings of both diagnoses say, without the priors of either: the information C⁻¹ − 1, one after the other.
struct Likelihood {
    /// Of each by its own diagnosis, with its prior.
    precisions: [DMatrix<f64>; 2],
    own: [DVector<f64>; 2],
    information: DMatrix<f64>,
    right: DVector<f64>,
}

/// Both machines, if some of the declared values have changed.
struct Hypothesis {
    changed: Vec<usize>,
    /// ln of its probability, up to a constant.
    ln: f64,
    /// Deviations from the declared values, before and after.
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// One quantity before and after.
struct Compared {
    /// ln of it.
    values: [f64; 2],
    /// Standard deviations of these.
    deviations: [f64; 2],
    /// Standard deviation of their difference.
    deviation: f64,
}

impl Likelihood {
    /// None where a covariance is none.
    fn new(both: [&Condition; 2]) -> Option<Self> {
        let n = both[0].deviations.len();
        let precision =
            |c: &Condition| DMatrix::from_fn(n, n, |i, j| c.deviation_covariance[i][j]).cholesky().map(|c| c.inverse());
        let precisions = [precision(both[0])?, precision(both[1])?];
        let own = both.map(|c| DVector::from_column_slice(&c.deviations));
        let (mut information, mut right) = (DMatrix::zeros(2 * n, 2 * n), DVector::zeros(2 * n));
        for (k, (precision, own)) in precisions.iter().zip(&own).enumerate() {
            information.view_mut((k * n, k * n), (n, n)).copy_from(&(precision - DMatrix::identity(n, n)));
            right.rows_mut(k * n, n).copy_from(&(precision * own));
        }
        Some(Self { precisions, own, information, right })
    }

    /// Before and after are p + Δ and p + Δ': p ~ N(0, 1) as declared, Δ and Δ' each with the standard deviation of a change or of a
    /// drift. Of n values one as likely as another has changed, and one as likely as none.
    fn if_changed(&self, changed: Vec<usize>) -> Option<Hypothesis> {
        let n = self.own[0].len();
        let mut information = self.information.clone();
        let mut ln_determinant = 0.0;
        for i in 0..n {
            let s = if changed.contains(&i) { CHANGE_SD } else { DRIFT_SD }.powi(2);
            let determinant = s * (2.0 + s);
            ln_determinant += determinant.ln();
            for (a, b, value) in [(i, i, 1.0 + s), (n + i, n + i, 1.0 + s), (i, n + i, -1.0), (n + i, i, -1.0)] {
                information[(a, b)] += value / determinant;
            }
        }
        let factor = information.cholesky()?;
        let mean = factor.solve(&self.right);
        let evidence = 0.5 * (self.right.dot(&mean) - factor.ln_determinant() - ln_determinant);
        let ln = evidence - changed.len() as f64 * (n as f64).ln();
        Some(Hypothesis { changed, ln, mean, covariance: factor.inverse() })
    }

    /// What may have changed: one more value after another, as long as that is likelier, with all that was tried on the way.
    fn hypotheses(&self) -> Option<Vec<Hypothesis>> {
        let n = self.own[0].len();
        let mut all = vec![self.if_changed(Vec::new())?];
        let mut best = 0;
        for _ in 0..MAX_CHANGED {
            let (changed, before) = (all[best].changed.clone(), all.len());
            let more = (0..n).filter(|i| !changed.contains(i));
            all.extend(more.filter_map(|i| self.if_changed([changed.clone(), vec![i]].concat())));
            let next = (0..all.len()).max_by(|a, b| all[*a].ln.total_cmp(&all[*b].ln))?;
            if next < before {
                break;
            }
            best = next;
        }
        Some(all)
    }

    /// A quantity, over all hypotheses by their probabilities. What no declared value takes part in is uncertain for itself.
    fn quantity(&self, hypotheses: &[Hypothesis], both: [&Quantity; 2]) -> Compared {
        let n = self.own[0].len();
        let shared = both.map(|q| DVector::from_column_slice(&q.shared));
        let slopes = [0, 1].map(|k| &self.precisions[k] * &shared[k]);
        let rest = [0, 1].map(|k| (both[k].standard_uncertainty.powi(2) - shared[k].dot(&slopes[k])).max(0.0));
        let top = hypotheses.iter().fold(f64::NEG_INFINITY, |m, h| m.max(h.ln));
        let total: f64 = hypotheses.iter().map(|h| (h.ln - top).exp()).sum();
        // weight, ln before and after, their variances and covariance
        let under = |h: &Hypothesis| {
            let value = |k: usize| both[k].identified.ln() + slopes[k].dot(&(h.mean.rows(k * n, n) - &self.own[k]));
            let part = |a: usize, b: usize| slopes[a].dot(&(h.covariance.view((a * n, b * n), (n, n)) * &slopes[b]));
            ((h.ln - top).exp() / total, [0, 1].map(value), [0, 1].map(|k| part(k, k) + rest[k]), part(0, 1))
        };
        let each: Vec<_> = hypotheses.iter().map(under).collect();
        let mean = |of: &dyn Fn(&[f64; 2]) -> f64| each.iter().map(|(w, values, ..)| w * of(values)).sum::<f64>();
        let variance = |of: &dyn Fn(&[f64; 2]) -> f64, own: &dyn Fn(&[f64; 2], f64) -> f64| {
            let middle = mean(of);
            let spread = each.iter().map(|(w, values, variances, covariance)| {
                w * (own(variances, *covariance) + (of(values) - middle).powi(2))
            });
            spread.sum::<f64>().max(0.0)
        };
        Compared {
            values: [mean(&|v| v[0]), mean(&|v| v[1])],
            deviations: [variance(&|v| v[0], &|v, _| v[0]), variance(&|v| v[1], &|v, _| v[1])].map(f64::sqrt),
            deviation: variance(&|v| v[1] - v[0], &|v, c| v[0] + v[1] - 2.0 * c).sqrt(),
        }
    }
}

/// The change of one quantity.
fn change(compared: &Compared, of: &Quantity, dof: [Option<f64>; 2], count: usize) -> Change {
    let Compared { values: [before, after], deviations: [a, b], deviation } = *compared;
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
    Change {
        quantity: of.quantity.clone(),
        what: of.what.clone(),
        unit: of.unit.clone(),
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

fn caveats(before: &Diagnosed, after: &Diagnosed) -> Vec<String> {
    let mut caveats = Vec::new();
    if before.data_sha256 == after.data_sha256 {
        caveats.push("both diagnoses are of the same readings: they say nothing of a change".to_owned());
    }
    for (when, d) in [("before", before), ("after", after)] {
        match d.measurement.verdict.as_str() {
            "sound" => {}
            UNSOUND => caveats.push(format!(
                "the measurement {when} is unsound ({}): its stiffnesses make up for the readings and say nothing of the machine",
                d.measurement.reasons.first().map_or("no reason is given", String::as_str)
            )),
            other => caveats.push(format!(
                "the measurement {when} is {other}: what it says of the machine may be an error of the readings"
            )),
        }
        let what = match d.model.verdict.as_str() {
            "good_enough" => continue,
            "in_doubt" => "is in doubt",
            _ => "leaves more than noise",
        };
        caveats.push(format!(
            "the model {when} {what} ({}): its stiffnesses may be farther off than their uncertainties say",
            d.verdict
        ));
    }
    caveats
}

/// Compares two diagnoses of one machine; none where one has a covariance that is none.
pub fn verify(before: &Diagnosed, after: &Diagnosed) -> Option<Verification> {
    let dof = [before, after].map(|d| d.uncertainty.degrees_of_freedom);
    let pairs: Vec<(&Quantity, &Quantity)> = (before.condition.quantities.iter())
        .filter_map(|a| Some((a, after.condition.quantities.iter().find(|b| b.quantity == a.quantity)?)))
        .collect();
    let likelihood = Likelihood::new([&before.condition, &after.condition])?;
    let hypotheses = likelihood.hypotheses()?;
    let compared =
        |(a, b): &(&Quantity, &Quantity)| change(&likelihood.quantity(&hypotheses, [a, b]), b, dof, pairs.len());
    let mut changes: Vec<Change> = pairs.iter().map(compared).collect();
    let caveats = caveats(before, after);
    if [before, after].iter().any(|d| d.measurement.verdict == UNSOUND) {
        changes.iter_mut().for_each(|c| c.verdict = INCONCLUSIVE);
        return Some(Verification { verdict: INCONCLUSIVE, changes, findings: Vec::new(), caveats });
    }
    let findings = fates(before, after, &changes);
    let is_changed =
        changes.iter().map(|c| c.verdict).chain(findings.iter().map(|f| f.verdict)).any(|v| v != "unchanged");
    Some(Verification { verdict: if is_changed { "changed" } else { "unchanged" }, changes, findings, caveats })
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

    fn compared(both: &[(Condition, Quantity); 2]) -> Compared {
        let likelihood = Likelihood::new([&both[0].0, &both[1].0]).unwrap();
        likelihood.quantity(&likelihood.hypotheses().unwrap(), [&both[0].1, &both[1].1])
    }

    /// Thousands of machines that differ from what is declared, and of which one part has changed or none: the change that is found
    /// is off by the standard deviation that is stated.
    #[test]
    fn a_change_is_as_uncertain_as_simulation_says() {
        let mut rng = fastrand::Rng::with_seed(3);
        let designs = [Linear::new(&mut rng, 6, 0.6), Linear::new(&mut rng, 12, 0.6)];
        let (mut sum, runs) = (0.0, 4000);
        for run in 0..runs {
            let declared = DVector::from_fn(3, |_, _| normal(&mut rng));
            let truths = [0, 1].map(|_| {
                let sd = |i: usize| if i == run % 6 { CHANGE_SD } else { DRIFT_SD };
                &declared + DVector::from_fn(3, |i, _| sd(i) * normal(&mut rng))
            });
            let both = [0, 1].map(|k| designs[k].diagnosed(&truths[k], |_, _| normal(&mut rng)));
            let Compared { values: [before, after], deviation, .. } = compared(&both);
            let truth = designs[0].gradient.dot(&(&truths[1] - &truths[0]));
            sum += ((after - before - truth) / deviation).powi(2);
        }
        let ratio = (sum / runs as f64).sqrt();
        assert!((ratio - 1.0).abs() < 0.06, "errors of {ratio} times what is stated");
    }

    /// Ten standard deviations of the declared prior, which pulls each diagnosis by itself a good part of the way back.
    #[test]
    fn a_large_change_is_not_pulled_toward_nothing() {
        let mut rng = fastrand::Rng::with_seed(5);
        let design = Linear::new(&mut rng, 12, 0.5);
        let truths = [DVector::from_vec(vec![-10.0, 0.0, 0.0]), DVector::zeros(3)];
        let both = truths.map(|t| design.diagnosed(&t, |_, _| 0.0));
        let truth = 100.0 * 1.0_f64.exp_m1();
        let plain = 100.0 * (both[1].1.identified / both[0].1.identified - 1.0);
        assert!(plain < 0.8 * truth, "{plain}");
        let found = change(&compared(&both), &both[1].1, [None; 2], 9);
        assert!((found.change_percent - truth).abs() < 0.05 * truth, "{} instead of {truth}", found.change_percent);
        assert_eq!(found.verdict, "stiffer");
    }

    #[test]
    fn a_change_must_be_more_than_noise_and_have_its_sign() {
        let mut rng = fastrand::Rng::with_seed(7);
        let (_, of) = Linear::new(&mut rng, 4, 1.0).diagnosed(&DVector::zeros(3), |_, _| 0.0);
        let changed = |by: f64, dof, count| {
            let both = Compared { values: [0.0, by], deviations: [0.01; 2], deviation: 0.01 * 2.0_f64.sqrt() };
            change(&both, &of, [dof; 2], count)
        };
        // 9 % at a standard deviation of 1.4 %
        let softer = changed(-0.09, None, 9);
        assert_eq!(softer.verdict, "softer");
        assert!(softer.probability > 0.999_999 && (softer.change_percent + 8.6).abs() < 0.05);
        assert_eq!(changed(0.09, None, 9).verdict, "stiffer");
        assert_eq!(changed(0.02, None, 9).verdict, "unchanged");
        // as many standard deviations are less with two degrees of freedom each
        assert_eq!(changed(0.06, None, 1).verdict, "stiffer");
        assert_eq!(changed(0.06, Some(2.0), 1).verdict, "unchanged");
    }
}

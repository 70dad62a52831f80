//! What a fit is worth, in sentences.

use super::{LOADS, forms};
use crate::fit::{DeflectionError, Evaluation, Fit, TermChoice, Verification};
use crate::page::{Finding, State};

/// A mean error that a model of the stiffness may have where it is used, %.
pub(crate) const USABLE_PERCENT: f64 = 5.0;
/// Poses that judge a table at the least: fewer lie in one plane of θ, σ and Z0, and leave a direction of the box untested.
const MIN_POSES: usize = 4;
/// Errors that are no more than the rounding of the data, %: shown as 0.0.
const ROUNDING_PERCENT: f64 = 0.05;

/// Whether a table errs more than none, both in %, beyond the rounding of sums and of the data.
fn is_worse(with_table: f64, without: f64) -> bool {
    with_table >= ROUNDING_PERCENT && with_table > without * (1.0 + 1e-9)
}

/// "1 pose", "25 poses".
pub(super) fn poses(number: usize) -> String {
    format!("{number} pose{}", if number == 1 { "" } else { "s" })
}

/// What is said of deflections, by what.
struct Judged<'a> {
    /// Of the training poses.
    trained: &'a Evaluation,
    /// Where there are whole matrices, of the verification.
    loaded: &'a Evaluation,
    /// Whether that is of the verification poses.
    verified: bool,
    /// Whether these had no part in the fit.
    by_others: bool,
}

impl<'a> Judged<'a> {
    fn new(fit: &Fit, trained: &'a Evaluation, verified: Option<&'a Evaluation>) -> Self {
        let whole = verified.filter(|v| v.deflection_percent.factor.is_some());
        let of_others = fit.verification.as_ref().is_some_and(Verification::is_of_others);
        Self {
            trained,
            loaded: whole.unwrap_or(trained),
            verified: whole.is_some(),
            by_others: whole.is_some() && of_others,
        }
    }

    /// Whether the model without a table has the data's deflections already, and the table leaves them as they are.
    fn agrees(&self) -> bool {
        let is_exact = |e: &Option<DeflectionError>| {
            e.as_ref().is_some_and(|e| e.max.iter().all(|percent| *percent < ROUNDING_PERCENT))
        };
        let all = [self.trained, self.loaded].map(|e| &e.deflection_percent);
        all.iter().all(|d| is_exact(&d.basic) && is_exact(&d.factor))
    }

    /// Whether other poses judge, and too few of them.
    fn by_few(&self) -> bool {
        self.by_others && self.loaded.poses < MIN_POSES
    }
}

/// The poses that principal stiffnesses are judged by, in words.
fn judged_on(fit: &Fit) -> String {
    match &fit.verification {
        None => "the training poses themselves: give --verify to judge the table by others".to_owned(),
        Some(v) if !v.is_of_others() => "verification poses that had a part in the fit themselves".to_owned(),
        Some(v) if v.fitted_too > 0 => {
            format!("the {} of {} verification poses that had no part in the fit", v.samples.len(), v.given)
        }
        Some(_) => "the verification poses, which had no part in the fit".to_owned(),
    }
}

/// What the fit is worth, in sentences.
pub(super) fn conclusion(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>) -> Vec<Finding> {
    let (e, on) = (verified.unwrap_or(trained), judged_on(fit));
    let worst = |v: &[f64; 6]| v.iter().copied().fold(0.0, f64::max);
    let judged = Judged::new(fit, trained, verified);
    let loaded = judged.loaded;
    let forms = forms(&loaded.deflection_percent);
    let mut findings = vec![verdict(&judged)];
    if verified.is_some() && !judged.verified && loaded.deflection_percent.factor.is_some() {
        findings.push(Finding::warning(
            "The verification poses have the six principal stiffnesses alone: deflections are judged by the training poses.",
        ));
    }
    findings.push(Finding::good(format!(
        "Principal stiffnesses: mean error at most {:.2} % with the table (diagonal form), up to {:.1} % without, on {on}.",
        worst(&e.improved.re_percent.mean),
        worst(&e.basic.re_percent.mean)
    )));
    if e.outside_box > 0 {
        findings.push(Finding::warning(format!(
            "{} of these {} poses lie outside the table's box: extrapolated.",
            e.outside_box, e.poses
        )));
    }
    if let Some((_, basic)) = forms.first() {
        for (name, errors) in &forms[1..] {
            let is_worse = |i: &usize| is_worse(errors[*i], basic[*i]);
            let worse: Vec<&str> = (0..6).filter(is_worse).map(|i| LOADS[i]).collect();
            let worst_of_these = |v: &[f64; 6]| (0..6).filter(is_worse).map(|i| v[i]).fold(0.0, f64::max);
            findings.push(if worse.is_empty() {
                Finding::good(format!(
                    "Deflection of A under load, {name}: mean error at most {:.2} %, where the model without a table (K_p) is \
                     wrong by up to {:.1} %.",
                    worst(errors),
                    worst(basic)
                ))
            } else {
                Finding::bad(format!(
                    "Deflection of A under load, {name}: WORSE than the model without a table (K_p) under {} (up to {:.0} % against \
                     {:.0} %). Don't predict deflections with it.",
                    worse.join(", "),
                    worst_of_these(errors),
                    worst_of_these(basic)
                ))
            });
        }
    }
    findings
}

/// Whether to use the table, by its factor form, which is what predicts deflections.
fn verdict(judged: &Judged<'_>) -> Finding {
    let e = judged.loaded;
    let d = &e.deflection_percent;
    let Some((factor, basic)) = d.factor.as_ref().zip(d.basic.as_ref()) else {
        return Finding::warning(
            "The table is for the six principal stiffnesses alone. The data hold no more: there is no factor form, and \
             nothing can be said about deflections under load.",
        );
    };
    let greatest = |values: &[f64; 6]| values.iter().copied().fold(0.0, f64::max);
    let error = greatest(&factor.mean);
    let at_tip = e.tip_deflection_percent.factor.as_ref().map_or(error, |f| greatest(&f.mean));
    if judged.agrees() {
        Finding::good(format!(
            "The data agree with the model: without a table (K_p) its deflections are less than {ROUNDING_PERCENT} % off at A at every pose, \
             and a table changes nothing."
        ))
    } else if (0..6).any(|i| is_worse(factor.mean[i], basic.mean[i])) {
        Finding::bad(format!("Don't use the table: it predicts deflections worse than no table ({error:.1} % off)."))
    } else if error > USABLE_PERCENT {
        Finding::warning(format!(
            "The table is rough: it predicts deflections with a mean error of {error:.1} % at A, more than {USABLE_PERCENT} %, and {at_tip:.1} % \
             at the tool's tip."
        ))
    } else if !judged.by_others {
        Finding::warning(format!(
            "The table follows its own data to {error:.1} % in deflection at A, {at_tip:.1} % at the tool's tip; no other poses have tested it."
        ))
    } else if judged.by_few() {
        Finding::warning(format!(
            "The table is hardly tested: it predicts deflections with a mean error of {error:.1} % at most at A, {at_tip:.1} % at the tool's tip, on \
             {} that it was not fitted to: fewer than {MIN_POSES} lie in one plane of θ, σ and Z0, and leave a direction of its box untested.",
            poses(e.poses)
        ))
    } else {
        Finding::good(format!(
            "The table can be used: it predicts deflections with a mean error of {error:.1} % at most at A, {at_tip:.1} % at the tool's tip, on \
             poses that it was not fitted to."
        ))
    }
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
pub(super) fn advice(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>, state: State) -> Vec<Finding> {
    let mut all = Vec::new();
    let judged = Judged::new(fit, trained, verified);
    let loaded = judged.loaded;
    if let Some((at_a, at_tip)) =
        loaded.deflection_percent.factor.as_ref().zip(loaded.tip_deflection_percent.factor.as_ref())
    {
        let [at_a, at_tip] = [at_a, at_tip].map(|f| f.max.iter().copied().fold(0.0, f64::max));
        let off =
            format!("under the worst of six loads, it is {at_a:.1} % off at A and {at_tip:.1} % at the tool's tip");
        all.push(
            Finding::good(if judged.by_others {
                format!("at the worst of {} of the verification, {off}.", poses(loaded.poses))
            } else {
                format!(
                    "at the worst of its own {}, {off}; between them it may be more, which nothing here tells.",
                    poses(loaded.poses)
                )
            })
            .sure(),
        );
    }
    let [theta, sigma, z0] = fit.extent.ranges().map(|[low, high]| format!("{low} to {high}"));
    let inside = format!("θ {theta}°, σ {sigma}°, Z0 {z0} mm");
    let select = (fit.choice != TermChoice::Select).then_some("let the fit choose its terms with --terms select");
    all.push(Finding::good(match state {
        State::Good if judged.agrees() => "nothing: the controller needs no table.".to_owned(),
        State::Good => format!("compile coefficients.rs into the controller and use the factor form, inside {inside}: outside the status says so."),
        State::Warning if judged.by_few() => {
            format!("give at least {MIN_POSES} poses with --verify, over all of {inside}.")
        }
        State::Warning => {
            let others = (!judged.by_others).then_some("give other poses with all 21 entries of K with --verify");
            let whole = loaded.deflection_percent.factor.is_none().then_some("give all 21 entries of K");
            let ways = [select, whole, others, Some("compute or measure more poses (pkm-host plan)")];
            format!("{}.", ways.into_iter().flatten().collect::<Vec<_>>().join(", or "))
        }
        State::Bad => {
            let first = select.map(|select| format!("{select}; if that is no better, ")).unwrap_or_default();
            format!("{first}check that the data are of this machine file, at A in A-uvw and in SI units.")
        }
    }).todo());
    all
}

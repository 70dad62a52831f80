//! What a search amounts to: lack of fit, verdict, and what the readings could show at all.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::extend::columns;
use crate::fit::Fit;
use crate::levels::Levels;
use crate::model::{Kind, Role, Unknown};
use crate::noise::{Noise, NoiseSource};
use crate::rules::Rules;
use crate::search::{Found, Search};
use crate::solve::Problem;

/// A test of whether the misfit is more than noise.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LackOfFit {
    /// F by repeats, reduced χ² with declared noise.
    pub statistic: f64,
    /// Probability of as much without misfit.
    pub p: f64,
    /// Where the noise is known from.
    pub noise_source: NoiseSource,
    /// Squared misfit beyond what noise may bring (its expectation and two standard deviations), in noise variances.
    #[serde(skip)]
    pub excess: f64,
}

impl LackOfFit {
    /// Variance of the readings about the model over that of their noise, as far as there is more than noise.
    pub fn scatter(&self, rules: &Rules) -> f64 {
        if self.p < rules.max_misfit_p { self.statistic.max(1.0) } else { 1.0 }
    }
}

/// Tests a fit.
pub fn lack_of_fit(problem: &Problem<'_>, noise: &Noise, fit: &Fit) -> LackOfFit {
    let n = problem.numbers() as f64;
    let (pure, pure_dof) = match noise.source {
        NoiseSource::Repeats => (problem.pure_error(), noise.dof),
        NoiseSource::Declared => (0.0, 0.0),
    };
    let dof = (n - fit.effective_parameters() - pure_dof).max(1.0);
    let misfit = (problem.chi2(fit) - pure).max(0.0);
    let (statistic, p) = match noise.source {
        NoiseSource::Repeats => {
            // the noise that whitens is the repeats' own
            let f = misfit / dof;
            (f, FisherSnedecor::new(dof, pure_dof).map_or(f64::NAN, |d| d.sf(f)))
        }
        NoiseSource::Declared => (misfit / dof, ChiSquared::new(dof).map_or(f64::NAN, |d| d.sf(misfit))),
    };
    // the noise itself is known from so many degrees of freedom only
    let unknown = if pure_dof > 0.0 { dof / pure_dof } else { 0.0 };
    let deviation = (2.0 * dof * (1.0 + unknown)).sqrt();
    LackOfFit { statistic, p, noise_source: noise.source, excess: (misfit - dof - 2.0 * deviation).max(0.0) }
}

/// A search's end with the values that predict best, both fits as of [`settled_fit`].
pub fn settled(levels: &Levels<'_>, noise: &Noise, mut search: Search) -> Option<Search> {
    let ([first, last], is_found) = (search.levels, !search.found.is_empty());
    search.base = settled_fit(levels, noise, search.base, first, false)?;
    search.fit = settled_fit(levels, noise, search.fit, last, is_found)?;
    if let Some((_, fit)) = search.steps.last_mut() {
        fit.clone_from(&search.fit);
    }
    Some(search)
}

/// A fit at a level of load errors with the values that predict best. What a formula lacks looks like errors of the loads to the
/// readings that it spoils, and values that follow these predict worse elsewhere: beside a find, or where more than noise is left,
/// they go by the declared errors alone. The linear form, and with it the uncertainty, stays that of the errors that the readings
/// suggest.
pub fn settled_fit(levels: &Levels<'_>, noise: &Noise, mut fit: Fit, level: usize, is_found: bool) -> Option<Fit> {
    let problem = &levels.problems[level];
    if level > 0
        && (is_found || lack_of_fit(problem, noise, &fit).p < problem.rules.max_misfit_p)
        // where that has no end, along a valley of two parameters, they stay as they are
        && let Some(plain) = levels.problems[0].fit_plain(&fit.unknowns, fit.x.as_slice())
    {
        fit.x = plain.x;
    }
    // at a kink the slopes of a fit are those of one side
    problem.linear(&fit.unknowns, fit.x.clone())
}

/// What a diagnosis ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing is missing; declared values may be wrong.
    Adequate,
    /// The finds leave nothing but noise.
    Explained,
    /// The finds are not all.
    PartlyExplained,
    /// The finds have rivals that call for different repairs.
    Ambiguous,
    /// More than noise is left, and no candidate accounts for it.
    Unexplained,
}

/// Everything that the verdict rests on.
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Before any finding.
    pub before: LackOfFit,
    /// With all findings.
    pub after: LackOfFit,
    /// Share of the misfit that is gone.
    pub gone: f64,
    /// Errors of the loads that nobody declared are clearly likelier than none, and larger than those that may stand beside an
    /// explanation.
    pub doubts_loads: bool,
}

/// Whether a search has found something that it cannot vouch for.
fn is_ambiguous(problem: &Problem<'_>, search: &Search) -> bool {
    let unknowns = || search.fit.unknowns.iter().zip(search.fit.x.iter());
    let follows_much = unknowns().any(|(u, _)| problem.parameter(*u).ambiguous);
    // nor may an effect lean on declared values that are farther off than these can be
    let leans =
        unknowns().any(|(u, x)| problem.parameter(*u).role == Role::Declared && x.abs() > problem.rules.large_pull_sd);
    let all = problem.model.candidates();
    let elsewhere = |f: &Found| {
        let own = &all[f.candidate];
        let rival = |c: &usize| all[*c].kind != Kind::Element && all[*c].place != own.place;
        own.kind != Kind::DeclaredValues && f.class.iter().any(rival)
    };
    follows_much || leans || search.found.iter().any(elsewhere)
}

/// Judges a search.
pub fn judge(levels: &Levels<'_>, noise: &Noise, search: &Search) -> Option<Judgement> {
    // by the errors of the loads under which both models were fitted, the declared one again
    let problem = &levels.problems[search.levels[1]];
    let rules = problem.rules;
    let (base, end) = (problem.fit(&search.base.unknowns, search.base.x.as_slice())?, &search.fit);
    let before = lack_of_fit(problem, noise, &base);
    let after = lack_of_fit(problem, noise, end);
    // what the search brought, against what was wrong to begin with
    let gained = (base.objective - end.objective).max(0.0);
    let gone = gained / (gained + after.excess).max(f64::MIN_POSITIVE);
    let kind = |f: &&Found| problem.model.candidates()[f.candidate].kind;
    let effects = search.found.iter().filter(|f| kind(f) != Kind::DeclaredValues).count();
    let measurement = search.found.iter().filter(|f| kind(f) == Kind::Measurement).count();
    let fits = after.p >= rules.max_misfit_p;
    // what only errors of the loads that nobody declared could account for is not explained
    let most = rules.max_explaining_load_error;
    let doubts_loads = levels.load_error(search.levels[1]) > most
        && levels.gain_over(end, search.levels[1], most)? >= rules.min_load_error_gain;
    let few = effects <= rules.max_explaining_effects && measurement <= rules.max_explaining_measurement_errors;
    let verdict = match (effects, fits) {
        (0, true) => Verdict::Adequate,
        (0, false) => Verdict::Unexplained,
        (_, true) if few && gone >= rules.min_explained_share && !doubts_loads => {
            if is_ambiguous(problem, search) {
                Verdict::Ambiguous
            } else {
                Verdict::Explained
            }
        }
        _ => Verdict::PartlyExplained,
    };
    Some(Judgement { verdict, before, after, gone, doubts_loads })
}

/// Least amplitudes of a candidate that would be found, alone, each with its unknown: none where no plausible one can be told
/// from re-identified declared values.
pub fn smallest_detectable(levels: &Levels<'_>, search: &Search, candidate: usize) -> Vec<(Unknown, Option<f64>)> {
    let problem = &levels.problems[search.levels[0]];
    let (rules, candidate) = (problem.rules, &problem.model.candidates()[candidate]);
    let v = columns(problem, &search.base, candidate).map(|own| search.base.remaining(&own.matrix));
    let amplitudes = candidate.unknowns.iter().filter(|u| problem.parameter(**u).is_amplitude());
    amplitudes
        .enumerate()
        .map(|(k, u)| {
            let seen = v.as_ref().map_or(0.0, |v| v[(k, k)]);
            let x = if seen > 0.0 { (rules.detectable / seen).sqrt() } else { f64::INFINITY };
            (*u, (x <= rules.max_amplitude).then(|| problem.parameter(*u).prior.value(x)))
        })
        .collect()
}

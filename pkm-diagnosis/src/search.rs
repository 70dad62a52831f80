//! What the model lacks: screen, full fits, acceptance, classes.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::class::{class_of, indistinguishable};
use crate::extend::{columns, extended};
use crate::fit::Fit;
use crate::levels::Levels;
use crate::model::{Kind, Unknown};
use crate::rules::SEED;
use crate::screening::{self, Columns, Score, Screen};

/// One candidate in one round.
#[derive(Clone, Debug)]
pub struct Ranked {
    /// Which of the model's candidates.
    pub candidate: usize,
    /// The screen.
    pub score: Score,
    /// Where its first shape began.
    pub shape: f64,
    /// Gain of 2 ln E over the model without it, by the noise that the better of both leaves; `None` when it was not
    /// fitted.
    pub gain: Option<f64>,
    /// Share of the left-out poses' squared error that it saves.
    pub left_out_gain: f64,
    /// Share of the poses that gain.
    pub poses_that_gain: f64,
    /// Share of the gain that comes from smaller deviations of declared values.
    pub from_pulls: f64,
    /// Why it was rejected.
    pub rejected: Option<&'static str>,
}

/// One round of the search.
pub struct Round {
    /// Family-wise p-value: probability of so strong a best candidate if nothing were missing.
    pub p_family: f64,
    /// Best first.
    pub ranking: Vec<Ranked>,
}

/// A finding.
#[derive(Clone, Debug)]
pub struct Found {
    /// The best.
    pub candidate: usize,
    /// What the readings cannot tell from it, itself left out.
    pub class: Vec<usize>,
    /// Probability against the candidates outside the class.
    pub confidence: f64,
}

/// What the search ends with.
pub struct Search {
    /// Declared values re-identified and nothing else.
    pub base: Fit,
    /// With all findings.
    pub fit: Fit,
    /// Level of load error that makes the readings most likely: with nothing found, and in the end.
    pub levels: [usize; 2],
    /// In the order of finding.
    pub found: Vec<Found>,
    /// What had been found after each round that found something, and the fit with it.
    pub steps: Vec<(Vec<usize>, Fit)>,
    /// What was tried.
    pub rounds: Vec<Round>,
}

/// Takes out again what the finds after it have made needless.
fn drop_needless(levels: &Levels<'_>, found: &mut Vec<Found>, level: &mut usize, fit: &mut Fit) {
    let plain = levels.plain;
    let mut n = 0;
    while n + 1 < found.len() {
        let own = &plain.model.candidates()[found[n].candidate].unknowns;
        let is_amplitude = |u: &&Unknown| plain.parameter(**u).is_amplitude();
        let has_amplitude = fit.unknowns.iter().filter(is_amplitude).any(|u| own.contains(u));
        let kept = fit.unknowns.iter().copied().zip(fit.x.iter().copied()).filter(|(u, _)| !own.contains(u));
        let (unknowns, x): (Vec<Unknown>, Vec<f64>) = kept.unzip();
        match levels.fit(&unknowns, &x, *level) {
            Some((at, without))
                if !has_amplitude
                    || 2.0 * (fit.ln_evidence() - without.ln_evidence()) / plain.temper(fit)
                        < plain.rules.min_gain[1] =>
            {
                (*level, *fit) = (at, without);
                found.remove(n);
            }
            _ => n += 1,
        }
    }
}

/// A candidate that was tried, and the fit with it.
type Tried = (Ranked, Option<(usize, Fit)>);

/// The model that candidates are tried on.
struct Current<'a> {
    levels: &'a Levels<'a>,
    level: usize,
    fit: &'a Fit,
    /// Rows by pose, and the squared error of each when it is left out.
    groups: &'a [Vec<usize>],
    left_out: Vec<f64>,
}

impl Current<'_> {
    /// Ranks a candidate by its score alone, or fits it fully.
    fn tried(&self, candidate: usize, score: Score, shape: f64, fully: bool) -> Tried {
        let mut ranked = Ranked {
            candidate,
            score,
            shape,
            gain: None,
            left_out_gain: 0.0,
            poses_that_gain: 0.0,
            from_pulls: 0.0,
            rejected: None,
        };
        if !fully {
            return (ranked, None);
        }
        let (levels, level, fit) = (self.levels, self.level, self.fit);
        let described = &levels.plain.model.candidates()[candidate];
        let with = match extended(levels, level, fit, described, &ranked.score.step, ranked.shape) {
            Ok(with) => with,
            Err(why) => {
                ranked.rejected = Some(why);
                return (ranked, None);
            }
        };
        // predictions are compared by the noise that the model without it has
        let same = || levels.problems[level].relevel(&levels.plain.linear(&with.1.unknowns, with.1.x.clone())?);
        let errors = if with.0 == level {
            with.1.left_out(self.groups)
        } else {
            same().map_or(vec![f64::INFINITY; self.groups.len()], |f| f.left_out(self.groups))
        };
        let (sum, rest): (f64, f64) = (self.left_out.iter().sum(), errors.iter().sum());
        ranked.left_out_gain = (sum - rest) / sum;
        let gaining = self.left_out.iter().zip(&errors).filter(|(a, b)| a > b).count();
        ranked.poses_that_gain = gaining as f64 / self.groups.len() as f64;
        let gain = 2.0 * (with.1.ln_evidence() - fit.ln_evidence());
        ranked.from_pulls = (fit.x.norm_squared() - with.1.x.norm_squared()) / gain;
        ranked.gain = Some(gain);
        (ranked, Some(with))
    }

    /// All open candidates, the best first, tempered by what the best of them leaves.
    fn ranking(&self, open: &[usize], columns: &[Columns], screened: &Screen) -> Vec<Tried> {
        let rules = self.levels.plain.rules;
        let mut order: Vec<usize> = (0..open.len()).collect();
        order.sort_by(|a, b| screened.scores[*b].gain.total_cmp(&screened.scores[*a].gain));
        let mut ranking: Vec<Tried> = order
            .par_iter()
            .enumerate()
            .map(|(place, i)| {
                let fully = place < rules.full_fits && screened.p_family <= rules.max_family_p;
                self.tried(open[*i], screened.scores[*i].clone(), columns[*i].shape, fully)
            })
            .collect();
        let raw = |r: &Tried| r.0.gain.unwrap_or(f64::NEG_INFINITY);
        ranking.sort_by(|a, b| raw(b).total_cmp(&raw(a)).then(a.0.score.p.total_cmp(&b.0.score.p)));
        let best = ranking.first().and_then(|r| r.1.as_ref());
        let c = best.map_or(1.0, |(_, fit)| self.levels.plain.temper(fit));
        for (r, _) in &mut ranking {
            r.gain = r.gain.map(|g| g / c);
        }
        ranking
    }
}

/// A search under way.
struct State<'a> {
    levels: &'a Levels<'a>,
    level: usize,
    fit: Fit,
    found: Vec<Found>,
    /// 2 ln E that the finds have gained together.
    gained: f64,
}

impl State<'_> {
    /// Whether a candidate may be accepted.
    fn passes(&self, r: &Ranked) -> bool {
        let rules = self.levels.plain.rules;
        let least = rules.min_gain[usize::from(!self.found.is_empty())].max(rules.min_gain_share * self.gained);
        let predicts = r.left_out_gain > 0.0 && r.poses_that_gain >= rules.min_poses_gaining;
        // stiffnesses far from their declared values may predict as well: then the smaller deviations decide
        let relieves = r.left_out_gain > -rules.max_left_out_loss && r.from_pulls > rules.min_prior_gain_share;
        r.gain.is_some_and(|g| g > least) && (predicts || relieves)
    }

    /// Takes over the best of what was tried, if it passes; returns whether it does. `columns` are of those that were open.
    fn accept(&mut self, ranking: &mut [Tried], open: &[usize], columns: &[Columns]) -> bool {
        let (problem, rules) = (self.levels.plain, self.levels.plain.rules);
        let Some(best) = ranking.iter().position(|(r, _)| self.passes(r)) else { return false };
        let top = ranking[best].0.gain.unwrap_or(0.0);
        let within = |r: &Ranked| r.gain.is_some_and(|g| top - g <= rules.min_gain[0]);
        // of what is as likely a wrong declared value is the simplest explanation, and a formula simpler than none
        let kind = |r: &Ranked| problem.model.candidates()[r.candidate].kind;
        let as_likely = |simpler: &dyn Fn(Kind) -> bool| {
            ranking.iter().position(|(r, _)| simpler(kind(r)) && within(r) && self.passes(r))
        };
        let declared = as_likely(&|kind| kind == Kind::DeclaredValues);
        let chosen = declared.or_else(|| as_likely(&|kind| kind != Kind::Element)).unwrap_or(best);
        let of = |r: &Ranked| open.iter().zip(columns).find(|(c, _)| **c == r.candidate).map(|(_, own)| own);
        let own = of(&ranking[chosen].0);
        let is_alike =
            |other: &Columns| own.is_some_and(|own| indistinguishable(&self.fit, own, other, rules.same_signal_share));
        let same = |r: &Ranked| within(r) || of(r).is_some_and(is_alike);
        let all: Vec<&Ranked> = ranking.iter().map(|(r, _)| r).collect();
        let (class, confidence) = class_of(&all, chosen, top, same);
        self.gained += ranking[chosen].0.gain.unwrap_or(0.0);
        self.found.push(Found { candidate: ranking[chosen].0.candidate, class, confidence });
        if let Some(with) = ranking[chosen].1.take() {
            (self.level, self.fit) = with;
        }
        true
    }
}

/// Candidates that may still be named: each find uses up one of the sites, the first that it could be at.
fn open(candidates: usize, found: &[Found], sites: Option<&[Vec<usize>]>) -> Vec<usize> {
    let is_new = |c: &usize| found.iter().all(|f| f.candidate != *c);
    let Some(sites) = sites else { return (0..candidates).filter(is_new).collect() };
    let mut free: Vec<&Vec<usize>> = sites.iter().collect();
    for f in found {
        if let Some(at) = free.iter().position(|s| s.contains(&f.candidate)) {
            free.remove(at);
        }
    }
    (0..candidates).filter(is_new).filter(|c| free.iter().any(|s| s.contains(c))).collect()
}

/// Searches until nothing more is accepted. With `sites`, lists of candidates of which each may give one name, nothing else is
/// named.
pub fn search(levels: &Levels<'_>, sites: Option<&[Vec<usize>]>) -> Option<Search> {
    let (plain, rules) = (levels.plain, levels.plain.rules);
    let declared = plain.model.declared();
    let (first_level, base) = levels.fit(&declared, &vec![0.0; declared.len()], 0)?;
    let groups = plain.by_pose();
    let candidates = plain.model.candidates();
    let none = || Columns { matrix: DMatrix::zeros(base.residuals.len(), 0), one_sided: Vec::new(), shape: 0.0 };
    let mut state = State { levels, level: first_level, fit: base.clone(), found: Vec::new(), gained: 0.0 };
    let (mut steps, mut rounds) = (Vec::new(), Vec::new());
    for round in 0..rules.max_rounds {
        if state.found.len() == rules.max_found {
            break;
        }
        let open = open(candidates.len(), &state.found, sites);
        if open.is_empty() {
            break;
        }
        let problem = &levels.problems[state.level];
        let of = |c: &usize| columns(problem, &state.fit, &candidates[*c]).unwrap_or_else(none);
        let open_columns: Vec<Columns> = open.par_iter().map(of).collect();
        let screened =
            screening::screen(&state.fit, &open_columns, plain.whitener.noise_dof, SEED + round as u64, rules);
        let left_out = state.fit.left_out(&groups);
        let current = Current { levels, level: state.level, fit: &state.fit, groups: &groups, left_out };
        let mut ranking = current.ranking(&open, &open_columns, &screened);
        let accepted = screened.p_family <= rules.max_family_p && state.accept(&mut ranking, &open, &open_columns);
        drop_needless(levels, &mut state.found, &mut state.level, &mut state.fit);
        if accepted {
            steps.push((state.found.iter().map(|f| f.candidate).collect(), state.fit.clone()));
        }
        rounds.push(Round { p_family: screened.p_family, ranking: ranking.into_iter().map(|(r, _)| r).collect() });
        if !accepted {
            break;
        }
    }
    let State { level, fit, found, .. } = state;
    Some(Search { base, fit, levels: [first_level, level], found, steps, rounds })
}

//! Which physics the model lacks: screen, full fits, acceptance, classes.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::SEED;
use super::model::{self, Unknown, info};
use super::screen::{self, Columns, Score};
use super::solve::{Fit, Levels, Problem};

/// Full fits in a round.
const FITTED: usize = 10;
/// Family-wise p at which something is accepted.
const P_FAMILY: f64 = 0.01;
/// Least gain of 2 ln E for the first thing that is accepted, and for more.
const LEAST_GAIN: [f64; 2] = [6.0, 10.0];
/// The same, as a share of what was gained before: a form that is nearly right leaves some of its signal, which must not
/// pass for something else.
const LEAST_SHARE: f64 = 0.03;
/// Share of the left-out poses' squared error that something may cost which is accepted for what it does to the pulls.
const HARMLESS: f64 = 0.01;
/// Most things that are found.
const MOST_FOUND: usize = 3;
/// Most rounds.
const ROUNDS: usize = 4;
/// Largest plausible amplitude, in units of its scale.
pub const LARGEST: f64 = 2.0;
/// Farthest plausible shape, in standard deviations of its prior.
const FARTHEST: f64 = 2.5;
/// Least share of signal in common at which two candidates count as the same.
const SAME: f64 = 0.9;

/// Something that the model may lack.
#[derive(Clone, Debug, PartialEq)]
pub enum Candidate {
    /// An effect, of the machine or of the measurement.
    Effect(usize),
    /// Declared stiffnesses that are wrong together.
    Class(usize),
}

impl Candidate {
    /// What is unknown of it.
    pub fn unknowns(&self, problem: &Problem<'_>) -> Vec<Unknown> {
        match *self {
            Self::Effect(effect) => {
                let mut unknowns = problem.model.of_effect(effect);
                if !problem.readings.has_unloading {
                    // a lag that grows with the load is then but a stiffer limb
                    unknowns.retain(|u| {
                        !matches!(*u, Unknown::Effect { effect, parameter }
                            if info(effect).parameters[parameter] == "lag_m_per_n")
                    });
                }
                unknowns
            }
            Self::Class(class) => vec![Unknown::Class(class)],
        }
    }

    /// Its id, or the keys of the machine file.
    pub fn names(&self, problem: &Problem<'_>) -> Vec<String> {
        match *self {
            Self::Effect(effect) => vec![info(effect).id.to_owned()],
            Self::Class(class) => problem.model.classes[class].keys(),
        }
    }
}

/// One candidate in one round.
#[derive(Clone, Debug)]
pub struct Ranked {
    /// What it is.
    pub candidate: Candidate,
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
    /// Share of the gain that comes from stiffnesses that need not move so far any more.
    pub from_pulls: f64,
    /// Why it was put aside.
    pub rejected: Option<&'static str>,
}

/// One round of the search.
pub struct Round {
    /// Probability of so strong a best candidate if nothing were missing.
    pub p_family: f64,
    /// Best first.
    pub ranking: Vec<Ranked>,
}

/// Something that was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The best.
    pub candidate: Candidate,
    /// What the data cannot tell from it, itself left out.
    pub class: Vec<Candidate>,
    /// Probability against the candidates outside the class.
    pub confidence: f64,
}

/// What the search ends with.
pub struct Search {
    /// Declared stiffnesses re-tuned and nothing else.
    pub base: Fit,
    /// With all that was found.
    pub fit: Fit,
    /// Level of load error that makes the readings most likely: with nothing found, and in the end.
    pub levels: [usize; 2],
    /// In the order of finding.
    pub found: Vec<Found>,
    /// What had been found after each round that found something, and the fit with it.
    pub steps: Vec<(Vec<Candidate>, Fit)>,
    /// What was tried.
    pub rounds: Vec<Round>,
    /// Candidates.
    pub candidates: Vec<Candidate>,
    /// Whitened columns of each at the base fit.
    pub columns: Vec<Columns>,
}

/// Rows of the whitened readings by pose.
pub fn by_pose(problem: &Problem<'_>) -> Vec<Vec<usize>> {
    let mut groups = vec![Vec::new(); problem.poses.len()];
    for (i, e) in problem.whitener.entries.iter().enumerate() {
        groups[problem.readings.conditions[e.condition].pose].push(i);
    }
    groups
}

/// What may be found in these readings.
fn candidates(problem: &Problem<'_>) -> Vec<Candidate> {
    let effects = (0..model::COUNT).filter(|effect| match info(*effect).id {
        "thermal-modulus" | "thermal-expansion" => problem.readings.has_temperature,
        _ => true,
    });
    let classes = (0..problem.model.classes.len()).map(Candidate::Class);
    effects.map(Candidate::Effect).chain(classes).collect()
}

/// Where the first shape of a candidate is tried, in standard deviations of its prior.
const SHAPES: [f64; 3] = [0.0, -1.5, 1.5];

/// Columns of a candidate's amplitudes at a fit, with the shape that promises most.
fn columns(problem: &Problem<'_>, fit: &Fit, candidate: &Candidate) -> Option<Columns> {
    let own = candidate.unknowns(problem);
    let (amplitudes, shapes): (Vec<Unknown>, Vec<Unknown>) =
        own.into_iter().partition(|u| problem.model.is_amplitude(u));
    let n = fit.unknowns.len();
    let unknowns: Vec<Unknown> = fit.unknowns.iter().chain(&amplitudes).chain(&shapes).copied().collect();
    let one_sided: Vec<bool> = amplitudes.iter().map(|u| problem.model.is_one_sided(u)).collect();
    let at = |shape: f64| {
        let mut x = fit.x.as_slice().to_vec();
        x.resize(unknowns.len(), 0.0);
        if !shapes.is_empty() {
            x[n + amplitudes.len()] = shape;
        }
        let matrix = problem.jacobian(&unknowns, &x, n..n + amplitudes.len())?;
        Some(Columns { matrix, one_sided: one_sided.clone(), shape })
    };
    if shapes.is_empty() {
        return at(0.0);
    }
    let tried = SHAPES.into_iter().filter_map(at).map(|c| (screen::gain(fit, &c), c));
    tried.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, c)| c)
}

/// χ² per freedom, at least 1: what the evidence is tempered by.
fn temper(problem: &Problem<'_>, fit: &Fit) -> f64 {
    (problem.chi2(fit) / (problem.numbers() as f64 - fit.used_freedoms()).max(1.0)).max(1.0)
}

/// Fits a candidate on top of a model. Negative amplitudes that must not be are pinned to 0, one after another.
///
/// # Errors
/// Why it is no explanation.
pub fn extended(
    levels: &Levels<'_>,
    level: usize,
    current: &Fit,
    candidate: &Candidate,
    step: &DVector<f64>,
    shape: f64,
) -> Result<(usize, Fit), &'static str> {
    let problem = &levels.problems[level];
    let (mut own, mut start) = (Vec::new(), Vec::new());
    let mut steps = step.iter().copied();
    for u in candidate.unknowns(problem) {
        let is_amplitude = problem.model.is_amplitude(&u);
        // the first shape is where the screen took it, others in their middle
        let is_first_shape = !is_amplitude && own.iter().all(|u| problem.model.is_amplitude(u));
        let first = match (is_amplitude, is_first_shape) {
            (true, _) => steps.next().unwrap_or(0.0),
            (false, true) => shape,
            (false, false) => 0.0,
        };
        if !is_amplitude || first != 0.0 {
            own.push(u);
            start.push(if is_amplitude { first.clamp(-1.0, 1.0) } else { first });
        }
    }
    if start.iter().all(|x| *x == 0.0) {
        return Err("negative compliance");
    }
    // nothing that begins so far out comes back into bounds
    if step.amax() > 3.0 * LARGEST {
        return Err("larger than plausible");
    }
    let (mut unknowns, mut start): (Vec<Unknown>, Vec<f64>) =
        (current.unknowns.iter().copied().zip(current.x.iter().copied())).chain(own.iter().copied().zip(start)).unzip();
    let tuned = current.x.iter().take(problem.model.stiffnesses().len()).any(|x| x.abs() > 3.0);
    loop {
        let mut fit = levels.fit(&unknowns, &start, level);
        if tuned {
            // the tuned values may have swallowed the effect: begin once more with the declared ones
            let declared: Vec<f64> = (unknowns.iter().zip(&start))
                .map(|(u, x)| if matches!(u, Unknown::Stiffness(_)) { 0.0 } else { *x })
                .collect();
            fit = match (fit, levels.fit(&unknowns, &declared, level)) {
                (Some(a), Some(b)) => Some(if b.1.ln_evidence() > a.1.ln_evidence() { b } else { a }),
                (a, b) => a.or(b),
            };
        }
        let (at, fit) = fit.ok_or("the fit did not converge")?;
        let one_sided = |i: &usize| problem.model.is_one_sided(&unknowns[*i]);
        let negative = (0..unknowns.len()).filter(one_sided).filter(|i| fit.x[*i] < 0.0);
        let Some(pinned) = negative.min_by(|a, b| fit.x[*a].total_cmp(&fit.x[*b])) else {
            let mine = |u: &Unknown| own.contains(u);
            let is_amplitude = |u: &Unknown| problem.model.is_amplitude(u);
            for (u, x) in unknowns.iter().zip(fit.x.iter()).filter(|(u, _)| mine(u)) {
                if is_amplitude(u) && x.abs() > LARGEST {
                    return Err("larger than plausible");
                }
                if x.abs() > FARTHEST {
                    return Err("of an implausible shape");
                }
            }
            return Ok((at, fit));
        };
        unknowns.remove(pinned);
        start.remove(pinned);
        let is_left = |u: &Unknown| own.contains(u) && problem.model.is_amplitude(u);
        if !unknowns.iter().any(is_left) {
            return Err("negative compliance");
        }
    }
}

/// Whether two candidates have the same signal, as far as the data and the other unknowns let it be seen.
fn indistinguishable(fit: &Fit, a: &Columns, b: &Columns) -> bool {
    let (a, b) = (&a.matrix, &b.matrix);
    let (na, nb) = (a.ncols(), b.ncols());
    if na == 0 || nb == 0 {
        return false;
    }
    let mut both = DMatrix::zeros(a.nrows(), na + nb);
    both.columns_mut(0, na).copy_from(a);
    both.columns_mut(na, nb).copy_from(b);
    let g = fit.remaining(&both);
    let share = |own: std::ops::Range<usize>, other: std::ops::Range<usize>| {
        let jj = g.view((own.start, own.start), (own.len(), own.len())).clone_owned();
        let kk = g.view((other.start, other.start), (other.len(), other.len())).clone_owned();
        let jk = g.view((own.start, other.start), (own.len(), other.len())).clone_owned();
        let trace = jj.trace();
        let inverse = kk.clone().pseudo_inverse(1e-6 * kk.trace().max(1e-12));
        inverse.map_or(0.0, |inverse| (&jk * inverse * jk.transpose()).trace() / trace.max(1e-12))
    };
    share(0..na, na..na + nb) >= SAME && share(na..na + nb, 0..na) >= SAME
}

/// Takes out again what the finds after it have made needless.
fn drop_needless(levels: &Levels<'_>, found: &mut Vec<Found>, level: &mut usize, fit: &mut Fit) {
    let mut n = 0;
    while n + 1 < found.len() {
        let own = found[n].candidate.unknowns(levels.plain);
        let is_amplitude = |u: &&Unknown| levels.plain.model.is_amplitude(u);
        let has_amplitude = fit.unknowns.iter().filter(is_amplitude).any(|u| own.contains(u));
        let kept: Vec<(Unknown, f64)> =
            fit.unknowns.iter().copied().zip(fit.x.iter().copied()).filter(|(u, _)| !own.contains(u)).collect();
        let (unknowns, x): (Vec<Unknown>, Vec<f64>) = kept.into_iter().unzip();
        match levels.fit(&unknowns, &x, *level) {
            Some((at, without))
                if !has_amplitude
                    || 2.0 * (fit.ln_evidence() - without.ln_evidence()) / temper(levels.plain, fit)
                        < LEAST_GAIN[1] =>
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
    fn tried(&self, candidate: Candidate, score: Score, shape: f64, fully: bool) -> Tried {
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
        let with = match extended(levels, level, fit, &ranked.candidate, &ranked.score.step, ranked.shape) {
            Ok(with) => with,
            Err(why) => {
                ranked.rejected = Some(why);
                return (ranked, None);
            }
        };
        // predictions are compared by the noise that the model without it has
        let same = levels.plain.linear(&with.1.unknowns, with.1.x.clone());
        let same = same.and_then(|plain| levels.problems[level].relevel(&plain));
        let errors = same.map_or(vec![f64::INFINITY; self.groups.len()], |f| f.left_out(self.groups));
        let (sum, rest): (f64, f64) = (self.left_out.iter().sum(), errors.iter().sum());
        ranked.left_out_gain = (sum - rest) / sum;
        let gaining = self.left_out.iter().zip(&errors).filter(|(a, b)| a > b).count();
        ranked.poses_that_gain = gaining as f64 / self.groups.len() as f64;
        let gain = 2.0 * (with.1.ln_evidence() - fit.ln_evidence());
        ranked.from_pulls = (fit.x.norm_squared() - with.1.x.norm_squared()) / gain;
        ranked.gain = Some(gain);
        (ranked, Some(with))
    }
}

/// The candidates that are one with the chosen one, and the probability of them all against the others.
fn class_of(ranking: &[Tried], chosen: usize, top: f64, same: impl Fn(&Ranked) -> bool) -> (Vec<Candidate>, f64) {
    let others = ranking.iter().enumerate().filter(|(i, (r, _))| *i != chosen && r.rejected.is_none() && same(r));
    let class: Vec<Candidate> = others.map(|(_, (r, _))| r.candidate.clone()).collect();
    let weight = |r: &Ranked| r.gain.map_or(0.0, |g| (0.5 * (g - top)).exp());
    let all: f64 = ranking.iter().map(|(r, _)| weight(r)).sum();
    let is_in = |(i, (r, _)): &(usize, &Tried)| *i == chosen || class.contains(&r.candidate);
    let in_class: f64 = ranking.iter().enumerate().filter(is_in).map(|(_, (r, _))| weight(r)).sum();
    (class, in_class / all)
}

/// Searches until nothing more is accepted.
pub fn search(levels: &Levels<'_>) -> Option<Search> {
    let plain = levels.plain;
    let stiffnesses = plain.model.stiffnesses();
    let (first_level, base) = levels.fit(&stiffnesses, &vec![0.0; stiffnesses.len()], 0)?;
    let groups = by_pose(plain);
    let candidates = candidates(plain);
    let all_columns = |fit: &Fit, level: usize| -> Vec<Columns> {
        let none = || Columns { matrix: DMatrix::zeros(base.residuals.len(), 0), one_sided: Vec::new(), shape: 0.0 };
        candidates.par_iter().map(|c| columns(&levels.problems[level], fit, c).unwrap_or_else(none)).collect()
    };
    let at_base = all_columns(&base, first_level);
    let (mut fit, mut level, mut found) = (base.clone(), first_level, Vec::<Found>::new());
    let (mut steps, mut rounds) = (Vec::new(), Vec::new());
    let mut gained = 0.0;
    for round in 0..ROUNDS {
        if found.len() == MOST_FOUND {
            break;
        }
        let columns = if round == 0 { at_base.clone() } else { all_columns(&fit, level) };
        let open: Vec<usize> =
            (0..candidates.len()).filter(|i| found.iter().all(|f| f.candidate != candidates[*i])).collect();
        let open_columns: Vec<Columns> = open.iter().map(|i| columns[*i].clone()).collect();
        let screened = screen::screen(&fit, &open_columns, SEED + round as u64);
        let mut order: Vec<usize> = (0..open.len()).collect();
        order.sort_by(|a, b| screened.scores[*b].gain.total_cmp(&screened.scores[*a].gain));
        let current = Current { levels, level, fit: &fit, groups: &groups, left_out: fit.left_out(&groups) };
        let mut ranking: Vec<Tried> = order
            .par_iter()
            .enumerate()
            .map(|(place, i)| {
                let candidate = candidates[open[*i]].clone();
                let fully = place < FITTED && screened.p_family <= P_FAMILY;
                current.tried(candidate, screened.scores[*i].clone(), open_columns[*i].shape, fully)
            })
            .collect();
        let raw = |r: &Tried| r.0.gain.unwrap_or(f64::NEG_INFINITY);
        ranking.sort_by(|a, b| raw(b).total_cmp(&raw(a)).then(a.0.score.p.total_cmp(&b.0.score.p)));
        // tempered by what the best of them leaves
        let c = ranking.first().and_then(|r| r.1.as_ref()).map_or(1.0, |r| temper(plain, &r.1));
        for (r, _) in &mut ranking {
            r.gain = r.gain.map(|g| g / c);
        }
        let least = LEAST_GAIN[usize::from(!found.is_empty())].max(LEAST_SHARE * gained);
        let passes = |r: &Ranked| {
            let predicts = r.left_out_gain > 0.0 && r.poses_that_gain >= 0.5;
            // stiffnesses far from their declared values may predict as well: then it is these that tell
            let relieves = r.left_out_gain > -HARMLESS && r.from_pulls > 0.5;
            r.gain.is_some_and(|g| g > least) && (predicts || relieves)
        };
        let accepted = ranking.iter().position(|(r, _)| passes(r)).filter(|_| screened.p_family <= P_FAMILY);
        if let Some(best) = accepted {
            let top = ranking[best].0.gain.unwrap_or(0.0);
            let within = |r: &Ranked| r.gain.is_some_and(|g| top - g <= LEAST_GAIN[0]);
            // what is as likely: a wrong declared value is the plainer explanation
            let plain = |r: &Ranked| matches!(r.candidate, Candidate::Class(_)) && within(r) && passes(r);
            let chosen = ranking.iter().position(|(r, _)| plain(r)).unwrap_or(best);
            let column_of = |c: &Candidate| &columns[candidates.iter().position(|o| o == c).unwrap_or(0)];
            let own = column_of(&ranking[chosen].0.candidate);
            let same = |r: &Ranked| within(r) || indistinguishable(&fit, own, column_of(&r.candidate));
            let (class, confidence) = class_of(&ranking, chosen, top, same);
            gained += ranking[chosen].0.gain.unwrap_or(0.0);
            let candidate = ranking[chosen].0.candidate.clone();
            found.push(Found { candidate, class, confidence });
            if let Some(with) = ranking[chosen].1.take() {
                (level, fit) = with;
            }
        }
        let stop = accepted.is_none();
        drop_needless(levels, &mut found, &mut level, &mut fit);
        if !stop {
            steps.push((found.iter().map(|f| f.candidate.clone()).collect(), fit.clone()));
        }
        rounds.push(Round { p_family: screened.p_family, ranking: ranking.into_iter().map(|(r, _)| r).collect() });
        if stop {
            break;
        }
    }
    Some(Search { base, fit, levels: [first_level, level], found, steps, rounds, candidates, columns: at_base })
}

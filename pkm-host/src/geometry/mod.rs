//! From unloaded poses to the true geometry: sizes, zeros of the joints, wrist, where the measuring frame stands.
//!
//! The controller commands the lengths that the declared geometry asks for; the machine goes where its true geometry takes it.
//! [`crate::files::unloaded`] → `start` (are the readings what they are taken for? where does the fit begin?) → `model` (the
//! core's kinematics as the engine takes them, `flaws` of the joints beside them) → fits with priors by `pkm-diagnosis` →
//! `directions` (what the readings tell), errors on poses that had no part → `json`, `report`, `write`.

mod directions;
mod flaws;
mod json;
mod model;
mod outcome;
pub mod report;
mod start;
pub mod write;

use nalgebra::DMatrix;
use pkm_diagnosis::robust::{deviation_by_median, upper_median};
use pkm_diagnosis::validation::{self, LeftOut};
use pkm_diagnosis::verdict::{LackOfFit, lack_of_fit};
use pkm_diagnosis::{
    Channel, Fit, ForwardModel, Noise, Observations, Problem, Reading, Rules, Unknown, UnknownNoise, Whitener,
};

pub use self::directions::Direction;
use self::directions::{MIN_SINGULAR, directions};
use self::flaws::Give;
use self::model::{CHANNELS, Experiment, Meaning, Model};
pub use self::outcome::{Estimate, Identification, RIVALS, Rival, RivalErrors, Suspect, Tried, TriedState, Verdict};
use self::outcome::{Frame, Located};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::unloaded::{SIGMA_COLUMN, Target, Unloaded};

/// Most steps from the optimiser's end to the very minimum.
const MAX_POLISHING_STEPS: usize = 4;
/// Gain of the objective by such a step at which the minimum is reached.
const MIN_GAIN: f64 = 1e-9;
/// Most rounds in which single readings are left out.
const MAX_ROUNDS_OF_OUTLIERS: usize = 3;
/// Most readings that are left out in a round: more are no slips.
const MAX_LEFT_OUT: usize = 3;
/// How well the compliance that each wrench of a limb meets is known where joints strain, as a factor of one standard deviation:
/// with 2 the stated deviations covered 87 to 94 % of errors, with 4 96 % (120 simulated machines each with 2.5 and 10 µm of noise).
const GIVE_SD_FACTOR: f64 = 4.0;

fn fail(unloaded: &Unloaded, message: impl Into<String>) -> Failure {
    Failure::input(message).in_file(&unloaded.source.name)
}

/// Readings as scalar observations.
fn observations(unloaded: &Unloaded) -> Observations {
    let channel = Channel { kind: 0, resolution: unloaded.resolution_m };
    Observations {
        channels: vec![channel; CHANNELS],
        pose_of: unloaded.sights.iter().map(|s| s.pose).collect(),
        readings: (unloaded.readings.iter().enumerate())
            .map(|(n, r)| Reading {
                condition: r.sight,
                repeat_of: r.sight,
                series: n,
                observed: r.observed.to_vec(),
                sigma: vec![r.sigma_m],
                covariance: None,
                drawn: Vec::new(),
            })
            .collect(),
    }
}

/// The minimum of a problem. The optimiser ends where its tolerance lets it; Newton steps with exact slopes go on from there.
fn fit(problem: &Problem<'_>, unknowns: &[Unknown], start: &[f64]) -> Option<Fit> {
    let mut fit = problem.linear(unknowns, problem.fit(unknowns, start)?.x)?;
    for _ in 0..MAX_POLISHING_STEPS {
        let slope = fit.jacobian.tr_mul(&fit.residuals) - &fit.x;
        let step = fit.information.solve(&slope);
        if !(step.dot(&slope) > MIN_GAIN) {
            break;
        }
        match problem.linear(unknowns, &fit.x + step) {
            Some(next) if next.objective <= fit.objective => fit = next,
            _ => break,
        }
    }
    Some(fit)
}

/// Unknowns by rival, and the fits.
struct Fits {
    declared: Fit,
    identified: Fit,
    with_found: Fit,
}

impl Fits {
    fn of(&self, rival: Rival) -> &Fit {
        match rival {
            Rival::Declared => &self.declared,
            Rival::Identified => &self.identified,
            Rival::WithFound => &self.with_found,
        }
    }

    /// Of all rivals, with some candidates found.
    fn new(problem: &Problem<'_>, model: &Model, found: &[usize]) -> Option<Self> {
        let measurement = model.unknowns(Meaning::is_of_measurement);
        let declared = fit(problem, &measurement, &vec![0.0; measurement.len()])?;
        let both = model.unknowns(|m| m.is_of_measurement() || m.is_of_machine());
        let identified = fit(problem, &both, &vec![0.0; both.len()])?;
        let with_found = if found.is_empty() { identified.clone() } else { extended(problem, &identified, found)? };
        Some(Self { declared, identified, with_found })
    }
}

/// A fit with candidates beside it.
fn extended(problem: &Problem<'_>, base: &Fit, candidates: &[usize]) -> Option<Fit> {
    let mut unknowns = base.unknowns.clone();
    for candidate in candidates {
        unknowns.extend(&problem.model.candidates()[*candidate].unknowns);
    }
    let mut start = base.x.as_slice().to_vec();
    start.resize(unknowns.len(), 0.0);
    fit(problem, &unknowns, &start)
}

/// What is missing beside the geometry: while the residuals are more than noise, the likeliest candidate that predicts poses left out
/// better.
fn search(problem: &Problem<'_>, noise: &Noise, identified: &Fit) -> (Vec<usize>, Vec<Tried>) {
    let rules = problem.rules;
    let candidates = problem.model.candidates();
    let groups = problem.by_pose();
    let (mut found, mut tried): (Vec<usize>, Vec<Tried>) = (Vec::new(), Vec::new());
    let mut base = identified.clone();
    while found.len() < rules.max_explaining_effects && lack_of_fit(problem, noise, &base).p < rules.max_misfit_p {
        let left_out: f64 = base.left_out(&groups).iter().sum();
        let open = (0..candidates.len()).filter(|c| !found.contains(c));
        let mut round: Vec<(usize, Fit, f64, f64)> = open
            .filter_map(|c| {
                let with = extended(problem, &base, &[c])?;
                let gain = 2.0 * (with.ln_evidence() - base.ln_evidence());
                let rest: f64 = with.left_out(&groups).iter().sum();
                Some((c, with, gain, 1.0 - rest / left_out))
            })
            .collect();
        round.sort_by(|a, b| b.2.total_cmp(&a.2));
        let Some(temper) = round.first().map(|(_, best, ..)| problem.temper(best)) else { break };
        let least = rules.min_gain[usize::from(!found.is_empty())];
        let top = round[0].2 / temper;
        let passes = top > least && round[0].3 > 0.0;
        tried.retain(|t| t.state != TriedState::Rejected);
        for (n, (c, _, gain, left_out_gain)) in round.iter().enumerate() {
            let gain = gain / temper;
            let state = match n {
                0 if passes => TriedState::Found,
                _ if passes && top - gain <= rules.min_gain[0] => TriedState::Alike,
                _ => TriedState::Rejected,
            };
            tried.push(Tried { id: candidates[*c].name(), gain, left_out_gain: *left_out_gain, state });
        }
        if !passes {
            break;
        }
        let (c, with, ..) = round.swap_remove(0);
        found.push(c);
        base = with;
    }
    (found, tried)
}

/// Readings that no noise explains, by what the identified geometry leaves. More than a few are no single errors, and stay.
fn outliers(observations: &Observations, noise: &Noise, said: &[f64], rules: &Rules) -> Vec<(usize, f64)> {
    let largest = |(n, r): (usize, &Reading)| {
        let of = |c: usize| {
            let error = r.observed[c]? - said[r.condition * CHANNELS + c];
            Some((error / noise.variance_of(observations, n, c).sqrt()).abs())
        };
        (0..CHANNELS).filter_map(of).fold(0.0, f64::max)
    };
    let all: Vec<f64> = observations.readings.iter().enumerate().map(largest).collect();
    // of the largest of three the median is above that of one, so that this is on the safe side
    let scale = upper_median(&mut all.clone()).map_or(1.0, deviation_by_median).max(1.0);
    let far = |(_, r): &(usize, f64)| *r > rules.outlier_sd * scale;
    all.into_iter().enumerate().filter(far).collect()
}

fn not_converged(unloaded: &Unloaded) -> Failure {
    fail(unloaded, "the fit of the geometry did not converge: are these readings of this machine?")
}

fn unknown_noise(unloaded: &Unloaded) -> Failure {
    let message = format!(
        "no noise of the readings is known: repeat some (same pose, target and ball), or add the column {SIGMA_COLUMN} with one \
         standard deviation of a coordinate"
    );
    fail(unloaded, message).at_column(SIGMA_COLUMN)
}

/// What the readings say of the machine.
///
/// # Errors
/// See `start`; too few numbers for the unknowns; unknown noise; held-out readings of other targets.
pub fn identify(file: &MachineFile, unloaded: &Unloaded, held_out: Option<&Unloaded>) -> Result<Identification> {
    let rules = Rules::DEFAULT;
    let held_out = held_out.map(|other| start::matched(unloaded, other)).transpose()?;
    let model = Model::new(file, unloaded, start::start(file, unloaded)?).ok_or_else(|| not_converged(unloaded))?;
    let mut kept = unloaded.clone();
    let mut suspects = Vec::new();
    for _ in 0..MAX_ROUNDS_OF_OUTLIERS {
        let study = Study::new(&model, &kept, &rules)?;
        let said = study.said(&study.fits(&[])?.identified)?;
        let found = outliers(&study.observations, &study.noise, &said, &rules);
        let line = |n: usize| kept.readings[n].line;
        let is_excluded = found.len() <= MAX_LEFT_OUT;
        suspects.extend(found.iter().map(|(n, sd)| Suspect { line: line(*n), residual_sd: *sd, is_excluded }));
        if found.is_empty() || !is_excluded {
            break;
        }
        let lines: Vec<u64> = found.iter().map(|(n, _)| line(*n)).collect();
        kept = kept.without(|r| lines.contains(&r.line));
    }
    Study::new(&model, &kept, &rules)?.identification(held_out.as_ref(), suspects)
}

/// Readings, their noise and the model together.
struct Study<'a> {
    model: &'a Model,
    unloaded: &'a Unloaded,
    rules: &'a Rules,
    experiment: Experiment<'a>,
    observations: Observations,
    noise: Noise,
    whitener: Whitener,
}

impl<'a> Study<'a> {
    fn new(model: &'a Model, unloaded: &'a Unloaded, rules: &'a Rules) -> Result<Self> {
        let observations = observations(unloaded);
        let noise = Noise::estimate(&observations, rules).map_err(|UnknownNoise { .. }| unknown_noise(unloaded))?;
        let experiment = Experiment::new(model, unloaded).ok_or_else(|| not_converged(unloaded))?;
        let whitener = Whitener::new(&observations, &noise);
        let this = Self { model, unloaded, rules, experiment, observations, noise, whitener };
        let (numbers, unknowns) =
            (this.problem().numbers(), model.unknowns(|m| m.is_of_machine() || m.is_of_measurement()));
        if 2 * numbers < 3 * unknowns.len() {
            let message = format!(
                "{numbers} scalar observations are too few for {} unknowns of machine and measurement: measure more poses",
                unknowns.len()
            );
            return Err(fail(unloaded, message));
        }
        Ok(this)
    }

    fn problem(&self) -> Problem<'_> {
        Problem::new(&self.observations, &self.whitener, &self.experiment, self.rules)
    }

    fn fits(&self, found: &[usize]) -> Result<Fits> {
        Fits::new(&self.problem(), self.model, found).ok_or_else(|| not_converged(self.unloaded))
    }

    fn said(&self, fit: &Fit) -> Result<Vec<f64>> {
        let said = self.experiment.predict(&fit.unknowns, fit.x.as_slice());
        said.ok_or_else(|| not_converged(self.unloaded))
    }

    /// Errors of predictions by rival.
    fn errors(&self, observations: &Observations, said: &[Vec<f64>]) -> RivalErrors {
        let of = |(rival, said): (Rival, &Vec<f64>)| {
            Some((rival, validation::errors(observations, &self.noise, said, |_| true, self.rules)?))
        };
        RIVALS.into_iter().zip(said).filter_map(of).collect()
    }

    /// Errors on poses that had no part in the fits.
    fn held_out(&self, other: Option<&Unloaded>, fits: &Fits, found: &[usize]) -> Result<(bool, usize, RivalErrors)> {
        if let Some(other) = other {
            let experiment = Experiment::new(self.model, other).ok_or_else(|| not_converged(other))?;
            let said = |rival| {
                let fit = fits.of(rival);
                experiment.predict(&fit.unknowns, fit.x.as_slice()).ok_or_else(|| not_converged(other))
            };
            let said = RIVALS.into_iter().map(said).collect::<Result<Vec<_>>>()?;
            return Ok((true, other.poses.len(), self.errors(&observations(other), &said)));
        }
        let refit = |is_left_out: &LeftOut<'_>| {
            let kept = self.observations.without(|r| is_left_out(self.observations.pose(r)));
            let whitener = Whitener::new(&kept, &self.noise);
            let problem = Problem::new(&kept, &whitener, &self.experiment, self.rules);
            let fits = Fits::new(&problem, self.model, found)?;
            let said = |rival| {
                let fit = fits.of(rival);
                self.experiment.predict(&fit.unknowns, fit.x.as_slice())
            };
            Some((RIVALS.into_iter().map(said).collect::<Option<Vec<_>>>()?, ()))
        };
        let said = validation::cross_validate(&self.observations, self.rules, refit);
        let (said, _) = said.ok_or_else(|| not_converged(self.unloaded))?;
        Ok((false, self.unloaded.poses.len(), self.errors(&self.observations, &said)))
    }

    fn identification(&self, held_out: Option<&Unloaded>, suspects: Vec<Suspect>) -> Result<Identification> {
        let problem = self.problem();
        let base = self.fits(&[])?;
        let (found, tried) = search(&problem, &self.noise, &base.identified);
        let fits = if found.is_empty() { base } else { self.fits(&found)? };
        let lack_of_fit = RIVALS.map(|rival| lack_of_fit(&problem, &self.noise, fits.of(rival)));
        let verdict = match (found.is_empty(), lack_of_fit[2].p >= self.rules.max_misfit_p) {
            (true, true) => Verdict::Adequate,
            (true, false) => Verdict::Unexplained,
            (false, true) => Verdict::Explained,
            (false, false) => Verdict::PartlyExplained,
        };
        let said = RIVALS.into_iter().map(|rival| self.said(fits.of(rival))).collect::<Result<Vec<_>>>()?;
        let by_reading = |said: &[f64]| {
            let of = |r: &Reading| std::array::from_fn(|c| said[r.condition * CHANNELS + c]);
            self.observations.readings.iter().map(of).collect::<Vec<[f64; CHANNELS]>>()
        };
        let sd = |n| std::array::from_fn(|c| self.noise.variance_of(&self.observations, n, c).sqrt());
        let covariance = self.covariance(&fits.with_found, &lack_of_fit[2]);
        let all = covariance.ok_or_else(|| not_converged(self.unloaded))?;
        let (estimates, covariance) = self.estimates(&fits, &all);
        let (frame, targets, balls) = self.measurement(&fits.with_found, &all);
        let mut identification = Identification {
            verdict,
            size: (problem.numbers(), self.unloaded.poses.len()),
            estimates,
            covariance,
            directions: directions(self.model, &fits.identified),
            frame,
            targets,
            balls,
            lack_of_fit,
            tried,
            errors: self.errors(&self.observations, &said),
            held_out: self.held_out(held_out, &fits, &found)?,
            suspects,
            said_m: by_reading(&said[1]),
            said_declared_m: by_reading(&said[0]),
            sd_m: (0..self.observations.readings.len()).map(sd).collect(),
            noise: self.noise.clone(),
        };
        if !identification.is_of_use() {
            identification.estimates.iter_mut().for_each(|e| e.held = e.declared);
        }
        Ok(identification)
    }

    /// Covariance of a fit: wider where more than noise is left, and where joints are off by what the limbs give, which nobody
    /// measured: by the first-order change of the fit with it.
    fn covariance(&self, fit: &Fit, lack: &LackOfFit) -> Option<DMatrix<f64>> {
        let mut covariance = fit.information.inverse() * lack.statistic.max(1.0);
        let strains = |u: &Unknown| matches!(self.model.meanings[u.0], Meaning::Flaw(_));
        if !fit.unknowns.iter().any(strains) {
            return Some(covariance);
        }
        for wrench in 0..8 {
            let give: Give = std::array::from_fn(|n| if n == wrench { GIVE_SD_FACTOR } else { 1.0 });
            let experiment = Experiment::with(self.model, self.unloaded, &give)?;
            let problem = Problem::new(&self.observations, &self.whitener, &experiment, self.rules);
            let change = &fit.residuals - problem.residuals(&fit.unknowns, fit.x.as_slice())?;
            let shift = fit.information.solve(&fit.jacobian.tr_mul(&change));
            covariance.ger(1.0, &shift, &shift, 1.0);
        }
        Some(covariance)
    }

    /// Numbers of the machine with their covariance, by the widest fit, whose covariance is `all`.
    fn estimates(&self, fits: &Fits, all: &DMatrix<f64>) -> (Vec<Estimate>, Vec<Vec<f64>>) {
        let (fit, held) = (&fits.with_found, &fits.identified);
        let by_noise = fit.information.inverse();
        let is_own = |n: &usize| self.model.meanings[fit.unknowns[*n].0].is_of_machine();
        let own: Vec<usize> = (0..fit.unknowns.len()).filter(is_own).collect();
        let scale = |n: usize| self.model.scale(fit.unknowns[n]);
        let of = |n: &usize| {
            let unknown = fit.unknowns[*n];
            let (declared, prior_sd) = (self.model.declared_value(unknown), scale(*n));
            Estimate {
                meaning: self.model.meanings[unknown.0],
                declared,
                value: declared + prior_sd * fit.x[*n],
                sd: all[(*n, *n)].sqrt().min(1.0) * prior_sd,
                prior_sd,
                identifiable: by_noise[(*n, *n)].sqrt() * MIN_SINGULAR <= 1.0,
                // its unknowns are the first of the wider fit
                held: declared + prior_sd * held.x[*n],
            }
        };
        let covariance = |i: &usize| own.iter().map(|j| all[(*i, *j)] * scale(*i) * scale(*j)).collect();
        (own.iter().map(of).collect(), own.iter().map(covariance).collect())
    }

    /// Measuring frame, targets and balls, of a fit with its covariance.
    fn measurement(
        &self,
        fit: &Fit,
        all: &DMatrix<f64>,
    ) -> (Option<Frame>, Vec<Located<Target>>, Vec<Located<String>>) {
        let values = self.model.values(&fit.unknowns, fit.x.as_slice());
        let errors = all.diagonal().map(f64::sqrt);
        let sd = |wanted: &dyn Fn(usize) -> Meaning| -> [f64; 3] {
            std::array::from_fn(|i| {
                let place = fit.unknowns.iter().position(|u| self.model.meanings[u.0] == wanted(i));
                place.map_or(0.0, |n| self.model.scale(fit.unknowns[n]) * errors[n])
            })
        };
        let has_frame = self.unloaded.sights.iter().any(|s| s.ball.is_none());
        let frame = has_frame.then(|| (self.model.frame_at(&values), [sd(&Meaning::Shift), sd(&Meaning::Turn)]));
        let targets = (self.unloaded.targets.iter().zip(&values.targets_m).enumerate())
            .map(|(n, (t, at))| (t.clone(), (*at).into(), sd(&|i| Meaning::Target(n, i))))
            .collect();
        let balls = (self.unloaded.balls.iter().zip(&values.balls_m).enumerate())
            .map(|(n, (b, at))| (b.clone(), (*at).into(), sd(&|i| Meaning::Ball(n, i))))
            .collect();
        (frame, targets, balls)
    }
}

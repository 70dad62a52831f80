//! From measured deflections to what the model lacks; the method is in docs/theory.md, Diagnosis.
//!
//! The statistics are the crate `pkm-diagnosis`, which knows no machine. Here stands what they need of this one:
//! [`crate::files::readings`] → `left_out` (what is wrong by itself) → `prepared` (readings and `model` as the engine takes them, by
//! `experiment`, and the noise) → `checks` (are the readings what they are taken for?) → the engine's search → `findings`,
//! [`compare`] (before and after, with the `residual_table`), `uncertainty` (how far its table may be off), `design` (what to
//! measure) → `json`, `sentences`, `report`, `write`.

mod advice;
mod alternatives;
pub mod badges;
pub mod campaign;
mod checks;
mod checks_of_noise;
pub mod compare;
mod condition;
mod declared;
pub(crate) mod design;
mod effects;
mod elements;
pub mod estimates;
mod experiment;
mod fates;
pub mod findings;
mod held_out;
mod inference;
mod json;
mod left_out;
mod model;
mod odd_rows;
pub(crate) mod places;
mod prepared;
pub mod quality;
mod reading_rules;
mod readings_table;
mod repeats;
pub mod report;
mod residual_plots;
mod residual_table;
pub mod sentences;
mod single_poses;
mod state;
#[cfg(test)]
mod tests;
pub(crate) mod text;
mod uncertainty;
pub mod verify;
mod warning;
mod ways;
mod within_series;
pub(crate) mod write;

use pkm_diagnosis::design::rivals;
use pkm_diagnosis::places::Inferred;
use pkm_diagnosis::residuals::{Residuals, Structure};
use pkm_diagnosis::verdict::{self, Judgement};
use pkm_diagnosis::{Noise, NoiseSource, Observations, Search, search};
pub use pkm_diagnosis::{Rules, SEED, verdict::Verdict};

use self::alternatives::alternatives;
use self::checks::Suspect;
use self::checks_of_noise::Coarse;
use self::compare::{Errors, Fitted, Predictions, Rival};
use self::effects::effects;
pub use self::effects::{ELEMENT, Effect};
use self::estimates::Estimates;
use self::experiment::observations;
use self::findings::{DeclaredFinding, Detectable};
pub use self::held_out::HeldOut;
use self::held_out::Judges;
use self::inference::{Found, Start};
use self::left_out::LeftOut;
use self::model::{Model, Recorded};
use self::places::World;
use self::prepared::{Prepared, check_units};
pub use self::warning::{Warning, WarningKind};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Readings};
use crate::files::table_numbers::UncertaintyNumbers;
use crate::progress::Progress;

/// The model after one of the finds.
pub struct Step {
    /// What had been found by then.
    pub found: Vec<String>,
    /// The machine with it.
    pub machine: pkm_core::MachineParameters,
    /// On the readings themselves.
    pub errors: Errors,
    /// On the held-out readings that were given.
    pub held_out: Option<Errors>,
}

/// A diagnosis.
pub struct Diagnosis {
    /// What speaks against the readings, to be looked at before anything else.
    pub warnings: Vec<Warning>,
    /// Readings that stand out.
    pub suspects: Vec<Suspect>,
    /// Scalar observations and different poses.
    pub size: (usize, usize),
    /// Of the readings.
    pub noise: Noise,
    /// Columns that are read in coarse steps.
    pub coarse: Vec<Coarse>,
    /// What was tried and found.
    pub search: Search,
    /// Relative error of the loads beyond the declared one, as the readings suggest.
    pub load_error: f64,
    /// What it amounts to.
    pub judgement: Judgement,
    /// Effects that were found.
    pub effects: Vec<Effect>,
    /// Places of the sets of findings that were compared, with their probabilities.
    pub alternatives: Vec<(Vec<String>, f64)>,
    /// Probability that the rest goes with no place; none by formulas.
    pub none_of_these: Option<f64>,
    /// Values that were declared wrong.
    pub declared: Vec<DeclaredFinding>,
    /// By effect.
    pub detectable: Vec<Detectable>,
    /// Whether what a pose has of its own was looked for.
    pub single_poses: bool,
    /// On the readings themselves.
    pub errors: Vec<(Rival, Errors)>,
    /// On others.
    pub held_out: HeldOut,
    /// After each find.
    pub steps: Vec<Step>,
    /// Of the residuals.
    pub structure: Vec<Structure>,
    /// What to measure next.
    pub proposals: Vec<design::Proposal>,
    /// The machine with re-identified stiffnesses and effects.
    pub machine: pkm_core::MachineParameters,
    /// How sure its parameters are, and in which condition it is.
    pub estimates: Estimates,
    /// The rivals, fitted to all readings.
    pub fitted: Fitted,
    /// How far the table of the identified model may be off; none where it has no stiffness nearby.
    pub table_uncertainty: Option<UncertaintyNumbers>,
    /// Their predictions of the readings.
    pub own: Predictions,
    /// Standard deviation of each reading and channel, zero and load cell included, m and rad.
    pub standard_deviations: Vec<[f64; CHANNELS]>,
    /// What the final model leaves of each reading and channel, whitened.
    pub standardised: Vec<Vec<f64>>,
    /// Numbers that were left out, single ones and those of rows and poses: reading and channel.
    pub left_out: Vec<(usize, usize)>,
    /// Names of candidates by round, for reports.
    pub names: Vec<Vec<String>>,
    /// The thresholds that it was made with.
    pub rules: Rules,
}

fn not_converged(readings: &Readings, noise: &Noise, warnings: &[Warning]) -> Failure {
    let usual = match noise.source {
        NoiseSource::Repeats => "are these readings of this machine, displacements of A in A-uvw?",
        NoiseSource::Declared => {
            "are these readings of this machine, displacements of A in A-uvw, and do they scatter as little as their sigma columns say?"
        }
    };
    let why = warnings.first().map_or(usual, |w| &w.message);
    Failure::input(format!("a fit did not converge: {why}")).in_file(&readings.source.name)
}

/// How a diagnosis searches for what the model lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Candidates with a formula, one after another.
    Formulas,
    /// Places first, whatever the formula; a formula is named only where a place asks for one.
    Places,
}

/// Steps of which progress is told.
const STEPS: u64 = 5;

/// Diagnoses readings.
///
/// # Errors
/// Readings that cannot be diagnosed, a fit that does not converge.
pub fn diagnose(
    file: &MachineFile,
    readings: &Readings,
    held_out: Option<&Readings>,
    method: Method,
    rules: &Rules,
    progress: &Progress<'_>,
) -> Result<Diagnosis> {
    let step = |done: u64, what: &str| progress(what, done, STEPS);
    step(0, "noise");
    let model = Model::new(file, Recorded::of(file, readings), method)
        .ok_or_else(|| Failure::input("the middle of the machine's box is out of reach").in_file(&file.source.name))?;
    checks_of_noise::constant_channels(readings)?;
    let left_out = LeftOut::new(file, readings, &model, rules);
    if let Some(failure) = left_out.refusal(readings) {
        return Err(failure);
    }
    let numbers = left_out.numbers();
    let prepared = Prepared::new(readings.without_numbers(&numbers), &model, rules)
        .map_err(|mut refusals| refusals.swap_remove(0).failure)?;
    let (given, readings) = (readings, &prepared.readings);
    let Prepared { read, noise, .. } = &prepared;
    let otherwise = prepared.taken_otherwise(file.wrist_parameters.tip_at_zero_m())?;
    if let Some(other) = held_out
        && let Some(found) = model.predict(&experiment::poses(other), &other.conditions, &[], &[])
    {
        check_units(other, &found, rules)?;
    }
    let taken_as_said = otherwise.is_none();
    // places are searched for in readings that are what they are taken for
    let method = if taken_as_said { method } else { Method::Formulas };
    let of_noise =
        checks_of_noise::of_noise(noise, rules).into_iter().chain(checks_of_noise::of_repeats(given, &numbers));
    let of_noise = of_noise.chain(checks_of_noise::of_copies(noise, readings));
    // one slip of many rows is no slip of each
    let of_left_out = left_out.warnings(given).into_iter().filter(|w| taken_as_said || w.left_out);
    let of_file = checks::of_file(readings).into_iter().chain(prepared.within_series());
    let warnings: Vec<Warning> = otherwise.into_iter().chain(of_file).chain(of_left_out).chain(of_noise).collect();
    step(1, "what the model lacks");
    let start = Start { model: &model, noise, method, taken_as_said, rules };
    let failure = not_converged(readings, noise, &warnings);
    let judged = start.search(readings, read, |found| {
        Searched { file, given, readings, held_out, read, left_out: &left_out, start: &start, found, warnings }
            .judged(progress)
    });
    judged.ok_or(failure)?
}

impl Diagnosis {
    /// See [`HeldOut::worse`]. Where nothing is found, values that were only re-identified may err a little more by their noise.
    fn worse(&self) -> Option<[f64; 2]> {
        self.held_out.worse().filter(|_| self.judgement.verdict != Verdict::Adequate)
    }

    /// Whether the final model leaves more than noise: what its values have moved by may be of what it lacks.
    fn leaves_more_than_noise(&self) -> bool {
        self.judgement.after.p < self.rules.max_misfit_p
    }
}

/// Adds to the class of each effect laws of another kind that are nearly as likely at its place, and says whether there are any.
fn add_rivals_of_laws(effects: &mut [Effect], inferred: Option<&(World, Inferred)>, rules: &Rules) -> bool {
    let Some((world, inferred)) = inferred else { return false };
    let mut is_law_open = false;
    for effect in effects.iter_mut().filter(|e| e.is_located() && !e.is_measurement()) {
        let rivals = effect.rivals_of_law(world, inferred, rules);
        is_law_open |= !rivals.is_empty();
        effect.class.extend(rivals);
    }
    is_law_open
}

/// Of every number that was read.
fn standard_deviations(noise: &Noise, given: &Observations) -> Vec<[f64; CHANNELS]> {
    let of_reading = |n| std::array::from_fn(|c| noise.variance_of(given, n, c).sqrt());
    (0..given.readings.len()).map(of_reading).collect()
}

/// A verdict that claims no more than what was found and what is known of the noise bear out.
fn restrained(verdict: Verdict, effects: &[Effect], is_law_open: bool, noise: &Noise, rules: &Rules) -> Verdict {
    // something yields for which there is no formula, or not for all that it does, so that the findings are not all
    let is_nameless = effects.iter().any(|e| e.parameters.is_empty() || e.is_in_proportion_alone());
    let is_guess = verdict == Verdict::Explained && checks_of_noise::is_little_known(noise, rules);
    match verdict {
        _ if is_nameless || is_guess => Verdict::PartlyExplained,
        // what is not located, and play where it may be softness, call for one repair or another
        Verdict::Explained if is_law_open || !effects.iter().all(Effect::is_located) => Verdict::Ambiguous,
        _ => verdict,
    }
}

/// A verdict that held-out readings bear out: an identified model that they contradict explains nothing.
fn borne_out(verdict: Verdict, is_contradicted: bool) -> Verdict {
    if is_contradicted && verdict != Verdict::Adequate { Verdict::Unexplained } else { verdict }
}

/// A search that has ended, and what it is judged by.
struct Searched<'a> {
    file: &'a MachineFile,
    /// As read, and without what is left out.
    given: &'a Readings,
    readings: &'a Readings,
    held_out: Option<&'a Readings>,
    read: &'a Observations,
    left_out: &'a LeftOut,
    start: &'a Start<'a>,
    found: Found<'a>,
    warnings: Vec<Warning>,
}

impl Searched<'_> {
    /// The verdict, the models before and after, and what to measure next.
    fn judged(self, progress: &Progress<'_>) -> Result<Diagnosis> {
        let step = |done: u64, what: &str| progress(what, done, STEPS);
        let Self { file, given, readings, held_out, read, left_out, start, found, mut warnings } = self;
        let Found { experiment, levels, noise: its_noise, search, reidentified, sites, inferred } = found;
        let (model, rules, noise) = (experiment.model, start.rules, start.noise);
        let not_converged = || not_converged(readings, its_noise, &warnings);
        let mut judgement = verdict::judge(levels, its_noise, &search).ok_or_else(not_converged)?;
        let is_found = inference::borne_out(sites, &search, judgement.after.p > rules.max_misfit_p, rules);
        let alternatives = inferred.map(|inferred| alternatives(inferred, model, &search, sites, &is_found));
        let sites: Vec<_> = sites.iter().zip(is_found).filter(|s| s.1).map(|s| s.0.clone()).collect();
        let search = inference::settled(levels, its_noise, &sites, search).ok_or_else(not_converged)?;
        let mut effects = effects(model, &search, &sites, judgement.after.scatter(rules));
        let is_law_open = add_rivals_of_laws(&mut effects, inferred, rules);
        judgement.verdict = restrained(judgement.verdict, &effects, is_law_open, noise, rules);
        let (problem, extent) = (&levels.problems[search.levels[1]], compare::extent(readings));
        step(2, "before and after");
        let fitted = Fitted::new(problem, experiment, &extent, &search, reidentified).ok_or_else(not_converged)?;
        let failed = || Failure::other("a model gives no deflection at some held-out pose");
        let own = fitted.predict(model, &experiment.poses, &readings.conditions, true).ok_or_else(failed)?;
        let judges = Judges { noise, model, rules };
        let errors = judges.errors(read, &own, &|_| true);
        let steps = judges.steps(readings, held_out, &search).ok_or_else(failed)?;
        let held = match held_out {
            Some(other) => judges.given(readings, other, &fitted).ok_or_else(failed)?,
            None => judges.left_out(readings, read, start, progress).ok_or_else(not_converged)?,
        };
        let unseen = (held_out.unwrap_or(readings), &held.said[..]);
        let table_uncertainty = judges.uncertainty(file, &fitted, &extent, unseen, judgement.after.excess);
        let contradiction = held.contradiction(&errors);
        judgement.verdict = borne_out(judgement.verdict, held.worse().is_some() || contradiction.is_some());
        step(3, "what to measure next");
        let proposals = design::propose(model, readings, its_noise, file, &rivals(levels, &search), rules);
        let residuals = Residuals::new(problem, its_noise, &search).ok_or_else(not_converged)?;
        let structure = findings::residual_structure(readings, read, &residuals);
        let mut suspects = checks::suspects(given, &left_out.gross, own.of(Rival::After), true);
        suspects.extend(checks::suspects(readings, &residuals.outliers(read, rules), own.of(Rival::After), false));
        step(4, "report");
        let name = |r: &search::Ranked| model.candidates[r.candidate].name();
        let declared = findings::declared_findings(problem, model, &search);
        warnings.extend(checks_of_noise::of_declared(&judgement.after, problem.numbers()));
        let of_change = inferred.and_then(|(world, inferred)| checks::of_change(world, inferred, readings));
        let of_result = checks::of_result(&judgement, &declared, &structure, rules);
        warnings.extend(of_result.into_iter().chain(contradiction).chain(of_change));
        Ok(Diagnosis {
            warnings,
            suspects,
            size: (problem.numbers(), problem.by_pose().len()),
            effects,
            alternatives: alternatives.unwrap_or_default(),
            none_of_these: inferred.map(|(_, inferred)| inferred.none_of_these()),
            declared,
            detectable: findings::detectable(levels, model, &search),
            single_poses: readings.poses.len() <= rules.max_single_poses,
            structure,
            machine: model.state(&search.fit.unknowns, search.fit.x.as_slice(), false).machine,
            estimates: Estimates::new(
                model,
                (&search.fit, judgement.after.scatter(rules)),
                noise,
                file.pose_box.middle_pose(),
            ),
            load_error: levels.load_error(search.levels[1]),
            noise: noise.clone(),
            coarse: checks_of_noise::coarse(read, noise),
            judgement,
            errors,
            held_out: held,
            steps,
            proposals,
            fitted,
            table_uncertainty,
            own,
            standard_deviations: standard_deviations(noise, &observations(given, model)),
            standardised: residuals.by_reading,
            left_out: left_out.numbers(),
            names: search.rounds.iter().map(|r| r.ranking.iter().map(name).collect()).collect(),
            search,
            rules: rules.clone(),
        })
    }
}

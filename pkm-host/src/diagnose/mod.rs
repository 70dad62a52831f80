//! From measured deflections to what the model lacks; the method is in docs/theory.md, Diagnosis.
//!
//! [`crate::files::readings`] → `noise` (whitened) → `doubts` (are the readings what they are taken for?) → `search` (`screen`, full fits by
//! `solve` of a `model` with unknowns) → [`verdict`], [`compare`] (before and after, with a table on the `remainder`), `next`
//! (what to measure).

pub mod compare;
mod doubts;
mod model;
pub(crate) mod next;
mod noise;
pub(crate) mod outputs;
mod remainder;
pub mod report;
mod screen;
mod search;
mod solve;
#[cfg(test)]
mod tests;
pub mod verdict;
mod words;

use serde_json::{Value, json};

use self::compare::{Errors, RIVALS, Rival, Zone};
use self::doubts::{Doubt, Suspect};
use self::model::{Unknown, info};
use self::noise::Noise;
use self::search::{Candidate, Search};
use self::solve::{Levels, Problem};
use self::verdict::{DeclaredFinding, Detectable, Judgement, Structure};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;
use crate::pose::written_units;
use crate::progress::Progress;

/// Seed of everything that is drawn: the null distribution of the screen, and resampled poses.
pub const SEED: u64 = 20_201;

/// Least poses.
const LEAST_POSES: usize = 4;

/// Held-out errors of all rivals, over all readings and by zone.
pub struct HeldOut {
    /// `given`, or by cross-validation.
    pub given: bool,
    /// Poses.
    pub poses: usize,
    /// By rival.
    pub all: Vec<(Rival, Errors)>,
    /// By zone and rival.
    pub zones: Vec<(Zone, Vec<(Rival, Errors)>)>,
}

/// An effect that was found.
pub struct Effect {
    /// Its id.
    pub id: &'static str,
    /// Index over machine and measurement.
    pub index: usize,
    /// Name, value, standard error.
    pub parameters: Vec<(&'static str, f64, f64)>,
    /// Probability against what is not in its class.
    pub confidence: f64,
    /// What the data cannot tell from it.
    pub class: Vec<String>,
}

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
    pub doubts: Vec<Doubt>,
    /// Readings that stand out.
    pub suspects: Vec<Suspect>,
    /// Numbers read and different poses.
    pub size: (usize, usize),
    /// Of the readings.
    pub noise: Noise,
    /// What was tried and found.
    pub search: Search,
    /// What it amounts to.
    pub judgement: Judgement,
    /// Effects that were found.
    pub effects: Vec<Effect>,
    /// Values that were declared wrong.
    pub declared: Vec<DeclaredFinding>,
    /// By effect.
    pub detectable: Vec<Detectable>,
    /// On the readings themselves.
    pub errors: Vec<(Rival, Errors)>,
    /// On others.
    pub held_out: HeldOut,
    /// After each find.
    pub steps: Vec<Step>,
    /// Of what is left.
    pub structure: Vec<Structure>,
    /// What to measure next.
    pub proposals: Vec<next::Proposal>,
    /// The machine with re-tuned stiffnesses and effects.
    pub machine: pkm_core::MachineParameters,
    /// The rivals, fitted to all readings.
    pub fitted: compare::Fitted,
    /// Their predictions of the readings.
    pub own: compare::Predictions,
    /// Names of candidates by round, for reports.
    pub names: Vec<Vec<String>>,
}

fn not_converged(readings: &Readings, doubts: &[Doubt]) -> Failure {
    let why = doubts.first().map_or("are these readings of this machine, displacements of A in A-uvw?", |d| &d.message);
    Failure::input(format!("a fit did not converge: {why}")).in_file(&readings.source.name)
}

/// Refuses what cannot be diagnosed, and says what is missing.
fn check(readings: &Readings, problem: &Problem<'_>) -> Result<()> {
    let fail = |message: String| Err(Failure::input(message).in_file(&readings.source.name));
    if readings.poses.len() < LEAST_POSES {
        return fail(format!(
            "{} poses cannot tell an effect from a wrong stiffness: at least {LEAST_POSES} different ones are needed, \
             20 spread over the box are good (`pkm-host plan --kind levels 5`)",
            readings.poses.len()
        ));
    }
    let unknowns = problem.model.stiffnesses().len();
    if problem.numbers() < 2 * unknowns {
        return fail(format!("{} numbers read are too few for {unknowns} unknown stiffnesses", problem.numbers()));
    }
    let Some(found) = problem.model.predict(&problem.poses, &readings.conditions, &[], &[]) else {
        return fail("the declared machine gives no deflection at some pose or load".into());
    };
    if found.iter().all(|d| d.iter().all(|v| *v == 0.0)) {
        return fail("no reading is under load".into());
    }
    // units: the model is never wrong by a factor of 100
    let mut logs = [Vec::new(), Vec::new()];
    for r in &readings.readings {
        for (kind, logs) in logs.iter_mut().enumerate() {
            let part = 3 * kind..3 * kind + 3;
            let (mut read, mut said) = (0.0_f64, 0.0_f64);
            for c in part {
                if let Some(v) = r.observed[c] {
                    read += v * v;
                    said += found[r.condition][c].powi(2);
                }
            }
            if read > 0.0 && said > 0.0 {
                logs.push(0.5 * (read / said).log10());
            }
        }
    }
    for (logs, (what, units)) in logs.iter_mut().zip([("translations", "µm"), ("rotations", "µrad")]) {
        logs.sort_by(f64::total_cmp);
        if let Some(middle) = logs.get(logs.len() / 2).filter(|m| m.abs() > 1.5) {
            return fail(format!(
                "the {what} read are {:.0e} times what the declared machine gives: are they in {units}, and loads in N and \
                 N·m?",
                10_f64.powf(*middle)
            ));
        }
    }
    Ok(())
}

/// Errors of all rivals on some of the readings.
fn all_errors(
    readings: &Readings,
    noise: &Noise,
    predictions: &compare::Predictions,
    filter: &dyn Fn(usize) -> bool,
) -> Vec<(Rival, Errors)> {
    let of = |rival: Rival| compare::errors(readings, noise, predictions.of(rival), filter);
    RIVALS.iter().filter_map(|(rival, ..)| Some((*rival, of(*rival)?))).collect()
}

/// Errors on held-out readings.
fn given(
    readings: &Readings,
    other: &Readings,
    noise: &Noise,
    model: &model::Model,
    fitted: &compare::Fitted,
) -> Option<HeldOut> {
    let poses: Vec<_> = other.poses.iter().map(|p| p.pose).collect();
    let found = fitted.predict(model, &poses, &other.conditions, false)?;
    let zones = compare::zones(readings, other);
    let by_zone = [Zone::Inside, Zone::Edge, Zone::Beyond, Zone::OtherLoads]
        .map(|zone| (zone, all_errors(other, noise, &found, &|n| zones[n] == zone)));
    Some(HeldOut {
        given: true,
        poses: other.poses.len(),
        all: all_errors(other, noise, &found, &|_| true),
        zones: by_zone.into_iter().filter(|(_, errors)| !errors.is_empty()).collect(),
    })
}

/// Errors on each pose of models that have not seen it.
fn left_out(readings: &Readings, noise: &Noise, model: &model::Model, search: &Search) -> Option<HeldOut> {
    let found = compare::cross_validate(readings, noise, model, search)?;
    let all = all_errors(readings, noise, &found, &|_| true);
    Some(HeldOut { given: false, poses: readings.poses.len(), all, zones: Vec::new() })
}

/// The effects among the finds.
fn effects(problem: &Problem<'_>, search: &Search) -> Vec<Effect> {
    let (end, model) = (&search.fit, problem.model);
    let standard_errors = end.standard_errors();
    let of = |found: &search::Found| {
        let Candidate::Effect(index) = found.candidate else { return None };
        let parameters = (end.unknowns.iter().enumerate())
            .filter_map(|(n, u)| match *u {
                Unknown::Effect { effect, parameter } if effect == index => Some((
                    info(effect).parameters[parameter],
                    model.amplitude(effect, parameter, end.x[n]),
                    model.amplitude_error(effect, parameter, end.x[n], standard_errors[n]),
                )),
                _ => None,
            })
            .collect();
        let mut class: Vec<String> = Vec::new();
        for name in found.class.iter().flat_map(|c| c.names(problem)) {
            if !class.contains(&name) {
                class.push(name);
            }
        }
        Some(Effect { id: info(index).id, index, parameters, confidence: found.confidence, class })
    };
    search.found.iter().filter_map(of).collect()
}

/// Diagnoses readings.
///
/// # Errors
/// Readings that cannot be diagnosed, a fit that does not converge.
pub fn diagnose(
    file: &MachineFile,
    readings: &Readings,
    held_out: Option<&Readings>,
    progress: &Progress<'_>,
) -> Result<Diagnosis> {
    let step = |done: u64, what: &str| progress(what, done, 5);
    step(0, "noise");
    let noise = Noise::new(readings)?;
    let model = model::Model::new(file)
        .ok_or_else(|| Failure::input("the middle of the machine's box is out of reach").in_file(&file.source.name))?;
    let whitener = noise::Whitener::new(readings, &noise);
    let plain = Problem::new(readings, &whitener, &model);
    check(readings, &plain)?;
    let otherwise = doubts::taken_otherwise(&plain, &whitener, file.wrist_parameters.tip_at_zero_m());
    let mut doubts: Vec<Doubt> = otherwise.into_iter().chain(doubts::of_file(readings)).collect();
    let whiteners = solve::whiteners(&plain, &file.uncertainty).ok_or_else(|| not_converged(readings, &doubts))?;
    let levels = Levels::new(&plain, &whiteners);
    step(1, "what the model lacks");
    let search = search::search(&levels).ok_or_else(|| not_converged(readings, &doubts))?;
    let judgement = verdict::judge(&levels, &noise, &search).ok_or_else(|| not_converged(readings, &doubts))?;
    let problem = &levels.problems[search.levels[1]];
    step(2, "before and after");
    let fitted = compare::Fitted::new(problem, &search, false).ok_or_else(|| not_converged(readings, &doubts))?;
    let failed = || Failure::other("a model gives no deflection at some held-out pose");
    let own = fitted.predict(&model, &problem.poses, &readings.conditions, true).ok_or_else(failed)?;
    let errors = all_errors(readings, &noise, &own, &|_| true);
    let steps = (search.steps.iter())
        .map(|(found, fit)| {
            let on = |readings: &Readings, as_measured: bool| {
                let poses: Vec<_> = readings.poses.iter().map(|p| p.pose).collect();
                let said = compare::predict(&model, fit, &poses, &readings.conditions, as_measured)?;
                compare::errors(readings, &noise, &said, |_| true)
            };
            Some(Step {
                found: found.iter().map(|c| c.names(problem).join(" + ")).collect(),
                machine: model.state(&fit.unknowns, fit.x.as_slice(), false).machine,
                errors: on(readings, true)?,
                held_out: held_out.and_then(|other| on(other, false)),
            })
        })
        .collect::<Option<Vec<Step>>>()
        .ok_or_else(failed)?;
    let held_out = match held_out {
        Some(other) => given(readings, other, &noise, &model, &fitted).ok_or_else(failed)?,
        None => left_out(readings, &noise, &model, &search).ok_or_else(|| not_converged(readings, &doubts))?,
    };
    step(3, "what to measure next");
    let contenders = next::contenders(&levels, &search);
    let proposals = next::propose(problem, &noise, file, &contenders);
    let residuals = verdict::Residuals::new(problem, &noise, &file.uncertainty, &search)
        .ok_or_else(|| not_converged(readings, &doubts))?;
    let structure = verdict::residual_structure(readings, &residuals);
    let suspects = doubts::suspects(readings, &residuals.by_reading, own.of(Rival::After));
    step(4, "report");
    let end = &search.fit;
    let effects = effects(problem, &search);
    let names = search
        .rounds
        .iter()
        .map(|r| r.ranking.iter().map(|r| r.candidate.names(problem).join(" + ")).collect())
        .collect();
    step(5, "report");
    let declared = verdict::declared_findings(problem, &search);
    doubts.extend(doubts::of_result(&judgement, &declared, &structure));
    Ok(Diagnosis {
        doubts,
        suspects,
        size: (problem.numbers(), readings.poses.len()),
        effects,
        declared,
        detectable: verdict::detectable(problem, &search),
        structure,
        machine: model.state(&end.unknowns, end.x.as_slice(), false).machine,
        noise,
        judgement,
        search,
        errors,
        held_out,
        steps,
        proposals,
        fitted,
        own,
        names,
    })
}

impl Diagnosis {
    /// The document of `formats.md`.
    pub fn to_json(&self) -> Value {
        let of = |errors: &[(Rival, Errors)], rival: Rival| {
            errors.iter().find(|e| e.0 == rival).map_or(Value::Null, |e| json!(e.1))
        };
        let effects: Vec<Value> = (self.effects.iter())
            .map(|e| {
                let parameters: serde_json::Map<String, Value> =
                    e.parameters.iter().map(|(n, v, s)| (n.to_string(), json!({ "value": v, "stderr": s }))).collect();
                json!({ "id": e.id, "parameters": parameters, "confidence": e.confidence, "class": e.class,
                    "of": if model::is_measurement(e.index) { "measurement" } else { "machine" },
                    "inspect": words::inspect_effect(e.id) })
            })
            .collect();
        let hidden = self.detectable.iter().filter(|d| d.is_hidden());
        let ranking: Vec<Value> = (self.search.rounds.iter().zip(&self.names))
            .map(|(round, names)| {
                let rows: Vec<Value> = (round.ranking.iter().zip(names).take(12))
                    .map(|(r, name)| {
                        json!({ "candidate": name, "statistic": r.score.statistic, "freedoms": r.score.freedoms,
                            "p": r.score.p, "gain_2_ln_evidence": r.gain, "left_out_gain": r.left_out_gain,
                            "poses_that_gain": r.poses_that_gain, "gain_from_pulls": r.from_pulls,
                            "rejected": r.rejected })
                    })
                    .collect();
                json!({ "p_family": round.p_family, "candidates": rows })
            })
            .collect();
        let mut held_out = json!({
            "poses": self.held_out.poses,
            "chosen": if self.held_out.given { "given" } else { "by cross-validation" },
        });
        for (rival, key, _) in RIVALS {
            held_out[key] = of(&self.held_out.all, rival);
        }
        let zones: serde_json::Map<String, Value> = (self.held_out.zones.iter())
            .map(|(zone, errors)| {
                let rivals: serde_json::Map<String, Value> =
                    RIVALS.iter().map(|(rival, key, _)| (key.to_string(), of(errors, *rival))).collect();
                (zone.name().to_owned(), rivals.into())
            })
            .collect();
        held_out["zones"] = zones.into();
        let micro = |v: [f64; 6]| v.map(|v| v * 1e6);
        json!({
            "verdict": self.judgement.verdict,
            "doubts": self.doubts,
            "suspect_readings": self.suspects,
            "effects": effects,
            "declared_value_findings": self.declared,
            "not_detectable": hidden.map(|d| json!({ "id": d.id, "smallest_detectable": d.text() })).collect::<Vec<_>>(),
            "detectable": self.detectable.iter().filter(|d| !d.is_hidden())
                .map(|d| json!({ "id": d.id, "smallest_detectable": d.text() })).collect::<Vec<_>>(),
            "lack_of_fit": self.judgement.before,
            "lack_of_fit_after": self.judgement.after,
            "load_error": { "direction_mrad": 1e3 * Levels::load_error(self.search.levels[1]),
                "gain": Levels::load_error(self.search.levels[1]),
                "about": "beyond the declared one, as the readings suggest" },
            "misfit_explained": self.judgement.gone,
            "noise": { "source": self.noise.source, "reading_um_urad": micro(self.noise.within),
                "series_um_urad": micro(self.noise.between) },
            "error_before": of(&self.errors, Rival::Declared),
            "error_after": of(&self.errors, Rival::After),
            "error_after_and_table": of(&self.errors, Rival::AfterAndTable),
            "error_retuned_only": of(&self.errors, Rival::Retuned),
            "error_table_only": of(&self.errors, Rival::Table),
            "holdout": held_out,
            "steps": self.steps.iter()
                .map(|s| json!({ "found": s.found, "error": s.errors, "holdout": s.held_out })).collect::<Vec<_>>(),
            "next_measurements": self.proposals.iter().map(|p| {
                let [theta_deg, sigma_deg, z0_mm] = written_units(&p.pose);
                json!({ "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm,
                    "wrench": p.wrench.to_array(), "separates": p.separates })
            }).collect::<Vec<_>>(),
            "residual_structure": self.structure,
            "ranking": ranking,
            "seed": SEED,
        })
    }
}

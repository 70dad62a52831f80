//! Readings as the statistics take them, and why some cannot be diagnosed: what `diagnose` and `check` begin with.

use nalgebra::Vector3;
use pkm_diagnosis::robust::upper_median;
use pkm_diagnosis::{Noise, Observations, Problem, Rules, UnknownNoise, Whitener};

use super::experiment::{Experiment, observations};
use super::model::Model;
use super::warning::{Warning, WarningKind};
use super::{checks, repeats, within_series};
use crate::error::{Failure, Result};
use crate::files::dataset::READ_COLUMNS;
use crate::files::readings::{CHANNELS, KINDS, Readings};

/// Readings with their noise.
pub struct Prepared<'a> {
    model: &'a Model,
    rules: &'a Rules,
    /// Without what is left out.
    pub readings: Readings,
    /// The same as the engine takes them.
    pub read: Observations,
    /// Theirs.
    pub noise: Noise,
    whitener: Whitener,
}

/// Why readings cannot be diagnosed.
pub struct Refusal {
    /// For programs.
    pub kind: WarningKind,
    /// For people.
    pub failure: Failure,
}

impl<'a> Prepared<'a> {
    /// Takes the noise of readings; what is to be left out is out of them.
    ///
    /// # Errors
    /// All reasons at once, of which there is at least one: too few poses, unknown noise.
    pub fn new(readings: Readings, model: &'a Model, rules: &'a Rules) -> std::result::Result<Self, Vec<Refusal>> {
        let read = observations(&readings, model);
        let noise = Experiment::new(model, &readings).noise(&read, rules);
        let few_poses = check_poses(&readings, rules).err();
        let few_poses = few_poses.map(|failure| Refusal { kind: WarningKind::CannotBeDiagnosed, failure });
        let of_noise = |unknown: UnknownNoise| Refusal {
            kind: WarningKind::UnknownNoise,
            failure: unknown_noise(&readings, unknown),
        };
        match (noise, few_poses) {
            (Ok(noise), None) => {
                let whitener = Whitener::new(&read, &noise);
                Ok(Self { model, rules, readings, read, noise, whitener })
            }
            (noise, few_poses) => Err(few_poses.into_iter().chain(noise.err().map(of_noise)).collect()),
        }
    }

    /// What a sensor spoils while a series is read, and repeats of another scale.
    pub fn within_series(&self) -> impl Iterator<Item = Warning> {
        let of_scale = repeats::of_other_scale(&self.readings);
        let stuck = within_series::of_stuck(&self.readings, &Experiment::new(self.model, &self.readings));
        // what sticks differs from its repeats as a drift does
        let spoiled = stuck.or_else(|| within_series::of_drift(&self.readings, &self.read, self.rules));
        spoiled.into_iter().chain(of_scale)
    }

    /// What says that the readings are in another frame, point, unit or sign than the file says, if something does; see
    /// [`checks::taken_otherwise`].
    ///
    /// # Errors
    /// Readings that cannot be diagnosed.
    pub fn taken_otherwise(&self, tip_m: Vector3<f64>) -> Result<Option<Warning>> {
        let experiment = Experiment::new(self.model, &self.readings);
        let problem = Problem::new(&self.read, &self.whitener, &experiment, self.rules);
        check(&self.readings, &problem, &experiment)?;
        Ok(checks::taken_otherwise(&problem, &self.whitener, self.model, &self.readings, tip_m))
    }
}

fn unknown_noise(readings: &Readings, unknown: UnknownNoise) -> Failure {
    let column = ["sigma_linear_um", "sigma_angular_urad"][KINDS[unknown.channel]];
    Failure::input(format!(
        "no repeats to take the noise of {} from, and no declared one above 0: repeat some readings (same pose, load and direction), \
         or add the column {column} with one standard deviation of a reading",
        READ_COLUMNS[unknown.channel]
    ))
    .in_file(&readings.source.name)
    .at_column(column)
}

/// Refuses readings at too few poses.
fn check_poses(readings: &Readings, rules: &Rules) -> Result<()> {
    let (poses, least) = (readings.read_poses(), rules.min_poses);
    if poses >= least {
        return Ok(());
    }
    let left = if poses < readings.poses.len() { "that are not left out " } else { "" };
    let message = format!(
        "{poses} {} {left}cannot tell an effect from a wrong stiffness: at least {least} different ones are needed, \
         20 spread over the box are good (`pkm-host plan --kind levels 5`)",
        if poses == 1 { "pose" } else { "poses" }
    );
    Err(Failure::input(message).in_file(&readings.source.name))
}

/// Refuses what cannot be diagnosed, and says what is missing.
fn check(readings: &Readings, problem: &Problem<'_>, experiment: &Experiment<'_>) -> Result<()> {
    let fail = |message: String| Err(Failure::input(message).in_file(&readings.source.name));
    let unknowns = problem.model.declared().len();
    if problem.numbers() < 2 * unknowns {
        return fail(format!(
            "{} scalar observations are too few for {unknowns} unknown stiffnesses",
            problem.numbers()
        ));
    }
    let Some(found) = experiment.model.predict(&experiment.poses, experiment.conditions, &[], &[]) else {
        return fail("the declared machine gives no deflection at some pose or load".into());
    };
    if found.iter().all(|d| d.iter().all(|v| *v == 0.0)) {
        return fail("no reading is under load".into());
    }
    check_units(readings, &found, problem.rules)
}

/// Refuses readings of another unit: see [`Rules::max_log10_scale`]. `found` is what the declared machine gives, by condition.
pub fn check_units(readings: &Readings, found: &[[f64; CHANNELS]], rules: &Rules) -> Result<()> {
    let mut logs = [Vec::new(), Vec::new()];
    for r in &readings.readings {
        for (kind, logs) in logs.iter_mut().enumerate() {
            let (mut read, mut said) = (0.0_f64, 0.0_f64);
            for c in (0..CHANNELS).filter(|c| KINDS[*c] == kind) {
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
        if let Some(middle) = upper_median(logs).filter(|m| m.abs() > rules.max_log10_scale) {
            let message = format!(
                "the {what} read are {:.0e} times what the declared machine gives: are they in {units}, and loads in N and \
                 N·m?",
                10_f64.powf(middle)
            );
            return Err(Failure::input(message).in_file(&readings.source.name));
        }
    }
    Ok(())
}

//! Errors of the rivals on the readings themselves and on those that had no part in a model, and how far a table may be off by them.

use pkm_diagnosis::{Noise, Observations, Rules, Search};

use super::Step;
use super::compare::{self, Errors, Fitted, Predictions, RIVALS, Rival, Zone, of};
use super::experiment::{self, observations};
use super::inference::Start;
use super::model::Model;
use super::reading_rules::MAX_HELD_OUT_PERCENT;
use super::uncertainty::{self, Unseen};
use super::warning::{Warning, WarningKind};
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Readings};
use crate::files::table_numbers::UncertaintyNumbers;
use crate::pose::PoseBox;
use crate::progress::Progress;

/// Held-out errors of all rivals, over all readings and by zone.
pub struct HeldOut {
    /// `given`, or by cross-validation.
    pub given: bool,
    /// Poses.
    pub poses: usize,
    /// By rival. Readings that were given are predicted as of a true measurement.
    pub all: Vec<(Rival, Errors)>,
    /// The same of readings that were given, predicted with the errors of the measurement that were found, if any were.
    pub as_measured: Option<Vec<(Rival, Errors)>>,
    /// By zone and rival.
    pub zones: Vec<(Zone, Vec<(Rival, Errors)>)>,
    /// Names of what the search in each fold of a cross-validation found.
    pub folds: Vec<Vec<String>>,
    /// Predictions with the residual correction table, by condition.
    pub said: Vec<[f64; CHANNELS]>,
}

impl HeldOut {
    /// Whether the readings are nearer to the identified model with the errors of the measurement that were found than to the
    /// machine alone: what was found of the sensor or the load is in readings that were given, or is not.
    pub fn is_as_measured(&self) -> bool {
        let rms = |errors: &[(Rival, Errors)]| of(errors, Rival::After).map(|e| e.linear_um_rms);
        let with = self.as_measured.as_deref().and_then(rms);
        with.zip(rms(&self.all)).is_some_and(|(with, without)| with < without)
    }

    /// Errors on the readings as they are: with errors of the measurement, or of the machine alone.
    pub fn nearest(&self) -> &[(Rival, Errors)] {
        self.as_measured.as_deref().filter(|_| self.is_as_measured()).unwrap_or(&self.all)
    }

    /// Rms errors of the translations as declared and as identified, µm, where the latter is larger: the model that came out is no
    /// improvement.
    pub fn worse(&self) -> Option<[f64; 2]> {
        let rms = |rival| of(self.nearest(), rival).map(|e| e.linear_um_rms);
        let [before, after] = [rms(Rival::Declared)?, rms(Rival::After)?];
        (after > before).then_some([before, after])
    }

    /// What speaks against readings that were given: that they are of another machine, or in other axes or signs than the readings, on which the
    /// errors are `errors`.
    pub(super) fn contradiction(&self, errors: &[(Rival, Errors)]) -> Option<Warning> {
        let percent = |errors: &[(Rival, Errors)]| of(errors, Rival::After).map(|e| e.linear_percent);
        let (own, other) = (percent(errors)?, percent(self.nearest()).filter(|_| self.given)?);
        (own < MAX_HELD_OUT_PERCENT && other > MAX_HELD_OUT_PERCENT).then(|| Warning::new(WarningKind::HeldOutContradicts, format!(
                "the identified model misses the held-out readings by {other:.0} % of their size, and the readings by {own:.1} %: are axes, \
                 signs, point and loads of the two files the same, and is it the same machine?"
            )))
    }
}

/// What errors are judged by.
pub(super) struct Judges<'a> {
    pub(super) noise: &'a Noise,
    pub(super) model: &'a Model,
    pub(super) rules: &'a Rules,
}

impl Judges<'_> {
    /// Errors of all rivals on some of the readings.
    pub(super) fn errors(
        &self,
        observations: &Observations,
        predictions: &Predictions,
        filter: &dyn Fn(usize) -> bool,
    ) -> Vec<(Rival, Errors)> {
        let of = |rival| compare::errors(observations, self.noise, predictions.of(rival), filter, self.rules);
        RIVALS.iter().filter_map(|(rival, ..)| Some((*rival, of(*rival)?))).collect()
    }

    /// Errors on held-out readings.
    pub(super) fn given(&self, readings: &Readings, other: &Readings, fitted: &Fitted) -> Option<HeldOut> {
        let (poses, observations) = (experiment::poses(other), observations(other, self.model));
        let predicted = |as_measured| fitted.predict(self.model, &poses, &other.conditions, as_measured);
        let found = predicted(false)?;
        let as_measured = if fitted.has_measurement_errors(self.model) { Some(predicted(true)?) } else { None };
        let zones = compare::zones(readings, other);
        let by_zone = [Zone::Inside, Zone::Edge, Zone::Beyond, Zone::OtherLoads]
            .map(|zone| (zone, self.errors(&observations, &found, &|n| zones[n] == zone)));
        let of_all = |found: &Predictions| self.errors(&observations, found, &|_| true);
        let mut held = HeldOut {
            given: true,
            poses: other.poses.len(),
            said: Vec::new(),
            all: of_all(&found),
            as_measured: as_measured.as_ref().map(of_all),
            zones: by_zone.into_iter().filter(|(_, errors)| !errors.is_empty()).collect(),
            folds: Vec::new(),
        };
        let nearest = as_measured.as_ref().filter(|_| held.is_as_measured()).unwrap_or(&found);
        held.said = nearest.of(Rival::AfterAndTable).to_vec();
        Some(held)
    }

    /// Errors on each pose of models that have been chosen and fitted without it.
    pub(super) fn left_out(
        &self,
        readings: &Readings,
        observations: &Observations,
        start: &Start<'_>,
        progress: &Progress<'_>,
    ) -> Option<HeldOut> {
        let (found, folds) = compare::cross_validate(readings, observations, start, progress)?;
        let all = self.errors(observations, &found, &|_| true);
        let (poses, said) = (readings.read_poses(), found.of(Rival::AfterAndTable).to_vec());
        Some(HeldOut { given: false, poses, all, as_measured: None, zones: Vec::new(), folds, said })
    }

    /// The model after each find.
    pub(super) fn steps(&self, readings: &Readings, held_out: Option<&Readings>, search: &Search) -> Option<Vec<Step>> {
        let step = |(found, fit): &(Vec<usize>, pkm_diagnosis::Fit)| {
            let on = |readings: &Readings, as_measured: bool| {
                let poses = experiment::poses(readings);
                let said = compare::predict(self.model, fit, &poses, &readings.conditions, as_measured)?;
                compare::errors(&observations(readings, self.model), self.noise, &said, |_| true, self.rules)
            };
            Some(Step {
                found: found.iter().map(|c| self.model.candidates[*c].name()).collect(),
                machine: self.model.state(&fit.unknowns, fit.x.as_slice(), false).machine,
                errors: on(readings, true)?,
                held_out: held_out.and_then(|other| on(other, false)),
            })
        };
        search.steps.iter().map(step).collect()
    }

    /// How far the table of the identified model may be off: by readings with what models say that these had no part in, and by the
    /// misfit of the readings that had one.
    pub(super) fn uncertainty(
        &self,
        file: &MachineFile,
        fitted: &Fitted,
        extent: &PoseBox,
        (readings, said): (&Readings, &[[f64; CHANNELS]]),
        misfit: f64,
    ) -> Option<UncertaintyNumbers> {
        let observations = &observations(readings, self.model);
        let unseen = Unseen { readings, observations, noise: self.noise, said, misfit };
        uncertainty::of_table(self.model, fitted, extent, file.wrist_parameters.tip_at_zero_m(), &unseen)
    }
}

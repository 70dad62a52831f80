//! Before and after: how the models err on poses that had no part in choosing them.

use std::sync::atomic::{AtomicU64, Ordering};

use pkm_diagnosis::validation::{self, KindErrors, LeftOut};
use pkm_diagnosis::{Fit, Noise, Observations, Problem, Rules, Search, Unknown};
use serde::Serialize;

use super::experiment::{self, Experiment};
use super::inference::{self, Found, Start};
use super::model::{Meaning, Model, is_measurement};
use super::residual_table::ResidualTable;
use crate::files::readings::{CHANNELS, Condition, Readings};
use crate::pose::{PoseBox, file_units};
use crate::progress::Progress;

/// Width of the edge of the measured box, relative to its half width.
const EDGE: f64 = 0.1;

/// The rivals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rival {
    /// The machine file as it is.
    Declared,
    /// The same with a table fitted to the readings.
    Table,
    /// Re-identified stiffnesses and nothing else.
    Reidentified,
    /// The identified model.
    After,
    /// The identified model with a residual correction table.
    AfterAndTable,
}

/// In the order of the reports.
pub const RIVALS: [(Rival, &str, &str); 5] = [
    (Rival::Declared, "before", "as declared"),
    (Rival::Table, "table_only", "table refitted only"),
    (Rival::Reidentified, "retuned_only", "stiffnesses re-identified only"),
    (Rival::After, "after", "identified model"),
    (Rival::AfterAndTable, "after_and_table", "the same with a residual correction table"),
];

/// Errors of one model on some readings.
#[derive(Clone, Debug, Serialize)]
pub struct Errors {
    /// Readings.
    pub readings: usize,
    /// Root mean square over readings of the length of the translation error.
    pub linear_um_rms: f64,
    /// 95 % interval of that over all poses of the kind that were taken, by resampling these, if they are
    /// enough.
    pub linear_um_rms_interval: Option<[f64; 2]>,
    /// Whether so few poses err so differently that there is no upper end: then the greatest error stands for it.
    pub linear_um_rms_interval_open: bool,
    /// Greatest length of the translation error.
    pub linear_um_max: f64,
    /// `linear_um_rms` over the root mean square of the translation.
    pub linear_percent: f64,
    /// Root mean square over readings of the length of the rotation error.
    pub angular_urad_rms: f64,
    /// `angular_urad_rms` over the root mean square of the rotation.
    pub angular_percent: f64,
    /// Reduced χ²: squared error over the noise, per scalar observation.
    pub chi2_per_dof: f64,
}

/// Of one of the rivals.
pub fn of(errors: &[(Rival, Errors)], rival: Rival) -> Option<&Errors> {
    errors.iter().find(|e| e.0 == rival).map(|e| &e.1)
}

/// Predictions of every rival, by condition.
pub struct Predictions([Vec<[f64; CHANNELS]>; 5]);

/// What the rivals were fitted to.
pub struct Fitted {
    base: Fit,
    end: Fit,
    tables: [ResidualTable; 2],
}

/// Extent of the poses that were read.
pub fn extent(readings: &Readings) -> PoseBox {
    PoseBox::of(readings.readings.iter().map(|r| &readings.poses[readings.conditions[r.condition].pose].pose))
}

/// Predictions of one fit; without errors of the measurement when the truth has none.
pub fn predict(
    model: &Model,
    fit: &Fit,
    poses: &[pkm_core::Pose<f64>],
    conditions: &[Condition],
    as_measured: bool,
) -> Option<Vec<[f64; CHANNELS]>> {
    let x: Vec<f64> = (fit.unknowns.iter().zip(fit.x.iter()))
        .map(|(u, x)| match model.meaning(*u) {
            Meaning::Effect { effect, .. } if is_measurement(effect) && !as_measured => 0.0,
            _ => *x,
        })
        .collect();
    model.predict(poses, conditions, &fit.unknowns, &x)
}

impl Fitted {
    /// The fits that a search ended with, and tables of what these leave of its readings. Stiffnesses that were re-identified
    /// otherwise than by the search are given.
    pub fn new(
        problem: &Problem<'_>,
        experiment: &Experiment<'_>,
        extent: &PoseBox,
        search: &Search,
        reidentified: Option<Fit>,
    ) -> Option<Self> {
        let (base, end) = (reidentified.unwrap_or_else(|| search.base.clone()), search.fit.clone());
        let declared = problem.residuals(&[], &[])?;
        let model = experiment.model;
        let machine = model.state(&end.unknowns, end.x.as_slice(), false).machine;
        let tables = [
            ResidualTable::fit(problem, experiment, &model.declared, &declared, extent)?,
            ResidualTable::fit(problem, experiment, &machine, &end.residuals, extent)?,
        ];
        Some(Self { base, end, tables })
    }

    /// The residual correction table of the identified model.
    pub fn residual_table(&self) -> &ResidualTable {
        &self.tables[1]
    }

    /// The fit of the identified model.
    pub fn identified(&self) -> &Fit {
        &self.end
    }

    /// Whether errors of the measurement are among what was found.
    pub fn has_measurement_errors(&self, model: &Model) -> bool {
        let of = |u: &Unknown| matches!(model.meaning(*u), Meaning::Effect { effect, .. } if is_measurement(effect));
        self.end.unknowns.iter().any(of)
    }

    /// Predictions of all rivals; see [`predict`].
    pub fn predict(
        &self,
        model: &Model,
        poses: &[pkm_core::Pose<f64>],
        conditions: &[Condition],
        as_measured: bool,
    ) -> Option<Predictions> {
        let at = |fit: &Fit| predict(model, fit, poses, conditions, as_measured);
        let plus = |a: &[[f64; CHANNELS]], table: &ResidualTable| -> Option<Vec<[f64; CHANNELS]>> {
            let b = table.predict(poses, conditions)?;
            Some(a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| a[c] + b[c])).collect())
        };
        let declared = model.predict(poses, conditions, &[], &[])?;
        let end = at(&self.end)?;
        let tables = [plus(&declared, &self.tables[0])?, plus(&end, &self.tables[1])?];
        let [table, end_and_table] = tables;
        Some(Predictions([declared, table, at(&self.base)?, end, end_and_table]))
    }
}

impl Predictions {
    /// Of one rival.
    pub fn of(&self, rival: Rival) -> &[[f64; CHANNELS]] {
        &self.0[RIVALS.iter().position(|r| r.0 == rival).unwrap_or(0)]
    }
}

/// Predictions for every reading from models that have not seen its pose, and what they were found to lack, fold by fold: the
/// whole search is made again without the poses that a fold leaves out.
pub fn cross_validate(
    readings: &Readings,
    observations: &Observations,
    start: &Start<'_>,
    progress: &Progress<'_>,
) -> Option<(Predictions, Vec<Vec<String>>)> {
    let done = AtomicU64::new(0);
    let tell = |done| {
        progress("searching without some of the poses", done, validation::folds(observations, start.rules) as u64)
    };
    tell(0);
    let of_fold = |is_left_out: &LeftOut<'_>| {
        let kept = readings.without(|r| is_left_out(readings.conditions[r.condition].pose));
        let read = experiment::observations(&kept, start.model);
        let found = start.search(&kept, &read, |found| {
            let Found { experiment, levels, noise, search, reidentified, sites, .. } = found;
            let search = inference::settled(levels, noise, sites, search)?;
            let problem = &levels.problems[search.levels[1]];
            let fitted = Fitted::new(problem, experiment, &extent(&kept), &search, reidentified)?;
            let said = fitted.predict(experiment.model, &experiment.poses, &readings.conditions, true)?;
            let names = search.found.iter().map(|f| experiment.model.candidates[f.candidate].name()).collect();
            Some((said.0.map(Vec::into_flattened).into(), names))
        })?;
        tell(done.fetch_add(1, Ordering::Relaxed) + 1);
        found
    };
    let (said, names) = validation::cross_validate(observations, start.rules, of_fold)?;
    let tables: Vec<Vec<[f64; CHANNELS]>> = said.iter().map(|f| f.as_chunks().0.to_vec()).collect();
    Some((Predictions(tables.try_into().ok()?), names))
}

/// Where a held-out reading lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Zone {
    /// Inside the measured box, under a load of a size and direction that was measured.
    Inside,
    /// The same, within a tenth of the half width of its edge.
    Edge,
    /// Outside the measured box.
    Beyond,
    /// Inside, under a load beyond those that were measured.
    OtherLoads,
}

impl Zone {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inside => "inside",
            Self::Edge => "edge",
            Self::Beyond => "beyond",
            Self::OtherLoads => "other_loads",
        }
    }
}

/// Zones of the readings of one file with respect to those of another.
pub fn zones(measured: &Readings, held_out: &Readings) -> Vec<Zone> {
    let extent = extent(measured);
    let components = |c: &Condition| <[f64; 6]>::from(c.wrench.to_vector());
    let loads: Vec<[f64; 6]> = measured.conditions.iter().map(components).collect();
    // a load is like a measured one along it, between zero and its own size
    let known = |w: [f64; 6]| {
        loads.iter().any(|l| {
            let size = |v: &[f64; 6]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            let (along, a, b) = (w.iter().zip(l).map(|(w, l)| w * l).sum::<f64>(), size(&w), size(l));
            a == 0.0 || (along > 0.999 * a * b && a <= b * (1.0 + 1e-9))
        })
    };
    held_out
        .readings
        .iter()
        .map(|r| {
            let c = &held_out.conditions[r.condition];
            let pose = file_units(&held_out.poses[c.pose].pose);
            let depth = pose.iter().zip(extent.ranges()).map(|(v, [low, high])| {
                let half = 0.5 * (high - low);
                if half > 0.0 { (half - (v - 0.5 * (low + high)).abs()) / half } else { 1.0 }
            });
            let depth = depth.fold(f64::INFINITY, f64::min);
            if depth < -1e-9 {
                Zone::Beyond
            } else if !known(components(c)) {
                Zone::OtherLoads
            } else if depth < EDGE {
                Zone::Edge
            } else {
                Zone::Inside
            }
        })
        .collect()
}

/// Errors of predictions by condition on some of the readings.
pub fn errors(
    observations: &Observations,
    noise: &Noise,
    predictions: &[[f64; CHANNELS]],
    of: impl Fn(usize) -> bool,
    rules: &Rules,
) -> Option<Errors> {
    let found = validation::errors(observations, noise, predictions.as_flattened(), of, rules)?;
    let [linear, angular]: [KindErrors; 2] = found.kinds.try_into().ok()?;
    let micro = |si: f64| si * 1e6;
    let linear_um_max = micro(linear.max);
    let interval = linear.rms_interval.map(|i| i.map(micro));
    Some(Errors {
        readings: found.readings,
        linear_um_rms: micro(linear.rms),
        linear_um_rms_interval: interval.map(|[low, high]| [low.min(linear_um_max), high.min(linear_um_max)]),
        linear_um_rms_interval_open: interval.is_some_and(|[_, high]| high > linear_um_max),
        linear_um_max,
        linear_percent: linear.percent,
        angular_urad_rms: micro(angular.rms),
        angular_percent: angular.percent,
        chi2_per_dof: found.chi2_per_dof,
    })
}

//! Before and after: how the models err on poses that had no part in choosing them.

use serde::Serialize;

use super::SEED;
use super::model::{Model, Unknown, is_measurement};
use super::noise::{Noise, Whitener};
use super::remainder::Remainder;
use super::search::Search;
use super::solve::{Fit, Problem};
use crate::files::readings::{CHANNELS, Condition, Readings};
use crate::pose::{PoseBox, file_units};

/// Resamples of the poses for intervals.
const RESAMPLES: usize = 1000;
/// Least poses that are resampled.
const LEAST_POSES: usize = 5;
/// Folds of the cross-validation.
const FOLDS: usize = 10;
/// Width of the edge of the measured box, relative to its half width.
const EDGE: f64 = 0.1;

/// The rivals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rival {
    /// The machine file as it is.
    Declared,
    /// The same with a table fitted to the readings.
    Table,
    /// Declared stiffnesses re-tuned and nothing else.
    Retuned,
    /// With what was found.
    After,
    /// The same with a table on what is left.
    AfterAndTable,
}

/// In the order of the reports.
pub const RIVALS: [(Rival, &str, &str); 5] = [
    (Rival::Declared, "before", "as declared"),
    (Rival::Table, "table_only", "table refitted only"),
    (Rival::Retuned, "retuned_only", "stiffnesses re-tuned only"),
    (Rival::After, "after", "with what was found"),
    (Rival::AfterAndTable, "after_and_table", "the same, and a table on the remainder"),
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
    /// Squared error over the noise, a number read.
    pub chi2_per_dof: f64,
}

/// Predictions of every rival, by condition.
pub struct Predictions([Vec<[f64; CHANNELS]>; 5]);

/// What the rivals were fitted to.
pub struct Fitted {
    base: Fit,
    end: Fit,
    tables: [Remainder; 2],
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
        .map(|(u, x)| match u {
            Unknown::Effect { effect, .. } if is_measurement(*effect) && !as_measured => 0.0,
            _ => *x,
        })
        .collect();
    model.predict(poses, conditions, &fit.unknowns, &x)
}

impl Fitted {
    /// Fits all rivals to some readings, beginning where a search ended.
    pub fn new(problem: &Problem<'_>, search: &Search, again: bool) -> Option<Self> {
        let fit = |fit: &Fit| if again { problem.fit(&fit.unknowns, fit.x.as_slice()) } else { Some(fit.clone()) };
        let (base, end) = (fit(&search.base)?, fit(&search.fit)?);
        let extent = extent(problem.readings);
        let declared = problem.residuals(&[], &[])?;
        let machine = |fit: &Fit| problem.model.state(&fit.unknowns, fit.x.as_slice(), false).machine;
        let tables = [
            Remainder::fit(problem, &problem.model.declared, &declared, &extent)?,
            Remainder::fit(problem, &machine(&end), &end.residuals, &extent)?,
        ];
        Some(Self { base, end, tables })
    }

    /// The table on what is left after everything that was found.
    pub fn remainder(&self) -> &Remainder {
        &self.tables[1]
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
        let plus = |a: &[[f64; CHANNELS]], table: &Remainder| -> Option<Vec<[f64; CHANNELS]>> {
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

/// Predictions for every reading from models that have not seen its pose.
pub fn cross_validate(readings: &Readings, noise: &Noise, model: &Model, search: &Search) -> Option<Predictions> {
    let folds = FOLDS.min(readings.poses.len());
    let mut all: Option<Predictions> = None;
    for fold in 0..folds {
        let left_out = |r: &crate::files::readings::Reading| readings.conditions[r.condition].pose % folds == fold;
        let kept = readings.without(left_out);
        let whitener = Whitener::new(&kept, noise);
        let problem = Problem::new(&kept, &whitener, model);
        let fitted = Fitted::new(&problem, search, true)?;
        let found = fitted.predict(model, &problem.poses, &readings.conditions, true)?;
        match &mut all {
            None => all = Some(found),
            Some(all) => {
                for (all, found) in all.0.iter_mut().zip(&found.0) {
                    for (n, _) in readings.conditions.iter().enumerate().filter(|(_, c)| c.pose % folds == fold) {
                        all[n] = found[n];
                    }
                }
            }
        }
    }
    all
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
    let components = |c: &Condition| c.wrench.to_array();
    let loads: Vec<[f64; 6]> = measured.conditions.iter().map(components).collect();
    // a load is like a measured one when each component is: its own size, a zero, or a size between
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
    readings: &Readings,
    noise: &Noise,
    predictions: &[[f64; CHANNELS]],
    of: impl Fn(usize) -> bool,
) -> Option<Errors> {
    let mut by_pose: Vec<(f64, f64)> = vec![(0.0, 0.0); readings.poses.len()];
    let (mut linear, mut angular, mut size, mut turn, mut largest) = (0.0, 0.0, 0.0, 0.0, 0.0_f64);
    let (mut count, mut chi2, mut numbers) = (0, 0.0, 0.0);
    for (_, r) in readings.readings.iter().enumerate().filter(|(n, _)| of(*n)) {
        let found = &predictions[r.condition];
        let (mut squares, mut sizes) = ([0.0; 2], [0.0; 2]);
        for c in 0..CHANNELS {
            let Some(observed) = r.observed[c] else { continue };
            let error = found[c] - observed;
            squares[c / 3] += error * error;
            sizes[c / 3] += observed * observed;
            let variance = noise.within[c].powi(2) + noise.between[c].powi(2);
            chi2 += error * error / variance;
            numbers += 1.0;
        }
        count += 1;
        linear += squares[0];
        angular += squares[1];
        size += sizes[0];
        turn += sizes[1];
        largest = largest.max(squares[0]);
        let pose = &mut by_pose[readings.conditions[r.condition].pose];
        pose.0 += squares[0];
        pose.1 += 1.0;
    }
    by_pose.retain(|p| p.1 > 0.0);
    if count == 0 {
        return None;
    }
    let rms = |sum: f64| (sum / f64::from(count)).sqrt() * 1e6;
    let percent = |a: f64, b: f64| if b > 0.0 { 100.0 * (a / b).sqrt() } else { 0.0 };
    let linear_um_max = largest.sqrt() * 1e6;
    let interval = interval(&by_pose).map(|i| i.map(|squared| squared.sqrt() * 1e6));
    Some(Errors {
        readings: count as usize,
        linear_um_rms: rms(linear),
        linear_um_rms_interval: interval.map(|[low, high]| [low.min(linear_um_max), high.min(linear_um_max)]),
        linear_um_rms_interval_open: interval.is_some_and(|[_, high]| high > linear_um_max),
        linear_um_max,
        linear_percent: percent(linear, size),
        angular_urad_rms: rms(angular),
        angular_percent: percent(angular, turn),
        chi2_per_dof: chi2 / numbers,
    })
}

/// ln of the mean of squared errors, given by pose as their sum and count, and its standard error but for a factor that
/// follows from the number of poses, and cancels.
fn log_mean(poses: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let (sum, count) = poses.clone().fold((0.0, 0.0), |(s, c), p| (s + p.0, c + p.1));
    let mean = sum / count;
    let scatter: f64 = poses.map(|p| (p.0 - mean * p.1).powi(2)).sum();
    (mean.ln(), scatter.sqrt() / sum)
}

/// 95 % interval of the mean of squared errors by resampling poses, studentised, on the logarithm: plain quantiles of
/// resampled means cover too little with some twenty poses of which a few err most.
fn interval(by_pose: &[(f64, f64)]) -> Option<[f64; 2]> {
    if by_pose.len() < LEAST_POSES {
        return None;
    }
    let (middle, error) = log_mean(by_pose.iter().copied());
    let mut rng = fastrand::Rng::with_seed(SEED);
    let mut studentised: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn: Vec<(f64, f64)> = (0..by_pose.len()).map(|_| by_pose[rng.usize(..by_pose.len())]).collect();
            let (there, error) = log_mean(drawn.iter().copied());
            (there - middle) / error
        })
        .filter(|t| t.is_finite())
        .collect();
    studentised.sort_by(f64::total_cmp);
    let quantile = |q: f64| studentised.get((q * studentised.len() as f64) as usize);
    let (low, high) = (quantile(0.975)?, quantile(0.025)?);
    Some([low, high].map(|t| (middle - t * error).exp()))
}

//! What speaks against the readings themselves: a frame, sign, point or unit other than the file's, a series that cannot be
//! one, single readings that stand out.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DVector, Matrix3, Vector3};
use pkm_diagnosis::places::Inferred;
use pkm_diagnosis::residuals::{Outlier, Structure};
use pkm_diagnosis::verdict::Judgement;
use pkm_diagnosis::{Fit, Problem, Rules, Whitener};
use rayon::prelude::*;
use serde::Serialize;

use super::experiment::{self, Experiment};
use super::findings::DeclaredFinding;
use super::model::Model;
use super::places::World;
use super::reading_rules::{MAX_ALIKE_RATIO, MAX_LEFT_WITH_LEVER, MAX_LEVER_M, MIN_LEVER_M};
use super::warning::{Warning, WarningKind};
use super::ways::{self, other_ways};
use crate::files::dataset::READ_COLUMNS;
use crate::files::pose::NamedPose;
use crate::files::readings::{CHANNELS, Readings};

/// Residuals over their noise from which on another way to take the readings does not fit well either.
const MISFIT_SD: f64 = 10.0;

/// A reading that stands out.
#[derive(Clone, Debug, Serialize)]
pub struct Suspect {
    /// Line of the file.
    pub line: u64,
    /// Its column.
    pub column: &'static str,
    /// As read, in µm or µrad.
    pub value: f64,
    /// As the final model gives it.
    pub expected: f64,
    /// Residual in robust standard deviations of its channel.
    pub residual_sd: f64,
    /// Whether it was left out: a gross error.
    pub excluded: bool,
}

impl Suspect {
    /// For people.
    pub fn text(&self) -> String {
        let left_out = if self.excluded { "; it was left out" } else { "" };
        format!(
            "line {}, {}: read {:.2}, expected {:.2}, {:.0} times the scatter of the others{left_out}",
            self.line, self.column, self.value, self.expected, self.residual_sd
        )
    }
}

/// What a linear form at the declared values leaves of some residuals when the stiffnesses move as their uncertainty lets
/// them, in noise variances a number: residuals and deviations from the declared values together.
fn left(linear: &Fit, residuals: &DVector<f64>, model: &Model) -> f64 {
    let along = linear.jacobian.tr_mul(residuals);
    let step = linear.information.solve(&along);
    let share = model.share_of_step(&step);
    let rest = residuals.norm_squared() - (2.0 - share) * share * along.dot(&step);
    rest.max(0.0) / residuals.len() as f64
}

/// How far from where the file has them the loads act for the least residuals, in A-uvw, m: forces that were put on at a tool or a
/// clamp, whose lever nobody noted. None below what a load may be off by anyway.
fn lever(
    as_said: &Fit,
    residuals_of: &(dyn Fn(&Readings) -> Option<DVector<f64>> + Sync),
    readings: &Readings,
) -> Option<Vector3<f64>> {
    const TRIED_M: f64 = 0.1;
    let turned = |axis: usize| {
        let moved = ways::with_lever(readings, Vector3::ith(axis, TRIED_M));
        Some((residuals_of(&moved)? - &as_said.residuals) / TRIED_M)
    };
    let columns = [turned(0)?, turned(1)?, turned(2)?];
    // of what no stiffness mends
    let inner = |a: &DVector<f64>, b: &DVector<f64>| {
        let mended = as_said.information.solve(&as_said.jacobian.tr_mul(b));
        a.dot(b) - as_said.jacobian.tr_mul(a).dot(&mended)
    };
    // where nothing tells, it is as the file says
    let weak = 1.0 / MAX_LEVER_M.powi(2);
    let information = Matrix3::from_fn(|i, j| inner(&columns[i], &columns[j]) + if i == j { weak } else { 0.0 });
    let along = Vector3::from_fn(|i, _| inner(&columns[i], &as_said.residuals));
    let lever_m = -information.cholesky()?.solve(&along);
    (MIN_LEVER_M..MAX_LEVER_M).contains(&lever_m.norm()).then_some(lever_m)
}

/// Whether the readings fit the declared machine much better when they are taken otherwise. Linearised, so that there is
/// an answer even where no fit converges.
pub fn taken_otherwise(
    problem: &Problem<'_>,
    whitener: &Whitener,
    model: &Model,
    readings: &Readings,
    tip_m: Vector3<f64>,
) -> Option<Warning> {
    let stiffnesses = problem.model.declared();
    let declared = vec![0.0; stiffnesses.len()];
    let at_declared = |problem: &Problem<'_>| problem.linear(&stiffnesses, declared.clone().into());
    let as_said = at_declared(problem)?;
    let left = |linear: &Fit, residuals: &DVector<f64>| left(linear, residuals, model);
    let said = left(&as_said, &as_said.residuals);
    let residuals_of = |taken: &Readings| {
        let (observations, experiment) = (experiment::observations(taken, model), Experiment::new(model, taken));
        Problem::new(&observations, whitener, &experiment, problem.rules).residuals(&[], &[])
    };
    let lever = lever(&as_said, &residuals_of, readings).map(|lever_m| ways::levered(readings, lever_m));
    let ways = other_ways(readings, tip_m).into_iter().map(|way| (way, f64::INFINITY));
    let ways: Vec<_> = ways.chain(lever.map(|way| (way, MAX_LEFT_WITH_LEVER))).collect();
    let found: Vec<(String, f64)> = ways
        .into_par_iter()
        .filter_map(|(way, most)| {
            let taken = (way.taken)()?;
            let (observations, experiment) = (experiment::observations(&taken, model), Experiment::new(model, &taken));
            let other = Problem::new(&observations, whitener, &experiment, problem.rules);
            let residuals = other.residuals(&[], &[])?;
            // no stiffness mends what is worse to begin with
            if residuals.norm_squared() >= as_said.residuals.norm_squared() {
                return None;
            }
            let rest =
                if way.is_as_predicted { left(&as_said, &residuals) } else { left(&at_declared(&other)?, &residuals) };
            (rest < most).then_some((way.how, rest))
        })
        .collect();
    // of what is alike the first two, which are the plainest
    let least = found.iter().map(|f| f.1).fold(f64::INFINITY, f64::min);
    let alike: Vec<&(String, f64)> = found.iter().filter(|f| f.1 <= MAX_ALIKE_RATIO * least).take(2).collect();
    let (_, rest) = alike.first()?;
    let how = alike.iter().map(|f| f.0.as_str()).collect::<Vec<_>>().join(", or ");
    let times = |left: f64| format!("{:.1}", left.sqrt());
    let other =
        if rest.sqrt() > MISFIT_SD { ", which is not well either: more than one thing may be otherwise" } else { "" };
    (*rest < said / problem.rules.min_rss_ratio).then(|| Warning::new(WarningKind::ReadingsTakenOtherwise, format!(
            "the readings fit the declared machine much better {how} (residuals of {} times their noise{other}) than as the file says, \
             displacements of A in A-uvw under loads at A ({} times): are they?",
            times(*rest),
            times(said)
        )))
}

/// What the file itself gives away: series and names of poses that stand at several poses.
pub fn of_file(readings: &Readings) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut poses_of: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for r in readings.readings.iter().filter(|r| !readings.series_names[r.series].is_empty()) {
        poses_of.entry(r.series).or_default().insert(readings.conditions[r.condition].pose);
    }
    let wide: Vec<_> = poses_of.iter().filter(|(_, poses)| poses.len() > 1).collect();
    if let Some((series, poses)) = wide.first() {
        let others = if wide.len() > 1 { format!(", {} more at several", wide.len() - 1) } else { String::new() };
        warnings.push(Warning::new(WarningKind::SeriesAtSeveralPoses, format!(
                "series {} stands at {} poses{others}: the readings of a series share the error of one zero reading; if the \
                 sensor was zeroed anew at each pose, number the series through",
                readings.series_names[**series],
                poses.len()
            )));
    }
    let mut firsts: BTreeMap<&str, &NamedPose> = BTreeMap::new();
    let mut twice = Vec::new();
    for pose in readings.poses.iter().filter(|pose| !pose.id.is_empty()) {
        match firsts.entry(&pose.id) {
            Entry::Occupied(first) => twice.push((*first.get(), pose)),
            Entry::Vacant(free) => _ = free.insert(pose),
        }
    }
    if let Some((first, other)) = twice.first() {
        let more = if twice.len() > 1 { format!(" (and {} more)", twice.len() - 1) } else { String::new() };
        warnings.push(Warning::new(WarningKind::PoseNameAtSeveralPositions, format!(
                "pose {} stands at other coordinates in line {} than in line {}{more}: they are taken as different poses: is \
                 one of them mistyped?",
                other.id, other.line, first.line
            )));
    }
    warnings
}

/// What the result gives away.
pub fn of_result(
    judgement: &Judgement,
    declared: &[DeclaredFinding],
    structure: &[Structure],
    rules: &Rules,
) -> Vec<Warning> {
    let limit = rules.implausible_pull_sd;
    let mut warnings = Vec::new();
    let great = declared.iter().filter(|f| f.pull_sd.abs() > limit).count();
    if great > rules.max_implausible_pulls {
        warnings.push(Warning::new(
            WarningKind::ManyGreatChanges,
            format!(
                "{great} declared values would have to change by more than {limit} standard deviations: a wrong frame, \
                 point, unit or sign of the readings is likelier than so many wrong stiffnesses"
            ),
        ));
    }
    let order = structure.iter().find(|s| s.factor == "order");
    if order.is_some_and(|s| s.p < rules.max_order_p && s.share > rules.min_order_share)
        && judgement.after.p < rules.max_misfit_p
    {
        warnings.push(Warning::new(
            WarningKind::OrderOfReadings,
            "the residuals go with the order of the readings: a drift, or a zero that was read anew; give readings \
                      that share a zero reading one number in the column `series`"
                .into(),
        ));
    }
    warnings
}

/// Of what was found from one pose on, and not before.
pub fn of_change(world: &World, inferred: &Inferred, readings: &Readings) -> Option<Warning> {
    let from = inferred.findings.iter().find_map(|f| world.since(f.block))?;
    let line = readings.readings.iter().find(|r| readings.conditions[r.condition].pose == from)?.line;
    let message = format!(
        "from {} on the readings differ from those before, as if sensor, load, poses or machine had been changed there: was something set \
         up anew, exchanged or loosened? Diagnose both parts separately",
        readings.poses[from].name()
    );
    Some(Warning { lines: vec![line], ..Warning::new(WarningKind::ChangeBetweenPoses, message) })
}

/// Outliers as the file has them, left out or not; `expected` is by condition.
pub fn suspects(
    readings: &Readings,
    outliers: &[Outlier],
    expected: &[[f64; CHANNELS]],
    excluded: bool,
) -> Vec<Suspect> {
    let of = |o: &Outlier| {
        let r = &readings.readings[o.reading];
        Suspect {
            line: r.line,
            column: READ_COLUMNS[o.channel],
            value: r.observed[o.channel].unwrap_or(f64::NAN) * 1e6,
            expected: expected[r.condition][o.channel] * 1e6,
            residual_sd: o.studentised,
            excluded,
        }
    };
    outliers.iter().map(of).collect()
}

/// Gross errors in readings: each costs its number, and no channel its noise.
pub fn gross(readings: &Readings, model: &Model, rules: &Rules) -> Vec<Outlier> {
    let experiment = Experiment::new(model, readings);
    let said = model.predict(&experiment.poses, experiment.conditions, &[], &[]);
    said.map_or(Vec::new(), |said| {
        pkm_diagnosis::gross::gross(&experiment::observations(readings, model), said.as_flattened(), rules)
    })
}

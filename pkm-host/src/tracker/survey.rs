//! The files of a campaign: which points belong to a reading, and whether they can tell a motion.

use std::collections::{BTreeSet, HashMap};

use nalgebra::Vector3;

use super::Task;
use super::rigid::{Motion, Pair, width_m};
use crate::error::{Failure, Result};
use crate::files::points::{Point, PointList, State};
use crate::files::reflectors::{On, Reflectors};

/// Reflectors that six components need.
pub(super) const MIN_REFLECTORS: usize = 3;
/// Least root mean square distance of reflectors from one line: with points of some micrometres the rotation about it is known to some
/// milliradians then.
const MIN_WIDTH_M: f64 = 2e-3;
/// Standard deviations of its distance by which a reflector may leave a rigid body.
const MAX_MISFIT_SD: f64 = 50.0;

/// Files of a campaign, and where its poses are.
pub(super) struct Survey<'a> {
    pub(super) reflectors: &'a Reflectors,
    pub(super) points: &'a PointList,
    pub(super) readings_file: &'a str,
    /// Of each reflector on the platform, in A-uvw.
    pub(super) on_platform_m: Vec<Option<Vector3<f64>>>,
}

/// Points of the platform in both states.
pub(super) type Pairs = Vec<(usize, [Point; 2])>;

impl Survey<'_> {
    pub(super) fn fail(&self, line: u64, message: String) -> Failure {
        Failure::input(message).in_file(&self.points.source.name).at_line(line)
    }

    pub(super) fn fail_reading(&self, task: &Task<'_>, message: String) -> Failure {
        Failure::input(message).in_file(self.readings_file).at_line(task.line).at_column("reading")
    }

    pub(super) fn name(&self, reflector: usize) -> &str {
        &self.reflectors.all[reflector].name
    }

    pub(super) fn is_on(&self, point: &Point, on: On) -> bool {
        self.reflectors.all[point.reflector].on == on
    }

    pub(super) fn has_base(&self) -> bool {
        self.reflectors.all.iter().any(|r| r.on == On::Base)
    }

    /// Refuses readings that stand twice, and points of readings that do not stand in the readings' file.
    pub(super) fn require_known_names(&self, tasks: &[Task<'_>]) -> Result<()> {
        let mut seen: HashMap<&str, u64> = HashMap::new();
        for task in tasks {
            if task.reading.is_empty() {
                let message = "expected the name of the reading, as in the list of points, found an empty cell";
                return Err(self.fail_reading(task, message.into()));
            }
            if let Some(first) = seen.insert(&task.reading, task.line) {
                let message =
                    format!("reading {} stands in line {first} as well: names of readings differ", task.reading);
                return Err(self.fail_reading(task, message));
            }
        }
        let series: BTreeSet<&str> = tasks.iter().map(|t| t.series.as_str()).collect();
        let is_known = |name: &str| seen.contains_key(name) || series.contains(name);
        match self.points.names.iter().find(|(name, _)| !is_known(name)) {
            None => Ok(()),
            Some((name, line)) => {
                let message = format!("no reading and no series `{name}` in {}", self.readings_file);
                Err(self.fail(*line, message).at_column("reading"))
            }
        }
    }

    /// The name under which a reading's unloaded points stand, and they.
    fn unloaded(&self, task: &Task<'_>) -> Option<&[Point]> {
        let of = |name: &str| self.points.sets.get(&(name.to_owned(), State::Unloaded)).map(Vec::as_slice);
        of(&task.series).or_else(|| of(&task.reading))
    }

    /// Unloaded and loaded points of a reading.
    pub(super) fn points_of(&self, task: &Task<'_>) -> Result<[&[Point]; 2]> {
        let missing = |state: State| {
            let or_series = if state == State::Unloaded && !task.series.is_empty() {
                format!(", nor of its series {}", task.series)
            } else {
                String::new()
            };
            let file = &self.points.source.name;
            let message = format!("no {} points of reading {}{or_series} in {file}", state.name(), task.reading);
            self.fail_reading(task, message)
        };
        let before = self.unloaded(task).ok_or_else(|| missing(State::Unloaded))?;
        let loaded = self.points.sets.get(&(task.reading.clone(), State::Loaded));
        Ok([before, loaded.ok_or_else(|| missing(State::Loaded))?])
    }

    /// Points of one body that were measured in both states.
    pub(super) fn both(&self, task: &Task<'_>, on: On, before: &[Point], after: &[Point]) -> Result<Pairs> {
        let of = |points: &[Point]| points.iter().filter(|p| self.is_on(p, on)).copied().collect::<Vec<Point>>();
        let (before, after) = (of(before), of(after));
        let missing = |here: &[Point], there: &[Point], state: State| {
            let alone = here.iter().find(|p| there.iter().all(|o| o.reflector != p.reflector))?;
            let message = format!(
                "`{}` of reading {} was not measured {}: a displacement needs both states",
                self.name(alone.reflector),
                task.reading,
                state.name()
            );
            Some(self.fail(alone.line, message).at_column("point"))
        };
        let alone = missing(&before, &after, State::Loaded).or_else(|| missing(&after, &before, State::Unloaded));
        if let Some(failure) = alone {
            return Err(failure);
        }
        let pair = |b: &Point| after.iter().find(|a| a.reflector == b.reflector).map(|a| (b.reflector, [*b, *a]));
        Ok(before.iter().filter_map(pair).collect())
    }

    /// Points of the platform in both states, as many as its reflectors promise.
    pub(super) fn pairs(&self, task: &Task<'_>, before: &[Point], after: &[Point]) -> Result<Pairs> {
        let pairs = self.both(task, On::Platform, before, after)?;
        let promised = self.reflectors.all.iter().filter(|r| r.on == On::Platform).count();
        if pairs.len() < promised.min(MIN_REFLECTORS) {
            let needed = if promised < MIN_REFLECTORS {
                format!("{promised} are there")
            } else {
                format!("six components need {MIN_REFLECTORS} of the {promised} that are there")
            };
            let message =
                format!("{} reflectors of the platform measured in reading {}: {needed}", pairs.len(), task.reading);
            return Err(self.fail_reading(task, message));
        }
        Ok(pairs)
    }

    /// Refuses reflectors that are too few or in one line.
    pub(super) fn require_body(&self, line: u64, reading: &str, places: &[Vector3<f64>]) -> Result<()> {
        if places.len() < MIN_REFLECTORS {
            let message = format!(
                "{} reflectors of the base measured in reading {reading}: its motion needs {MIN_REFLECTORS}",
                places.len()
            );
            return Err(self.fail(line, message).at_column("point"));
        }
        let width = width_m(places);
        if width < MIN_WIDTH_M {
            let message = format!(
                "the reflectors of reading {reading} lie within {:.3} mm of one line: they do not tell the rotation about it",
                width * 1e3
            );
            return Err(self.fail(line, message).at_column("point"));
        }
        Ok(())
    }

    /// Refuses a reflector that left the others.
    pub(super) fn require_together(&self, reading: &str, points: &Pairs, pairs: &[Pair]) -> Result<()> {
        let misfits = |pairs: &[Pair]| -> Vec<f64> {
            let motion = Motion::fit(pairs);
            pairs.iter().map(|p| (p.after_m - motion.of(&p.before_m)).norm() / p.variance().sqrt()).collect()
        };
        let own = misfits(pairs);
        let largest = own.iter().copied().fold(0.0, f64::max);
        if largest <= MAX_MISFIT_SD {
            return Ok(());
        }
        // the one without which the others fit best; of three, nobody knows
        let without = |n: usize| {
            let others: Vec<Pair> = pairs.iter().enumerate().filter(|(o, _)| *o != n).map(|(_, p)| *p).collect();
            if pairs.len() > MIN_REFLECTORS { misfits(&others).iter().map(|m| m * m).sum() } else { -own[n] }
        };
        let rest: Vec<f64> = (0..pairs.len()).map(without).collect();
        let worst = (0..rest.len()).min_by(|a, b| rest[*a].total_cmp(&rest[*b])).unwrap_or(0);
        let (reflector, [_, loaded]) = points[worst];
        let sure = if pairs.len() > MIN_REFLECTORS { "" } else { ", or one of the two others," };
        let message = format!(
            "`{}`{sure} has left the others in reading {reading}: by up to {largest:.0} standard deviations they move unlike a rigid \
             body (at most {MAX_MISFIT_SD}): was it mistaken for another, or is it loose?",
            self.name(reflector)
        );
        Err(self.fail(loaded.line, message).at_column("point"))
    }
}

//! What is kept of a walk along a path, however long it is: tallies, the greatest errors of stretches and lines, and where limits come near.

use pkm_core::ToolSolution;

use crate::files::machine::MachineFile;
use crate::plan::feed::{HeldFeeds, TooFast};
use crate::pose::{PoseBox, file_units};

/// Most stretches that greatest errors are kept of: as many as a screen shows.
const STRETCHES: u64 = 250;
/// Most places of the path's picture.
const PLACES: u64 = 2000;
/// Lines with the greatest errors.
const LINES: usize = 12;

/// Greatest and root mean square of some errors.
#[derive(Default)]
pub struct Tally {
    /// Greatest.
    pub max: f64,
    squares: f64,
    /// How many.
    pub count: usize,
}

impl Tally {
    pub(super) fn add(&mut self, value: f64) {
        self.max = self.max.max(value);
        self.squares += value * value;
        self.count += 1;
    }

    /// Root mean square; 0 of none.
    pub fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.squares / self.count as f64).sqrt() }
    }
}

/// A point of the path under load.
#[derive(Clone, Copy, Debug)]
pub struct LoadedPoint {
    /// Line of the file that leads to it.
    pub line: u64,
    /// Path length of the tip from the beginning, m.
    pub path_length_m: f64,
    /// Where the tip was asked to be, in B.
    pub tip_m: [f64; 3],
    /// How far the load takes it from there, in B.
    pub before_m: [f64; 3],
    /// How far it is off with the new command.
    pub after_m: f64,
    /// How far it is off with the new command if the load is off by its uncertainty.
    pub load_off_m: f64,
    /// How well the table knows the deflection, where it says so.
    pub known: Option<KnownDeflection>,
}

/// How well a deflection of the tip is known.
#[derive(Clone, Copy, Debug)]
pub struct KnownDeflection {
    /// Length of its expanded uncertainty along u, v, w, coverage 95 %.
    pub u95_m: f64,
    /// Share of it that is compensated, as by a controller: [`pkm_core::TipUncertainty::known_share`].
    pub share: f64,
}

/// An error of a [`LoadedPoint`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Length of what the load does.
    Before,
    /// Its part along x of B.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// With the new command.
    After,
    /// With the new command and another load.
    LoadOff,
    /// Expanded uncertainty of the deflection, 0 where the table does not say it.
    U95,
}

impl Error {
    const ALL: [Self; 7] = [Self::Before, Self::X, Self::Y, Self::Z, Self::After, Self::LoadOff, Self::U95];
}

impl LoadedPoint {
    /// One of its errors, m.
    pub fn error_m(&self, error: Error) -> f64 {
        match error {
            Error::Before => self.before_m.into_iter().map(|x| x.powi(2)).sum::<f64>().sqrt(),
            Error::X => self.before_m[0],
            Error::Y => self.before_m[1],
            Error::Z => self.before_m[2],
            Error::After => self.after_m,
            Error::LoadOff => self.load_off_m,
            Error::U95 => self.known.map_or(0.0, |known| known.u95_m),
        }
    }
}

/// A stretch of the path: the point with the greatest of each [`Error`].
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    number: u64,
    greatest: [LoadedPoint; Error::ALL.len()],
    /// The tool went without load before it.
    pub is_behind_gap: bool,
}

impl Stretch {
    /// The point with the greatest of an error.
    pub fn greatest(&self, error: Error) -> &LoadedPoint {
        &self.greatest[error as usize]
    }
}

/// A place on the path, for its picture.
#[derive(Clone, Copy, Debug)]
pub struct PathPlace {
    /// In B.
    pub tip_m: [f64; 3],
    /// How far the load takes the tip; `None` without a load.
    pub before_m: Option<f64>,
    /// The way to it is not known.
    pub is_fresh: bool,
}

/// The greatest errors on a line of the file.
#[derive(Clone, Copy, Debug)]
pub struct LineErrors {
    /// Where the load takes the tip furthest.
    pub worst: LoadedPoint,
    /// The greatest that is left on the line, m.
    pub after_m: f64,
}

/// Where a limit comes nearest.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// How much is left.
    pub room: f64,
    /// Of which limb, joint or variable, from 0.
    pub which: usize,
    /// Line of the file.
    pub line: u64,
    /// Where the tip was asked to be, in B.
    pub tip_m: [f64; 3],
}

/// Where limits come nearest along the path, as it is commanded.
#[derive(Default)]
pub struct Margins {
    /// A screw's travel, m.
    pub travel: Option<Nearest>,
    /// A wrist joint's limit, rad.
    pub wrist: Option<Nearest>,
    /// The normalised Jacobian determinant.
    pub determinant: Option<Nearest>,
    /// The table's box, as a share of its half width along θ, σ or Z0; negative outside. Under load alone.
    pub extent: Option<Nearest>,
}

fn keep(kept: &mut Option<Nearest>, line: u64, tip_m: [f64; 3], rooms: impl Iterator<Item = f64>) {
    for (which, room) in rooms.enumerate() {
        if kept.is_none_or(|kept| room < kept.room) {
            *kept = Some(Nearest { room, which, line, tip_m });
        }
    }
}

impl Margins {
    /// Takes a configuration; `extent` is the table's box where a load acts.
    pub(super) fn take(
        &mut self,
        file: &MachineFile,
        solution: &ToolSolution<f64>,
        extent: Option<&PoseBox>,
        line: u64,
        tip_m: [f64; 3],
    ) {
        let room = |at: f64, low: f64, high: f64| (at - low).min(high - at);
        let (travel, wrist) = (&file.parameters.travel, &file.wrist_parameters);
        let screws = solution.joints.lengths.q_m.iter().enumerate();
        keep(&mut self.travel, line, tip_m, screws.map(|(i, q)| room(*q, travel.min_m[i], travel.max_m[i])));
        let joints = solution.joints.beta_rad.iter().enumerate();
        keep(&mut self.wrist, line, tip_m, joints.map(|(i, beta)| room(*beta, wrist.min_rad[i], wrist.max_rad[i])));
        keep(&mut self.determinant, line, tip_m, std::iter::once(solution.normalised_determinant));
        if let Some(extent) = extent {
            let variables = file_units(&solution.configuration.pose).into_iter().zip(extent.ranges());
            let shares = variables.map(|(v, [low, high])| room(v, low, high) / (0.5 * (high - low)));
            keep(&mut self.extent, line, tip_m, shares);
        }
    }
}

/// What came of a path.
#[derive(Default)]
pub struct Track {
    /// How many points the new path has.
    pub points: usize,
    /// Of tip in m and axis in rad, as the path was.
    pub before: [Tally; 2],
    /// As it becomes.
    pub after: [Tally; 2],
    /// Of the tip in m, at midpoints between points.
    pub at_midpoints: Tally,
    /// Of the tip in m, as it becomes, if the load is off by its uncertainty: of the loads that have one.
    pub load_off: Tally,
    /// Length of the deflection's expanded uncertainty in m; of no points where the table does not say.
    pub u95: Tally,
    /// Loaded points where that is greater than the deflection.
    pub unsure: usize,
    /// Least share of a deflection that is known.
    pub least_known_share: f64,
    /// Moves whose load is estimated from the cut.
    pub estimated: usize,
    /// Where limits come nearest.
    pub margins: Margins,
    /// Points outside the table's box.
    pub extrapolated: usize,
    /// Where a load acts, in the path's order.
    pub stretches: Vec<Stretch>,
    /// The whole path.
    pub places: Vec<PathPlace>,
    /// Lines with the greatest errors, the greatest first.
    pub worst: Vec<LineErrors>,
    /// The tool goes without load.
    is_in_gap: bool,
    /// The line that is being gone along.
    line: Option<LineErrors>,
    /// Steps done, and of how many.
    pub(super) steps: [u64; 2],
    /// Lines that ask too much of a joint, with limits.
    pub too_fast: Vec<TooFast>,
    /// Cuts by whether their feed was held against limits; `None` where there are no limits.
    pub feeds: Option<HeldFeeds>,
}

impl Track {
    /// Of a path with so many steps, with limits of the joints or without.
    pub(super) fn of_steps(all: u64, with_limits: bool) -> Self {
        let feeds = with_limits.then(HeldFeeds::default);
        Self { steps: [0, all], least_known_share: 1.0, feeds, ..Self::default() }
    }

    /// Least normalised Jacobian determinant.
    pub fn min_normalised_determinant(&self) -> f64 {
        self.margins.determinant.map_or(f64::INFINITY, |nearest| nearest.room)
    }

    /// Takes a point under load.
    pub(super) fn take(&mut self, point: LoadedPoint) {
        let [done, all] = self.steps;
        let number = done * STRETCHES / all.max(1);
        match self.stretches.last_mut().filter(|stretch| stretch.number == number) {
            Some(stretch) => {
                for (greatest, error) in stretch.greatest.iter_mut().zip(Error::ALL) {
                    if point.error_m(error).abs() > greatest.error_m(error).abs() {
                        *greatest = point;
                    }
                }
            }
            None => {
                let is_behind_gap = self.is_in_gap;
                self.stretches.push(Stretch { number, greatest: [point; Error::ALL.len()], is_behind_gap });
            }
        }
        self.is_in_gap = false;
        match self.line.as_mut().filter(|line| line.worst.line == point.line) {
            Some(line) => {
                line.after_m = line.after_m.max(point.after_m);
                if point.error_m(Error::Before) > line.worst.error_m(Error::Before) {
                    line.worst = point;
                }
            }
            None => {
                let done = self.line.replace(LineErrors { worst: point, after_m: point.after_m });
                self.rank(done);
            }
        }
    }

    /// A line's place among the worst.
    fn rank(&mut self, line: Option<LineErrors>) {
        let Some(line) = line else { return };
        let size = |line: &LineErrors| line.worst.error_m(Error::Before);
        let place = self.worst.partition_point(|other| size(other) >= size(&line));
        if place < LINES {
            self.worst.insert(place, line);
            self.worst.truncate(LINES);
        }
    }

    /// A place that the path comes to, after each step, if it is one to be drawn.
    pub(super) fn step(&mut self, place: Option<PathPlace>, ends: bool) {
        let [done, all] = self.steps;
        self.steps[0] += 1;
        let Some(place) = place else { return };
        self.is_in_gap |= place.before_m.is_none();
        // corners too, as long as there are not too many
        let every = all.div_ceil(PLACES);
        if done.is_multiple_of(every)
            || (ends && every < 20 && self.places.len() < 2 * PLACES as usize)
            || place.is_fresh
        {
            self.places.push(place);
        }
    }

    pub(super) fn finish(&mut self) {
        let done = self.line.take();
        self.rank(done);
    }

    /// One entry a line, with the feed that all of its moves can have.
    pub(super) fn slow_down(&mut self, found: Option<TooFast>) {
        let Some(found) = found else { return };
        match self.too_fast.last_mut().filter(|last| last.line == found.line) {
            Some(last) if last.allowed_per_min <= found.allowed_per_min => {}
            Some(last) => *last = found,
            None => self.too_fast.push(found),
        }
    }
}

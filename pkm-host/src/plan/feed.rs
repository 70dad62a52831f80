//! Which lines of a program ask a joint for more than it can do.

use pkm_core::JointValues;
use pkm_core::five_axis::JointMotion;
use pkm_core::nalgebra::Vector5;

use crate::files::limits::JointLimits;
use crate::files::path::{FeedMode, Move};

/// A line at whose feed a joint would be too fast, or accelerate too much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TooFast {
    /// Of the file, from 1.
    pub line: u64,
    /// As programmed, in `G95` F times S.
    pub feed_per_min: f64,
    /// At which every joint stays within its limits.
    pub allowed_per_min: f64,
    /// Of both: `mm/min`, or `°/min` where only the tool turns.
    pub unit: &'static str,
    /// Whether F is that of a turn of the spindle.
    pub of_a_turn: bool,
}

/// Why the feed of a cut cannot be held against the joints' limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotHeld {
    /// `G93`.
    InverseTime,
    /// `G95`, and no S or no F is in force.
    OfATurn,
    /// No F is in force.
    NoFeed,
    /// Where the cut begins is not known.
    NoBeginning,
}

impl NotHeld {
    /// Why a cut's feed cannot be, if so.
    pub fn of(mv: &Move, begins: bool) -> Option<Self> {
        match (mv.feed_mode, mv.feed_per_min) {
            (FeedMode::InverseTime, _) => Some(Self::InverseTime),
            (FeedMode::OfATurn, None) => Some(Self::OfATurn),
            (FeedMode::OfAMinute, None) => Some(Self::NoFeed),
            (FeedMode::OfAMinute | FeedMode::OfATurn, Some(_)) => (!begins).then_some(Self::NoBeginning),
        }
    }
}

/// Cuts whose feed could not be held against limits.
#[derive(Clone, Copy, Debug)]
pub struct NotHeldCuts {
    /// Why.
    pub why: NotHeld,
    /// How many.
    pub count: usize,
    /// Of the first, in the file, from 1.
    pub line: u64,
}

/// Cuts whose feed was to be held against limits; all of an arc is one.
#[derive(Default)]
pub struct HeldFeeds {
    /// How many were.
    pub held: usize,
    /// Others, by the reason.
    pub not_held: Vec<NotHeldCuts>,
}

impl HeldFeeds {
    /// Counts a cut.
    pub(super) fn add(&mut self, why_not: Option<NotHeld>, line: u64) {
        match (why_not, self.not_held.iter_mut().find(|cuts| Some(cuts.why) == why_not)) {
            (None, _) => self.held += 1,
            (Some(_), Some(cuts)) => cuts.count += 1,
            (Some(why), None) => self.not_held.push(NotHeldCuts { why, count: 1, line }),
        }
    }

    /// How many were not.
    pub fn not_held(&self) -> usize {
        self.not_held.iter().map(|cuts| cuts.count).sum()
    }
}

/// The joints along one move, at even steps.
#[derive(Default)]
pub struct JointTrack {
    points: Vec<Vector5<f64>>,
}

impl JointTrack {
    /// The next point.
    pub fn add(&mut self, joints: &JointValues<f64>) {
        let [q1, q2, q3] = joints.lengths.q_m.into();
        self.points.push(Vector5::new(q1, q2, q3, joints.beta_rad.x, joints.beta_rad.y));
    }

    /// Goes on by a chord of an arc, whose ends alone count; the last three stay.
    pub fn follow(&mut self, chord: &Self) {
        if self.points.is_empty() {
            self.points.extend(chord.points.first());
        }
        self.points.extend(chord.points.last());
        self.points.drain(..self.points.len().saturating_sub(3));
    }

    /// Whether the move's feed is too much for the joints, with a step's way of the tip in m and turn in rad: velocities at points by the parabola through three, of two
    /// points their mean; accelerations from three points each. What the control does where moves meet is not known here.
    pub fn too_fast(&self, [path_length_m, turn_rad]: [f64; 2], mv: &Move, limits: &JointLimits) -> Option<TooFast> {
        let [of_tip, of_turn] = mv.feed_per_min?;
        // as controls do: the feed is the tip's, and a turn's where the tip stays
        let (way, feed_per_min, unit) = if path_length_m > 1e-9 {
            (path_length_m * 1e3, of_tip, "mm/min")
        } else {
            (turn_rad.to_degrees(), of_turn, "°/min")
        };
        let step_s = Some(60.0 * way / feed_per_min).filter(|s| *s > 0.0)?;
        let share = |velocity, acceleration| {
            JointMotion { velocity, acceleration }.feed_share(&limits.velocity, &limits.acceleration)
        };
        let none = Vector5::zeros();
        let fast = self.points.windows(2).map(|w| share((w[1] - w[0]) / step_s, none));
        // the mean over a step is less than the velocity at one of its ends
        let ends = self.points.windows(3).flat_map(|w| {
            let (first, last) = (w[1] * 4.0 - w[0] * 3.0 - w[2], w[2] * 3.0 - w[1] * 4.0 + w[0]);
            [first, last].map(|way| share(way / (2.0 * step_s), none))
        });
        let strong = self.points.windows(3).map(|w| share(none, (w[2] - w[1] * 2.0 + w[0]) / (step_s * step_s)));
        let allowed = fast.chain(ends).chain(strong).fold(1.0, f64::min);
        (allowed < 1.0).then_some(TooFast {
            line: mv.line,
            feed_per_min,
            allowed_per_min: allowed * feed_per_min,
            unit,
            of_a_turn: mv.feed_mode == FeedMode::OfATurn,
        })
    }
}

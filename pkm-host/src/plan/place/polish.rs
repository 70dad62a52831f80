//! The least value about a position of the grid.

use super::goal::Goal;
use super::search::{Polished, Searcher};
use crate::files::job::{Axis, Position};

/// How far a polish goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// First and last step along an axis, as a share of the grid's.
    steps: [f64; 2],
    /// At the most.
    rounds: usize,
    /// Without other postures where Newton's steps find none, which is quick and misses the last µm to an edge of reach.
    is_near: bool,
}

/// From an optimum of the grid to the end.
pub(super) const FULL: Effort = Effort { steps: [1.0, 1e-6], rounds: 4, is_near: false };
/// From there, as far as branch and bound needs it.
pub(super) const ROUGH: Effort = Effort { steps: [1.0, 1e-3], rounds: 1, is_near: true };
/// For a point of a front: while branch and bound looks for it, and after that.
pub(super) const POINT: Effort = Effort { steps: [0.1, 1e-5], rounds: 1, is_near: true };
/// From what branch and bound has found to the end.
pub(super) const LAST: Effort = Effort { steps: [0.1, 1e-6], rounds: 4, is_near: false };

/// Search for the least value about a position. The least is often on the edge of what is in reach, where value and edge may run
/// nearly alike, so that no fixed set of directions leads on. So along one axis always the best of the other is taken, edge or not.
pub(super) struct Polish<'a> {
    pub searcher: &'a Searcher<'a>,
    pub goal: Goal,
    /// Of the grid.
    pub spacing: Position,
    pub effort: Effort,
}

impl Polish<'_> {
    /// The least about a position that reaches every hole.
    pub fn from(&self, start: Position) -> Option<Polished> {
        let mut state = self.searcher.state();
        let (value, holes) = self.searcher.judged(self.goal, &start, &mut state)?;
        Some(self.onward((value, start, holes)))
    }

    /// The least about a position with its postures: on the edge of reach another start may just miss them.
    pub fn onward(&self, mut best: Polished) -> Polished {
        let moving: Vec<Axis> = Axis::ALL.into_iter().filter(|axis| self.spacing[*axis] > 0.0).collect();
        for _ in 0..self.effort.rounds {
            let before = best.0;
            for inner in &moving {
                let others = moving.iter().filter(|outer| *outer != inner);
                // one axis alone has itself
                for outer in others.chain(moving.iter().filter(|_| moving.len() == 1)) {
                    self.ridge(&mut best, *outer, *inner);
                }
            }
            if !(best.0 < before * (1.0 - 1e-10)) {
                break;
            }
        }
        best
    }

    /// Along one axis, with the best of the other at each place.
    fn ridge(&self, best: &mut Polished, outer: Axis, inner: Axis) {
        let [mut scale, finest] = self.effort.steps;
        while scale > finest {
            let mut next: Option<Polished> = None;
            for k in [0.0, -1.0, 1.0, -0.5, 0.5] {
                let mut position = best.1;
                position[outer] = self.limited(outer, position[outer] + k * scale * self.spacing[outer]);
                let found = self.line(best, position, inner, 6.0 * scale * self.spacing[inner]);
                let least = next.as_ref().map_or(best.0, |n| n.0);
                if let Some(found) = found.filter(|found| found.0 < least) {
                    next = Some(found);
                }
            }
            // stay at a scale while it pays
            if !next.as_ref().is_some_and(|n| n.0 < best.0 * (1.0 - 1e-11)) {
                scale *= 0.3;
            }
            *best = next.unwrap_or_else(|| best.clone());
        }
    }

    /// The best along a line about a position: samples, then golden sections between the neighbours of the best.
    fn line(&self, near: &Polished, position: Position, axis: Axis, reach: f64) -> Option<Polished> {
        let mut state = self.searcher.state();
        state.near = near.2.iter().map(|p| p.solution.configuration).collect();
        state.is_near = self.effort.is_near;
        let mut best: Option<Polished> = None;
        let mut value_at = |value: f64| {
            let mut at = position;
            at[axis] = self.limited(axis, value);
            let Some((value, holes)) = self.searcher.judged(self.goal, &at, &mut state) else {
                return f64::INFINITY;
            };
            if best.as_ref().is_none_or(|best| value < best.0) {
                best = Some((value, at, holes));
            }
            value
        };
        let (middle, half) = (position[axis], 10);
        let spacing = reach / f64::from(half);
        let sampled = (-half..=half).map(|n| middle + spacing * f64::from(n)).map(|at| (value_at(at), at));
        let known = sampled.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(least, _)| least.is_finite())?;
        golden(&mut value_at, [known.1 - spacing, known.1 + spacing], known);
        best
    }

    fn limited(&self, axis: Axis, value: f64) -> f64 {
        let [low, high] = self.searcher.model.job.limits[axis];
        value.clamp(low, high)
    }
}

/// Evaluates between two ends where there may be less than what is known between them, by golden sections.
fn golden(value_at: &mut impl FnMut(f64) -> f64, [mut low, mut high]: [f64; 2], (mut least, mut at): (f64, f64)) {
    const SECTIONS: usize = 20;
    let share = 0.5 * (3.0 - 5.0_f64.sqrt());
    for _ in 0..SECTIONS {
        let to = if high - at > at - low { high } else { low };
        let next = at + share * (to - at);
        let value = value_at(next);
        let (kept, end) = if value < least { (next, at) } else { (at, next) };
        // the end on the side of what is dropped
        *(if end > kept { &mut high } else { &mut low }) = end;
        (least, at) = (least.min(value), kept);
    }
}

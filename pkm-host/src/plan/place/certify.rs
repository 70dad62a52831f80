//! Branch and bound: the best position, with a proof of how much better another one could be.
//!
//! A cell of positions has a lower bound of the objective over all of it, from [`Taylor`] and [`Cover`]. The cell with the least
//! bound is divided until that bound is near the best value that was found.

use std::collections::BinaryHeap;

use pkm_core::{FiveAxis, Machine, Wrist};
use rayon::prelude::*;

use super::bound::{Node, Search, Seen, widest};
use super::boxes::Cell;
use super::cover::Cover;
use super::polish::Polish;
use super::search::{Polished as Best, Searcher};
use super::taylor::{ROUNDING, THREE, TWO, Taylor};
use crate::files::job::Axis;

/// Cells that are divided at a time. The same on every machine, so that the result is.
const BATCH: usize = 8;
/// Cells after which the best position is polished for the first time, and twice as many for each time after that. Only where
/// another objective may not be too great: hardly a middle of a cell is near that edge, where the least is.
const POLISHED: usize = 256;

/// What is proved of a placement.
#[derive(Clone, Copy, Debug)]
pub struct Certificate {
    /// No position is better than this, SI.
    pub bound: f64,
    /// By how much of its value the position may be worse than the best there is.
    pub gap: f64,
    /// Cells that were looked at.
    pub cells: usize,
}

impl Certificate {
    /// The same of a position with this value.
    pub(super) fn of(self, value: f64) -> Self {
        let bound = self.bound.min(value);
        // a value of 0 is the least there is
        Self { bound, gap: if value > 0.0 { (value - bound) / value } else { 0.0 }, ..self }
    }
}

/// When branch and bound ends.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// The gap that is asked for.
    pub gap: f64,
    /// Cells that are looked at, at the most.
    pub cells: usize,
}

impl Searcher<'_> {
    /// Improves a position by the goal of a polish, and bounds by how much any other could be better.
    pub(super) fn certified(
        &self,
        polish: &Polish<'_>,
        best: Option<Best>,
        limits: &Limits,
    ) -> (Option<Best>, Certificate) {
        let [low, high] = self.model.job.limits[Axis::Rotary];
        if high > low {
            self.branched::<THREE>(polish, best, limits)
        } else {
            self.branched::<TWO>(polish, best, limits)
        }
    }

    fn branched<const N: usize>(
        &self,
        polish: &Polish<'_>,
        mut best: Option<Best>,
        limits: &Limits,
    ) -> (Option<Best>, Certificate) {
        let goal = polish.goal;
        let unlimited = self.model.reach.unlimited();
        let machine: Machine<Taylor<N>> = unlimited.machine.converted();
        let wrist: Wrist<Taylor<N>> = unlimited.wrist.converted();
        let mut store = self.model.store();
        let table = self.model.table.as_ref().and_then(|table| table.converted(&mut store));
        let five = FiveAxis { machine: &machine, wrist: &wrist };
        let cover = Cover::new(self.model, five, table, &self.targets);
        let search = Search { searcher: self, cover, goal, gap: limits.gap };
        let half = Axis::ALL.map(|axis| {
            let [low, high] = self.model.job.limits[axis];
            [0.5 * (low + high), 0.5 * (high - low)]
        });
        let cell = Cell { middle: half.map(|h| h[0]), half: half.map(|h| h[1]) };
        let count = self.targets.len();
        let (boxes, lows) = (vec![search.cover.whole(); count], [vec![0.0; count], vec![0.0; count]]);
        let mut state = self.state();
        state.is_near = goal.most.is_some();
        let root = Node { bound: 0.0, boxes, lows, state, divide: widest(&cell), cell };
        let (mut open, mut done, mut cells) = (BinaryHeap::from([root]), f64::INFINITY, 0);
        let mut next_polish = if goal.most.is_some() { POLISHED } else { usize::MAX };
        let told = format!("{}, {}", self.name, goal.least.name());
        while cells < limits.cells {
            let value = best.as_ref().map_or(f64::INFINITY, |best| best.0);
            let batch: Vec<Node> = (0..BATCH)
                .map_while(|_| {
                    open.peek().is_some_and(|node| node.bound < value * (1.0 - limits.gap)).then(|| open.pop())?
                })
                .collect();
            if batch.is_empty() {
                break;
            }
            let parts: Vec<Node> = batch.iter().flat_map(Node::parts).collect();
            // one task a cell: the first batches have two cells, and these take longest
            let seen: Vec<Seen> = parts.into_par_iter().map(|part| search.seen(part, value)).collect();
            cells += seen.len();
            (self.progress)(&told, cells as u64, limits.cells as u64);
            for Seen { node, best: found, done: bound } in seen {
                open.extend(node);
                done = done.min(bound);
                if let Some(found) = found.filter(|found| best.as_ref().is_none_or(|best| found.0 < best.0)) {
                    best = Some(found);
                }
            }
            if cells >= next_polish {
                best = best.map(|best| polish.onward(best));
                next_polish = 2 * cells;
            }
        }
        let value = best.as_ref().map_or(f64::INFINITY, |best| best.0);
        let bound = open.peek().map_or(f64::INFINITY, |node| node.bound).min(done).min(value);
        let bound = bound * (1.0 - ROUNDING);
        (best, Certificate { bound, gap: 1.0, cells }.of(value))
    }
}

//! A grid of positions, each judged by every objective.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::search::{Options, Searcher};
use super::{Objective, Posture};
use crate::error::{Failure, Result};
use crate::files::job::{Axis, Job, PerAxis, Position};

/// Grid optima that are polished.
const POLISHED: usize = 6;
/// Steps of a grid over cross slide and rotary axis together, as a multiple of those over either: slide, rotary axis.
const COARSER: [f64; 2] = [10.0, 5.0];
/// Of a grid.
const MAX_POSITIONS: f64 = 4e6;

/// One position of the grid as an objective sees it.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// SI.
    pub value: f64,
    /// Mean over the holes of k11…k66, SI.
    pub mean_k: [f64; 6],
    /// The table is extrapolated at one of the holes.
    pub outside_box: bool,
}

/// What the grid found.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Places along each.
    pub axes: PerAxis<Vec<f64>>,
    /// For each objective: rotary outermost, dx innermost; `None` where a hole is out of reach.
    pub cells: Vec<Vec<Option<Cell>>>,
}

pub(super) fn mean_k(postures: &[Posture]) -> [f64; 6] {
    std::array::from_fn(|i| postures.iter().map(|p| p.k[i]).sum::<f64>() / postures.len() as f64)
}

/// Evenly from one limit to the other, no further apart than a step.
pub(super) fn places([low, high]: [f64; 2], step: f64) -> Vec<f64> {
    let count = ((high - low) / step - 1e-9).ceil().max(0.0) as usize;
    (0..=count).map(|i| if count == 0 { low } else { low + (high - low) * i as f64 / count as f64 }).collect()
}

/// Positions of the grid along each axis.
pub(super) fn grid_axes(job: &Job, options: &Options) -> Result<PerAxis<Vec<f64>>> {
    // three axes at once are too many positions for a fine one
    let [coarse, turn] = if job.slides_and_turns() { COARSER } else { [1.0; 2] };
    let step_m = coarse * options.step_m;
    let steps = PerAxis { dx_m: step_m, dy_m: step_m, rotary_rad: turn * options.step_rad };
    let count: f64 =
        Axis::ALL.map(|axis| (job.limits[axis][1] - job.limits[axis][0]) / steps[axis] + 1.0).iter().product();
    if !(count <= MAX_POSITIONS) {
        let message =
            format!("a grid of {count:.1e} positions is too fine, at most {MAX_POSITIONS:e}: give greater steps");
        return Err(Failure::usage(message));
    }
    Ok(PerAxis::of(|axis| places(job.limits[axis], steps[axis])))
}

impl Grid {
    fn position(&self, mut cell: usize) -> Position {
        let [xs, ys, angles] = Axis::ALL.map(|axis| &self.axes[axis]);
        let x = cell % xs.len();
        cell /= xs.len();
        Position { dx_m: xs[x], dy_m: ys[cell % ys.len()], rotary_rad: angles[cell / ys.len()] }
    }

    pub(super) fn best(&self, objective: usize) -> Option<(Position, f64)> {
        let values = self.cells[objective].iter().enumerate().filter_map(|(i, c)| c.as_ref().map(|c| (i, c.value)));
        values.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, value)| (self.position(i), value))
    }

    /// The best by an objective where another one is at most some value.
    pub(super) fn best_below(&self, objective: usize, other: usize, most: f64) -> Option<Position> {
        let value = |i: &usize| self.cells[objective][*i].as_ref().map_or(f64::INFINITY, |cell| cell.value);
        let below = |i: &usize| self.cells[other][*i].as_ref().is_some_and(|cell| cell.value <= most);
        let best = (0..self.cells[objective].len()).filter(below).min_by(|a, b| value(a).total_cmp(&value(b)));
        best.map(|i| self.position(i))
    }

    /// The best of the positions that no neighbour betters.
    pub(super) fn optima(&self, objective: usize) -> Vec<Position> {
        let cells = &self.cells[objective];
        let [nx, ny, na] = Axis::ALL.map(|axis| self.axes[axis].len());
        let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        let mut found: Vec<(f64, usize)> = (0..cells.len())
            .filter_map(|i| {
                let value = cells[i].as_ref()?.value;
                let (x, y, a) = (i % nx, i / nx % ny, i / nx / ny);
                let bettered = near(a, na).any(|a| {
                    near(y, ny).any(|y| {
                        near(x, nx).any(|x| cells[(a * ny + y) * nx + x].as_ref().is_some_and(|c| c.value < value))
                    })
                });
                (!bettered).then_some((value, i))
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().take(POLISHED).map(|(_, i)| self.position(i)).collect()
    }

    pub(super) fn feasible_share(&self) -> f64 {
        self.cells[0].iter().flatten().count() as f64 / self.cells[0].len() as f64
    }

    pub(super) fn q_ratio(&self, objective: usize, found: &[f64; 6]) -> f64 {
        let ratios = (0..6).map(|i| {
            let of = |c: &Cell| c.mean_k[i];
            let all = || self.cells[objective].iter().flatten().map(of);
            let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
            if high > low { (high - found[i]) / (high - low) } else { 0.0 }
        });
        ratios.sum::<f64>() / 6.0
    }

    /// Distances of neighbours; 0 along an axis that does not move.
    pub fn spacing(&self) -> Position {
        PerAxis::of(|axis| match self.axes[axis].as_slice() {
            [first, second, ..] => second - first,
            _ => 0.0,
        })
    }
}

impl Searcher<'_> {
    pub(super) fn grid(&self, objectives: &[Objective], axes: PerAxis<Vec<f64>>) -> Grid {
        let PerAxis { dx_m: xs, dy_m: ys, rotary_rad: angles } = &axes;
        let rows: Vec<(f64, f64)> = angles.iter().flat_map(|a| ys.iter().map(move |y| (*a, *y))).collect();
        let told = self.name.clone();
        let (done, count) = (AtomicU64::new(0), rows.len() as u64);
        (self.progress)(&told, 0, count);
        let found: Vec<Vec<Vec<Option<Cell>>>> = rows
            .par_iter()
            .map(|&(rotary_rad, dy_m)| {
                let mut state = self.state();
                let row = xs.iter().map(|&dx_m| {
                    let found = self.all(&Position { dx_m, dy_m, rotary_rad }, &mut state);
                    objectives
                        .iter()
                        .map(|objective| {
                            let (value, postures) = self.cheapest(*objective, found.as_ref()?);
                            let outside_box = postures.iter().any(|p| p.outside_box);
                            Some(Cell { value, mean_k: mean_k(&postures), outside_box })
                        })
                        .collect()
                });
                let row = row.collect();
                (self.progress)(&told, done.fetch_add(1, Ordering::Relaxed) + 1, count);
                row
            })
            .collect();
        let cells = (0..objectives.len()).map(|o| found.iter().flatten().map(|cell| cell[o]).collect()).collect();
        Grid { axes, cells }
    }
}

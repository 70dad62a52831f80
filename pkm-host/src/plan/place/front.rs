//! A Pareto front: how much tip deflection a better value of another objective takes.
//!
//! Each of its points is the least deflection of all positions whose other objective is at most some value, found and bounded by
//! branch and bound. The bounds are the steps of a staircase that no position is below.

use super::Objective;
use super::certify::{Certificate, Limits};
use super::goal::Goal;
use super::polish::{self, Polish};
use super::search::{Grid, Placement, Polished, Searcher};
use crate::files::job::Position;

/// Share by which values differ that pass for the same.
const ALIKE: f64 = 1e-6;

/// A position that no other one betters in both, as far as its certificate goes.
#[derive(Clone, Debug)]
pub struct Point {
    /// Of the table.
    pub position: Position,
    /// Greatest displacement of a tip, m, weighted.
    pub tip_m: f64,
    /// The other objective's value, SI.
    pub other: f64,
    /// Of all positions whose other objective is no greater.
    pub certificate: Certificate,
}

/// A step of what is proved.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// No position whose other objective is at most this, SI; without end for the last.
    pub other_at_most: Option<f64>,
    /// Has a tip that moves less, m.
    pub bound_m: f64,
}

/// Tip deflection against another objective.
#[derive(Clone, Debug)]
pub struct Front {
    /// Which series of the job; several are placed together.
    pub series: Vec<usize>,
    /// Beside the tip's deflection.
    pub other: Objective,
    /// The other objective's least value first. One alone: a position has the least of both.
    pub points: Vec<Point>,
    /// No position has less of the other objective, SI.
    pub other_bound: f64,
    /// In the same order.
    pub proved: Vec<Step>,
}

/// Between two points of a front: where further ones may be.
struct Between {
    /// Of the other objective.
    from: f64,
    to: f64,
    /// Of the tip, least last.
    tips_m: [f64; 2],
}

impl Between {
    fn area(&self) -> f64 {
        (self.to - self.from).max(0.0) * (self.tips_m[0] - self.tips_m[1]).max(0.0)
    }
}

impl Searcher<'_> {
    /// From the optimum of another objective to that of tip-worst, each point where it halves the greatest rectangle in which others
    /// may be.
    pub(super) fn front(
        &self,
        [by_tip, by_other]: [&Placement; 2],
        (grid, columns): (&Grid, [usize; 2]),
        points: usize,
        limits: &Limits,
    ) -> Front {
        let other = by_other.objective;
        let last = self.point(by_tip, other, by_tip.value);
        let other_bound = by_other.certificate.map_or(0.0, |c| c.bound);
        let mut front = Front {
            series: by_tip.series.clone(),
            other,
            proved: vec![Step { other_at_most: None, bound_m: last.certificate.bound }],
            points: vec![last.clone()],
            other_bound,
        };
        let start = (by_other.value, by_other.position, by_other.holes.clone());
        let alike = |value: f64, least: f64| value <= least * (1.0 + ALIKE);
        if alike(last.other, by_other.value) {
            return front;
        }
        let search = |most: f64| self.least_tip(other, most, &start, (grid, columns), limits);
        let Some(first) = search(by_other.value) else { return front };
        front.proved.insert(0, first.1);
        if alike(first.0.tip_m, last.tip_m) {
            front.points = vec![first.0];
            return front;
        }
        let mut open = vec![Between { from: first.0.other, to: last.other, tips_m: [first.0.tip_m, last.tip_m] }];
        front.points.insert(0, first.0);
        for _ in 2..points {
            let greatest = (0..open.len()).max_by(|a, b| open[*a].area().total_cmp(&open[*b].area()));
            let Some(between) = greatest.map(|n| open.swap_remove(n)).filter(|b| b.area() > 0.0) else { break };
            let Some((point, step)) = search(0.5 * (between.from + between.to)) else { break };
            let [most, least] = between.tips_m;
            open.push(Between { to: point.other, tips_m: [most, point.tip_m], ..between });
            open.push(Between { from: 0.5 * (between.from + between.to), tips_m: [point.tip_m, least], ..between });
            front.proved.push(step);
            front.points.push(point);
        }
        front.sort();
        front
    }

    fn point(&self, placement: &Placement, other: Objective, tip_m: f64) -> Point {
        let certificate = placement.certificate.unwrap_or(Certificate { bound: 0.0, gap: 1.0, cells: 0 });
        let value = self.worth(other, &placement.holes);
        Point { position: placement.position, tip_m, other: value, certificate }
    }

    /// The least deflection where another objective is at most some value. `start`: where that is least.
    fn least_tip(
        &self,
        other: Objective,
        most: f64,
        start: &Polished,
        (grid, [tip, column]): (&Grid, [usize; 2]),
        limits: &Limits,
    ) -> Option<(Point, Step)> {
        let goal = Goal { least: Objective::TipWorst, most: Some((other, most)) };
        let polish = |effort| Polish { searcher: self, goal, spacing: grid.spacing(), effort };
        let from_grid = grid.best_below(tip, column, most);
        let mut starts = vec![(self.worth(goal.least, &start.2), start.1, start.2.clone())];
        starts.extend(from_grid.and_then(|position| polish(polish::ROUGH).from(position)));
        let best = starts.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let (best, certificate) = self.certified(goal, best, limits);
        let (tip_m, position, holes) = polish(polish::LAST).onward(best?);
        let certificate = certificate.of(tip_m);
        let step = Step { other_at_most: Some(most), bound_m: certificate.bound };
        Some((Point { position, tip_m, other: self.worth(other, &holes), certificate }, step))
    }
}

impl Front {
    /// In order, without points that another one betters.
    fn sort(&mut self) {
        self.points.sort_by(|a, b| a.other.total_cmp(&b.other).then(a.tip_m.total_cmp(&b.tip_m)));
        let mut least = f64::INFINITY;
        self.points.retain(|point| {
            let betters = point.tip_m < least;
            least = least.min(point.tip_m);
            betters
        });
        let end = |step: &Step| step.other_at_most.unwrap_or(f64::INFINITY);
        self.proved.sort_by(|a, b| end(a).total_cmp(&end(b)));
    }

    /// Whether a better value of the one takes a worse one of the other.
    pub fn conflicts(&self) -> bool {
        self.points.len() > 1
    }
}

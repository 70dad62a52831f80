//! A Pareto front: how much tip deflection a better value of another objective takes.
//!
//! Each of its points is the least deflection of all positions whose other objective is at most some value, found and bounded by
//! branch and bound. The bounds are the steps of a staircase that no position is below.

use super::certify::{Certificate, Limits};
use super::goal::Goal;
use super::grid::Grid;
use super::polish::{self, Polish};
use super::search::{Placement, Polished, Searcher};
use super::{Objective, Posture};
use crate::files::job::Position;

/// Share by which values differ that pass for the same.
const ALIKE: f64 = 1e-6;
/// Share of a front's extent in the other objective between two points that are not worth another one between them: where tips jump, bounds close the
/// more slowly the nearer a limit is to the jump.
const FINEST: f64 = 0.01;

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
    /// With the tips by their ratio: 20 µm and 30 µm are as different as 400 µm and 600 µm.
    fn area(&self) -> f64 {
        (self.to - self.from) * (self.tips_m[0] / self.tips_m[1]).ln()
    }

    /// `width`: of the other objective. `gap`: as much as the bounds of tips are off.
    fn is_worth_more(&self, width: f64, gap: f64) -> bool {
        self.to - self.from > width && self.tips_m[1] < self.tips_m[0] * (1.0 - gap)
    }
}

/// What a search for a point gives.
struct Found {
    point: Point,
    step: Step,
    holes: Vec<Posture>,
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
        let last = self.point(by_tip, other);
        let mut front = Front {
            series: by_tip.series.clone(),
            other,
            proved: vec![Step { other_at_most: None, bound_m: last.certificate.bound }],
            points: vec![last.clone()],
            other_bound: by_other.certificate.map_or(0.0, |c| c.bound),
        };
        let least = by_other.value;
        if last.other <= least * (1.0 + ALIKE) {
            return front;
        }
        let width = FINEST * (last.other - least);
        front.other_bound = front.other_bound.max(self.least_other(
            by_other,
            grid,
            &Limits { gap: (width / least).max(ALIKE), ..*limits },
        ));
        let mut known = vec![(least, by_other.position, by_other.holes.clone())];
        let Some(first) = self.least_tip(other, least, &known, (grid, columns), limits) else { return front };
        front.proved.insert(0, first.step);
        if first.point.tip_m <= last.tip_m * (1.0 + ALIKE) {
            front.points = vec![first.point];
            return front;
        }
        let mut open = vec![Between { from: least, to: last.other, tips_m: [first.point.tip_m, last.tip_m] }];
        front.points.insert(0, first.point);
        while front.points.len() < points {
            open.retain(|between| between.is_worth_more(width, limits.gap));
            let greatest = (0..open.len()).max_by(|a, b| open[*a].area().total_cmp(&open[*b].area()));
            let Some(between) = greatest.map(|n| open.swap_remove(n)) else { break };
            let most = 0.5 * (between.from + between.to);
            let Some(found) = self.least_tip(other, most, &known, (grid, columns), limits) else { break };
            let ([greater_m, less_m], tip_m) = (between.tips_m, found.point.tip_m);
            open.push(Between { to: found.point.other, tips_m: [greater_m, tip_m], ..between });
            open.push(Between { from: most, tips_m: [tip_m, less_m], ..between });
            known.push((found.point.other, found.point.position, found.holes));
            front.proved.push(found.step);
            front.points.push(found.point);
        }
        front.sort();
        front
    }

    fn point(&self, placement: &Placement, other: Objective) -> Point {
        let certificate = placement.certificate.unwrap_or(Certificate { bound: 0.0, gap: 1.0, cells: 0 });
        let value = self.worth(other, &placement.holes);
        Point { position: placement.position, tip_m: placement.value, other: value, certificate }
    }

    /// A bound of the other objective that is near beside how much it differs over a front, which may be less than the gap that its
    /// optimum was certified to.
    fn least_other(&self, optimum: &Placement, grid: &Grid, limits: &Limits) -> f64 {
        if optimum.certificate.is_some_and(|certificate| certificate.gap <= limits.gap) {
            return 0.0;
        }
        let goal = optimum.objective.into();
        let polish = Polish { searcher: self, goal, spacing: grid.spacing(), effort: polish::POINT };
        let start = (optimum.value, optimum.position, optimum.holes.clone());
        self.certified(&polish, Some(start), limits).1.bound
    }

    /// The least deflection where another objective is at most some value. `known`: positions, the first of them within that, each with
    /// the other objective's value and its postures.
    fn least_tip(
        &self,
        other: Objective,
        most: f64,
        known: &[Polished],
        (grid, [tip, column]): (&Grid, [usize; 2]),
        limits: &Limits,
    ) -> Option<Found> {
        let goal = Goal { least: Objective::TipWorst, most: Some((other, most)) };
        let polish = |effort| Polish { searcher: self, goal, spacing: grid.spacing(), effort };
        let within = known.iter().filter(|(value, ..)| *value <= most);
        let mut starts: Vec<Polished> =
            within.map(|(_, position, holes)| (self.worth(goal.least, holes), *position, holes.clone())).collect();
        starts.extend(grid.best_below(tip, column, most).and_then(|position| polish(polish::ROUGH).from(position)));
        let best = starts.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let polish = polish(polish::POINT);
        let (best, certificate) = self.certified(&polish, best, limits);
        let (tip_m, position, holes) = polish.onward(best?);
        let certificate = certificate.of(tip_m);
        let step = Step { other_at_most: Some(most), bound_m: certificate.bound };
        let point = Point { position, tip_m, other: self.worth(other, &holes), certificate };
        Some(Found { point, step, holes })
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

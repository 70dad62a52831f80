//! What a position of the table is judged by: the holes of a series, or of several that are machined without moving the table.

use nalgebra::Vector3;
use pkm_core::Wrench;

use super::{Objective, Posture};
use crate::files::job::{Hole, Job, Position};

/// A hole with the load on its tool, how much it counts, and what is not sure of it.
#[derive(Clone, Debug)]
pub(super) struct Target<'a> {
    pub hole: &'a Hole,
    pub wrench: &'a Wrench<f64>,
    /// What its cost is multiplied by: 1 but for series that are placed together.
    pub weight: f64,
    /// How far its hole is from where it is meant, along x and y of W, m.
    pub off_m: [f64; 2],
    /// Some that the force on its tool may be; none: the wrench's alone.
    pub forces_n: Vec<Vector3<f64>>,
    /// How many times as much as by its stiffness the machine may yield.
    pub softer: f64,
}

impl<'a> Target<'a> {
    /// The holes of some series, one series after the other.
    pub fn of(job: &'a Job, series: &[usize]) -> Vec<Self> {
        let alone = series.len() == 1;
        let of_series = |n: &usize| {
            let series = &job.series[*n];
            let weight = if alone { 1.0 } else { series.weight };
            let sure = move |hole| {
                let (off_m, forces_n) = ([0.0; 2], Vec::new());
                Self { hole, wrench: &series.wrench, weight, off_m, forces_n, softer: 1.0 }
            };
            series.holes.iter().map(sure)
        };
        series.iter().flat_map(of_series).collect()
    }

    /// The table's position from which a hole that is where it is meant is seen as this one is.
    pub fn seen_from(&self, position: &Position) -> Position {
        let [x, y] = self.off_m;
        Position { dx_m: position.dx_m + x, dy_m: position.dy_m + y, ..*position }
    }
}

/// Of all postures that reach a hole the one that costs least, and what they all cost together.
pub(super) fn stiffest(objective: Objective, targets: &[Target<'_>], found: &[Vec<Posture>]) -> (f64, Vec<Posture>) {
    let cost = |p: &Posture| objective.cost(p);
    let best: Vec<Posture> =
        found.iter().filter_map(|p| p.iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).copied()).collect();
    let weighted = best.iter().zip(targets).map(|(posture, target)| target.weight * cost(posture));
    (objective.value(weighted), best)
}

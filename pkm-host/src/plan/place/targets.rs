//! What a position of the table is judged by: the holes of a series, or of several that are machined without moving the table.

use pkm_core::Wrench;

use super::{Objective, Posture};
use crate::files::job::{Hole, Job};

/// A hole with the load on its tool, and how much it counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target<'a> {
    pub hole: &'a Hole,
    pub wrench: &'a Wrench<f64>,
    /// What its cost is multiplied by: 1 but for series that are placed together.
    pub weight: f64,
}

impl<'a> Target<'a> {
    /// The holes of some series, one series after the other.
    pub fn of(job: &'a Job, series: &[usize]) -> Vec<Self> {
        let alone = series.len() == 1;
        let of_series = |n: &usize| {
            let series = &job.series[*n];
            let weight = if alone { 1.0 } else { series.weight };
            series.holes.iter().map(move |hole| Self { hole, wrench: &series.wrench, weight })
        };
        series.iter().flat_map(of_series).collect()
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

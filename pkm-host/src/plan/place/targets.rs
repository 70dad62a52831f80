//! What a position of the table is judged by: the holes of a series, or of several that are machined without moving the table.

use nalgebra::Vector3;
use pkm_core::Wrench;

use crate::files::job::{Hole, Job, Position};

/// A hole with the load on its tool, how much it counts, and what is not sure of it.
#[derive(Clone, Debug)]
pub(super) struct Target<'a> {
    pub hole: &'a Hole,
    pub wrench: &'a Wrench<f64>,
    /// Nothing goes to it from the hole before it: the first one of a series.
    pub is_first: bool,
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
            let sure = move |(n, hole)| {
                let (off_m, forces_n) = ([0.0; 2], Vec::new());
                Self { hole, wrench: &series.wrench, is_first: n == 0, weight, off_m, forces_n, softer: 1.0 }
            };
            series.holes.iter().enumerate().map(sure)
        };
        series.iter().flat_map(of_series).collect()
    }

    /// The table's position from which a hole that is where it is meant is seen as this one is.
    pub fn seen_from(&self, position: &Position) -> Position {
        let [x, y] = self.off_m;
        Position { dx_m: position.dx_m + x, dy_m: position.dy_m + y, ..*position }
    }
}

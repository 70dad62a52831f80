//! How long the joints take from hole to hole: of postures, and bounded over cells of positions.

use nalgebra::Vector5;
use pkm_core::Scalar;
use pkm_core::five_axis::rest_to_rest_s;

use super::bound::{Node, Search};
use super::cover::{Cost, Solved};
use super::search::Searcher;
use super::targets::Target;
use super::taylor::{Taylor, decided};
use super::{PlacementModel, Posture};
use crate::error::{Failure, Result};
use crate::files::job::{Job, Series};
use crate::files::limits::JointLimits;

/// Boxes of a hole from which on a cell is so great that nothing is known of its times: all pairs of two holes' boxes would be looked at.
const MAX_BOXES: usize = 32;

/// Whether cycle times are known, and not all the same.
pub(super) fn possible(job: &Job, limits: Option<&JointLimits>) -> Result<()> {
    if limits.is_none() {
        return Err(Failure::usage(
            "cycle-time takes the joints' velocities and accelerations: give --limits, TOML with screw_velocity_mm_per_min and its like (docs/formats.md)",
        ));
    }
    let is_one = |series: &&Series| series.holes.len() == 1;
    job.series.iter().find(is_one).map_or(Ok(()), |series| {
        let message = "of one hole nothing goes from hole to hole: leave the series or cycle-time out";
        Err(Failure::input(message).in_file(&job.source.name).at_column(format!("series.{}.holes", series.name)))
    })
}

fn joints(posture: &Posture) -> Vector5<f64> {
    let joints = &posture.solution.joints;
    let ([q1, q2, q3], [beta1, beta2]): ([f64; 3], [f64; 2]) = (joints.lengths.q_m.into(), joints.beta_rad.into());
    [q1, q2, q3, beta1, beta2].into()
}

impl PlacementModel<'_> {
    /// Time in s for all joints together from a posture to another one, without limits without end.
    fn rapid_s(&self, from: &Posture, to: &Posture) -> f64 {
        let Some(limits) = &self.limits else { return f64::INFINITY };
        let way = joints(to) - joints(from);
        (0..5).map(|i| rest_to_rest_s(way[i], limits.velocity[i], limits.acceleration[i])).fold(0.0, f64::max)
    }

    /// To each hole from the one before it, weighted; the first of a series has no way to it.
    pub(super) fn ways_s(&self, targets: &[Target<'_>], postures: &[Posture]) -> Vec<f64> {
        let way = |n: usize| match targets[n].is_first {
            true => 0.0,
            false => targets[n].weight * self.rapid_s(&postures[n - 1], &postures[n]),
        };
        (0..postures.len()).map(way).collect()
    }
}

impl Searcher<'_> {
    /// Of all postures that reach the holes those with which the joints take the least time.
    pub(super) fn quickest(&self, found: &[Vec<Posture>]) -> Vec<Posture> {
        // least time to each posture of a hole, and from which one of the hole before
        let mut least: Vec<Vec<(f64, usize)>> = Vec::new();
        for (hole, postures) in found.iter().enumerate() {
            let Target { is_first, weight, .. } = &self.targets[hole];
            let to = |posture: &Posture| {
                let Some(before) = least.last() else { return (0.0, 0) };
                let from = |(n, (so_far, _)): (usize, &(f64, usize))| {
                    let way = if *is_first { 0.0 } else { weight * self.model.rapid_s(&found[hole - 1][n], posture) };
                    (so_far + way, n)
                };
                before.iter().enumerate().map(from).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
            };
            least.push(postures.iter().map(to).collect());
        }
        let Some(last) = least.last() else { return Vec::new() };
        let mut n = (0..last.len()).min_by(|a, b| last[*a].0.total_cmp(&last[*b].0)).unwrap_or(0);
        let mut chosen = Vec::new();
        for (hole, postures) in found.iter().enumerate().rev() {
            chosen.extend(postures.get(n));
            n = least[hole].get(n).map_or(0, |way| way.1);
        }
        chosen.into_iter().rev().copied().collect()
    }
}

impl<const N: usize> Search<'_, N> {
    /// Bounds of the ways to the holes over a cell; `None`: a hole is out of reach. `reached`: what is known of some holes.
    pub(super) fn ways(
        &self,
        kept: usize,
        node: &mut Node,
        reached: Vec<Option<Vec<Solved<N>>>>,
    ) -> Option<Vec<Cost<N>>> {
        let limits = self.searcher.model.limits.as_ref()?;
        let (mut costs, mut before): (Vec<Cost<N>>, Vec<[Taylor<N>; 5]>) = (Vec::new(), Vec::new());
        for (hole, solved) in reached.into_iter().enumerate() {
            let mut solved = solved.unwrap_or_else(|| self.solved(hole, node));
            let mut here = Vec::new();
            if solved.len() > MAX_BOXES {
                here.push([Taylor::UNKNOWN; 5]);
            } else {
                solved.retain_mut(|one| {
                    let joints = self.cover.joints(hole, &node.cell, one);
                    here.extend(joints);
                    joints.is_some()
                });
            }
            node.boxes[hole] = solved.iter().map(|one| one.within).collect();
            if here.is_empty() {
                return None;
            }
            let Target { is_first, weight, .. } = &self.searcher.targets[hole];
            if !is_first {
                let cost = match (before.as_slice(), here.as_slice()) {
                    ([from], [to]) => rapid(from, to, limits),
                    // the least of several is no polynomial
                    (before, here) => {
                        let pairs = before.iter().flat_map(|from| here.iter().map(move |to| slowest(from, to, limits)));
                        Cost::at_least(pairs.map(|(least_s, _)| least_s).fold(f64::INFINITY, f64::min))
                    }
                };
                let cost = Cost { low: weight * cost.low, over: Taylor::ZERO.plus(*weight, &cost.over) };
                node.lows[kept][hole] = cost.low.max(node.lows[kept][hole]);
                costs.push(cost);
            }
            before = here;
        }
        Some(costs)
    }
}

/// Least time in s over a cell of the joint for which that is greatest: all together take no less. With which one it is.
fn slowest<const N: usize>(from: &[Taylor<N>; 5], to: &[Taylor<N>; 5], limits: &JointLimits) -> (f64, usize) {
    let of_joint = |i: usize| {
        let way = to[i] - from[i];
        let nearest = way.low().max(-way.high()).max(0.0);
        (rest_to_rest_s(nearest, limits.velocity[i], limits.acceleration[i]), i)
    };
    (0..5).map(of_joint).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
}

/// What all joints take at the least over a cell: no less than any one of them does.
fn rapid<const N: usize>(from: &[Taylor<N>; 5], to: &[Taylor<N>; 5], limits: &JointLimits) -> Cost<N> {
    let (least_s, i) = slowest(from, to, limits);
    let [velocity, acceleration] = [limits.velocity[i], limits.acceleration[i]].map(Taylor::constant);
    let over = decided(|| rest_to_rest_s(to[i] - from[i], velocity, acceleration));
    match over.filter(|over| over.low() > 0.0) {
        Some(over) => Cost { low: over.low().max(least_s), over },
        None => Cost::at_least(least_s),
    }
}

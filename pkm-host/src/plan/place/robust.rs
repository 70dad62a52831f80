//! The worst that stated uncertainties of stiffness, load direction and hole position do to a placement.
//!
//! A target stands for a hole at one of its places with all of its loads ([`Target::robust`]), so that grid, polish and branch and
//! bound take uncertain holes as they take others. What the search sees of a hole's disc are nine places,
//! and of a cone of loads its axis and some of its rim: no worst case is less than theirs. [`Searcher::most`] bounds all the rest.

use std::f64::consts::PI;

use nalgebra::{Unit, Vector3};
use pkm_core::{FiveAxis, Machine, Wrist};

use super::Objective;
use super::boxes::Cell;
use super::certify::Limits;
use super::cover::Cover;
use super::grid::Grid;
use super::polish::{self, Polish};
use super::search::{Placement, Polished, Searcher};
use super::targets::Target;
use super::taylor::{ROUNDING, TWO, Taylor};
use crate::error::{Failure, Result};
use crate::files::job::{Job, Position, Uncertain};

/// Forces on the rim of a cone, and corners of each ring about it.
const CORNERS: usize = 16;
/// Parts of a hole's disc along x and along y, each bounded by itself.
const PARTS: usize = 6;
/// Places on the rim of a hole's disc that the search looks at, beside its middle.
const RIM: usize = 8;
/// Half the least cell that a worst case is bounded over, m: over one of no width Newton's steps find no end.
const MIN_RADIUS_M: f64 = 1e-6;

/// Of a force whose direction is within a cone: some that it may be, along the cone's axis and on its rim, and corners of a convex
/// body that holds all of them.
///
/// The body is between the plane of the rim and the one that touches the sphere at its pole, within the cone that touches it at the
/// rim, its circles widened to polygons.
fn forces(force_n: &Vector3<f64>, half_angle: f64) -> [Vec<Vector3<f64>>; 2] {
    let along = Unit::new_normalize(*force_n);
    let across = Unit::new_normalize(along.cross(&Vector3::ith(along.iamin(), 1.0)));
    let third = along.cross(&across);
    let ring = |height: f64, radius: f64| {
        (0..CORNERS).map(move |n| {
            let (sin, cos) = (2.0 * PI * n as f64 / CORNERS as f64).sin_cos();
            (along.into_inner() * height + (across.into_inner() * cos + third * sin) * radius) * force_n.norm()
        })
    };
    let (sin, cos) = half_angle.sin_cos();
    let wider = 1.0 / (PI / CORNERS as f64).cos();
    let within = ring(cos, sin).chain([*force_n]).collect();
    [within, ring(cos, wider * sin).chain(ring(1.0, wider * (0.5 * half_angle).tan())).collect()]
}

impl<'a> Target<'a> {
    /// The holes of some series with what is not sure of them: first each where it is meant, then each on the rim of its disc.
    pub fn robust(job: &'a Job, series: &[usize], uncertain: &Uncertain) -> Vec<Self> {
        let mut targets = Self::of(job, series);
        for target in &mut targets {
            target.softer = 1.0 / (1.0 - uncertain.stiffness);
            if uncertain.load_cone_rad > 0.0 {
                [target.forces_n, _] = forces(&target.wrench.force_n, uncertain.load_cone_rad);
            }
        }
        let meant = targets.clone();
        let rim = if uncertain.hole_radius_m > 0.0 { RIM } else { 0 };
        for n in 0..rim {
            let (sin, cos) = (2.0 * PI * n as f64 / rim as f64).sin_cos();
            let off_m = [cos, sin].map(|share| share * uncertain.hole_radius_m);
            targets.extend(meant.iter().map(|target| Self { off_m, ..target.clone() }));
        }
        targets
    }
}

/// A placement by its worst case.
#[derive(Clone, Debug)]
pub struct Robust {
    /// Its value is the worst case: no tip moves more, if that is proved. Its holes are where they are meant.
    pub placement: Placement,
    /// Its value without uncertainty, SI.
    pub nominal_m: f64,
    /// `None`: the value is the greatest that was seen.
    pub proved: Option<Worst>,
    /// Where the optimum without uncertainty is, and its value.
    pub optimum: (Position, f64),
    /// The worst case there; `None`: a hole may be out of reach.
    pub worst_of_optimum_m: Option<f64>,
}

/// What is proved of a position.
#[derive(Clone, Copy, Debug)]
pub struct Worst {
    /// No tip moves more, m, weighted.
    pub most: f64,
    /// Every hole is in reach wherever it is; else it was seen to be at some places only.
    pub reached: bool,
}

impl Searcher<'_> {
    /// The position whose worst case is least, beside the one that is least without uncertainty.
    pub(super) fn robust(
        &self,
        nominal: &Placement,
        grid: &Grid,
        (starts, limits): (&[Position], &Limits),
        uncertain: &Uncertain,
    ) -> Result<Robust> {
        let goal = Objective::TipWorst.into();
        let polish = Polish { searcher: self, goal, spacing: grid.spacing(), effort: polish::ROUGH };
        let start = [nominal.position].iter().chain(starts).find_map(|start| polish.from(*start));
        let (best, certificate) = self.certified(&polish, start, limits);
        let Some(best) = best else {
            let message = format!(
                "{}: no position was found from which every hole is in reach wherever it may be: a smaller robust.hole_radius_mm, or more travel",
                self.name
            );
            return Err(Failure::refused("unreachable", message).in_file(&self.model.job.source.name));
        };
        let proved = self.most(&best, uncertain);
        let (seen, position, mut holes) = best;
        holes.truncate(nominal.holes.len());
        let value = proved.map_or(seen, |worst| worst.most.max(seen));
        let tips =
            holes.iter().zip(&self.targets).map(|(p, target)| target.weight * p.deflection_m.unwrap_or(f64::NAN));
        Ok(Robust {
            nominal_m: tips.fold(0.0, f64::max),
            proved,
            optimum: (nominal.position, nominal.value),
            worst_of_optimum_m: self.worst_at(nominal, uncertain),
            placement: Placement {
                position,
                value,
                holes,
                certificate: Some(certificate.of(value)),
                ..nominal.clone()
            },
        })
    }

    /// The worst case of a placement that was found without uncertainty.
    fn worst_at(&self, nominal: &Placement, uncertain: &Uncertain) -> Option<f64> {
        let mut state = self.state();
        let stand = nominal.holes.iter().map(|posture| posture.solution.configuration);
        state.near = stand.cycle().take(self.targets.len()).collect();
        let (seen, holes) = self.judged(Objective::TipWorst, &nominal.position, &mut state)?;
        let proved = self.most(&(seen, nominal.position, holes), uncertain);
        Some(proved.map_or(seen, |worst| worst.most.max(seen)))
    }

    /// How far tips may move at the most with every hole anywhere on its disc, as each is reached at the position; `None` where
    /// that is not bounded.
    pub(super) fn most(&self, (_, position, postures): &Polished, uncertain: &Uncertain) -> Option<Worst> {
        let unlimited = self.model.reach.unlimited();
        let machine: Machine<Taylor<TWO>> = unlimited.machine.converted();
        let wrist: Wrist<Taylor<TWO>> = unlimited.wrist.converted();
        let mut store = self.model.store();
        let table = self.model.table.as_ref().and_then(|table| table.converted(&mut store));
        let five = FiveAxis { machine: &machine, wrist: &wrist };
        let cover = Cover::new(self.model, five, table, &self.targets);
        let radius = uncertain.hole_radius_m.max(MIN_RADIUS_M);
        let cell = Cell { middle: [position.dx_m, position.dy_m, position.rotary_rad], half: [radius, radius, 0.0] };
        let mut worst = Worst { most: 0.0, reached: true };
        let meant = self.targets.iter().enumerate().filter(|(_, target)| target.off_m == [0.0; 2]);
        for ((hole, target), posture) in meant.zip(postures) {
            let corners = match uncertain.load_cone_rad {
                0.0 => Vec::new(),
                angle => forces(&target.wrench.force_n, angle)[1].clone(),
            };
            let beta = &posture.solution.configuration.beta_rad;
            let solved = cover.solved(hole, &cell, cover.whole());
            let on_branch = solved.iter().find(|one| one.within.holds(beta))?;
            for part in parts_of_disc(&cell) {
                let solved = cover.solved(hole, &part, [on_branch.within]);
                worst.reached &= !solved.is_empty();
                for one in &solved {
                    let (moved, reached) = cover.moved(hole, &part, one, &corners)?;
                    let squared = moved.iter().map(|moved| moved.dot(moved).high()).fold(0.0, f64::max);
                    worst.most = worst.most.max(cover.weight(hole) * squared.sqrt() * (1.0 + ROUNDING));
                    worst.reached &= reached;
                }
            }
        }
        // a hole that is where it is meant to be is reached there
        worst.reached |= uncertain.hole_radius_m == 0.0;
        worst.most.is_finite().then_some(worst)
    }
}

/// Squares within a disc's cell that the disc reaches into. Over each a bound is the tighter the smaller it is.
fn parts_of_disc(cell: &Cell) -> Vec<Cell> {
    let [radius, ..] = cell.half;
    if radius == 0.0 {
        return vec![*cell];
    }
    let half = radius / PARTS as f64;
    let centre = |n: usize| half * (2 * n + 1) as f64 - radius;
    let nearest = |n: usize| (centre(n).abs() - half).max(0.0);
    let all = (0..PARTS).flat_map(|i| (0..PARTS).map(move |j| (i, j)));
    let inside = all.filter(|(i, j)| nearest(*i).hypot(nearest(*j)) <= radius);
    let part = |(i, j)| {
        let [x, y, angle] = cell.middle;
        Cell { middle: [x + centre(i), y + centre(j), angle], half: [half, half, cell.half[2]] }
    };
    inside.map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    #[test]
    fn the_corners_hold_the_cone_and_a_smaller_body_does_not() {
        let mut rng = Rng::with_seed(3);
        let mut part = || 2.0 * rng.f64() - 1.0;
        for _ in 0..50 {
            let force = Vector3::new(part(), part(), part()) * 300.0;
            let angle = 0.02 + 0.3 * part().abs();
            let (mut too_narrow, size) = (0, force.norm());
            let [within, _] = forces(&force, angle);
            assert!(within.iter().all(|f| (f.norm() / size - 1.0).abs() < 1e-12 && f.angle(&force) < angle + 1e-7));
            for _ in 0..500 {
                // a convex body holds a point if and only if no direction has it beyond all corners
                let normal = Vector3::new(part(), part(), part());
                let reach = |angle: f64| {
                    let [_, corners] = forces(&force, angle);
                    corners.iter().map(|corner| corner.dot(&normal)).fold(f64::NEG_INFINITY, f64::max)
                };
                // the farthest of the cone along the normal: the normal itself, or the rim below it
                let turn = force.angle(&normal);
                let farthest = size * normal.norm() * (turn - angle).max(0.0).cos();
                let found = reach(angle);
                assert!(found >= farthest - 1e-9 * size, "{found} {farthest}");
                // two in a hundred of what is across the cone by polygons; and the rings' edge, half-way to the rim
                let wide = 0.02 * angle.sin() + 1.0 / (0.5 * angle).cos() - 1.0;
                assert!(found <= farthest + wide * size * normal.norm(), "{found} {farthest}");
                too_narrow += usize::from(reach(0.9 * angle) < farthest - 1e-9 * size);
            }
            assert!(too_narrow > 10, "{too_narrow}");
        }
    }
}

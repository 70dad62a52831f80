//! Blocks of the moving platform, the base and the tool, and the residual that goes with no place.

use std::sync::Arc;

use nalgebra::Vector6;
use pkm_core::effects::Place;

use super::coupled::Written;
use super::elastic::{Frame, M68, V8};
use super::terms::{Seen, Term, rows, symmetric};
use super::{Blocks, Says};

const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];
const SHIFTS: [usize; 3] = [0, 1, 2];
const TURNS: [usize; 3] = [3, 4, 5];
/// Moments that the joints at the base carry.
const ACROSS_Y: [usize; 2] = [3, 5];
/// What bends a plate: the force across it, and the moments about axes in it.
const BENDING_A_PLATE: [usize; 3] = [2, 3, 4];
/// What bends a column along w or z, such as a tool: the forces across it, and the moments about these.
const BENDING_A_COLUMN: [usize; 4] = [0, 1, 3, 4];

/// Names of a place, what passes there, and how elements say a compliance of it.
type Mount = (Vec<String>, fn(&Frame) -> &M68, Written);

/// A place between three joints, the forces and moments at these, and limb and component of those that they carry.
type Plate = (Place, fn(&Frame) -> &[M68; 3], Vec<(usize, usize)>);

/// Adds all of them.
pub fn add(blocks: &mut Blocks<'_>) {
    let usual: Vec<f64> = (0..6).map(|i| blocks.usual.1[(i, i)]).collect();
    mounts(blocks, &usual);
    plates(blocks, &usual);
    by_load(blocks, &usual);
    by_angle(blocks, &usual);
    if blocks.looks_at_single_poses() {
        at_one_pose(blocks, &usual);
    }
    smooth(blocks, &usual);
}

/// Moving platform and base, by the forces and moments at their joints.
fn plates(blocks: &mut Blocks<'_>, usual: &[f64]) {
    const TOGETHER: usize = usize::MAX;
    // forces at all three, and moments: at the moving platform those of limbs 1 and 2, at the base all but about y, about which they turn
    let moving = carried(2, &TURNS);
    let base = carried(3, &ACROSS_Y);
    let plates: [Plate; 2] = [(Place::MovingPlatform, |f| &f.bores, moving), (Place::Base, |f| &f.points, base)];
    // each force by itself, each joint's seat by itself, or all joints together
    let parts = [(&SHIFTS[..], 1), (&SHIFTS, 3), (&SHIFTS, TOGETHER), (&ALL, TOGETHER), (&BENDING_A_PLATE, TOGETHER)];
    for (components, together) in parts {
        for (place, joints, carried) in &plates {
            let which: Vec<usize> = (0..carried.len()).filter(|n| components.contains(&carried[*n].1)).collect();
            // three joints share a load
            let units: Vec<f64> = which.iter().map(|n| 3.0 * usual[carried[*n].1]).collect();
            let force = |f: &Frame, (limb, component): (usize, usize)| joints(f)[limb].row(component).transpose();
            let forces = |f: &Frame| -> Vec<V8> { which.iter().map(|n| force(f, carried[*n])).collect() };
            let written = Written::of(&[*place], &units, &|n| which[n]).by(together);
            blocks.add_compliance(&[place.name().unwrap_or_default().to_owned()], &forces, written);
        }
    }
}

/// Limb and component of what the joints carry, as an element's weights stand: forces at all three, moments at the first of them.
fn carried(with_moments: usize, moments: &[usize]) -> Vec<(usize, usize)> {
    let of = |limbs: usize, components: &[usize]| -> Vec<(usize, usize)> {
        (0..limbs).flat_map(|limb| components.iter().map(move |c| (limb, *c))).collect()
    };
    [of(3, &SHIFTS), of(with_moments, moments)].concat()
}

/// The whole mechanism on the base, and the tool on the platform.
fn mounts(blocks: &mut Blocks<'_>, usual: &[f64]) {
    let g = blocks.model.declared.geometry;
    for (which, together) in [(&SHIFTS[..], 1), (&TURNS, 1), (&ALL, 1), (&ALL, 6), (&BENDING_A_COLUMN, 4)] {
        let units: Vec<f64> = which.iter().map(|i| usual[*i]).collect();
        let tool = Written::of(&[Place::Tool], &units, &|n| which[n]).by(together);
        // at A the moving platform's hub and the tool's holder are in a row
        let at_a = ["tool".into(), "moving_platform".into()];
        blocks.add_compliance(&at_a, &|f| rows(&f.wrenches, which), tool);
        let base = Written::of_ground(&g, &units, which).by(together);
        blocks.add_compliance(&["base".into()], &|f| rows(&f.ground, which), base);
    }
}

/// Mounts that open or rock under load, a tool's holder or a foot: beside what they yield in proportion, they give along some directions by
/// laws of what they carry along these. Across a flange and about axes in it, in any mixture; or also along it, two at a time.
fn by_load(blocks: &mut Blocks<'_>, usual: &[f64]) {
    /// Opens, slides up to a force, gives beyond one; in units of the usual load.
    const LAWS: [fn(f64) -> f64; 3] =
        [|u| (u * u + 0.05).sqrt(), |u| 0.3 * (u / 0.3).tanh(), |u| u - u.clamp(-0.8, 0.8)];
    /// Force across a flange, and moments about axes in it; then the forces along it too.
    const FLANGE: [(&[usize], usize); 2] = [(&[2, 3, 4], 3), (&[0, 1, 2, 3, 4], 2)];
    /// Part of the usual compliance that goes with the load.
    const SHARE: f64 = 0.3;
    let g = blocks.model.declared.geometry;
    let tool: Mount =
        (vec!["tool".into(), "moving_platform".into()], |f| &f.wrenches, Written::of(&[Place::Tool], usual, &|n| n));
    let base: Mount = (vec!["base".into()], |f| &f.ground, Written::of_ground(&g, usual, &ALL));
    for (places, passing, written) in [tool, base] {
        let frames = blocks.frames;
        let usual_loads: Vec<f64> =
            (ALL.iter()).map(|k| blocks.usual_load(|f| passing(f).row(*k).transpose())).collect();
        for (axes, most) in FLANGE {
            let mut terms = symmetric(frames, &|f| rows(passing(f), &ALL), usual, &[&|_| 1.0], 6);
            for direction in directions(axes, most) {
                let carried = |f: &Frame| -> V8 {
                    ALL.iter().map(|k| passing(f).row(*k).transpose() * (direction[*k] / usual_loads[*k])).sum()
                };
                let carried: Arc<Vec<V8>> = Arc::new(frames.iter().map(carried).collect());
                let work = |k: &usize| usual[*k] * (usual_loads[*k] * direction[*k]).powi(2);
                let unit = SHARE * ALL.iter().map(work).sum::<f64>();
                terms.extend(LAWS.map(|law| {
                    let carried = carried.clone();
                    Term::Law(Arc::new(move |pose, now: &V8, _: &V8| {
                        carried[pose] * (unit * (law(carried[pose].dot(now)) - law(0.0)))
                    }))
                }));
            }
            blocks.add(&places, "general", "load", terms);
            // what goes with the load is on no controller
            blocks.write_last(Says::Directions(written.clone()));
        }
    }
}

/// Sums and differences of up to some axes, of length 1, none the opposite of another.
fn directions(axes: &[usize], most: usize) -> Vec<[f64; 6]> {
    let mut all = vec![[0.0; 6]];
    for axis in axes {
        let with = |sign: f64| move |d: &[f64; 6]| std::array::from_fn(|k| if k == *axis { sign } else { d[k] });
        let count = |d: &[f64; 6]| d.iter().filter(|v| **v != 0.0).count();
        let shorter: Vec<[f64; 6]> = all.iter().copied().filter(|d| count(d) < most).collect();
        all.extend(shorter.iter().map(with(1.0)));
        all.extend(shorter.iter().filter(|d| count(d) > 0).map(with(-1.0)));
    }
    all.remove(0);
    all.into_iter().map(|d| Vector6::from(d).normalize().into()).collect()
}

/// What yields between platform and tool goes with the pose, such as a bracket that swings at some angles: along any line smoothly over θ or σ,
/// a sum of bumps.
fn by_angle(blocks: &mut Blocks<'_>, usual: &[f64]) {
    /// Distance of their middles, and width, in parts of the range.
    const STEP: f64 = 0.25;
    const WIDTH: f64 = 0.15;
    for axis in 0..2 {
        let of = || blocks.frames.iter().map(|f| f.pose[axis]);
        let (least, most) = (of().fold(f64::INFINITY, f64::min), of().fold(f64::NEG_INFINITY, f64::max));
        let range = (most - least).max(f64::MIN_POSITIVE);
        let bump = |n: usize| {
            let middle = least + STEP * n as f64 * range;
            move |f: &Frame| (-0.5 * ((f.pose[axis] - middle) / (WIDTH * range)).powi(2)).exp()
        };
        let bumps: Vec<_> = (0..=4).map(bump).collect();
        let shapes: Vec<&dyn Fn(&Frame) -> f64> = bumps.iter().map(|b| b as &dyn Fn(&Frame) -> f64).collect();
        let terms = symmetric(blocks.frames, &|f| rows(&f.wrenches, &SHIFTS), &usual[..3], &shapes, 3);
        blocks.add(&["tool".into(), "moving_platform".into()], "general", "pose", terms);
    }
}

/// What yields at one pose alone, such as a clamp that was not tight there.
fn at_one_pose(blocks: &mut Blocks<'_>, usual: &[f64]) {
    let count = blocks.frames.len();
    for pose in 0..count {
        let term = |k: &usize| {
            let r: V8 = blocks.frames[pose].wrenches.row(*k).transpose();
            Term::AtPose(pose, Box::new(r * r.transpose() * usual[*k]))
        };
        let terms = ALL.iter().map(term).collect();
        let ln_prior = super::measurement::LN_PRIOR_OF_ODDITIES - (count as f64).ln();
        blocks.add_with(&["tool".into(), "sensor".into()], "general", "pose", terms, 0, ln_prior);
    }
}

/// A residual that is smooth over pose and load and goes with no place: discrepancy as Kennedy and O'Hagan have it.
fn smooth(blocks: &mut Blocks<'_>, usual: &[f64]) {
    let mut shapes: Vec<Vec<f64>> = vec![vec![1.0; blocks.frames.len()]];
    for axis in 0..3 {
        let (mean, spread) = (blocks.mean(|f| f.pose[axis]), blocks.spread(|f| f.pose[axis]));
        shapes.push(blocks.frames.iter().map(|f| (f.pose[axis] - mean) / spread).collect());
    }
    let mut terms = Vec::new();
    for i in 0..6 {
        for j in 0..6 {
            let unit = 0.05 * (usual[i] * usual[j]).sqrt();
            for shape in &shapes {
                let shape = shape.clone();
                terms.push(Term::Direct(Arc::new(move |s: &Seen<'_>| {
                    let mut d = [0.0; 6];
                    d[i] = unit * shape[s.pose] * s.wrench[j];
                    d
                })));
            }
        }
    }
    blocks.add(&[], "general", "constant", terms);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_apart_from_each_other() {
        for (axes, most, count) in [(&[2, 3, 4][..], 3, 13), (&[0, 1, 2, 3, 4], 2, 25)] {
            let all = directions(axes, most);
            assert_eq!(all.len(), count);
            let dot = |a: &[f64; 6], b: &[f64; 6]| (0..6).map(|k| a[k] * b[k]).sum::<f64>();
            for (n, a) in all.iter().enumerate() {
                assert!((dot(a, a) - 1.0).abs() < 1e-12 && a.iter().filter(|v| **v != 0.0).count() <= most);
                assert!(all[..n].iter().all(|b| dot(a, b).abs() < 0.9), "{a:?}");
            }
        }
    }
}

//! Blocks of the moving platform, the base and the tool, and the residual that goes with no place.

use std::sync::Arc;

use pkm_core::effects::Place;

use super::Blocks;
use super::coupled::Written;
use super::elastic::{Frame, V8};
use super::terms::{Seen, Term, rows};

const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];
const SHIFTS: [usize; 3] = [0, 1, 2];
const TURNS: [usize; 3] = [3, 4, 5];
/// Moments that the joints at the base carry.
const ACROSS_Y: [usize; 2] = [3, 5];

/// Adds all of them.
pub fn add(blocks: &mut Blocks<'_>) {
    let usual: Vec<f64> = (0..6).map(|i| blocks.usual.1[(i, i)]).collect();
    mounts(blocks, &usual);
    // three joints share a load
    let shift_units: Vec<f64> = (0..9).map(|i| 3.0 * usual[i % 3]).collect();
    let turn_units: Vec<f64> = (0..6).map(|i| 3.0 * usual[3 + i % 3]).collect();
    let bores = |f: &Frame| -> Vec<V8> { (0..3).flat_map(|i| rows(&f.bores[i], &SHIFTS)).collect() };
    let points = |f: &Frame| -> Vec<V8> { (0..3).flat_map(|i| rows(&f.points[i], &SHIFTS)).collect() };
    let platform = |units: &[f64]| Written::of(&[Place::MovingPlatform], units, &|n| n);
    let base = |units: &[f64]| Written::of(&[Place::Base], units, &|n| n);
    for coupled in [false, true] {
        blocks.add_compliance(&["moving_platform".into()], &bores, coupled, platform(&shift_units));
        blocks.add_compliance(&["base".into()], &points, coupled, base(&shift_units));
    }
    // the joints of limbs 1 and 2 bring moments as well
    let with_moments = |f: &Frame| -> Vec<V8> {
        let moments = (0..2).flat_map(|i| rows(&f.bores[i], &TURNS));
        bores(f).into_iter().chain(moments).collect()
    };
    let units = [shift_units.clone(), turn_units].concat();
    blocks.add_compliance(&["moving_platform".into()], &with_moments, true, platform(&units));
    // and those of all three at the base, but about y, about which they turn
    let with_moments = |f: &Frame| -> Vec<V8> {
        let moments = (0..3).flat_map(|i| rows(&f.points[i], &ACROSS_Y));
        points(f).into_iter().chain(moments).collect()
    };
    let units: Vec<f64> = shift_units.into_iter().chain((0..6).map(|i| 3.0 * usual[ACROSS_Y[i % 2]])).collect();
    blocks.add_compliance(&["base".into()], &with_moments, true, base(&units));
    if blocks.looks_at_single_poses() {
        at_one_pose(blocks, &usual);
    }
    smooth(blocks, &usual);
}

/// The whole mechanism on the base, and the tool on the platform.
fn mounts(blocks: &mut Blocks<'_>, usual: &[f64]) {
    let g = blocks.model.declared.geometry;
    for (which, coupled) in [(&SHIFTS[..], false), (&TURNS, false), (&ALL, false), (&ALL, true)] {
        let units: Vec<f64> = which.iter().map(|i| usual[*i]).collect();
        let tool = Written::of(&[Place::Tool], &units, &|n| which[n]);
        // at A the moving platform's hub and the tool's holder are in a row
        let at_a = ["tool".into(), "moving_platform".into()];
        blocks.add_compliance(&at_a, &|f| rows(&f.wrenches, which), coupled, tool);
        let base = Written::of_ground(&g, &units, which);
        blocks.add_compliance(&["base".into()], &|f| rows(&f.ground, which), coupled, base);
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

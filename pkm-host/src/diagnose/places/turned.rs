//! Blocks of joints whose axes are turned: what a joint's own motion makes of stiffnesses along and about other axes.
//!
//! Turned by A, a joint's stiffness K changes by [A, K], and the displacement at A by −Eᵀ [A, K] E w, with E the joint's motion
//! by the load. A free turn counts as motion there: a moment across the free axis works on it, which no compliance of the
//! forces that pass the joint says. So there is no element for it either.

use std::sync::Arc;

use nalgebra::{RowSVector, Vector3};
use pkm_core::machine::Joint;
use pkm_core::{MachineParameters, Transmission};

use super::Blocks;
use super::elastic::{Frame, M6, M8, M68};
use super::limbs::part;
use super::measurement::LN_PRIOR_OF_ODDITIES;
use super::terms::Term;

/// Unit of turns: about a degree.
const TURN_RAD: f64 = 0.02;

/// Adds the joints one by one, and all of them.
pub fn add(blocks: &mut Blocks<'_>) {
    let place = |limb: usize, joint: usize| part(limb, ["base_joint", "platform_joint"][joint]);
    let mut all = Vec::new();
    for limb in 0..3 {
        for joint in [1, 0] {
            let terms = turns(blocks, limb, joint);
            all.extend(terms.clone());
            let places = ["geometry".to_owned(), place(limb, joint)];
            blocks.add_with(&places, "general", "constant", terms, 0, LN_PRIOR_OF_ODDITIES);
        }
    }
    let places = [(0, 1), (1, 1), (2, 0)].map(|(limb, joint)| place(limb, joint));
    let places = [vec!["geometry".to_owned()], places.to_vec()].concat();
    blocks.add_with(&places, "general", "constant", all, 0, LN_PRIOR_OF_ODDITIES);
}

/// Of a machine's limb the joint at the base (0) or at the platform (1).
fn joint(machine: &MachineParameters, limb: usize, joint: usize) -> &Joint {
    let limb = &machine.limbs[limb];
    if joint == 0 { &limb.base_joint } else { &limb.platform_joint }
}

/// What a turn of a joint's axes by 1 rad about one of them adds to the compliance that the transmitted wrenches meet.
fn change(own: &Joint, motion: &M68, axis: usize) -> M8 {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let of = |first: usize, k: &[f64; 3]| {
        let (a_moves, b_moves) = (motion.row(first + a), motion.row(first + b));
        (a_moves.tr_mul(&b_moves) + b_moves.tr_mul(&a_moves)) * (k[b] - k[a])
    };
    of(0, &own.linear_n_per_m) + of(3, &own.angular_nm_per_rad)
}

/// Turns of a joint's axes about each of them that change anything.
fn turns(blocks: &Blocks<'_>, limb: usize, which: usize) -> Vec<Term> {
    let own = joint(&blocks.model.declared, limb, which);
    let about = |axis: usize| -> Option<Term> {
        let of = |f: &Frame| change(own, &f.motions[limb][which], axis) * TURN_RAD;
        let all: Vec<M8> = blocks.frames.iter().map(of).collect();
        all.iter().any(|e| e.amax() > 0.0).then(|| Term::Elastic(Arc::new(all)))
    };
    (0..3).filter_map(about).collect()
}

/// Motions of a limb's joints at base and platform along and about their axes, by the transmitted wrenches: what yields follows
/// the forces and moments that pass, `passing`; free turns follow the platform, whose displacement at A is `compliance` times the
/// load. The body's own bending is left out of the turn about y at the base of limbs 1 and 2, so that what a turn of that joint's axes
/// about x does comes out up to two fifths wrong; all else is exact.
pub fn motions(
    machine: &MachineParameters,
    t: &Transmission<f64>,
    compliance: &M6,
    limb: usize,
    passing: &[M68; 2],
) -> [M68; 2] {
    let frame = &t.limbs[limb];
    let mut motions: [M68; 2] = std::array::from_fn(|n| {
        let own = joint(machine, limb, n);
        let k = [own.linear_n_per_m, own.angular_nm_per_rad];
        M68::from_fn(|i, j| {
            let k = k[i / 3][i % 3];
            if k > 0.0 { passing[n][(i, j)] / k } else { 0.0 }
        })
    });
    let platform = compliance * t.wrenches;
    let turned = platform.fixed_rows::<3>(3);
    // of a direction in A-uvw: rotation about it, and displacement along it of a point of the platform
    let about = |axis: &Vector3<f64>| -> RowSVector<f64, 8> { axis.transpose() * turned };
    let along = |axis: &Vector3<f64>, at: &Vector3<f64>| -> RowSVector<f64, 8> {
        axis.transpose() * platform.fixed_rows::<3>(0) + about(&at.cross(axis))
    };
    let yielding = |motions: &[M68; 2], joint: usize, kind: usize, axis: &Vector3<f64>| -> RowSVector<f64, 8> {
        (axis.transpose() * frame.axes[joint]) * motions[joint].fixed_rows::<3>(3 * kind)
    };
    let [base, own] = [0, 1].map(|joint| [0, 1, 2].map(|axis| frame.axes[joint].column(axis).into_owned()));
    // nothing bends the limb in the plane across x, as x is free at both ends
    let across =
        along(&own[1], &frame.joints_m[1]) - yielding(&motions, 1, 0, &own[1]) - yielding(&motions, 0, 0, &own[1]);
    let leaning = across * (-1.0 / frame.length_m);
    if limb < 2 {
        let about_y = about(&base[1]) - yielding(&motions, 1, 1, &base[1]);
        motions[0].set_row(4, &about_y);
        motions[1].set_row(3, &(about(&own[0]) - leaning));
    }
    motions[0].set_row(3, &leaning);
    motions
}

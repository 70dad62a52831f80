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
/// load. The body's own bending is left out of the turn about y at the base, where it is little beside the platform's.
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

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Matrix6, Rotation3};
    use pkm_core::Machine;
    use pkm_core::machine::{BodyKind, Tube};

    use super::super::elastic;
    use super::*;
    use crate::diagnose::declared::Declared;
    use crate::diagnose::tests::machine;
    use crate::pose::pose_of;

    /// Stiffness of what is free, N·m/rad: little beside 10⁵.
    const FREE: f64 = 3.0;

    /// The motion at A by one of a point's, along axes there.
    fn carried(point: &Vector3<f64>, axes: &Matrix3<f64>) -> Matrix6<f64> {
        let mut all = Matrix6::zeros();
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(axes);
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(axes);
        all.fixed_view_mut::<3, 3>(0, 3).copy_from(&(point.cross_matrix() * axes));
        all
    }

    /// Terminal compliance of three limbs, each joint, beam and joint in a row, with a joint's axes turned.
    fn compliance(machine: &MachineParameters, t: &Transmission<f64>, turned: (usize, usize, usize), turn: f64) -> M6 {
        let mut stiffness = M6::zeros();
        for limb in 0..3 {
            let (frame, body) = (&t.limbs[limb], &machine.limbs[limb].body);
            // of a tube: area, and second moment about a diameter
            let powers = |t: &Tube, n: i32| std::f64::consts::PI * (t.outer_m.powi(n) - t.inner_m.powi(n));
            let (area, moment) = (|t: &Tube| powers(t, 2) / 4.0, |t: &Tube| powers(t, 4) / 64.0);
            let sum = |of: &dyn Fn(&Tube) -> f64| of(&body.rod) + of(&body.screw);
            let (ea, ei) = (sum(&|t| t.young_pa * area(t)), sum(&|t| t.young_pa * moment(t)));
            let gj = 2.0 * sum(&|t| t.shear_pa * moment(t));
            let q = frame.length_m;
            let (bend, slope, tilt) = (q.powi(3) / (3.0 * ei), q * q / (2.0 * ei), q / ei);
            let mut own = Matrix6::from_diagonal(&[bend, bend, q / ea, tilt, tilt, q / gj].into());
            for (i, j, value) in [(0, 4, slope), (1, 3, -slope)] {
                own[(i, j)] = value;
                own[(j, i)] = value;
            }
            let at_tip = carried(&frame.joints_m[1], &frame.axes[1]);
            let mut all = at_tip * own * at_tip.transpose();
            for which in 0..2 {
                let j = joint(machine, limb, which);
                let k = [j.linear_n_per_m, j.angular_nm_per_rad].concat();
                let soft = Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|i, _| 1.0 / k[i].max(FREE)));
                let angle = if (limb, which) == (turned.0, turned.1) { turn } else { 0.0 };
                let turn = Rotation3::new(Vector3::ith(turned.2, angle));
                let carried = carried(&frame.joints_m[which], &(frame.axes[which] * turn.matrix()));
                all += carried * soft * carried.transpose();
            }
            stiffness += all.try_inverse().unwrap();
        }
        stiffness.try_inverse().unwrap()
    }

    /// Turned axes of every joint are what springs and beams in a row make of them.
    #[test]
    fn turned_axes_are_those_of_joints_and_beams_in_a_row() {
        let mut declared = machine().parameters;
        declared.limbs.iter_mut().for_each(|l| l.body.kind = BodyKind::Beam);
        let core = Machine::<f64>::new(&declared).unwrap();
        let pose = pose_of(9.0, -6.0, 560.0);
        let t = core.transmission(&pose).unwrap();
        let frames = Frame::all(&declared, &Declared::all(&declared), &[pose]).unwrap();
        let p = elastic::solve(&t.wrenches, &frames[0].compliance()).unwrap();
        let size = |i: usize, j: usize| (p.compliance[(i, i)] * p.compliance[(j, j)]).sqrt();
        let scaled = |m: &M6| M6::from_fn(|i, j| m[(i, j)] / size(i, j));
        for limb in 0..3 {
            for which in 0..2 {
                for axis in 0..3 {
                    let step = 1e-3;
                    let [more, less] = [step, -step].map(|h| compliance(&declared, &t, (limb, which, axis), h));
                    let there = scaled(&((more - less) / (2.0 * step)));
                    let e = change(joint(&declared, limb, which), &frames[0].motions[limb][which], axis);
                    let said = scaled(&(p.response * e * p.response.transpose()));
                    let error = (said - there).amax() / there.amax().max(1e-2);
                    println!("{limb} {which} {axis}: {:e} {error:e}", there.amax());
                    // about x of the base of limbs 1 and 2, whose bending is left out
                    let tolerance = if (which, axis) == (0, 0) && limb < 2 { 0.3 } else { 0.01 };
                    assert!(error < tolerance, "limb {limb}, joint {which}, axis {axis}: {error:e}");
                }
            }
        }
    }
}

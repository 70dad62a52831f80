//! What small errors of the joints do to the platform: axes that are not parallel, joints beside their places.
//!
//! A limb whose parts are a little off asks for a small motion of the platform. Its free axes take part of that; what the wrenches
//! see that it transmits does not go away. With H the wrenches, D the compliance that they meet and e = Hᵀ(motion) of that limb
//! alone, the platform goes where the limbs strain least: (H D⁻¹ Hᵀ)⁻¹ H D⁻¹ e. H and D are the core's.

use nalgebra::{Matrix3, SMatrix, Vector3, Vector6};
use pkm_core::{LimbFrame, Machine, Pose, Transmission};

/// Wrenches of each limb among all.
const WRENCHES_OF: [std::ops::Range<usize>; 3] = [0..3, 3..6, 6..8];
/// A body of a limb's chain in which an error keeps its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Body {
    Base,
    /// Between the two axes of the universal joint.
    Yoke,
    Limb,
    Platform,
}

/// A small error of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flaw {
    limb: usize,
    body: Body,
    /// 0 at the base joint, 1 at the platform joint.
    end: usize,
    /// Of the body's frame.
    axis: usize,
    is_turn: bool,
}

impl Flaw {
    /// Turns of joint axes: every part of a limb may be turned against the next.
    pub fn turns() -> Vec<Self> {
        let of = |limb: usize| -> &'static [(Body, usize)] {
            match limb {
                // a spherical joint has no axis
                2 => &[(Body::Base, 0), (Body::Limb, 0)],
                _ => &[(Body::Base, 0), (Body::Yoke, 0), (Body::Limb, 0), (Body::Limb, 1), (Body::Platform, 1)],
            }
        };
        let turn = |limb, body, end, axis| Self { limb, body, end, axis, is_turn: true };
        let all = (0..3).flat_map(|limb| of(limb).iter().map(move |(body, end)| (limb, *body, *end)));
        all.flat_map(|(limb, body, end)| (0..3).map(move |axis| turn(limb, body, end, axis))).collect()
    }

    /// Joints beside their places on the two platforms.
    pub fn places() -> Vec<Self> {
        let ends = [(Body::Base, 0), (Body::Platform, 1)];
        let place = |limb, (body, end), axis| Self { limb, body, end, axis, is_turn: false };
        let all = (0..3).flat_map(|limb| ends.map(|end| (limb, end)));
        all.flat_map(|(limb, end)| (0..3).map(move |axis| place(limb, end, axis))).collect()
    }

    /// Axes of the body in A-uvw.
    fn frame(&self, t: &Transmission<f64>, limb: &LimbFrame<f64>) -> Matrix3<f64> {
        match self.body {
            Body::Base => t.base_axes,
            Body::Yoke => limb.axes[0],
            Body::Limb => limb.axes[1],
            Body::Platform => Matrix3::identity(),
        }
    }

    /// Motion that a unit of it asks of the platform: of A, then rotation, in A-uvw.
    fn motion(&self, t: &Transmission<f64>) -> Vector6<f64> {
        let limb = &t.limbs[self.limb];
        let along: Vector3<f64> = self.frame(t, limb).column(self.axis).into_owned();
        let (translation, rotation) = if self.is_turn {
            (limb.joints_m[self.end].cross(&along), along)
        } else if self.end == 0 {
            (along, Vector3::zeros())
        } else {
            (-along, Vector3::zeros())
        };
        let mut motion = Vector6::zeros();
        motion.fixed_rows_mut::<3>(0).copy_from(&translation);
        motion.fixed_rows_mut::<3>(3).copy_from(&rotation);
        motion
    }
}

/// By how much each of the wrenches is met by more compliance than is declared: factors.
pub type Give = [f64; 8];

/// How a unit of each flaw moves the platform at a pose, m and rad in A-uvw; `None` where the machine has no posture.
pub fn responses(machine: &Machine<f64>, pose: &Pose<f64>, flaws: &[Flaw], give: &Give) -> Option<Vec<Vector6<f64>>> {
    let t = machine.transmission(pose).ok()?;
    let entry = |i: usize, j: usize| t.compliance[(i.max(j), i.min(j))] * (give[i] * give[j]).sqrt();
    let d = SMatrix::<f64, 8, 8>::from_fn(entry);
    let h_over_d = t.wrenches * d.cholesky()?.inverse();
    let response = (h_over_d * t.wrenches.transpose()).cholesky()?.inverse() * h_over_d;
    let of = |flaw: &Flaw| {
        let mut seen = t.wrenches.tr_mul(&flaw.motion(&t));
        (0..8).filter(|n| !WRENCHES_OF[flaw.limb].contains(n)).for_each(|n| seen[n] = 0.0);
        response * seen
    };
    Some(flaws.iter().map(of).collect())
}

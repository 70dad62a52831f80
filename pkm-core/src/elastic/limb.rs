//! A limb at a pose.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::Chain;
use crate::linalg::join;
use crate::scalar::Scalar;

/// A limb as effects see it. Points and axes are in A-uvw, with A as the origin.
pub(crate) struct Limb<'a, T, const N: usize> {
    /// 0, 1, 2.
    pub index: usize,
    /// Length, m.
    pub q: T,
    /// B_i and A_i, m.
    pub base: Vector3<T>,
    /// See `base`.
    pub platform: Vector3<T>,
    /// Axes of body and platform joint, as columns: x, y, z along the limb.
    pub axes: Matrix3<T>,
    /// Axes of the base joint, as columns.
    pub base_axes: Matrix3<T>,
    /// 1/EA, 1/EI and 1/GJ of the declared body.
    pub axial: T,
    /// See `axial`.
    pub bending: T,
    /// See `axial`.
    pub torsion: T,
    /// Where compliance is added.
    pub chain: &'a mut Chain<T, N>,
}

/// Joints of one limb at a pose, in A-uvw with A as the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimbFrame<T> {
    /// Length B_i A_i, m.
    pub length_m: T,
    /// B_i and A_i, m.
    pub joints_m: [Vector3<T>; 2],
    /// Unit vectors x, y, z of the base joint, and of body and platform joint, as columns.
    pub axes: [Matrix3<T>; 2],
}

impl<T: Scalar> LimbFrame<T> {
    /// The middle between both joints.
    fn middle(&self) -> Vector3<T> {
        let [b, a] = &self.joints_m;
        (a + b) * T::from_f64(0.5)
    }

    /// What a force at a point that is fixed to the limb's body does at A. The limb hangs between its joints: it goes along with A_i,
    /// stays at B_i, and turns as the line between them does.
    fn carried(&self, point: &Vector3<T>, force: &Vector3<T>) -> Vector6<T> {
        let [b, a] = &self.joints_m;
        let moment = (point - b).cross(force);
        let z = self.axes[1].column(2);
        let along = z * (force.dot(&z) * (point - b).dot(&z));
        let at_a = (moment.cross(&z) + along) * (T::ONE / self.length_m);
        join(at_a, a.cross(&at_a))
    }

    /// What a tie between the middles of two limbs' bodies does at A when it pulls with a force on the first: the force acts half way
    /// between the middles, on both.
    pub fn tied(limbs: [&Self; 2], force: &Vector3<T>) -> Vector6<T> {
        let [first, second] = limbs;
        let point = (first.middle() + second.middle()) * T::from_f64(0.5);
        first.carried(&point, force) - second.carried(&point, force)
    }
}

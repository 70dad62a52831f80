//! A limb at a pose.

use nalgebra::{Matrix3, Vector3};

use super::Chain;

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

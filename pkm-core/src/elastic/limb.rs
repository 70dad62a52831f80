//! A limb at a pose.

use super::Chain;

/// A limb as effects see it. Points and axes are in A-uvw, with A as the origin.
pub(crate) struct Limb<'a, T, const N: usize> {
    /// 0, 1, 2.
    pub index: usize,
    /// Length, m.
    pub q: T,
    /// B_i and A_i, m.
    pub base: [T; 3],
    /// See `base`.
    pub platform: [T; 3],
    /// Axes of body and platform joint: x, y, z along the limb.
    pub axes: [[T; 3]; 3],
    /// Axes of the base joint.
    pub base_axes: [[T; 3]; 3],
    /// 1/EA, 1/EI and 1/GJ of the declared body.
    pub axial: T,
    /// See `axial`.
    pub bending: T,
    /// See `axial`.
    pub torsion: T,
    /// Where compliance is added.
    pub chain: &'a mut Chain<T, N>,
}

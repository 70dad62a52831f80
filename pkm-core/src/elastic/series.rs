//! Compliance in series with the whole mechanism.

use nalgebra::{Matrix3, Vector3, Vector6};

use crate::linalg::{Lower, axes};
use crate::scalar::Scalar;

/// Compliance between ground or tool and the whole mechanism, at a point with axes, both in A-uvw.
pub(crate) struct Series<T> {
    /// m.
    pub at: Vector3<T>,
    /// Three unit vectors, as columns.
    pub axes: Matrix3<T>,
    /// Along and about the axes, m/N and rad/(N·m).
    pub compliance: [T; 6],
}

impl<T: Scalar> Series<T> {
    /// At A, along and about u, v, w.
    pub fn at_a(compliance: [T; 6]) -> Self {
        Self { at: Vector3::zeros(), axes: Matrix3::identity(), compliance }
    }

    /// K := (K⁻¹ + C)⁻¹, a direction at a time. Lower triangle. False when a negative compliance leaves it not positive
    /// definite.
    #[must_use]
    pub fn soften(&self, k: &mut Lower<T>) -> bool {
        let mut definite = true;
        for (axis, (linear, angular)) in
            axes(&self.axes).iter().zip(self.compliance.iter().zip(self.compliance.iter().skip(3)))
        {
            for (compliance, motion) in [*linear, *angular].into_iter().zip(motions(&self.at, axis)) {
                definite &= soften(k, motion, compliance);
            }
        }
        definite
    }
}

/// What A moves by when a point, given in A-uvw, gives by one unit along an axis, and about it.
pub(crate) fn motions<T: Scalar>(at: &Vector3<T>, axis: &Vector3<T>) -> [[T; 6]; 2] {
    let o = T::ZERO;
    let [x, y, z] = (*axis).into();
    let [rx, ry, rz] = at.cross(axis).into();
    [[x, y, z, o, o, o], [rx, ry, rz, x, y, z]]
}

/// K := K + k w wᵀ: a spring beside the mechanism that does the wrench w at A per unit of its force. Lower triangle.
pub(crate) fn stiffen<T: Scalar>(k: &mut Lower<T>, wrench: &Vector6<T>, stiffness: T) {
    let w: [T; 6] = (*wrench).into();
    for i in 0..6 {
        for j in 0..=i {
            k.data.0[j][i] += stiffness * w[i] * w[j];
        }
    }
}

/// K := (K⁻¹ + c m mᵀ)⁻¹ (Sherman and Morrison), with m what A moves by when the spring gives by one unit. Lower triangle. False
/// when a negative compliance leaves it not positive definite.
#[must_use]
pub(crate) fn soften<T: Scalar>(k: &mut Lower<T>, motion: [T; 6], compliance: T) -> bool {
    let (o, k) = (T::ZERO, &mut k.data.0);
    if compliance == o {
        return true;
    }
    let mut force = [o; 6];
    for i in 0..6 {
        for j in 0..6 {
            force[i] += if j <= i { k[j][i] } else { k[i][j] } * motion[j];
        }
    }
    let mut work = o;
    for i in 0..6 {
        work += force[i] * motion[i];
    }
    let share = T::ONE / (T::ONE / compliance + work);
    for i in 0..6 {
        for j in 0..=i {
            k[j][i] -= share * force[i] * force[j];
        }
    }
    // det K changes by the factor 1 + compliance × work, which must stay positive
    compliance > o || !(share > o)
}

//! Limits that scale a whole vector of joint offsets, so that the tip keeps its direction.

use nalgebra::SVector;

use crate::scalar::Scalar;

/// The greatest share, at most 1, of a finite vector that leaves every component within its limit.
pub(super) fn share_within<T: Scalar, const JOINTS: usize>(
    vector: &SVector<T, JOINTS>,
    most: &SVector<T, JOINTS>,
) -> T {
    let mut share = T::ONE;
    for (component, most) in vector.as_slice().iter().zip(most.as_slice()) {
        let size = component.abs();
        if size * share > *most {
            share = *most / size;
        }
    }
    share
}

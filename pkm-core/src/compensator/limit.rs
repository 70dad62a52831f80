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

/// A share of a way that ends where `way` does, on which the tip goes straight: way s − ½ s (1 − s) times the second derivative of the
/// joints along it. `most` holds for it, as it does for the same share of a straight way of the joints. `None` where that is the same,
/// where there is no derivative, or where its part is not small beside `most`.
pub(super) fn bent_part<T: Scalar, const JOINTS: usize>(
    way: &SVector<T, JOINTS>,
    share: T,
    most: &SVector<T, JOINTS>,
    second: impl Fn(&SVector<T, JOINTS>) -> Option<SVector<T, JOINTS>>,
) -> Option<SVector<T, JOINTS>> {
    if !(share < T::ONE) {
        return None;
    }
    let bend = second(way)? * (T::from_f64(0.5) * share * (T::ONE - share));
    let small = share_within(&(bend * T::from_f64(4.0)), most) >= T::ONE;
    let bent = way * share - bend;
    small.then(|| bent * share_within(&bent, most))
}

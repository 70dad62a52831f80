//! Limits that scale a whole vector of joint offsets, so that the tip keeps its direction.

use nalgebra::SVector;

use crate::scalar::Scalar;

/// The greatest share, at most 1, of a finite vector that leaves every component within its limit, and the number of the component that
/// asks for it; 0 where none does.
pub(super) fn share_within<T: Scalar, const JOINTS: usize>(
    vector: &SVector<T, JOINTS>,
    most: &SVector<T, JOINTS>,
) -> (T, usize) {
    let (mut share, mut lead) = (T::ONE, 0);
    for (n, (component, most)) in vector.as_slice().iter().zip(most.as_slice()).enumerate() {
        let size = component.abs();
        if size * share > *most {
            (share, lead) = (*most / size, n);
        }
    }
    (share, lead)
}

/// A part of a way that ends where `way` does, on which the tip goes straight: way s − ½ s (1 − s) times the second derivative of the
/// joints along it. It moves the joint that asks for the share by as much as that share of a straight way of the joints would, so that
/// no more steps are needed; it is smaller where another joint would exceed `most`, which holds for it. `None` where the whole way is
/// within `most`, where there is no derivative, or where its part is not small beside `most`.
pub(super) fn bent_part<T: Scalar, const JOINTS: usize>(
    way: &SVector<T, JOINTS>,
    (share, lead): (T, usize),
    most: &SVector<T, JOINTS>,
    second: impl Fn(&SVector<T, JOINTS>) -> Option<SVector<T, JOINTS>>,
) -> Option<SVector<T, JOINTS>> {
    // of a share that rounding takes for none there is no part either
    if !(share < T::ONE && share > T::EPSILON) {
        return None;
    }
    let half = second(way)? * T::from_f64(0.5);
    let bend = half * (share * (T::ONE - share));
    if share_within(&(bend * T::from_f64(4.0)), most).0 < T::ONE {
        return None;
    }
    // a share at which the joint moves by as much, as far as its way is straight from here to there
    let (straight, bend) = (*way.as_slice().get(lead)? * share, *bend.as_slice().get(lead)?);
    let share = share * (straight / (straight - bend));
    let part = way * share - half * (share * (T::ONE - share));
    Some(part * share_within(&part, most).0)
}

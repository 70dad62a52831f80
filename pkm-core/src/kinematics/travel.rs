//! Ends of travel of the screws.

use super::KinematicsError;
use crate::linalg::is_finite;
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::ScrewLengths;

impl<T: Scalar> Machine<T> {
    /// How far the lengths are from the nearest end of travel, in m; negative outside. With the limb, which counts from 1.
    ///
    /// # Errors
    /// [`KinematicsError::NotFinite`]
    pub fn travel_margin_m(&self, lengths: &ScrewLengths<T>) -> Result<(T, u8), KinematicsError> {
        if !is_finite(&lengths.q_m) {
            return Err(KinematicsError::NotFinite);
        }
        let q_m: [T; 3] = lengths.q_m.into();
        let mut least = (q_m[0] - self.q_min[0], 1);
        for (limb, ((q, lo), hi)) in [1, 2, 3].into_iter().zip(q_m.into_iter().zip(self.q_min).zip(self.q_max)) {
            for margin in [q - lo, hi - q] {
                if margin < least.0 {
                    least = (margin, limb);
                }
            }
        }
        Ok(least)
    }

    pub(super) fn check_travel(&self, lengths: &ScrewLengths<T>) -> Result<(), KinematicsError> {
        let mut furthest = (T::ZERO, 0);
        let q_m: [T; 3] = lengths.q_m.into();
        for (limb, ((q, lo), hi)) in [1, 2, 3].into_iter().zip(q_m.into_iter().zip(self.q_min).zip(self.q_max)) {
            let (beyond, end) = if q < lo { (lo - q, lo) } else { (q - hi, hi) };
            // a pose that came from lengths on the very end of travel must not be refused for its rounding
            let excess = beyond - T::SLACK * end;
            if excess > furthest.0 || !(q > T::ZERO) {
                furthest = (excess, limb);
            }
        }
        let (_, limb) = furthest;
        if limb == 0 { Ok(()) } else { Err(KinematicsError::OutOfTravel { limb }) }
    }
}

//! Ends of travel of the screws.

use super::KinematicsError;
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::ScrewLengths;

impl<T: Scalar> Machine<T> {
    /// How far the lengths are from the nearest end of travel, in m; negative outside. With the limb, 0…2.
    pub fn travel_margin_m(&self, lengths: &ScrewLengths<T>) -> (T, usize) {
        let mut least = (lengths.q_m[0] - self.q_min[0], 0);
        for (limb, ((q, lo), hi)) in lengths.q_m.into_iter().zip(self.q_min).zip(self.q_max).enumerate() {
            for margin in [q - lo, hi - q] {
                if margin < least.0 {
                    least = (margin, limb);
                }
            }
        }
        least
    }

    pub(super) fn check_travel(&self, lengths: &ScrewLengths<T>) -> Result<(), KinematicsError> {
        let (margin, limb) = self.travel_margin_m(lengths);
        // a pose that came from lengths on the very end of travel must not be refused for its rounding; where travel is endless
        // that rounding is more than any length
        if margin >= -T::SLACK * self.q_max[0] && lengths.q_m.iter().all(|q| *q > T::ZERO) {
            Ok(())
        } else {
            Err(KinematicsError::OutOfTravel { limb: limb as u8 + 1 })
        }
    }
}

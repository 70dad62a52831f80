//! The pose of screw lengths in closed form.

use super::{KinematicsError, SingularityDistance};
use crate::machine::Sizes;
use crate::scalar::Scalar;
use crate::types::{Pose, ScrewLengths};

impl<T: Scalar> Sizes<T> {
    /// See [`Machine::forward`](crate::Machine::forward); whatever the travel.
    pub(super) fn forward(&self, lengths: &ScrewLengths<T>) -> Result<Pose<T>, KinematicsError> {
        let [q1, q2, q3] = lengths.q_m.into();
        let (two, three) = (T::from_f64(2.0), T::from_f64(3.0));
        let half = T::from_f64(0.5);
        let (a1, b1, a2, b2) = (self.a1, self.b1, self.a2, self.b2);

        // In x = 1 − cos σ the cubic reads x (x − 2) (x − m) = d; the working mode is its smallest root.
        let k = two * a1 * b1;
        let gap = b1 - a1;
        let m = ((q1 * q1 + q2 * q2) * half - gap * gap) / k;
        let a1_l_sin_sigma = (q2 - q1) * (q2 + q1) * T::from_f64(0.25);
        let d = a1_l_sin_sigma * a1_l_sin_sigma / (a1 * a1 * k);
        let centre = (m + two) / three;
        let radius = (m * m - two * m + T::from_f64(4.0)).sqrt() / three;
        let at_centre = centre * (centre - two) * (centre - m) - d;
        let ratio = -at_centre / (two * radius * radius * radius);
        if !(m > T::ZERO && ratio <= T::ONE) {
            return Err(KinematicsError::Unreachable);
        }
        let third_angle = if ratio > -T::ONE { ratio.acos() / three } else { T::from_f64(core::f64::consts::PI / 3.0) };
        let mut x = centre + two * radius * (third_angle + T::from_f64(2.0 * core::f64::consts::PI / 3.0)).cos();
        for _ in 0..2 {
            let slope = three * x * x - two * (m + two) * x + two * m;
            if slope > T::ZERO {
                x -= (x * (x - two) * (x - m) - d) / slope;
            }
        }
        let l2 = k * (m - x);
        if !(l2 > T::ZERO) {
            return Err(KinematicsError::Unreachable);
        }
        let l = l2.sqrt();
        let sin_sigma = a1_l_sin_sigma / (a1 * l);
        let cos_sigma = T::ONE - x;

        // L sin θ + a2 cos θ = along, L cos θ − a2 sin θ = across > 0
        let n2 = l2 + a2 * a2;
        let along = (n2 + b2 * b2 - q3 * q3) / (two * b2);
        let across2 = n2 - along * along;
        if !(across2 >= T::ZERO) {
            return Err(KinematicsError::Unreachable);
        }
        let across = across2.sqrt();
        let n2_cos_theta = a2 * along + l * across;
        SingularityDistance::new(self, l2, sin_sigma, cos_sigma, across).check()?;
        if !(n2_cos_theta > T::ZERO) {
            return Err(KinematicsError::Unreachable);
        }
        Ok(Pose {
            theta_rad: (l * along - a2 * across).atan2(n2_cos_theta),
            sigma_rad: sin_sigma.atan2(cos_sigma),
            z0_m: l * n2_cos_theta / n2,
        })
    }
}

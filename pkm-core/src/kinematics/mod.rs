//! Inverse and forward kinematics of the parallel mechanism (paper, Eqs. 3-6; `docs/theory.md`).
//!
//! With L = |AB| = Z0/cos θ the mechanism is two plane problems: limbs 1 and 2 set (L, σ), limb 3 then sets θ.

use core::fmt;

use nalgebra::Matrix3;

use crate::linalg::{from_columns, is_finite};
use crate::machine::{Machine, Sizes};
use crate::scalar::Scalar;
use crate::types::{Pose, ScrewLengths};

mod forward;
mod posture;
mod travel;

pub(crate) use posture::{Actual, Posture};

/// Least [`SingularityDistance`] at which a pose is accepted.
pub const SINGULARITY_MARGIN: f64 = 1e-3;

/// Why there are no screw lengths for a pose, or no pose for screw lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum KinematicsError {
    /// An input is NaN or infinite.
    NotFinite,
    /// No assembly exists in the working mode: an angle beyond ±90°, Z0 not above 0, the far side of a
    /// singularity, or lengths that don't close.
    Unreachable,
    /// Nearer to a direct singularity than [`SINGULARITY_MARGIN`].
    Singular,
    /// A screw would leave its travel. Limbs count from 1.
    OutOfTravel {
        /// The limb that leaves its travel furthest.
        limb: u8,
    },
}

impl fmt::Display for KinematicsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("an input is not a finite number"),
            Self::Unreachable => f.write_str("no assembly exists in the working mode"),
            Self::Singular => f.write_str("too near to a direct singularity"),
            Self::OutOfTravel { limb } => write!(f, "the screw of limb {limb} would leave its travel"),
        }
    }
}

impl core::error::Error for KinematicsError {}

/// How far a posture is from the two direct singularities, dimensionless: 0 there, positive in the working
/// mode, 1 at the most. The determinant of the Jacobian vanishes with either.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SingularityDistance<T> {
    /// (L² cos σ − a1 b1 sin² σ) / (L² + a1 b1): limbs 1 and 2.
    pub limbs_1_2: T,
    /// (L cos θ − a2 sin θ) / √(L² + a2²): limb 3 square to B3–A3 when 1, in line with B–A3 when 0.
    pub limb_3: T,
}

impl<T: Scalar> SingularityDistance<T> {
    /// `across` is L cos θ − a2 sin θ.
    fn new(sizes: &Sizes<T>, l2: T, sin_sigma: T, cos_sigma: T, across: T) -> Self {
        let ab = sizes.a1 * sizes.b1;
        Self {
            limbs_1_2: (l2 * cos_sigma - ab * sin_sigma * sin_sigma) / (l2 + ab),
            limb_3: across / (l2 + sizes.a2 * sizes.a2).sqrt(),
        }
    }

    fn check(&self) -> Result<(), KinematicsError> {
        let margin = T::from_f64(SINGULARITY_MARGIN);
        if self.limbs_1_2 >= margin && self.limb_3 >= margin {
            Ok(())
        } else if self.limbs_1_2 > -margin && self.limb_3 > -margin {
            Err(KinematicsError::Singular)
        } else {
            Err(KinematicsError::Unreachable)
        }
    }
}

impl<T: Scalar> Machine<T> {
    /// Screw lengths for a pose: q1,2² = (L ∓ a1 sin σ)² + (b1 − a1 cos σ)²,
    /// q3² = L² + a2² + b2² − 2 b2 (L sin θ + a2 cos θ).
    ///
    /// Accuracy: [`forward`](Self::forward) of it returns the pose to 1e-12 (f64, relative to 1 rad and to L)
    /// for every machine and pose with a singularity distance of at least 0.05.
    ///
    /// # Errors
    /// In this order: not finite, unreachable, singular, out of travel.
    ///
    /// ```
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::{KinematicsError, Pose, tables::reference};
    /// let machine = &reference::MACHINE_F64;
    /// let q = machine.inverse(&Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 })?;
    /// assert_eq!(q.q_m.map(|q| (q * 1e4).round() / 10.0), Vector3::new(567.8, 550.6, 519.4));
    /// let far = Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.9 };
    /// assert_eq!(machine.inverse(&far), Err(KinematicsError::OutOfTravel { limb: 1 }));
    /// # Ok::<(), KinematicsError>(())
    /// ```
    pub fn inverse(&self, pose: &Pose<T>) -> Result<ScrewLengths<T>, KinematicsError> {
        Ok(ScrewLengths { q_m: self.posture_inline(pose)?.q })
    }

    /// The pose in the working mode for screw lengths, in closed form (`docs/theory.md`): the root of a cubic
    /// for cos σ, then θ. Two Newton steps on the cubic restore the digits that its cosine form loses.
    ///
    /// # Errors
    /// In this order: not finite, out of travel, unreachable, singular.
    ///
    /// ```
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::{KinematicsError, ScrewLengths, tables::reference};
    /// let pose = reference::MACHINE_F64.forward(&ScrewLengths { q_m: Vector3::new(0.5678, 0.5506, 0.5194) })?;
    /// assert!((pose.theta_rad - 0.1).abs() < 1e-3 && (pose.z0_m - 0.53).abs() < 1e-4);
    /// # Ok::<(), KinematicsError>(())
    /// ```
    pub fn forward(&self, lengths: &ScrewLengths<T>) -> Result<Pose<T>, KinematicsError> {
        if !is_finite(&lengths.q_m) {
            return Err(KinematicsError::NotFinite);
        }
        self.check_travel(lengths)?;
        self.declared.forward(lengths)
    }

    /// ∂q/∂(θ, σ, Z0): a row for each limb, columns in m/rad, m/rad, m/m.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn jacobian(&self, pose: &Pose<T>) -> Result<Matrix3<T>, KinematicsError> {
        let p = self.posture(pose)?;
        let (dl_dz0, dl_dtheta) = (T::ONE / p.cos_theta, p.l * p.sin_theta / p.cos_theta);
        let [q1, q2, q3] = p.q.into();
        let dq_dl = [p.along_n[0] / q1, p.along_n[1] / q2, p.limb_3[1] / q3];
        let dq_dsigma =
            |side: T, q: T| self.declared.a1 * (self.declared.b1 * p.sin_sigma + side * p.l * p.cos_sigma) / q;
        let across = p.l * p.cos_theta - self.declared.a2 * p.sin_theta;
        let mut by_theta = dq_dl.map(|dq| dq * dl_dtheta);
        by_theta[2] -= self.declared.b2 * across / q3;
        let by_sigma = [dq_dsigma(-T::ONE, q1), dq_dsigma(T::ONE, q2), T::ZERO];
        Ok(from_columns([by_theta, by_sigma, dq_dl.map(|dq| dq * dl_dz0)]))
    }

    /// How far a pose is from the direct singularities.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn singularity_distance(&self, pose: &Pose<T>) -> Result<SingularityDistance<T>, KinematicsError> {
        Ok(self.posture(pose)?.singularity_distance(&self.declared))
    }

    // not inlined: one copy saves flash, and the call costs little beside what uses a posture
    #[inline(never)]
    pub(crate) fn posture(&self, pose: &Pose<T>) -> Result<Posture<T>, KinematicsError> {
        self.posture_inline(pose)
    }

    #[inline(always)]
    fn posture_inline(&self, pose: &Pose<T>) -> Result<Posture<T>, KinematicsError> {
        let posture = self.declared.posture(pose)?;
        self.check_travel(&ScrewLengths { q_m: posture.q })?;
        Ok(posture)
    }

    /// Where the mechanism stands when it is told to take a posture: the lengths are those of the declared sizes, the
    /// rest follows from the actual ones.
    #[inline(never)]
    pub(crate) fn actual(&self, commanded: &Posture<T>) -> Result<Actual<T>, KinematicsError> {
        if self.actual == self.declared {
            return Ok(Actual { posture: *commanded, turn: None });
        }
        let pose = self.actual.forward(&ScrewLengths { q_m: commanded.q })?;
        let posture = self.actual.posture(&pose)?;
        Ok(Actual { posture, turn: Some(posture.base() * commanded.base().transpose()) })
    }
}

/// u, v, w in B-xyz, as columns, from sine and cosine of θ and of σ.
pub fn platform_axes<T: Scalar>((sin_t, cos_t): (T, T), (sin_s, cos_s): (T, T)) -> Matrix3<T> {
    from_columns([
        [cos_t, T::ZERO, -sin_t],
        [sin_s * sin_t, cos_s, sin_s * cos_t],
        [cos_s * sin_t, -sin_s, cos_s * cos_t],
    ])
}

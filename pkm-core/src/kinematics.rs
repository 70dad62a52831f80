//! Inverse and forward kinematics of the parallel mechanism (paper, Eqs. 3-6; `docs/theory.md`).
//!
//! With L = |AB| = Z0/cos θ the mechanism is two plane problems: limbs 1 and 2 set (L, σ), limb 3 then sets θ.

use core::fmt;

use crate::linalg::Lower;
use crate::machine::{Machine, Sizes};
use crate::scalar::Scalar;
use crate::types::{Pose, ScrewLengths};
use crate::vector::{combined, cross, dot, join, split};

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

/// Everything about a pose that both kinematics and stiffness use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Posture<T> {
    pub sin_theta: T,
    pub cos_theta: T,
    pub sin_sigma: T,
    pub cos_sigma: T,
    /// |AB|, m.
    pub l: T,
    /// Components of B_i→A_i for limbs 1, 2 along y of B and along n = BA/|BA|, m.
    pub along_y: [T; 2],
    pub along_n: [T; 2],
    /// Components of B_3→A_3 along u and along n, m.
    pub limb_3: [T; 2],
    pub q: [T; 3],
}

impl<T: Scalar> Posture<T> {
    /// x of B in A-uvw.
    pub fn x(&self) -> [T; 3] {
        [self.cos_theta, self.sin_sigma * self.sin_theta, self.cos_sigma * self.sin_theta]
    }

    /// y of B in A-uvw.
    pub fn y(&self) -> [T; 3] {
        [T::ZERO, self.cos_sigma, -self.sin_sigma]
    }

    /// Direction from B to A in A-uvw.
    pub fn n(&self) -> [T; 3] {
        [T::ZERO, self.sin_sigma, self.cos_sigma]
    }

    fn singularity_distance(&self, sizes: &Sizes<T>) -> SingularityDistance<T> {
        let across = self.l * self.cos_theta - sizes.a2 * self.sin_theta;
        SingularityDistance::new(sizes, self.l * self.l, self.sin_sigma, self.cos_sigma, across)
    }

    /// Moves A_1 and A_2 along w, A_3 by the second amount, the pose held.
    pub fn offset(&mut self, [limbs_1_2, limb_3]: [T; 2]) {
        for (y, n) in self.along_y.iter_mut().zip(&mut self.along_n) {
            *y -= self.sin_sigma * limbs_1_2;
            *n += self.cos_sigma * limbs_1_2;
        }
        self.limb_3[1] += self.cos_sigma * limb_3;
        let aside = self.sin_sigma * limb_3;
        let [[y1, y2], [n1, n2], [u3, n3]] = [self.along_y, self.along_n, self.limb_3];
        let o = T::ZERO;
        self.q = [(y1, n1, o), (y2, n2, o), (u3, n3, aside)].map(|(x, y, z)| (x * x + y * y + z * z).sqrt());
    }
}

/// The actual posture at a commanded pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Actual<T> {
    pub posture: Posture<T>,
    /// R_actualᵀ R_commanded, from commanded A-uvw into the actual one; `None` when they are the same.
    turn: Option<[[T; 3]; 3]>,
}

impl<T: Scalar> Actual<T> {
    /// A six-vector in commanded A-uvw as seen in the actual one.
    pub fn seen(&self, v: [T; 6]) -> [T; 6] {
        let Some(turn) = self.turn else { return v };
        let (linear, angular) = split(v);
        join(turn.map(|row| dot(row, linear)), turn.map(|row| dot(row, angular)))
    }

    /// A six-vector in the actual A-uvw as seen in the commanded one.
    pub fn given_back(&self, v: [T; 6]) -> [T; 6] {
        let Some(turn) = &self.turn else { return v };
        let (linear, angular) = split(v);
        join(combined(turn, linear), combined(turn, angular))
    }

    /// A symmetric matrix in the actual A-uvw, lower triangle, as seen in the commanded one.
    #[inline(never)] // its copies would take stack during the whole assembly
    pub fn given_back_matrix(&self, lower: &mut Lower<T>) {
        if self.turn.is_none() {
            return;
        }
        // Kᵀ = K, so that turning the rows, twice with a transposition between, turns both sides
        let mut k = *lower;
        for i in 0..6 {
            for j in 0..i {
                k[j][i] = k[i][j];
            }
        }
        let half = k.map(|row| self.given_back(row));
        for i in 0..6 {
            for j in 0..6 {
                k[i][j] = half[j][i];
            }
        }
        *lower = k.map(|row| self.given_back(row));
    }
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
        let least = if self.limbs_1_2 < self.limb_3 { self.limbs_1_2 } else { self.limb_3 };
        let margin = T::from_f64(SINGULARITY_MARGIN);
        if least >= margin {
            Ok(())
        } else if least > -margin {
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
    /// use pkm_core::{KinematicsError, Pose, tables::reference};
    /// let machine = &reference::MACHINE_F64;
    /// let q = machine.inverse(&Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 })?;
    /// assert_eq!(q.q_m.map(|q| (q * 1e4).round() / 10.0), [567.8, 550.6, 519.4]);
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
    /// use pkm_core::{KinematicsError, ScrewLengths, tables::reference};
    /// let pose = reference::MACHINE_F64.forward(&ScrewLengths { q_m: [0.5678, 0.5506, 0.5194] })?;
    /// assert!((pose.theta_rad - 0.1).abs() < 1e-3 && (pose.z0_m - 0.53).abs() < 1e-4);
    /// # Ok::<(), KinematicsError>(())
    /// ```
    pub fn forward(&self, lengths: &ScrewLengths<T>) -> Result<Pose<T>, KinematicsError> {
        if !lengths.q_m.iter().all(|q| q.is_finite()) {
            return Err(KinematicsError::NotFinite);
        }
        self.check_travel(lengths)?;
        self.declared.forward(lengths)
    }

    /// ∂q/∂(θ, σ, Z0): row i for limb i+1, columns in m/rad, m/rad, m/m.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn jacobian(&self, pose: &Pose<T>) -> Result<[[T; 3]; 3], KinematicsError> {
        let p = self.posture(pose)?;
        let (dl_dz0, dl_dtheta) = (T::ONE / p.cos_theta, p.l * p.sin_theta / p.cos_theta);
        let mut rows = [[T::ZERO; 3]; 3];
        for (i, side) in [-T::ONE, T::ONE].into_iter().enumerate() {
            let dq_dl = p.along_n[i] / p.q[i];
            let dq_dsigma = self.declared.a1 * (self.declared.b1 * p.sin_sigma + side * p.l * p.cos_sigma) / p.q[i];
            rows[i] = [dq_dl * dl_dtheta, dq_dsigma, dq_dl * dl_dz0];
        }
        let dq_dl = p.limb_3[1] / p.q[2];
        let across = p.l * p.cos_theta - self.declared.a2 * p.sin_theta;
        rows[2] = [dq_dl * dl_dtheta - self.declared.b2 * across / p.q[2], T::ZERO, dq_dl * dl_dz0];
        Ok(rows)
    }

    /// How far a pose is from the direct singularities.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn singularity_distance(&self, pose: &Pose<T>) -> Result<SingularityDistance<T>, KinematicsError> {
        Ok(self.posture(pose)?.singularity_distance(&self.declared))
    }

    // once in an image: beside all that takes a posture further, the call is little
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
    pub(crate) fn actual(&self, commanded: Posture<T>) -> Result<Actual<T>, KinematicsError> {
        if self.actual == self.declared {
            return Ok(Actual { posture: commanded, turn: None });
        }
        let pose = self.actual.forward(&ScrewLengths { q_m: commanded.q })?;
        let posture = self.actual.posture(&pose)?;
        let axes = |p: &Posture<T>| [p.x(), p.y(), cross(p.x(), p.y())];
        let (there, here) = (axes(&posture), axes(&commanded));
        let mut turn = [[T::ZERO; 3]; 3];
        for (there, here) in there.iter().zip(&here) {
            for (row, t) in turn.iter_mut().zip(there) {
                for (entry, h) in row.iter_mut().zip(here) {
                    *entry += *t * *h;
                }
            }
        }
        Ok(Actual { posture, turn: Some(turn) })
    }

    fn check_travel(&self, lengths: &ScrewLengths<T>) -> Result<(), KinematicsError> {
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

impl<T: Scalar> Sizes<T> {
    /// See [`Machine::forward`]; whatever the travel.
    fn forward(&self, lengths: &ScrewLengths<T>) -> Result<Pose<T>, KinematicsError> {
        let [q1, q2, q3] = lengths.q_m;
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

    /// See [`Machine::inverse`]; whatever the travel.
    #[inline(always)] // `inverse` is short enough for a call to count
    fn posture(&self, pose: &Pose<T>) -> Result<Posture<T>, KinematicsError> {
        if !pose.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let right_angle = T::from_f64(core::f64::consts::FRAC_PI_2);
        if !(pose.theta_rad.abs() < right_angle && pose.sigma_rad.abs() < right_angle && pose.z0_m > T::ZERO) {
            return Err(KinematicsError::Unreachable);
        }
        let (sin_theta, cos_theta) = pose.theta_rad.sin_cos();
        let (sin_sigma, cos_sigma) = pose.sigma_rad.sin_cos();
        let l = pose.z0_m / cos_theta;
        let (a1_sin, a1_cos) = (self.a1 * sin_sigma, self.a1 * cos_sigma);
        let narrowing = self.b1 - a1_cos;
        let along_n = [l - a1_sin, l + a1_sin];
        let limb_3 = [self.a2 - self.b2 * cos_theta, l - self.b2 * sin_theta];
        let length = |x: T, y: T| (x * x + y * y).sqrt();
        let posture = Posture {
            sin_theta,
            cos_theta,
            sin_sigma,
            cos_sigma,
            l,
            along_y: [narrowing, -narrowing],
            along_n,
            limb_3,
            q: [length(narrowing, along_n[0]), length(narrowing, along_n[1]), length(limb_3[0], limb_3[1])],
        };
        posture.singularity_distance(self).check()?;
        Ok(posture)
    }
}

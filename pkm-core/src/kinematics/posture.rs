//! What follows from a pose alone.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::{KinematicsError, SingularityDistance};
use crate::linalg::{Lower, frame, join, split};
use crate::machine::Sizes;
use crate::scalar::Scalar;
use crate::types::Pose;

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
    pub q: Vector3<T>,
}

impl<T: Scalar> Posture<T> {
    /// Length of limb 1 (`LIMB` = 0) or 2.
    pub fn length<const LIMB: usize>(&self) -> T {
        if LIMB == 0 { self.q.x } else { self.q.y }
    }

    /// x of B in A-uvw.
    pub fn x(&self) -> Vector3<T> {
        Vector3::new(self.cos_theta, self.sin_sigma * self.sin_theta, self.cos_sigma * self.sin_theta)
    }

    /// y of B in A-uvw.
    pub fn y(&self) -> Vector3<T> {
        Vector3::new(T::ZERO, self.cos_sigma, -self.sin_sigma)
    }

    /// Direction from B to A in A-uvw.
    pub fn n(&self) -> Vector3<T> {
        Vector3::new(T::ZERO, self.sin_sigma, self.cos_sigma)
    }

    /// x, y and z of B in A-uvw, as columns.
    pub fn base(&self) -> Matrix3<T> {
        let (x, y) = (self.x(), self.y());
        frame(x, y, x.cross(&y))
    }

    pub(super) fn singularity_distance(&self, sizes: &Sizes<T>) -> SingularityDistance<T> {
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
        self.q = [(y1, n1, o), (y2, n2, o), (u3, n3, aside)].map(|(x, y, z)| (x * x + y * y + z * z).sqrt()).into();
    }
}

/// The actual posture at a commanded pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Actual<T> {
    pub posture: Posture<T>,
    /// R_actualᵀ R_commanded, from commanded A-uvw into the actual one; `None` when they are the same.
    pub(super) turn: Option<Matrix3<T>>,
}

impl<T: Scalar> Actual<T> {
    /// A six-vector in commanded A-uvw as seen in the actual one.
    pub fn seen(&self, v: Vector6<T>) -> Vector6<T> {
        let Some(turn) = &self.turn else { return v };
        let (linear, angular) = split(v);
        join(turn * linear, turn * angular)
    }

    /// A six-vector in the actual A-uvw as seen in the commanded one.
    pub fn given_back(&self, v: Vector6<T>) -> Vector6<T> {
        let Some(turn) = &self.turn else { return v };
        let (linear, angular) = split(v);
        join(turn.tr_mul(&linear), turn.tr_mul(&angular))
    }

    /// A symmetric matrix in the actual A-uvw, lower triangle, as seen in the commanded one.
    #[inline(never)] // its copies would take stack during the whole assembly
    pub fn given_back_matrix(&self, lower: &mut Lower<T>) {
        if self.turn.is_none() {
            return;
        }
        // Kᵀ = K, so that turning the rows, twice with a transposition between, turns both sides
        let mut k = lower.data.0;
        for i in 0..6 {
            for j in 0..i {
                k[i][j] = k[j][i];
            }
        }
        let half = k.map(|row| <[T; 6]>::from(self.given_back(row.into())));
        for i in 0..6 {
            for j in 0..6 {
                k[i][j] = half[j][i];
            }
        }
        let turned = k.map(|row| <[T; 6]>::from(self.given_back(row.into())));
        for i in 0..6 {
            for j in 0..=i {
                lower.data.0[j][i] = turned[i][j];
            }
        }
    }
}

impl<T: Scalar> Sizes<T> {
    /// See [`Machine::inverse`](crate::Machine::inverse); whatever the travel.
    #[inline(always)] // `inverse` is short enough for a call to count
    pub(super) fn posture(&self, pose: &Pose<T>) -> Result<Posture<T>, KinematicsError> {
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
            q: Vector3::new(length(narrowing, along_n[0]), length(narrowing, along_n[1]), length(limb_3[0], limb_3[1])),
        };
        posture.singularity_distance(self).check()?;
        Ok(posture)
    }

    /// By what A moves, to first order, when the limbs grow: q_i times the elongation of each, m². The screws are free to turn, so
    /// that nothing else resists.
    pub fn moved(&self, p: &Posture<T>, [first, second, third]: [T; 3]) -> Vector6<T> {
        let [dtheta, dsigma, dl] = self.rates(p, [first, second, third]);
        let (n, y) = (p.n(), p.y());
        Vector6::new(p.l * dtheta, dl * n.y, dl * n.z, dsigma, dtheta * y.y, dtheta * y.z)
    }

    /// The same as derivatives of θ, σ and L.
    #[inline(always)] // `moved` is called for every amplitude that is learned
    pub fn rates(&self, p: &Posture<T>, [first, second, third]: [T; 3]) -> [T; 3] {
        let Self { a1, a2, b1, b2 } = *self;
        let (sin, cos, l) = (p.sin_sigma, p.cos_sigma, p.l);
        let half = T::from_f64(0.5) / (l * l * cos - a1 * b1 * sin * sin);
        let (sum, difference) = (first + second, second - first);
        let dl = half * (sum * l * cos - difference * b1 * sin);
        let dsigma = half * (difference * l / a1 - sum * sin);
        let dtheta = (dl * (l - b2 * p.sin_theta) - third) / (b2 * (l * p.cos_theta - a2 * p.sin_theta));
        [dtheta, dsigma, dl]
    }
}

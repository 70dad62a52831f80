//! The quantities that cross the border of this crate.
//!
//! Frames (`docs/theory.md`). *B-xyz* sits on the fixed platform: x from B to B3, y from B to B2.
//! *A-uvw* sits on the moving platform: u from A to A3, v from A to A2. Six-vectors are ordered
//! `[x, y, z, about x, about y, about z]`, forces before moments, translations before rotations.
//! Everything is SI: m, rad, N, N·m, N/m, N·m/rad.
//!
//! Vectors and matrices are nalgebra's of fixed size. What is a list of numbers rather than a vector (a machine's parameters, a
//! table's coefficients) is an array.

use nalgebra::{Vector3, Vector6};

use crate::linalg::{join, split};
use crate::scalar::Scalar;

/// Where the moving platform stands: the paper's end variables θ, σ, Z0 (Eq. 3).
///
/// φ = 0, Y0 = 0 and X0 = Z0·tan θ follow. The orientation is R_y(θ)·R_x(σ).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pose<T> {
    /// θ, about y of B, rad, within ±π/2.
    pub theta_rad: T,
    /// σ, about u, rad, within ±π/2.
    pub sigma_rad: T,
    /// Z0, height of A over B along z of B, m, above 0.
    pub z0_m: T,
}

impl<T: Scalar> Pose<T> {
    /// Where A is in B-xyz, m: over B's x axis, at x = Z0 tan θ. Not checked: NaN where the pose is not finite.
    pub fn a_in_b_m(&self) -> Vector3<T> {
        let (sin, cos) = self.theta_rad.sin_cos();
        Vector3::new(self.z0_m * sin / cos, T::ZERO, self.z0_m)
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.theta_rad.is_finite() && self.sigma_rad.is_finite() && self.z0_m.is_finite()
    }
}

/// Lengths |A_i B_i| of limbs 1, 2, 3 in m: what the three screws set.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScrewLengths<T> {
    /// q1, q2, q3.
    pub q_m: Vector3<T>,
}

/// A load on the moving platform at A, in A-uvw.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Wrench<T> {
    /// Force along u, v, w in N.
    pub force_n: Vector3<T>,
    /// Moment about A, around u, v, w, in N·m.
    pub moment_nm: Vector3<T>,
}

/// Displacement of the moving platform at A under a [`Wrench`], in A-uvw.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Deflection<T> {
    /// Translation of A along u, v, w in m.
    pub translation_m: Vector3<T>,
    /// Rotation about u, v, w in rad.
    pub rotation_rad: Vector3<T>,
}

/// What `zeros` of nalgebra is at run time.
const fn zero<T: Scalar>() -> Vector3<T> {
    Vector3::new(T::ZERO, T::ZERO, T::ZERO)
}

impl<T: Scalar> Wrench<T> {
    /// No load.
    pub const ZERO: Self = Self { force_n: zero(), moment_nm: zero() };

    /// From force and moment in one vector.
    pub fn from_vector(components: Vector6<T>) -> Self {
        let (force_n, moment_nm) = split(components);
        Self { force_n, moment_nm }
    }

    /// Force and moment in one vector.
    pub fn to_vector(self) -> Vector6<T> {
        join(self.force_n, self.moment_nm)
    }

    /// The same load, given at the point `at_m` (A-uvw, m), as a load at A.
    pub fn moved_to_a(&self, at_m: Vector3<T>) -> Self {
        Self { force_n: self.force_n, moment_nm: self.moment_nm + at_m.cross(&self.force_n) }
    }

    /// Work on a displacement of the same point, J.
    pub(crate) fn work(&self, moved: &Deflection<T>) -> T {
        self.force_n.dot(&moved.translation_m) + self.moment_nm.dot(&moved.rotation_rad)
    }
}

impl<T: Scalar> Deflection<T> {
    /// None.
    pub const ZERO: Self = Self { translation_m: zero(), rotation_rad: zero() };

    /// From translation and rotation in one vector.
    pub fn from_vector(components: Vector6<T>) -> Self {
        let (translation_m, rotation_rad) = split(components);
        Self { translation_m, rotation_rad }
    }

    /// Translation and rotation in one vector.
    pub fn to_vector(self) -> Vector6<T> {
        join(self.translation_m, self.rotation_rad)
    }

    /// The displacement of the point `at_m` (A-uvw, m) of the moving platform.
    pub fn seen_at(&self, at_m: Vector3<T>) -> Self {
        Self { translation_m: self.translation_m + self.rotation_rad.cross(&at_m), rotation_rad: self.rotation_rad }
    }

    pub(crate) fn times(&self, factor: T) -> Self {
        Self { translation_m: self.translation_m * factor, rotation_rad: self.rotation_rad * factor }
    }

    /// Both together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            translation_m: self.translation_m + other.translation_m,
            rotation_rad: self.rotation_rad + other.rotation_rad,
        }
    }
}

/// Coverage factor of expanded uncertainties at 95 %, of a normal distribution.
pub const K95: f64 = 1.96;

/// How well a translation of the tip is known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TipUncertainty<T> {
    /// Variances along u, v, w, m².
    pub variance_m2: Vector3<T>,
}

impl<T: Scalar> TipUncertainty<T> {
    /// Expanded uncertainty along u, v, w, coverage 95 % (k = 1.96), m.
    pub fn u95_m(&self) -> Vector3<T> {
        self.variance_m2.map(|variance| T::from_f64(K95) * variance.sqrt())
    }

    /// What to compensate of a translation of the tip: all of it where it is greater than its expanded uncertainty, else the share
    /// that it is of that.
    pub fn known_share(&self, translation_m: &Vector3<T>) -> T {
        let (moved, uncertain) = (translation_m.dot(translation_m), T::from_f64(K95 * K95) * self.variance_m2.sum());
        if moved >= uncertain { T::ONE } else { (moved / uncertain).sqrt() }
    }
}

/// Where a pose stands to the box that a correction table was fitted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum Domain {
    /// In the box or on its edge: the table's stated errors hold.
    Inside,
    /// Outside: the value is an extrapolation for which nobody has vouched. It is computed all the same; see
    /// [`CorrectionTable::cycle`](crate::CorrectionTable::cycle) for what a controller may do then.
    Outside,
}

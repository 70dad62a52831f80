//! Terminal stiffness of the parallel mechanism from its limbs (paper, Eqs. 7-9; `docs/theory.md`).
//!
//! A limb passes on to the moving platform only the wrenches that its free axes cannot release: three for
//! limbs 1 and 2, two for limb 3. Written as columns H_i, with D_i = H_iᵀ C_i H_i the compliance of everything
//! elastic in the limb's chain as these wrenches see it,
//!
//! > K_p = Σ H_i D_i⁻¹ H_iᵀ.
//!
//! A `Chain` (in `elastic`) holds H_i and D_i. Whatever else is elastic between B_i and A ([`effects`](crate::effects)) adds its
//! Hᵀ C H to D_i; what is elastic under B or behind A is in series with the sum.

use core::fmt;

use nalgebra::{Matrix6, Vector6};

use crate::kinematics::KinematicsError;
use crate::linalg::{self, Lower, NotPositiveDefinite, is_finite};
use crate::scalar::Scalar;
use crate::types::{Deflection, Wrench};

mod assembly;
mod history;
mod limbs;
mod load;
mod transmission;

pub use history::{LoadHistory, MAX_TURNS};
pub use load::{LoadResponse, MAX_ITERATIONS};
pub use transmission::Transmission;

/// Why there is no stiffness for a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StiffnessError {
    /// The pose has no posture.
    Kinematics(KinematicsError),
    /// The 6×6 is not positive definite in this number type.
    NotPositiveDefinite,
    /// A wrench, a temperature or a deflection is NaN or infinite.
    NotFinite,
    /// The limb forces under load-dependent effects were not found.
    NotConverged,
}

impl fmt::Display for StiffnessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kinematics(e) => e.fmt(f),
            Self::NotPositiveDefinite => f.write_str("the stiffness matrix is not positive definite"),
            Self::NotFinite => f.write_str("the wrench, the temperature or the deflection is not finite"),
            Self::NotConverged => f.write_str("the limb forces under load-dependent effects were not found"),
        }
    }
}

impl core::error::Error for StiffnessError {}

impl From<NotPositiveDefinite> for StiffnessError {
    fn from(NotPositiveDefinite: NotPositiveDefinite) -> Self {
        Self::NotPositiveDefinite
    }
}

impl From<KinematicsError> for StiffnessError {
    fn from(e: KinematicsError) -> Self {
        Self::Kinematics(e)
    }
}

/// A symmetric 6×6 stiffness at A in A-uvw: N/m, N/rad, N·m/m and N·m/rad by block.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Stiffness<T> {
    lower: Lower<T>,
}

impl<T: Scalar> Stiffness<T> {
    /// From a matrix of which the lower triangle is read.
    pub fn from_lower(matrix: &Matrix6<T>) -> Self {
        Self { lower: *matrix }
    }

    /// The whole matrix, symmetric to the last bit.
    pub fn matrix(&self) -> Matrix6<T> {
        let mut full = self.lower;
        let columns = &mut full.data.0;
        for i in 0..6 {
            for j in 0..i {
                columns[i][j] = columns[j][i];
            }
        }
        full
    }

    /// The principal stiffnesses k11…k66: resistance to one displacement with the other five held at 0.
    pub fn principal(&self) -> Vector6<T> {
        self.lower.diagonal()
    }

    /// Cholesky factor, translations first.
    ///
    /// # Errors
    /// [`StiffnessError::NotPositiveDefinite`], also for NaN or infinity in the matrix.
    pub fn factor(&self) -> Result<StiffnessFactor<T>, StiffnessError> {
        let mut lower = self.lower;
        factor(&mut lower)?;
        Ok(StiffnessFactor { lower })
    }
}

/// Softening in series subtracts, and rounding may leave nothing; squares of levers may be too small for a number.
pub(crate) fn check_diagonal<T: Scalar>(k: &Lower<T>) -> Result<(), StiffnessError> {
    let positive = (0..6).all(|i| k.data.0[i][i] > T::ZERO);
    if positive { Ok(()) } else { Err(StiffnessError::NotPositiveDefinite) }
}

/// K, lower triangle, turned into its Cholesky factor.
pub(crate) fn factor<T: Scalar>(lower: &mut Lower<T>) -> Result<(), StiffnessError> {
    if linalg::cholesky(lower) { Ok(()) } else { Err(StiffnessError::NotPositiveDefinite) }
}

/// A stiffness as its lower triangular Cholesky factor F, K = F Fᵀ: ready for deflections.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StiffnessFactor<T> {
    pub(crate) lower: Lower<T>,
}

impl<T: Scalar> StiffnessFactor<T> {
    /// K = F Fᵀ.
    pub fn stiffness(&self) -> Stiffness<T> {
        Stiffness { lower: linalg::square(&self.lower) }
    }

    /// Displacement of A under a wrench at A, by two triangular solves.
    ///
    /// # Errors
    /// [`StiffnessError::NotFinite`] when the wrench or the result is not finite.
    pub fn deflection(&self, wrench: &Wrench<T>) -> Result<Deflection<T>, StiffnessError> {
        finite(Deflection::from_vector(linalg::solve(&self.lower, &wrench.to_vector())))
    }

    /// F; above the diagonal it is 0.
    pub fn lower(&self) -> Matrix6<T> {
        self.lower
    }
}

/// Rejects results that are not finite.
pub(crate) fn finite<T: Scalar>(d: Deflection<T>) -> Result<Deflection<T>, StiffnessError> {
    if is_finite(&d.translation_m) && is_finite(&d.rotation_rad) { Ok(d) } else { Err(StiffnessError::NotFinite) }
}

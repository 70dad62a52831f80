//! Terminal stiffness of the parallel mechanism from its limbs (paper, Eqs. 7-9; spec: model.md 2).
//!
//! A limb passes on to the moving platform only the wrenches that its free axes cannot release: three for
//! limbs 1 and 2, two for limb 3. Written as columns H_i, with D_i = H_iᵀ C_i H_i the compliance of everything
//! elastic in the limb's chain as these wrenches see it,
//!
//! > K_p = Σ H_i D_i⁻¹ H_iᵀ.
//!
//! A `Chain` holds H_i and D_i. Whatever else is elastic between B_i and A adds its Hᵀ C H to D_i before
//! `Chain::add_stiffness_to`; nothing else changes.

use core::fmt;

use crate::kinematics::{KinematicsError, Posture};
use crate::linalg::{self, Lower};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::{Deflection, Pose, Wrench};

/// Why there is no stiffness for a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StiffnessError {
    /// The pose has no posture.
    Kinematics(KinematicsError),
    /// The 6×6 is not positive definite in this number type.
    NotPositiveDefinite,
}

impl fmt::Display for StiffnessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kinematics(e) => e.fmt(f),
            Self::NotPositiveDefinite => f.write_str("the stiffness matrix is not positive definite"),
        }
    }
}

impl core::error::Error for StiffnessError {}

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
    pub fn from_lower(matrix: &[[T; 6]; 6]) -> Self {
        Self { lower: *matrix }
    }

    /// All 36 entries, row by row.
    pub fn matrix(&self) -> [[T; 6]; 6] {
        let mut full = self.lower;
        for i in 0..6 {
            for j in 0..i {
                full[j][i] = full[i][j];
            }
        }
        full
    }

    /// The principal stiffnesses k11…k66: resistance to one displacement with the other five held at 0.
    pub fn principal(&self) -> [T; 6] {
        let k = &self.lower;
        [k[0][0], k[1][1], k[2][2], k[3][3], k[4][4], k[5][5]]
    }

    /// Cholesky factor, translations first.
    ///
    /// # Errors
    /// [`StiffnessError::NotPositiveDefinite`], also for NaN or infinity in the matrix.
    pub fn factor(&self) -> Result<StiffnessFactor<T>, StiffnessError> {
        match linalg::cholesky(&self.lower) {
            Some(lower) => Ok(StiffnessFactor { lower }),
            None => Err(StiffnessError::NotPositiveDefinite),
        }
    }
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
    /// [`KinematicsError::NotFinite`] when the wrench or the result is not finite.
    pub fn deflection(&self, wrench: &Wrench<T>) -> Result<Deflection<T>, StiffnessError> {
        let x = linalg::solve(&self.lower, &wrench.to_array());
        if x.iter().all(|v| v.is_finite()) {
            Ok(Deflection::from_array(x))
        } else {
            Err(KinematicsError::NotFinite.into())
        }
    }

    /// The factor's entries; above the diagonal they are 0.
    pub fn lower(&self) -> [[T; 6]; 6] {
        self.lower
    }
}

/// One limb: the `N` wrenches it transmits, at A in A-uvw, and the compliance they meet.
struct Chain<T, const N: usize> {
    wrenches: [[T; 6]; N],
    /// Hᵀ C H, lower triangle.
    compliance: [[T; N]; N],
}

impl<T: Scalar, const N: usize> Chain<T, N> {
    /// K += H D⁻¹ Hᵀ, by D = L Δ Lᵀ: with Y = L⁻¹ Hᵀ the limb is N springs in parallel.
    fn add_stiffness_to(mut self, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        let (d, y) = (&mut self.compliance, &mut self.wrenches);
        for j in 0..N {
            if !(d[j][j] > T::ZERO) {
                return Err(StiffnessError::NotPositiveDefinite);
            }
            let spring = T::ONE / d[j][j];
            for i in j + 1..N {
                let ratio = d[i][j] * spring;
                for m in j + 1..=i {
                    d[i][m] -= ratio * d[m][j];
                }
                for c in 0..6 {
                    y[i][c] -= ratio * y[j][c];
                }
            }
            for r in 0..6 {
                let scaled = y[j][r] * spring;
                for c in 0..=r {
                    k[r][c] += scaled * y[j][c];
                }
            }
        }
        Ok(())
    }
}

impl<T: Scalar> Machine<T> {
    /// Basic terminal stiffness K_p at A in A-uvw (Eqs. 7-9).
    ///
    /// Accuracy: equals the dense 24×24 structural matrix of Eq. 8 to 1e-13 of √(k_ii k_jj) in f64. In f32 it is
    /// within 2e-5 of f64 in the same measure, without any scaling inside: K_p is a sum of positive springs, in
    /// which nothing cancels.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse), and [`StiffnessError::NotPositiveDefinite`] when rounding leaves a
    /// limb without compliance.
    pub fn stiffness(&self, pose: &Pose<T>) -> Result<Stiffness<T>, StiffnessError> {
        let p = self.posture(pose)?;
        let mut lower = linalg::zero();
        self.chain_1_2::<0>(&p).add_stiffness_to(&mut lower)?;
        self.chain_1_2::<1>(&p).add_stiffness_to(&mut lower)?;
        self.chain_3(&p).add_stiffness_to(&mut lower)?;
        Ok(Stiffness { lower })
    }

    /// Limb 1 (`LIMB` = 0) or 2. All of it lies in the plane of y of B and n = BA/|BA|, square to u. The wrenches are the
    /// axial force, the force along u through B_i, and the couple about n.
    fn chain_1_2<const LIMB: usize>(&self, p: &Posture<T>) -> Chain<T, 3> {
        let side = if LIMB == 0 { -T::ONE } else { T::ONE };
        let c = &self.limbs[LIMB];
        let (q, sin, cos) = (p.q[LIMB], p.sin_sigma, p.cos_sigma);
        // limb axis in (y, n), and in A-uvw, where y = (0, cos σ, −sin σ) and n = (0, sin σ, cos σ)
        let (zy, zn) = (p.along_y[LIMB] / q, p.along_n[LIMB] / q);
        let (zv, zw) = (zy * cos + zn * sin, zn * cos - zy * sin);
        let o = T::ZERO;
        let b = side * self.b1;
        let wrenches = [
            [o, zv, zw, side * self.a1 * zw, o, o],
            [T::ONE, o, o, o, -p.l * cos - b * sin, p.l * sin - b * cos],
            [o, o, o, o, sin, cos],
        ];

        // The force through B_i meets the cantilever like a load on its tip that leaves no moment at B_i; the
        // uncoupled one (diagonal) takes the tip's moment −q as a second load.
        let (force_share, mixed_share) = if c.coupled { (1.0 / 3.0, 0.5) } else { (4.0 / 3.0, 1.0) };
        let bend = q * c.bending;
        let tilt = c.platform_angular[1];
        let (zy2, zn2) = (zy * zy, zn * zn);
        let axial = zy2 * c.base_linear[1] + zn2 * c.base_linear[2] + q * c.axial + c.platform_linear[2];
        let force = c.base_linear[0] + c.platform_linear[0] + q * q * (T::from_f64(force_share) * bend + tilt);
        let mixed = zy * q * (T::from_f64(mixed_share) * bend + tilt);
        let couple = c.base_angular[2] + zy2 * (bend + tilt) + zn2 * (q * c.torsion + c.platform_angular[2]);
        Chain { wrenches, compliance: [[axial, o, o], [o, force, o], [o, mixed, couple]] }
    }

    /// Limb 3: the axial force and the force along y of B, both through A3.
    fn chain_3(&self, p: &Posture<T>) -> Chain<T, 2> {
        let c = &self.limbs[2];
        let q = p.q[2];
        let (zu, zn) = (p.limb_3[0] / q, p.limb_3[1] / q);
        let through_a3 = |u: T, v: T, w: T| [u, v, w, T::ZERO, -self.a2 * w, self.a2 * v];
        let wrenches =
            [through_a3(zu, zn * p.sin_sigma, zn * p.cos_sigma), through_a3(T::ZERO, p.cos_sigma, -p.sin_sigma)];
        let axial = c.base_linear[2] + q * c.axial + c.platform_linear[2];
        let sideways = c.base_linear[0]
            + c.platform_linear[0]
            + q * q * (c.base_angular[1] + q * c.bending * T::from_f64(1.0 / 3.0));
        Chain { wrenches, compliance: [[axial, T::ZERO], [T::ZERO, sideways]] }
    }
}

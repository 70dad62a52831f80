//! How far the corrected stiffness may be off, and what that means at the tip (`docs/estimation.md`).
//!
//! With K_m = F Fᵀ the true compliance is F⁻ᵀ (I + S) F⁻¹, S symmetric, small and not known. The translation of the tip along
//! an axis i is then off by y_iᵀ S x, with x = F⁻¹ w of the load and y_i = F⁻¹ w_i of a unit force on the tip along i (virtual
//! work). S is v(t)^½ (Σ_r z_r U_r + z₀ s), z independent with variance 1: a few columns U_r that have most of its variance, and a
//! rest that is the same in every direction. v(t) says how the variance grows towards the edge of the table's box and beyond.

use core::hint::black_box;

use nalgebra::{Vector3, Vector6};

use super::{CorrectionTable, TableError};
use crate::checksum::{Damaged, START, over_numbers, over_numbers_f32};
use crate::linalg;
use crate::scalar::Scalar;
use crate::stiffness::{StiffnessError, StiffnessFactor};
use crate::types::{K95, Pose, TipUncertainty, Wrench};

/// Columns of the covariance factor.
pub const UNCERTAINTY_COLUMNS: usize = 4;
/// Numbers of the growth of the variance.
pub const UNCERTAINTY_SPREAD: usize = 4;
/// Entries of a symmetric 6×6, its lower triangle row by row.
pub const UNCERTAINTY_ENTRIES: usize = 21;

/// Covariance of what a corrected compliance is off by, relative to itself: 89 numbers, 712 bytes in `f64` and 356 in `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableUncertainty<T> {
    spread: [T; UNCERTAINTY_SPREAD],
    rest: T,
    columns: [[T; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS],
}

macro_rules! uncertainty {
    ($t:ty, $over:path) => {
        impl TableUncertainty<$t> {
            /// Checks the numbers. Works in a `const`.
            ///
            /// # Arguments
            /// * `spread`: coefficients of [`spread_terms`](super::spread_terms) in v(t).
            /// * `rest`: standard deviation of the diagonal of S beyond the columns; 1/√2 of it off the diagonal.
            /// * `columns`: lower triangles, row by row.
            ///
            /// # Errors
            /// A number that is not finite; a `spread` or `rest` below 0.
            pub const fn new(
                spread: [$t; UNCERTAINTY_SPREAD],
                rest: $t,
                columns: [[$t; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS],
            ) -> Result<Self, TableError> {
                let mut i = 0;
                while i < UNCERTAINTY_SPREAD {
                    if !(spread[i] >= 0.0 && spread[i].is_finite()) {
                        return Err(TableError::Uncertainty);
                    }
                    i += 1;
                }
                if !(rest >= 0.0 && rest.is_finite()) {
                    return Err(TableError::Uncertainty);
                }
                let mut i = 0;
                while i < UNCERTAINTY_COLUMNS * UNCERTAINTY_ENTRIES {
                    if !columns[i / UNCERTAINTY_ENTRIES][i % UNCERTAINTY_ENTRIES].is_finite() {
                        return Err(TableError::Uncertainty);
                    }
                    i += 1;
                }
                Ok(Self { spread, rest, columns })
            }

            /// Checksum (FNV-1a, 64 bit) over the bits of all numbers in the order of [`new`](Self::new).
            pub const fn checksum(&self) -> u64 {
                let mut hash = $over($over(START, &self.spread), &[self.rest]);
                let mut i = 0;
                while i < UNCERTAINTY_COLUMNS {
                    hash = $over(hash, &self.columns[i]);
                    i += 1;
                }
                hash
            }

            /// Computes the checksum again from what is in memory now, and compares it: a bit that flips changes which share of a
            /// deflection is compensated.
            ///
            /// # Arguments
            /// * `built`: the [`checksum`](Self::checksum) that a `const` has of it.
            ///
            /// # Errors
            /// [`Damaged::Uncertainty`]
            pub fn verify(&self, built: u64) -> Result<(), Damaged> {
                // or the compiler would compare two constants
                if black_box(self).checksum() == built { Ok(()) } else { Err(Damaged::Uncertainty) }
            }
        }
    };
}

uncertainty!(f32, over_numbers_f32);
uncertainty!(f64, over_numbers);

impl<T: Scalar> CorrectionTable<'_, T> {
    /// Variances of the tip's translation under a load from what the table may be off by, to first order in that. What
    /// load-dependent effects and warmth add to the deflection has no part in it. What sits behind A counts as if it were as
    /// uncertain as the table.
    ///
    /// # Arguments
    /// * `factor`: of the corrected stiffness at `pose`.
    /// * `wrench_at_tip`: the load on the tip, its moment about the tip, in the axes of A-uvw.
    /// * `tip_m`: where the tip is in A-uvw.
    ///
    /// In `f32` it is within 1e-3 of `f64` for the reference machine in its box.
    ///
    /// # Errors
    /// [`StiffnessError::NotFinite`] when the result is not finite.
    ///
    /// ```
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::{CorrectionError, Pose, Wrench, tables::reference::{MACHINE_F64, TABLE_F64, UNCERTAINTY_F64}};
    /// let (pose, tip_m) = (Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 }, Vector3::new(0.0, 0.0, 0.3));
    /// let push = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
    /// let factor = TABLE_F64.factor_form(&MACHINE_F64, &pose)?.factor;
    /// let moved = factor.deflection(&push.moved_to_a(tip_m))?.seen_at(tip_m).translation_m;
    /// let uncertainty = TABLE_F64.tip_uncertainty(&UNCERTAINTY_F64, &factor, &pose, &push, tip_m)?;
    /// assert!(uncertainty.u95_m().norm() < 0.1 * moved.norm());
    /// # Ok::<(), CorrectionError>(())
    /// ```
    pub fn tip_uncertainty(
        &self,
        uncertainty: &TableUncertainty<T>,
        factor: &StiffnessFactor<T>,
        pose: &Pose<T>,
        wrench_at_tip: &Wrench<T>,
        tip_m: Vector3<T>,
    ) -> Result<TipUncertainty<T>, StiffnessError> {
        uncertainty.of_tip(factor, self.scaled(pose), wrench_at_tip, tip_m)
    }

    /// Expanded uncertainties (k = 1.96) of the principal stiffnesses k11…k66 of `factor`, in their units, to first order in what the
    /// table may be off by: k_ii is off by f_iᵀ S f_i, f_i row i of F.
    pub fn stiffness_u95(
        &self,
        uncertainty: &TableUncertainty<T>,
        factor: &StiffnessFactor<T>,
        pose: &Pose<T>,
    ) -> Vector6<T> {
        let spread = uncertainty.spread_at(self.scaled(pose));
        let mut u95 = Vector6::zeros();
        for (u95, row) in u95.iter_mut().zip(factor.lower.row_iter()) {
            let f = row.transpose();
            let variance = spread * uncertainty.variance(&f, &f, &(f.dot(&f), uncertainty.moved(&f)));
            *u95 = T::from_f64(K95) * variance.sqrt();
        }
        u95
    }
}

impl<T: Scalar> TableUncertainty<T> {
    /// [`CorrectionTable::tip_uncertainty`] at a pose in a table's scaled variables θ, σ, Z0.
    ///
    /// # Errors
    /// [`StiffnessError::NotFinite`] when the result is not finite.
    pub fn of_tip(
        &self,
        factor: &StiffnessFactor<T>,
        scaled: [T; 3],
        wrench_at_tip: &Wrench<T>,
        tip_m: Vector3<T>,
    ) -> Result<TipUncertainty<T>, StiffnessError> {
        let load = wrench_at_tip.moved_to_a(tip_m).to_vector();
        self.of_loaded(factor, scaled, &linalg::solve_lower::<T, 0>(&factor.lower, &load), tip_m)
    }

    /// The same with x, F⁻¹ times the load at A.
    #[inline(never)] // takes no stack while the stiffness is worked out
    pub(crate) fn of_loaded(
        &self,
        factor: &StiffnessFactor<T>,
        scaled: [T; 3],
        x: &Vector6<T>,
        tip_m: Vector3<T>,
    ) -> Result<TipUncertainty<T>, StiffnessError> {
        let lower = &factor.lower;
        let moved = (x.dot(x), self.moved(x));
        let ([u, v, w], one, o) = (tip_m.into(), T::ONE, T::ZERO);
        // unit forces on the tip, their moments about A
        let along_u = linalg::solve_lower::<T, 0>(lower, &Vector6::new(one, o, o, o, w, -v));
        let along_v = linalg::solve_lower::<T, 1>(lower, &Vector6::new(o, one, o, -w, o, u));
        let along_w = linalg::solve_lower::<T, 2>(lower, &Vector6::new(o, o, one, v, -u, o));
        let spread = self.spread_at(scaled);
        let variances = [along_u, along_v, along_w].map(|y| spread * self.variance(&y, x, &moved));
        let variance_m2 = Vector3::from(variances);
        if linalg::is_finite(&variance_m2) {
            Ok(TipUncertainty { variance_m2 })
        } else {
            Err(StiffnessError::NotFinite)
        }
    }

    /// Columns times x.
    fn moved(&self, x: &Vector6<T>) -> [Vector6<T>; UNCERTAINTY_COLUMNS] {
        self.columns.each_ref().map(|column| product(column, x))
    }

    /// Variance of yᵀ S x for v = 1, from x² and columns times x.
    fn variance(
        &self,
        y: &Vector6<T>,
        x: &Vector6<T>,
        (x_squared, moved): &(T, [Vector6<T>; UNCERTAINTY_COLUMNS]),
    ) -> T {
        let along = y.dot(x);
        let half_rest = self.rest * self.rest * T::from_f64(0.5);
        let mut variance = half_rest * (y.dot(y) * *x_squared + along * along);
        for moved in moved {
            let off = y.dot(moved);
            variance += off * off;
        }
        variance
    }

    /// v(t).
    fn spread_at(&self, scaled: [T; 3]) -> T {
        spread_terms(scaled).iter().zip(&self.spread).fold(T::ZERO, |sum, (term, factor)| sum + *term * *factor)
    }
}

/// What the variance grows by: 1, θ⁸, σ⁸ and Z0⁸ of a table's scaled variables. A table of the second order lacks third powers,
/// and its fit levels what they would add inside the box, so that the error grows more steeply at its edge.
pub fn spread_terms<T: Scalar>(scaled: [T; 3]) -> [T; UNCERTAINTY_SPREAD] {
    let [theta, sigma, z0] = scaled.map(|t| {
        let square = t * t;
        square * square
    });
    [T::ONE, theta * theta, sigma * sigma, z0 * z0]
}

/// A symmetric matrix, its lower triangle row by row, times a vector.
fn product<T: Scalar>(lower: &[T; UNCERTAINTY_ENTRIES], x: &Vector6<T>) -> Vector6<T> {
    let x: [T; 6] = (*x).into();
    let mut sums = [T::ZERO; 6];
    for i in 0..6 {
        let row = i * (i + 1) / 2;
        for j in 0..i {
            sums[i] += lower[row + j] * x[j];
            sums[j] += lower[row + j] * x[i];
        }
        sums[i] += lower[row + i] * x[i];
    }
    sums.into()
}

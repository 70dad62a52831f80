//! Corrected stiffness from a fitted table (paper, Eqs. 10-12; `docs/theory.md`).
//!
//! The coefficients are polynomials of the pose in scaled variables t = (x − centre) / half width, each in
//! −1…1 over the box that the table was fitted on. Two forms:
//!
//! * *diagonal*, the paper's: k_ii of K_m is c_ii·k_ii of K_p. The paper gives no couplings; here the whole
//!   matrix is √C K_p √C, which has these diagonals. It is wrong for loads, see `docs/theory.md`.
//! * *factor*: with K_p = L Lᵀ, K_m = (L G)(L G)ᵀ, G lower triangular with 21 polynomial entries. Positive
//!   definite wherever the diagonal of G is positive, and already factored.

mod buffer;
mod uncertainty;
mod watch;

use core::fmt;

use nalgebra::Vector6;

use crate::checksum::{START, over_byte, over_numbers, over_numbers_f32};
use crate::kinematics::Posture;
use crate::linalg::{self, Lower};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::stiffness::{self, StiffnessError, StiffnessFactor};
use crate::types::{Domain, Pose};

pub use buffer::{TableBuffer, TableHeader, TransferError};
pub use uncertainty::{TableUncertainty, UNCERTAINTY_COLUMNS, UNCERTAINTY_ENTRIES, UNCERTAINTY_SPREAD, spread_terms};
pub use watch::{TableWatch, WATCHED_NUMBERS};

/// The nine terms of Eq. 11 in its order: exponents of θ, σ, Z0.
pub const EQ_11: [[u8; 3]; 9] =
    [[2, 0, 0], [1, 0, 0], [0, 2, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [0, 0, 0]];

/// Most terms a table may have.
pub const MAX_TERMS: usize = 64;
/// Greatest exponent in a term.
pub const MAX_EXPONENT: u8 = 6;
/// More than [`MAX_EXPONENT`], and a power of two.
const POWERS: usize = 8;
/// Entries of the factor form: a lower triangle, row by row.
pub const FACTOR_ENTRIES: usize = 21;

/// Why a table was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TableError {
    /// No terms, or more than [`MAX_TERMS`].
    TermCount,
    /// An exponent above [`MAX_EXPONENT`].
    Exponent,
    /// The coefficients are not 6 (21 for the factor form) rows of one number a term.
    CoefficientCount,
    /// A number is NaN or infinite.
    NotFinite,
    /// A half width is not above 0.
    EmptyBox,
    /// A number of the uncertainty is not finite, or a variance below 0.
    Uncertainty,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TermCount => "a table needs 1 to 64 terms",
            Self::Exponent => "an exponent is above 6",
            Self::CoefficientCount => "the number of coefficients is not rows times terms",
            Self::NotFinite => "a number of the table is not finite",
            Self::EmptyBox => "a half width of the box is not above 0",
            Self::Uncertainty => "a number of the table's uncertainty is not finite, or a variance below 0",
        })
    }
}

impl core::error::Error for TableError {}

/// Why there is no corrected stiffness for a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CorrectionError {
    /// The basic stiffness failed.
    Stiffness(StiffnessError),
    /// The table was fitted on principal stiffnesses alone and has no factor form.
    NoFactorForm,
    /// A coefficient that must be positive is not, at this pose. Only an extrapolation can do this: the fit
    /// refuses a table that does it inside its box.
    NotPositive {
        /// Row of the coefficient, from 1.
        row: u8,
    },
}

impl fmt::Display for CorrectionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stiffness(e) => e.fmt(f),
            Self::NoFactorForm => f.write_str("the table has no factor form"),
            Self::NotPositive { row } => write!(f, "the correction of row {row} is not positive at this pose"),
        }
    }
}

impl core::error::Error for CorrectionError {}

impl<E: Into<StiffnessError>> From<E> for CorrectionError {
    fn from(e: E) -> Self {
        Self::Stiffness(e.into())
    }
}

/// Monomials of the pose in scaled variables, and the box in which they are scaled to −1…1.
#[derive(Clone, Copy, Debug)]
pub struct Basis<'a, T> {
    pub(crate) centre: [T; 3],
    pub(crate) half_width: [T; 3],
    pub(crate) terms: &'a [[u8; 3]],
}

impl<T: Scalar> Basis<'_, T> {
    /// Where a pose stands to the box. A pose that is not finite is outside.
    pub fn domain(&self, pose: &Pose<T>) -> Domain {
        if self.is_within(pose, T::ONE + T::SLACK) { Domain::Inside } else { Domain::Outside }
    }

    /// Whether a pose is in a box about the same middle whose half widths are this share of the box's.
    pub(crate) fn is_within(&self, pose: &Pose<T>, share: T) -> bool {
        self.scaled(pose).into_iter().all(|t| t.abs() <= share)
    }

    /// The terms' values at a pose, in their order; zeros behind the last.
    pub fn monomials(&self, pose: &Pose<T>) -> [T; MAX_TERMS] {
        let powers = self.scaled(pose).map(|t| {
            let mut powers = [T::ONE; POWERS];
            for n in 1..POWERS {
                powers[n] = powers[n - 1] * t;
            }
            powers
        });
        let [theta, sigma, z0] = &powers;
        // the remainder changes no exponent, and spares the check that it is in range
        let at = |exponent: u8| usize::from(exponent) % POWERS;
        let mut monomials = [T::ZERO; MAX_TERMS];
        for (monomial, [p, r, s]) in monomials.iter_mut().zip(self.terms) {
            *monomial = theta[at(*p)] * sigma[at(*r)] * z0[at(*s)];
        }
        monomials
    }

    fn scaled(&self, pose: &Pose<T>) -> [T; 3] {
        let [c, h] = [self.centre, self.half_width];
        [(pose.theta_rad - c[0]) / h[0], (pose.sigma_rad - c[1]) / h[1], (pose.z0_m - c[2]) / h[2]]
    }
}

/// A correction table: box, terms, coefficients. Borrows its numbers, which on a controller are in flash.
///
/// Several machines and tables: hold pairs of `&Machine` and `&CorrectionTable` and pick one. `Machine::new`, `Basis::new`
/// and `CorrectionTable::new` also run at run time, so that a table may be made of numbers in flash, in a format of your
/// own: the three check them, and [`checksum`](Self::checksum) of the numbers in `f64` tells whether they are the right
/// ones. A table holds no mark of its machine: keep the pair together, since with another machine it computes without an
/// error.
///
/// ```
/// use pkm_core::correction::{EQ_11, FACTOR_ENTRIES};
/// use pkm_core::{Basis, CorrectionTable, Domain, Pose, tables::reference};
/// // from numbers at run time: the factor form with G = 1 leaves K_p as it is
/// let basis = Basis::<f64>::new([0.0, 0.0, 0.53], [0.26, 0.26, 0.03], &EQ_11)?;
/// let (mut diagonal, mut factor) = ([0.0; 6 * 9], [0.0; FACTOR_ENTRIES * 9]);
/// diagonal.iter_mut().skip(8).step_by(9).for_each(|constant| *constant = 1.0);
/// for row in [0, 2, 5, 9, 14, 20] {
///     factor[9 * row + 8] = 1.0;
/// }
/// let table = CorrectionTable::<f64>::new(basis, &diagonal, Some(&factor))?;
/// assert!(table.has_factor_form());
///
/// let (machine, pose) = (&reference::MACHINE_F64, Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.6 });
/// let k_m = table.factor_form(machine, &pose)?;
/// assert_eq!(k_m.domain, Domain::Outside);
/// let (k_m, k_p) = (k_m.factor.stiffness().principal(), machine.stiffness(&pose)?.principal());
/// assert!((k_m.z / k_p.z - 1.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct CorrectionTable<'a, T> {
    pub(crate) basis: Basis<'a, T>,
    pub(crate) diagonal: &'a [T],
    pub(crate) factor: Option<&'a [T]>,
}

macro_rules! table {
    ($t:ty, $over:path) => {
        impl<'a> Basis<'a, $t> {
            /// Checks a basis. Works in a `const`.
            ///
            /// # Arguments
            /// * `centre`, `half_width`: of the box in θ, σ (rad) and Z0 (m).
            /// * `terms`: exponents of the scaled θ, σ, Z0.
            ///
            /// # Errors
            /// What is wrong, see [`TableError`].
            pub const fn new(centre: [$t; 3], half_width: [$t; 3], terms: &'a [[u8; 3]]) -> Result<Self, TableError> {
                if terms.is_empty() || terms.len() > MAX_TERMS {
                    return Err(TableError::TermCount);
                }
                let mut i = 0;
                while i < terms.len() {
                    let [p, r, s] = terms[i];
                    if p > MAX_EXPONENT || r > MAX_EXPONENT || s > MAX_EXPONENT {
                        return Err(TableError::Exponent);
                    }
                    i += 1;
                }
                let mut i = 0;
                while i < 3 {
                    if !(centre[i].is_finite() && half_width[i].is_finite()) {
                        return Err(TableError::NotFinite);
                    }
                    if !(half_width[i] > 0.0) {
                        return Err(TableError::EmptyBox);
                    }
                    i += 1;
                }
                Ok(Self { centre, half_width, terms })
            }
        }

        impl<'a> CorrectionTable<'a, $t> {
            /// Checks a table. Works in a `const`.
            ///
            /// # Arguments
            /// * `diagonal`: six rows of one coefficient a term, c11…c66.
            /// * `factor`: 21 rows, the lower triangle of G row by row; absent when the data had no couplings.
            ///
            /// # Errors
            /// What is wrong, see [`TableError`].
            pub const fn new(
                basis: Basis<'a, $t>,
                diagonal: &'a [$t],
                factor: Option<&'a [$t]>,
            ) -> Result<Self, TableError> {
                const fn check(values: &[$t], count: usize) -> Result<(), TableError> {
                    if values.len() != count {
                        return Err(TableError::CoefficientCount);
                    }
                    let mut i = 0;
                    while i < values.len() {
                        if !values[i].is_finite() {
                            return Err(TableError::NotFinite);
                        }
                        i += 1;
                    }
                    Ok(())
                }
                if let Err(e) = check(diagonal, 6 * basis.terms.len()) {
                    return Err(e);
                }
                if let Some(factor) = factor {
                    if let Err(e) = check(factor, FACTOR_ENTRIES * basis.terms.len()) {
                        return Err(e);
                    }
                }
                Ok(Self { basis, diagonal, factor })
            }

            /// Checksum (FNV-1a, 64 bit) over the bits of box, terms and coefficients in the order of the constructors:
            /// a generated table checks itself with it when it is compiled, a controller can report it.
            pub const fn checksum(&self) -> u64 {
                let mut hash = $over(START, &self.basis.centre);
                hash = $over(hash, &self.basis.half_width);
                let mut i = 0;
                while i < self.basis.terms.len() {
                    let [p, r, s] = self.basis.terms[i];
                    hash = over_byte(over_byte(over_byte(hash, p), r), s);
                    i += 1;
                }
                hash = $over(hash, self.diagonal);
                match self.factor {
                    Some(factor) => $over(hash, factor),
                    None => hash,
                }
            }
        }
    };
}

table!(f32, over_numbers_f32);
table!(f64, over_numbers);

/// A corrected stiffness and where its pose stands to the table's box.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Corrected<T> {
    /// Cholesky factor of K_m at A in A-uvw: ask it for the stiffness or for deflections.
    pub factor: StiffnessFactor<T>,
    /// Whether the table may be trusted here.
    pub domain: Domain,
}

impl<T: Scalar> CorrectionTable<'_, T> {
    /// Where a pose stands to the box that the table was fitted on. A pose that is not finite is outside.
    pub fn domain(&self, pose: &Pose<T>) -> Domain {
        self.basis.domain(pose)
    }

    /// A pose in the table's scaled variables.
    pub(crate) fn scaled(&self, pose: &Pose<T>) -> [T; 3] {
        self.basis.scaled(pose)
    }

    /// Whether the table has the factor form.
    pub const fn has_factor_form(&self) -> bool {
        self.factor.is_some()
    }

    /// The paper's correction coefficients c11…c66 at a pose (Eq. 11).
    pub fn coefficients(&self, pose: &Pose<T>) -> Vector6<T> {
        Vector6::from(self.evaluate(self.diagonal, pose))
    }

    /// K_m in the diagonal form, √C K_p √C: principal stiffnesses as Eq. 10 has them.
    ///
    /// # Errors
    /// Those of [`Machine::stiffness`], and a coefficient that is not positive.
    pub fn diagonal_form(&self, machine: &Machine<T>, pose: &Pose<T>) -> Result<Corrected<T>, CorrectionError> {
        let mut lower = linalg::zero();
        machine.add_stiffness_below_tool(&machine.posture(pose)?, &mut lower)?;
        stiffness::factor(&mut lower)?;
        let coefficients: [T; 6] = self.coefficients(pose).into();
        for (i, c) in coefficients.into_iter().enumerate() {
            if !(c > T::ZERO) {
                return Err(CorrectionError::NotPositive { row: i as u8 + 1 });
            }
            let root = c.sqrt();
            for column in &mut lower.data.0 {
                column[i] *= root;
            }
        }
        check_range(&lower)?;
        soften_by_tool(machine, &mut lower)?;
        Ok(Corrected { factor: StiffnessFactor { lower }, domain: self.domain(pose) })
    }

    /// K_m in the factor form, (L G)(L G)ᵀ with K_p = L Lᵀ.
    ///
    /// # Errors
    /// Those of [`Machine::stiffness`], no factor form, and a diagonal entry of G that is not positive.
    pub fn factor_form(&self, machine: &Machine<T>, pose: &Pose<T>) -> Result<Corrected<T>, CorrectionError> {
        let mut lower = linalg::zero();
        self.add_factor_form(machine, pose, &machine.posture(pose)?, &mut lower)?;
        Ok(Corrected { factor: StiffnessFactor { lower }, domain: self.domain(pose) })
    }

    /// The factor L of a K_p turned into L G. It may be seen along other axes A, as that of A K_p Aᵀ, which is A L: G comes after.
    /// What is elastic between A and the tool is not in it.
    ///
    /// # Errors
    /// As [`factor_form`](Self::factor_form).
    pub fn corrected(&self, k_p: &StiffnessFactor<T>, pose: &Pose<T>) -> Result<StiffnessFactor<T>, CorrectionError> {
        let mut corrected = *k_p;
        self.multiply_by_g(self.factor.ok_or(CorrectionError::NoFactorForm)?, pose, &mut corrected.lower)?;
        Ok(corrected)
    }

    /// Turns zeros into the factor of K_m. `posture` is the pose's own.
    pub(crate) fn add_factor_form(
        &self,
        machine: &Machine<T>,
        pose: &Pose<T>,
        posture: &Posture<T>,
        lower: &mut Lower<T>,
    ) -> Result<(), CorrectionError> {
        let rows = self.factor.ok_or(CorrectionError::NoFactorForm)?;
        machine.add_stiffness_below_tool(posture, lower)?;
        self.correct_factor(rows, pose, lower)?;
        soften_by_tool(machine, lower)
    }

    /// Turns K_p into the factor of K_m.
    #[inline(never)] // as `soften_by_tool`: neither takes stack while K_p is put together
    fn correct_factor(&self, rows: &[T], pose: &Pose<T>, lower: &mut Lower<T>) -> Result<(), CorrectionError> {
        stiffness::factor(lower)?;
        self.multiply_by_g(rows, pose, lower)
    }

    #[inline(always)] // a frame less
    fn multiply_by_g(&self, rows: &[T], pose: &Pose<T>, lower: &mut Lower<T>) -> Result<(), CorrectionError> {
        let g: [T; FACTOR_ENTRIES] = self.evaluate(rows, pose);
        for (row, d) in (1..).zip([g[0], g[2], g[5], g[9], g[14], g[20]]) {
            if !(d > T::ZERO) {
                return Err(CorrectionError::NotPositive { row });
            }
        }
        linalg::multiply(lower, &g);
        Ok(check_range(lower)?)
    }

    /// `ROWS` polynomials with the table's terms at a pose.
    #[inline(never)] // its monomials would take stack while K_p is put together
    fn evaluate<const ROWS: usize>(&self, coefficients: &[T], pose: &Pose<T>) -> [T; ROWS] {
        let monomials = self.basis.monomials(pose);
        const { assert!(ROWS.is_multiple_of(3)) };
        let mut values = [T::ZERO; ROWS];
        let terms = self.basis.terms.len().max(1);
        // three rows at a time share the loads of the monomials
        for (values, rows) in values.as_chunks_mut::<3>().0.iter_mut().zip(coefficients.chunks_exact(3 * terms)) {
            let mut rows = rows.chunks_exact(terms);
            let (Some(a), Some(b), Some(c)) = (rows.next(), rows.next(), rows.next()) else { break };
            let mut sums = [T::ZERO; 3];
            for (((a, b), c), monomial) in a.iter().zip(b).zip(c).zip(&monomials) {
                sums = [sums[0] + *a * *monomial, sums[1] + *b * *monomial, sums[2] + *c * *monomial];
            }
            *values = sums;
        }
        values
    }
}

/// Far outside of its box a table's polynomials leave the range of a number type, up or down.
fn check_range<T: Scalar>(lower: &Lower<T>) -> Result<(), StiffnessError> {
    if linalg::is_in_range(lower) { Ok(()) } else { Err(StiffnessError::NotPositiveDefinite) }
}

/// Takes what lies behind A, which is not in the table, into a factor.
#[inline(never)]
fn soften_by_tool<T: Scalar>(machine: &Machine<T>, lower: &mut Lower<T>) -> Result<(), CorrectionError> {
    if machine.effects.any() {
        let mut stiffness = linalg::square(lower);
        if machine.add_tool_compliance(&mut stiffness)? {
            stiffness::factor(&mut stiffness)?;
            *lower = stiffness;
        }
    }
    Ok(())
}

/// The same numbers in `f32`, for the `f32` side of a generated table.
pub const fn narrow<const N: usize>(values: &[f64; N]) -> [f32; N] {
    let mut narrow = [0.0; N];
    let mut i = 0;
    while i < N {
        narrow[i] = values[i] as f32;
        i += 1;
    }
    narrow
}

//! 6×6 symmetric positive definite arithmetic on lower triangles.
//!
//! Hand-written: the loops have constant bounds, so no panic path is left without link-time optimisation, and
//! they are clean under Miri's default rules, which nalgebra's fixed-size `cholesky()` is not.

use crate::scalar::Scalar;

/// A 6×6 matrix of which only the lower triangle has a meaning.
pub(crate) type Lower<T> = [[T; 6]; 6];

/// A matrix is not positive definite in its number type.
pub(crate) struct NotPositiveDefinite;

pub(crate) fn zero<T: Scalar>() -> Lower<T> {
    [[T::ZERO; 6]; 6]
}

/// Turns a into its L, a = L Lᵀ, with zeros above the diagonal. False when a pivot is not positive, NaN included; then a is of no use.
#[must_use]
pub(crate) fn cholesky<T: Scalar>(a: &mut Lower<T>) -> bool {
    // the column is a constant, so that every loop has a constant length and unrolls
    fn column<const J: usize, T: Scalar>(a: &mut Lower<T>) -> bool {
        for i in 0..J {
            a[i][J] = T::ZERO;
        }
        for i in J..6 {
            let mut sum = a[i][J];
            for k in 0..J {
                sum -= a[i][k] * a[J][k];
            }
            a[i][J] = if i > J {
                sum / a[J][J]
            } else if sum > T::ZERO && sum.is_finite() {
                sum.sqrt()
            } else {
                return false;
            };
        }
        true
    }
    column::<0, T>(a)
        && column::<1, T>(a)
        && column::<2, T>(a)
        && column::<3, T>(a)
        && column::<4, T>(a)
        && column::<5, T>(a)
}

/// x with L Lᵀ x = b.
pub(crate) fn solve<T: Scalar>(l: &Lower<T>, b: &[T; 6]) -> [T; 6] {
    let mut x = *b;
    for i in 0..6 {
        for k in 0..i {
            x[i] -= l[i][k] * x[k];
        }
        x[i] = x[i] / l[i][i];
    }
    for i in (0..6).rev() {
        for k in i + 1..6 {
            x[i] -= l[k][i] * x[k];
        }
        x[i] = x[i] / l[i][i];
    }
    x
}

/// Turns L into L·G. G is a lower triangle row by row, without what is above.
pub(crate) fn multiply<T: Scalar>(l: &mut Lower<T>, g: &[T; 21]) {
    // column K of L meets row K of G, and nothing needs it afterwards
    fn step<const K: usize, T: Scalar>(l: &mut Lower<T>, g: &[T; 21]) {
        let row = K * (K + 1) / 2;
        for i in K..6 {
            let factor = l[i][K];
            for j in 0..K {
                l[i][j] += factor * g[row + j];
            }
            l[i][K] = factor * g[row + K];
        }
    }
    step::<0, T>(l, g);
    step::<1, T>(l, g);
    step::<2, T>(l, g);
    step::<3, T>(l, g);
    step::<4, T>(l, g);
    step::<5, T>(l, g);
}

/// Whether L Lᵀ is positive definite with finite entries, none of which is beyond its trace.
pub(crate) fn is_in_range<T: Scalar>(l: &Lower<T>) -> bool {
    let mut trace = T::ZERO;
    let mut positive = true;
    for i in 0..6 {
        for j in 0..i {
            trace += l[i][j] * l[i][j];
        }
        let pivot = l[i][i] * l[i][i];
        trace += pivot;
        positive &= l[i][i] > T::ZERO && pivot > T::ZERO;
    }
    positive && trace.is_finite()
}

/// L Lᵀ, whole.
pub(crate) fn square<T: Scalar>(l: &Lower<T>) -> [[T; 6]; 6] {
    let mut a = zero();
    for i in 0..6 {
        for j in 0..=i {
            for k in 0..=j {
                a[i][j] += l[i][k] * l[j][k];
            }
            a[j][i] = a[i][j];
        }
    }
    a
}

//! 6×6 symmetric positive definite arithmetic on lower triangles.
//!
//! Hand-written: the loops have constant bounds, so no panic path is left without link-time optimisation, and
//! they are clean under Miri's default rules, which nalgebra's fixed-size `cholesky()` is not.

use crate::scalar::Scalar;

/// A 6×6 matrix of which only the lower triangle has a meaning.
pub(crate) type Lower<T> = [[T; 6]; 6];

pub(crate) fn zero<T: Scalar>() -> Lower<T> {
    [[T::ZERO; 6]; 6]
}

/// L with a = L Lᵀ. `None` when a pivot is not positive, NaN included.
pub(crate) fn cholesky<T: Scalar>(a: &Lower<T>) -> Option<Lower<T>> {
    let mut l = zero();
    for i in 0..6 {
        for j in 0..=i {
            let mut sum = a[i][j];
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            l[i][j] = if i > j {
                sum / l[j][j]
            } else if sum > T::ZERO && sum.is_finite() {
                sum.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(l)
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

/// L·G of two lower triangles.
pub(crate) fn product<T: Scalar>(l: &Lower<T>, g: &Lower<T>) -> Lower<T> {
    let mut p = zero();
    for i in 0..6 {
        for j in 0..=i {
            for k in j..=i {
                p[i][j] += l[i][k] * g[k][j];
            }
        }
    }
    p
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

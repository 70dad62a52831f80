//! What the core needs of linear algebra beside nalgebra's sums and products: vectors and matrices put together and taken apart, and
//! 6×6 symmetric positive definite arithmetic on lower triangles.
//!
//! The latter is hand-written on nalgebra's storage: clean under Miri's default rules, which nalgebra's `cholesky()` is not, and
//! without its `ComplexField`. `docs/dependencies.md` has the counts of both.

use nalgebra::{ArrayStorage, Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use crate::scalar::Scalar;

/// The matrix with these columns.
pub(crate) const fn from_columns<T, const R: usize, const C: usize>(columns: [[T; R]; C]) -> SMatrix<T, R, C> {
    SMatrix::from_array_storage(ArrayStorage(columns))
}

/// Three axes as the columns of a matrix: it takes components along them into the frame in which they are given.
pub(crate) fn frame<T: Scalar>(x: Vector3<T>, y: Vector3<T>, z: Vector3<T>) -> Matrix3<T> {
    from_columns([x.into(), y.into(), z.into()])
}

/// The three columns of a matrix.
pub(crate) fn axes<T: Scalar>(frame: &Matrix3<T>) -> [Vector3<T>; 3] {
    let [x, y, z] = frame.data.0;
    [x.into(), y.into(), z.into()]
}

/// Length of a vector. `norm` of nalgebra asks for its `ComplexField`, which `Scalar` leaves out.
pub(crate) fn length<T: Scalar>(v: &Vector3<T>) -> T {
    v.dot(v).sqrt()
}

/// The same direction at length 1; `None` when it has none.
pub(crate) fn unit<T: Scalar>(v: &Vector3<T>) -> Option<Vector3<T>> {
    let length = length(v);
    (length > T::ZERO && length.is_finite()).then(|| v / length)
}

pub(crate) fn is_finite<T: Scalar, const N: usize>(v: &SVector<T, N>) -> bool {
    v.as_slice().iter().all(|component| component.is_finite())
}

/// Two halves of a six-vector.
pub(crate) fn join<T: Scalar>(first: Vector3<T>, second: Vector3<T>) -> Vector6<T> {
    let ([a, b, c], [d, e, f]) = (first.into(), second.into());
    Vector6::new(a, b, c, d, e, f)
}

/// See [`join`].
pub(crate) fn split<T: Scalar>(v: Vector6<T>) -> (Vector3<T>, Vector3<T>) {
    let [a, b, c, d, e, f] = v.into();
    (Vector3::new(a, b, c), Vector3::new(d, e, f))
}

/// A 6×6 matrix of which only the lower triangle has a meaning. The loops below work on its columns, `data.0`: entry (i, j) is
/// `columns[j][i]`.
pub(crate) type Lower<T> = Matrix6<T>;

/// A matrix is not positive definite in its number type.
pub(crate) struct NotPositiveDefinite;

pub(crate) const fn zero<T: Scalar>() -> Lower<T> {
    from_columns([[T::ZERO; 6]; 6])
}

/// Turns a into its L, a = L Lᵀ, with zeros above the diagonal. False when a pivot is not positive, NaN included; then a is of no use.
#[must_use]
pub(crate) fn cholesky<T: Scalar>(a: &mut Lower<T>) -> bool {
    // the column is a constant, so that every loop has a constant length and unrolls
    fn column<const J: usize, T: Scalar>(a: &mut [[T; 6]; 6]) -> bool {
        for i in 0..J {
            a[J][i] = T::ZERO;
        }
        for i in J..6 {
            let mut sum = a[J][i];
            for k in 0..J {
                sum -= a[k][i] * a[k][J];
            }
            a[J][i] = if i > J {
                sum / a[J][J]
            } else if sum > T::ZERO && sum.is_finite() {
                sum.sqrt()
            } else {
                return false;
            };
        }
        true
    }
    let a = &mut a.data.0;
    column::<0, T>(a)
        && column::<1, T>(a)
        && column::<2, T>(a)
        && column::<3, T>(a)
        && column::<4, T>(a)
        && column::<5, T>(a)
}

/// x with L x = b, where b is 0 before `FIRST`.
pub(crate) fn solve_lower<T: Scalar, const FIRST: usize>(l: &Lower<T>, b: &Vector6<T>) -> Vector6<T> {
    let l = &l.data.0;
    let mut x: [T; 6] = (*b).into();
    for i in FIRST..6 {
        for k in FIRST..i {
            x[i] -= l[k][i] * x[k];
        }
        x[i] /= l[i][i];
    }
    x.into()
}

/// x with L Lᵀ x = b.
pub(crate) fn solve<T: Scalar>(l: &Lower<T>, b: &Vector6<T>) -> Vector6<T> {
    solve_upper(l, &solve_lower::<T, 0>(l, b))
}

/// x with Lᵀ x = b.
pub(crate) fn solve_upper<T: Scalar>(l: &Lower<T>, b: &Vector6<T>) -> Vector6<T> {
    let l = &l.data.0;
    let mut x: [T; 6] = (*b).into();
    for i in (0..6).rev() {
        for k in i + 1..6 {
            x[i] -= l[i][k] * x[k];
        }
        x[i] /= l[i][i];
    }
    x.into()
}

/// Turns L into L·G. G is a lower triangle row by row, without what is above.
pub(crate) fn multiply<T: Scalar>(l: &mut Lower<T>, g: &[T; 21]) {
    // column K of L meets row K of G, and nothing needs it afterwards
    fn step<const K: usize, T: Scalar>(l: &mut [[T; 6]; 6], g: &[T; 21]) {
        let row = K * (K + 1) / 2;
        for i in K..6 {
            let factor = l[K][i];
            for j in 0..K {
                l[j][i] += factor * g[row + j];
            }
            l[K][i] = factor * g[row + K];
        }
    }
    let l = &mut l.data.0;
    step::<0, T>(l, g);
    step::<1, T>(l, g);
    step::<2, T>(l, g);
    step::<3, T>(l, g);
    step::<4, T>(l, g);
    step::<5, T>(l, g);
}

/// Whether L Lᵀ is positive definite with finite entries, none of which is beyond its trace.
pub(crate) fn is_in_range<T: Scalar>(l: &Lower<T>) -> bool {
    let l = &l.data.0;
    let mut trace = T::ZERO;
    let mut positive = true;
    for i in 0..6 {
        for j in 0..i {
            trace += l[j][i] * l[j][i];
        }
        let pivot = l[i][i] * l[i][i];
        trace += pivot;
        positive &= l[i][i] > T::ZERO && pivot > T::ZERO;
    }
    positive && trace.is_finite()
}

/// L Lᵀ, whole.
pub(crate) fn square<T: Scalar>(l: &Lower<T>) -> Matrix6<T> {
    let l = &l.data.0;
    let mut square = zero();
    let a = &mut square.data.0;
    for i in 0..6 {
        for j in 0..=i {
            for k in 0..=j {
                a[j][i] += l[k][i] * l[k][j];
            }
            a[i][j] = a[j][i];
        }
    }
    square
}

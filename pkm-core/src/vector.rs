//! Three numbers along three axes.

use crate::scalar::Scalar;

pub(crate) fn dot<T: Scalar>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn plus<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn less<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The sum of three axes, each times its component of `v`.
pub(crate) fn combined<T: Scalar>(axes: &[[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    let [x, y, z] = axes;
    [
        x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
        x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
        x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
    ]
}

/// The same direction at length 1; `None` when it has none.
pub(crate) fn unit<T: Scalar>(v: [T; 3]) -> Option<[T; 3]> {
    let size = dot(v, v).sqrt();
    (size > T::ZERO && size.is_finite()).then(|| v.map(|v| v / size))
}

pub(crate) fn finite<T: Scalar>(v: [T; 3]) -> bool {
    v.iter().all(|v| v.is_finite())
}

/// Two halves of a six-vector.
pub(crate) fn join<T: Scalar>([a, b, c]: [T; 3], [d, e, f]: [T; 3]) -> [T; 6] {
    [a, b, c, d, e, f]
}

/// See [`join`].
pub(crate) fn split<T: Scalar>([a, b, c, d, e, f]: [T; 6]) -> ([T; 3], [T; 3]) {
    ([a, b, c], [d, e, f])
}

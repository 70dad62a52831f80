//! Rigid motions of points: the one that fits best, and what the errors of the points make of it.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};

/// A rotation about the origin, then a translation.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    pub(crate) rotation: Rotation3<f64>,
    pub(crate) translation_m: Vector3<f64>,
}

/// A point before and after a motion.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub(crate) before_m: Vector3<f64>,
    pub(crate) after_m: Vector3<f64>,
    /// Standard deviations of each coordinate, before and after.
    pub(crate) sd_m: [f64; 2],
}

impl Pair {
    pub(crate) fn variance(&self) -> f64 {
        self.sd_m.iter().map(|s| s * s).sum()
    }
}

impl Motion {
    pub(crate) fn of(&self, at_m: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * at_m + self.translation_m
    }

    pub(crate) fn back(&self, at_m: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse() * (at_m - self.translation_m)
    }

    /// The motion that leaves the least weighted squares (W. Kabsch, A solution for the best rotation to relate two sets of
    /// vectors, Acta Cryst. A32, 1976); some motion where the points determine none.
    pub(crate) fn fit(pairs: &[Pair]) -> Self {
        let total: f64 = pairs.iter().map(|p| 1.0 / p.variance()).sum();
        let mean =
            |of: fn(&Pair) -> Vector3<f64>| pairs.iter().map(|p| of(p) / p.variance()).sum::<Vector3<f64>>() / total;
        let (before, after) = (mean(|p| p.before_m), mean(|p| p.after_m));
        let moment = |p: &Pair| (p.after_m - after) * (p.before_m - before).transpose() / p.variance();
        let svd = pairs.iter().map(moment).sum::<Matrix3<f64>>().svd(true, true);
        let (u, v_t) = (svd.u.unwrap_or_default(), svd.v_t.unwrap_or_default());
        // of the two that are left, the one that is no reflection
        let (least, _) = svd.singular_values.argmin();
        let mut signs = Vector3::repeat(1.0);
        signs[least] = (u * v_t).determinant().signum();
        let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&signs) * v_t);
        Self { rotation, translation_m: after - rotation * before }
    }

    /// Translation of the origin, then the rotation vector.
    pub(crate) fn components(&self) -> Vector6<f64> {
        let (t, r) = (self.translation_m, self.rotation.scaled_axis());
        Vector6::new(t.x, t.y, t.z, r.x, r.y, r.z)
    }

    /// Covariances of [`components`](Self::components), the rotation small or taken in the frame after it: of the errors before,
    /// and of those after. `None` where the points determine no motion.
    pub(crate) fn covariances(&self, pairs: &[Pair]) -> Option<[Matrix6<f64>; 2]> {
        let mut information = Matrix6::zeros();
        let mut moments = [Matrix6::zeros(); 2];
        for p in pairs {
            let square = squared_rows(&(self.rotation * p.before_m));
            let variance = p.variance();
            information += square / variance;
            for (moment, sd) in moments.iter_mut().zip(p.sd_m) {
                *moment += square * (sd / variance).powi(2);
            }
        }
        let inverse = information.cholesky()?.inverse();
        Some(moments.map(|m| inverse * m * inverse))
    }
}

/// JᵀJ of a point's three coordinates by the components of a motion.
fn squared_rows(at_m: &Vector3<f64>) -> Matrix6<f64> {
    let turn = -at_m.cross_matrix();
    let mut square = Matrix6::identity();
    square.fixed_view_mut::<3, 3>(0, 3).copy_from(&turn);
    square.fixed_view_mut::<3, 3>(3, 0).copy_from(&turn.transpose());
    square.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turn.transpose() * turn));
    square
}

/// Root mean square distance of some points from the line that fits them best.
pub(crate) fn width_m(points: &[Vector3<f64>]) -> f64 {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / n;
    let sizes = spread.symmetric_eigenvalues();
    (sizes.sum() - sizes.max()).max(0.0).sqrt()
}

//! Stiffness and deflection over a cell, without what a factorization loses there.
//!
//! A Cholesky factor multiplies what its matrix leaves open by the matrix' condition, and what is known to a percent has soon no
//! factor at all. Along axes in which K_p of the cell's middle is 1 it is near 1 all over the cell, and the factors of K_p and
//! K_m are known as well as it is.

use nalgebra::{Matrix3, Matrix6, Vector2, Vector3, Vector6};
use pkm_core::{CorrectionTable, FiveAxis, Pose, Stiffness, StiffnessFactor, Wrench};

use super::taylor::{Taylor, undecided};

/// K_m over a cell.
#[derive(Clone, Debug)]
pub(super) struct Whitened<const N: usize> {
    /// Factor of K_p in the middle of the cell, and its inverse.
    axes: Matrix6<f64>,
    inverse: Matrix6<f64>,
    /// K_m = (axes · factor) (axes · factor)ᵀ.
    factor: StiffnessFactor<Taylor<N>>,
}

/// A matrix of numbers times one over the cell.
fn times<const N: usize>(a: &Matrix6<f64>, b: &Matrix6<Taylor<N>>) -> Matrix6<Taylor<N>> {
    Matrix6::from_fn(|i, j| (0..6).fold(Taylor::constant(0.0), |sum, k| sum.plus(a[(i, k)], &b[(k, j)])))
}

impl<const N: usize> Whitened<N> {
    /// Of a machine without effects, by a table's factor form; `None` where there is no K_m, or where it is [`undecided`].
    pub fn new(
        five: &FiveAxis<'_, Taylor<N>>,
        table: &CorrectionTable<'_, Taylor<N>>,
        pose: &Pose<Taylor<N>>,
    ) -> Option<Self> {
        let k_p = five.machine.stiffness(pose).ok()?.matrix();
        let middle = Stiffness::from_lower(&k_p.map(|k| k.middle()));
        // a middle without a factor says nothing of the rest of the cell
        let Ok(axes) = middle.factor().map(|factor| factor.lower()) else { return undecided() };
        let Some(inverse) = axes.try_inverse() else { return undecided() };
        let seen = times(&inverse, &times(&inverse, &k_p).transpose());
        let factor = table.corrected(&Stiffness::from_lower(&seen).factor().ok()?, pose).ok()?;
        Some(Self { axes, inverse, factor })
    }

    /// Σ of k11…k66 of K_m.
    pub fn trace(&self) -> Taylor<N> {
        times(&self.axes, &self.factor.lower()).iter().fold(Taylor::constant(0.0), |sum, l| sum + *l * *l)
    }

    /// How a wrench on the tip moves it, along the tool's axes: the work that unit forces on the tip would do.
    pub fn moved(
        &self,
        five: &FiveAxis<'_, Taylor<N>>,
        beta_rad: Vector2<Taylor<N>>,
        wrench: &Wrench<Taylor<N>>,
    ) -> Option<Vector3<Taylor<N>>> {
        let seen = |wrench: &Wrench<Taylor<N>>| {
            let at_a = five.wrist.wrench_at_a(beta_rad, wrench).to_vector();
            Vector6::from_fn(|i, _| {
                (0..6).fold(Taylor::constant(0.0), |sum, k| sum.plus(self.inverse[(i, k)], &at_a[k]))
            })
        };
        let yields = self.factor.deflection(&Wrench::from_vector(seen(wrench))).ok()?.to_vector();
        let along = Matrix3::<Taylor<N>>::identity();
        let zero = Vector3::zeros();
        Some(Vector3::from_fn(|i, _| seen(&Wrench { force_n: along.column(i).into(), moment_nm: zero }).dot(&yields)))
    }

    /// The same for a wrench, or for each of some forces in place of its own.
    pub fn moved_by(
        &self,
        five: &FiveAxis<'_, Taylor<N>>,
        beta_rad: Vector2<Taylor<N>>,
        wrench: &Wrench<Taylor<N>>,
        forces_n: &[Vector3<f64>],
    ) -> Option<Vec<Vector3<Taylor<N>>>> {
        if forces_n.is_empty() {
            return Some(vec![self.moved(five, beta_rad, wrench)?]);
        }
        let (along, zero) = (Matrix3::<Taylor<N>>::identity(), Vector3::zeros());
        let mut yields = [zero; 3];
        for (i, yields) in yields.iter_mut().enumerate() {
            *yields = self.moved(five, beta_rad, &Wrench { force_n: along.column(i).into(), moment_nm: zero })?;
        }
        let by_moment = self.moved(five, beta_rad, &Wrench { force_n: zero, ..*wrench })?;
        let moved = |force: &Vector3<f64>| {
            Vector3::from_fn(|row, _| (0..3).fold(by_moment[row], |sum, i| sum.plus(force[i], &yields[i][row])))
        };
        Some(forces_n.iter().map(moved).collect())
    }
}

/// What a vector's length is nowhere less than.
pub(super) fn length<const N: usize>(v: &Vector3<Taylor<N>>) -> Taylor<N> {
    let root = pkm_core::Scalar::sqrt(v.dot(v));
    // along its direction in the middle, which needs no root: squares may reach below 0 where the vector is hardly known
    let Some(direction) = v.map(|v| v.middle()).try_normalize(0.0) else { return root };
    let along = v.iter().zip(&direction).fold(Taylor::constant(0.0), |sum, (v, share)| sum.plus(*share, v));
    if root.low() >= along.low() { root } else { along }
}

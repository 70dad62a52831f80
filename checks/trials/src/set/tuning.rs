//! The signal that re-identified stiffnesses cannot take.

use nalgebra::{DMatrix, DVector, Vector6};

use super::measuring::NOISE;
use crate::machine::Pose;
use crate::truth::{Row, World};

/// What a user believes of it.
pub(super) const PRIOR: f64 = 0.10;

/// Readings in µm and µrad as one vector, whitened with the noise of a reading and of a series' zero.
pub(super) fn whitened(rows: &[Row], readings: &[Vector6<f64>], rotations: bool) -> DVector<f64> {
    let channels = if rotations { 6 } else { 3 };
    let mut all = DVector::zeros(rows.len() * channels);
    for same in rows.chunk_by(|a, b| a.series == b.series).scan(0, |from, chunk| {
        let range = *from..*from + chunk.len();
        *from = range.end;
        Some(range)
    }) {
        let n = same.len() as f64;
        for channel in 0..channels {
            let [s, t] = NOISE[channel / 3];
            let mean = same.clone().map(|i| readings[i][channel] * 1e6).sum::<f64>() / n;
            let share = 1.0 - s / (s * s + n * t * t).sqrt();
            for i in same.clone() {
                all[i * channels + channel] = (readings[i][channel] * 1e6 - share * mean) / s;
            }
        }
    }
    all
}

/// Derivatives of the whitened readings by every declared stiffness, times its prior.
pub(super) struct Tuning {
    pub jacobian: DMatrix<f64>,
    /// (AᵀA + 1)⁻¹
    pub inner: DMatrix<f64>,
}

impl Tuning {
    pub fn new(world: &World, poses: &[Pose], rows: &[Row], rotations: bool) -> Self {
        let bare = world.with(Vec::new());
        let base = bare.deflections(poses, rows, false);
        let h = 1e-3;
        let columns: Vec<DVector<f64>> = bare
            .machine
            .stiffnesses()
            .into_iter()
            .map(|which| {
                let mut moved = bare.clone();
                moved.machine.scale(which, 1.0 + h);
                let there = moved.deflections(poses, rows, false);
                let change: Vec<_> = there.iter().zip(&base).map(|(a, b)| (a - b) * (PRIOR / h)).collect();
                whitened(rows, &change, rotations)
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let inner = jacobian.tr_mul(&jacobian) + DMatrix::identity(columns.len(), columns.len());
        let inner = inner.cholesky().expect("identity plus a square").inverse();
        Self { jacobian, inner }
    }

    /// aᵀ(1 + AAᵀ)⁻¹b in its small form.
    pub fn product(&self, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
        a.dot(b) - (self.jacobian.tr_mul(a).transpose() * &self.inner * self.jacobian.tr_mul(b))[0]
    }

    /// λ = ηᵀ(1 + AAᵀ)⁻¹η.
    pub fn lambda(&self, signal: &DVector<f64>) -> f64 {
        self.product(signal, signal)
    }
}

//! Readings, models and linear algebra that the tests share.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::{
    Candidate, Channel, CommonErrors, ForwardModel, Noise, NoiseSource, Observations, Parameter, Prior, Reading, Role,
    Unknown,
};

/// Three displacements, three rotations.
pub const CHANNELS: usize = 6;

pub fn reading(condition: usize, series: usize, observed: [Option<f64>; CHANNELS]) -> Reading {
    Reading {
        condition,
        repeat_of: condition,
        series,
        observed: observed.to_vec(),
        sigma: vec![None; 2],
        covariance: None,
        drawn: Vec::new(),
    }
}

/// Readings in six channels of two kinds, given with the pose of each condition.
pub fn observations(pose_of: Vec<usize>, readings: Vec<Reading>) -> Observations {
    let channels = (0..CHANNELS).map(|c| Channel { kind: c / 3, resolution: 1e-9 }).collect();
    Observations { channels, pose_of, readings }
}

pub fn normal(rng: &mut fastrand::Rng) -> f64 {
    // twelve uniform numbers: near enough, and not what the engine does
    (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
}

pub fn micro(rng: &mut fastrand::Rng) -> f64 {
    1e-6 * normal(rng)
}

pub fn near(found: f64, truth: f64, tolerance: f64) {
    assert!((found - truth).abs() <= tolerance * truth.abs().max(1e-9), "{found} instead of {truth}");
}

/// rᵀ C⁻¹ r
pub fn quadratic(c: &DMatrix<f64>, r: &DVector<f64>) -> f64 {
    r.dot(&c.clone().lu().solve(r).unwrap())
}

pub fn close(found: &[f64], truth: &[f64], tolerance: f64) {
    assert_eq!(found.len(), truth.len());
    let largest = truth.iter().fold(1e-9_f64, |most, v| most.max(v.abs()));
    let off = found.iter().zip(truth).any(|(f, t)| !((f - t).abs() <= tolerance * largest));
    assert!(!off, "{found:?} instead of {truth:?}");
}

/// ln N(r; 0, C), less the constant.
pub fn ln_likelihood(c: &DMatrix<f64>, r: &DVector<f64>) -> f64 {
    -0.5 * (quadratic(c, r) + c.determinant().ln())
}

/// (I + A Aᵀ)⁻¹, the residual when unknowns with priors are fitted.
pub fn unexplained(a: &DMatrix<f64>) -> DMatrix<f64> {
    (DMatrix::identity(a.nrows(), a.nrows()) + a * a.transpose()).try_inverse().unwrap()
}

/// The same noise in all channels.
pub fn even(s: f64) -> Noise {
    Noise {
        source: NoiseSource::Repeats,
        within: vec![s; CHANNELS],
        unrounded: vec![s; CHANNELS],
        between: vec![0.0; CHANNELS],
        dof: 0.0,
        declared_share: [1.0; 2],
        is_zero_open: vec![false; CHANNELS],
    }
}

/// A model whose predictions are given as tables by condition and channel: a constant, and a column for each unknown, which
/// comes in by x + curve x².
pub struct Table {
    pub parameters: Vec<Parameter>,
    pub candidates: Vec<Candidate>,
    pub constant: Vec<f64>,
    pub columns: Vec<Vec<f64>>,
    pub curve: f64,
    pub common: CommonErrors,
}

impl Table {
    /// Declared parameters alone, with columns of given size.
    pub fn random(rng: &mut fastrand::Rng, conditions: usize, unknowns: usize, size: f64) -> Self {
        let mut column = |size: f64| (0..conditions * CHANNELS).map(|_| size * normal(rng)).collect::<Vec<f64>>();
        Self {
            parameters: vec![parameter(Role::Declared); unknowns],
            candidates: Vec::new(),
            constant: column(1e-4),
            columns: (0..unknowns).map(|_| column(size)).collect(),
            curve: 0.0,
            common: CommonErrors { group_of: vec![0; conditions], ..CommonErrors::default() },
        }
    }
}

pub fn parameter(role: Role) -> Parameter {
    Parameter { prior: Prior::Normal { scale: 1.0 }, role, ambiguous: false }
}

pub fn unknowns(count: usize) -> Vec<Unknown> {
    (0..count).map(Unknown).collect()
}

impl ForwardModel for Table {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<Vec<f64>> {
        let mut found = self.constant.clone();
        for (u, x) in unknowns.iter().zip(x) {
            for (found, column) in found.iter_mut().zip(&self.columns[u.0]) {
                *found += column * (x + self.curve * x * x);
            }
        }
        Some(found)
    }

    fn common_errors(&self) -> Option<CommonErrors> {
        Some(self.common.clone())
    }
}

/// One reading of every condition, each its own series, as a model has it at `x`.
pub fn simulated(model: &Table, pose_of: Vec<usize>, x: &[f64], s: f64, seed: u64) -> Observations {
    let mut rng = fastrand::Rng::with_seed(seed);
    let said = model.predict(&unknowns(x.len()), x).unwrap();
    let read = |(n, said): (usize, &[f64; CHANNELS])| reading(n, n, said.map(|d| Some(d + s * normal(&mut rng))));
    let readings = said.as_chunks().0.iter().enumerate().map(read).collect();
    observations(pose_of, readings)
}

//! What readings can tell at all: singular values of the machine's unknowns, and the combinations behind them.

use nalgebra::DMatrix;
use pkm_diagnosis::Fit;

use super::model::{Meaning, Model};

/// Least singular value of a direction that counts as identified, and least ratio of prior to posterior deviation of a
/// parameter: its variance is then a tenth of the declared one.
pub const MIN_SINGULAR: f64 = 3.0;
/// Least share of a direction's largest entry at which a parameter is named with it.
const MIN_NAMED: f64 = 0.1;

/// A combination of the machine's unknowns.
#[derive(Clone, Debug)]
pub struct Direction {
    /// What its declared standard deviation changes of the readings over their noise, measuring frame and targets fitted.
    pub singular_value: f64,
    /// Parameters by key with their part, the declared deviation as unit, of length 1; small ones are left out.
    pub parts: Vec<(Meaning, f64)>,
}

impl Direction {
    /// Whether the readings tell it.
    pub fn is_identified(&self) -> bool {
        self.singular_value >= MIN_SINGULAR
    }

    /// In words.
    pub fn text(&self) -> String {
        let part = |(meaning, v): &(Meaning, f64)| format!("{v:+.2} {}", meaning.key());
        self.parts.iter().map(part).collect::<Vec<_>>().join(" ")
    }
}

/// Largest singular value first: with variances 1/(1 + s²) of combinations whose declared variance is 1.
pub fn directions(model: &Model, fit: &Fit) -> Vec<Direction> {
    let is_own = |n: &usize| model.meanings[fit.unknowns[*n].0].is_of_machine();
    let machine: Vec<usize> = (0..fit.unknowns.len()).filter(is_own).collect();
    let inverse = fit.information.inverse();
    let covariance = DMatrix::from_fn(machine.len(), machine.len(), |i, j| inverse[(machine[i], machine[j])]);
    let eigen = covariance.symmetric_eigen();
    let of = |k: usize| {
        let vector = eigen.eigenvectors.column(k);
        let largest = vector.amax();
        let mut parts: Vec<(Meaning, f64)> = (machine.iter().zip(vector.iter()))
            .map(|(n, v)| (model.meanings[fit.unknowns[*n].0], *v))
            .filter(|(_, v)| v.abs() >= MIN_NAMED * largest)
            .collect();
        parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        // of a direction and its opposite the one whose largest part is positive
        let sign = parts.first().map_or(1.0, |p| p.1.signum());
        parts.iter_mut().for_each(|p| p.1 *= sign);
        let variance = eigen.eigenvalues[k].max(f64::MIN_POSITIVE);
        Direction { singular_value: (1.0 / variance - 1.0).max(0.0).sqrt(), parts }
    };
    let mut all: Vec<Direction> = (0..machine.len()).map(of).collect();
    all.sort_by(|a, b| b.singular_value.total_cmp(&a.singular_value));
    all
}

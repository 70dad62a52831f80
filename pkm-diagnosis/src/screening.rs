//! Which candidates the residual points at, before any of them is fitted.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Normal};

use crate::fit::Fit;
use crate::rules::Rules;

/// What the screen says of one candidate.
#[derive(Clone, Debug)]
pub struct Score {
    /// Δχ² that its columns could bring, linearised.
    pub statistic: f64,
    /// Degrees of freedom that it adds.
    pub dof: usize,
    /// Probability of so large a statistic without the effect.
    pub p: f64,
    /// Gain of 2 ln E by the best choice of its columns, linearised; 0 for none.
    pub gain: f64,
    /// First step of its amplitudes: 0 for those that the best choice leaves out.
    pub step: DVector<f64>,
}

/// Scores of all candidates, and the family-wise p of the best.
pub struct Screen {
    /// By candidate.
    pub scores: Vec<Score>,
    /// Probability that any candidate looks as good as the best, if nothing is missing.
    pub p_family: f64,
}

/// Eigenvalues above the limit with their vectors.
fn seen(v: &DMatrix<f64>, limit: f64) -> (Vec<f64>, DMatrix<f64>) {
    if v.is_empty() {
        return (Vec::new(), v.clone());
    }
    let eigen = v.clone().symmetric_eigen();
    let kept: Vec<usize> = (0..v.nrows()).filter(|i| eigen.eigenvalues[*i] > limit).collect();
    (kept.iter().map(|i| eigen.eigenvalues[*i]).collect(), eigen.eigenvectors.select_columns(&kept))
}

/// Columns of a candidate of which all choices are tried: the time doubles with each.
const MAX_CHOSEN: usize = 12;

/// The columns of a candidate that explain most for what they cost, with the steps of their amplitudes, those of
/// one-sided ones positive: by trying all choices of a few columns; of more of them by leaving out what comes out negative, then one
/// after another what costs more than it explains.
fn best_choice(s: &DVector<f64>, v: &DMatrix<f64>, one_sided: &[bool]) -> (f64, DVector<f64>) {
    let n = s.len();
    // gain and steps of some columns, and those that come out negative and must not
    let with = |used: &[usize]| {
        let part = s.select_rows(used);
        let own = v.select_rows(used).select_columns(used);
        let factor = (own + DMatrix::identity(used.len(), used.len())).cholesky()?;
        let step = factor.solve(&part);
        let mut all = DVector::zeros(n);
        used.iter().zip(step.iter()).for_each(|(i, x)| all[*i] = *x);
        let negative: Vec<usize> = used.iter().copied().filter(|i| one_sided[*i] && all[*i] < 0.0).collect();
        Some((step.dot(&part) - factor.ln_determinant(), all, negative))
    };
    if n > MAX_CHOSEN {
        let possible = |mut used: Vec<usize>| loop {
            let (gain, all, negative) = with(&used)?;
            if negative.is_empty() {
                return Some((gain, all, used));
            }
            used.retain(|i| !negative.contains(i));
        };
        let mut best = possible((0..n).collect());
        while let Some((gain, _, used)) = &best {
            let without = |i: &usize| possible(used.iter().copied().filter(|other| other != i).collect());
            let next = used.iter().filter_map(without).max_by(|a, b| a.0.total_cmp(&b.0));
            match next.filter(|next| next.0 > *gain) {
                Some(next) => best = Some(next),
                None => break,
            }
        }
        return best.map_or_else(|| (0.0, DVector::zeros(n)), |(gain, all, _)| (gain, all));
    }
    let mut best: Option<(f64, DVector<f64>)> = None;
    for choice in 1_u32..1 << n {
        let used: Vec<usize> = (0..n).filter(|i| choice & (1 << i) != 0).collect();
        if let Some((gain, all, negative)) = with(&used)
            && negative.is_empty()
            && best.as_ref().is_none_or(|b| gain > b.0)
        {
            best = Some((gain, all));
        }
    }
    best.unwrap_or_else(|| (0.0, DVector::zeros(n)))
}

/// Columns of a candidate.
#[derive(Clone)]
pub struct Columns {
    /// By amplitude.
    pub matrix: DMatrix<f64>,
    /// Which amplitudes must not be negative.
    pub one_sided: Vec<bool>,
    /// Where its first shape was taken, in standard deviations of its prior.
    pub shape: f64,
}

/// Gain of 2 ln E by the best choice of columns, linearised.
pub fn gain(fit: &Fit, columns: &Columns) -> f64 {
    let s = columns.matrix.tr_mul(&fit.residuals);
    best_choice(&s, &fit.remaining(&columns.matrix), &columns.one_sided).0
}

/// The columns of all candidates side by side, and where those of each begin.
fn side_by_side(rows: usize, candidates: &[Columns]) -> (DMatrix<f64>, Vec<usize>) {
    let total: usize = candidates.iter().map(|c| c.matrix.ncols()).sum();
    let mut all = DMatrix::zeros(rows, total);
    let mut starts = Vec::new();
    let mut at = 0;
    for columns in candidates {
        all.columns_mut(at, columns.matrix.ncols()).copy_from(&columns.matrix);
        starts.push(at);
        at += columns.matrix.ncols();
    }
    (all, starts)
}

/// Tests the columns of every candidate against the residuals of a fit, which were whitened by noise that is known from so many
/// degrees of freedom: with few of them the residuals may all be too large, and no statistic is χ².
pub fn screen(fit: &Fit, candidates: &[Columns], noise_dof: Option<f64>, seed: u64, rules: &Rules) -> Screen {
    let widths: Vec<usize> = candidates.iter().map(|c| c.matrix.ncols()).collect();
    let (all, starts) = side_by_side(fit.residuals.len(), candidates);
    let s = all.tr_mul(&fit.residuals);
    let v = fit.remaining(&all);
    // each candidate's whitening: t = |w s|²
    let mut whiteners = Vec::new();
    let mut scores = Vec::new();
    for ((start, width), columns) in starts.iter().zip(&widths).zip(candidates) {
        let own = v.view((*start, *start), (*width, *width)).clone_owned();
        let (values, vectors) = seen(&own, rules.min_signal);
        let mut whitener = vectors.transpose();
        for (i, value) in values.iter().enumerate() {
            whitener.row_mut(i).scale_mut(1.0 / value.sqrt());
        }
        let part = s.rows(*start, *width).clone_owned();
        let whitened = &whitener * &part;
        let statistic = whitened.norm_squared();
        let dof = values.len();
        let (gain, step) = best_choice(&part, &own, &columns.one_sided);
        scores.push(Score { statistic, dof, p: tail(statistic, dof, noise_dof), gain, step });
        whiteners.push(whitener);
    }
    let least = scores.iter().map(|s| s.p).fold(1.0, f64::min);
    let as_small = draws_as_small(&v, &whiteners, &starts, least, noise_dof, [rules.null_draws as u64, seed]);
    // a p below what the draws resolve is bounded by the number of candidates
    let resolved = (as_small as f64 + 1.0) / (rules.null_draws as f64 + 1.0);
    let bonferroni = least * candidates.len() as f64;
    Screen { scores, p_family: if as_small == 0 { resolved.min(bonferroni) } else { resolved } }
}

/// How many draws of all scores from N(0, v) have a candidate with a p as small as `least`.
fn draws_as_small(
    v: &DMatrix<f64>,
    whiteners: &[DMatrix<f64>],
    starts: &[usize],
    least: f64,
    noise_dof: Option<f64>,
    [draws, seed]: [u64; 2],
) -> usize {
    // thresholds of the statistic that would give as small a p, by degrees of freedom
    let most = whiteners.iter().map(DMatrix::ncols).max().unwrap_or(0);
    let limits: Vec<f64> = (0..=most).map(|k| inverse_tail(least, k, noise_dof)).collect();
    let (values, vectors) = seen(v, 1e-9);
    let mut root = vectors;
    for (i, value) in values.iter().enumerate() {
        root.column_mut(i).scale_mut(value.sqrt());
    }
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut as_small = 0;
    for _ in 0..draws {
        let u = &root * DVector::from_fn(values.len(), |_, _| normal(&mut rng));
        // by how much the noise is taken for smaller than it is
        let scale = noise_dof.map_or(1.0, |dof| 1.0 / mean_square(dof, normal(&mut rng)));
        let hit = whiteners.iter().zip(starts).any(|(w, start)| {
            w.nrows() > 0 && scale * (w * u.rows(*start, w.ncols())).norm_squared() >= limits[w.nrows()]
        });
        as_small += usize::from(hit);
    }
    as_small
}

/// χ² of some degrees of freedom over their number: its quantile where a standard normal number has its own.
fn mean_square(dof: f64, normal: f64) -> f64 {
    ChiSquared::new(dof).map_or(1.0, |d| d.inverse_cdf(Normal::standard().cdf(normal)) / dof)
}

fn tail(statistic: f64, dof: usize, noise_dof: Option<f64>) -> f64 {
    let k = dof as f64;
    match noise_dof {
        None => ChiSquared::new(k).map_or(1.0, |d| d.sf(statistic)),
        Some(noise) => FisherSnedecor::new(k, noise).map_or(1.0, |d| d.sf(statistic / k)),
    }
}

fn inverse_tail(p: f64, dof: usize, noise_dof: Option<f64>) -> f64 {
    let (mut low, mut high) = (0.0, 10.0);
    while tail(high, dof, noise_dof) > p && high < 1e9 {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if tail(middle, dof, noise_dof) > p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Standard normal number by Box and Muller.
pub fn normal(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_squares_have_the_quantiles_of_the_tables() {
        // χ² of 3 and 10 degrees of freedom at 0.1 %, 1 %, 50 % and 99 %
        let tables = [(3.0, [0.02430, 0.11483, 2.36597, 11.34487]), (10.0, [1.47874, 2.55821, 9.34182, 23.20925])];
        for (dof, quantiles) in tables {
            for (normal, quantile) in [-3.090_232, -2.326_348, 0.0, 2.326_348].into_iter().zip(quantiles) {
                let found = dof * mean_square(dof, normal);
                assert!((found / quantile - 1.0).abs() < 1e-3, "{dof}: {found} {quantile}");
            }
        }
    }
}

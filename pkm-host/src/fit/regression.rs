//! Least squares for polynomials: coefficients with their errors, what poses cannot determine, and which terms predict best.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};
use pkm_core::correction::MAX_TERMS;

use crate::error::{Failure, Result};

/// Least ratio of singular values at which terms count as determined.
const RANK_LIMIT: f64 = 1e-8;

/// Values by used term, spread over all terms.
pub(super) fn spread(values: &DVector<f64>, used: &[bool]) -> Vec<f64> {
    let mut next = values.iter();
    used.iter().map(|u| if *u { next.next().copied().unwrap_or(0.0) } else { 0.0 }).collect()
}

/// What is nearer than this share of a variable's whole range is at one step of it.
pub(super) const STEP: f64 = 1e-3;

/// The steps of a variable that poses share, in order, as those of a grid.
pub(super) fn levels(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    let least = STEP * all.first().zip(all.last()).map_or(0.0, |(low, high)| high - low);
    all.dedup_by(|next, kept| *next - *kept <= least);
    all
}

pub(super) fn columns(design: &DMatrix<f64>, used: &[bool]) -> DMatrix<f64> {
    let picked: Vec<usize> = (0..design.ncols()).filter(|j| used[*j]).collect();
    design.select_columns(&picked)
}

pub(super) fn condition(design: &DMatrix<f64>) -> f64 {
    let values = design.singular_values();
    values.max() / values.min()
}

/// Names the terms that the poses leave undetermined.
pub(super) fn refuse_rank_deficiency(design: &DMatrix<f64>, used: &[bool]) -> Result<()> {
    let names = ["θ²", "θ", "σ²", "σ", "Z0", "θσ", "θZ0", "σZ0", "1"];
    let names: Vec<&str> = names.into_iter().zip(used).filter_map(|(n, u)| u.then_some(n)).collect();
    let x = columns(design, used);
    if x.nrows() <= x.ncols() {
        let (found, needed) = (x.nrows(), x.ncols() + 1);
        return Err(Failure::input(format!(
            "{found} poses cannot determine the {} terms {}: at least {needed} are needed",
            x.ncols(),
            names.join(", ")
        )));
    }
    let svd = x.svd(false, true);
    let Some(v_t) = svd.v_t else { return Err(Failure::other("no singular value decomposition")) };
    let limit = RANK_LIMIT * svd.singular_values.max();
    let mut undetermined = BTreeSet::new();
    for (k, value) in svd.singular_values.iter().enumerate() {
        if *value <= limit {
            undetermined.extend((0..names.len()).filter(|j| v_t[(k, *j)].abs() > 0.1));
        }
    }
    if undetermined.is_empty() {
        return Ok(());
    }
    let list: Vec<&str> = undetermined.into_iter().map(|j| names[j]).collect();
    Err(Failure::input(format!(
        "these poses cannot determine the terms {}: vary θ, σ and Z0 independently (`pkm-host plan` lays such poses)",
        list.join(", ")
    )))
}

/// A least-squares fit by singular values.
pub(super) struct Regression {
    pub coefficients: DVector<f64>,
    pub standard_errors: DVector<f64>,
    pub loo_rms: f64,
    /// What each pose is off from a fit to the others.
    pub left_out: Vec<f64>,
}

impl Regression {
    pub fn new(design: &DMatrix<f64>, used: &[bool], y: &DVector<f64>) -> Result<Self> {
        let x = columns(design, used);
        let (n, k) = x.shape();
        if n < k {
            return Err(Failure::input("fewer poses than terms"));
        }
        let svd = x.clone().svd(true, true);
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else {
            return Err(Failure::other("no singular value decomposition"));
        };
        if svd.singular_values.min() <= RANK_LIMIT * svd.singular_values.max() {
            return Err(Failure::input("the poses cannot determine the terms"));
        }
        let coefficients = v_t.tr_mul(&(u.tr_mul(y)).component_div(&svd.singular_values));
        let residuals = y - &x * &coefficients;
        let variance = residuals.norm_squared() / n.saturating_sub(k).max(1) as f64;
        let standard_errors = DVector::from_fn(k, |j, _| {
            let sum: f64 = (0..k).map(|i| (v_t[(i, j)] / svd.singular_values[i]).powi(2)).sum();
            (variance * sum).sqrt()
        });
        // leave-one-out residual: r / (1 − leverage)
        let left_out: Vec<f64> =
            (0..n).map(|i| residuals[i] / (1.0 - u.row(i).norm_squared()).max(f64::EPSILON)).collect();
        let loo_rms = (left_out.iter().map(|r| r.powi(2)).sum::<f64>() / n as f64).sqrt();
        Ok(Self { coefficients, standard_errors, loo_rms, left_out })
    }
}

/// Forward selection: add the term that lowers the leave-one-out error most, as long as one lowers it by 5 %.
pub(super) fn select(design: &DMatrix<f64>, y: &[f64]) -> BTreeSet<usize> {
    const MIN_GAIN: f64 = 0.05;
    let y = DVector::from_column_slice(y);
    let error = |set: &BTreeSet<usize>| {
        let used: Vec<bool> = (0..design.ncols()).map(|j| set.contains(&j)).collect();
        Regression::new(design, &used, &y).map_or(f64::INFINITY, |r| r.loo_rms)
    };
    // the first candidate is the constant
    let mut chosen = BTreeSet::from([0]);
    let mut best = error(&chosen);
    let most_terms = (y.len() / 3).min(MAX_TERMS);
    while chosen.len() < most_terms {
        let with = |j: usize| chosen.iter().copied().chain([j]).collect::<BTreeSet<_>>();
        let trials = (0..design.ncols()).filter(|j| !chosen.contains(j)).map(|j| (error(&with(j)), j));
        let Some((least, j)) = trials.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if !(least < (1.0 - MIN_GAIN) * best) {
            break;
        }
        best = least;
        chosen.insert(j);
    }
    chosen
}

//! Least squares with priors: the fit of any set of unknowns.

use std::collections::HashMap;
use std::ops::Range;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::fit::{Fit, rows_and_products, squared};
use crate::model::{CommonErrors, ForwardModel, Parameter, Unknown};
use crate::observations::Observations;
use crate::rules::Rules;
use crate::whitening::{Entry, Whitener};

/// Readings, noise and model together.
#[derive(Clone)]
pub struct Problem<'a> {
    /// What was read.
    pub observations: &'a Observations,
    /// By the noise.
    pub whitener: &'a Whitener,
    /// What predicts, under the conditions of the readings.
    pub model: &'a dyn ForwardModel,
    /// What decides.
    pub rules: &'a Rules,
    /// Means of the readings, by entry.
    means: Vec<f64>,
    /// The same, whitened.
    observed: DVector<f64>,
}

/// Whitened entries that have errors in common, and what one unit of each does to them.
pub type CommonGroup = (Vec<usize>, DMatrix<f64>);

/// Step of the central differences, in units of the priors: truncation and rounding are both near 1e-9.
const STEP: f64 = 1e-4;
/// Step of the one-sided ones.
const SHORT_STEP: f64 = 1e-6;
/// How often a fit that has taken all its steps goes on from where it is: along a bent valley it takes many.
const MAX_RESTARTS: usize = 4;

impl<'a> Problem<'a> {
    /// Puts them together.
    pub fn new(
        observations: &'a Observations,
        whitener: &'a Whitener,
        model: &'a dyn ForwardModel,
        rules: &'a Rules,
    ) -> Self {
        let mean = |e: &Entry| {
            let sum: f64 = e.readings.iter().filter_map(|r| observations.readings[*r].observed[e.channel]).sum();
            sum / e.readings.len() as f64
        };
        let means: Vec<f64> = whitener.entries.iter().map(mean).collect();
        let mut observed = means.clone();
        whitener.whiten(&mut observed);
        Self { observations, whitener, model, rules, means, observed: observed.into() }
    }

    /// The same readings and model under another whitening of the same entries.
    pub fn with(&self, whitener: &'a Whitener) -> Self {
        Self::new(self.observations, whitener, self.model, self.rules)
    }

    /// What is known of an unknown.
    pub fn parameter(&self, unknown: Unknown) -> &Parameter {
        &self.model.parameters()[unknown.0]
    }

    /// Whitened means of readings.
    pub fn observed(&self) -> &DVector<f64> {
        &self.observed
    }

    /// Number of whitened means of readings.
    fn count(&self) -> usize {
        self.observed.len()
    }

    /// Number of scalar observations.
    pub fn numbers(&self) -> usize {
        self.whitener.entries.iter().map(|e| e.readings.len()).sum()
    }

    /// χ² of a fit over all scalar observations.
    pub fn chi2(&self, fit: &Fit) -> f64 {
        fit.chi2 + self.whitener.averaged
    }

    /// χ² of a fit per degree of freedom, at least 1: what evidence is divided by, so that a model that leaves more than noise is not surer
    /// than it can be.
    pub fn temper(&self, fit: &Fit) -> f64 {
        (self.chi2(fit) / (self.numbers() as f64 - fit.effective_parameters()).max(1.0)).max(1.0)
    }

    /// Squared whitened scatter of repeats about their means.
    pub fn pure_error(&self) -> f64 {
        let key = |e: &Entry| (self.observations.readings[e.readings[0]].repeat_of, e.channel);
        // repeats under loads that were recorded differently differ by that as well
        let said = self.model.predict(&[], &[]).unwrap_or_default();
        let place = |e: &Entry| e.condition * self.observations.channels.len() + e.channel;
        let beyond = |(e, mean): (&Entry, &f64)| mean - said.get(place(e)).unwrap_or(&0.0);
        let means: Vec<f64> = self.whitener.entries.iter().zip(&self.means).map(beyond).collect();
        let mut sums: HashMap<(usize, usize), (f64, f64)> = HashMap::new();
        for (e, mean) in self.whitener.entries.iter().zip(&means) {
            let sum = sums.entry(key(e)).or_default();
            sum.0 += mean * e.readings.len() as f64;
            sum.1 += e.readings.len() as f64;
        }
        let of = |e: &Entry| sums.get(&key(e)).map_or(0.0, |(sum, n)| sum / n);
        let mut scatter: Vec<f64> = self.whitener.entries.iter().zip(&means).map(|(e, mean)| mean - of(e)).collect();
        self.whitener.whiten(&mut scatter);
        scatter.iter().map(|s| s * s).sum::<f64>() + self.whitener.averaged
    }

    /// Values by entry from those by condition and channel.
    fn by_entry(&self, by_condition: &[f64]) -> Vec<f64> {
        let channels = self.observations.channels.len();
        self.whitener.entries.iter().map(|e| by_condition[e.condition * channels + e.channel]).collect()
    }

    /// Values by entry from those by condition and channel, whitened.
    pub fn whitened(&self, by_condition: &[f64]) -> Vec<f64> {
        let mut values = self.by_entry(by_condition);
        self.whitener.whiten(&mut values);
        values
    }

    /// Rows of the whitened readings by pose, of those that have any.
    pub fn by_pose(&self) -> Vec<Vec<usize>> {
        let mut groups = vec![Vec::new(); self.observations.poses()];
        for (i, e) in self.whitener.entries.iter().enumerate() {
            groups[self.observations.pose_of[e.condition]].push(i);
        }
        groups.retain(|rows| !rows.is_empty());
        groups
    }

    /// Whitened effects of the errors that readings have in common, group by group.
    pub fn common_groups(&self, errors: &CommonErrors) -> Vec<CommonGroup> {
        let columns: Vec<Vec<f64>> = errors.columns.iter().map(|c| self.whitened(c)).collect();
        let mut groups: Vec<Vec<usize>> = vec![Vec::new(); errors.group_of.iter().map(|g| g + 1).max().unwrap_or(0)];
        for (n, e) in self.whitener.entries.iter().enumerate() {
            groups[errors.group_of[e.condition]].push(n);
        }
        groups.retain(|entries| !entries.is_empty());
        let of = |entries: Vec<usize>| {
            let u = DMatrix::from_fn(entries.len(), columns.len(), |i, k| columns[k][entries[i]]);
            (entries, u)
        };
        groups.into_iter().map(of).collect()
    }

    /// Whitened predictions.
    pub fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<DVector<f64>> {
        let values = self.whitened(&self.model.predict(unknowns, x)?);
        values.iter().all(|v| v.is_finite()).then(|| values.into())
    }

    /// Predictions, white but for the common errors.
    fn predict_plain(&self, unknowns: &[Unknown], x: &[f64]) -> Option<DVector<f64>> {
        let mut values = self.by_entry(&self.model.predict(unknowns, x)?);
        self.whitener.whiten_plain(&mut values);
        values.iter().all(|v| v.is_finite()).then(|| values.into())
    }

    /// Derivatives of the whitened predictions by some of the unknowns.
    pub fn jacobian(&self, unknowns: &[Unknown], x: &[f64], columns: Range<usize>) -> Option<DMatrix<f64>> {
        let columns: Option<Vec<DVector<f64>>> = columns
            .into_par_iter()
            .map(|i| {
                let at = |step: f64| {
                    let mut x = x.to_vec();
                    x[i] += step;
                    self.predict(unknowns, &x)
                };
                Some((at(STEP)? - at(-STEP)?) / (2.0 * STEP))
            })
            .collect();
        let columns = columns?;
        if columns.is_empty() { Some(DMatrix::zeros(self.count(), 0)) } else { Some(DMatrix::from_columns(&columns)) }
    }

    /// The same of [`predict_plain`](Self::predict_plain) by all unknowns, from the predictions there: at half the work.
    fn slopes(&self, unknowns: &[Unknown], x: &[f64], there: &DVector<f64>) -> Option<DMatrix<f64>> {
        let slope = |i: usize| {
            let mut x = x.to_vec();
            x[i] += SHORT_STEP;
            Some((self.predict_plain(unknowns, &x)? - there) / SHORT_STEP)
        };
        let columns: Option<Vec<DVector<f64>>> = (0..x.len()).into_par_iter().map(slope).collect();
        Some(DMatrix::from_columns(&columns?))
    }

    /// Whitened readings less predictions.
    pub fn residuals(&self, unknowns: &[Unknown], x: &[f64]) -> Option<DVector<f64>> {
        Some(&self.observed - self.predict(unknowns, x)?)
    }

    /// The linear form at a point.
    pub fn linear(&self, unknowns: &[Unknown], x: DVector<f64>) -> Option<Fit> {
        let residuals = self.residuals(unknowns, x.as_slice())?;
        let jacobian = self.jacobian(unknowns, x.as_slice(), 0..unknowns.len())?;
        Fit::new(unknowns.to_vec(), x, residuals, jacobian, self.whitener.log_determinant)
    }

    /// Residuals and derivatives that are white but for the common errors, whitened.
    fn shrunk(&self, residuals: &DVector<f64>, jacobian: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let (mut residuals, mut jacobian) = (residuals.clone(), jacobian.clone());
        self.whitener.shrink(residuals.as_mut_slice());
        for mut column in jacobian.column_iter_mut() {
            self.whitener.shrink(column.as_mut_slice());
        }
        (residuals, jacobian)
    }

    /// A linear form without common errors, taken under those of this problem.
    pub fn relevel(&self, plain: &Fit) -> Option<Fit> {
        let (residuals, jacobian) = self.shrunk(&plain.residuals, &plain.jacobian);
        Fit::new(plain.unknowns.clone(), plain.x.clone(), residuals, jacobian, self.whitener.log_determinant)
    }

    /// Most likely values of the unknowns, from a start, and the linear form there.
    pub fn fit(&self, unknowns: &[Unknown], start: &[f64]) -> Option<Fit> {
        self.relevel(&self.fit_plain(unknowns, start)?)
    }

    /// Most likely values of the unknowns under the errors of this problem, from a start, and the linear form there without the
    /// common ones. Its slopes are those of the last step, one-sided.
    pub fn fit_plain(&self, unknowns: &[Unknown], start: &[f64]) -> Option<Fit> {
        if unknowns.is_empty() {
            return None;
        }
        let mut observed = self.means.clone();
        self.whitener.whiten_plain(&mut observed);
        let (x, observed) = (DVector::from_column_slice(start), observed.into());
        let mut squares = Squares { problem: self, unknowns, observed, x, at: None };
        squares.at = squares.there();
        // unknowns are in units of their priors: scaled by what readings say of each, steps along valleys stay short
        let solver = LevenbergMarquardt::new()
            .with_scale_diag(false)
            .with_ftol(1e-6)
            .with_xtol(1e-5)
            .with_gtol(1e-6)
            .with_patience(2);
        let has_lost_patience = |ended: &TerminationReason| matches!(ended, TerminationReason::LostPatience);
        let (mut found, mut report) = solver.minimize(squares);
        for _ in 0..MAX_RESTARTS {
            if has_lost_patience(&report.termination) {
                (found, report) = solver.minimize(found);
            }
        }
        let usable = report.termination.was_successful() || has_lost_patience(&report.termination);
        let there = found.at.filter(|_| usable)?;
        Fit::new(unknowns.to_vec(), found.x, there.residuals, there.jacobian, 0.0)
    }
}

/// The sum of squares to minimise: residuals, then the unknowns themselves (their priors). Thousands of readings are first
/// reduced to as many numbers as there are unknowns, and one for the rest that no unknown reaches: the same sum, gradient
/// and curvature for a fraction of the work.
struct Squares<'p, 'a> {
    problem: &'p Problem<'a>,
    unknowns: &'p [Unknown],
    /// White but for the common errors.
    observed: DVector<f64>,
    x: DVector<f64>,
    at: Option<There>,
}

/// The linear form at a point.
struct There {
    /// White but for the common errors, as the derivatives.
    residuals: DVector<f64>,
    /// Of the predictions.
    jacobian: DMatrix<f64>,
    reduced: (DVector<f64>, DMatrix<f64>),
}

impl Squares<'_, '_> {
    fn there(&self) -> Option<There> {
        let k = self.x.len();
        let predicted = self.problem.predict_plain(self.unknowns, self.x.as_slice())?;
        let jacobian = self.problem.slopes(self.unknowns, self.x.as_slice(), &predicted)?;
        let residuals = &self.observed - predicted;
        let (rows, products) = rows_and_products(&jacobian, &residuals);
        let products = products - squared(&self.problem.whitener.lost(&rows));
        // (J; I) = Q U and (r; x) = Q c + a part orthogonal to all columns
        let u = (products.view((0, 0), (k, k)) + DMatrix::identity(k, k)).cholesky()?.l();
        let c = u.solve_lower_triangular(&(&self.x - products.view((0, k), (k, 1))))?;
        let rest = (products[(k, k)] + self.x.norm_squared() - c.norm_squared()).max(0.0).sqrt();
        Some(There { residuals, jacobian, reduced: (c.push(rest), u.transpose().insert_row(k, 0.0)) })
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Squares<'_, '_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
        self.at = self.there();
    }

    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        self.at.as_ref().map(|there| there.reduced.0.clone())
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        self.at.as_ref().map(|there| there.reduced.1.clone())
    }
}

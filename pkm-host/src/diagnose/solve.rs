//! Least squares with priors: the fit of any set of unknowns, and what follows from its linear form.

use std::collections::{BTreeMap, HashMap};

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use pkm_core::{Pose, Wrench};
use rayon::prelude::*;

use super::model::{Model, Unknown};
use super::noise::{Entry, Whitener};
use crate::files::machine::Uncertainty;
use crate::files::readings::{Condition, Readings};

/// Data, noise and model together.
pub struct Problem<'a> {
    /// What was read.
    pub readings: &'a Readings,
    /// Commanded poses.
    pub poses: Vec<Pose<f64>>,
    /// By the noise.
    pub whitener: &'a Whitener,
    /// What predicts.
    pub model: &'a Model,
    /// Means of the readings, by entry.
    means: Vec<f64>,
    /// The same, whitened.
    observed: DVector<f64>,
}

/// A converged fit and its linear form.
#[derive(Clone)]
pub struct Fit {
    /// What was unknown.
    pub unknowns: Vec<Unknown>,
    /// Where the fit ended.
    pub x: DVector<f64>,
    /// Whitened readings less predictions.
    pub residuals: DVector<f64>,
    /// Of the whitened predictions.
    pub jacobian: DMatrix<f64>,
    /// Cholesky factor of AᵀA + I.
    pub information: Cholesky<f64, Dyn>,
    /// |r|².
    pub chi2: f64,
    /// |r|² + |x|².
    pub objective: f64,
    /// ln|I + UUᵀ| of the load errors under which it was made.
    log_determinant: f64,
}

/// Whitened entries under one load at one pose, and what errors of the load do to them.
pub type LoadGroup = (Vec<usize>, DMatrix<f64>);

/// Step of the central differences, in units of the priors: truncation and rounding are both near 1e-9.
const STEP: f64 = 1e-4;
/// Step of the one-sided ones.
const SHORT_STEP: f64 = 1e-6;

impl<'a> Problem<'a> {
    /// Puts them together.
    pub fn new(readings: &'a Readings, whitener: &'a Whitener, model: &'a Model) -> Self {
        let mean = |e: &Entry| {
            let sum: f64 = e.readings.iter().filter_map(|r| readings.readings[*r].observed[e.channel]).sum();
            sum / e.readings.len() as f64
        };
        let means: Vec<f64> = whitener.entries.iter().map(mean).collect();
        let mut observed = means.clone();
        whitener.whiten(&mut observed);
        let poses = readings.poses.iter().map(|p| p.pose).collect();
        Self { readings, poses, whitener, model, means, observed: observed.into() }
    }

    /// Number of whitened means of readings.
    fn count(&self) -> usize {
        self.observed.len()
    }

    /// Numbers that were read.
    pub fn numbers(&self) -> usize {
        self.whitener.entries.iter().map(|e| e.readings.len()).sum()
    }

    /// χ² of a fit over all numbers that were read.
    pub fn chi2(&self, fit: &Fit) -> f64 {
        fit.chi2 + self.whitener.averaged
    }

    /// Squared whitened scatter of repeats about their means.
    pub fn pure_error(&self) -> f64 {
        let key = |e: &Entry| (self.readings.readings[e.readings[0]].repeat_of, e.channel);
        let mut sums: HashMap<(usize, usize), (f64, f64)> = HashMap::new();
        for (e, mean) in self.whitener.entries.iter().zip(&self.means) {
            let sum = sums.entry(key(e)).or_default();
            sum.0 += mean * e.readings.len() as f64;
            sum.1 += e.readings.len() as f64;
        }
        let of = |e: &Entry| sums.get(&key(e)).map_or(0.0, |(sum, n)| sum / n);
        let mut scatter: Vec<f64> =
            self.whitener.entries.iter().zip(&self.means).map(|(e, mean)| mean - of(e)).collect();
        self.whitener.whiten(&mut scatter);
        scatter.iter().map(|s| s * s).sum::<f64>() + self.whitener.averaged
    }

    /// Whitened displacements that errors of the loads cause: for every pose and line of load,
    /// three turns of its direction by 1 rad and a gain by 1, common to all readings there.
    pub fn load_errors(&self) -> Option<Vec<LoadGroup>> {
        let readings = self.readings;
        // the line of a load, whichever way along it and however large
        let line = |c: &Condition| -> (usize, Vec<i64>) {
            let all = c.wrench.to_array();
            let size = all.iter().map(|v| v * v).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
            let sign = all.iter().find(|v| **v != 0.0).map_or(1.0, |v| v.signum());
            (c.pose, all.iter().map(|v| (1e3 * sign * v / size).round() as i64).collect())
        };
        let mut groups: BTreeMap<(usize, Vec<i64>), Vec<usize>> = BTreeMap::new();
        for (n, e) in self.whitener.entries.iter().enumerate() {
            groups.entry(line(&readings.conditions[e.condition])).or_default().push(n);
        }
        let turned = |v: [f64; 3], axis: usize| -> [f64; 3] {
            let unit: [f64; 3] = std::array::from_fn(|i| f64::from(i == axis));
            [unit[1] * v[2] - unit[2] * v[1], unit[2] * v[0] - unit[0] * v[2], unit[0] * v[1] - unit[1] * v[0]]
        };
        let columns: Option<Vec<Vec<f64>>> = (0..4)
            .map(|kind| {
                let conditions: Vec<Condition> = (readings.conditions.iter())
                    .map(|c| {
                        let changed = |v: [f64; 3]| {
                            if kind < 3 { turned(v, kind) } else { v }
                        };
                        let wrench =
                            Wrench { force_n: changed(c.wrench.force_n), moment_nm: changed(c.wrench.moment_nm) };
                        Condition { wrench, rise_k: 0.0, ..*c }
                    })
                    .collect();
                let found = self.model.predict(&self.poses, &conditions, &[], &[])?;
                let mut values: Vec<f64> =
                    (self.whitener.entries.iter()).map(|e| found[e.condition][e.channel]).collect();
                self.whitener.whiten(&mut values);
                Some(values)
            })
            .collect();
        let columns = columns?;
        Some(
            groups
                .into_values()
                .map(|entries| {
                    let u = DMatrix::from_fn(entries.len(), 4, |i, k| columns[k][entries[i]]);
                    (entries, u)
                })
                .collect(),
        )
    }

    /// Whitened predictions.
    pub fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<DVector<f64>> {
        let found = self.model.predict(&self.poses, &self.readings.conditions, unknowns, x)?;
        let mut values: Vec<f64> = self.whitener.entries.iter().map(|e| found[e.condition][e.channel]).collect();
        self.whitener.whiten(&mut values);
        values.iter().all(|v| v.is_finite()).then(|| values.into())
    }

    /// Derivatives of the whitened predictions by some of the unknowns.
    pub fn jacobian(&self, unknowns: &[Unknown], x: &[f64], columns: std::ops::Range<usize>) -> Option<DMatrix<f64>> {
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

    /// The same by all unknowns, from the predictions there: good enough for the way to a minimum, at half the work.
    fn slopes(&self, unknowns: &[Unknown], x: &[f64], there: &DVector<f64>) -> Option<DMatrix<f64>> {
        let slope = |i: usize| {
            let mut x = x.to_vec();
            x[i] += SHORT_STEP;
            Some((self.predict(unknowns, &x)? - there) / SHORT_STEP)
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

    /// A linear form of plain whitening under errors of the loads as well.
    pub fn relevel(&self, plain: &Fit) -> Option<Fit> {
        let (mut residuals, mut jacobian) = (plain.residuals.clone(), plain.jacobian.clone());
        self.whitener.shrink(residuals.as_mut_slice());
        for mut column in jacobian.column_iter_mut() {
            self.whitener.shrink(column.as_mut_slice());
        }
        Fit::new(plain.unknowns.clone(), plain.x.clone(), residuals, jacobian, self.whitener.log_determinant)
    }

    /// Most likely values of the unknowns, from a start.
    pub fn fit(&self, unknowns: &[Unknown], start: &[f64]) -> Option<Fit> {
        if unknowns.is_empty() {
            return None;
        }
        let mut least = Squares { problem: self, unknowns, x: DVector::from_column_slice(start), reduced: None };
        least.reduced = least.reduce();
        let (found, report) =
            LevenbergMarquardt::new().with_ftol(1e-6).with_xtol(1e-5).with_gtol(1e-6).with_patience(2).minimize(least);
        let usable = report.termination.was_successful()
            || matches!(report.termination, levenberg_marquardt::TerminationReason::LostPatience);
        if !usable { None } else { self.linear(unknowns, found.x) }
    }
}

/// Relative errors of load direction (rad) and size beyond the declared ones that are considered: nobody declares all.
const LOAD_ERRORS: [f64; 6] = [0.0, 5e-4, 1e-3, 2e-3, 4e-3, 8e-3];

/// One problem at every level of load error.
pub struct Levels<'a> {
    /// Without any.
    pub plain: &'a Problem<'a>,
    /// From the declared one on.
    pub problems: Vec<Problem<'a>>,
}

/// Whitenings for [`Levels`], from the declared load errors on.
pub fn whiteners(plain: &Problem<'_>, declared: &Uncertainty) -> Option<Vec<Whitener>> {
    let groups = plain.load_errors()?;
    let at = |more: &f64| {
        let (turn, gain) = (declared.load_direction_rad.hypot(*more), declared.load_gain.hypot(*more));
        plain.whitener.with_load_errors(&groups, [turn, turn, turn, gain])
    };
    Some(LOAD_ERRORS.iter().map(at).collect())
}

impl<'a> Levels<'a> {
    /// Puts them together.
    pub fn new(plain: &'a Problem<'a>, whiteners: &'a [Whitener]) -> Self {
        let problems = whiteners.iter().map(|w| Problem::new(plain.readings, w, plain.model)).collect();
        Self { plain, problems }
    }

    /// The load error beyond the declared one at a level, relative.
    pub fn load_error(level: usize) -> f64 {
        LOAD_ERRORS[level]
    }

    /// Fits at a level, then at the one that makes the readings most likely.
    pub fn fit(&self, unknowns: &[Unknown], start: &[f64], level: usize) -> Option<(usize, Fit)> {
        let fit = self.problems[level].fit(unknowns, start)?;
        let plain = self.plain.linear(unknowns, fit.x.clone())?;
        let fits: Vec<Option<Fit>> = self.problems.par_iter().map(|p| p.relevel(&plain)).collect();
        let evidence = |l: &usize| fits[*l].as_ref().map_or(f64::NEG_INFINITY, Fit::ln_evidence);
        let best = (0..fits.len()).max_by(|a, b| evidence(a).total_cmp(&evidence(b)))?;
        if best == level {
            Some((level, fit))
        } else {
            Some((best, self.problems[best].fit(unknowns, fit.x.as_slice())?))
        }
    }
}

/// The sum of squares that is made least: residuals, then the unknowns themselves (their priors). Thousands of readings
/// are first reduced to as many numbers as there are unknowns, and one for the rest that no unknown reaches: the
/// same sum, gradient and curvature for a fraction of the work.
struct Squares<'p, 'a> {
    problem: &'p Problem<'a>,
    unknowns: &'p [Unknown],
    x: DVector<f64>,
    reduced: Option<(DVector<f64>, DMatrix<f64>)>,
}

impl Squares<'_, '_> {
    fn reduce(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let k = self.x.len();
        let predicted = self.problem.predict(self.unknowns, self.x.as_slice())?;
        let j = self.problem.slopes(self.unknowns, self.x.as_slice(), &predicted)?;
        let r = predicted - &self.problem.observed;
        // (J; I) = Q U and (r; x) = Q c + what is square to all columns
        let u = (product(&j, &j) + DMatrix::identity(k, k)).cholesky()?.l();
        let c = u.solve_lower_triangular(&(j.tr_mul(&r) + &self.x))?;
        let rest = (r.norm_squared() + self.x.norm_squared() - c.norm_squared()).max(0.0).sqrt();
        Some((c.push(rest), u.transpose().insert_row(k, 0.0)))
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Squares<'_, '_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
        self.reduced = self.reduce();
    }

    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        self.reduced.as_ref().map(|r| r.0.clone())
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        self.reduced.as_ref().map(|r| r.1.clone())
    }
}

/// Aᵀ B. What `tr_mul` does takes several times as long.
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    a.transpose() * b
}

impl Fit {
    fn new(
        unknowns: Vec<Unknown>,
        x: DVector<f64>,
        residuals: DVector<f64>,
        jacobian: DMatrix<f64>,
        log_determinant: f64,
    ) -> Option<Self> {
        let information = (product(&jacobian, &jacobian) + DMatrix::identity(x.len(), x.len())).cholesky()?;
        let chi2 = residuals.norm_squared();
        let objective = chi2 + x.norm_squared();
        Some(Self { unknowns, x, residuals, jacobian, information, chi2, objective, log_determinant })
    }

    /// ½ ln|AᵀA + I|.
    fn half_log_determinant(&self) -> f64 {
        self.information.l_dirty().diagonal().iter().map(|d| d.ln()).sum()
    }

    /// ln of the probability of the readings under the model, up to a constant of the data.
    pub fn ln_evidence(&self) -> f64 {
        // what is still to gain by a step to the bottom
        let slope = self.jacobian.tr_mul(&self.residuals) - &self.x;
        let rest = slope.dot(&self.information.solve(&slope));
        -0.5 * (self.objective - rest + self.log_determinant) - self.half_log_determinant()
    }

    /// Freedoms that the fit used up: tr[(AᵀA + I)⁻¹ AᵀA].
    pub fn used_freedoms(&self) -> f64 {
        self.x.len() as f64 - self.information.inverse().trace()
    }

    /// Standard errors of the unknowns.
    pub fn standard_errors(&self) -> DVector<f64> {
        self.information.inverse().diagonal().map(f64::sqrt)
    }

    /// Unknowns whose signals are nearly that of another.
    pub fn alike(&self, of: Unknown) -> Vec<Unknown> {
        let Some(own) = self.unknowns.iter().position(|u| *u == of) else { return Vec::new() };
        let a = self.jacobian.column(own);
        let cosine = |j: usize| {
            let b = self.jacobian.column(j);
            a.dot(&b).abs() / (a.norm() * b.norm()).max(f64::MIN_POSITIVE)
        };
        (0..self.unknowns.len()).filter(|j| *j != own && cosine(*j) > 0.95).map(|j| self.unknowns[j]).collect()
    }

    /// V = Jᵀ (I + AAᵀ)⁻¹ J: what of some columns the unknowns of this fit cannot take.
    pub fn remaining(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let cross = product(&self.jacobian, columns);
        product(columns, columns) - cross.tr_mul(&self.information.solve(&cross))
    }

    /// Squared errors of prediction, group by group of whitened readings, each predicted from the others: the linear
    /// form without the group is exact for it.
    pub fn left_out(&self, groups: &[Vec<usize>]) -> Vec<f64> {
        let m = self.information.l();
        let m = &m * m.transpose();
        groups
            .par_iter()
            .map(|group| {
                let a = self.jacobian.select_rows(group);
                let r = self.residuals.select_rows(group);
                let b = a.tr_mul(&r);
                let gram = a.tr_mul(&a);
                let shift = (&m - &gram).cholesky().map(|c| c.solve(&b));
                shift.map_or(f64::INFINITY, |s| r.norm_squared() + 2.0 * s.dot(&b) + s.dot(&(&gram * &s)))
            })
            .collect()
    }
}

//! The linear form of a model at its most likely values, and what follows from it.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::model::Unknown;

/// A fit and its linear form. One that still moves after five times the steps that fits take ends there.
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
    /// ln|I + UUᵀ| of the common errors under which it was made.
    log_determinant: f64,
}

/// Aᵀ B. What `tr_mul` does takes several times as long.
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    a.transpose() * b
}

/// Derivatives and, behind them, residuals: as rows, and their inner products.
pub(crate) fn rows_and_products(jacobian: &DMatrix<f64>, residuals: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut columns = jacobian.clone().insert_column(jacobian.ncols(), 0.0);
    columns.set_column(jacobian.ncols(), residuals);
    let rows = columns.transpose();
    let products = &rows * columns;
    (rows, products)
}

/// A Aᵀ.
pub(crate) fn squared(a: &DMatrix<f64>) -> DMatrix<f64> {
    a * a.transpose()
}

/// ln of the probability of the readings, from AᵀA + I, half the downward slope of the objective, the objective, and ln|I + UUᵀ| of
/// the common errors.
fn laplace(information: &Cholesky<f64, Dyn>, slope: &DVector<f64>, objective: f64, log_determinant: f64) -> f64 {
    // what is still to gain by a step to the minimum
    let rest = slope.dot(&information.solve(slope));
    let half_ln: f64 = information.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    -0.5 * (objective - rest + log_determinant) - half_ln
}

/// [`Fit::ln_evidence`] from inner products of the jacobian's columns and, behind them, the residuals.
pub(crate) fn ln_evidence(products: &DMatrix<f64>, x: &DVector<f64>, log_determinant: f64) -> Option<f64> {
    let k = x.len();
    let information = (products.view((0, 0), (k, k)) + DMatrix::identity(k, k)).cholesky()?;
    let slope = products.view((0, k), (k, 1)) - x;
    Some(laplace(&information, &slope.column(0).clone_owned(), products[(k, k)] + x.norm_squared(), log_determinant))
}

impl Fit {
    /// Puts it together; none where the information matrix is not finite.
    pub fn new(
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

    /// ln of the probability of the readings under the model (Laplace), up to a constant of the data.
    pub fn ln_evidence(&self) -> f64 {
        let slope = self.jacobian.tr_mul(&self.residuals) - &self.x;
        laplace(&self.information, &slope, self.objective, self.log_determinant)
    }

    /// Effective number of parameters: tr[(AᵀA + I)⁻¹ AᵀA].
    pub fn effective_parameters(&self) -> f64 {
        self.x.len() as f64 - self.information.inverse().trace()
    }

    /// Covariance of the unknowns where the readings scatter about the model by so many times the variance of their noise: they then say less,
    /// and the prior as much.
    pub fn covariance(&self, scatter: f64) -> DMatrix<f64> {
        let identity = DMatrix::identity(self.x.len(), self.x.len());
        let of_noise = || self.information.inverse();
        if scatter == 1.0 {
            return of_noise();
        }
        let of_readings = product(&self.jacobian, &self.jacobian) / scatter;
        (of_readings + identity).cholesky().map_or_else(of_noise, |information| information.inverse())
    }

    /// Standard errors of the unknowns, by the same.
    pub fn standard_errors(&self, scatter: f64) -> DVector<f64> {
        self.covariance(scatter).diagonal().map(f64::sqrt)
    }

    /// Unknowns whose signals are nearly that of another: cosine beyond a limit.
    pub fn alike(&self, of: Unknown, cosine_limit: f64) -> Vec<Unknown> {
        let Some(own) = self.unknowns.iter().position(|u| *u == of) else { return Vec::new() };
        let a = self.jacobian.column(own);
        let cosine = |j: usize| {
            let b = self.jacobian.column(j);
            a.dot(&b).abs() / (a.norm() * b.norm()).max(f64::MIN_POSITIVE)
        };
        (0..self.unknowns.len()).filter(|j| *j != own && cosine(*j) > cosine_limit).map(|j| self.unknowns[j]).collect()
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

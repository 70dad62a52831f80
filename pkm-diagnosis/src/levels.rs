//! One problem at several sizes of the errors that readings have in common, such as those of the loads: nobody declares all.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::fit::{Fit, ln_evidence, product, rows_and_products, squared};
use crate::model::{CommonErrors, Unknown};
use crate::solve::Problem;
use crate::whitening::Whitener;

/// One problem at every level of common errors.
pub struct Levels<'a> {
    /// Without any.
    pub plain: &'a Problem<'a>,
    /// From the declared ones on.
    pub problems: Vec<Problem<'a>>,
}

/// Whitenings for [`Levels`], from the declared common errors on; all alike where the model has none.
pub fn whiteners(plain: &Problem<'_>) -> Vec<Whitener> {
    let Some(errors) = plain.model.common_errors() else {
        return vec![plain.whitener.clone(); plain.rules.load_error_levels.len()];
    };
    let groups = plain.common_groups(&errors);
    let at = |level: &f64| plain.whitener.with_common_errors(&groups, &scale(&errors, *level));
    plain.rules.load_error_levels.iter().map(at).collect()
}

/// Standard deviations of common errors at a level.
fn scale(errors: &CommonErrors, level: f64) -> Vec<f64> {
    errors.sd.iter().zip(&errors.undeclared).map(|(sd, more)| sd.hypot(level * more)).collect()
}

/// The same with disturbances of the readings that the model knows nothing of ([`Whitener::with_disturbances`]).
pub fn disturbed(whiteners: &[Whitener], columns: &DMatrix<f64>) -> Vec<Whitener> {
    whiteners.par_iter().map(|w| w.with_disturbances(columns)).collect()
}

impl<'a> Levels<'a> {
    /// Puts them together.
    pub fn new(plain: &'a Problem<'a>, whiteners: &'a [Whitener]) -> Self {
        Self { plain, problems: whiteners.iter().map(|w| plain.with(w)).collect() }
    }

    /// The relative error beyond the declared one at a level.
    pub fn load_error(&self, level: usize) -> f64 {
        self.plain.rules.load_error_levels[level]
    }

    /// Fits at a level, then at the one that makes the readings most likely.
    pub fn fit(&self, unknowns: &[Unknown], start: &[f64], level: usize) -> Option<(usize, Fit)> {
        let at = |level: usize, start: &[f64]| {
            let plain = self.problems[level].fit_plain(unknowns, start)?;
            let evidence = self.evidence(&plain);
            // of levels that say the same the least
            let best = (0..evidence.len()).reduce(|a, b| if evidence[b] > evidence[a] { b } else { a })?;
            Some((best, plain))
        };
        let (best, mut plain) = at(level, start)?;
        if best != level {
            plain = at(best, plain.x.as_slice())?.1;
        }
        Some((best, self.problems[best].relevel(&plain)?))
    }

    /// What readings are expected to be by condition and channel, by a fit and the common errors at a level that they most likely have
    /// beside it.
    pub fn expected(&self, fit: &Fit, level: usize) -> Option<Vec<f64>> {
        let x = fit.x.as_slice();
        let mut said = self.plain.model.predict(&fit.unknowns, x)?;
        let Some(errors) = self.plain.model.common_errors() else { return Some(said) };
        let (left, scale) = (self.plain.residuals(&fit.unknowns, x)?, scale(&errors, self.load_error(level)));
        let (channels, count) = (self.plain.observations.channels.len(), scale.len());
        let mut likely = vec![0.0; count * errors.group_of.len()];
        for (entries, mut u) in self.plain.common_groups(&errors) {
            u.column_iter_mut().zip(&scale).for_each(|(mut column, sd)| column *= *sd);
            let mut towards = DVector::zeros(count);
            for (row, e) in entries.iter().enumerate() {
                towards.axpy(left[*e], &u.row(row).transpose(), 1.0);
            }
            let known = (product(&u, &u) + DMatrix::identity(count, count)).cholesky()?;
            let group = errors.group_of[self.plain.whitener.entries[entries[0]].condition];
            likely[group * count..][..count].copy_from_slice(known.solve(&towards).as_slice());
        }
        for (n, said) in said.iter_mut().enumerate() {
            let own = &likely[errors.group_of[n / channels] * count..][..count];
            *said += (0..count).map(|k| errors.columns[k][n] * scale[k] * own[k]).sum::<f64>();
        }
        Some(said)
    }

    /// By how much a level of load errors is likelier than all up to the relative size `most`, as ln evidence of a fit's unknowns.
    pub fn gain_over(&self, fit: &Fit, level: usize, most: f64) -> Option<f64> {
        let evidence = self.evidence(&self.problems[level].fit_plain(&fit.unknowns, fit.x.as_slice())?);
        let small = (0..evidence.len()).filter(|n| self.load_error(*n) <= most).map(|n| evidence[n]);
        Some(evidence[level] - small.fold(f64::NEG_INFINITY, f64::max))
    }

    /// ln evidence at every level of a linear form without common errors.
    fn evidence(&self, plain: &Fit) -> Vec<f64> {
        let (rows, products) = rows_and_products(&plain.jacobian, &plain.residuals);
        let at = |problem: &Problem<'_>| {
            let left = &products - squared(&problem.whitener.lost(&rows));
            ln_evidence(&left, &plain.x, problem.whitener.log_determinant).unwrap_or(f64::NEG_INFINITY)
        };
        self.problems.par_iter().map(at).collect()
    }
}

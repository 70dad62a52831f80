//! Evidence of sets with their amplitudes eliminated: one more member, at any scale, costs no more than its own columns.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{Evidence, Linear, Set, ln_determinant};

/// A set in the linear model, with its amplitudes eliminated beside the declared values.
pub struct Eliminated {
    /// Wanted family, column, prior scale.
    columns: Vec<(usize, usize, f64)>,
    /// Of the Cholesky factorisation of what is known of the amplitudes, in units of their priors.
    lower: DMatrix<f64>,
    /// What readings say of them, solved by it.
    slope: DVector<f64>,
    ln_determinant: f64,
    /// Squared whitened residuals.
    rest: f64,
    ln_prior: f64,
    level: usize,
    scatter: usize,
}

impl Linear {
    /// Squared whitened readings that declared values leave.
    fn left_by_declared(&self, level: usize, scatter: usize) -> f64 {
        let (p, data) = (&self.products[level], self.starts[self.wanted.len()]);
        p.with_held[(p.held.nrows() - 1, data)] - p.taken[scatter].0.column(data).norm_squared()
    }

    /// Inner product of two columns at their scales, of what declared values leave of them.
    fn beyond_declared(&self, s: &Eliminated, a: (usize, usize, f64), b: (usize, usize, f64)) -> f64 {
        let p = &self.products[s.level];
        let taken = &p.taken[s.scatter].0;
        (self.product(p, (a.0, a.1), (b.0, b.1)) - taken.column(a.1).dot(&taken.column(b.1))) * a.2 * b.2
    }

    /// The same of a column and the readings.
    fn slope_beyond_declared(&self, s: &Eliminated, (_, column, scale): (usize, usize, f64)) -> f64 {
        let (p, data) = (&self.products[s.level], self.starts[self.wanted.len()]);
        let taken = &p.taken[s.scatter].0;
        (p.with_held[(p.held.nrows() - 1, column)] - taken.column(column).dot(&taken.column(data))) * scale
    }
}

impl Evidence<'_> {
    /// ln evidence of a set, with the priors of its members. The variance of the noise is known from so many degrees of
    /// freedom only, so that the readings are Student, not normal.
    pub fn ln_evidence(&self, l: &Linear, set: &Set) -> f64 {
        let ln = |eliminated: Eliminated| self.ln_of(l, &eliminated, eliminated.ln_determinant, eliminated.rest);
        self.eliminated(l, set).map_or(f64::NEG_INFINITY, ln)
    }

    /// The same from ln of the determinant of what is known of the amplitudes, and what they leave.
    fn ln_of(&self, l: &Linear, s: &Eliminated, ln_determinant: f64, rest: f64) -> f64 {
        let ln_declared = l.products[s.level].taken[s.scatter].1;
        -0.5 * (ln_determinant + ln_declared + self.misfit(rest.max(f64::MIN_POSITIVE))) + s.ln_prior
    }

    /// ln of the prior weight of a member.
    fn ln_prior(&self, family: usize) -> f64 {
        self.families[family].ln_prior - (self.rules.block_scales.len() as f64).ln()
    }

    /// Columns of some members in [`Linear`]: wanted family, column, prior scale.
    fn columns(l: &Linear, members: &[(usize, f64)]) -> Option<Vec<(usize, usize, f64)>> {
        let mut columns = Vec::new();
        for (family, scale) in members {
            let at = l.position(*family)?;
            columns.extend((l.starts[at]..l.starts[at + 1]).map(|column| (at, column, *scale)));
        }
        Some(columns)
    }

    /// A set with its amplitudes eliminated.
    fn eliminated(&self, l: &Linear, set: &Set) -> Option<Eliminated> {
        let ln_prior =
            self.rules.ln_prior_of_scatter * set.scatter as f64 + self.rules.ln_prior_of_level * set.level as f64;
        let mut eliminated = Eliminated {
            columns: Self::columns(l, &set.members)?,
            lower: DMatrix::zeros(0, 0),
            slope: DVector::zeros(0),
            ln_determinant: 0.0,
            rest: l.left_by_declared(set.level, set.scatter),
            ln_prior: ln_prior + set.members.iter().map(|(family, _)| self.ln_prior(*family)).sum::<f64>(),
            level: set.level,
            scatter: set.scatter,
        };
        let n = eliminated.columns.len();
        let mut information = DMatrix::identity(n, n);
        for i in 0..n {
            for j in 0..=i {
                information[(i, j)] += l.beyond_declared(&eliminated, eliminated.columns[i], eliminated.columns[j]);
                information[(j, i)] = information[(i, j)];
            }
        }
        let slope = DVector::from_fn(n, |i, _| l.slope_beyond_declared(&eliminated, eliminated.columns[i]));
        let chol = information.cholesky()?;
        eliminated.ln_determinant = ln_determinant(&chol);
        eliminated.lower = chol.l();
        eliminated.slope = eliminated.lower.solve_lower_triangular(&slope)?;
        eliminated.rest -= eliminated.slope.norm_squared();
        Some(eliminated)
    }

    /// A set and one more member, at its best scale: the other amplitudes are eliminated once for all scales.
    fn with_member(&self, l: &Linear, eliminated: &Eliminated, family: usize) -> Option<(f64, f64)> {
        let own = Self::columns(l, &[(family, 1.0)])?;
        let k = own.len();
        let across = DMatrix::from_fn(eliminated.columns.len(), k, |i, j| {
            l.beyond_declared(eliminated, eliminated.columns[i], own[j])
        });
        let across = eliminated.lower.solve_lower_triangular(&across)?;
        let mut left = -across.tr_mul(&across);
        for i in 0..k {
            for j in 0..=i {
                left[(i, j)] += l.beyond_declared(eliminated, own[i], own[j]);
                left[(j, i)] = left[(i, j)];
            }
        }
        let slope =
            DVector::from_fn(k, |i, _| l.slope_beyond_declared(eliminated, own[i])) - across.tr_mul(&eliminated.slope);
        let at = |scale: f64| {
            let chol = (&left * (scale * scale) + DMatrix::identity(k, k)).cholesky()?;
            let step = chol.l_dirty().solve_lower_triangular(&(&slope * scale))?;
            let (ln_determinant, rest) =
                (eliminated.ln_determinant + ln_determinant(&chol), eliminated.rest - step.norm_squared());
            Some((self.ln_of(l, eliminated, ln_determinant, rest) + self.ln_prior(family), scale))
        };
        self.rules.block_scales.iter().filter_map(|scale| at(*scale)).max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// A set without one of its members, for [`best_member`](Self::best_member): at every level.
    pub fn without_member(&self, l: &Linear, rest: &Set) -> Vec<Option<Eliminated>> {
        (0..self.whiteners.len())
            .into_par_iter()
            .map(|level| self.eliminated(l, &Set { level, ..rest.clone() }))
            .collect()
    }

    /// The best scale of a member beside others, and level: ln evidence, scale, level.
    pub fn best_member(&self, l: &Linear, others: &[Option<Eliminated>], family: usize) -> (f64, f64, usize) {
        // side by side, as a block with columns for each pose takes as long as all others together
        let of = |eliminated: &Option<Eliminated>| {
            let eliminated = eliminated.as_ref()?;
            self.with_member(l, eliminated, family).map(|(ln, scale)| (ln, scale, eliminated.level))
        };
        let tried: Vec<(f64, f64, usize)> = others.par_iter().filter_map(of).collect();
        let none = (f64::NEG_INFINITY, self.rules.block_scales[0], 0);
        tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or(none)
    }

    /// -2 ln of how likely readings are that leave so much, but for a constant. People declare a sensor's noise, or its resolution, and what
    /// they read scatters more: declared noise may be greater than it is said to be, and not less.
    fn misfit(&self, rest: f64) -> f64 {
        let count = self.observed.len() as f64;
        if !self.is_declared {
            (self.dof + count) * (rest / self.dof).ln_1p()
        } else if rest <= count {
            rest
        } else {
            count + (self.dof + count) * ((self.dof + rest) / (self.dof + count)).ln()
        }
    }

    /// The best scale of one member, and level, for a set.
    pub(super) fn best_scale(&self, l: &Linear, set: &Set, member: usize) -> (f64, Set) {
        let others = self.without_member(l, &set.without(member));
        let (ln, scale, level) = self.best_member(l, &others, set.members[member].0);
        let mut set = Set { level, ..set.clone() };
        set.members[member].1 = scale;
        (ln, set)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::{Block, Family, PlaceModel, Products, State, held};
    use super::*;
    use crate::places::AtState;
    use crate::rules::Rules;

    /// The linear model is given as it is.
    struct NoModel;

    impl PlaceModel for NoModel {
        fn declared(&self) -> usize {
            3
        }

        fn blocks(&self) -> &[Block] {
            &[]
        }

        fn at<'a>(&'a self, _: &State) -> Option<Box<dyn AtState + 'a>> {
            None
        }
    }

    /// ln of the probability of readings of such a covariance, but for a constant.
    fn of_covariance(data: &DVector<f64>, columns: &[(&DMatrix<f64>, f64)]) -> f64 {
        let mut covariance = DMatrix::identity(data.len(), data.len());
        columns.iter().for_each(|(c, scale)| covariance += *c * c.transpose() * (scale * scale));
        let chol = covariance.cholesky().unwrap();
        -0.5 * (ln_determinant(&chol) + data.dot(&chol.solve(data)))
    }

    #[test]
    fn evidence_is_that_of_the_covariance_whichever_member_comes_last() {
        let mut rng = fastrand::Rng::with_seed(5);
        let mut matrix = |columns: usize| DMatrix::from_fn(12, columns, |_, _| 2.0 * rng.f64() - 1.0);
        let (declared, a, b) = (matrix(3), matrix(4), matrix(2));
        let data: DVector<f64> = matrix(1).column(0).into();
        let rules = Rules::DEFAULT;
        let held = held(&declared, &[(0, a.clone())], &data);
        let wanted =
            DMatrix::from_columns(&a.column_iter().chain(b.column_iter()).chain([data.column(0)]).collect::<Vec<_>>());
        let of_scatter = |s: &f64| {
            let chol = (declared.tr_mul(&declared) * (s * s) + DMatrix::identity(3, 3)).cholesky().unwrap();
            let taken = chol.l().solve_lower_triangular(&(declared.tr_mul(&wanted) * *s)).unwrap();
            (taken, ln_determinant(&chol))
        };
        let linear = Linear {
            wanted: vec![0, 1],
            starts: vec![0, 4, 6],
            held_at: vec![Some(3), None],
            products: vec![Products {
                held: held.tr_mul(&held),
                with_held: held.tr_mul(&wanted),
                own: vec![a.tr_mul(&a), b.tr_mul(&b)],
                taken: rules.declared_scatters.iter().map(of_scatter).collect(),
            }],
            parts: BTreeMap::new(),
            members: vec![(0, a.clone())],
            declared: 3,
        };
        let families = [0.4, -0.7].map(|ln_prior| Family { block: 0, combinations: None, ln_prior });
        let evidence = Evidence {
            model: &NoModel,
            whiteners: Vec::new(),
            dof: 30.0,
            is_declared: true,
            observed: &data,
            rules: &rules,
            families: families.to_vec(),
        };
        let sd = rules.declared_scatters[1];
        let prior = |members: &[usize]| -> f64 {
            rules.ln_prior_of_scatter + members.iter().map(|f| evidence.ln_prior(*f)).sum::<f64>()
        };
        let alone = Set { members: vec![(0, 0.3)], level: 0, scatter: 1 };
        let expected = of_covariance(&data, &[(&declared, sd), (&a, 0.3)]) + prior(&[0]);
        assert!((evidence.ln_evidence(&linear, &alone) - expected).abs() < 1e-9);
        // the second member at each of the scales, by the dense covariance
        let at = |scale: f64| of_covariance(&data, &[(&declared, sd), (&a, 0.3), (&b, scale)]) + prior(&[0, 1]);
        let best = rules.block_scales.iter().map(|s| (at(*s), *s)).max_by(|x, y| x.0.total_cmp(&y.0)).unwrap();
        let eliminated = evidence.eliminated(&linear, &alone).unwrap();
        let (ln, scale) = evidence.with_member(&linear, &eliminated, 1).unwrap();
        assert!((ln - best.0).abs() < 1e-9 && scale == best.1, "{ln} at {scale}, expected {best:?}");
        let both = evidence.ln_evidence(&linear, &alone.with(1, scale));
        assert!((both - ln).abs() < 1e-9, "{both} and {ln}");
    }
}

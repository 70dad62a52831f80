//! Which candidates the readings cannot tell from one another.

use nalgebra::DMatrix;

use crate::fit::Fit;
use crate::screening::Columns;
use crate::search::Ranked;

/// Whether two candidates have the same signal, as far as the readings and the other unknowns let it be seen.
pub(crate) fn indistinguishable(fit: &Fit, a: &Columns, b: &Columns, min_share: f64) -> bool {
    let (a, b) = (&a.matrix, &b.matrix);
    let (na, nb) = (a.ncols(), b.ncols());
    if na == 0 || nb == 0 {
        return false;
    }
    let mut both = DMatrix::zeros(a.nrows(), na + nb);
    both.columns_mut(0, na).copy_from(a);
    both.columns_mut(na, nb).copy_from(b);
    let g = fit.remaining(&both);
    let share = |own: std::ops::Range<usize>, other: std::ops::Range<usize>| {
        let jj = g.view((own.start, own.start), (own.len(), own.len())).clone_owned();
        let kk = g.view((other.start, other.start), (other.len(), other.len())).clone_owned();
        let jk = g.view((own.start, other.start), (own.len(), other.len())).clone_owned();
        let trace = jj.trace();
        let inverse = kk.clone().pseudo_inverse(1e-6 * kk.trace().max(1e-12));
        inverse.map_or(0.0, |inverse| (&jk * inverse * jk.transpose()).trace() / trace.max(1e-12))
    };
    share(0..na, na..na + nb) >= min_share && share(na..na + nb, 0..na) >= min_share
}

/// The candidates that are one with the chosen one, and the probability of them all against the others.
pub(crate) fn class_of(
    ranking: &[&Ranked],
    chosen: usize,
    top: f64,
    same: impl Fn(&Ranked) -> bool,
) -> (Vec<usize>, f64) {
    let others = ranking.iter().enumerate().filter(|(i, r)| *i != chosen && r.rejected.is_none() && same(r));
    let class: Vec<usize> = others.map(|(_, r)| r.candidate).collect();
    let weight = |r: &Ranked| r.gain.map_or(0.0, |g| (0.5 * (g - top)).exp());
    let all: f64 = ranking.iter().map(|r| weight(r)).sum();
    let is_in = |(i, r): &(usize, &&Ranked)| *i == chosen || class.contains(&r.candidate);
    let in_class: f64 = ranking.iter().enumerate().filter(is_in).map(|(_, r)| weight(r)).sum();
    (class, in_class / all)
}

//! What to measure next, to tell rivals apart.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::extend::extended;
use crate::fit::Fit;
use crate::levels::Levels;
use crate::model::ForwardModel;
use crate::search::{Ranked, Search};

/// A rival: a fit and its name.
pub struct Rival {
    /// As in files.
    pub name: String,
    /// With it.
    pub fit: Fit,
}

/// One proposed measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Proposal {
    /// Which of the conditions that could be measured.
    pub condition: usize,
    /// The two rivals that it tells apart best.
    pub separates: [usize; 2],
}

/// Step of the derivatives, in units of the priors.
const STEP: f64 = 1e-3;

/// Predictions of a rival under all conditions and their derivatives, in units of the noise.
struct Linear {
    values: Vec<f64>,
    slopes: Vec<Vec<f64>>,
    channels: usize,
}

impl Linear {
    fn new(model: &dyn ForwardModel, fit: &Fit, scale: &[f64]) -> Option<Self> {
        let channels = scale.len();
        let at = |x: &[f64]| -> Option<Vec<f64>> {
            let mut found = model.predict(&fit.unknowns, x)?;
            found.iter_mut().enumerate().for_each(|(n, v)| *v *= scale[n % channels]);
            Some(found)
        };
        let x = fit.x.as_slice();
        let slope = |k: usize| -> Option<Vec<f64>> {
            let mut moved = x.to_vec();
            moved[k] += STEP;
            let high = at(&moved)?;
            moved[k] -= 2.0 * STEP;
            let low = at(&moved)?;
            Some(high.iter().zip(&low).map(|(h, l)| (h - l) / (2.0 * STEP)).collect())
        };
        let slopes: Option<Vec<Vec<f64>>> = (0..x.len()).map(slope).collect();
        Some(Self { values: at(x)?, slopes: slopes?, channels })
    }

    /// Derivatives under one condition.
    fn rows(&self, condition: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.channels, self.slopes.len(), |c, k| self.slopes[k][condition * self.channels + c])
    }

    /// Number of conditions.
    fn conditions(&self) -> usize {
        self.values.len() / self.channels
    }
}

/// Squared difference of two rivals under a condition, in units of noise and of what their unknowns leave open.
fn separation(linear: [&Linear; 2], covariances: [&DMatrix<f64>; 2], condition: usize) -> f64 {
    let channels = linear[0].channels;
    let at = |of: &Linear, c: usize| of.values[condition * channels + c];
    let d = DMatrix::from_fn(channels, 1, |c, _| at(linear[0], c) - at(linear[1], c));
    let mut s = DMatrix::identity(channels, channels);
    for (linear, covariance) in linear.iter().zip(covariances) {
        let rows = linear.rows(condition);
        s += &rows * covariance * rows.transpose();
    }
    s.cholesky().map_or(0.0, |s| (d.transpose() * s.solve(&d))[0])
}

/// Picks measurements one by one: each time the one that makes the least separated pair of rivals most different, given
/// what is known and what was picked. `model` predicts the conditions that could be measured; `scale` is one over the
/// noise of each channel, 0 for one that is not read.
pub fn propose(model: &dyn ForwardModel, scale: &[f64], rivals: &[Rival], count: usize) -> Vec<Proposal> {
    if rivals.len() < 2 {
        return Vec::new();
    }
    let linear: Option<Vec<Linear>> = rivals.par_iter().map(|r| Linear::new(model, &r.fit, scale)).collect();
    let Some(linear) = linear else { return Vec::new() };
    let mut covariances: Vec<DMatrix<f64>> = rivals.iter().map(|r| r.fit.information.inverse()).collect();
    let pairs: Vec<(usize, usize)> =
        (0..rivals.len()).flat_map(|a| (a + 1..rivals.len()).map(move |b| (a, b))).collect();
    let mut separated = vec![0.0; pairs.len()];
    let mut proposals: Vec<Proposal> = Vec::new();
    while proposals.len() < count {
        let gain = |n: usize| -> Vec<f64> {
            let of = |(a, b): &(usize, usize)| {
                separation([&linear[*a], &linear[*b]], [&covariances[*a], &covariances[*b]], n)
            };
            pairs.iter().map(of).collect()
        };
        let open: Vec<usize> =
            (0..linear[0].conditions()).filter(|n| proposals.iter().all(|p| p.condition != *n)).collect();
        let gains: Vec<Vec<f64>> = open.par_iter().map(|n| gain(*n)).collect();
        let least = |g: &[f64]| g.iter().zip(&separated).map(|(g, s)| g + s).fold(f64::INFINITY, f64::min);
        let Some(best) = (0..open.len()).max_by(|a, b| least(&gains[*a]).total_cmp(&least(&gains[*b]))) else { break };
        let n = open[best];
        let strongest = (0..pairs.len()).max_by(|a, b| gains[best][*a].total_cmp(&gains[best][*b])).unwrap_or(0);
        for (s, g) in separated.iter_mut().zip(&gains[best]) {
            *s += g;
        }
        for (linear, covariance) in linear.iter().zip(&mut covariances) {
            let rows = linear.rows(n);
            let cross = &*covariance * rows.transpose();
            let inner = DMatrix::identity(scale.len(), scale.len()) + &rows * &cross;
            if let Some(inner) = inner.cholesky() {
                *covariance -= &cross * inner.solve(&cross.transpose());
            }
        }
        let (a, b) = pairs[strongest];
        proposals.push(Proposal { condition: n, separates: [a, b] });
    }
    proposals
}

/// The best of what was tried in the first round with two rivals: what was found with its class, or the ones that came
/// nearest.
pub fn rivals(levels: &Levels<'_>, search: &Search) -> Vec<Rival> {
    let candidates = levels.plain.model.candidates();
    for round in &search.rounds {
        let mut names: Vec<(String, &Ranked)> = Vec::new();
        for ranked in round.ranking.iter().filter(|r| r.rejected.is_none()) {
            let name = candidates[ranked.candidate].name();
            if names.iter().all(|(n, _)| *n != name) {
                names.push((name, ranked));
            }
        }
        if names.len() < 2 {
            continue;
        }
        let with = |(name, ranked): (String, &Ranked)| {
            let (candidate, step) = (&candidates[ranked.candidate], &ranked.score.step);
            let fit = extended(levels, search.levels[0], &search.base, candidate, step, ranked.shape);
            fit.ok().map(|(_, fit)| Rival { name, fit })
        };
        return names.into_iter().take(levels.plain.rules.rivals).filter_map(with).collect();
    }
    Vec::new()
}

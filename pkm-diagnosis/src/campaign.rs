//! Which poses to measure before anything was read, so that amplitudes of a stated size are found.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::extend::columns;
use crate::fit::product;
use crate::model::Unknown;
use crate::solve::Problem;

/// An amplitude that is to be found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Which candidate it belongs to.
    pub candidate: usize,
    /// Its unknown.
    pub unknown: Unknown,
    /// Size to be found, in units of its prior.
    pub x: f64,
}

/// Poses in the order in which they are worth most, and what they show of each target.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaign {
    /// Poses of the problem.
    pub poses: Vec<usize>,
    /// By target: least x that is found with the first few poses, with all that were chosen, and with every pose there is.
    /// Infinite where declared values can imitate it.
    pub smallest: Vec<[f64; 3]>,
}

/// Sums over poses of what their readings tell: of the declared values, and of each target beside them.
#[derive(Clone)]
struct Told {
    /// AᵀA.
    declared: DMatrix<f64>,
    /// Aᵀc and cᵀc by target.
    targets: Vec<(DVector<f64>, f64)>,
}

impl Told {
    fn plus(&self, other: &Self) -> Self {
        let targets = self.targets.iter().zip(&other.targets);
        Self {
            declared: &self.declared + &other.declared,
            targets: targets.map(|(a, b)| (&a.0 + &b.0, a.1 + b.1)).collect(),
        }
    }

    /// λ of a unit of each target: its signal that re-identified declared values cannot take.
    fn signals(&self) -> Vec<f64> {
        let n = self.declared.nrows();
        let Some(information) = (&self.declared + DMatrix::identity(n, n)).cholesky() else {
            return vec![0.0; self.targets.len()];
        };
        self.targets.iter().map(|(cross, own)| (own - cross.dot(&information.solve(cross))).max(0.0)).collect()
    }
}

/// By how much the targets fall short of being found, in ln λ; those are left out that no set of poses shows.
fn shortfall(signals: &[f64], all: &[f64], targets: &[Target], detectable: f64) -> f64 {
    let each = signals.iter().zip(all).zip(targets).filter(|((_, all), t)| t.x * t.x * **all >= detectable);
    each.map(|((signal, _), t)| (detectable / (t.x * t.x * signal).max(f64::MIN_POSITIVE)).ln().max(0.0)).sum()
}

/// Chooses poses one by one, each time the one that brings the targets nearest to being found, until all are that can be:
/// between `least` and `most` poses. The readings of the problem stand for its plan: their values do not matter.
pub fn campaign(problem: &Problem<'_>, targets: &[Target], least: usize, most: usize) -> Option<Campaign> {
    let declared = problem.model.declared();
    let base = problem.linear(&declared, DVector::zeros(declared.len()))?;
    let candidates = problem.model.candidates();
    let column = |t: &Target| {
        let own = &candidates[t.candidate];
        let mut amplitudes = own.unknowns.iter().filter(|u| problem.parameter(**u).is_amplitude());
        let at = amplitudes.position(|u| *u == t.unknown)?;
        Some(columns(problem, &base, own)?.matrix.column(at).into_owned())
    };
    let columns: Vec<DVector<f64>> = targets.par_iter().map(column).collect::<Option<_>>()?;
    let of_pose = |rows: &Vec<usize>| {
        let a = base.jacobian.select_rows(rows);
        let target = |c: &DVector<f64>| {
            let own = c.select_rows(rows);
            (a.tr_mul(&own), own.norm_squared())
        };
        Told { declared: product(&a, &a), targets: columns.iter().map(target).collect() }
    };
    let told: Vec<Told> = problem.by_pose().par_iter().map(of_pose).collect();
    let (first, rest) = told.split_first()?;
    let all = rest.iter().fold(first.clone(), |sum, t| sum.plus(t)).signals();
    let detectable = problem.rules.detectable;
    let n = declared.len();
    let nothing = Told { declared: DMatrix::zeros(n, n), targets: vec![(DVector::zeros(n), 0.0); targets.len()] };
    let (mut sum, mut poses, mut start) = (nothing, Vec::new(), None);
    while poses.len() < most.min(told.len()) {
        let open: Vec<usize> = (0..told.len()).filter(|p| !poses.contains(p)).collect();
        let with = |p: &usize| {
            let signals = sum.plus(&told[*p]).signals();
            // of poses that miss nothing any more the one that shows most
            (shortfall(&signals, &all, targets, detectable), -signals.iter().map(|s| s.ln_1p()).sum::<f64>())
        };
        let scores: Vec<(f64, f64)> = open.par_iter().map(with).collect();
        let better =
            |a: &usize, b: &usize| scores[*a].0.total_cmp(&scores[*b].0).then(scores[*a].1.total_cmp(&scores[*b].1));
        let best = (0..open.len()).min_by(better)?;
        sum = sum.plus(&told[open[best]]);
        poses.push(open[best]);
        if poses.len() == least {
            start = Some(sum.signals());
        }
        if poses.len() >= least && scores[best].0 == 0.0 {
            break;
        }
    }
    let end = sum.signals();
    let start = start.unwrap_or_else(|| end.clone());
    let size = |signal: f64| (detectable / signal).sqrt();
    let smallest = (0..targets.len()).map(|t| [start[t], end[t], all[t]].map(size)).collect();
    Some(Campaign { poses, smallest })
}

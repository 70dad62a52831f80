//! What to measure next to tell rivals apart.

use nalgebra::DMatrix;
use pkm_core::{Pose, Wrench};
use rayon::prelude::*;

use super::noise::Noise;
use super::search::Search;
use super::solve::{Fit, Levels, Problem};
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Condition, REFERENCE_C};
use crate::pose::{PoseBox, pose_of};

/// How many measurements are proposed.
const PROPOSED: usize = 8;
/// How much wider than the box the poses may lie, half of it on either side.
const BEYOND: f64 = 0.3;
/// Levels of θ, σ and Z0 that are considered.
const LEVELS: [usize; 3] = [5, 5, 3];

/// One proposed measurement.
pub struct Proposal {
    /// Where.
    pub pose: Pose<f64>,
    /// Load at A, in A-uvw.
    pub wrench: Wrench<f64>,
    /// The two that it tells apart best.
    pub separates: [String; 2],
}

/// A rival: a fit and its name.
pub struct Contender {
    /// As in files.
    pub name: String,
    /// With it.
    pub fit: Fit,
}

/// Loads along each axis either way, as great as those that were measured, and a fifth of them: light loads tell what
/// depends on the load from what does not.
fn loads(conditions: &[Condition]) -> Vec<Wrench<f64>> {
    let largest = |pick: fn(&Wrench<f64>) -> [f64; 3]| {
        conditions.iter().flat_map(|c| pick(&c.wrench)).map(f64::abs).fold(0.0, f64::max)
    };
    let (force, moment) = (largest(|w| w.force_n), largest(|w| w.moment_nm));
    let mut loads = Vec::new();
    for axis in 0..6 {
        for sign in [1.0, -1.0] {
            let size = sign * if axis < 3 { force } else { moment };
            if size == 0.0 {
                continue;
            }
            let unit = |first: usize| std::array::from_fn(|i| if i + first == axis { size } else { 0.0 });
            loads.push(Wrench { force_n: unit(0), moment_nm: unit(3) });
        }
    }
    let light: Vec<_> = loads
        .iter()
        .map(|w| Wrench { force_n: w.force_n.map(|f| 0.2 * f), moment_nm: w.moment_nm.map(|m| 0.2 * m) })
        .collect();
    loads.extend(light);
    loads
}

/// A grid of poses over the box and somewhat beyond it, those out of travel left out.
fn poses(file: &MachineFile) -> Vec<Pose<f64>> {
    let wider = PoseBox::from(file.pose_box.ranges().map(|[low, high]| {
        let more = 0.5 * BEYOND * (high - low);
        [low - more, high + more]
    }));
    let mut poses = Vec::new();
    for i in 0..LEVELS[0] {
        for j in 0..LEVELS[1] {
            for k in 0..LEVELS[2] {
                let [theta, sigma, z0] = wider.level(LEVELS, [i, j, k]).map(|v| (v * 10.0).round() / 10.0);
                let pose = pose_of(theta, sigma, z0);
                if file.machine.inverse(&pose).is_ok() {
                    poses.push(pose);
                }
            }
        }
    }
    poses
}

/// Predictions by condition and, by unknown, their derivatives.
type Linear = (Vec<[f64; CHANNELS]>, Vec<Vec<[f64; CHANNELS]>>);

/// The linear form of a fit, in units of one over `scale`.
fn linear(
    problem: &Problem<'_>,
    fit: &Fit,
    poses: &[Pose<f64>],
    conditions: &[Condition],
    scale: [f64; CHANNELS],
) -> Option<Linear> {
    let at = |x: &[f64]| -> Option<Vec<[f64; CHANNELS]>> {
        let found = problem.model.predict(poses, conditions, &fit.unknowns, x)?;
        Some(found.into_iter().map(|d| std::array::from_fn(|c| d[c] * scale[c])).collect())
    };
    let x = fit.x.as_slice();
    let slopes: Option<Vec<_>> = (0..x.len())
        .map(|k| {
            let mut moved = x.to_vec();
            moved[k] += 1e-3;
            let (high, low) = (at(&moved)?, {
                moved[k] -= 2e-3;
                at(&moved)?
            });
            Some((high.iter().zip(&low)).map(|(h, l)| std::array::from_fn(|c| (h[c] - l[c]) / 2e-3)).collect())
        })
        .collect();
    Some((at(x)?, slopes?))
}

/// Picks measurements one by one: each time the one that makes the least separated pair of rivals most different, given
/// what is known and what was picked.
pub fn propose(problem: &Problem<'_>, noise: &Noise, file: &MachineFile, rivals: &[Contender]) -> Vec<Proposal> {
    if rivals.len() < 2 {
        return Vec::new();
    }
    let (loads, poses) = (loads(&problem.readings.conditions), poses(file));
    let conditions: Vec<Condition> = (0..poses.len())
        .flat_map(|pose| {
            loads.iter().map(move |wrench| Condition {
                pose,
                wrench: *wrench,
                point_m: [0.0; 3],
                turned_at: Wrench::ZERO,
                temperature_c: REFERENCE_C,
                rise_k: 0.0,
            })
        })
        .collect();
    // every rival's predictions and their derivatives, in units of the noise
    let used = problem.readings.channels();
    let scale: [f64; CHANNELS] = std::array::from_fn(|c| {
        if used[c] { 1.0 / (noise.within[c].powi(2) + noise.between[c].powi(2)).sqrt() } else { 0.0 }
    });
    let linear: Option<Vec<Linear>> =
        rivals.par_iter().map(|rival| linear(problem, &rival.fit, &poses, &conditions, scale)).collect();
    let Some(linear) = linear else { return Vec::new() };
    let mut covariances: Vec<DMatrix<f64>> = rivals.iter().map(|r| r.fit.information.inverse()).collect();
    let rows = |rival: usize, n: usize| {
        let slopes = &linear[rival].1;
        DMatrix::from_fn(CHANNELS, slopes.len(), |c, k| slopes[k][n][c])
    };
    let pairs: Vec<(usize, usize)> =
        (0..rivals.len()).flat_map(|a| (a + 1..rivals.len()).map(move |b| (a, b))).collect();
    let mut separated = vec![0.0; pairs.len()];
    let mut taken: Vec<usize> = Vec::new();
    let mut proposals = Vec::new();
    while proposals.len() < PROPOSED {
        let gain = |n: usize| -> Vec<f64> {
            pairs
                .iter()
                .map(|(a, b)| {
                    let d = DMatrix::from_fn(CHANNELS, 1, |c, _| linear[*a].0[n][c] - linear[*b].0[n][c]);
                    let mut s = DMatrix::identity(CHANNELS, CHANNELS);
                    for rival in [*a, *b] {
                        let rows = rows(rival, n);
                        s += &rows * &covariances[rival] * rows.transpose();
                    }
                    s.cholesky().map_or(0.0, |s| (d.transpose() * s.solve(&d))[0])
                })
                .collect()
        };
        let open: Vec<usize> = (0..conditions.len()).filter(|n| !taken.contains(n)).collect();
        let gains: Vec<Vec<f64>> = open.par_iter().map(|n| gain(*n)).collect();
        let least = |g: &[f64]| g.iter().zip(&separated).map(|(g, s)| g + s).fold(f64::INFINITY, f64::min);
        let Some(best) = (0..open.len()).max_by(|a, b| least(&gains[*a]).total_cmp(&least(&gains[*b]))) else { break };
        let n = open[best];
        taken.push(n);
        let strongest = (0..pairs.len()).max_by(|a, b| gains[best][*a].total_cmp(&gains[best][*b])).unwrap_or(0);
        let (a, b) = pairs[strongest];
        for (s, g) in separated.iter_mut().zip(&gains[best]) {
            *s += g;
        }
        for (rival, covariance) in covariances.iter_mut().enumerate() {
            let rows = rows(rival, n);
            let cross = &*covariance * rows.transpose();
            let inner = DMatrix::identity(CHANNELS, CHANNELS) + &rows * &cross;
            if let Some(inner) = inner.cholesky() {
                *covariance -= &cross * inner.solve(&cross.transpose());
            }
        }
        proposals.push(Proposal {
            pose: poses[conditions[n].pose],
            wrench: conditions[n].wrench,
            separates: [rivals[a].name.clone(), rivals[b].name.clone()],
        });
    }
    proposals
}

/// The best of what was tried in the round that settled most, as contenders: what was found with its class, or the two that
/// came nearest.
pub fn contenders(levels: &Levels<'_>, search: &Search) -> Vec<Contender> {
    let mut contenders = Vec::new();
    for round in &search.rounds {
        let mut names: Vec<(String, &super::search::Ranked)> = Vec::new();
        for ranked in round.ranking.iter().filter(|r| r.rejected.is_none()) {
            let name = ranked.candidate.names(levels.plain).join(" + ");
            if names.iter().all(|(n, _)| *n != name) {
                names.push((name, ranked));
            }
        }
        if names.len() < 2 {
            continue;
        }
        for (name, ranked) in names.into_iter().take(3) {
            let from = (&search.base, &ranked.candidate, &ranked.score.step);
            if let Ok((_, fit)) =
                super::search::extended(levels, search.levels[0], from.0, from.1, from.2, ranked.shape)
            {
                contenders.push(Contender { name, fit });
            }
        }
        break;
    }
    contenders
}

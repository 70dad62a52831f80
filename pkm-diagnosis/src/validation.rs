//! Errors of predictions on readings that had no part in choosing the model.

use rayon::prelude::*;

use crate::noise::Noise;
use crate::observations::Observations;
use crate::rules::{Rules, SEED};

/// Errors of one model on the channels of one kind, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct KindErrors {
    /// Root mean square over readings of the length of the error.
    pub rms: f64,
    /// 95 % interval of that over all poses of the kind that were taken, by resampling these, if they are enough.
    pub rms_interval: Option<[f64; 2]>,
    /// Greatest length of the error.
    pub max: f64,
    /// `rms` over the root mean square of the readings, in percent.
    pub percent: f64,
}

/// Errors of one model on some readings.
#[derive(Clone, Debug)]
pub struct Errors {
    /// Readings.
    pub readings: usize,
    /// By kind of channel.
    pub kinds: Vec<KindErrors>,
    /// Squared error over the noise, by scalar observation.
    pub chi2_per_dof: f64,
}

/// Sums over the readings of one kind of channel.
#[derive(Clone)]
struct Sums {
    /// Squared errors and readings, by pose.
    by_pose: Vec<(f64, f64)>,
    /// Readings that have one of its channels.
    count: usize,
    errors: f64,
    sizes: f64,
    largest: f64,
}

/// Errors of predictions, given by condition and channel, on some of the readings.
pub fn errors(
    observations: &Observations,
    noise: &Noise,
    predictions: &[f64],
    of: impl Fn(usize) -> bool,
    rules: &Rules,
) -> Option<Errors> {
    let (channels, kinds) = (&observations.channels, observations.kinds());
    let none =
        Sums { by_pose: vec![(0.0, 0.0); observations.poses()], count: 0, errors: 0.0, sizes: 0.0, largest: 0.0 };
    let mut sums = vec![none; kinds];
    let (mut count, mut chi2, mut numbers) = (0_usize, 0.0, 0.0);
    for (n, r) in observations.readings.iter().enumerate().filter(|(n, _)| of(*n)) {
        let found = &predictions[r.condition * channels.len()..][..channels.len()];
        let mut squares: Vec<Option<(f64, f64)>> = vec![None; kinds];
        for (c, channel) in channels.iter().enumerate() {
            let Some(observed) = r.observed[c] else { continue };
            let error = found[c] - observed;
            let (of_errors, of_sizes) = squares[channel.kind].get_or_insert_default();
            *of_errors += error * error;
            *of_sizes += observed * observed;
            chi2 += error * error / noise.variance_of(observations, n, c);
            numbers += 1.0;
        }
        count += 1;
        for (sums, squares) in sums.iter_mut().zip(squares) {
            let Some((error, size)) = squares else { continue };
            sums.count += 1;
            sums.errors += error;
            sums.sizes += size;
            sums.largest = sums.largest.max(error);
            let pose = &mut sums.by_pose[observations.pose(r)];
            pose.0 += error;
            pose.1 += 1.0;
        }
    }
    if count == 0 {
        return None;
    }
    let of_kind = |mut sums: Sums| {
        sums.by_pose.retain(|p| p.1 > 0.0);
        KindErrors {
            rms: (sums.errors / sums.count.max(1) as f64).sqrt(),
            rms_interval: interval(&sums.by_pose, rules).map(|i| i.map(f64::sqrt)),
            max: sums.largest.sqrt(),
            percent: if sums.sizes > 0.0 { 100.0 * (sums.errors / sums.sizes).sqrt() } else { 0.0 },
        }
    };
    let kinds = sums.into_iter().map(of_kind).collect();
    Some(Errors { readings: count, kinds, chi2_per_dof: chi2 / numbers })
}

/// ln of the mean of squared errors, given by pose as their sum and count, and its standard error but for a factor that
/// follows from the number of poses, and cancels.
fn log_mean(poses: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let (sum, count) = poses.clone().fold((0.0, 0.0), |(s, c), p| (s + p.0, c + p.1));
    let mean = sum / count;
    let scatter: f64 = poses.map(|p| (p.0 - mean * p.1).powi(2)).sum();
    (mean.ln(), scatter.sqrt() / sum)
}

/// 95 % interval of the mean of squared errors by resampling poses, studentised, on the logarithm: plain quantiles of
/// resampled means cover too little with some twenty poses of which a few err most.
fn interval(by_pose: &[(f64, f64)], rules: &Rules) -> Option<[f64; 2]> {
    if by_pose.len() < rules.min_resampled_poses {
        return None;
    }
    let (middle, error) = log_mean(by_pose.iter().copied());
    let mut rng = fastrand::Rng::with_seed(SEED);
    let mut studentised: Vec<f64> = (0..rules.resamples)
        .map(|_| {
            let drawn: Vec<(f64, f64)> = (0..by_pose.len()).map(|_| by_pose[rng.usize(..by_pose.len())]).collect();
            let (there, error) = log_mean(drawn.iter().copied());
            (there - middle) / error
        })
        .filter(|t| t.is_finite())
        .collect();
    studentised.sort_by(f64::total_cmp);
    let quantile = |q: f64| studentised.get((q * studentised.len() as f64) as usize);
    let (low, high) = (quantile(0.975)?, quantile(0.025)?);
    Some([low, high].map(|t| (middle - t * error).exp()))
}

/// Folds of a cross-validation.
pub fn folds(observations: &Observations, rules: &Rules) -> usize {
    let poses = observations.poses();
    let of_so_many = rules.folds.iter().rev().find(|(_, least)| poses >= *least);
    of_so_many.map_or(1, |(folds, _)| *folds).min(poses)
}

/// The fold that leaves each pose out, drawn: every fifth pose of a grid may be a whole plane of it, which a model would have to
/// extrapolate to.
pub fn fold_of(observations: &Observations, rules: &Rules) -> Vec<usize> {
    let folds = folds(observations, rules);
    let mut fold_of: Vec<usize> = (0..observations.poses()).map(|pose| pose % folds).collect();
    fastrand::Rng::with_seed(SEED).shuffle(&mut fold_of);
    fold_of
}

/// Most readings of which three folds are made at once.
const MAX_READINGS_AT_ONCE: usize = 20_000;

/// Which poses are left out.
pub type LeftOut<'a> = dyn Fn(usize) -> bool + 'a;

/// Predictions for every condition from models that have not seen its pose. `refit` chooses and fits models without the poses
/// that it is told and predicts all conditions, one table of predictions a model; what else it says is returned fold by fold. Of few
/// readings three folds are made side by side, as a search alone keeps two cores busy for some of the time only; more would take more
/// memory.
pub fn cross_validate<E: Send>(
    observations: &Observations,
    rules: &Rules,
    refit: impl Fn(&LeftOut<'_>) -> Option<(Vec<Vec<f64>>, E)> + Sync,
) -> Option<(Vec<Vec<f64>>, Vec<E>)> {
    let channels = observations.channels.len();
    let (folds, fold_of) = (folds(observations, rules), fold_of(observations, rules));
    let without = |fold: usize| refit(&|pose| fold_of[pose] == fold);
    let mut found: Vec<(Vec<Vec<f64>>, E)> = Vec::new();
    // many readings keep the cores busy: searches at once take half as much memory again and hardly less time
    let at_once = if observations.readings.len() > MAX_READINGS_AT_ONCE { 1 } else { 3 };
    for first in (0..folds).step_by(at_once) {
        let these: Option<Vec<_>> = (first..folds.min(first + at_once)).into_par_iter().map(without).collect();
        found.extend(these?);
    }
    let mut all: Vec<Vec<f64>> = found.first()?.0.clone();
    for (fold, (found, _)) in found.iter().enumerate() {
        for (all, found) in all.iter_mut().zip(found) {
            for (n, _) in observations.pose_of.iter().enumerate().filter(|(_, pose)| fold_of[**pose] == fold) {
                let own = n * channels..(n + 1) * channels;
                all[own.clone()].copy_from_slice(&found[own]);
            }
        }
    }
    Some((all, found.into_iter().map(|f| f.1).collect()))
}

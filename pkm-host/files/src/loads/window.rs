//! What a log says around a time.

use std::ops::Range;

use pkm_diagnosis::robust::MEDIAN_OF_NORMAL;

use crate::load_log::Sample;

/// Parts of a window that are compared to see whether the load was at rest.
const PARTS: usize = 5;

/// The samples of a window.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Their places in the log.
    pub samples: Range<usize>,
    /// Mean of each component, N and N·m.
    pub mean: [f64; 6],
    /// Standard deviation of a single sample; 0 for one.
    pub sd: [f64; 6],
    /// Greatest difference of the means of parts of the window.
    pub drift: [f64; 6],
}

/// Places of the samples from one time to another.
pub(super) fn between(samples: &[Sample], from_s: f64, to_s: f64) -> Range<usize> {
    let at = |time_s: f64, with: bool| samples.partition_point(|s| s.time_s < time_s || (with && s.time_s <= time_s));
    // a clock in seconds since 1970 has steps of some tenths of a microsecond
    at(from_s - 1e-6, false)..at(to_s + 1e-6, true)
}

fn mean(samples: &[Sample]) -> [f64; 6] {
    std::array::from_fn(|c| samples.iter().map(|s| s.load[c]).sum::<f64>() / samples.len() as f64)
}

impl Window {
    /// Of samples, at least one.
    pub fn of(log: &[Sample], samples: Range<usize>) -> Self {
        let own = &log[samples.clone()];
        let mean_of_all = mean(own);
        let deviation = |c: usize| {
            let squares: f64 = own.iter().map(|s| (s.load[c] - mean_of_all[c]).powi(2)).sum();
            (squares / (own.len() - 1).max(1) as f64).sqrt()
        };
        let means: Vec<[f64; 6]> = own.chunks(own.len().div_ceil(PARTS)).map(mean).collect();
        let drift = |c: usize| {
            let of = means.iter().map(|m| m[c]);
            of.clone().fold(f64::NEG_INFINITY, f64::max) - of.fold(f64::INFINITY, f64::min)
        };
        Self { samples, mean: mean_of_all, sd: std::array::from_fn(deviation), drift: std::array::from_fn(drift) }
    }
}

/// Least step of each component's numbers, 0 where all are the same: a scatter below is that of rounding.
pub(super) fn steps(samples: &[Sample]) -> [f64; 6] {
    std::array::from_fn(|c| {
        let mut all: Vec<f64> = samples.iter().map(|s| s.load[c]).collect();
        all.sort_by(f64::total_cmp);
        let least = all.windows(2).map(|w| w[1] - w[0]).filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 0.0 }
    })
}

/// Standard deviation of each component by its differences from one sample to the next, most of which see no change of the load.
pub(super) fn jitter(samples: &[Sample]) -> [f64; 6] {
    std::array::from_fn(|c| {
        let differences = samples.windows(2).map(|w| (w[1].load[c] - w[0].load[c]).abs()).collect();
        super::median(differences) / (MEDIAN_OF_NORMAL * 2.0_f64.sqrt())
    })
}

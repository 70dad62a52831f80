//! Numbers that are read in steps coarser than they scatter. Repeats are rounded alike, so that their mean is no surer than one of them,
//! and what is lost of a number depends on the number. What such a number says is that it lies within its step.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use crate::noise::Noise;
use crate::observations::Observations;

/// Terms of a Fourier series, which are less than 1/k²; bisections of its inverse.
const TERMS: i32 = 50;
const BISECTIONS: usize = 40;

/// Scatter from which on rounding is but noise, in steps.
const MAX_SCATTER: f64 = 0.35;

/// Least scatter that is reckoned with, in steps: a model is not surer than that of where in its step a number lies.
const MIN_SCATTER: f64 = 0.05;

/// Scatter of repeats which, once rounded, scatter by a step/√12, in steps.
const SCATTER_OF_ROUNDING: f64 = 0.1475;

/// Points that an integral over a step and what is beside it is a sum of, and the width beside it in standard deviations.
const POINTS: usize = 400;
const BESIDE: f64 = 6.0;

/// Least probability of a step that its logarithm's slope is taken of.
const MIN_PROBABILITY: f64 = 1e-9;

/// Variance of rounded numbers that scatter by `sd` about one place, averaged over places, all in steps: a step's own less that of what
/// all are rounded by alike, a sawtooth of the place, averaged over normal scatter (its Fourier series).
fn variance_when_rounded(sd: f64) -> f64 {
    let alike = |k: i32| {
        let wave = 2.0 * PI * f64::from(k);
        2.0 * (-(wave * sd).powi(2)).exp() / wave.powi(2)
    };
    sd * sd + 1.0 / 12.0 - (1..=TERMS).map(alike).sum::<f64>()
}

/// Deviation of repeats before they are rounded to a step, by that after it, of so many degrees of freedom. One more pair than was seen
/// is taken to differ, so that few repeats that never do are not taken for free of scatter.
pub(crate) fn of_repeats(sd: f64, freedom: f64, step: f64) -> f64 {
    if step <= 0.0 {
        return sd;
    }
    let rounded = (sd / step).powi(2) + 0.5 / freedom.max(1.0);
    let (mut low, mut high) = (0.0, rounded.sqrt());
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        *if variance_when_rounded(middle) < rounded { &mut low } else { &mut high } = middle;
    }
    step * high
}

/// The same of a declared deviation. One that is less than repeats with that of rounding alone have is declared without rounding; beyond
/// that it has rounding in it.
pub(crate) fn of_declared(sd: f64, step: f64) -> f64 {
    let without_rounding = (sd * sd - step * step / 12.0).max(0.0).sqrt();
    sd.min(SCATTER_OF_ROUNDING * step).max(without_rounding)
}

/// Probability that a number rounds to 0 which scatters by `sd` about a place, and the slope of that over the place, all in steps.
fn probability(place: f64, sd: f64) -> (f64, f64) {
    let [low, high] = [-0.5, 0.5].map(|end: f64| (end - place) / sd);
    let below = |z: f64| 0.5 * libm::erfc(-z * FRAC_1_SQRT_2);
    let density = |z: f64| (-0.5 * z * z).exp() / (2.0 * PI).sqrt();
    (below(high) - below(low), (density(low) - density(high)) / sd)
}

/// What a rounded number tells of the place about which it scatters by `sd`, averaged over places: one over a variance (Fisher
/// information), all in steps.
fn information(sd: f64) -> f64 {
    let width = 1.0 + 2.0 * BESIDE * sd;
    let at = |n: usize| width * ((n as f64 + 0.5) / POINTS as f64 - 0.5);
    let of = |(p, slope): (f64, f64)| if p > MIN_PROBABILITY { slope * slope / p } else { 0.0 };
    (0..POINTS).map(|n| of(probability(at(n), sd))).sum::<f64>() * width / POINTS as f64
}

/// Channels that are read in steps coarser than they scatter, and by how much they do before they are rounded, in steps.
pub fn coarse(observations: &Observations, noise: &Noise) -> Vec<(usize, f64)> {
    let steps = observations.channels.iter().map(|c| c.resolution).enumerate();
    let read = steps.filter(|(c, step)| noise.within[*c] > 0.0 && *step > 0.0);
    let scatters = read.map(|(c, step)| (c, (noise.unrounded[c] / step).max(MIN_SCATTER)));
    scatters.filter(|(_, sd)| *sd < MAX_SCATTER).collect()
}

/// Pseudo-observations, and their noise, that say of a model near one that gives `said`, by condition and channel, what the rounded ones do: a
/// number is off that by the slope of its probability, as a normal one would be, but by no more than it was read off it, or a step. `None` where nothing
/// is read in coarse steps.
pub fn unrounded(observations: &Observations, noise: &Noise, said: &[f64]) -> Option<(Observations, Noise)> {
    let channels = observations.channels.len();
    let step = |c: usize| observations.channels[c].resolution;
    let coarse = coarse(observations, noise);
    if coarse.is_empty() {
        return None;
    }
    let (mut pseudo, mut pseudo_noise) = (observations.clone(), noise.clone());
    for (c, sd) in coarse {
        let variance = 1.0 / information(sd);
        let zeros = zeros(observations, noise, said, c);
        for r in &mut pseudo.readings {
            let expected = said[r.condition * channels + c] + zeros[r.series];
            let off = |read: f64| {
                let as_read = (read - expected) / step(c);
                let (p, slope) = probability(-as_read, sd);
                let by_slope = if p > MIN_PROBABILITY { slope.abs() / p * variance } else { f64::INFINITY };
                as_read.signum() * as_read.abs().max(1.0).min(by_slope)
            };
            r.observed[c] = r.observed[c].map(|read| expected + step(c) * off(read));
        }
        pseudo_noise.within[c] = step(c) * variance.sqrt();
        // no declared deviation counts for less
        pseudo.channels[c].resolution = pseudo_noise.within[c] * 12.0_f64.sqrt();
    }
    Some((pseudo, pseudo_noise))
}

/// Zero of each series in a channel, shrunk by what is known of zeros.
fn zeros(observations: &Observations, noise: &Noise, said: &[f64], channel: usize) -> Vec<f64> {
    let series = observations.readings.iter().map(|r| r.series + 1).max().unwrap_or(0);
    let (mut sums, mut counts) = (vec![0.0; series], vec![0.0; series]);
    for r in &observations.readings {
        if let Some(read) = r.observed[channel] {
            sums[r.series] += read - said[r.condition * observations.channels.len() + channel];
            counts[r.series] += 1.0;
        }
    }
    let [own, zero] = [noise.within[channel].powi(2), noise.between[channel].powi(2)];
    sums.iter().zip(&counts).map(|(sum, count)| sum * zero / (own + count * zero)).collect()
}

//! Zeros that drift while a series is read, from what repeats of one condition differ by, without a model.

use std::collections::BTreeMap;

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::observations::Observations;
use crate::rules::Rules;

/// Zeros of a channel that drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Which.
    pub channel: usize,
    /// By how much from the first to the last reading of a series, against its repeats: with its sign where all series drift alike,
    /// else rms of them.
    pub change: f64,
    /// Whether all drift alike.
    pub is_common: bool,
    /// Series that were compared with others, or had repeats of their own.
    pub series: usize,
    /// The change over the standard deviation of a reading.
    pub over_noise: f64,
    /// Probability of as much by chance.
    pub p: f64,
}

/// Differences of repeats in one series: what a straight line over the places in the series takes of them.
struct Slope {
    /// Σ x e and Σ x² of places and differences, the zero and what is in proportion to the deflection taken out.
    inner: f64,
    places: f64,
    /// Squares that the line leaves, and their degrees of freedom.
    rest: f64,
    dof: f64,
    /// Readings from the first to the last one.
    length: f64,
}

/// A difference of two repeats, how far apart in their series they stand, and their mean.
struct Difference {
    places: f64,
    value: f64,
    mean: f64,
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Takes a direction out of a vector.
fn take_out(v: &mut [f64], direction: &[f64]) {
    let square = inner(direction, direction);
    if square > 0.0 {
        let part = inner(v, direction) / square;
        v.iter_mut().zip(direction).for_each(|(v, d)| *v -= part * d);
    }
}

impl Slope {
    /// Of the differences of a series. With another series' zero these have a constant of their own; a deflection that has become
    /// larger in proportion, such as by warmth, is no drift.
    fn new(differences: &[Difference], has_zero: bool, length: f64, rules: &Rules) -> Option<Self> {
        let column = |of: fn(&Difference) -> f64| differences.iter().map(of).collect::<Vec<f64>>();
        let (mut places, mut values) = (column(|d| d.places), column(|d| d.value));
        let mut means = column(|d| d.mean);
        let ones = vec![1.0; differences.len()];
        if has_zero {
            [&mut places, &mut values, &mut means].into_iter().for_each(|v| take_out(v, &ones));
        }
        let before = inner(&places, &places);
        take_out(&mut places, &means);
        take_out(&mut values, &means);
        let left = inner(&places, &places);
        let fitted = 2 + usize::from(has_zero);
        let are_enough = differences.len() >= fitted + rules.min_dof_of_drift;
        if !are_enough || left < rules.min_places_left * before || left <= 0.0 {
            return None;
        }
        let inner_of = inner(&places, &values);
        Some(Self {
            inner: inner_of,
            places: left,
            rest: inner(&values, &values) - inner_of * inner_of / left,
            dof: (differences.len() - fitted) as f64,
            length,
        })
    }
}

/// Drifts of the zeros, by channel, where they are significant (`max_order_p`) and larger than the noise (`min_drift_sd`). Readings
/// are taken to stand in the order in which they were read. Series are compared with the first one at their pose, and repeats within
/// a series with one another: a drift that is the same in all series of a pose is not to be seen.
pub fn drifts(observations: &Observations, rules: &Rules) -> Vec<Drift> {
    let readings = &observations.readings;
    let mut length_of: BTreeMap<usize, usize> = BTreeMap::new();
    let mut place_of = Vec::with_capacity(readings.len());
    for r in readings {
        let length = length_of.entry(r.series).or_default();
        place_of.push(*length as f64);
        *length += 1;
    }
    let mut repeats: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    readings.iter().enumerate().for_each(|(n, r)| repeats.entry(r.repeat_of).or_default().push(n));
    let channels = observations.channels.len();
    let of_channel = |channel: usize| {
        // by series, and whether its differences are those from another series
        let mut differences: BTreeMap<(usize, bool), Vec<Difference>> = BTreeMap::new();
        for group in repeats.values() {
            let read: Vec<(usize, f64)> =
                group.iter().filter_map(|n| readings[*n].observed[channel].map(|v| (*n, v))).collect();
            for (k, (n, value)) in read.iter().enumerate() {
                let series = readings[*n].series;
                let own = read[..k].iter().rev().find(|(o, _)| readings[*o].series == series);
                let other = read[..k].iter().find(|(o, _)| readings[*o].series != series);
                // a repeat in the series tells more than one beside it
                let Some((partner, partner_value)) = own.or(other) else { continue };
                let from = if own.is_some() { place_of[*partner] } else { 0.0 };
                differences.entry((series, own.is_none())).or_default().push(Difference {
                    places: place_of[*n] - from,
                    value: value - partner_value,
                    mean: 0.5 * (value + partner_value),
                });
            }
        }
        let of = |((series, has_zero), differences): (&(usize, bool), &Vec<Difference>)| {
            Slope::new(differences, *has_zero, length_of[series] as f64 - 1.0, rules)
        };
        let slopes: Vec<Slope> = differences.iter().filter_map(of).collect();
        drift(channel, &slopes, channels, rules)
    };
    (0..channels).filter_map(of_channel).collect()
}

/// Of the series of one channel together.
fn drift(channel: usize, slopes: &[Slope], channels: usize, rules: &Rules) -> Option<Drift> {
    let count = slopes.len() as f64;
    let sum = |of: fn(&Slope) -> f64| slopes.iter().map(of).sum::<f64>();
    let (rest, dof) = (sum(|s| s.rest), sum(|s| s.dof));
    let variance = rest / dof;
    if slopes.is_empty() || variance.is_nan() || variance <= 0.0 {
        return None;
    }
    let tail = |squares: f64, of: f64| FisherSnedecor::new(of, dof).map_or(1.0, |f| f.sf(squares / of / variance));
    let (inner, places) = (sum(|s| s.inner), sum(|s| s.places));
    let squares = sum(|s| s.inner * s.inner / s.places);
    let (common, single) = (tail(inner * inner / places, 1.0), tail(squares, count));
    let is_common = common <= single;
    // two tests in every channel
    let p = (2.0 * channels as f64 * common.min(single)).min(1.0);
    let length = sum(|s| s.length) / count;
    let own = ((squares - count * variance) / places).max(0.0).sqrt();
    let change = length * if is_common { inner / places } else { own };
    // a difference has the noise of two readings
    let over_noise = change.abs() / (0.5 * variance).sqrt();
    let is_drift = p < rules.max_order_p && over_noise > rules.min_drift_sd;
    is_drift.then_some(Drift { channel, change, is_common, series: slopes.len(), over_noise, p })
}

//! What a model leaves of every reading: outliers, and what the rest goes with.

use std::collections::BTreeMap;

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::levels;
use crate::noise::Noise;
use crate::observations::{Channel, Observations};
use crate::robust::{deviation_by_median, upper_median};
use crate::rules::Rules;
use crate::search::Search;
use crate::solve::Problem;
use crate::whitening::Whitener;

/// What the end of a search leaves of every reading.
pub struct Residuals {
    /// By reading and channel, each in its own noise; 0 where nothing was read.
    pub by_reading: Vec<Vec<f64>>,
    /// By channel, the deviation of rounding, likewise.
    rounding: Vec<f64>,
    /// Squared, beyond what noise brings.
    excess: f64,
}

/// A scalar observation that stands out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Reading.
    pub reading: usize,
    /// Its channel.
    pub channel: usize,
    /// Residual in robust standard deviations of its channel.
    pub studentised: f64,
}

/// A share of the misfit that goes with something.
#[derive(Clone, Debug, Serialize)]
pub struct Structure {
    /// What it goes with.
    pub factor: &'static str,
    /// Share of the misfit, 0…1.
    pub share: f64,
    /// Probability of as much by chance.
    pub p: f64,
}

/// A factor that residuals may go with.
pub struct Factor<'a> {
    /// As in reports.
    pub name: &'static str,
    /// Group of a reading.
    pub group: &'a dyn Fn(usize) -> (i64, usize),
    /// Sign with which a reading's residuals are summed up in its group.
    pub sign: &'a dyn Fn(usize) -> f64,
}

impl Residuals {
    /// Of the model at the end of a search.
    pub fn new(problem: &Problem<'_>, noise: &Noise, search: &Search) -> Option<Self> {
        let observations = problem.observations;
        let by_reading = Whitener::by_reading(observations, noise);
        let plain = problem.with(&by_reading);
        let whitener = levels::whiteners(&plain).swap_remove(search.levels[1]);
        let left = problem.with(&whitener).residuals(&search.fit.unknowns, search.fit.x.as_slice())?;
        let mut by_reading = vec![vec![0.0; observations.channels.len()]; observations.readings.len()];
        for (e, r) in whitener.entries.iter().zip(left.iter()) {
            by_reading[e.readings[0]][e.channel] = *r;
        }
        let rounding = |(c, channel): (usize, &Channel)| match noise.within[c] {
            within if within > 0.0 => channel.resolution / 12.0_f64.sqrt() / within,
            _ => 0.0,
        };
        let rounding = observations.channels.iter().enumerate().map(rounding).collect();
        Some(Self { by_reading, rounding, excess: (left.norm_squared() - left.len() as f64).max(0.0) })
    }

    /// Scalar observations that stand out of the residuals of their channel, the worst first.
    pub fn outliers(&self, observations: &Observations, rules: &Rules) -> Vec<Outlier> {
        outliers(observations, &self.by_reading, &self.rounding, rules)
    }

    /// How much of the misfit goes with a factor.
    pub fn structure(&self, observations: &Observations, factor: &Factor<'_>) -> Structure {
        let channels = observations.channels.len();
        // of a group and a channel, the sum of its residuals and how many these are
        let mut sums: BTreeMap<((i64, usize), usize), (f64, f64)> = BTreeMap::new();
        for (i, (reading, left)) in observations.readings.iter().zip(&self.by_reading).enumerate() {
            for c in (0..channels).filter(|c| reading.observed[*c].is_some()) {
                let (sum, count) = sums.entry(((factor.group)(i), c)).or_default();
                *sum += (factor.sign)(i) * left[c];
                *count += 1.0;
            }
        }
        let between: f64 = sums.values().map(|(sum, count)| sum * sum / count).sum();
        let dof = sums.len() as f64;
        let p = ChiSquared::new(dof).map_or(f64::NAN, |d| d.sf(between));
        let share = if self.excess > 0.0 { ((between - dof) / self.excess).clamp(0.0, 1.0) } else { 0.0 };
        Structure { factor: factor.name, share, p }
    }
}

/// See [`Residuals::outliers`]; `residuals` are by reading and channel, `least` is what these scatter by at least.
fn outliers(observations: &Observations, residuals: &[Vec<f64>], least: &[f64], rules: &Rules) -> Vec<Outlier> {
    let readings = &observations.readings;
    let mut found = Vec::new();
    for channel in 0..observations.channels.len() {
        let read: Vec<(usize, f64)> = (readings.iter().zip(residuals).enumerate())
            .filter_map(|(n, (r, left))| r.observed[channel].map(|_| (n, left[channel].abs())))
            .collect();
        let mut sizes: Vec<f64> = read.iter().map(|r| r.1).collect();
        let scale = upper_median(&mut sizes).map(|size| deviation_by_median(size).max(least[channel]));
        let Some(scale) = scale.filter(|s| *s > 0.0) else { continue };
        // where a repeat of it errs as well, it is the model or the load that errs
        let alone = |n: usize| {
            let repeat_of = readings[n].repeat_of;
            let is_other = |o: usize| o != n && readings[o].repeat_of == repeat_of;
            let limit = rules.outlier_repeat_share * rules.outlier_sd * scale;
            read.iter().all(|(o, size)| !is_other(*o) || *size < limit)
        };
        let standing: Vec<_> = read.iter().filter(|r| r.1 > rules.outlier_sd * scale).collect();
        if standing.len() as f64 > (rules.max_outlier_share * read.len() as f64).max(1.0) {
            continue;
        }
        let standing = standing.into_iter().filter(|(n, _)| alone(*n));
        found.extend(standing.map(|(n, size)| Outlier { reading: *n, channel, studentised: size / scale }));
    }
    found.sort_by(|a, b| b.studentised.total_cmp(&a.studentised));
    found.truncate(rules.max_outliers);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observations::Reading;

    /// Of two channels the second is read in every tenth reading of a group; there it is off by 3 deviations in one group of two.
    #[test]
    fn a_channel_that_is_seldom_read_shows_its_structure() {
        let is_read = |n: usize| n.is_multiple_of(10);
        let group = |n: usize| (n as i64 / 50, 0);
        let reading = |n: usize| Reading {
            condition: n,
            repeat_of: n,
            series: 0,
            observed: vec![Some(0.0), is_read(n).then_some(0.0)],
            sigma: vec![None; 2],
            covariance: None,
            drawn: Vec::new(),
        };
        let channels = vec![Channel { kind: 0, resolution: 0.0 }; 2];
        let observations =
            Observations { channels, pose_of: (0..100).collect(), readings: (0..100).map(reading).collect() };
        let second = |n: usize| if is_read(n) && n < 50 { 3.0 } else { 0.0 };
        let residuals = Residuals {
            by_reading: (0..100).map(|n| vec![0.0, second(n)]).collect(),
            rounding: vec![0.0; 2],
            excess: 45.0,
        };
        let found = residuals.structure(&observations, &Factor { name: "order", group: &group, sign: &|_| 1.0 });
        // between is 5 · 3², of four sums
        let expected = ChiSquared::new(4.0).unwrap().sf(45.0);
        assert!((found.p / expected - 1.0).abs() < 1e-9 && (found.share - 41.0 / 45.0).abs() < 1e-12, "{found:?}");
    }
}

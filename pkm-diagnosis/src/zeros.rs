//! Errors of the zeros of series that no repeats show, from what readings say at no load.
//!
//! Where each condition is read in one series alone, repeats have the zero in common and say nothing of it. But what is read is
//! proportional to the loads while nothing slips or opens, so that what a straight line through the readings of a series leaves at
//! no load is its zero.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::noise::{Noise, NoiseSource, reduced};
use crate::observations::Observations;
use crate::rules::Rules;

/// Singular values of loads below this share of the greatest are none.
const MIN_SINGULAR: f64 = 1e-9;

/// Zeros of one channel: number, sum of squares, and that of the factors by which the variance of a reading is in them.
#[derive(Clone, Copy, Default)]
struct Zeros {
    count: f64,
    squares: f64,
    factors: f64,
}

impl Zeros {
    fn plus(self, o: Self) -> Self {
        Self { count: self.count + o.count, squares: self.squares + o.squares, factors: self.factors + o.factors }
    }

    /// Variance of a zero, that of a reading given. Divided as sums of squares of repeats are.
    fn variance(self, of_reading: f64) -> f64 {
        ((self.squares - of_reading * self.factors) / reduced(self.count)).max(0.0)
    }
}

impl Noise {
    /// The same with the zeros' deviations where they could not be had from repeats. `proportional` has for each reading a group and
    /// its loads: within a group, what is read without noise is one linear function of them.
    pub fn with_zeros(
        mut self,
        observations: &Observations,
        proportional: &[(usize, Vec<f64>)],
        rules: &Rules,
    ) -> Self {
        let is_declared = observations.readings.iter().any(|r| r.covariance.is_some());
        if self.source == NoiseSource::Declared || is_declared {
            return self;
        }
        let mut groups: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for (n, (r, (group, _))) in observations.readings.iter().zip(proportional).enumerate() {
            groups.entry((r.series, *group)).or_default().push(n);
        }
        let zeros = |channel: usize| {
            let of = |all: &Vec<usize>| zero(observations, proportional, all, channel);
            groups.values().filter_map(of).fold(Zeros::default(), Zeros::plus)
        };
        let own: Vec<Zeros> = (0..observations.channels.len()).map(zeros).collect();
        for (c, channel) in observations.channels.iter().enumerate() {
            let pool = || (0..own.len()).filter(|o| observations.channels[*o].kind == channel.kind).map(|o| own[o]);
            let all = pool().fold(Zeros::default(), Zeros::plus);
            if !self.is_zero_open[c] || all.count < rules.min_dof_of_kind {
                continue;
            }
            let taken = if own[c].count >= rules.min_dof_of_channel { own[c] } else { all };
            self.between[c] = taken.variance(self.within[c].powi(2)).sqrt();
            self.is_zero_open[c] = false;
        }
        self
    }
}

/// What the readings of a series in a group have at no load. `None` where their loads do not tell it as well as a reading would.
fn zero(
    observations: &Observations,
    proportional: &[(usize, Vec<f64>)],
    all: &[usize],
    channel: usize,
) -> Option<Zeros> {
    let read: Vec<(f64, &Vec<f64>)> = (all.iter())
        .filter_map(|n| Some((observations.readings[*n].observed[channel]?, &proportional[*n].1)))
        .collect();
    let loads = DMatrix::from_fn(read.len(), read.first()?.1.len(), |i, j| read[i].1[j]);
    let svd = loads.svd(true, false);
    let (u, greatest) = (svd.u?, svd.singular_values.max());
    let mut ones = DVector::from_element(read.len(), 1.0);
    for (column, singular) in u.column_iter().zip(&svd.singular_values) {
        if *singular > MIN_SINGULAR * greatest {
            let along = column.sum();
            ones.axpy(-along, &column, 1.0);
        }
    }
    let told = ones.norm_squared();
    if told < 1.0 {
        return None;
    }
    let at_no_load = ones.dot(&DVector::from_iterator(read.len(), read.iter().map(|r| r.0))) / told;
    Some(Zeros { count: 1.0, squares: at_no_load.powi(2), factors: 1.0 / told })
}

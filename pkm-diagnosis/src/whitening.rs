//! Whitening: turns readings or predictions into numbers of unit variance without correlation.

use std::collections::HashMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, DVectorViewMut};

use crate::noise::{Noise, NoiseSource};
use crate::observations::Observations;

/// Numbers of one channel under one condition that are told from one another by noise alone: their mean counts.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Rows of the file.
    pub readings: Vec<usize>,
    /// Index of their condition.
    pub condition: usize,
    /// Which.
    pub channel: usize,
}

/// Turns readings or predictions into numbers that have unit variance and no correlation, if the model is right.
#[derive(Clone)]
pub struct Whitener {
    /// In the order of the whitened numbers.
    pub entries: Vec<Entry>,
    /// Whitened squared scatter that went into the means of entries.
    pub averaged: f64,
    /// Degrees of freedom of the noise that it was made with; none where that counts as known.
    pub noise_dof: Option<f64>,
    /// One over the standard deviation of each, apart from zero errors.
    weight: Vec<f64>,
    /// Entries of one reading whose errors go together.
    correlated: Vec<Correlated>,
    /// Entries that share a zero error, or an error that a reading draws beside its noise.
    shared: Vec<Shared>,
    /// Entries that share the zeros of their series in several channels, where errors of channels go together.
    zeros: Vec<CommonError>,
    /// Orthogonal directions in which common errors move a group of entries, and how much to shrink them.
    common: Vec<CommonError>,
    /// The same of what disturbs all entries beside these.
    disturbances: Option<CommonError>,
    /// ln|I + U Uᵀ| of these.
    pub log_determinant: f64,
}

/// A zero error as a whitened direction v over a range of entries.
#[derive(Clone)]
struct Shared {
    entries: Range<usize>,
    direction: DVector<f64>,
    /// (1 − 1/√(1 + |v|²)) / |v|²
    share: f64,
}

impl Shared {
    /// Of a direction that is not 0.
    fn new(entries: Range<usize>, direction: Vec<f64>) -> Option<Self> {
        let direction = DVector::from_vec(direction);
        let v2 = direction.norm_squared();
        (v2 > 0.0).then(|| Self { entries, direction, share: (1.0 - 1.0 / (1.0 + v2).sqrt()) / v2 })
    }

    /// (I + v vᵀ)^-½: the part along v shrinks to 1/√(1 + |v|²).
    fn shrink(&self, part: &mut [f64]) {
        let mut part = DVectorViewMut::from_slice(part, part.len());
        part.axpy(-self.share * self.direction.dot(&part), &self.direction, 1.0);
    }
}

/// Correlated noise of one reading: L of its correlations L Lᵀ.
#[derive(Clone)]
struct Correlated {
    entries: Range<usize>,
    factor: DMatrix<f64>,
}

impl Correlated {
    /// L⁻¹ by forward substitution.
    fn whiten(&self, part: &mut [f64]) {
        for i in 0..part.len() {
            let known: f64 = (0..i).map(|j| self.factor[(i, j)] * part[j]).sum();
            part[i] = (part[i] - known) / self.factor[(i, i)];
        }
    }
}

/// Errors that some entries have in common, as whitened directions.
#[derive(Clone)]
struct CommonError {
    entries: Vec<usize>,
    /// Orthonormal, by column.
    directions: DMatrix<f64>,
    /// Share of each that shrinking takes.
    shrink: DVector<f64>,
}

impl CommonError {
    /// Of whitened columns of one standard deviation, and ln|I + U Uᵀ|.
    fn new(entries: Vec<usize>, u: DMatrix<f64>) -> (Self, f64) {
        if u.is_empty() {
            return (Self { directions: DMatrix::zeros(entries.len(), 0), entries, shrink: DVector::zeros(0) }, 0.0);
        }
        // (I + U Uᵀ)^-½ shrinks the principal directions of U
        let svd = u.svd(true, false);
        let values = svd.singular_values;
        let kept: Vec<usize> = (0..values.len()).filter(|k| values[*k] > 1e-9).collect();
        let grown = DVector::from_iterator(kept.len(), kept.iter().map(|k| 1.0 + values[*k] * values[*k]));
        let directions = svd.u.map_or(DMatrix::zeros(entries.len(), 0), |u| u.select_columns(&kept));
        (Self { entries, directions, shrink: grown.map(|g| 1.0 - 1.0 / g.sqrt()) }, grown.map(f64::ln).sum())
    }

    /// What shrinking takes from rows of numbers, by direction: squared, from the sum of squares.
    fn lost(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let mut lost = rows.select_columns(&self.entries) * &self.directions;
        for (mut column, shrink) in lost.column_iter_mut().zip(&self.shrink) {
            column *= (shrink * (2.0 - shrink)).sqrt();
        }
        lost
    }

    /// Shrinks these directions of numbers that are white but for them.
    fn shrink(&self, values: &mut [f64]) {
        let own = DVector::from_iterator(self.entries.len(), self.entries.iter().map(|e| values[*e]));
        let taken = &self.directions * self.directions.tr_mul(&own).component_mul(&self.shrink);
        for (e, taken) in self.entries.iter().zip(&taken) {
            values[*e] -= taken;
        }
    }
}

/// Condition, bits of the weight, readings: those of one channel in one series that are alike.
type Cell = (usize, u64, Vec<usize>);
/// What must be the same of two series in a channel: condition, bits of the weight and number of each cell.
type Pattern = (usize, Vec<(usize, u64, usize)>);

impl Whitener {
    /// Standard deviation of an entry, apart from zero errors.
    pub fn deviation(&self, entry: usize) -> f64 {
        1.0 / self.weight[entry]
    }

    /// By the noise of the readings alone. What was repeated within a series, and series that are repeats of one
    /// another, come in by their means, which says the same of the model for less work.
    pub fn new(observations: &Observations, noise: &Noise) -> Self {
        Self::build(observations, noise, true)
    }

    /// The same with every reading on its own.
    pub fn by_reading(observations: &Observations, noise: &Noise) -> Self {
        Self::build(observations, noise, false)
    }

    fn build(observations: &Observations, noise: &Noise, average: bool) -> Self {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (i, r) in observations.readings.iter().enumerate() {
            if r.series >= groups.len() {
                groups.resize(r.series + 1, Vec::new());
            }
            groups[r.series].push(i);
        }
        // series that are alike in a channel, in the order in which they appear
        let mut alike: HashMap<Pattern, usize> = HashMap::new();
        let mut blocks: Vec<(usize, Vec<Vec<Cell>>)> = Vec::new();
        let goes_together = |r: &usize| {
            let r = &observations.readings[*r];
            r.covariance.is_some() || r.drawn.iter().any(|d| *d != 0.0)
        };
        let (together, apart): (Vec<_>, Vec<_>) = groups.iter().partition(|group| group.iter().any(goes_together));
        for group in apart {
            for channel in 0..observations.channels.len() {
                let cells = cells(observations, noise, group, channel, average);
                let key =
                    (channel, cells.iter().map(|(condition, weight, r)| (*condition, *weight, r.len())).collect());
                let next = blocks.len();
                let block = if average { *alike.entry(key).or_insert(next) } else { next };
                if block == next {
                    blocks.push((channel, Vec::new()));
                }
                blocks[block].1.push(cells);
            }
        }
        let mut this = Self {
            entries: Vec::new(),
            averaged: 0.0,
            noise_dof: (noise.source == NoiseSource::Repeats && noise.dof > 0.0).then_some(noise.dof),
            weight: Vec::new(),
            correlated: Vec::new(),
            shared: Vec::new(),
            zeros: Vec::new(),
            common: Vec::new(),
            disturbances: None,
            log_determinant: 0.0,
        };
        for (channel, series) in blocks {
            this.add(observations, noise, channel, &series);
        }
        for series in together {
            this.add_together(observations, noise, series);
        }
        this
    }

    /// Adds a series with errors that go through several channels. Its readings come in one by one: no two of them need have the
    /// same covariance.
    fn add_together(&mut self, observations: &Observations, noise: &Noise, series: &[usize]) {
        let (first, known) = (self.entries.len(), (self.correlated.len(), self.shared.len()));
        for reading in series {
            let r = &observations.readings[*reading];
            let channels: Vec<usize> = (0..r.observed.len()).filter(|c| r.observed[*c].is_some()).collect();
            let entries = self.entries.len()..self.entries.len() + channels.len();
            let entry = |channel: &usize| Entry { readings: vec![*reading], condition: r.condition, channel: *channel };
            self.entries.extend(channels.iter().map(entry));
            self.weight.extend(channels.iter().map(|c| 1.0 / noise.within_of(observations, *reading, *c)));
            if let Some(covariance) = &r.covariance {
                // what repeats scatter beyond the declared errors is none of theirs, and goes by itself
                let share = |c: usize| {
                    noise.together_of(observations, *reading, c).0 / noise.within_of(observations, *reading, c)
                };
                let factor = covariance.factor(&channels, |c| share(c).min(1.0));
                self.correlated.push(Correlated { entries: entries.clone(), factor });
            }
            if !r.drawn.is_empty() {
                let mut direction: Vec<f64> =
                    channels.iter().zip(&self.weight[entries.clone()]).map(|(c, w)| r.drawn[*c] * w).collect();
                if let Some(correlated) = self.correlated.last().filter(|c| c.entries == entries) {
                    correlated.whiten(&mut direction);
                }
                self.shared.extend(Shared::new(entries, direction));
            }
        }
        let entries: Vec<usize> = (first..self.entries.len()).collect();
        let channels = observations.channels.len();
        let factor = zero_factor(observations, noise, series);
        let mut columns = DMatrix::zeros(entries.len(), channels);
        for (row, e) in self.entries[first..].iter().enumerate() {
            let between = noise.between_of(observations, e.readings[0], e.channel);
            columns.row_mut(row).copy_from(&(factor.row(e.channel) * between));
        }
        let here = |entries: &Range<usize>| entries.start - first..entries.end - first;
        for mut column in columns.column_iter_mut() {
            column.iter_mut().zip(&self.weight[first..]).for_each(|(v, w)| *v *= w);
            let values = column.as_mut_slice();
            self.correlated[known.0..].iter().for_each(|c| c.whiten(&mut values[here(&c.entries)]));
            self.shared[known.1..].iter().for_each(|s| s.shrink(&mut values[here(&s.entries)]));
        }
        self.zeros.push(CommonError::new(entries, columns).0);
    }

    /// Adds series that are alike in a channel.
    fn add(&mut self, observations: &Observations, noise: &Noise, channel: usize, series: &[Vec<Cell>]) {
        let observed = |reading: &usize| observations.readings[*reading].observed[channel].unwrap_or(f64::NAN);
        let mean = |rows: &[usize]| rows.iter().map(observed).sum::<f64>() / rows.len() as f64;
        let start = self.entries.len();
        let weights: Vec<f64> =
            series[0].iter().map(|(_, weight, rows)| f64::from_bits(*weight) * (rows.len() as f64).sqrt()).collect();
        let direction: Vec<f64> = weights.iter().map(|w| w * noise.between[channel]).collect();
        let shared = Shared::new(start..start + weights.len(), direction);
        for (n, (condition, ..)) in series[0].iter().enumerate() {
            let rows: Vec<usize> = series.iter().flat_map(|cells| cells[n].2.iter().copied()).collect();
            self.entries.push(Entry { readings: rows, condition: *condition, channel });
            self.weight.push(weights[n] * (series.len() as f64).sqrt());
        }
        for cells in series {
            let mut scatter = Vec::new();
            for ((cell, weight), entry) in cells.iter().zip(&weights).zip(&self.entries[start..]) {
                let own = mean(&cell.2);
                scatter.push(weight * (own - mean(&entry.readings)));
                let squares: f64 = cell.2.iter().map(|r| (f64::from_bits(cell.1) * (observed(r) - own)).powi(2)).sum();
                self.averaged += squares;
            }
            if let Some(shared) = &shared {
                shared.shrink(&mut scatter);
            }
            self.averaged += scatter.iter().map(|s| s * s).sum::<f64>();
        }
        self.shared.extend(shared);
    }

    /// The same with common errors: for each group of entries, whitened columns of one standard deviation.
    pub fn with_common_errors(&self, groups: &[(Vec<usize>, DMatrix<f64>)], scale: &[f64]) -> Self {
        let mut log_determinant = 0.0;
        let of = |(entries, u): &(Vec<usize>, DMatrix<f64>)| {
            let mut u = u.clone();
            for (k, scale) in scale.iter().enumerate() {
                u.column_mut(k).scale_mut(*scale);
            }
            let (common, own) = CommonError::new(entries.clone(), u);
            log_determinant += own;
            common
        };
        let common = groups.iter().map(of).filter(|common| !common.shrink.is_empty()).collect();
        Self { common, log_determinant, ..self.clone() }
    }

    /// The same with disturbances of all readings: columns of one standard deviation, white but for the common errors.
    pub fn with_disturbances(&self, columns: &DMatrix<f64>) -> Self {
        let mut u = columns.clone();
        u.column_iter_mut().for_each(|mut column| self.shrink(column.as_mut_slice()));
        let (own, ln) = CommonError::new((0..self.entries.len()).collect(), u);
        let mut this = self.clone();
        this.disturbances = Some(own);
        this.log_determinant += ln;
        this
    }

    /// What shrinking takes from inner products: those of shrunk rows are A Aᵀ − L Lᵀ for this L of the rows A.
    pub fn lost(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        // as seen from before the common errors
        let disturbances = self.disturbances.as_ref().map(|own| {
            let mut own = own.clone();
            own.directions.column_iter_mut().for_each(|mut direction| self.shrink_common(direction.as_mut_slice()));
            own
        });
        let all: Vec<&CommonError> = self.common.iter().chain(&disturbances).collect();
        let mut lost = DMatrix::zeros(rows.nrows(), all.iter().map(|common| common.shrink.len()).sum());
        let mut first = 0;
        for common in all {
            let count = common.shrink.len();
            lost.columns_mut(first, count).copy_from(&common.lost(rows));
            first += count;
        }
        lost
    }

    /// Whitens numbers given by entry, in SI units.
    pub fn whiten(&self, values: &mut [f64]) {
        self.whiten_plain(values);
        self.shrink(values);
    }

    /// The same but for the common errors.
    pub fn whiten_plain(&self, values: &mut [f64]) {
        for (value, weight) in values.iter_mut().zip(&self.weight) {
            *value *= weight;
        }
        for correlated in &self.correlated {
            correlated.whiten(&mut values[correlated.entries.clone()]);
        }
        for shared in &self.shared {
            shared.shrink(&mut values[shared.entries.clone()]);
        }
        for zero in &self.zeros {
            zero.shrink(values);
        }
    }

    /// The part of the whitening that is due to common errors, on numbers that are white but for these.
    pub fn shrink(&self, values: &mut [f64]) {
        self.shrink_common(values);
        if let Some(disturbances) = &self.disturbances {
            disturbances.shrink(values);
        }
    }

    fn shrink_common(&self, values: &mut [f64]) {
        for common in &self.common {
            common.shrink(values);
        }
    }
}

/// L of the correlations L Lᵀ between the zeros of a series in its channels: those of its first reading that has any.
fn zero_factor(observations: &Observations, noise: &Noise, series: &[usize]) -> DMatrix<f64> {
    let channels: Vec<usize> = (0..observations.channels.len()).collect();
    let own = series.iter().find_map(|r| Some((*r, observations.readings[*r].covariance.as_ref()?)));
    own.map_or_else(
        || DMatrix::identity(channels.len(), channels.len()),
        |(reading, covariance)| {
            let share = |c: usize| {
                let between = noise.between_of(observations, reading, c).max(f64::MIN_POSITIVE);
                noise.together_of(observations, reading, c).1 / between
            };
            covariance.factor(&channels, |c| share(c).min(1.0))
        },
    )
}

/// What one series reads in a channel.
fn cells(observations: &Observations, noise: &Noise, series: &[usize], channel: usize, average: bool) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::new();
    let mut places: HashMap<(usize, u64), usize> = HashMap::new();
    for reading in series {
        let r = &observations.readings[*reading];
        if r.observed[channel].is_none() {
            continue;
        }
        let weight = (1.0 / noise.within_of(observations, *reading, channel)).to_bits();
        let next = cells.len();
        let place = if average { *places.entry((r.condition, weight)).or_insert(next) } else { next };
        if place == next {
            cells.push((r.condition, weight, Vec::new()));
        }
        cells[place].2.push(*reading);
    }
    cells
}

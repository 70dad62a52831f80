//! How much readings scatter, from repeats or as declared, and the whitening that follows.

use std::collections::HashMap;

use nalgebra::DMatrix;
use serde::Serialize;

use crate::error::{Failure, Result};
use crate::files::dataset::DEFLECTION_COLUMNS;
use crate::files::readings::{CHANNELS, Readings};

/// Least degrees of freedom at which a channel's scatter is taken from its own repeats; with fewer, translations are
/// taken together, and rotations.
const ENOUGH: f64 = 20.0;

/// Where the noise model comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum NoiseSource {
    /// Scatter of repeats.
    Repeats,
    /// Columns `sigma_linear_um`, `sigma_angular_urad`.
    Declared,
}

/// Standard deviations by channel, in m and rad.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Where it comes from.
    pub source: NoiseSource,
    /// Of one reading within its series.
    pub within: [f64; CHANNELS],
    /// Of the zero reading that a series shares.
    pub between: [f64; CHANNELS],
    /// Degrees of freedom of the repeats, all channels together; 0 when declared.
    pub freedom: f64,
}

/// Sums of squares of one channel's repeats.
#[derive(Clone, Copy, Default)]
struct Scatter {
    /// With the means of conditions and series removed.
    within: f64,
    within_freedom: f64,
    /// With the means of conditions removed alone.
    total: f64,
    total_freedom: f64,
    /// How often t² is in the expectation of `total`.
    series_weight: f64,
}

impl Scatter {
    fn plus(self, o: Self) -> Self {
        Self {
            within: self.within + o.within,
            within_freedom: self.within_freedom + o.within_freedom,
            total: self.total + o.total,
            total_freedom: self.total_freedom + o.total_freedom,
            series_weight: self.series_weight + o.series_weight,
        }
    }

    /// s and t. Sums of squares are divided by two freedoms less, so that it is 1/variance, which readings are weighed by,
    /// that is right on average.
    fn deviations(&self) -> (f64, f64) {
        let mean = |sum: f64, freedom: f64| sum / if freedom > 4.0 { freedom - 2.0 } else { freedom };
        if self.within_freedom < 1.0 {
            // one reading a series: its zero error can't be told from its noise, and need not be
            return (mean(self.total, self.total_freedom).sqrt(), 0.0);
        }
        let s2 = mean(self.within, self.within_freedom);
        let freedom = self.total_freedom - self.within_freedom;
        if freedom < 1.0 || self.series_weight <= 0.0 {
            return (s2.sqrt(), 0.0);
        }
        let between = mean(self.total - self.within, freedom);
        (s2.sqrt(), ((between - s2) * freedom / self.series_weight).max(0.0).sqrt())
    }
}

/// Groups a list by a key that counts from 0.
fn means(values: &[(usize, usize, f64)], key: impl Fn(&(usize, usize, f64)) -> usize) -> HashMap<usize, (f64, usize)> {
    let mut groups: HashMap<usize, (f64, usize)> = HashMap::new();
    for value in values {
        let group = groups.entry(key(value)).or_default();
        group.0 += value.2;
        group.1 += 1;
    }
    for group in groups.values_mut() {
        group.0 /= group.1 as f64;
    }
    groups
}

fn scatter(readings: &Readings, channel: usize) -> Scatter {
    let mut rows: Vec<(usize, usize, f64)> =
        readings.readings.iter().filter_map(|r| Some((r.repeat_of, r.series, r.observed[channel]?))).collect();
    let repeated = means(&rows, |r| r.0);
    rows.retain(|r| repeated[&r.0].1 > 1);
    if rows.is_empty() {
        return Scatter::default();
    }
    let by_condition = means(&rows, |r| r.0);
    let n = rows.len() as f64;
    for row in &mut rows {
        row.2 -= by_condition[&row.0].0;
    }
    let total = rows.iter().map(|r| r.2 * r.2).sum();
    let total_freedom = n - by_condition.len() as f64;
    // n_g − Σ n_gs²/n_g over conditions g and series s
    let mut in_both: HashMap<(usize, usize), f64> = HashMap::new();
    for row in &rows {
        *in_both.entry((row.0, row.1)).or_default() += 1.0;
    }
    let squares: f64 = in_both.iter().map(|((g, _), count)| count * count / by_condition[g].1 as f64).sum();

    // both means removed by turns until nothing changes
    let mut change = f64::INFINITY;
    for _ in 0..200 {
        if change <= 1e-12 * total {
            break;
        }
        change = 0.0;
        for of_series in [true, false] {
            let key = |r: &(usize, usize, f64)| if of_series { r.1 } else { r.0 };
            let group = means(&rows, key);
            for row in &mut rows {
                let mean = group[&key(row)].0;
                row.2 -= mean;
                change += mean * mean;
            }
        }
    }
    let series = means(&rows, |r| r.1).len();
    // conditions and series hang together in components, each of which has one mean in common
    let mut label: HashMap<usize, usize> = HashMap::new();
    let mut of_series: HashMap<usize, usize> = HashMap::new();
    loop {
        let mut moved = false;
        for (g, s, _) in &rows {
            let low = label.get(g).copied().unwrap_or(*g).min(of_series.get(s).copied().unwrap_or(usize::MAX));
            moved |= label.insert(*g, low) != Some(low);
            moved |= of_series.insert(*s, low) != Some(low);
        }
        if !moved {
            break;
        }
    }
    let mut labels: Vec<usize> = label.into_values().collect();
    labels.sort_unstable();
    labels.dedup();
    let freedom = n - by_condition.len() as f64 - series as f64 + labels.len() as f64;
    Scatter {
        within: rows.iter().map(|r| r.2 * r.2).sum(),
        within_freedom: freedom,
        total,
        total_freedom,
        series_weight: n - squares,
    }
}

impl Noise {
    /// From repeats where there are some, else as declared.
    ///
    /// # Errors
    /// Neither repeats nor declared deviations.
    pub fn new(readings: &Readings) -> Result<Self> {
        let scatters: [Scatter; CHANNELS] = std::array::from_fn(|c| scatter(readings, c));
        let channels = readings.channels();
        let (mut within, mut between) = ([0.0; CHANNELS], [0.0; CHANNELS]);
        let pooled = |kind: usize| (3 * kind..3 * kind + 3).fold(Scatter::default(), |sum, c| sum.plus(scatters[c]));
        let pools = [pooled(0), pooled(1)];
        let used: Vec<usize> = (0..CHANNELS).filter(|c| channels[*c]).collect();
        // a declared deviation beats a handful of repeats
        let declared = readings.readings.iter().any(|r| r.sigma.iter().any(Option::is_some));
        let needed = if declared { 2.0 * ENOUGH } else { 3.0 };
        let from_repeats = used.iter().all(|c| pools[c / 3].total_freedom >= needed);
        if !from_repeats {
            return Self::declared(readings, &used);
        }
        for c in &used {
            let own = scatters[*c];
            let taken = if own.total_freedom >= ENOUGH { own } else { pools[c / 3] };
            let (s, t) = taken.deviations();
            // rounding of the file is noise as well
            within[*c] = s.max(readings.resolution[*c] / 12.0_f64.sqrt());
            between[*c] = t;
        }
        let freedom = used.iter().map(|c| scatters[*c].total_freedom).sum();
        Ok(Self { source: NoiseSource::Repeats, within, between, freedom })
    }

    fn declared(readings: &Readings, used: &[usize]) -> Result<Self> {
        let names = ["sigma_linear_um", "sigma_angular_urad"];
        let mut within = [0.0; CHANNELS];
        for c in used {
            let kind = c / 3;
            let rows: Vec<_> = readings.readings.iter().filter(|r| r.observed[*c].is_some()).collect();
            let declared: Vec<f64> = rows.iter().filter_map(|r| r.sigma[kind]).collect();
            if declared.len() < rows.len() {
                return Err(Failure::input(format!(
                    "no repeats to take the noise of {} from, and no declared one: repeat some readings (same pose, \
                     load and direction), or add the column {} with one standard deviation of a reading",
                    DEFLECTION_COLUMNS[*c], names[kind]
                ))
                .in_file(&readings.source.name)
                .at_column(names[kind]));
            }
            let mean_square = declared.iter().map(|s| s * s).sum::<f64>() / declared.len() as f64;
            let floor = readings.resolution[*c] / 12.0_f64.sqrt();
            within[*c] = mean_square.sqrt().max(floor);
        }
        Ok(Self { source: NoiseSource::Declared, within, between: [0.0; CHANNELS], freedom: 0.0 })
    }
}

/// Numbers of one channel under one condition that are told from one another by noise alone: their mean counts.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Rows of the file.
    pub readings: Vec<usize>,
    /// Index of their condition.
    pub condition: usize,
    /// 0…5.
    pub channel: usize,
}

/// Turns readings or predictions into numbers that have unit variance and no correlation, if the model is right.
#[derive(Clone)]
pub struct Whitener {
    /// In the order of the whitened numbers.
    pub entries: Vec<Entry>,
    /// Whitened squared scatter that went into the means of entries.
    pub averaged: f64,
    /// One over the standard deviation of each, apart from zero errors.
    weight: Vec<f64>,
    /// Entries that share a zero error.
    shared: Vec<Shared>,
    /// Directions in which the load's own uncertainty moves a group of entries, orthogonal, and how much to shrink them.
    loads: Vec<LoadError>,
    /// ln|I + U Uᵀ| of these.
    pub log_determinant: f64,
}

/// A zero error as a whitened direction v over a range of entries.
#[derive(Clone)]
struct Shared {
    entries: std::ops::Range<usize>,
    direction: Vec<f64>,
    /// (1 − 1/√(1 + |v|²)) / |v|²
    share: f64,
}

impl Shared {
    /// (I + v vᵀ)^-½: the part along v shrinks to 1/√(1 + |v|²).
    fn shrink(&self, part: &mut [f64]) {
        let along: f64 = part.iter().zip(&self.direction).map(|(p, d)| p * d).sum();
        for (p, d) in part.iter_mut().zip(&self.direction) {
            *p -= self.share * along * d;
        }
    }
}

/// Uncertainty of one load as whitened directions over some entries.
#[derive(Clone)]
struct LoadError {
    entries: Vec<usize>,
    directions: Vec<(Vec<f64>, f64)>,
}

/// Condition, bits of the weight, readings: those of one channel in one series that are alike.
type Cell = (usize, u64, Vec<usize>);
/// What must be the same of two series in a channel: condition, bits of the weight and number of each cell.
type Pattern = (usize, Vec<(usize, u64, usize)>);

impl Whitener {
    /// By the noise of the readings alone. What was repeated within a series, and series that are repeats of one
    /// another, come in by their means, which says the same of the model for less work.
    pub fn new(readings: &Readings, noise: &Noise) -> Self {
        Self::build(readings, noise, true)
    }

    /// The same with every reading on its own.
    pub fn by_reading(readings: &Readings, noise: &Noise) -> Self {
        Self::build(readings, noise, false)
    }

    fn build(readings: &Readings, noise: &Noise, average: bool) -> Self {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (i, r) in readings.readings.iter().enumerate() {
            if r.series >= groups.len() {
                groups.resize(r.series + 1, Vec::new());
            }
            groups[r.series].push(i);
        }
        // series that are alike in a channel, in the order in which they appear
        let mut alike: HashMap<Pattern, usize> = HashMap::new();
        let mut blocks: Vec<(usize, Vec<Vec<Cell>>)> = Vec::new();
        for group in &groups {
            for channel in 0..CHANNELS {
                let cells = cells(readings, noise, group, channel, average);
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
            weight: Vec::new(),
            shared: Vec::new(),
            loads: Vec::new(),
            log_determinant: 0.0,
        };
        for (channel, series) in blocks {
            this.add(readings, noise, channel, &series);
        }
        this
    }

    /// Adds series that are alike in a channel.
    fn add(&mut self, readings: &Readings, noise: &Noise, channel: usize, series: &[Vec<Cell>]) {
        let observed = |reading: &usize| readings.readings[*reading].observed[channel].unwrap_or(f64::NAN);
        let mean = |rows: &[usize]| rows.iter().map(observed).sum::<f64>() / rows.len() as f64;
        let start = self.entries.len();
        let weights: Vec<f64> =
            series[0].iter().map(|(_, weight, rows)| f64::from_bits(*weight) * (rows.len() as f64).sqrt()).collect();
        let direction: Vec<f64> = weights.iter().map(|w| w * noise.between[channel]).collect();
        let v2 = direction.iter().map(|v| v * v).sum::<f64>();
        let entries = start..start + weights.len();
        let shared = (v2 > 0.0).then(|| Shared { entries, direction, share: (1.0 - 1.0 / (1.0 + v2).sqrt()) / v2 });
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

    /// The same with errors of the loads: for each group of entries, whitened columns of one standard deviation.
    pub fn with_load_errors(&self, groups: &[(Vec<usize>, DMatrix<f64>)], scale: [f64; 4]) -> Self {
        let mut log_determinant = 0.0;
        let loads = groups
            .iter()
            .map(|(entries, u)| {
                let mut u = u.clone();
                for (k, scale) in scale.iter().enumerate() {
                    u.column_mut(k).scale_mut(*scale);
                }
                // (I + U Uᵀ)^-½ shrinks the principal directions of U
                let svd = u.svd(true, false);
                let values = svd.singular_values;
                let directions = svd.u.map_or(Vec::new(), |u| {
                    (0..values.len())
                        .filter(|k| values[*k] > 1e-9)
                        .map(|k| {
                            let grown = 1.0 + values[k] * values[k];
                            log_determinant += grown.ln();
                            (u.column(k).iter().copied().collect(), 1.0 - 1.0 / grown.sqrt())
                        })
                        .collect()
                });
                LoadError { entries: entries.clone(), directions }
            })
            .collect();
        Self { loads, log_determinant, ..self.clone() }
    }

    /// Whitens numbers given by entry, in m and rad.
    pub fn whiten(&self, values: &mut [f64]) {
        for (value, weight) in values.iter_mut().zip(&self.weight) {
            *value *= weight;
        }
        for shared in &self.shared {
            shared.shrink(&mut values[shared.entries.clone()]);
        }
        self.shrink(values);
    }

    /// The part of the whitening that is due to errors of the loads, on numbers that are white but for these.
    pub fn shrink(&self, values: &mut [f64]) {
        for LoadError { entries, directions } in &self.loads {
            for (direction, shrink) in directions {
                let along: f64 = entries.iter().zip(direction).map(|(e, d)| values[*e] * d).sum();
                for (e, d) in entries.iter().zip(direction) {
                    values[*e] -= shrink * along * d;
                }
            }
        }
    }
}

/// What one series reads in a channel.
fn cells(readings: &Readings, noise: &Noise, series: &[usize], channel: usize, average: bool) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::new();
    let mut places: HashMap<(usize, u64), usize> = HashMap::new();
    for reading in series {
        let r = &readings.readings[*reading];
        if r.observed[channel].is_none() {
            continue;
        }
        let declared = r.sigma[channel / 3].filter(|_| noise.source == NoiseSource::Declared);
        let floor = readings.resolution[channel] / 12.0_f64.sqrt();
        let weight = (1.0 / declared.map_or(noise.within[channel], |s| s.max(floor))).to_bits();
        let next = cells.len();
        let place = if average { *places.entry((r.condition, weight)).or_insert(next) } else { next };
        if place == next {
            cells.push((r.condition, weight, Vec::new()));
        }
        cells[place].2.push(*reading);
    }
    cells
}

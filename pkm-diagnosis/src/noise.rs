//! Noise of readings, from repeats or as declared.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;

use crate::observations::Observations;
use crate::rules::Rules;

/// Where the noise model comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum NoiseSource {
    /// Scatter of repeats.
    Repeats,
    /// Standard deviations that came with the readings.
    Declared,
}

/// Standard deviations by channel, in SI units.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Where it comes from.
    pub source: NoiseSource,
    /// Of one reading within its series.
    pub within: Vec<f64>,
    /// Of the zero reading that a series shares.
    pub between: Vec<f64>,
    /// Degrees of freedom of the repeats, all channels together; 0 when declared.
    pub dof: f64,
}

/// Sums of squares of one channel's repeats.
#[derive(Clone, Copy, Default)]
struct Scatter {
    /// With the means of conditions and series removed.
    within: f64,
    within_dof: f64,
    /// With the means of conditions removed alone.
    total: f64,
    total_dof: f64,
    /// How often t² is in the expectation of `total`.
    series_weight: f64,
}

impl Scatter {
    fn plus(self, o: Self) -> Self {
        Self {
            within: self.within + o.within,
            within_dof: self.within_dof + o.within_dof,
            total: self.total + o.total,
            total_dof: self.total_dof + o.total_dof,
            series_weight: self.series_weight + o.series_weight,
        }
    }

    /// s and t. Sums of squares are divided by two freedoms less, so that it is 1/variance, which readings are weighed by,
    /// that is right on average.
    fn deviations(&self) -> (f64, f64) {
        let mean = |sum: f64, freedom: f64| sum / if freedom > 4.0 { freedom - 2.0 } else { freedom };
        if self.within_dof < 1.0 {
            // one reading a series: its zero error can't be told from its noise, and need not be
            return (mean(self.total, self.total_dof).sqrt(), 0.0);
        }
        let s2 = mean(self.within, self.within_dof);
        let freedom = self.total_dof - self.within_dof;
        if freedom < 1.0 || self.series_weight <= 0.0 {
            return (s2.sqrt(), 0.0);
        }
        let between = mean(self.total - self.within, freedom);
        (s2.sqrt(), ((between - s2) * freedom / self.series_weight).max(0.0).sqrt())
    }
}

/// Groups a list by a key that counts from 0.
fn means(values: &[(usize, usize, f64)], key: impl Fn(&(usize, usize, f64)) -> usize) -> BTreeMap<usize, (f64, usize)> {
    let mut groups: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
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

/// What is read in one channel: number of the repeat, series, value.
type Row = (usize, usize, f64);

/// Sum of squares that remains when the means of repeats and of series are both removed, by turns until nothing changes.
/// `total` is the sum of squares without the means of repeats.
fn remove_means(rows: &mut [Row], total: f64) -> f64 {
    let mut change = f64::INFINITY;
    for _ in 0..200 {
        if change <= 1e-12 * total {
            break;
        }
        change = 0.0;
        for of_series in [true, false] {
            let key = |r: &Row| if of_series { r.1 } else { r.0 };
            let group = means(rows, key);
            for row in rows.iter_mut() {
                let mean = group[&key(row)].0;
                row.2 -= mean;
                change += mean * mean;
            }
        }
    }
    rows.iter().map(|r| r.2 * r.2).sum()
}

/// Number of components in which repeats and series hang together; each has one mean in common.
fn components(rows: &[Row]) -> usize {
    let mut of_repeat: HashMap<usize, usize> = HashMap::new();
    let mut of_series: HashMap<usize, usize> = HashMap::new();
    loop {
        let mut moved = false;
        for (g, s, _) in rows {
            let low = of_repeat.get(g).copied().unwrap_or(*g).min(of_series.get(s).copied().unwrap_or(usize::MAX));
            moved |= of_repeat.insert(*g, low) != Some(low);
            moved |= of_series.insert(*s, low) != Some(low);
        }
        if !moved {
            break;
        }
    }
    let mut labels: Vec<usize> = of_repeat.into_values().collect();
    labels.sort_unstable();
    labels.dedup();
    labels.len()
}

/// Analysis of variance of one channel.
fn scatter(observations: &Observations, channel: usize) -> Scatter {
    let mut rows: Vec<Row> =
        observations.readings.iter().filter_map(|r| Some((r.repeat_of, r.series, r.observed[channel]?))).collect();
    let repeated = means(&rows, |r| r.0);
    rows.retain(|r| repeated[&r.0].1 > 1);
    if rows.is_empty() {
        return Scatter::default();
    }
    let by_repeat = means(&rows, |r| r.0);
    let n = rows.len() as f64;
    for row in &mut rows {
        row.2 -= by_repeat[&row.0].0;
    }
    let total = rows.iter().map(|r| r.2 * r.2).sum();
    let total_dof = n - by_repeat.len() as f64;
    // n_g − Σ n_gs²/n_g over repeats g and series s
    let mut in_both: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for row in &rows {
        *in_both.entry((row.0, row.1)).or_default() += 1.0;
    }
    let squares: f64 = in_both.iter().map(|((g, _), count)| count * count / by_repeat[g].1 as f64).sum();
    let within = remove_means(&mut rows, total);
    let series = means(&rows, |r| r.1).len();
    let within_dof = n - by_repeat.len() as f64 - series as f64 + components(&rows) as f64;
    Scatter { within, within_dof, total, total_dof, series_weight: n - squares }
}

/// A channel whose noise is not known: neither enough repeats nor a declared deviation for every reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownNoise {
    /// Which.
    pub channel: usize,
}

impl Noise {
    /// From repeats where there are some, else as declared.
    ///
    /// # Errors
    /// Neither enough repeats nor declared deviations.
    pub fn estimate(observations: &Observations, rules: &Rules) -> Result<Self, UnknownNoise> {
        let channels = &observations.channels;
        let scatters: Vec<Scatter> = (0..channels.len()).map(|c| scatter(observations, c)).collect();
        let of_kind = |kind: usize| (0..channels.len()).filter(move |c| channels[*c].kind == kind);
        let pooled = |kind: usize| of_kind(kind).fold(Scatter::default(), |sum, c| sum.plus(scatters[c]));
        let pools: Vec<Scatter> = (0..observations.kinds()).map(pooled).collect();
        let is_used = observations.used_channels();
        let used: Vec<usize> = (0..channels.len()).filter(|c| is_used[*c]).collect();
        // a declared deviation is better than a few repeats
        let declared = observations.readings.iter().any(|r| r.sigma.iter().any(Option::is_some));
        let needed = if declared { rules.min_dof_beside_declared } else { rules.min_dof_of_kind };
        if !used.iter().all(|c| pools[channels[*c].kind].total_dof >= needed) {
            return Self::declared(observations, &used);
        }
        let (mut within, mut between) = (vec![0.0; channels.len()], vec![0.0; channels.len()]);
        for c in &used {
            let own = scatters[*c];
            let taken = if own.total_dof >= rules.min_dof_of_channel { own } else { pools[channels[*c].kind] };
            let (s, t) = taken.deviations();
            // rounding of the file is noise as well
            within[*c] = s.max(channels[*c].resolution / 12.0_f64.sqrt());
            between[*c] = t;
        }
        let dof = used.iter().map(|c| scatters[*c].total_dof).sum();
        Ok(Self { source: NoiseSource::Repeats, within, between, dof })
    }

    fn declared(observations: &Observations, used: &[usize]) -> Result<Self, UnknownNoise> {
        let channels = &observations.channels;
        let mut within = vec![0.0; channels.len()];
        for c in used {
            let rows: Vec<_> = observations.readings.iter().filter(|r| r.observed[*c].is_some()).collect();
            let declared: Vec<f64> = rows.iter().filter_map(|r| r.sigma[channels[*c].kind]).collect();
            if declared.len() < rows.len() {
                return Err(UnknownNoise { channel: *c });
            }
            let mean_square = declared.iter().map(|s| s * s).sum::<f64>() / declared.len() as f64;
            let floor = channels[*c].resolution / 12.0_f64.sqrt();
            within[*c] = mean_square.sqrt().max(floor);
        }
        Ok(Self { source: NoiseSource::Declared, within, between: vec![0.0; channels.len()], dof: 0.0 })
    }

    /// Standard deviation of one reading within its series: the one declared for it where that is the noise's source, no less
    /// than its digits can say, or else its channel's.
    pub fn within_of(&self, observations: &Observations, reading: usize, channel: usize) -> f64 {
        let c = &observations.channels[channel];
        let declared = observations.readings[reading].sigma[c.kind].filter(|_| self.source == NoiseSource::Declared);
        declared.map_or(self.within[channel], |s| s.max(c.resolution / 12.0_f64.sqrt()))
    }

    /// Variance of one reading of a channel about the model: its own noise and that of its zero.
    pub fn variance(&self, channel: usize) -> f64 {
        self.within[channel].powi(2) + self.between[channel].powi(2)
    }
}

//! Noise of readings, from repeats or as declared.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::observations::{Observations, Reading};
use crate::rounding;
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
    /// The same before it is rounded, however coarsely.
    pub unrounded: Vec<f64>,
    /// Of the zero reading that a series shares.
    pub between: Vec<f64>,
    /// Degrees of freedom of the repeats, all channels together; 0 when declared.
    pub dof: f64,
    /// How much of the deviations that covariances declare the repeats show, at most 1: of a reading, and of a zero. One share for all
    /// channels, so that what goes together keeps its proportions.
    pub declared_share: [f64; 2],
    /// By channel, whether repeats could not tell the zeros' deviation, as no series are repeats of one another.
    pub is_zero_open: Vec<bool>,
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

/// What a sum of squares is divided by: so that 1/variance is right on average, where its mean is known well enough for that.
pub(crate) fn reduced(freedom: f64) -> f64 {
    if freedom > 4.0 { freedom - 2.0 } else { freedom }
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

    /// Degrees of freedom of the zeros.
    fn zero_dof(&self) -> f64 {
        self.total_dof - self.within_dof
    }

    /// s. Sums of squares are divided by two degrees of freedom less, so that it is 1/variance, which readings are weighed by,
    /// that is right on average.
    fn of_reading(&self) -> f64 {
        // one reading a series: its zero error can't be told from its noise, and need not be
        let alone = self.within_dof < 1.0;
        let (sum, freedom) = if alone { (self.total, self.total_dof) } else { (self.within, self.within_dof) };
        (sum / reduced(freedom)).sqrt()
    }

    /// t. None where no series are repeats of one another. Of less than `few` degrees of freedom the 95 % bound: a zero that is taken for
    /// smaller than it is leaves what something has to explain, and one that is taken for greater costs little.
    fn of_zero(&self, few: f64) -> Option<f64> {
        if self.within_dof < 1.0 {
            return Some(0.0);
        }
        let freedom = self.zero_dof();
        if freedom < 1.0 || self.series_weight <= 0.0 {
            return None;
        }
        let divisor = match ChiSquared::new(freedom) {
            Ok(law) if freedom < few => law.inverse_cdf(0.05),
            _ => reduced(freedom),
        };
        let between = (self.total - self.within) / divisor;
        Some(((between - self.of_reading().powi(2)) * freedom / self.series_weight).max(0.0).sqrt())
    }
}

/// What is read in one channel.
#[derive(Clone, Copy)]
struct Row {
    repeat: usize,
    series: usize,
    value: f64,
    /// By which it counts among others.
    weight: f64,
}

/// Weighted mean and number of the rows of each group.
fn means(rows: &[Row], key: impl Fn(&Row) -> usize) -> BTreeMap<usize, (f64, usize)> {
    let mut groups: BTreeMap<usize, (f64, f64, usize)> = BTreeMap::new();
    for row in rows {
        let group = groups.entry(key(row)).or_default();
        group.0 += row.weight * row.value;
        group.1 += row.weight;
        group.2 += 1;
    }
    groups.into_iter().map(|(key, (sum, weight, count))| (key, (sum / weight, count))).collect()
}

/// Removes the means of groups; gives the sum of the squares of what was removed.
fn remove(rows: &mut [Row], key: impl Fn(&Row) -> usize) -> f64 {
    let group = means(rows, &key);
    let mut change = 0.0;
    for row in rows.iter_mut() {
        let mean = group[&key(row)].0;
        row.value -= mean;
        change += mean * mean;
    }
    change
}

fn sum_of_squares(rows: &[Row]) -> f64 {
    rows.iter().map(|r| r.weight * r.value * r.value).sum()
}

/// Removes the means of repeats.
fn remove_repeats(rows: &mut [Row]) {
    remove(rows, |r| r.repeat);
}

/// Removes the means of repeats and of series, by turns until nothing changes.
fn remove_repeats_and_series(rows: &mut [Row]) {
    remove_repeats(rows);
    let total: f64 = rows.iter().map(|r| r.value * r.value).sum();
    for _ in 0..200 {
        let change = remove(rows, |r| r.series) + remove(rows, |r| r.repeat);
        if change <= 1e-12 * total {
            break;
        }
    }
}

/// Number of components in which repeats and series hang together; each has one mean in common.
fn components(rows: &[Row]) -> usize {
    let mut of_repeat: HashMap<usize, usize> = HashMap::new();
    let mut of_series: HashMap<usize, usize> = HashMap::new();
    loop {
        let mut moved = false;
        for Row { repeat: g, series: s, .. } in rows {
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

/// Most that copied rows scatter by, in steps: far less than repeats of which one in a hundred differs.
const MAX_COPIED: f64 = 0.05;

/// Least share of the plain variance that may be left when what readings draw is taken out: declared too large, it would leave none.
const MIN_SHARE_LEFT: f64 = 1e-4;

/// Sum of squares about means that rows would have without the errors that they draw beside their noise: that of the variance which,
/// added to the variances of those, weighs the squares so that they sum up to their degrees of freedom (Paule and Mandel, Consensus
/// values and weighting factors, J. Res. NBS 87, 1982).
fn beyond_drawn(rows: &[Row], drawn: &[f64], dof: f64, remove_means: fn(&mut [Row])) -> f64 {
    let weighed = |weight: &dyn Fn(f64) -> f64| {
        let mut rows = rows.to_vec();
        rows.iter_mut().zip(drawn).for_each(|(r, d)| r.weight = weight(*d));
        remove_means(&mut rows);
        sum_of_squares(&rows)
    };
    let plain = weighed(&|_| 1.0);
    if dof < 1.0 || plain == 0.0 || drawn.iter().all(|d| *d == 0.0) {
        return plain;
    }
    let (mut low, mut high) = (MIN_SHARE_LEFT * plain / dof, plain / dof);
    // to a thousandth, far less than what is known of a variance
    for _ in 0..24 {
        let middle = (low * high).sqrt();
        *if weighed(&|d| 1.0 / (middle + d * d)) > dof { &mut low } else { &mut high } = middle;
    }
    high * dof
}

/// Analysis of variance of one channel.
fn scatter(observations: &Observations, channel: usize) -> Scatter {
    let row = |r: &Reading| {
        let value = r.observed[channel]?;
        let drawn = r.drawn.get(channel).copied().unwrap_or(0.0);
        Some((Row { repeat: r.repeat_of, series: r.series, value, weight: 1.0 }, drawn))
    };
    let mut read: Vec<(Row, f64)> = observations.readings.iter().filter_map(row).collect();
    let repeated = means(&read.iter().map(|r| r.0).collect::<Vec<Row>>(), |r| r.repeat);
    read.retain(|(r, _)| repeated[&r.repeat].1 > 1);
    if read.is_empty() {
        return Scatter::default();
    }
    let (rows, drawn): (Vec<Row>, Vec<f64>) = read.into_iter().unzip();
    let by_repeat = means(&rows, |r| r.repeat);
    let n = rows.len() as f64;
    let total_dof = n - by_repeat.len() as f64;
    // n_g − Σ n_gs²/n_g over repeats g and series s
    let mut in_both: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for row in &rows {
        *in_both.entry((row.repeat, row.series)).or_default() += 1.0;
    }
    let squares: f64 = in_both.iter().map(|((g, _), count)| count * count / by_repeat[g].1 as f64).sum();
    let series = means(&rows, |r| r.series).len();
    let within_dof = total_dof - series as f64 + components(&rows) as f64;
    Scatter {
        within: beyond_drawn(&rows, &drawn, within_dof, remove_repeats_and_series),
        within_dof,
        total: beyond_drawn(&rows, &drawn, total_dof, remove_repeats),
        total_dof,
        series_weight: n - squares,
    }
}

/// Ratio of the zero's deviation to that of a reading within its series, as covariances declare it for a channel.
fn declared_zero(observations: &Observations, channel: usize) -> f64 {
    let rows = || observations.readings.iter().filter(|r| r.observed[channel].is_some());
    let shares = rows().filter_map(|r| r.covariance.as_ref().map(|c| c.zero_share()));
    let share = shares.fold(0.0, |sum, share| sum + share) / rows().count() as f64;
    (share / (1.0 - share)).sqrt()
}

/// See [`Noise::declared_share`], for deviations of readings and of zeros by channel.
fn declared_share(observations: &Observations, deviations: [&[f64]; 2]) -> [f64; 2] {
    let (mut ratios, mut count) = ([0.0; 2], 0.0);
    for r in &observations.readings {
        let Some(covariance) = &r.covariance else { continue };
        for c in (0..r.observed.len()).filter(|c| r.observed[*c].is_some()) {
            let (within, between) = covariance.deviations(c);
            ratios[0] += (deviations[0][c] / within).powi(2);
            ratios[1] += if between > 0.0 { (deviations[1][c] / between).powi(2) } else { 1.0 };
            count += 1.0;
        }
    }
    if count > 0.0 { ratios.map(|sum| (sum / count).sqrt().min(1.0)) } else { [1.0; 2] }
}

/// A channel whose noise is not known: neither enough repeats nor a declared deviation above 0 for every reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownNoise {
    /// Which.
    pub channel: usize,
}

impl Noise {
    /// From repeats where there are some, else as declared.
    ///
    /// # Errors
    /// Neither enough repeats nor declared deviations above 0.
    pub fn estimate(observations: &Observations, rules: &Rules) -> Result<Self, UnknownNoise> {
        let channels = &observations.channels;
        let scatters: Vec<Scatter> = (0..channels.len()).map(|c| scatter(observations, c)).collect();
        let of_kind = |kind: usize| (0..channels.len()).filter(move |c| channels[*c].kind == kind);
        let pooled = |kind: usize| of_kind(kind).fold(Scatter::default(), |sum, c| sum.plus(scatters[c]));
        let pools: Vec<Scatter> = (0..observations.kinds()).map(pooled).collect();
        let is_used = observations.used_channels();
        let used: Vec<usize> = (0..channels.len()).filter(|c| is_used[*c]).collect();
        // a declared deviation is better than a few repeats
        let is_declared = |r: &Reading| r.covariance.is_some() || r.sigma.iter().any(Option::is_some);
        let declared = observations.readings.iter().any(is_declared);
        let needed = if declared { rules.min_dof_beside_declared } else { rules.min_dof_of_kind };
        // the rounding of the file is noise as well
        let least = |c: usize| channels[c].resolution / 12.0_f64.sqrt();
        // copied rows repeat nothing
        let is_copied = |c: &usize| pools[channels[*c].kind].of_reading() <= MAX_COPIED * channels[*c].resolution;
        let is_known = used.iter().all(|c| pools[channels[*c].kind].total_dof >= needed);
        if !is_known || (declared && used.iter().all(is_copied)) {
            return Self::declared(observations, &used);
        }
        let [mut within, mut unrounded, mut between] = [(); 3].map(|()| vec![0.0; channels.len()]);
        let mut is_zero_open = vec![false; channels.len()];
        for c in &used {
            let own = scatters[*c];
            let pool = pools[channels[*c].kind];
            let taken = |freedom: f64| if freedom >= rules.min_dof_of_channel { own } else { pool };
            let s = taken(own.total_dof).of_reading();
            let t = taken(own.zero_dof()).of_zero(rules.min_dof_of_verdict);
            within[*c] = s.max(least(*c));
            let freedom = taken(own.total_dof).total_dof;
            unrounded[*c] = rounding::of_repeats(s, freedom, channels[*c].resolution);
            is_zero_open[*c] = t.is_none();
            between[*c] = t.unwrap_or_else(|| s * declared_zero(observations, *c));
        }
        let dof = used.iter().map(|c| scatters[*c].total_dof).sum();
        let declared_share = declared_share(observations, [&within, &between]);
        Ok(Self { source: NoiseSource::Repeats, within, unrounded, between, dof, declared_share, is_zero_open })
    }

    /// As declared, whatever repeats show.
    ///
    /// # Errors
    /// A channel with readings for which none is declared, or none above 0.
    pub fn as_declared(observations: &Observations) -> Result<Self, UnknownNoise> {
        let is_used = observations.used_channels();
        Self::declared(observations, &(0..is_used.len()).filter(|c| is_used[*c]).collect::<Vec<_>>())
    }

    fn declared(observations: &Observations, used: &[usize]) -> Result<Self, UnknownNoise> {
        let channels = &observations.channels;
        let [mut within, mut unrounded, mut between] = [(); 3].map(|()| vec![0.0; channels.len()]);
        for c in used {
            let rows: Vec<_> = observations.readings.iter().filter(|r| r.observed[*c].is_some()).collect();
            let declared: Vec<(f64, f64)> = rows.iter().filter_map(|r| r.declared(*c, channels[*c].kind)).collect();
            if declared.len() < rows.len() {
                return Err(UnknownNoise { channel: *c });
            }
            let n = declared.len() as f64;
            let mean_square = declared.iter().map(|d| d.0 * d.0).sum::<f64>() / n;
            if mean_square == 0.0 {
                return Err(UnknownNoise { channel: *c });
            }
            let floor = channels[*c].resolution / 12.0_f64.sqrt();
            within[*c] = mean_square.sqrt().max(floor);
            unrounded[*c] = rounding::of_declared(mean_square.sqrt(), channels[*c].resolution);
            between[*c] = (declared.iter().map(|d| d.1 * d.1).sum::<f64>() / n).sqrt();
        }
        let is_zero_open = vec![false; channels.len()];
        let (source, declared_share) = (NoiseSource::Declared, [1.0; 2]);
        Ok(Self { source, within, unrounded, between, dof: 0.0, declared_share, is_zero_open })
    }

    /// Standard deviation of one reading within its series: the one declared for it where that is the noise's source, no less
    /// than its digits can say, or else its channel's, no less than its share of what a covariance declares.
    pub fn within_of(&self, observations: &Observations, reading: usize, channel: usize) -> f64 {
        let c = &observations.channels[channel];
        let floor = c.resolution / 12.0_f64.sqrt();
        match (self.source, observations.readings[reading].declared(channel, c.kind)) {
            (NoiseSource::Declared, Some((within, _))) => within.max(floor),
            _ => self.within[channel].max(self.together_of(observations, reading, channel).0),
        }
    }

    /// Standard deviation of the zero that a reading shares with its series, likewise.
    pub fn between_of(&self, observations: &Observations, reading: usize, channel: usize) -> f64 {
        let kind = observations.channels[channel].kind;
        match (self.source, observations.readings[reading].declared(channel, kind)) {
            (NoiseSource::Declared, Some((_, between))) => between,
            _ => self.between[channel].max(self.together_of(observations, reading, channel).1),
        }
    }

    /// The part of these that goes together with other channels.
    pub(crate) fn together_of(&self, observations: &Observations, reading: usize, channel: usize) -> (f64, f64) {
        let covariance = observations.readings[reading].covariance.as_ref();
        let (within, between) = covariance.map_or((0.0, 0.0), |c| c.deviations(channel));
        (self.declared_share[0] * within, self.declared_share[1] * between)
    }

    /// Variance of one reading about the model: its own noise, that of its zero, and the error that it draws beside.
    pub fn variance_of(&self, observations: &Observations, reading: usize, channel: usize) -> f64 {
        let drawn = observations.readings[reading].drawn.get(channel).copied().unwrap_or(0.0);
        let of = |deviation: f64| deviation * deviation;
        of(self.within_of(observations, reading, channel))
            + of(self.between_of(observations, reading, channel))
            + of(drawn)
    }

    /// Variance of one reading of a channel about the model: its own noise and that of its zero.
    pub fn variance(&self, channel: usize) -> f64 {
        self.within[channel].powi(2) + self.between[channel].powi(2)
    }
}

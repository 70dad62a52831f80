//! What speaks against the readings' noise: too few repeats, repeats that differ beyond all others, channels that always say the same.

use std::collections::{BTreeMap, HashSet};

use pkm_diagnosis::robust::upper_median;
use pkm_diagnosis::verdict::LackOfFit;
use pkm_diagnosis::{Noise, NoiseSource, Observations, Rules, rounding};

use super::reading_rules::{
    MAX_SHARE_OF_DECLARED_VARIANCE, MAX_SPREAD_RATIO, MIN_CONSTANT_READINGS, MIN_NUMBERS_OF_DECLARED_NOISE,
    MIN_SHARE_OF_DECLARED_VARIANCE,
};
use super::warning::{Warning, WarningKind};
use crate::error::{Failure, Result};
use crate::files::dataset::READ_COLUMNS;
use crate::files::readings::{CHANNELS, Readings};

/// Deviation of a number that is rounded to a resolution, as a share of it, with some room for the last bit.
const READ_ROUNDING: f64 = 0.288_68;

/// Most repeats that are named.
const MAX_NAMED: usize = 3;

/// Whether the noise is known from so few repeats that nothing counts as explained.
pub fn is_little_known(noise: &Noise, rules: &Rules) -> bool {
    noise.source == NoiseSource::Repeats && noise.dof < rules.min_dof_of_verdict
}

/// Of noise that is known from few repeats.
pub fn of_noise(noise: &Noise, rules: &Rules) -> Option<Warning> {
    let least = rules.min_dof_of_verdict;
    is_little_known(noise, rules).then(|| Warning::new(WarningKind::FewDegreesOfFreedom, format!(
            "the noise is known from {:.0} degrees of freedom only, all channels together, so that nothing counts as explained: repeat at \
             least {:.0} more numbers (a row has one in each channel; same pose, load and direction; twenty are good), or declare it in \
             the columns sigma_linear_um and sigma_angular_urad",
            noise.dof,
            (least - noise.dof).ceil()
        )))
}

/// A column that is read in steps which are coarse beside its noise.
#[derive(Clone, Copy, Debug)]
pub struct Coarse {
    /// Which.
    pub column: &'static str,
    /// µm or µrad.
    pub step: f64,
    /// What its readings scatter by before they are rounded, likewise.
    pub noise: f64,
}

/// All of them.
pub fn coarse(read: &Observations, noise: &Noise) -> Vec<Coarse> {
    // as it is written, 10 and not 9.999999999999998
    let micro = |si: f64| (1e12 * si).round() / 1e6;
    let of = |(c, _): (usize, f64)| Coarse {
        column: READ_COLUMNS[c],
        step: micro(read.channels[c].resolution),
        noise: micro(noise.unrounded[c]),
    };
    rounding::coarse(read, noise).into_iter().map(of).collect()
}

/// Of repeats that are equal to the last digit, as far as they were written: copied rows are no repeats.
pub fn of_copies(noise: &Noise, readings: &Readings) -> Option<Warning> {
    let is_used = readings.channels();
    let mut used = (0..CHANNELS).filter(|c| is_used[*c]);
    let is_rounding = |c: usize| noise.within[c] <= READ_ROUNDING * readings.resolution[c];
    let all = noise.source == NoiseSource::Repeats && used.all(is_rounding) && !differ(readings);
    all.then(|| Warning::new(WarningKind::EqualRepeats, "repeats are equal to the last digit, so that the noise is taken for that of rounding: were rows copied? What is read again \
                  differs"
            .into()))
}

/// Whether a repeat is a step off the first of its load, as those of a coarse dial are at times.
fn differ(readings: &Readings) -> bool {
    let repeats = readings.readings.iter().map(|r| r.repeat_of + 1).max().unwrap_or(0);
    let mut first = vec![None; repeats];
    readings.readings.iter().any(|r| {
        let first = first[r.repeat_of].get_or_insert(r.observed);
        let is_off = |c: usize| Some((r.observed[c]? - first[c]?).abs() > 0.5 * readings.resolution[c]);
        (0..CHANNELS).any(|c| is_off(c) == Some(true))
    })
}

/// Of a declared noise of which a fit leaves far less, or more: it is not that of the readings, or the model is wrong.
pub fn of_declared(after: &LackOfFit, numbers: usize) -> Option<Warning> {
    let LackOfFit { noise_source, statistic, .. } = *after;
    if noise_source != NoiseSource::Declared || numbers < MIN_NUMBERS_OF_DECLARED_NOISE {
        return None;
    }
    let left = statistic.sqrt();
    if statistic < MIN_SHARE_OF_DECLARED_VARIANCE {
        return Some(Warning::new(
            WarningKind::DeclaredNoiseTooGreat,
            format!(
                "the model leaves {left:.3} of the noise that is declared, which is too little to be chance: are sigma_linear_um in µm and \
             sigma_angular_urad in µrad? An effect that is less than such a noise is not to be seen"
            ),
        ));
    }
    (statistic > MAX_SHARE_OF_DECLARED_VARIANCE).then(|| Warning::new(WarningKind::DeclaredNoiseTooSmall, format!(
            "the model leaves {left:.1} times the noise that is declared, and no repeats tell whether the model is wrong or readings \
             scatter by more than that, as they do where the resolution of a sensor is declared: repeat some loads"
        )))
}

/// Repeats of one load that differ in one channel by far more than the others do: not the noise of the rest.
pub struct WideRepeats {
    /// Of the readings.
    pub channel: usize,
    /// Lines of the file.
    pub lines: Vec<u64>,
    /// Greatest difference, m or rad.
    pub size: f64,
    /// The same over the median of all repeats of the channel.
    pub ratio: f64,
}

/// All of them, without some numbers: pairs of reading and channel.
pub fn wide_repeats(readings: &Readings, left_out: &[(usize, usize)]) -> Vec<WideRepeats> {
    let left_out: HashSet<&(usize, usize)> = left_out.iter().collect();
    let mut all = Vec::new();
    for channel in 0..CHANNELS {
        let mut repeats: BTreeMap<usize, Vec<(f64, u64)>> = BTreeMap::new();
        for (n, r) in readings.readings.iter().enumerate() {
            let value = r.observed[channel].filter(|_| !left_out.contains(&(n, channel)));
            if let Some(value) = value {
                repeats.entry(r.repeat_of).or_default().push((value, r.line));
            }
        }
        let spread = |values: &[(f64, u64)]| {
            let least = values.iter().map(|v| v.0).fold(f64::INFINITY, f64::min);
            let most = values.iter().map(|v| v.0).fold(f64::NEG_INFINITY, f64::max);
            most - least
        };
        let spreads: Vec<(f64, Vec<(f64, u64)>)> =
            repeats.into_values().filter(|v| v.len() > 1).map(|v| (spread(&v), v)).collect();
        // of those that differ: of numbers in steps most do not
        let mut differ: Vec<f64> = spreads.iter().map(|s| s.0).filter(|size| *size > 0.0).collect();
        let Some(usual) = upper_median(&mut differ).map(|usual| usual.max(readings.resolution[channel])) else {
            continue;
        };
        let wide = spreads.into_iter().filter(|(size, _)| *size > MAX_SPREAD_RATIO * usual);
        all.extend(wide.map(|(size, values)| WideRepeats {
            channel,
            lines: values.into_iter().map(|v| v.1).collect(),
            size,
            ratio: size / usual,
        }));
    }
    all
}

/// What a diagnosis says of them.
pub fn of_repeats(readings: &Readings, left_out: &[(usize, usize)]) -> Option<Warning> {
    let wide = wide_repeats(readings, left_out);
    let name = |w: &WideRepeats| format!("line {}, {}: by {:.1}", w.lines[0], READ_COLUMNS[w.channel], w.size * 1e6);
    let named: Vec<String> = wide.iter().take(MAX_NAMED).map(name).collect();
    let more = wide.len() - named.len();
    let others = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!named.is_empty()).then(|| Warning::new(WarningKind::RepeatsDiffer, format!(
            "repeats differ by more than {MAX_SPREAD_RATIO} times as much as the others of their column ({}{others}, µm or µrad): are \
             they of one load, and written right?",
            named.join("; ")
        )))
}

/// Refuses a channel in which all numbers are one under different loads: it was not measured.
///
/// # Errors
/// The first such channel.
pub fn constant_channels(readings: &Readings) -> Result<()> {
    for (channel, column) in (0..CHANNELS).zip(READ_COLUMNS) {
        let of = |r: &crate::files::readings::Reading| Some((r.observed[channel]?, r.condition, r.line));
        let mut all = readings.readings.iter().filter_map(of);
        let Some((value, condition, line)) = all.next() else { continue };
        let rest: Vec<_> = all.collect();
        let is_loaded_otherwise = rest.iter().any(|r| r.1 != condition);
        if rest.len() + 1 >= MIN_CONSTANT_READINGS && is_loaded_otherwise && rest.iter().all(|r| r.0 == value) {
            let message = format!(
                "all {} numbers are {}: leave the cells blank if it was not measured",
                rest.len() + 1,
                value * 1e6
            );
            return Err(Failure::input(message).in_file(&readings.source.name).at_line(line).at_column(column));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{condition, reading, readings};
    use super::*;

    #[test]
    fn repeats_that_differ_far_more_than_the_others_are_named() {
        let mut rng = fastrand::Rng::with_seed(5);
        let mut all = Vec::new();
        for c in 0..12 {
            for series in 0..2 {
                let value = 1e-5 * f64::from(c) + 1e-6 * rng.f64();
                let more = if c == 7 && series == 1 { 9e-5 } else { 0.0 };
                let mut own = reading(c as usize, series, [Some(value + more); CHANNELS]);
                own.observed[1..].fill(None);
                own.line = 10 * c as u64 + series as u64;
                all.push(own);
            }
        }
        let conditions = (0..12).map(|n| condition(0, [f64::from(n), 0.0, 0.0, 0.0, 0.0, 0.0])).collect();
        let read = readings(conditions, all);
        let warning = of_repeats(&read, &[]).unwrap();
        assert!(warning.message.contains("line 70, dx_um: by 89.9"), "{}", warning.message);
        assert_eq!(wide_repeats(&read, &[])[0].lines, [70, 71]);
        // left out as a gross error it is said there
        assert!(of_repeats(&read, &[(15, 0)]).is_none());
        assert!(constant_channels(&read).is_ok());
    }
}

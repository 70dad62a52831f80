//! What speaks against the readings' noise: too few repeats, repeats that differ beyond all others, channels that always say the same.

use std::collections::BTreeMap;

use pkm_diagnosis::verdict::LackOfFit;
use pkm_diagnosis::{Noise, NoiseSource, Rules};

use super::reading_rules::{
    MAX_SPREAD_RATIO, MIN_CONSTANT_READINGS, MIN_NUMBERS_OF_DECLARED_NOISE, MIN_SHARE_OF_DECLARED_VARIANCE,
};
use super::warning::{Warning, WarningKind};
use crate::error::{Failure, Result};
use crate::files::dataset::READ_COLUMNS;
use crate::files::readings::{CHANNELS, Readings};

/// Deviation of a number that is rounded to a resolution, as a share of it, with some room for the last bit.
const READ_ROUNDING: f64 = 0.288_68;

/// Most repeats that are named.
const MOST_NAMED: usize = 3;

/// Whether the noise is known from so few repeats that nothing counts as explained.
pub fn is_little_known(noise: &Noise, rules: &Rules) -> bool {
    noise.source == NoiseSource::Repeats && noise.dof < rules.min_dof_of_verdict
}

/// Of noise that is known from few repeats.
pub fn of_noise(noise: &Noise, rules: &Rules) -> Option<Warning> {
    let least = rules.min_dof_of_verdict;
    is_little_known(noise, rules).then(|| Warning::new(WarningKind::FewDegreesOfFreedom, format!(
            "the noise is known from {:.0} degrees of freedom only, so that nothing counts as explained: repeat at least {:.0} more \
             numbers (same pose, load and direction; twenty are good), or declare it in the columns sigma_linear_um and \
             sigma_angular_urad",
            noise.dof,
            (least - noise.dof).ceil()
        )))
}

/// Of repeats that are equal to the last digit, as far as they were written: copied rows are no repeats.
pub fn of_copies(noise: &Noise, readings: &Readings) -> Option<Warning> {
    let is_used = readings.channels();
    let mut used = (0..CHANNELS).filter(|c| is_used[*c]);
    let is_rounding = |c: usize| noise.within[c] <= READ_ROUNDING * readings.resolution[c];
    let all = noise.source == NoiseSource::Repeats && used.all(is_rounding);
    all.then(|| Warning::new(WarningKind::EqualRepeats, "repeats are equal to the last digit, so that the noise is taken for that of rounding: were rows copied? What is read again \
                  differs"
            .into()))
}

/// Of a declared noise of which a fit leaves far less: it is not that of the readings.
pub fn of_declared(after: &LackOfFit, numbers: usize) -> Option<Warning> {
    let LackOfFit { noise_source, statistic, .. } = *after;
    let is_too_great = noise_source == NoiseSource::Declared
        && numbers >= MIN_NUMBERS_OF_DECLARED_NOISE
        && statistic < MIN_SHARE_OF_DECLARED_VARIANCE;
    is_too_great.then(|| Warning::new(WarningKind::DeclaredNoiseTooGreat, format!(
            "the model leaves {:.3} of the noise that is declared, which is too little to be chance: are sigma_linear_um in µm and \
             sigma_angular_urad in µrad? An effect that is less than such a noise is not to be seen",
            statistic.sqrt()
        )))
}

/// Greatest difference among the repeats of each load in a channel, with the line of the first of them.
fn spreads(readings: &Readings, channel: usize, left_out: &[(usize, usize)]) -> Vec<(f64, u64)> {
    let mut ranges: BTreeMap<usize, (f64, f64, u64, usize)> = BTreeMap::new();
    for (n, r) in readings.readings.iter().enumerate() {
        let Some(v) = r.observed[channel].filter(|_| !left_out.contains(&(n, channel))) else { continue };
        let range = ranges.entry(r.repeat_of).or_insert((v, v, r.line, 0));
        *range = (range.0.min(v), range.1.max(v), range.2, range.3 + 1);
    }
    ranges.into_values().filter(|r| r.3 > 1).map(|r| (r.1 - r.0, r.2)).collect()
}

/// Of repeats that differ by far more than the others: not the noise of the rest.
pub fn of_repeats(readings: &Readings, left_out: &[(usize, usize)]) -> Option<Warning> {
    let mut named: Vec<String> = Vec::new();
    for (channel, column) in READ_COLUMNS.iter().enumerate() {
        let all = spreads(readings, channel, left_out);
        let mut sizes: Vec<f64> = all.iter().map(|s| s.0).collect();
        sizes.sort_by(f64::total_cmp);
        let Some(middle) = sizes.get(sizes.len() / 2).map(|m| m.max(readings.resolution[channel])) else { continue };
        let far = all.iter().filter(|(size, _)| *size > MAX_SPREAD_RATIO * middle);
        named.extend(far.map(|(size, line)| format!("line {line}, {column}: by {:.1}", size * 1e6)));
    }
    let more = named.len().saturating_sub(MOST_NAMED);
    let others = if more > 0 { format!(" and {more} more") } else { String::new() };
    named.truncate(MOST_NAMED);
    (!named.is_empty()).then(|| Warning::new(WarningKind::RepeatsThatDiffer, format!(
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
        // left out as a gross error it is said there
        assert!(of_repeats(&read, &[(15, 0)]).is_none());
        assert!(constant_channels(&read).is_ok());
    }
}

//! Readings that a sensor spoils while a series is read: zeros that drift, values that do not move under other loads.

use std::collections::BTreeMap;

use pkm_diagnosis::drift::{Drift, drifts};
use pkm_diagnosis::{Observations, Rules};

use super::experiment::Experiment;
use super::reading_rules::{MAX_SOUND_DRIFT_SD, MAX_WARMING_K, MIN_STUCK_READINGS, MIN_STUCK_STEPS};
use super::warning::{Warning, WarningKind};
use crate::error::lines_text;
use crate::files::dataset::READ_COLUMNS;
use crate::files::readings::{CHANNELS, KINDS, Readings};

/// Of one channel, in its unit.
fn amount(channel: usize, value: f64) -> String {
    format!("{:.1} {}", value * 1e6, ["µm", "µrad"][KINDS[channel]])
}

/// Of zeros that drift. A machine that warms up while a series is read grows, which is no drift of the sensor.
pub fn of_drift(readings: &Readings, read: &Observations, rules: &Rules) -> Option<Warning> {
    let mut warmth = vec![[f64::INFINITY, f64::NEG_INFINITY]; readings.series_names.len()];
    for r in &readings.readings {
        let temperature_c = readings.conditions[r.condition].temperature_c;
        let [least, most] = &mut warmth[r.series];
        (*least, *most) = (least.min(temperature_c), most.max(temperature_c));
    }
    if warmth.iter().any(|[least, most]| most - least > MAX_WARMING_K) {
        return None;
    }
    let all = drifts(read, rules);
    let text = |d: &Drift| {
        let otherwise = if d.is_common { "" } else { " rms, in each series otherwise" };
        let (column, times) = (READ_COLUMNS[d.channel], d.over_noise);
        format!("{column} by {}{otherwise} ({times:.0} times the noise)", amount(d.channel, d.change))
    };
    let what = all.iter().map(text).collect::<Vec<String>>().join(", ");
    let count = all.iter().map(|d| d.series).max()?;
    let message = format!(
        "the zero drifts while a series is read, as repeats in {count} series show: from the first reading to the last {what}. What is \
         found may be this drift: let sensor and machine come to rest, read the zero again within each series, or the loads forth and \
         back"
    );
    let makes_unsound = all.iter().any(|d| d.over_noise > MAX_SOUND_DRIFT_SD);
    Some(Warning { makes_unsound, ..Warning::new(WarningKind::DriftWithinSeries, message) })
}

/// Least difference of two numbers of a channel: the step of what was read, whatever its digits.
fn step(readings: &Readings, channel: usize) -> Option<f64> {
    let mut all: Vec<f64> = readings.readings.iter().filter_map(|r| r.observed[channel]).collect();
    all.sort_by(f64::total_cmp);
    all.windows(2).map(|pair| pair[1] - pair[0]).filter(|d| *d > 0.0).min_by(f64::total_cmp)
}

/// What a channel of one sensor read in a series, in order: by gauge and point, where there are several.
fn rows(readings: &Readings, channel: usize) -> Vec<Vec<usize>> {
    let mut rows: BTreeMap<(usize, Vec<u64>), Vec<usize>> = BTreeMap::new();
    for (n, r) in readings.readings.iter().enumerate().filter(|(_, r)| r.observed[channel].is_some()) {
        let condition = &readings.conditions[r.condition];
        let sensor = condition.gauge.into_iter().flatten().chain(condition.point_m).map(f64::to_bits).collect();
        rows.entry((r.series, sensor)).or_default().push(n);
    }
    rows.into_values().collect()
}

/// Of values that stay the same under loads that move the declared machine by many of the sensor's steps.
pub fn of_stuck(readings: &Readings, experiment: &Experiment<'_>) -> Option<Warning> {
    let expected = experiment.model.predict(&experiment.poses, experiment.conditions, &[], &[])?;
    let mut stuck: Vec<(usize, Vec<usize>)> = Vec::new();
    for channel in 0..CHANNELS {
        let Some(step) = step(readings, channel) else { continue };
        let value = |n: usize| readings.readings[n].observed[channel];
        let is_stuck = |run: &&[usize]| {
            let moved = |n: &usize| expected[readings.readings[*n].condition][channel];
            let least = run.iter().map(moved).fold(f64::INFINITY, f64::min);
            let most = run.iter().map(moved).fold(f64::NEG_INFINITY, f64::max);
            run.len() >= MIN_STUCK_READINGS && most - least > MIN_STUCK_STEPS * step
        };
        for row in rows(readings, channel) {
            let runs = row.chunk_by(|a, b| value(*a) == value(*b)).filter(is_stuck);
            stuck.extend(runs.map(|run| (channel, run.to_vec())));
        }
    }
    let (channel, run) = stuck.first()?;
    let value = readings.readings[run[0]].observed[*channel]?;
    let mut lines: Vec<u64> = stuck.iter().flat_map(|(_, run)| run).map(|n| readings.readings[*n].line).collect();
    lines.sort_unstable();
    lines.dedup();
    let others = match stuck.len() {
        1 => String::new(),
        2 => ", and so does another run".to_owned(),
        count => format!(", and so do {} other runs", count - 1),
    };
    let message = format!(
        "{} reads {} {} times in a row while the load changes{others} ({}): a sensor that sticks, or a value that was copied down? Leave \
         these cells blank, or read them again",
        READ_COLUMNS[*channel],
        amount(*channel, value),
        run.len(),
        lines_text(&lines)
    );
    Some(Warning { lines, ..Warning::new(WarningKind::StuckReadings, message) })
}

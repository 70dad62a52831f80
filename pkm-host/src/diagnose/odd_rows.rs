//! Single rows that are not what the file says: read with the opposite sign, in another unit, or without the load that it should have.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use pkm_core::Wrench;
use pkm_diagnosis::Rules;
use pkm_diagnosis::robust::median;

use super::experiment::{Experiment, observations};
use super::model::Model;
use super::reading_rules::{
    MAX_LOST_SHARE, MAX_OTHER_UNIT_RATIO, MAX_REVERSED_COSINE, MAX_REVERSED_RATIO, MIN_LOST_SD, MIN_LOST_SIZE,
    MIN_MEDIAN_COSINE, MIN_OTHER_UNIT_LOADS, MIN_OTHER_UNIT_SD, MIN_REVERSED_SIZE,
};
use super::warning::WarningKind;
use crate::error::lines_text;
use crate::files::readings::{CHANNELS, Reading, Readings};

/// Rows with one thing wrong, in the file's order.
pub struct OddRows {
    /// For programs.
    pub kind: WarningKind,
    /// Which.
    pub rows: Vec<usize>,
    what: String,
    ask: String,
}

impl OddRows {
    /// Their lines.
    pub fn lines(&self, readings: &Readings) -> Vec<u64> {
        self.rows.iter().map(|n| readings.readings[*n].line).collect()
    }

    /// Whether many of them leave nothing to diagnose, whatever the other rows say.
    pub fn is_refused(&self) -> bool {
        self.kind == WarningKind::RowsInOtherUnit
    }

    /// For people.
    pub fn text(&self, readings: &Readings) -> String {
        let others = match self.lines(readings).as_slice() {
            [] | [_] => String::new(),
            [_, rest @ ..] => format!(" (as in {})", lines_text(rest)),
        };
        format!("{}{others}: {}", self.what, self.ask)
    }
}

/// All of them.
pub fn odd_rows(readings: &Readings, model: &Model, rules: &Rules) -> Vec<OddRows> {
    let experiment = Experiment::new(model, readings);
    let Some(declared) = model.predict(&experiment.poses, experiment.conditions, &[], &[]) else { return Vec::new() };
    let read = observations(readings, model);
    let of_noise = experiment.noise(&read, rules).ok().map(|noise| {
        let sd =
            |n: usize, channels: Range<usize>| channels.map(|c| noise.variance_of(&read, n, c)).sum::<f64>().sqrt();
        let small = [(0..3, "translations", "mm"), (3..6, "rotations", "mrad")]
            .into_iter()
            .filter_map(|group| in_other_unit(readings, &declared, &sd, group));
        small.chain(without_load(readings, &declared, &sd)).collect::<Vec<OddRows>>()
    });
    reversed(readings, &declared).into_iter().chain(of_noise.into_iter().flatten()).collect()
}

/// Rows whose deflection is next to nothing: in some channels, which have a name and a unit that is likely.
fn in_other_unit(
    readings: &Readings,
    declared: &[[f64; CHANNELS]],
    noise: &dyn Fn(usize, Range<usize>) -> f64,
    (channels, name, unit): (Range<usize>, &str, &str),
) -> Option<OddRows> {
    let size = |values: &dyn Fn(usize) -> f64| channels.clone().map(|c| values(c).powi(2)).sum::<f64>().sqrt();
    let sizes = |(n, r): (usize, &Reading)| {
        let count = channels.clone().filter(|c| r.observed[*c].is_some()).count();
        let said = size(&|c| r.observed[c].map_or(0.0, |_| declared[r.condition][c]));
        (count > 1 && said > 0.0).then(|| (n, size(&|c| r.observed[c].unwrap_or(0.0)) / said, said))
    };
    let rows: Vec<(usize, f64, f64)> = readings.readings.iter().enumerate().filter_map(sizes).collect();
    let usual = median(&mut rows.iter().map(|(.., ratio, _)| *ratio).collect::<Vec<f64>>())?;
    let is_small = |(n, ratio, said): &&(usize, f64, f64)| {
        *ratio < MAX_OTHER_UNIT_RATIO * usual && *said > MIN_OTHER_UNIT_SD * noise(*n, channels.clone())
    };
    let rows: Vec<usize> = rows.iter().filter(is_small).map(|(n, ..)| *n).collect();
    let load = |n: &usize| (readings.readings[*n].series, readings.readings[*n].condition);
    let loads: BTreeSet<(usize, usize)> = rows.iter().map(load).collect();
    (loads.len() >= MIN_OTHER_UNIT_LOADS).then(|| OddRows {
        kind: WarningKind::RowsInOtherUnit,
        rows,
        what: format!("the {name} are next to nothing, unlike what the load gives in other rows"),
        ask: format!("are they in {unit}, or was the load not there?"),
    })
}

/// Cosine between the translations that were read and those that the machine gives, and the sizes of both.
fn cosine(reading: &Reading, expected: &[f64; CHANNELS]) -> Option<(f64, [f64; 2])> {
    let pairs = || (0..3).filter_map(|c| Some((reading.observed[c]?, expected[c])));
    let sum = |of: fn((f64, f64)) -> f64| pairs().map(of).sum::<f64>();
    let (read, said) = (sum(|(a, _)| a * a).sqrt(), sum(|(_, b)| b * b).sqrt());
    (read * said > 0.0).then(|| (sum(|(a, b)| a * b) / (read * said), [read, said]))
}

/// Rows that were read with the opposite sign. A small deflection may be less than the error of the zero reading.
fn reversed(readings: &Readings, declared: &[[f64; CHANNELS]]) -> Option<OddRows> {
    let of = |(n, r): (usize, &Reading)| Some((n, cosine(r, &declared[r.condition])?));
    let rows: Vec<(usize, (f64, [f64; 2]))> = readings.readings.iter().enumerate().filter_map(of).collect();
    let (mut cosines, mut sizes): (Vec<f64>, Vec<f64>) =
        rows.iter().map(|(_, (cosine, [_, said]))| (cosine.abs(), *said)).unzip();
    let is_clear = median(&mut cosines)? > MIN_MEDIAN_COSINE;
    let least = MIN_REVERSED_SIZE * median(&mut sizes)?;
    let is_reversed = |(_, (cosine, [read, said])): &&(usize, (f64, [f64; 2]))| {
        // a digit that slipped turns it too
        *cosine < MAX_REVERSED_COSINE && *said > least && *read < MAX_REVERSED_RATIO * said
    };
    let rows: Vec<usize> = rows.iter().filter(is_reversed).map(|(n, _)| *n).collect();
    (is_clear && !rows.is_empty()).then_some(OddRows {
        kind: WarningKind::ReversedSign,
        rows,
        what: "the deflection has the opposite sign of what the load gives, unlike in other rows".into(),
        ask: "is the sign of the load or of the readings reversed?".into(),
    })
}

/// How far the tip of a row without a load is from the zero of its series, which the loaded rows tell, and the median deflection of these.
fn beyond_zero(row: &Reading, loaded: &[&Reading], expected: &dyn Fn(&Reading, usize) -> f64) -> Option<(f64, f64)> {
    let size = |r: &&Reading| (0..3).map(|c| expected(r, c).powi(2)).sum::<f64>().sqrt();
    let usual = median(&mut loaded.iter().map(size).collect::<Vec<f64>>())?;
    let mut squares = 0.0;
    for (c, read) in row.observed.iter().enumerate().take(3).filter_map(|(c, read)| Some((c, (*read)?))) {
        let zero = |r: &&Reading| Some(r.observed[c]? - expected(r, c));
        squares += (read - median(&mut loaded.iter().filter_map(zero).collect::<Vec<f64>>())?).powi(2);
    }
    Some((squares.sqrt(), usual))
}

/// Rows without a load whose tip has moved as under one: the load was lost.
fn without_load(
    readings: &Readings,
    declared: &[[f64; CHANNELS]],
    noise: &dyn Fn(usize, Range<usize>) -> f64,
) -> Option<OddRows> {
    let is_loaded = |r: &&Reading| readings.conditions[r.condition].wrench != Wrench::ZERO;
    // declared stiffnesses may all be off
    let pairs = readings.readings.iter().filter(is_loaded).flat_map(|r| (0..3).map(move |c| (r, c)));
    let ratio = |(r, c): (&Reading, usize)| Some(r.observed[c]? / declared[r.condition][c]).filter(|k| k.is_finite());
    let scale = median(&mut pairs.filter_map(ratio).collect::<Vec<f64>>())?;
    let expected = |r: &Reading, c: usize| scale * declared[r.condition][c];
    let mut series: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    readings.readings.iter().enumerate().for_each(|(n, r)| series.entry(r.series).or_default().push(n));
    let (mut free_rows, mut rows) = (0, Vec::new());
    for of_series in series.into_values() {
        let is_loaded = |n: &usize| is_loaded(&&readings.readings[*n]);
        let (loaded, free): (Vec<usize>, Vec<usize>) = of_series.into_iter().partition(is_loaded);
        let loaded: Vec<&Reading> = loaded.iter().map(|n| &readings.readings[*n]).collect();
        free_rows += free.len();
        let is_lost = |n: &usize| {
            beyond_zero(&readings.readings[*n], &loaded, &expected)
                .is_some_and(|(off, usual)| off > MIN_LOST_SIZE * usual && off > MIN_LOST_SD * noise(*n, 0..3))
        };
        rows.extend(free.into_iter().filter(is_lost));
    }
    rows.sort_unstable();
    let are_few = rows.len() == 1 || rows.len() as f64 <= MAX_LOST_SHARE * free_rows as f64;
    (are_few && !rows.is_empty()).then_some(OddRows {
        kind: WarningKind::LoadMissing,
        rows,
        what: "there is no load, and the tip has moved as under one".into(),
        ask: "was the load lost?".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::Method;
    use super::super::model::Recorded;
    use super::super::tests::{condition, machine, reading, readings};
    use super::*;

    #[test]
    fn the_noise_that_a_lost_load_is_held_against_is_that_of_the_given_rules() {
        let model = Model::new(&machine(), Recorded::default(), Method::Formulas).unwrap();
        let loads = [0.0, 200.0, 300.0, 400.0, 0.0];
        let conditions: Vec<_> = loads.iter().map(|force| condition(0, [*force, 0.0, 0.0, 0.0, 0.0, 0.0])).collect();
        let poses = [readings(conditions.clone(), Vec::new()).poses[0].pose];
        let said = model.predict(&poses, &conditions, &[], &[]).unwrap();
        // four repeats of each load, in two series
        let rows = (0..17).map(|n| {
            // the machine had a load in the last row, which the file does not have
            let read = if n == 16 { said[3] } else { said[n / 4] };
            let error = 1e-8 * ((7 * n % 5) as f64 - 2.0);
            reading(n / 4, n % 2, read.map(|v| Some(v + error)))
        });
        let all = readings(conditions, rows.collect());
        let kinds = |rules: &Rules| odd_rows(&all, &model, rules).iter().map(|odd| odd.kind).collect::<Vec<_>>();
        assert_eq!(kinds(&Rules::DEFAULT), [WarningKind::LoadMissing]);
        // by these the repeats are too few to tell a noise
        assert!(kinds(&Rules { min_dof_of_kind: 1e6, ..Rules::DEFAULT }).is_empty());
    }
}

//! Readings against the declared machine: the checks that a diagnosis begins with, without its fits.

use std::collections::BTreeMap;

use pkm_core::Wrench;
use pkm_diagnosis::gross::median;
use pkm_diagnosis::{Problem, Rules, Whitener};

use super::super::experiment::{Experiment, observations};
use super::super::left_out::LeftOut;
use super::super::model::{Model, Recorded};
use super::super::{Method, check as check_usable, check_units, checks, single_poses, unknown_noise};
use super::DataWarning;
use crate::error::{Failure, lines_text};
use crate::files::dataset::READ_COLUMNS;
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Reading, Readings};

/// Kind of the warning that there is nothing to take the noise from.
pub(super) const UNKNOWN_NOISE: &str = "unknown_noise";
/// Kind of the warning of a row with the wrong sign.
const REVERSED_SIGN: &str = "reversed_sign";
/// Largest cosine between what was read and what the machine gives at which a row has the wrong sign.
const MAX_REVERSED_COSINE: f64 = -0.8;
/// Least median cosine of all rows, whatever its sign, at which a single one with the wrong sign is to be seen.
const MIN_MEDIAN_COSINE: f64 = 0.8;
/// Least deflection of such a row, as a share of the median of all.
const MIN_REVERSED_SIZE: f64 = 0.5;
/// Least deflection of a row without a load, beyond its series' zero, that is that of a load, as a share of the median of its series.
const MIN_LOST_SIZE: f64 = 0.5;
/// The same in standard deviations of the noise.
const MIN_LOST_SD: f64 = 8.0;
/// Rows without a load that may be those, as a share of all: where more are, the zero is another than the others of its series say.
const MAX_LOST_SHARE: f64 = 1.0 / 3.0;

fn model(file: &MachineFile, readings: &Readings) -> Option<Model> {
    let recorded = Recorded { temperatures: readings.has_temperature, unloading: readings.has_unloading };
    Model::new(file, recorded, Method::Formulas)
}

/// Rows that were read with the opposite sign, and rows whose load was lost, but at poses that a diagnosis names as a whole.
pub(super) fn check_rows(file: &MachineFile, readings: &Readings) -> Vec<DataWarning> {
    let Some(model) = model(file, readings) else { return Vec::new() };
    let left_out = LeftOut::new(file, readings, &model, &Rules::DEFAULT);
    of_rows(&readings.without_numbers(&left_out.of_poses), &model)
}

fn of_rows(readings: &Readings, model: &Model) -> Vec<DataWarning> {
    reversed(readings, model).into_iter().chain(without_load(readings, model)).collect()
}

/// Readings that are hundreds of times what the declared machine gives, or a hundredth.
pub(super) fn size(file: &MachineFile, readings: &Readings) -> Option<DataWarning> {
    let model = model(file, readings)?;
    let experiment = Experiment::new(&model, readings);
    let expected = model.predict(&experiment.poses, experiment.conditions, &[], &[])?;
    let failure = check_units(readings, &expected, &Rules::DEFAULT).err()?;
    Some(DataWarning::new("other_units", failure.message))
}

pub(super) fn check(file: &MachineFile, readings: &Readings) -> Vec<DataWarning> {
    let rules = &Rules::DEFAULT;
    let Some(model) = model(file, readings) else { return Vec::new() };
    let left_out = LeftOut::new(file, readings, &model, rules);
    let mut all = of_rows(&readings.without_numbers(&left_out.of_poses), &model);
    for pose in &left_out.poses {
        let lines = pose.rows(readings).map(|(_, r)| r.line).collect();
        all.push(DataWarning::new(single_poses::TAKEN_OTHERWISE, pose.text(readings)).at_lines(lines));
    }
    let whole_rows: Vec<u64> = all.iter().flat_map(|w| w.lines.clone()).collect();
    for outlier in &left_out.gross {
        let r = &readings.readings[outlier.reading];
        if !whole_rows.contains(&r.line) {
            let value = r.observed[outlier.channel].unwrap_or(f64::NAN) * 1e6;
            let message = format!(
                "{value:.2} is {:.0} standard deviations away from its repeats or from the declared machine: is it mistyped? A \
                 diagnosis leaves it out",
                outlier.studentised
            );
            all.push(
                DataWarning::new("gross_error", message)
                    .at_lines(vec![r.line])
                    .at_column(READ_COLUMNS[outlier.channel]),
            );
        }
    }
    let of_all = of_all(file, &readings.without_numbers(&left_out.numbers()), &model);
    if of_all.iter().any(|w| w.kind == checks::TAKEN_OTHERWISE) {
        // one slip that reverses many rows is no slip of each
        all.retain(|w| w.kind != REVERSED_SIGN);
    }
    all.extend(of_all);
    all
}

/// What ends a diagnosis before it begins, and no command that only reads.
fn refused(kind: &'static str, failure: &Failure) -> DataWarning {
    DataWarning::new(kind, format!("`diagnose` refuses these readings: {}", failure.message))
}

/// What speaks against the readings as a whole: too few, other units, another frame or sign.
fn of_all(file: &MachineFile, readings: &Readings, model: &Model) -> Vec<DataWarning> {
    let rules = &Rules::DEFAULT;
    let read = observations(readings, model);
    let experiment = Experiment::new(model, readings);
    let noise = match experiment.noise(&read, rules) {
        Ok(noise) => noise,
        Err(unknown) => return vec![refused(UNKNOWN_NOISE, &unknown_noise(readings, unknown))],
    };
    let whitener = Whitener::new(&read, &noise);
    let problem = Problem::new(&read, &whitener, &experiment, rules);
    if let Err(failure) = check_usable(readings, &problem, &experiment) {
        return vec![refused("cannot_be_diagnosed", &failure)];
    }
    let tip_m = file.wrist_parameters.tip_at_zero_m();
    let otherwise = checks::taken_otherwise(&problem, &whitener, model, readings, tip_m);
    otherwise.into_iter().map(|w| DataWarning::new(w.kind, w.message)).collect()
}

/// Cosine between the translations that were read and those that the machine gives, and the size of the latter.
fn cosine(reading: &Reading, expected: &[f64; CHANNELS]) -> Option<(f64, f64)> {
    let pairs = || (0..3).filter_map(|c| Some((reading.observed[c]?, expected[c])));
    let sum = |of: fn((f64, f64)) -> f64| pairs().map(of).sum::<f64>();
    let (read, said) = (sum(|(a, _)| a * a).sqrt(), sum(|(_, b)| b * b).sqrt());
    (read * said > 0.0).then(|| (sum(|(a, b)| a * b) / (read * said), said))
}

/// Rows that were read with the opposite sign. A small deflection may be less than the error of the zero reading.
fn reversed(readings: &Readings, model: &Model) -> Option<DataWarning> {
    let experiment = Experiment::new(model, readings);
    let expected = model.predict(&experiment.poses, experiment.conditions, &[], &[])?;
    let rows: Vec<(u64, (f64, f64))> =
        (readings.readings.iter()).filter_map(|r| Some((r.line, cosine(r, &expected[r.condition])?))).collect();
    let (mut cosines, mut sizes): (Vec<f64>, Vec<f64>) =
        rows.iter().map(|(_, (cosine, size))| (cosine.abs(), *size)).unzip();
    let is_clear = median(&mut cosines)? > MIN_MEDIAN_COSINE;
    let least = MIN_REVERSED_SIZE * median(&mut sizes)?;
    let is_reversed = |(_, (cosine, size)): &&(u64, (f64, f64))| *cosine < MAX_REVERSED_COSINE && *size > least;
    let found: Vec<u64> = rows.iter().filter(is_reversed).map(|(line, _)| *line).collect();
    let others = match found.as_slice() {
        [] => return None,
        [_] => String::new(),
        [_, rest @ ..] => format!(" (as in {})", lines_text(rest)),
    };
    let message = format!(
        "the deflection has the opposite sign of what the load gives, unlike in other rows{others}: is the sign of the load or of the \
         readings reversed?"
    );
    is_clear.then(|| DataWarning::new(REVERSED_SIGN, message).at_lines(found))
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
fn without_load(readings: &Readings, model: &Model) -> Option<DataWarning> {
    let experiment = Experiment::new(model, readings);
    let declared = model.predict(&experiment.poses, experiment.conditions, &[], &[])?;
    let is_loaded = |r: &&Reading| readings.conditions[r.condition].wrench != Wrench::ZERO;
    // declared stiffnesses may all be off
    let pairs = readings.readings.iter().filter(is_loaded).flat_map(|r| (0..3).map(move |c| (r, c)));
    let ratio = |(r, c): (&Reading, usize)| Some(r.observed[c]? / declared[r.condition][c]).filter(|k| k.is_finite());
    let scale = median(&mut pairs.filter_map(ratio).collect::<Vec<f64>>())?;
    let expected = |r: &Reading, c: usize| scale * declared[r.condition][c];
    let mut series: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    readings.readings.iter().enumerate().for_each(|(n, r)| series.entry(r.series).or_default().push(n));
    let read = observations(readings, model);
    let noise = experiment.noise(&read, &Rules::DEFAULT).ok()?;
    let noise_m = |n: usize| (0..3).map(|c| noise.variance_of(&read, n, c)).sum::<f64>().sqrt();
    let (mut rows, mut lost) = (0, Vec::new());
    for of_series in series.into_values() {
        let is_loaded = |n: &usize| is_loaded(&&readings.readings[*n]);
        let (loaded, free): (Vec<usize>, Vec<usize>) = of_series.into_iter().partition(is_loaded);
        let loaded: Vec<&Reading> = loaded.iter().map(|n| &readings.readings[*n]).collect();
        rows += free.len();
        let is_lost = |n: &usize| {
            beyond_zero(&readings.readings[*n], &loaded, &expected)
                .is_some_and(|(off, usual)| off > MIN_LOST_SIZE * usual && off > MIN_LOST_SD * noise_m(*n))
        };
        lost.extend(free.into_iter().filter(is_lost).map(|n| readings.readings[n].line));
    }
    lost.sort_unstable();
    let message = match lost.as_slice() {
        [] => return None,
        [_] => "there is no load, and the tip has moved as under one: was the load lost?".to_owned(),
        [_, rest @ ..] => {
            format!(
                "there is no load, and the tip has moved as under one (as in {}): was the load lost?",
                lines_text(rest)
            )
        }
    };
    (lost.len() as f64 <= MAX_LOST_SHARE * rows as f64 || lost.len() == 1)
        .then(|| DataWarning::new("load_missing", message).at_lines(lost))
}

//! Readings against the declared machine: the checks that a diagnosis begins with, without its fits.

use pkm_diagnosis::Rules;

use super::super::Method;
use super::super::experiment::Experiment;
use super::super::left_out::{LEFT_OUT, LeftOut};
use super::super::model::{Model, Recorded};
use super::super::odd_rows::OddRows;
use super::super::prepared::{Prepared, Refusal, check_units};
use super::super::warning::WarningKind;
use super::DataWarning;
use crate::files::dataset::READ_COLUMNS;
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;

fn model(file: &MachineFile, readings: &Readings) -> Option<Model> {
    Model::new(file, Recorded::of(file, readings), Method::Formulas)
}

fn of_rows(odd: &OddRows, readings: &Readings, more: &str) -> DataWarning {
    DataWarning::new(odd.kind, odd.text(readings) + more).at_lines(odd.lines(readings))
}

/// Readings that are hundreds of times what the declared machine gives, or a hundredth.
pub(super) fn size(file: &MachineFile, readings: &Readings) -> Option<DataWarning> {
    let model = model(file, readings)?;
    let experiment = Experiment::new(&model, readings);
    let expected = model.predict(&experiment.poses, experiment.conditions, &[], &[])?;
    let failure = check_units(readings, &expected, &Rules::DEFAULT).err()?;
    Some(DataWarning::new(WarningKind::OtherUnits, failure.message))
}

pub(super) fn check(file: &MachineFile, readings: &Readings, rules: &Rules) -> Vec<DataWarning> {
    let Some(model) = model(file, readings) else { return Vec::new() };
    let left_out = LeftOut::new(file, readings, &model, rules);
    let of_all = of_all(file, readings.without_numbers(&left_out.numbers()), &model, rules);
    let mut all: Vec<DataWarning> = left_out.rows.iter().map(|odd| of_rows(odd, readings, LEFT_OUT)).collect();
    let taken_as_said = of_all.iter().all(|w| w.kind != WarningKind::ReadingsTakenOtherwise);
    // one slip of many rows is no slip of each
    for odd in left_out.doubted.iter().filter(|odd| taken_as_said || odd.is_refused()) {
        all.push(of_rows(odd, readings, if odd.is_refused() { " `diagnose` refuses so many of them" } else { "" }));
    }
    for pose in &left_out.poses {
        let lines = pose.rows(readings).map(|(_, r)| r.line).collect();
        all.push(DataWarning::new(WarningKind::PoseTakenOtherwise, pose.text() + LEFT_OUT).at_lines(lines));
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
                DataWarning::new(WarningKind::GrossError, message)
                    .at_lines(vec![r.line])
                    .at_column(READ_COLUMNS[outlier.channel]),
            );
        }
    }
    all.extend(of_all);
    all
}

/// What ends a diagnosis before it begins, and no command that only reads.
fn refused(Refusal { kind, failure }: Refusal) -> DataWarning {
    DataWarning::new(kind, format!("`diagnose` refuses these readings: {}", failure.message))
}

/// What speaks against the readings as a whole: too few, other units, another frame or sign.
fn of_all(file: &MachineFile, readings: Readings, model: &Model, rules: &Rules) -> Vec<DataWarning> {
    let prepared = match Prepared::new(readings, model, rules) {
        Ok(prepared) => prepared,
        Err(refusals) => return refusals.into_iter().map(refused).collect(),
    };
    let mut all = match prepared.taken_otherwise(file.wrist_parameters.tip_at_zero_m()) {
        Ok(otherwise) => otherwise.into_iter().map(|w| DataWarning::new(w.kind, w.message)).collect(),
        Err(failure) => vec![refused(Refusal { kind: WarningKind::CannotBeDiagnosed, failure })],
    };
    all.extend(prepared.within_series().map(|w| DataWarning::new(w.kind, w.message).at_lines(w.lines)));
    all
}

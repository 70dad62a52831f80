//! Data-quality checks of measured data: what is doubtful about a file that can be read, before anything is fitted.
//!
//! `values`: single columns, such as angles in radians. `repeats`: what repeats say of noise and of each other. `model`: against
//! the declared machine, by the checks that a diagnosis begins with.

mod model;
mod repeats;
mod values;

use pkm_diagnosis::Rules;
use serde::Serialize;

use super::checks;
use super::warning::WarningKind;
use crate::files::dataset::Sheet;
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;

/// A reason to look at the readings before the machine.
#[derive(Clone, Debug, Serialize)]
pub struct DataWarning {
    /// What it is about, for programs.
    pub kind: WarningKind,
    /// The first line of the file that it is about, if it is about some.
    pub line: Option<u64>,
    /// All of them.
    pub lines: Vec<u64>,
    /// Column, where it is about one.
    pub column: Option<&'static str>,
    /// For people: what is doubtful, and what to do.
    pub message: String,
}

impl DataWarning {
    fn new(kind: WarningKind, message: impl Into<String>) -> Self {
        Self { kind, line: None, lines: Vec::new(), column: None, message: message.into() }
    }

    /// As a line of text about a file.
    pub fn text(&self, file: &str) -> String {
        let line = self.line.map_or(String::new(), |line| format!("{line}:"));
        let column = self.column.map_or(String::new(), |column| format!("{column}: "));
        format!("{file}:{line} {column}{}", self.message)
    }

    fn at_lines(mut self, lines: Vec<u64>) -> Self {
        self.line = lines.first().copied();
        self.lines = lines;
        self
    }

    fn at_column(mut self, column: &'static str) -> Self {
        self.column = Some(column);
        self
    }
}

/// What is doubtful about columns and rows, for a diagnosis, which by itself looks at the repeats and holds the readings against the
/// declared machine.
pub fn check_rows(sheet: &Sheet) -> Vec<DataWarning> {
    let mut all = values::check(sheet);
    all.extend(repeats::duplicates(sheet));
    all
}

/// Columns whose numbers are of the size of another unit: for poses and loads, whatever was read there.
pub fn check_columns(sheet: &Sheet) -> Vec<DataWarning> {
    values::units(sheet)
}

/// Columns whose numbers are of the size of another unit, and readings that are of another size than the declared machine gives: for a
/// log, whose single rows an estimator judges by itself.
pub fn check_units(file: &MachineFile, sheet: &Sheet, readings: &Readings) -> Vec<DataWarning> {
    let mut all = values::units(sheet);
    all.extend(model::size(file, readings));
    all
}

/// All that is doubtful, in the order of the checks. What stands out in several ways is said once: a row as a whole before its
/// numbers, a number among its repeats before its distance from the declared machine.
pub fn check(file: &MachineFile, sheet: &Sheet, readings: &Readings) -> Vec<DataWarning> {
    let rules = &Rules::DEFAULT;
    let of_model = model::check(file, readings, rules);
    let rows: Vec<u64> = of_model.iter().filter(|w| w.column.is_none()).flat_map(|w| w.lines.clone()).collect();
    let mut all = values::check(sheet);
    let of_repeats = repeats::check(sheet, readings, rules);
    all.extend(
        of_repeats.into_iter().filter(|w| w.column.is_none() || !w.lines.iter().any(|line| rows.contains(line))),
    );
    all.extend(checks::of_file(readings).into_iter().map(|w| DataWarning::new(w.kind, w.message)));
    let numbers: Vec<(u64, &str)> =
        all.iter().flat_map(|w| w.lines.iter().filter_map(|line| Some((*line, w.column?)))).collect();
    let is_new = |w: &DataWarning| {
        let is_said = w.kind == WarningKind::UnknownNoise && all.iter().any(|w| w.kind == WarningKind::FewRepeats);
        !is_said && !w.line.zip(w.column).is_some_and(|place| numbers.contains(&place))
    };
    let of_model: Vec<DataWarning> = of_model.into_iter().filter(is_new).collect();
    all.extend(of_model);
    all
}

//! Data-quality checks of measured data: what is doubtful about a file that can be read, before anything is fitted.
//!
//! `values`: single columns, such as angles in radians. `repeats`: what repeats say of noise and of each other. `model`: against
//! the declared machine, by the checks that a diagnosis begins with.

mod model;
mod repeats;
mod values;

use serde::Serialize;

use super::checks;
use crate::files::dataset::Sheet;
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;

/// A reason to look at the readings before the machine.
#[derive(Clone, Debug, Serialize)]
pub struct DataWarning {
    /// What it is about, for programs.
    pub kind: &'static str,
    /// Line of the file, where it is about one.
    pub line: Option<u64>,
    /// Column, where it is about one.
    pub column: Option<&'static str>,
    /// For people: what is doubtful, and what to do.
    pub message: String,
}

impl DataWarning {
    fn new(kind: &'static str, message: impl Into<String>) -> Self {
        Self { kind, line: None, column: None, message: message.into() }
    }

    /// As a line of text about a file.
    pub fn text(&self, file: &str) -> String {
        let line = self.line.map_or(String::new(), |line| format!("{line}:"));
        let column = self.column.map_or(String::new(), |column| format!("{column}: "));
        format!("{file}:{line} {column}{}", self.message)
    }

    fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    fn at_column(mut self, column: &'static str) -> Self {
        self.column = Some(column);
        self
    }
}

/// Lines for a message: the first of them, and how many more.
pub fn lines_text(lines: &[u64]) -> String {
    const SHOWN: usize = 6;
    let first: Vec<String> = lines.iter().take(SHOWN).map(u64::to_string).collect();
    let more = if lines.len() > SHOWN { format!(" and {} more", lines.len() - SHOWN) } else { String::new() };
    format!("{}{more}", first.join(", "))
}

/// All that is doubtful, in no order but that of the checks.
pub fn check(file: &MachineFile, sheet: &Sheet, readings: &Readings) -> Vec<DataWarning> {
    let mut all = values::check(sheet);
    all.extend(repeats::check(sheet, readings));
    all.extend(checks::of_file(readings).into_iter().map(|w| DataWarning::new(w.kind, w.message)));
    // the same number may stand out in several ways: the plainest is said
    let known: Vec<(Option<u64>, Option<&str>)> = all.iter().map(|w| (w.line, w.column)).collect();
    let is_new = |w: &DataWarning| w.line.is_none() || !known.contains(&(w.line, w.column));
    all.extend(model::check(file, readings).into_iter().filter(is_new));
    all
}

//! `check`: everything that is wrong or doubtful with measured data, without a fit.

use std::path::PathBuf;

use serde::Serialize;
use serde_json::{Value, json};

use super::arguments::ColumnsArgs;
use super::session::{Output, Session, counted};
use crate::diagnose::quality::{self, DataWarning};
use crate::error::{Failure, Result, lines_text};
use crate::files::machine::MachineFile;
use crate::files::measured::Measured;
use crate::files::readings::Readings;
use crate::files::source::Source;

/// Everything that is wrong or doubtful with a file of readings, without fitting anything.
///
/// Wrong is what no command reads: exit 2. Doubtful is what can be read and may mislead, such as angles that look like radians, a
/// channel that never changes, repeats that differ far more than others: exit 0. Nothing is written.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Measured data, also as a laboratory exports them.
    #[arg(value_name = "FILE")]
    data: PathBuf,
    #[command(flatten)]
    columns: ColumnsArgs,
}

/// Something to mend or to look at, as `--json` has it.
#[derive(Serialize)]
struct Problem {
    severity: &'static str,
    kind: Value,
    line: Option<u64>,
    /// All lines with the same problem.
    lines: Vec<u64>,
    column: Option<String>,
    message: String,
}

impl Problem {
    fn wrong(failure: &Failure, lines: Vec<u64>) -> Self {
        Self {
            severity: "wrong",
            kind: json!(failure.kind.name()),
            line: failure.line,
            lines,
            column: failure.column.clone(),
            message: failure.message.clone(),
        }
    }

    fn doubtful(warning: &DataWarning) -> Self {
        Self {
            severity: "doubtful",
            kind: json!(warning.kind),
            line: warning.line,
            lines: warning.lines.clone(),
            column: warning.column.map(str::to_owned),
            message: warning.message.clone(),
        }
    }
}

/// What makes two failures the same but for the row: column, and message without numbers and quotations.
type Shape = (Option<String>, String);

fn shape(failure: &Failure) -> Shape {
    let text = failure.message.split('`').step_by(2).flat_map(str::chars);
    (failure.column.clone(), text.filter(|c| !c.is_ascii_digit() && !"+-.e".contains(*c)).collect())
}

/// One failure for all that are the same but for the row, with their lines.
fn grouped(failures: Vec<Failure>) -> Vec<(Failure, Vec<u64>)> {
    let mut groups: Vec<(Shape, Failure, Vec<u64>)> = Vec::new();
    for failure in failures {
        let (shape, line) = (shape(&failure), failure.line);
        match groups.iter_mut().find(|(own, ..)| *own == shape) {
            Some((.., lines)) => lines.extend(line),
            None => groups.push((shape, failure, line.into_iter().collect())),
        }
    }
    let with_lines = |(_, mut failure, lines): (_, Failure, Vec<u64>)| {
        if lines.len() > 1 {
            failure.message.push_str(&format!(" (the same in {})", lines_text(&lines[1..])));
        }
        (failure, lines)
    };
    groups.into_iter().map(with_lines).collect()
}

/// What is wrong and what is doubtful in a file that has rows of readings, and how many rows and poses are right.
fn examine(file: &MachineFile, read: Measured) -> Result<(Vec<Failure>, Vec<DataWarning>, [usize; 2])> {
    let Measured { sheet, cases, mut failures, .. } = read;
    if cases.is_empty() {
        return Ok((failures, Vec::new(), [0; 2]));
    }
    let readings = Readings::new(&sheet, &cases, file.uncertainty.load_random)?;
    failures.extend(readings.require_deflections(&sheet).err());
    let doubtful = quality::check(file, &sheet, &readings);
    Ok((failures, doubtful, [cases.len(), readings.poses.len()]))
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let machine = session.machine()?;
    let source = Source::read(&args.data)?;
    let name = source.name.clone();
    let read = Measured::read(source, &machine, &args.columns.renames()).map_err(|failure| {
        let problems = [Problem::wrong(&failure, failure.line.into_iter().collect())];
        let document = json!({ "file": name, "readings": 0, "poses": 0, "conversions": [], "problems": problems });
        failure.with_others(Vec::new(), document)
    })?;
    let conversions = read.conversions.clone();
    session.warn(read.sheet.warnings.clone());
    let (failures, doubtful, [rows, poses]) = examine(&machine, read)?;
    let wrong = grouped(failures.into_iter().map(|failure| session.or_of_another_machine(failure)).collect());
    let problems: Vec<Problem> = wrong
        .iter()
        .map(|(failure, lines)| Problem::wrong(failure, lines.clone()))
        .chain(doubtful.iter().map(Problem::doubtful))
        .collect();
    let document =
        json!({ "file": name, "readings": rows, "poses": poses, "conversions": conversions, "problems": problems });
    session.warn(doubtful.iter().map(|w| w.text(&name)));
    let mut failures = wrong.into_iter().map(|(failure, _)| failure);
    if let Some(first) = failures.next() {
        return Err(first.with_others(failures.collect(), document));
    }
    let mut text: String = conversions.iter().map(|what| format!("- {what}\n")).collect();
    let doubtful = if doubtful.is_empty() { "nothing".into() } else { counted(doubtful.len(), "thing") };
    let (readings, at) = (counted(rows, "reading"), counted(poses, "pose"));
    text.push_str(&format!("{name}: {readings} at {at}; wrong: nothing; doubtful: {doubtful}\n"));
    session.output(text, &document)
}

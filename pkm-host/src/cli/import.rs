//! `import`: measured data as they were exported → the file of docs/formats.md.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::ColumnsArgs;
use super::session::{Output, Session, counted};
use crate::error::Result;
use crate::files::measured::{self, Measured};
use crate::files::readings::Readings;
use crate::files::source::{self, Source};

/// Measured data as a laboratory or a shop exports them, written as the CSV of docs/formats.md.
///
/// Read as they are: commas, semicolons or tabs; decimal points or commas; UTF-8, UTF-16, Windows-1252; titles above the header; names
/// in any case with units in brackets or in a row below; merged cells; - and n/a for what was not measured. Prints what was converted.
/// What is ambiguous is refused, with its line and column.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The exported file: text of a spreadsheet, a tracker, a load cell.
    #[arg(long, value_name = "FILE")]
    data: PathBuf,
    #[command(flatten)]
    columns: ColumnsArgs,
    /// CSV to write.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let Args { data, columns, out } = args;
    let machine = session.machine()?;
    let read = Measured::read(Source::read(data)?, &machine, &columns.renames())?;
    let conversions = read.conversions.clone();
    let more = read.failures.len().saturating_sub(1);
    let (sheet, cases) = read.complete().map_err(|mut failure| {
        if more > 0 {
            failure.message.push_str(&format!(" (and {more} more: `pkm-host check` lists them)"));
        }
        session.or_of_another_machine(failure)
    })?;
    session.warn(sheet.warnings.clone());
    let readings = Readings::new(&sheet, &cases, machine.uncertainty.load_random)?;
    source::write(out, measured::to_csv(&sheet), &[session.machine_path(), Some(data)])?;
    let (rows, poses) = (cases.len(), readings.poses.len());
    let mut text: String = conversions.iter().map(|what| format!("- {what}\n")).collect();
    let (readings, at) = (counted(rows, "reading"), counted(poses, "pose"));
    text.push_str(&format!("wrote {readings} at {at} to {}\n", out.display()));
    let document =
        json!({ "readings": rows, "poses": poses, "conversions": conversions, "out": out.display().to_string() });
    session.output(text, &document)
}

//! `diagnose`: from readings to what the model lacks.

use std::path::PathBuf;

use super::arguments::ColumnsArgs;
use super::bar::bar;
use super::session::{Output, Session};
use crate::diagnose::{self, Method, report, write};
use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;
use crate::files::source::{self, Source};

/// From measured deflections to the physics that the model lacks: adds it, and compares before and after.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Measured data, also as exported; default, for the reference machine alone: simulated readings.
    #[arg(long, value_name = "CSV")]
    data: Option<PathBuf>,
    /// Measured data to compare on; default: whole poses of --data in turn (cross-validation).
    #[arg(long, value_name = "CSV")]
    holdout: Option<PathBuf>,
    #[command(flatten)]
    columns: ColumnsArgs,
    /// Folder for diagnosis.json, machine.toml, coefficients.rs, coefficients.json, residuals.csv and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// `formulas`: effects with a formula, one after another. `places`: first where the machine yields, whatever the formula,
    /// then a formula only there; what has none is found as `element`. Rates of both: docs/trials.md.
    #[arg(long, value_enum, default_value = "places")]
    method: Method,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let Args { data, holdout, columns, out, method } = args;
    let columns = columns.renames();
    let file = session.machine()?;
    session.warn(file.wrist_warning());
    let source = session.read_or_fixture(data.as_deref(), pkm_fixtures::MEASURED, "--data", &file)?;
    let readings = Readings::read_renamed(source, &file, &columns)?;
    let read_held_out = |path| Readings::read_renamed(Source::read(path)?, &file, &columns);
    let held_out = holdout.as_deref().map(read_held_out).transpose()?;
    session.warn(readings.warnings.iter().chain(held_out.iter().flat_map(|h| &h.warnings)).cloned());
    if held_out.as_ref().is_some_and(|h| h.source.sha256() == readings.source.sha256()) {
        session.warn(["--holdout has the readings of --data, and says nothing of others".to_owned()]);
    }
    let diagnosis = diagnose::diagnose(&file, &readings, held_out.as_ref(), *method, &bar())?;
    let json = diagnosis.to_json();
    let machine_toml = write::machine_toml(&file, &diagnosis)?;
    let improved = MachineFile::parse(Source::from_text("machine.toml", machine_toml.clone()))?;
    let (rust, table, warning) = write::table(&file, &improved, &readings, &diagnosis)?;
    session.warn(warning);
    let html = report::html(&file, &readings, held_out.as_ref(), &diagnosis, &session.warnings)?;
    let wrote = source::write_all(
        out,
        &[
            ("diagnosis.json", source::json(&json)),
            ("machine.toml", machine_toml),
            ("coefficients.rs", rust),
            ("coefficients.json", table.to_json()),
            ("residuals.csv", write::residuals_csv(&readings, &diagnosis)),
            ("report.html", html),
        ],
        &[session.machine_path(), data.as_deref(), holdout.as_deref()],
    )?;
    session.output(report::text(&diagnosis) + &wrote, &json)
}

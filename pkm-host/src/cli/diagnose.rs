//! `diagnose`: from readings to what the model lacks.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::{ColumnsArgs, DateArgs};
use super::bar::bar;
use super::session::{Output, Session};
use crate::diagnose::{self, Method, Rules, quality, report, write};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;
use crate::files::source::{self, Source};
use crate::files::unloaded::Unloaded;
use crate::geometry;

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
    #[command(flatten)]
    date: DateArgs,
    /// Folder for diagnosis.json, machine.toml, coefficients.rs, coefficients.json, residuals.csv, covariance.csv and
    /// report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// `formulas`: effects with a formula, one after another. `places`: first where the machine yields, whatever the formula,
    /// then a formula only there; what has none is found as `element`. Rates of both: docs/trials.md.
    #[arg(long, value_enum, default_value = "places", conflicts_with = "unloaded")]
    method: Method,
    /// From unloaded poses, measured against commanded ones (tracker, ball bar), the true geometry: --data and --holdout have
    /// places or distances; --out gets geometry.json, machine.toml, residuals.csv and report.html.
    #[arg(long, conflicts_with = "columns")]
    unloaded: bool,
}

/// Of held-out readings that are those of the fit.
fn warn_if_same(session: &mut Session, data: &Source, holdout: Option<&Source>) {
    if holdout.is_some_and(|holdout| holdout.sha256() == data.sha256()) {
        session
            .warn(["--holdout is the same file as --data: its errors say nothing of other readings, so give others"
                .to_owned()]);
    }
}

/// `diagnose --unloaded`.
fn run_unloaded(args: &Args, session: &mut Session) -> Result<Output> {
    let file = session.machine()?;
    let Some(data) = args.data.as_deref() else {
        return Err(Failure::usage("--unloaded needs --data: no unloaded readings come with the program"));
    };
    let unloaded = Unloaded::read(Source::read(data)?, &file)?;
    let read = |path| Unloaded::read(Source::read(path)?, &file);
    let held_out = args.holdout.as_deref().map(read).transpose()?;
    session.warn(unloaded.warnings.iter().chain(held_out.iter().flat_map(|h| &h.warnings)).cloned());
    if unloaded.has_wrist() {
        session.warn(file.wrist_warning());
    }
    warn_if_same(session, &unloaded.source, held_out.as_ref().map(|h| &h.source));
    let found = geometry::identify(&file, &unloaded, held_out.as_ref())?;
    let json = found.to_json();
    let machine_toml = geometry::write::machine_toml(&file, &found)?;
    // what was written must be a machine
    MachineFile::parse(Source::from_text("machine.toml", machine_toml.clone()))?;
    let html = geometry::report::html(&file, &unloaded, held_out.as_ref(), &found, &session.warnings)?;
    let html = args.date.of(html);
    let wrote = source::write_all(
        &args.out,
        &[
            ("geometry.json", source::json(&json)),
            ("machine.toml", machine_toml),
            ("residuals.csv", geometry::write::residuals_csv(&unloaded, &found)),
            ("report.html", html),
        ],
        &[session.machine_path(), args.data.as_deref(), args.holdout.as_deref()],
    )?;
    session.output(geometry::report::text(&found) + &wrote, &json)
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    if args.unloaded {
        return run_unloaded(args, session);
    }
    let Args { data, holdout, columns, out, method, .. } = args;
    let columns = columns.renames();
    let file = session.machine()?;
    session.warn(file.wrist_warning());
    let source = session.read_or_fixture(data.as_deref(), pkm_fixtures::MEASURED, "--data", &file)?;
    let (sheet, readings) = Readings::read_conditions(source, &file, &columns)?;
    readings.require_deflections(&sheet)?;
    let read_held_out = |path| Readings::read_renamed(Source::read(path)?, &file, &columns);
    let held_out = holdout.as_deref().map(read_held_out).transpose()?;
    session.warn(readings.warnings.iter().chain(held_out.iter().flat_map(|h| &h.warnings)).cloned());
    session.warn(quality::check_rows(&sheet).iter().map(|w| w.text(&readings.source.name)));
    warn_if_same(session, &readings.source, held_out.as_ref().map(|h| &h.source));
    let diagnosis = diagnose::diagnose(&file, &readings, held_out.as_ref(), *method, &Rules::DEFAULT, &bar())?;
    let machine_toml = write::machine_toml(&file, &diagnosis)?;
    let improved = MachineFile::parse(Source::from_text("machine.toml", machine_toml.clone()))?;
    let mut json = diagnosis.to_json();
    (json["machine"], json["machine_sha256"]) = (json!(file.name), json!(file.source.sha256()));
    json["identified_sha256"] = json!(improved.source.sha256());
    (json["data"], json["data_sha256"]) = (json!(readings.source.file_name()), json!(readings.source.sha256()));
    json["readings"] = json!(write::shown_readings(&readings, &diagnosis));
    let shipped = write::table(&file, &improved, &readings, &diagnosis)?;
    session.warn(shipped.warnings);
    json["table_departure_um_rms"] = json!(shipped.departure_um_rms);
    let html = args.date.of(report::html(&file, &readings, held_out.as_ref(), &diagnosis, &session.warnings)?);
    let wrote = source::write_all(
        out,
        &[
            ("diagnosis.json", source::json(&json)),
            ("machine.toml", machine_toml),
            ("coefficients.rs", shipped.rust),
            ("coefficients.json", shipped.table.to_json()),
            ("residuals.csv", write::residuals_csv(&readings, &diagnosis)),
            ("covariance.csv", diagnosis.estimates.covariance_csv()),
            ("report.html", html),
        ],
        &[session.machine_path(), data.as_deref(), holdout.as_deref()],
    )?;
    session.output(report::text(&diagnosis) + &wrote, &json)
}

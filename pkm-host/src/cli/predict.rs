//! `predict`: measured data with the deflections of the model in place of the readings.

use std::path::PathBuf;

use pkm_core::StiffnessError;
use serde_json::json;

use super::arguments::{ColumnsArgs, TableArgs};
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::files::dataset::{self, READ_COLUMNS};
use crate::files::readings::{CHANNELS, Readings};
use crate::files::source;
use crate::plan::model::{Form, extrapolation_warning, no_factor_form, outside_box};

/// Measured data with the model's deflections in place of the readings.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// CSV with poses and wrenches; default, for the reference machine alone: simulated readings.
    #[arg(long, value_name = "CSV")]
    data: Option<PathBuf>,
    #[command(flatten)]
    columns: ColumnsArgs,
    #[command(flatten)]
    table: TableArgs,
    /// CSV to write.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let Args { data, columns, table, out } = args;
    let model = session.model(table)?;
    if let Some(t) = model.table.as_ref().filter(|t| table.form == Form::Auto && t.form == Form::Diagonal) {
        return Err(no_factor_form(&t.source, "or give --form diagonal to have it all the same"));
    }
    let source = session.read_or_fixture(data.as_deref(), pkm_fixtures::MEASURED, "--data", &model.machine)?;
    let file = source.name.clone();
    let (sheet, readings) = Readings::read_conditions(source, &model.machine, &columns.renames())?;
    session.warn(sheet.warnings.clone());
    let conditions: Vec<_> = readings.readings.iter().map(|r| readings.conditions[r.condition]).collect();
    let at = conditions.iter().map(|c| (&readings.poses[c.pose], c.temperature_c));
    let solved = model.solve(at).map_err(|f| f.in_file(&file))?;
    session.warn(extrapolation_warning(&solved));

    let mut header = sheet.header.clone();
    let is_read = |channel: &usize| conditions.iter().any(|c| c.channels().contains(channel));
    let channels: Vec<usize> = (0..CHANNELS).filter(is_read).collect();
    let missing = channels.iter().map(|c| READ_COLUMNS[*c]).filter(|c| !sheet.header.iter().any(|h| h == c));
    header.extend(missing.map(str::to_owned));
    let columns = READ_COLUMNS.map(|c| header.iter().position(|h| h == c));
    let mut rows = Vec::new();
    for ((row, c), solved) in sheet.rows.iter().zip(&conditions).zip(&solved) {
        let failed = |e: StiffnessError| Failure::input(format!("no deflection: {e}")).in_file(&file).at_line(row.line);
        let seen = model.deflection(solved, &readings.poses[c.pose].pose, c).map_err(failed)?;
        let mut cells = row.to_cells();
        cells.resize(header.len(), String::new());
        let micro = c.read(seen.to_vector().into()).map(|v| v * 1e6);
        for channel in c.channels() {
            columns[channel].into_iter().for_each(|column| cells[column] = sheet.written(micro[channel]));
        }
        rows.push(cells);
    }
    let count = rows.len();
    let inputs = [session.machine_path(), data.as_deref(), table.table.as_deref()];
    source::write(out, dataset::to_csv(sheet.delimiter(), &header, rows), &inputs)?;
    session.output(
        format!("wrote {} rows to {}\n", count, out.display()),
        &json!({ "rows": count, "outside_box": outside_box(&solved), "out": out.display().to_string() }),
    )
}

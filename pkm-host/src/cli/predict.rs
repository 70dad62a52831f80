//! `predict`: measured data with the deflections of the model in place of the readings.

use std::path::PathBuf;

use pkm_core::StiffnessError;
use serde_json::json;

use super::arguments::{ColumnsArgs, TableArgs};
use super::session::{Output, Session};
use crate::diagnose::quality;
use crate::error::{Failure, Result};
use crate::files::dataset::{self, READ_COLUMNS, Row, U95_COLUMNS};
use crate::files::readings::{CHANNELS, Condition, Readings};
use crate::files::source;
use crate::plan::model::{Form, extrapolation_warning, no_factor_form, outside_box};
use crate::pose::NamedPose;

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
    session.warn(quality::check_columns(&sheet).iter().map(|w| w.text(&file)));
    let conditions: Vec<_> = readings.readings.iter().map(|r| readings.conditions[r.condition]).collect();
    let of_row = |(row, c): (&Row, &Condition)| NamedPose { line: row.line, ..readings.poses[c.pose].clone() };
    let poses: Vec<NamedPose> = sheet.rows.iter().zip(&conditions).map(of_row).collect();
    let at = poses.iter().zip(&conditions).map(|(pose, c)| (pose, c.temperature_c));
    let solved = model.solve(at).map_err(|f| f.in_file(&file))?;
    session.warn(extrapolation_warning(&solved));

    let mut header = sheet.header.clone();
    let is_read = |channel: &usize| conditions.iter().any(|c| c.channels().contains(channel));
    let channels: Vec<usize> = (0..CHANNELS).filter(is_read).collect();
    let says_u95 = model.table.as_ref().is_some_and(|t| t.uncertainty.is_some());
    let u95_columns = U95_COLUMNS.iter().filter(|_| says_u95);
    let missing = channels.iter().map(|c| &READ_COLUMNS[*c]).chain(u95_columns);
    header.extend(missing.filter(|c| !sheet.header.iter().any(|h| h == *c)).map(|c| (*c).to_owned()));
    let place = |column: &str| header.iter().position(|h| h == column);
    let (columns, u95_columns) = (READ_COLUMNS.map(place), U95_COLUMNS.map(place));
    let mut squares = 0.0;
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
        let (pose, point_m) = (&readings.poses[c.pose].pose, c.point_m.into());
        if let Some(known) = model.uncertainty(solved, pose, &c.wrench, point_m).map_err(|f| f.in_file(&file))? {
            let u95_um = known.u95_m() * 1e6;
            squares += u95_um.norm_squared();
            for (column, u95) in u95_columns.into_iter().zip(&u95_um) {
                column.into_iter().for_each(|column| cells[column] = sheet.written(*u95));
            }
        }
        rows.push(cells);
    }
    let count = rows.len();
    let inputs = [session.machine_path(), data.as_deref(), table.table.as_deref()];
    source::write(out, dataset::to_csv(sheet.delimiter(), &header, rows), &inputs)?;
    let u95_um_rms = says_u95.then(|| (squares / count.max(1) as f64).sqrt());
    let known = u95_um_rms.map_or(String::new(), |rms| format!("; expanded uncertainty U95 {rms:.3} µm rms"));
    session.output(
        format!("wrote {count} rows to {}{known}\n", out.display()),
        &json!({
            "rows": count, "outside_box": outside_box(&solved), "u95_um_rms": u95_um_rms, "out": out.display().to_string(),
        }),
    )
}

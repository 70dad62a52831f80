//! A controller's log: a measured file whose rows have a time.

use std::collections::HashMap;

use pkm_core::estimation::{TipReading, Touch};
use pkm_core::nalgebra::{Vector3, Vector6};
use pkm_core::thermal::DECLARED_TEMPERATURE_C;
use pkm_core::{Deflection, Machine, Wrench};

use crate::csv::{Row, Sheet};
use crate::dataset::{
    CORRELATION_COLUMNS, DEFLECTION_COLUMNS, LOAD_RANDOM_COLUMN, READ_COLUMNS, SIGMA_COLUMNS, ZERO_SHARE_COLUMN,
};
use crate::error::{Failure, Result, printable};
use crate::import::{self, Renames};
use crate::machine::MachineFile;
use crate::measured::{LoadCase, Measured};
use crate::readings::Readings;
use crate::source::Source;
use crate::warmth::{Warmth, Zeros};

/// When a row was read: whole seconds since any fixed time.
pub const TIME_COLUMN: &str = "time_s";
const DEVIATION_COLUMNS: [&str; 2] = ["sigma_linear_um", "sigma_angular_urad"];

/// A reading of a log.
pub struct Entry {
    /// Of the file.
    pub line: u64,
    /// Where and under which load.
    pub touch: Touch<f64>,
    /// Of the machine, °C.
    pub temperature_c: f64,
    /// What was read.
    pub readings: Vec<TipReading<f64>>,
}

/// A log.
pub struct Log {
    /// Its rows.
    pub entries: Vec<Entry>,
    /// What of the file is not used, or doubtful.
    pub warnings: Vec<String>,
    sheet: Sheet,
    cases: Vec<LoadCase>,
}

impl Log {
    /// Its rows, and what they read as measured data; `load_random` is the load cell's relative noise.
    ///
    /// # Errors
    /// A cell that is no number.
    pub fn as_measured(&self, load_random: f64) -> Result<(&Sheet, Readings)> {
        Ok((&self.sheet, Readings::new(&self.sheet, &self.cases, load_random)?))
    }

    /// Some of its rows as measured data: those of which `is_kept` says so by their line, and those without load, at which a series
    /// has its zero reading. `load_random` is the load cell's relative noise.
    ///
    /// # Errors
    /// A cell that is no number.
    pub fn measured(self, load_random: f64, is_kept: impl Fn(u64) -> bool) -> Result<(Sheet, Readings)> {
        let Self { mut sheet, cases, .. } = self;
        let rows = std::mem::take(&mut sheet.rows).into_iter().zip(cases);
        let is_part = |(row, case): &(Row, LoadCase)| is_kept(row.line) || case.wrench == Wrench::ZERO;
        let (rows, cases): (Vec<_>, Vec<_>) = rows.filter(is_part).unzip();
        sheet.rows = rows;
        let readings = Readings::new(&sheet, &cases, load_random)?;
        Ok((sheet, readings))
    }
}

/// Reads a log.
///
/// # Errors
/// Those of a measured file; a component of the load that has no column, or no number in a row; rows without time or without
/// standard deviations of what they read.
pub fn read(source: Source, machine: &MachineFile, renames: &Renames) -> Result<Log> {
    let imported = import::read_controller_log(source, renames)?;
    let (mut sheet, cases) = Measured::of(imported, machine).complete()?;
    sheet.require(&[TIME_COLUMN])?;
    // people leave out what is 0; a controller that says nothing of a load has lost it
    if let Some(column) = sheet.added().first() {
        let message = format!("expected a column `{column}`: a log says every component of its loads, 0 too");
        return Err(Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line));
    }
    let mut zeros = Zeros::default();
    let entry = |(row, case): (&_, &LoadCase)| {
        let time = sheet.number(row, TIME_COLUMN)?;
        if !(0.0..=f64::from(u32::MAX)).contains(&time) || time.fract() != 0.0 {
            let message = format!("expected whole seconds from 0 to {}, found {time}", u32::MAX);
            return Err(sheet.failure(row, message).at_column(TIME_COLUMN));
        }
        let mut readings = Vec::new();
        for (channel, column) in READ_COLUMNS.iter().enumerate() {
            if !sheet.has(column) || sheet.cell(row, column)?.is_empty() {
                continue;
            }
            let angular = (3..DEFLECTION_COLUMNS.len()).contains(&channel);
            let sigma = DEVIATION_COLUMNS[usize::from(angular)];
            sheet.require(&[sigma])?;
            let deviation = sheet.number(row, sigma)? * 1e-6;
            if !(deviation > 0.0) {
                let message = format!("expected a standard deviation above 0, found {}", deviation * 1e6);
                return Err(sheet.failure(row, message).at_column(sigma));
            }
            let mut direction = Vector6::zeros();
            match case.gauge.filter(|_| channel >= DEFLECTION_COLUMNS.len()) {
                Some(gauge) => direction.fixed_rows_mut::<3>(0).copy_from(&Vector3::from(gauge)),
                None => direction[channel.min(5)] = 1.0,
            }
            readings.push(TipReading { direction, read: sheet.number(row, column)? * 1e-6, deviation });
        }
        if readings.is_empty() {
            let message = format!("expected a deflection in one of {}", DEFLECTION_COLUMNS.join(", "));
            return Err(sheet.failure(row, message));
        }
        if sheet.has("temperature_c") {
            let temperature = sheet.number(row, "temperature_c")?;
            let refused = |e| sheet.failure(row, format!("{temperature} °C: {e}")).at_column("temperature_c");
            machine.machine.at_temperature(temperature).map_err(refused)?;
        }
        let Warmth { temperature_c, rise_k } = zeros.step(&sheet, row, &case.wrench)?;
        let touch = Touch {
            time_s: time as u32,
            pose: case.pose.pose,
            tip_m: case.point_m.into(),
            wrench: case.wrench,
            rise_k,
        };
        Ok(Entry { line: row.line, touch, temperature_c, readings })
    };
    let entries: Vec<Entry> = sheet.rows.iter().zip(&cases).map(entry).collect::<Result<_>>()?;
    let warnings = std::mem::take(&mut sheet.warnings)
        .into_iter()
        .chain(unused(&sheet, &machine.machine, &entries))
        .chain(copies(&sheet))
        .collect();
    Ok(Log { entries, warnings, sheet, cases })
}

/// Columns of measured data that say nothing to an estimator, or not of this machine.
fn unused(sheet: &Sheet, machine: &Machine<f64>, entries: &[Entry]) -> Vec<String> {
    let of_components = [&SIGMA_COLUMNS[..], &CORRELATION_COLUMNS, &[ZERO_SHARE_COLUMN, LOAD_RANDOM_COLUMN]].concat();
    let there: Vec<&str> = of_components.into_iter().filter(|c| sheet.has(c)).collect();
    let at = format!("{}:{}", printable(&sheet.source.name), sheet.header_line);
    let mut unused = Vec::new();
    if !there.is_empty() {
        unused.push(format!("{at}: not used in a log: {}", there.join(", ")));
    }
    let warms = |pose| machine.thermal_deflection(pose, 1.0) != Ok(Deflection::ZERO);
    let softens = machine.at_temperature(DECLARED_TEMPERATURE_C + 1.0) != Ok(*machine);
    if sheet.has("temperature_c") && !softens && !entries.iter().any(|entry| warms(&entry.touch.pose)) {
        unused.push(format!("{at}: temperature_c changes nothing: the machine file has no effect of temperature"));
    }
    unused
}

/// Rows that are the same as an earlier one in every cell.
fn copies(sheet: &Sheet) -> Option<String> {
    let mut seen: HashMap<Vec<&str>, u64> = HashMap::new();
    let mut copies = Vec::new();
    for row in &sheet.rows {
        let first = *seen.entry(row.cells.iter().collect()).or_insert(row.line);
        if first != row.line {
            copies.push((row.line, first));
        }
    }
    let (line, first) = copies.first()?;
    let count = copies.len();
    let more = if count > 1 { format!(" (first of {count} such rows)") } else { String::new() };
    let file = printable(&sheet.source.name);
    Some(format!("{file}:{line}: the same reading as in line {first}{more}: each counts as one of its own"))
}

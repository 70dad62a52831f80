//! Single columns: units, constants, placeholders, loads that never turn.

use std::collections::HashSet;

use pkm_core::thermal::DECLARED_TEMPERATURE_C;
use pkm_diagnosis::robust::upper_median;

use super::DataWarning;
use crate::diagnose::WarningKind;
use crate::diagnose::reading_rules::{
    MAX_LOAD_RANDOM, MIN_FAHRENHEIT, MIN_KELVIN, MIN_PLACEHOLDER_RATIO, MIN_POINT_MM, PLACEHOLDERS,
};
use crate::error::lines_text;
use crate::files::dataset::{LOAD_RANDOM_COLUMN, POINT_COLUMNS, READ_COLUMNS, Sheet, WRENCH_COLUMNS};
use crate::pose::MAX_RADIANS;

/// Lines and numbers of a column; empty where it is not there.
fn numbers(sheet: &Sheet, column: &str) -> Vec<(u64, f64)> {
    if !sheet.has(column) {
        return Vec::new();
    }
    sheet.rows.iter().filter_map(|row| Some((row.line, sheet.number(row, column).ok()?))).collect()
}

/// Size of the largest number; 0 without any.
fn largest(numbers: &[(u64, f64)]) -> f64 {
    numbers.iter().fold(0.0, |most, (_, v)| most.max(v.abs()))
}

pub(super) fn check(sheet: &Sheet) -> Vec<DataWarning> {
    let mut all = units(sheet);
    all.extend(temperatures_left_out(sheet));
    for column in WRENCH_COLUMNS.into_iter().chain(READ_COLUMNS).chain(["temperature_c"]) {
        all.extend(placeholders(&numbers(sheet, column), column));
    }
    all.extend(READ_COLUMNS.into_iter().filter_map(|column| constant(&numbers(sheet, column), column)));
    all.extend(scattered(sheet));
    all.extend(one_sided(sheet));
    all
}

/// Columns whose numbers are of the size of another unit.
pub(super) fn units(sheet: &Sheet) -> Vec<DataWarning> {
    let mut all = Vec::new();
    let angles = ["theta_deg", "sigma_deg"].map(|column| largest(&numbers(sheet, column)));
    let most = angles[0].max(angles[1]);
    if most > 0.0 && most < MAX_RADIANS {
        let message = format!(
            "no angle is above {most}°: are theta and sigma in radians? Then call the columns `theta [rad]` and `sigma [rad]`"
        );
        all.push(DataWarning::new(WarningKind::AnglesInRadians, message).at_column("theta_deg"));
    }
    let temperatures = numbers(sheet, "temperature_c");
    let warm: Vec<u64> = temperatures.iter().filter(|(_, v)| *v > MIN_KELVIN).map(|(line, _)| *line).collect();
    let least = temperatures.iter().fold(f64::INFINITY, |least, (_, v)| least.min(*v));
    if warm.is_empty() && least > MIN_FAHRENHEIT && least < f64::INFINITY {
        let message =
            format!("no temperature is below {least} °C: are they in °F? Then call the column `temperature [°F]`");
        all.push(DataWarning::new(WarningKind::TemperatureInFahrenheit, message).at_column("temperature_c"));
    }
    if !warm.is_empty() {
        let message = format!(
            "temperatures above {MIN_KELVIN} °C in {}: are they in kelvins? Then call the column `temperature [K]`",
            lines_text(&warm)
        );
        all.push(DataWarning::new(WarningKind::TemperatureInKelvin, message).at_lines(warm).at_column("temperature_c"));
    }
    let point = POINT_COLUMNS.map(|column| largest(&numbers(sheet, column))).into_iter().fold(0.0, f64::max);
    if point > 0.0 && point < MIN_POINT_MM {
        let message = format!(
            "the point of the readings is at most {point} mm from A: is it in metres? Then call the columns `point_u [m]`, …"
        );
        all.push(DataWarning::new(WarningKind::PointInMetres, message).at_column("point_u_mm"));
    }
    all
}

/// Rows that say no temperature where others do.
fn temperatures_left_out(sheet: &Sheet) -> Option<DataWarning> {
    let said: HashSet<u64> = numbers(sheet, "temperature_c").into_iter().map(|(line, _)| line).collect();
    let left_out: Vec<u64> = sheet.rows.iter().map(|row| row.line).filter(|line| !said.contains(line)).collect();
    (!said.is_empty() && !left_out.is_empty()).then(|| {
        let message = format!(
            "no temperature in {}, while other rows have one: {DECLARED_TEMPERATURE_C} °C is taken; fill in how warm it was",
            lines_text(&left_out)
        );
        DataWarning::new(WarningKind::TemperatureLeftOut, message).at_lines(left_out).at_column("temperature_c")
    })
}

/// Numbers such as 9999 that stand for no value.
fn placeholders(numbers: &[(u64, f64)], column: &'static str) -> Vec<DataWarning> {
    let mut sizes: Vec<f64> = numbers.iter().map(|(_, v)| v.abs()).collect();
    let median = upper_median(&mut sizes).unwrap_or(0.0);
    let is_placeholder =
        |v: f64| PLACEHOLDERS.contains(&v.abs()) && v.abs() > MIN_PLACEHOLDER_RATIO * median && sizes.len() > 2;
    let found = numbers.iter().filter(|(_, v)| is_placeholder(*v));
    found
        .map(|(line, v)| {
            let message = format!("{v} is what instruments write for no value: empty the cell if nothing was measured");
            DataWarning::new(WarningKind::Placeholder, message).at_lines(vec![*line]).at_column(column)
        })
        .collect()
}

/// A channel that always reads the same.
fn constant(numbers: &[(u64, f64)], column: &'static str) -> Option<DataWarning> {
    let (_, first) = numbers.first()?;
    (numbers.len() > 2 && numbers.iter().all(|(_, v)| v == first)).then(|| {
        let message = format!(
            "all {} readings are {first}: if the channel was not connected or not measured, empty its cells",
            numbers.len()
        );
        DataWarning::new(WarningKind::ConstantChannel, message).at_column(column)
    })
}

/// Loads that scatter by more than a load at rest does, as joined to readings by clocks that are apart.
fn scattered(sheet: &Sheet) -> Option<DataWarning> {
    let mut shares: Vec<f64> = numbers(sheet, LOAD_RANDOM_COLUMN).into_iter().map(|(_, v)| v).collect();
    let median = upper_median(&mut shares).filter(|median| *median > MAX_LOAD_RANDOM)?;
    let message = format!(
        "the loads scatter by {:.0} % (median): was the load not at rest, or are the clocks of load cell and readings apart? Readings under \
         such loads say little",
        100.0 * median
    );
    Some(DataWarning::new(WarningKind::LoadsThatScatter, message).at_column(LOAD_RANDOM_COLUMN))
}

/// Loads of one sign alone: clearance, preload and a shifted zero look like compliance then.
fn one_sided(sheet: &Sheet) -> Option<DataWarning> {
    let columns = WRENCH_COLUMNS.map(|column| numbers(sheet, column));
    let has =
        |positive: bool| columns.iter().any(|c| c.iter().any(|(_, v)| if positive { *v > 0.0 } else { *v < 0.0 }));
    let turns = |c: &Vec<(u64, f64)>| c.iter().any(|(_, v)| *v > 0.0) && c.iter().any(|(_, v)| *v < 0.0);
    let message = "no force or moment changes its direction: clearance, preload and a shifted zero then look like compliance; \
                   repeat some readings with the load reversed";
    ((has(true) || has(false)) && !columns.iter().any(turns))
        .then(|| DataWarning::new(WarningKind::LoadsOfOneSign, message))
}

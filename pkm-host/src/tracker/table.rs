//! Readings without deflections → tasks, and deflections → the rows of docs/formats.md.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};

use super::{Deflection, Task};
use crate::error::{Failure, Result};
use crate::files::csv::{self, Sheet};
use crate::files::dataset::{
    CORRELATION_COLUMNS, DEFLECTION_COLUMNS, GAUGE_COLUMNS, LOAD_POINT_COLUMNS, POINT_COLUMNS, READ_COLUMNS,
    SIGMA_COLUMNS, ZERO_SHARE_COLUMN,
};
use crate::files::import::COLUMNS;
use crate::files::measured::{self, LoadCase};
use crate::files::source::Source;

/// What each row of a readings' file asks of the points.
///
/// # Errors
/// No names of readings; columns that follow from the points.
pub fn tasks<'a>(sheet: &Sheet, cases: &'a [LoadCase]) -> Result<Vec<Task<'a>>> {
    if !sheet.has("reading") {
        return Err(sheet.missing("reading", ": each reading needs the name that its points have"));
    }
    let mut from_points = READ_COLUMNS.iter().chain(&POINT_COLUMNS).chain(&GAUGE_COLUMNS).chain(&SIGMA_COLUMNS);
    if let Some(column) = from_points.find(|c| sheet.has(c)) {
        let message = "not expected beside --points, from which it follows; where the load acts is load_u_mm, load_v_mm, load_w_mm";
        let failure = Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line());
        return Err(failure.at_column(*column));
    }
    let task = |(row, case): (&csv::Row, &'a LoadCase)| {
        let series = if sheet.has("series") { sheet.cell(row, "series")?.to_owned() } else { String::new() };
        Ok(Task { line: row.line, reading: sheet.cell(row, "reading")?.to_owned(), series, pose: &case.pose })
    };
    sheet.rows.iter().zip(cases).map(task).collect()
}

/// A number with so many digits behind the point, and no minus before a zero.
fn written(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.trim_start_matches('-').to_owned() } else { text }
}

/// Cells of a deflection whose first components were read.
fn cells(components: &DVector<f64>, covariance: &DMatrix<f64>, zero_share: f64) -> HashMap<&'static str, String> {
    let mut cells = HashMap::new();
    let n = components.len();
    let sd = |i: usize| covariance[(i, i)].sqrt();
    let mut columns = CORRELATION_COLUMNS.iter();
    for i in 0..DEFLECTION_COLUMNS.len() {
        if i < n {
            cells.insert(DEFLECTION_COLUMNS[i], written(components[i] * 1e6, 4));
            cells.insert(SIGMA_COLUMNS[i], written(sd(i) * 1e6, 6));
        }
        for (j, column) in (i + 1..DEFLECTION_COLUMNS.len()).zip(&mut columns) {
            if j < n {
                cells.insert(column, written(covariance[(i, j)] / (sd(i) * sd(j)), 9));
            }
        }
    }
    cells.insert(ZERO_SHARE_COLUMN, written(zero_share, 6));
    cells
}

fn dynamic<const N: usize>(matrix: &nalgebra::SMatrix<f64, N, N>) -> DMatrix<f64> {
    DMatrix::from_fn(N, N, |i, j| matrix[(i, j)])
}

/// The readings with their deflections, as the other commands read them: a row a reading, or a row for each of one or two reflectors.
///
/// # Errors
/// None for a sheet of which all rows are right.
pub fn with_deflections(sheet: &Sheet, deflections: &[Deflection]) -> Result<String> {
    let known: Vec<&str> = COLUMNS.iter().map(|c| c.name).collect();
    let sheet = Sheet::parse(Source::from_text(&sheet.source.name, measured::to_csv(sheet)), &known)?;
    let mut rows: Vec<(usize, HashMap<&str, String>)> = Vec::new();
    for (n, (row, deflection)) in sheet.rows.iter().zip(deflections).enumerate() {
        match deflection {
            Deflection::Whole(components, covariance, zero_share) => {
                let components = DVector::from_column_slice(components.as_slice());
                rows.push((n, cells(&components, &dynamic(covariance), *zero_share)));
            }
            Deflection::Points(displacements) => {
                for d in displacements {
                    let components = DVector::from_column_slice(d.components_m.as_slice());
                    let mut own = cells(&components, &dynamic(&d.covariance), d.zero_share);
                    own.extend(POINT_COLUMNS.iter().zip(d.point_m).map(|(c, m)| (*c, written(m * 1e3, 6))));
                    // else the load would be taken to act at the reflector
                    if !LOAD_POINT_COLUMNS.iter().all(|c| sheet.has(c)) {
                        own.extend(LOAD_POINT_COLUMNS.map(|c| (c, "0".to_owned())));
                    }
                    // each reflector has a zero of its own
                    if sheet.has("series") && !sheet.cell(row, "series")?.is_empty() {
                        own.insert("series", format!("{} {}", sheet.cell(row, "series")?, d.reflector));
                    }
                    rows.push((n, own));
                }
            }
        }
    }
    // columns of the covariance stand together, some of them empty where no rotation was seen
    let of_all = [&DEFLECTION_COLUMNS[..], &SIGMA_COLUMNS, &CORRELATION_COLUMNS].concat();
    let is_there = |c: &&str| sheet.has(c) || of_all.contains(c) || rows.iter().any(|(_, own)| own.contains_key(c));
    let header: Vec<&str> = known.into_iter().filter(is_there).collect();
    let cell = |n: usize, own: &HashMap<&str, String>, column: &str| match own.get(column) {
        Some(own) => own.clone(),
        None => sheet.cell(&sheet.rows[n], column).unwrap_or_default().to_owned(),
    };
    let lines = rows.iter().map(|(n, own)| header.iter().map(|c| cell(*n, own, c)).collect::<Vec<String>>());
    let names: Vec<String> = header.iter().map(|c| (*c).to_owned()).collect();
    Ok(csv::to_csv(b',', &names, lines))
}

//! Loads into the sheet of their readings.

use super::Load;
use crate::csv::Sheet;
use crate::dataset::{LOAD_RANDOM_COLUMN, WRENCH_COLUMNS};
use crate::error::Result;

/// Digits behind the point: of forces in N, of moments in N·m and of shares.
const DIGITS: [usize; 3] = [4, 6, 6];

/// A number without a minus before zero.
fn written(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { "0".into() } else { text }
}

/// Writes wrench and scatter of each row. Where rows had nominal loads and no names of them, these become the names: readings of one
/// nominal load are repeats, whatever the cell recorded.
pub(super) fn write(sheet: &mut Sheet, loads: &[Load]) -> Result<()> {
    let has_nominal = WRENCH_COLUMNS.iter().any(|c| sheet.has(c));
    if has_nominal && !sheet.has("load") {
        let mut names = Vec::with_capacity(sheet.rows.len());
        for row in &sheet.rows {
            let nominal = sheet.load(row)?;
            // −0 and 0 are one load
            names.push(nominal.map(|v| (v + 0.0).to_string()).join(" "));
        }
        sheet.set_column("load", names);
    }
    for (component, column) in WRENCH_COLUMNS.into_iter().enumerate() {
        let digits = DIGITS[usize::from(component > 2)];
        let cells = loads.iter().map(|load| sheet.written(written(load.wrench[component], digits))).collect();
        sheet.set_column(column, cells);
    }
    let random = |load: &Load| load.random.map_or(String::new(), |share| sheet.written(written(share, DIGITS[2])));
    let cells = loads.iter().map(random).collect();
    sheet.set_column(LOAD_RANDOM_COLUMN, cells);
    Ok(())
}

//! Measured data as laboratories and shops export them → a [`Sheet`] with the columns of `docs/formats.md`.
//!
//! `encoding`: bytes → text. `header`: its row, what stands between cells, a row of units. `names` and `units`: what the columns
//! are. `merged` and `cells`: each cell as the contract has it. `kinds`: files that are no readings, such as a list of points.
//! Nothing is guessed silently: what is ambiguous is refused or warned of, and every conversion is named.

mod cells;
mod encoding;
mod header;
mod kinds;
mod merged;
mod names;
mod units;

pub use self::names::{COLUMNS, Renames};
use self::names::{Use, is_blank_unit, uses};
use crate::error::{Failure, Result, printable};
use crate::files::csv::{Header, Row, Sheet, fitted, records};
use crate::files::dataset::WRENCH_COLUMNS;
use crate::files::source::Source;

/// What an export says.
pub struct Imported {
    /// Its cells, with names and units of `docs/formats.md`.
    pub sheet: Sheet,
    /// What was converted, for the user.
    pub conversions: Vec<String>,
    /// Rows and cells that cannot be read.
    pub failures: Vec<Failure>,
}

/// Reads measured data as they were exported.
///
/// # Errors
/// No header, columns that are not clear, a unit that is missing or unknown, a file that holds something else.
pub fn read(source: Source, renames: &Renames) -> Result<Imported> {
    let shared = source.clone();
    let (text, encoding) = encoding::text(&shared)?;
    let found = header::find(&shared, &text, renames)?;
    let mut conversions: Vec<String> = encoding.map(|name| format!("text in {name}")).into_iter().collect();
    if found.delimiter == b'\t' {
        conversions.push("tabs between cells".into());
    }
    let mut rows = records(&text, found.delimiter, &shared.name).skip(found.above.len() + 1).peekable();
    let next = rows.peek().and_then(|row| row.as_ref().ok());
    let units = next.and_then(|row| header::units_of(row, &found.header, renames)).unwrap_or_default();
    if !units.is_empty() {
        rows.next();
        conversions.push(format!("units in line {}", found.header.line + 1));
    }
    let (columns, kept, unnamed) = columns(&shared, &found.header, &units, renames)?;
    conversions.extend(kept.iter().zip(&columns).filter_map(|(n, used)| converted(&found.header.names[*n], used)));
    let header = Header {
        line: found.header.line,
        names: kept.iter().zip(&columns).map(|(n, c)| name_of(c, &found.header.names[*n])).collect(),
    };
    let known: Vec<&str> = COLUMNS.iter().map(|c| c.name).collect();
    let mut sheet = Sheet::new(source, &text, found.delimiter, header, &known).map_err(with_advice)?;
    let mut failures = Vec::new();
    let mut has_unnamed = false;
    for row in rows {
        let row = row?;
        let line = row.line;
        match fitted(row, found.header.names.len(), found.delimiter) {
            Ok(row) => {
                has_unnamed |= unnamed.iter().any(|n| !row.cells[*n].is_empty());
                let cells = kept.iter().map(|n| &row.cells[*n]).collect();
                sheet.rows.push(Row { line, cells });
            }
            Err(message) => failures.push(Failure::input(message).in_file(&shared.name).at_line(line)),
        }
    }
    if !sheet.rows.is_empty() || failures.is_empty() {
        sheet.finish(&known)?;
    }
    let line = sheet.header_line;
    let file = printable(&shared.name);
    if let (Some(first), Some(last)) = (found.above.first(), found.above.last()) {
        let lines = if first.line == last.line { "line".into() } else { format!("lines {} to", first.line) };
        sheet.warnings.push(format!("{file}:{}: {lines} {} above the header: not read", first.line, last.line));
    }
    if has_unnamed {
        sheet.warnings.push(format!("{file}:{line}: not used: columns without a name of their own"));
    }
    if sheet.has_decimal_commas() {
        conversions.push("decimal commas".into());
    }
    conversions.extend(cells::tidy(&mut sheet, &columns));
    let carried = merged::carry_down(&mut sheet);
    sheet.warnings.extend(carried);
    failures.extend(cells::refuse_ambiguous(&mut sheet, &columns));
    cells::convert(&mut sheet, &columns);
    if let Some(failure) = kinds::other_than_readings(&sheet) {
        return Err(failure);
    }
    complete_loads(&mut sheet);
    Ok(Imported { sheet, conversions, failures })
}

/// How the columns are read; which of them are kept, by their place; and those that have no name of their own.
fn columns(
    source: &Source,
    header: &Header,
    units: &[String],
    renames: &Renames,
) -> Result<(Vec<Option<Use>>, Vec<usize>, Vec<usize>)> {
    let mut uses = uses(&header.names, units, renames).map_err(|(cell, message)| {
        Failure::input(message).in_file(&source.name).at_line(header.line).at_column(cell)
    })?;
    let is_unnamed = |n: &usize| {
        let name = &header.names[*n];
        uses[*n].is_none() && (is_blank_unit(name) || header.names[..*n].contains(name))
    };
    let (unnamed, kept): (Vec<usize>, Vec<usize>) = (0..header.names.len()).partition(is_unnamed);
    let columns = kept.iter().map(|n| uses[*n].take()).collect();
    Ok((columns, kept, unnamed))
}

/// The name of a column in the sheet.
fn name_of(used: &Option<Use>, cell: &str) -> String {
    used.as_ref().map_or(cell, |used| used.column.name).to_owned()
}

/// What is said of a column that has another name or another unit.
fn converted(cell: &str, used: &Option<Use>) -> Option<String> {
    let used = used.as_ref()?;
    let name = (cell != used.column.name).then(|| format!("`{}` is {}", printable(cell), used.column.name));
    let unit = used.unit.zip(used.column.own_unit()).filter(|(from, to)| !std::ptr::eq(*from, *to));
    let unit = unit.map(|(from, to)| format!("{} converted to {}", from.name(), to.name()));
    match (name, unit) {
        (None, None) => None,
        (name, unit) => {
            let name = name.unwrap_or_else(|| used.column.name.to_owned());
            Some(name + &unit.map_or(String::new(), |unit| format!(", {unit}")))
        }
    }
}

/// A name that may be misspelt may as well have its unit in a way that is not read.
fn with_advice(mut failure: Failure) -> Failure {
    if failure.message.contains("did you mean") {
        failure.message.push_str(" Another unit stands in brackets, as `dx [mm]`; another name needs --columns");
    }
    failure
}

/// Forces and moments that have no column are 0, where some are there.
fn complete_loads(sheet: &mut Sheet) {
    let missing: Vec<&str> = WRENCH_COLUMNS.into_iter().filter(|c| !sheet.has(c)).collect();
    if missing.is_empty() || missing.len() == WRENCH_COLUMNS.len() {
        return;
    }
    missing.iter().for_each(|column| sheet.add_column(column, "0"));
    let (file, line) = (printable(&sheet.source.name), sheet.header_line);
    sheet.warnings.push(format!("{file}:{line}: no columns {}: taken as 0", missing.join(", ")));
}

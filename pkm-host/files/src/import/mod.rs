//! Measured data and a tracker's points as laboratories and shops export them → a [`Sheet`] with the columns of `docs/formats.md`.
//!
//! `encoding`: bytes → text. `header`: its row, what stands between cells, a row of units. `columns`, `names` and `units`: what the columns
//! are. `merged` and `cells`: each cell as the contract has it. `kinds`: files that are no readings, such as a list of points.
//! Nothing is guessed silently: what is ambiguous is refused or warned of, and every conversion is named.

mod cells;
mod columns;
pub(crate) mod encoding;
mod header;
mod kinds;
mod merged;
mod names;
mod units;

pub use self::columns::COLUMNS;
pub(crate) use self::merged::refuse_statistics;
pub use self::names::Renames;
use self::names::{Names, Use, is_blank_unit, unused_of, uses};
use self::units::Quantity;
pub use self::units::{FOOT_M, GRAVITY, POUND_N};
use crate::csv::Sheet;
use crate::csv_rows::{Header, Row, fitted, records, surplus};
use crate::dataset::{DEFLECTION_COLUMNS, GAUGE_READING, WRENCH_COLUMNS};
use crate::error::{Failure, Result, printable};
use crate::source::Source;

/// What an export says.
pub struct Imported {
    /// Its cells, with names and units of `docs/formats.md`.
    pub sheet: Sheet,
    /// What was converted, for the user.
    pub conversions: Vec<String>,
    /// Rows and cells that cannot be read.
    pub failures: Vec<Failure>,
    /// Lines above the header that hold something.
    above: Option<(u64, u64)>,
    /// Columns that are not used and have a unit of a force, a moment, a length and an angle: the first of each.
    unused: [Option<String>; 4],
}

impl Imported {
    /// Says that lines above the header were not read.
    fn warn_of_lines_above(&mut self) {
        let Some((first, last)) = self.above else { return };
        let lines = if first == last { "line".into() } else { format!("lines {first} to") };
        let file = printable(&self.sheet.source.name);
        self.sheet.warnings.push(format!("{file}:{first}: {lines} {last} above the header: not read"));
    }
}

/// Reads measured data as they were exported.
///
/// # Errors
/// No header, columns that are not clear, a unit that is missing or unknown, a file that holds something else.
pub fn read(source: Source, renames: &Renames) -> Result<Imported> {
    let imported = readings_of(source, &Names::of_readings(renames), merged::carry_down)?;
    refuse_lost_deflections(&imported)?;
    Ok(imported)
}

/// Reads measured data whose loads a log has, with the columns that join them.
///
/// # Errors
/// As [`read`].
pub fn read_timed(source: Source, renames: &Renames) -> Result<Imported> {
    let imported = readings_of(source, &Names::of_timed(renames), merged::carry_down)?;
    refuse_lost_deflections(&imported)?;
    Ok(imported)
}

/// Reads a controller's log: each row says all of itself, and an empty cell is one that was lost.
///
/// # Errors
/// As [`read`].
pub fn read_controller_log(source: Source, renames: &Renames) -> Result<Imported> {
    readings_of(source, &Names::of_controller_log(renames), |_| Vec::new())
}

fn readings_of(source: Source, names: &Names<'_>, carried: Carried) -> Result<Imported> {
    let shared = source.clone();
    // a header without names of readings may be that of a log
    let as_log = || {
        let (text, _) = encoding::text(&shared).ok()?;
        header::find(&shared, &text, names).err().and_then(|_| kinds::load_log(&shared, &text, names))
    };
    let imported = columns_of(source, names, carried);
    let mut imported = imported.map_err(|failure| as_log().unwrap_or(failure))?;
    if let Some(failure) = kinds::other_than_readings(&imported.sheet) {
        return Err(failure);
    }
    imported.warn_of_lines_above();
    complete_loads(&mut imported)?;
    Ok(imported)
}

/// Reads a load cell's log as it was exported, and the lines above its header.
///
/// # Errors
/// As [`read`].
pub fn read_load_log(source: Source, renames: &Renames) -> Result<(Imported, Vec<String>)> {
    let shared = source.clone();
    let imported = columns_of(source, &Names::of_load_log(renames), |_| Vec::new())?;
    let above = usize::try_from(imported.sheet.header_line).unwrap_or(usize::MAX) - 1;
    let (text, _) = encoding::text(&shared)?;
    Ok((imported, text.lines().take(above).map(str::to_owned).collect()))
}

/// Reads a tracker's list of points as it was exported.
///
/// # Errors
/// As [`read`].
pub fn read_points(source: Source, renames: &Renames) -> Result<Imported> {
    let mut imported = columns_of(source, &Names::of_points(renames), |_| Vec::new())?;
    imported.warn_of_lines_above();
    Ok(imported)
}

/// Fills empty cells, and says where.
type Carried = fn(&mut Sheet) -> Vec<String>;

/// The columns of an export that have some names.
fn columns_of(source: Source, names: &Names<'_>, carried: Carried) -> Result<Imported> {
    let shared = source.clone();
    let (text, encoding) = encoding::text(&shared)?;
    let found = header::find(&shared, &text, names)?;
    let mut conversions: Vec<String> = encoding.map(|name| format!("text in {name}")).into_iter().collect();
    if found.delimiter == b'\t' {
        conversions.push("tabs between cells".into());
    }
    let mut rows = records(&text, found.delimiter, &shared.name).skip(found.above.len() + 1).peekable();
    let below = rows.peek().and_then(|row| row.as_ref().ok());
    let units = below.and_then(|row| Some((row.line, header::units_of(row, &found.header, names)?)));
    if let Some((line, _)) = &units {
        conversions.push(format!("units in line {line}"));
        rows.next();
    }
    let units = units.map(|(_, units)| units).unwrap_or_default();
    let side_by_side = || names.side_by_side(&found.header.names).map(|failure| failure.at_line(found.header.line));
    if let Some(failure) = header::units_above(&found, names).or_else(side_by_side) {
        return Err(failure.in_file(&shared.name));
    }
    let columns = Columns::of(&found.header, &units, names)
        .map_err(|failure| failure.in_file(&shared.name).at_line(found.header.line))?;
    conversions.extend(columns.conversions(&found.header));
    let known = names.own();
    let header = Header { names: columns.names(&found.header), ..found.header.clone() };
    let mut sheet = Sheet::new(source, &text, found.delimiter, header, &known).map_err(with_advice)?;
    let mut failures = columns.read(&mut sheet, rows, &found.header)?;
    if !sheet.rows.is_empty() || failures.is_empty() {
        sheet.finish(&known)?;
    }
    failures.extend(refuse_statistics(&mut sheet));
    // before dashes become blanks: who writes one did not mean the row above
    let warnings = carried(&mut sheet);
    sheet.warnings.extend(warnings);
    failures.extend(cells::refuse_dashes(&sheet));
    conversions.extend(cells::tidy(&mut sheet, &columns.uses));
    failures.extend(cells::refuse_overflows(&sheet, &columns.uses));
    let at = format!("{}:{}", printable(&shared.name), found.header.line);
    sheet.warnings.extend(found.not_renamed.iter().map(|message| format!("{at}: {message}")));
    failures.extend(cells::refuse_ambiguous(&mut sheet, &columns.uses));
    if sheet.has_decimal_commas() {
        conversions.push("decimal commas".into());
    }
    cells::convert(&mut sheet, &columns.uses);
    let unused = [Quantity::Force, Quantity::Moment, Quantity::Length, Quantity::Angle]
        .map(|q| unused_of(&found.header.names, &units, names, q).map(str::to_owned));
    let above = found.above.first().zip(found.above.last()).map(|(first, last)| (first.line, last.line));
    Ok(Imported { sheet, conversions, failures, above, unused })
}

/// The columns of a file.
struct Columns {
    /// How those are read that are kept; `None` for those that the program does not use.
    uses: Vec<Option<Use>>,
    /// Their places in the file.
    kept: Vec<usize>,
    /// Places of columns that have no name of their own and are left out.
    unnamed: Vec<usize>,
}

impl Columns {
    /// By a header and the row of units below it, which may be empty.
    fn of(header: &Header, units: &[String], names: &Names<'_>) -> Result<Self> {
        let mut uses =
            uses(&header.names, units, names).map_err(|(cell, message)| Failure::input(message).at_column(cell))?;
        let is_unnamed = |n: &usize| {
            let name = &header.names[*n];
            uses[*n].is_none() && (is_blank_unit(name) || header.names[..*n].contains(name))
        };
        let (unnamed, kept): (Vec<usize>, Vec<usize>) = (0..header.names.len()).partition(is_unnamed);
        let uses = kept.iter().map(|n| uses[*n].take()).collect();
        Ok(Self { uses, kept, unnamed })
    }

    /// Those that are kept: their name in the file, and how they are read.
    fn all<'a>(&'a self, header: &'a Header) -> impl Iterator<Item = (&'a str, Option<&'a Use>)> {
        self.kept.iter().map(|n| header.names[*n].as_str()).zip(self.uses.iter().map(Option::as_ref))
    }

    /// Their names in the sheet.
    fn names(&self, header: &Header) -> Vec<String> {
        self.all(header).map(|(cell, used)| used.map_or(cell, |used| used.column.name).to_owned()).collect()
    }

    /// What is said of those that have another name or another unit.
    fn conversions(&self, header: &Header) -> Vec<String> {
        self.all(header).filter_map(|(cell, used)| converted(cell, used?)).collect()
    }

    /// Puts the rows of a file into a sheet; gives those that are not as wide as the header.
    fn read(
        &self,
        sheet: &mut Sheet,
        rows: impl Iterator<Item = Result<Row>>,
        header: &Header,
    ) -> Result<Vec<Failure>> {
        let rows: Vec<Row> = rows.collect::<Result<_>>()?;
        let surplus = surplus(&rows, header);
        let (mut failures, mut has_unnamed) = (Vec::new(), false);
        for row in rows {
            let line = row.line;
            match fitted(row, header, surplus, sheet.delimiter()) {
                Ok(row) => {
                    has_unnamed |= self.unnamed.iter().any(|n| !row.cells[*n].is_empty());
                    sheet.rows.push(Row { line, cells: self.kept.iter().map(|n| &row.cells[*n]).collect() });
                }
                Err(message) => failures.push(Failure::input(message).in_file(&sheet.source.name).at_line(line)),
            }
        }
        if has_unnamed {
            let (file, line) = (printable(&sheet.source.name), sheet.header_line);
            sheet.warnings.push(format!("{file}:{line}: not used: columns without a name of their own"));
        }
        Ok(failures)
    }
}

/// What is said of a column that has another name or another unit.
fn converted(cell: &str, used: &Use) -> Option<String> {
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

/// A column of some quantity that nobody can tell may be one that is missing.
fn refuse_unclear(imported: &Imported, unused: Option<&String>, missing: &[&str], or: &str) -> Result<()> {
    let (Some(theirs), [column, ..]) = (unused, missing) else { return Ok(()) };
    let message = format!(
        "is it {column}, which has no column{or}? Say --columns {column}={theirs}, or leave the column out of the file"
    );
    let failure = Failure::input(message).in_file(&imported.sheet.source.name);
    Err(failure.at_line(imported.sheet.header_line).at_column(theirs))
}

/// Refuses a file of which a column may hold a deflection that would be lost.
fn refuse_lost_deflections(imported: &Imported) -> Result<()> {
    let sheet = &imported.sheet;
    // others are read from a tracker's points, or along a gauge
    if !DEFLECTION_COLUMNS.iter().any(|c| sheet.has(c)) || sheet.has(GAUGE_READING) {
        return Ok(());
    }
    for (columns, unused) in DEFLECTION_COLUMNS.chunks(3).zip(&imported.unused[2..]) {
        let missing: Vec<&str> = columns.iter().copied().filter(|c| !sheet.has(c)).collect();
        refuse_unclear(imported, unused.as_ref(), &missing, "")?;
    }
    Ok(())
}

/// Forces and moments that have no column are 0, where some are there.
fn complete_loads(imported: &mut Imported) -> Result<()> {
    let missing: Vec<&str> = WRENCH_COLUMNS.into_iter().filter(|c| !imported.sheet.has(c)).collect();
    if missing.is_empty() || missing.len() == WRENCH_COLUMNS.len() {
        return Ok(());
    }
    for (unused, of_quantity) in imported.unused.iter().zip(WRENCH_COLUMNS.chunks(3)) {
        let missing: Vec<&str> = missing.iter().copied().filter(|c| of_quantity.contains(c)).collect();
        refuse_unclear(imported, unused.as_ref(), &missing, " and would be 0")?;
    }
    let sheet = &mut imported.sheet;
    missing.iter().for_each(|column| sheet.add_column(column, "0"));
    let (file, line) = (printable(&sheet.source.name), sheet.header_line);
    sheet.warnings.push(format!("{file}:{line}: no columns {}: taken as 0", missing.join(", ")));
    Ok(())
}

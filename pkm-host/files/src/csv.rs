//! A CSV as cells: read with file, line and column of what is wrong, and written.

use std::collections::HashMap;
use std::fmt::Display;

pub use crate::csv_rows::Row;
use crate::csv_rows::{Header, fitted, records, surplus};
use crate::error::{Failure, MAX_TYPO_BYTES, Result, advice, printable};
use crate::source::Source;

/// The pose columns, in the order in which they are written.
pub const POSE_COLUMNS: [&str; 4] = ["pose", "theta_deg", "sigma_deg", "z0_mm"];
/// What may stand in their place.
pub(super) const LENGTH_COLUMNS: [&str; 3] = ["q1_mm", "q2_mm", "q3_mm"];

/// A CSV as cells, checked for shape: one header, no doubled column, every row as wide as the header.
pub struct Sheet {
    /// The file.
    pub source: Source,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Rows in the file's order.
    pub rows: Vec<Row>,
    pub(super) header_line: u64,
    /// Between cells. If it is no comma, a decimal comma is as good as a point.
    delimiter: u8,
    /// Some number has one.
    decimal_commas: bool,
    columns: HashMap<String, usize>,
    /// Columns that the file does not have.
    added: Vec<String>,
    /// Names the columns that are not used, and comments that look like rows.
    pub warnings: Vec<String>,
}

/// The first comment with as many cells as the header, most of them numbers: a row that was switched off, or one whose name begins
/// with #, which is read in quotes alone.
fn commented_rows(text: &str, delimiter: u8, width: usize) -> Option<String> {
    let is_number = |cell: &&str| cell.trim().replace(',', ".").parse::<f64>().is_ok();
    let is_row = |line: &str| {
        let cells: Vec<&str> = line.split(char::from(delimiter)).collect();
        line.starts_with('#') && cells.len() == width && 2 * cells.iter().filter(|c| is_number(c)).count() > width
    };
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| is_row(line)).map(|(n, _)| n);
    let first: u64 = lines.next()?;
    let more = match lines.count() {
        0 => String::new(),
        n => format!(", and {n} more"),
    };
    Some(format!("{first}: a comment that looks like a row is skipped{more}: put a name that begins with # in quotes"))
}

impl Sheet {
    /// Reads a CSV and holds its header against the `known` columns.
    ///
    /// # Errors
    /// The line and column that are wrong; a column that looks like a misspelt known one.
    pub fn parse(source: Source, known: &[&str]) -> Result<Self> {
        let shared = source.clone();
        let text = shared.text()?;
        let fail = |line: u64, message: String| Failure::input(message).in_file(&shared.name).at_line(line);
        let semicolons = separator(text).map_err(|(line, message)| fail(line, message))?;
        let delimiter = if semicolons { b';' } else { b',' };
        let mut records = records(text, delimiter, &shared.name);
        let Some(header) = records.next() else { return Err(fail(1, "expected a header line, found none".into())) };
        let header = Header::new(&header?);
        let mut sheet = Self::new(source, text, delimiter, header.clone(), known)?;
        let rows: Vec<Row> = records.collect::<Result<_>>()?;
        let surplus = surplus(&rows, &header);
        for row in rows {
            let at = row.line;
            sheet.rows.push(fitted(row, &header, surplus, delimiter).map_err(|message| fail(at, message))?);
        }
        sheet.finish(known)?;
        Ok(sheet)
    }

    /// A sheet without rows.
    pub(super) fn new(source: Source, text: &str, delimiter: u8, header: Header, known: &[&str]) -> Result<Self> {
        let Header { line, names, .. } = header;
        let fail = |(column, message): Flaw| {
            let failure = Failure::input(message).in_file(&source.name).at_line(line);
            if let Some(column) = column { failure.at_column(column) } else { failure }
        };
        let columns = numbered(&names).map_err(fail)?;
        let unused = unused_columns(&names, &columns, known).map_err(fail)?;
        let name = printable(&source.name);
        let warning = || format!("{name}:{line}: not used: {}", printable(&unused.join(", ")));
        let mut warnings: Vec<String> = (!unused.is_empty()).then(warning).into_iter().collect();
        warnings.extend(commented_rows(text, delimiter, names.len()).map(|what| format!("{name}:{what}")));
        Ok(Self {
            header: names,
            header_line: line,
            rows: Vec::new(),
            delimiter,
            decimal_commas: false,
            columns,
            added: Vec::new(),
            warnings,
            source,
        })
    }

    /// Looks at the rows when all of them are there.
    pub(super) fn finish(&mut self, known: &[&str]) -> Result<()> {
        if self.rows.is_empty() {
            let message = "expected rows of data below the header, found none";
            return Err(Failure::input(message).in_file(&self.source.name).at_line(self.header_line));
        }
        let is_number = |cell: &str| cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok();
        let mut numbers = self.columns.iter().filter(|(name, _)| **name != "pose" && known.contains(&name.as_str()));
        self.decimal_commas =
            self.may_have_commas() && numbers.any(|(_, i)| self.rows.iter().any(|r| is_number(&r.cells[*i])));
        Ok(())
    }

    /// Appends a column with the same cell in every row.
    pub(super) fn add_column(&mut self, name: &str, cell: &str) {
        self.columns.insert(name.to_owned(), self.header.len());
        self.added.push(name.to_owned());
        self.header.push(name.to_owned());
        self.rows.iter_mut().for_each(|row| row.cells.push_field(cell));
    }

    /// Writes a column anew, or appends it: a cell for each row.
    pub(crate) fn set_column(&mut self, name: &str, cells: Vec<String>) {
        if !self.has(name) {
            self.columns.insert(name.to_owned(), self.header.len());
            self.header.push(name.to_owned());
            self.rows.iter_mut().for_each(|row| row.cells.push_field(""));
        }
        let index = self.columns[name];
        for (row, new) in self.rows.iter_mut().zip(cells) {
            row.cells =
                row.cells.iter().enumerate().map(|(n, old)| if n == index { new.as_str() } else { old }).collect();
        }
    }

    /// Columns that the file does not have, and that were added with the same cell in every row.
    pub(super) fn added(&self) -> &[String] {
        &self.added
    }

    /// Whether a comma may stand in a number: none stands between cells.
    fn may_have_commas(&self) -> bool {
        self.delimiter != b','
    }

    /// As this file has between cells.
    pub fn delimiter(&self) -> u8 {
        self.delimiter
    }

    /// Line of the header, from 1.
    pub fn header_line(&self) -> u64 {
        self.header_line
    }

    /// Whether some number has a decimal comma.
    pub(super) fn has_decimal_commas(&self) -> bool {
        self.decimal_commas
    }

    /// No comma of this file is known to be a decimal one.
    pub(super) fn take_points(&mut self) {
        self.decimal_commas = false;
    }

    /// A number as this file writes them.
    pub fn written(&self, value: impl Display) -> String {
        let text = value.to_string();
        if self.decimal_commas { text.replace('.', ",") } else { text }
    }

    /// Whether there is such a column.
    pub fn has(&self, column: &str) -> bool {
        self.columns.contains_key(column)
    }

    /// An input failure at a row.
    pub fn failure(&self, row: &Row, message: impl Into<String>) -> Failure {
        Failure::input(message).in_file(&self.source.name).at_line(row.line)
    }

    /// A failure at the header, about a column that is not there.
    pub fn missing(&self, column: &str, why: &str) -> Failure {
        let failure = Failure::input(format!("missing column{why}")).in_file(&self.source.name);
        failure.at_line(self.header_line).at_column(column)
    }

    pub(crate) fn require(&self, columns: &[&str]) -> Result<()> {
        columns.iter().find(|c| !self.has(c)).map_or(Ok(()), |c| Err(self.missing(c, "")))
    }

    /// The text of a cell.
    ///
    /// # Errors
    /// An input failure where the file has no such column.
    pub fn cell<'a>(&self, row: &'a Row, column: &str) -> Result<&'a str> {
        let index = self.columns.get(column).ok_or_else(|| self.missing(column, ""))?;
        Ok(&row.cells[*index])
    }

    /// A finite number. With semicolons between cells a decimal comma is as good as a point.
    ///
    /// # Errors
    /// An input failure where there is no such column, or something else in it.
    pub fn number(&self, row: &Row, column: &str) -> Result<f64> {
        let cell = self.cell(row, column)?;
        if self.decimal_commas && is_grouped(cell, &['.']) {
            let message = format!("`{cell}`: point or thousands? Other numbers here have decimal commas");
            return Err(self.failure(row, format!("{message}: save the file {UNGROUPED}")).at_column(column));
        }
        let text = if self.may_have_commas() { cell.replace(',', ".") } else { cell.to_owned() };
        let digits = text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
        match text.parse::<f64>() {
            Ok(value) if digits && value.is_finite() => Ok(value),
            _ => {
                let shown: String = cell.chars().take(40).collect();
                let grouped = is_grouped(cell, &['.', ',', '\'', '’', ' ', '\u{a0}', '\u{202f}']);
                let found = if cell.is_empty() {
                    "an empty cell".into()
                } else if grouped {
                    format!("`{shown}`: save the file {UNGROUPED}")
                } else {
                    format!("`{shown}`{}", advice(&text))
                };
                Err(self.failure(row, format!("expected a finite number, found {found}")).at_column(column))
            }
        }
    }

    /// A number whose cell, or column, may not be there.
    pub(crate) fn optional(&self, row: &Row, column: &str) -> Result<Option<f64>> {
        if !self.has(column) || self.cell(row, column)?.is_empty() {
            return Ok(None);
        }
        self.number(row, column).map(Some)
    }

    pub(crate) fn numbers<const N: usize>(&self, row: &Row, columns: [&str; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.number(row, column)?;
        }
        Ok(values)
    }
}

/// A column, if it is one, and what is wrong.
type Flaw = (Option<String>, String);

/// Whether semicolons stand between the cells of a text's header; or the line where it is none.
fn separator(text: &str) -> std::result::Result<bool, (u64, String)> {
    // what is no line of data, here and below
    let is_skipped =
        |line: &str| line.starts_with('#') || line.chars().all(|c| c.is_whitespace() || c == ';' || c == ',');
    let Some(header_line) = text.lines().find(|l| !is_skipped(l)) else {
        return Err((1, "expected a header line with column names, found nothing".into()));
    };
    let unquoted: String = header_line.split('"').step_by(2).collect();
    let semicolons = unquoted.contains(';');
    if header_line.matches('"').count() % 2 == 1 {
        let line = 1 + text.lines().take_while(|l| is_skipped(l)).count() as u64;
        return Err((line, "a quote in the header is not closed".into()));
    }
    // no list of columns that the program reads has but one
    if !semicolons && !unquoted.contains(',') {
        let line = 1 + text.lines().take_while(|l| is_skipped(l)).count() as u64;
        let title: String = unquoted.chars().take(40).collect();
        let found = if unquoted.contains('\t') {
            "tabs".into()
        } else {
            format!("`{}`: put # before lines above the header", printable(&title))
        };
        let message = format!("expected a header with commas or semicolons between its cells, found {found}");
        return Err((line, message));
    }
    Ok(semicolons)
}

/// Indices of the columns, each with a name of its own.
fn numbered(header: &[String]) -> std::result::Result<HashMap<String, usize>, Flaw> {
    let mut columns = HashMap::new();
    for (i, name) in header.iter().enumerate() {
        if name.parse::<f64>().is_ok_and(f64::is_finite) {
            let message = format!("expected a header with names of columns, found numbers such as `{name}`");
            return Err((None, message));
        }
        if name.is_empty() {
            return Err((None, format!("column {} of the header has no name", i + 1)));
        }
        if columns.insert(name.clone(), i).is_some() {
            return Err((Some(name.clone()), "duplicate column in the header".into()));
        }
    }
    Ok(columns)
}

/// Columns that are not known, unless they look like known ones.
fn unused_columns<'a>(
    header: &'a [String],
    columns: &HashMap<String, usize>,
    known: &[&str],
) -> std::result::Result<Vec<&'a str>, Flaw> {
    // a file with the pose in one form needs no column of the other
    let has_any = |names: &[&str]| names.iter().any(|n| columns.contains_key(*n));
    let (angles, lengths) = (has_any(&POSE_COLUMNS[1..]), has_any(&LENGTH_COLUMNS));
    let of_other_form = |name: &str| {
        (angles && LENGTH_COLUMNS.contains(&name)) || (lengths && !angles && POSE_COLUMNS[1..].contains(&name))
    };
    let (mut unused, mut misspelt) = (Vec::new(), Vec::new());
    for name in header.iter().filter(|n| !known.contains(&n.as_str())) {
        if name.len() > MAX_TYPO_BYTES {
            unused.push(name.as_str());
            continue;
        }
        let meant = known.iter().filter(|k| {
            looks_the_same(name, k) || (!columns.contains_key(**k) && !of_other_form(k) && looks_like(name, k))
        });
        match meant.min_by_key(|k| strsim::osa_distance(name, k)) {
            Some(meant) => misspelt.push((name, meant)),
            None => unused.push(name.as_str()),
        }
    }
    if let Some(((name, meant), more)) = misspelt.split_first() {
        let more: String = more.iter().map(|(name, meant)| format!("; `{meant}` for `{name}`?")).collect();
        return Err((Some((*name).clone()), format!("unknown column: did you mean `{meant}`?{more}")));
    }
    if unused.len() == header.len() {
        let (some, found) = (known.iter().take(4).copied().collect::<Vec<_>>().join(", "), header.join(", "));
        let message = format!("expected a header with column names such as {some}, found `{found}`");
        return Err((None, format!("{message}: put # before lines above the header")));
    }
    Ok(unused)
}

/// Digits of a number behind its point, with the exponent worked out: 4 of `1.2e-3`, none of `1.2e+2`.
pub(super) fn decimals(cell: &str) -> usize {
    let (mantissa, exponent) = cell.split_once(['e', 'E']).unwrap_or((cell, "0"));
    let digits = mantissa.rsplit_once(['.', ',']).map_or(0, |(_, fraction)| fraction.len());
    usize::try_from((digits as i64).saturating_sub(exponent.parse().unwrap_or(0))).unwrap_or(0)
}

pub(super) const UNGROUPED: &str = "without separators between thousands";

/// Whether a cell is a number with digits in groups of three.
pub(super) fn is_grouped(cell: &str, separators: &[char]) -> bool {
    let mut groups = cell.trim_start_matches(['+', '-']).split(separators);
    let digits = |group: &str| !group.is_empty() && group.bytes().all(|b| b.is_ascii_digit());
    let first = groups.next().is_some_and(|group| group.len() <= 3 && digits(group) && !group.starts_with('0'));
    // what is behind the last may be a fraction
    let rest: Vec<&str> = groups.collect();
    first && rest.first().is_some_and(|group| group.len() == 3) && rest.iter().all(|group| digits(group))
}

/// Whether two names differ in case, spaces and underscores alone.
fn looks_the_same(name: &str, known: &str) -> bool {
    let plain = |s: &str| s.to_lowercase().replace(['_', '-', ' '], "");
    plain(name) == plain(known)
}

/// Whether an unknown name is probably a typing error for a known one: another unit, a letter, in long names two.
fn looks_like(name: &str, known: &str) -> bool {
    // `k12 [N/m]`
    let name = name.split(['[', '(']).next().map(str::trim_end).filter(|n| !n.is_empty()).unwrap_or(name);
    let stem = |s: &str| s.rsplit_once('_').map(|(stem, _)| stem.to_lowercase());
    let allowed = if known.len() < 7 { 1 } else { 2 };
    let other_number = |a: &str, b: &str| {
        let letters = |s: &str| s.chars().filter(|c| !c.is_ascii_digit()).collect::<String>();
        letters(a) == letters(b) && a.len() == b.len()
    };
    (stem(known).is_some() && (stem(name) == stem(known) || stem(known) == Some(name.to_lowercase())))
        || (strsim::osa_distance(&name.to_lowercase(), known) <= allowed && !other_number(name, known))
}

/// CSV text. An id that starts with `#` is quoted, so that it is not read back as a comment.
pub fn to_csv<R: AsRef<[String]>>(delimiter: u8, header: &[String], rows: impl IntoIterator<Item = R>) -> String {
    let mut writer = csv::WriterBuilder::new().delimiter(delimiter).comment(Some(b'#')).from_writer(Vec::new());
    let mut write = |cells: &[String]| writer.write_record(cells).expect("writing to memory");
    write(header);
    for row in rows {
        write(row.as_ref());
    }
    String::from_utf8(writer.into_inner().expect("writing to memory")).expect("cells are UTF-8")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_behind_the_point_know_the_exponent() {
        for (cell, expected) in
            [("12", 0), ("-12.50", 2), ("12,5", 1), ("1.2345E+01", 3), ("1.2E+02", 0), ("1.2e-3", 4), ("5E-1", 1)]
        {
            assert_eq!(decimals(cell), expected, "{cell}");
        }
        // as small as it may be written
        assert!(decimals("1e-9223372036854775808") > 1_000_000);
    }
}

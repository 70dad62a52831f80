//! A CSV as cells: read with file, line and column of what is wrong, and written.

use std::collections::HashMap;
use std::fmt::Display;

use crate::error::{Failure, MAX_TYPO_BYTES, Result, advice, printable};
use crate::files::source::Source;

/// The pose columns, in the order in which they are written.
pub const POSE_COLUMNS: [&str; 4] = ["pose", "theta_deg", "sigma_deg", "z0_mm"];
/// What may stand in their place.
pub(super) const LENGTH_COLUMNS: [&str; 3] = ["q1_mm", "q2_mm", "q3_mm"];

/// A CSV as cells, checked for shape: one header, no doubled column, every row as wide as the header.
pub struct Sheet {
    pub(crate) source: Source,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Rows in the file's order.
    pub rows: Vec<Row>,
    pub(super) header_line: u64,
    /// Semicolons between cells: a decimal comma is as good as a point.
    semicolons: bool,
    /// Some number has one.
    decimal_commas: bool,
    columns: HashMap<String, usize>,
    /// Names the columns that are not used, and comments that look like rows.
    pub warnings: Vec<String>,
}

/// The first comment with as many cells as the header, most of them numbers: a row that was switched off, or one whose name begins
/// with #, which is read in quotes alone.
fn commented_rows(text: &str, semicolons: bool, width: usize) -> Option<String> {
    let is_number = |cell: &&str| cell.trim().replace(',', ".").parse::<f64>().is_ok();
    let is_row = |line: &str| {
        let cells: Vec<&str> = line.split(if semicolons { ';' } else { ',' }).collect();
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

/// A line of a [`Sheet`].
pub struct Row {
    /// Line in the file, from 1.
    pub line: u64,
    /// Cells without the spaces around them.
    pub cells: csv::StringRecord,
}

impl Row {
    /// The cells, to be changed.
    pub(crate) fn to_cells(&self) -> Vec<String> {
        self.cells.iter().map(str::to_owned).collect()
    }
}

impl Sheet {
    /// Reads a CSV and holds its header against the `known` columns.
    ///
    /// # Errors
    /// The line and column that are wrong; a column that looks like a misspelt known one.
    pub fn parse(source: Source, known: &[&str]) -> Result<Self> {
        let text = source.text()?;
        let fail = |line: u64, message: String| Failure::input(message).in_file(&source.name).at_line(line);
        let semicolons = separator(text).map_err(|(line, message)| fail(line, message))?;
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(if semicolons { b';' } else { b',' })
            .comment(Some(b'#'))
            .has_headers(false)
            .flexible(true)
            .from_reader(text.as_bytes());
        // the reader's position is where it began to look: comments and empty lines may come first
        let line_of = |position: Option<&csv::Position>| {
            let Some(p) = position else { return 1 };
            let rest = text.get(usize::try_from(p.byte()).unwrap_or(usize::MAX)..).unwrap_or("");
            p.line() + rest.lines().take_while(|l| l.is_empty() || l.starts_with('#')).count() as u64
        };
        let read = |e: csv::Error| fail(line_of(e.position()), format!("not a CSV line: {e}"));
        // spaces around a cell, and quotes that came behind a space
        let tidy = |cell: &str| {
            let cell = cell.trim();
            let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
            inner.unwrap_or(cell).trim().to_owned()
        };
        let mut records =
            reader.records().filter(|r| !r.as_ref().is_ok_and(|r| r.iter().all(|cell| cell.trim().is_empty())));
        let Some(header) = records.next() else { return Err(fail(1, "expected a header line, found none".into())) };
        let header = header.map_err(read)?;
        let at = line_of(header.position());
        let mut header: Vec<String> = header.iter().map(tidy).collect();
        // a spreadsheet keeps columns that once held something
        while header.last().is_some_and(String::is_empty) {
            header.pop();
        }
        let columns = numbered(&header).map_err(|(column, message)| {
            let failure = fail(at, message);
            if let Some(column) = column { failure.at_column(column) } else { failure }
        })?;
        let unused = unused_columns(&header, &columns, known).map_err(|(column, message)| {
            let failure = fail(at, message);
            if let Some(column) = column { failure.at_column(column) } else { failure }
        })?;
        let warning = || format!("{}:{at}: not used: {}", printable(&source.name), printable(&unused.join(", ")));
        let mut warnings: Vec<String> = (!unused.is_empty()).then(warning).into_iter().collect();
        warnings.extend(
            commented_rows(text, semicolons, header.len()).map(|what| format!("{}:{what}", printable(&source.name))),
        );

        let mut rows = Vec::new();
        for record in records {
            let record = record.map_err(read)?;
            let line = line_of(record.position());
            let mut cells: csv::StringRecord = record.iter().map(tidy).collect();
            while cells.len() > header.len() && cells[cells.len() - 1].is_empty() {
                cells.truncate(cells.len() - 1);
            }
            if cells.len() != header.len() {
                let (found, wide) = (cells.len(), header.len());
                let advice = if record.iter().any(|cell| cell.contains('\n')) {
                    ": is a quote not closed?"
                } else if found > wide && !semicolons {
                    ": for decimal commas write semicolons between cells"
                } else {
                    ""
                };
                return Err(fail(line, format!("expected {wide} cells as in the header, found {found}{advice}")));
            }
            rows.push(Row { line, cells });
        }
        if rows.is_empty() {
            return Err(fail(at, "expected rows of data below the header, found none".into()));
        }
        let is_number = |cell: &str| cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok();
        let numbers = columns.iter().filter(|(name, _)| **name != "pose" && known.contains(&name.as_str()));
        let decimal_commas =
            semicolons && numbers.into_iter().any(|(_, i)| rows.iter().any(|r| is_number(&r.cells[*i])));
        Ok(Self { header, header_line: at, rows, semicolons, decimal_commas, columns, warnings, source })
    }

    /// As this file has between cells.
    pub fn delimiter(&self) -> u8 {
        if self.semicolons { b';' } else { b',' }
    }

    /// A number as this file writes them.
    pub fn written(&self, value: impl Display) -> String {
        let text = value.to_string();
        if self.decimal_commas { text.replace('.', ",") } else { text }
    }

    pub(crate) fn has(&self, column: &str) -> bool {
        self.columns.contains_key(column)
    }

    pub(crate) fn failure(&self, row: &Row, message: impl Into<String>) -> Failure {
        Failure::input(message).in_file(&self.source.name).at_line(row.line)
    }

    /// A failure at the header, about a column that is not there.
    pub(crate) fn missing(&self, column: &str, why: &str) -> Failure {
        let failure = Failure::input(format!("missing column{why}")).in_file(&self.source.name);
        failure.at_line(self.header_line).at_column(column)
    }

    pub(crate) fn require(&self, columns: &[&str]) -> Result<()> {
        columns.iter().find(|c| !self.has(c)).map_or(Ok(()), |c| Err(self.missing(c, "")))
    }

    pub(crate) fn cell<'a>(&self, row: &'a Row, column: &str) -> Result<&'a str> {
        let index = self.columns.get(column).ok_or_else(|| self.missing(column, ""))?;
        Ok(&row.cells[*index])
    }

    /// A finite number. With semicolons between cells a decimal comma is as good as a point.
    pub(crate) fn number(&self, row: &Row, column: &str) -> Result<f64> {
        let cell = self.cell(row, column)?;
        if self.decimal_commas && is_grouped(cell, &['.']) {
            let message = format!("`{cell}`: point or thousands? Other numbers here have decimal commas");
            return Err(self.failure(row, format!("{message}: save the file {UNGROUPED}")).at_column(column));
        }
        let text = if self.semicolons { cell.replace(',', ".") } else { cell.to_owned() };
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
                    format!("`{shown}`{}", advice(cell))
                };
                Err(self.failure(row, format!("expected a finite number, found {found}")).at_column(column))
            }
        }
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

const UNGROUPED: &str = "without separators between thousands";

/// Whether a cell is a number with digits in groups of three.
fn is_grouped(cell: &str, separators: &[char]) -> bool {
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

//! Rows of a CSV: a text's lines with their cells, each brought to the width of the header.

use crate::error::{Failure, Result};

/// A line with its cells.
pub struct Row {
    /// Line in the file, from 1.
    pub line: u64,
    /// Cells without the spaces around them.
    pub cells: csv::StringRecord,
}

impl Row {
    /// The cells, to be changed.
    pub fn to_cells(&self) -> Vec<String> {
        self.cells.iter().map(str::to_owned).collect()
    }
}

/// A cell without the spaces around it, and the quotes that came behind a space.
fn tidy(cell: &str) -> String {
    // a file behind another keeps its byte order mark
    let cell = cell.trim().trim_start_matches('\u{feff}').trim();
    let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    inner.unwrap_or(cell).trim().to_owned()
}

/// The lines of a text with their cells, without comments and empty lines.
pub(super) fn records<'a>(text: &'a str, delimiter: u8, file: &'a str) -> impl Iterator<Item = Result<Row>> + 'a {
    let reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .comment(Some(b'#'))
        .has_headers(false)
        .flexible(true)
        .from_reader(text.as_bytes());
    // the reader's position is where it began to look: comments and empty lines may come first
    let line_of = move |position: Option<&csv::Position>| {
        let Some(p) = position else { return 1 };
        let rest = text.get(usize::try_from(p.byte()).unwrap_or(usize::MAX)..).unwrap_or("");
        p.line() + rest.lines().take_while(|l| l.is_empty() || l.starts_with('#')).count() as u64
    };
    reader.into_records().filter(|r| !r.as_ref().is_ok_and(|r| r.iter().all(|cell| cell.trim().is_empty()))).map(
        move |record| match record {
            Ok(record) => Ok(Row { line: line_of(record.position()), cells: record.iter().map(tidy).collect() }),
            Err(e) => {
                let failure = Failure::input(format!("not a CSV line: {e}")).in_file(file);
                Err(failure.at_line(line_of(e.position())))
            }
        },
    )
}

/// A header: its line, and the names of the columns.
#[derive(Clone)]
pub(super) struct Header {
    pub(super) line: u64,
    pub(super) names: Vec<String>,
    /// Empty columns at its end, beside the names.
    pub(super) empty: usize,
}

impl Header {
    /// Of a row, without the empty columns at its end, which a spreadsheet keeps once they held something.
    pub(super) fn new(row: &Row) -> Self {
        let mut names = row.to_cells();
        while names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        Self { line: row.line, empty: row.cells.len() - names.len(), names }
    }
}

/// Cells that all rows have beyond the header's: some programs end every row with a semicolon or tab.
pub(super) fn surplus(rows: &[Row], header: &Header) -> usize {
    let narrowest = rows.iter().map(|row| row.cells.len()).min().unwrap_or(0);
    narrowest.saturating_sub(header.names.len() + header.empty)
}

/// Brings a row to the width of the header: empty cells beyond it go, if all rows have them. One row alone that is wider has a separator
/// too many, and its cells moved.
pub(super) fn fitted(mut row: Row, header: &Header, surplus: usize, delimiter: u8) -> std::result::Result<Row, String> {
    let (width, with_empty, given) = (header.names.len(), header.names.len() + header.empty, row.cells.len());
    let separators = |cell: &str| cell.bytes().filter(|b| *b == delimiter).count();
    let is_swallowed = |cell: &str| cell.contains(['\n', '\r']) && (given < width || separators(cell) + 1 >= width);
    // a decimal comma moves what is behind it: a blank cell then stands beyond the header
    let may_be_commas = delimiter == b',';
    let commas = |mark| {
        if may_be_commas { format!("{mark} for decimal commas write semicolons between cells") } else { String::new() }
    };
    let expected = format!("expected {width} cells as in the header, found {given}");
    if row.cells.iter().any(is_swallowed) {
        return Err(format!("{expected}: is a quote not closed?"));
    }
    let unnamed = row.cells.iter().enumerate().skip(width).find(|(_, cell)| !cell.is_empty());
    match unnamed {
        _ if given < width => Err(expected),
        Some((n, cell)) if given <= with_empty => {
            Err(format!("`{cell}` stands in column {}, which has no name: name it, or empty it{}", n + 1, commas(';')))
        }
        Some(_) => Err(expected + &commas(':')),
        None if given <= with_empty || (given <= with_empty + surplus && !may_be_commas) => {
            row.cells.truncate(width);
            Ok(row)
        }
        None => {
            let commas = commas(':');
            Err(format!("{expected}, the last of them empty{commas}, otherwise leave out the separators at the end"))
        }
    }
}

//! Where the header of an export is, and what stands between its cells.

use std::collections::HashSet;

use super::names::{Names, split_unit};
use super::units;
use crate::csv_rows::{Header, Row, records};
use crate::error::{Failure, Result, printable};
use crate::source::Source;

/// Rows among which a header is looked for: a title and the settings of an instrument may stand above it.
const SEARCHED: usize = 100;

/// Columns that a message names, of any kind of file.
const EXAMPLES: [&str; 9] = ["pose", "theta_deg", "fx_n", "dx_um", "state", "point", "x_mm", "time_s", "force_n"];

/// A header and its place in the file.
pub(super) struct Found {
    pub(super) header: Header,
    pub(super) delimiter: u8,
    /// Rows above it, which are not read.
    pub(super) above: Vec<Row>,
    /// What of `--columns` is not in it.
    pub(super) not_renamed: Option<String>,
}

/// The first row with the most names that are known, whatever stands between the cells.
pub(super) fn find(source: &Source, text: &str, names: &Names<'_>) -> Result<Found> {
    let mut best = (0, 0, b',');
    for delimiter in [b',', b';', b'\t'] {
        for (n, row) in records(text, delimiter, &source.name).take(SEARCHED).enumerate() {
            let Ok(row) = row else { continue };
            let count = row.cells.iter().filter(|cell| names.is_known(cell)).count();
            if count > best.0 {
                best = (count, n, delimiter);
            }
        }
    }
    let (count, n, delimiter) = best;
    let around = records(text, delimiter, &source.name).skip(n.saturating_sub(1)).take(3);
    let around: Vec<Row> = around.filter_map(Result::ok).collect();
    if let Some(failure) = around.windows(2).find_map(|rows| in_two_rows(source, [&rows[0], &rows[1]], names)) {
        return Err(failure);
    }
    if count < 2 {
        return Err(commented(source, text, names).unwrap_or_else(|| none(source, text, names)));
    }
    let mut rows = records(text, delimiter, &source.name).take(n + 1).collect::<Result<Vec<_>>>()?;
    let Some(row) = rows.pop() else { return Err(none(source, text, names)) };
    let header = Header::new(&row);
    let not_renamed = names.require_renamed(&header.names);
    let not_renamed = not_renamed.map_err(|f| f.in_file(&source.name).at_line(header.line))?;
    Ok(Found { header, delimiter, above: rows, not_renamed })
}

/// How many columns that are known some names are of.
fn known_columns(cells: &[String], names: &Names<'_>) -> usize {
    cells.iter().filter_map(|cell| names.own_name(cell)).collect::<HashSet<_>>().len()
}

/// The names that a row of groups and the row below it make together: `Force [N]` over x, y, z. A cell of the upper row is that of all
/// columns up to the next, as a spreadsheet saves merged cells.
fn joined(upper: &[String], lower: &[String], names: &Names<'_>) -> Vec<String> {
    let mut group = "";
    let name = |n: usize| {
        let [upper, lower] = [upper, lower].map(|cells| cells.get(n).map_or("", String::as_str));
        if !upper.is_empty() {
            group = upper;
        }
        match split_unit(group) {
            _ if lower.is_empty() => upper.to_owned(),
            _ if group.is_empty() || names.is_known(lower) => lower.to_owned(),
            (group, Some(unit)) => format!("{group} {lower} [{unit}]"),
            (group, None) => format!("{group} {lower}"),
        }
    };
    (0..upper.len().max(lower.len())).map(name).collect()
}

/// Why a header cannot be read whose names stand in two rows: more are known together than in either row. One more alone may be that of
/// a row of data with such a word in it.
fn in_two_rows(source: &Source, [upper, lower]: [&Row; 2], names: &Names<'_>) -> Option<Failure> {
    let lines = [upper.line, lower.line];
    let [upper, lower] = [upper, lower].map(Row::to_cells);
    let both = joined(&upper, &lower, names);
    if known_columns(&both, names) < known_columns(&upper, names).max(known_columns(&lower, names)) + 2 {
        return None;
    }
    let mut numbers = names.number_columns(&both).into_iter().map(|n| &both[n]);
    let such = numbers.find(|name| !upper.contains(name) && !lower.contains(name));
    let such = such.map_or(String::new(), |name| format!(", such as `{}`", printable(name)));
    let message = format!(
        "names of columns in two rows, lines {} and {}: write them into one row, each column with its whole name{such}, and delete \
         the other",
        lines[0], lines[1]
    );
    Some(Failure::input(message).in_file(&source.name).at_line(lines[0]))
}

/// A header behind #, as numerical programs write it.
fn commented(source: &Source, text: &str, names: &Names<'_>) -> Option<Failure> {
    let is_header = |line: &str| {
        let cells = line.trim_start_matches(['#', ' ']).split([',', ';', '\t']);
        line.starts_with('#') && cells.filter(|cell| names.is_known(cell.trim())).count() > 1
    };
    let (line, _) = (1..).zip(text.lines().take(SEARCHED)).find(|(_, line)| is_header(line))?;
    let message = "the header begins with # and is taken as a comment: remove the #";
    Some(Failure::input(message).in_file(&source.name).at_line(line))
}

fn none(source: &Source, text: &str, names: &Names<'_>) -> Failure {
    let is_content = |line: &&str| !line.starts_with('#') && line.chars().any(char::is_alphanumeric);
    let mut lines = (1..).zip(text.lines());
    let (line, found) = match lines.find(|(_, line)| is_content(line)) {
        Some((n, line)) => (n, format!("`{}`", printable(&line.chars().take(60).collect::<String>()))),
        None => (1, "nothing".into()),
    };
    let own = names.own();
    let usual: Vec<&str> = EXAMPLES.into_iter().filter(|name| own.contains(name)).collect();
    let message = format!(
        "expected a header with column names such as {} with commas, semicolons or tabs between them, \
         found {found}: for other names say --columns new=theirs,…",
        usual.join(", ")
    );
    Failure::input(message).in_file(&source.name).at_line(line)
}

/// Why a line above the header with units is refused where columns have the program's own names, whose units are others.
pub(super) fn units_above(found: &Found, names: &Names<'_>) -> Option<Failure> {
    let own = names.columns.iter().find(|c| c.is_number() && found.header.names.iter().any(|name| name == c.name))?;
    let says_units = |row: &&Row| {
        let of = |text: &str| text.split([' ', ',', ';', '=']).filter(|part| units::is_any(part)).count();
        let first = row.cells[0].to_lowercase();
        let is_named = ["unit", "einheit", "unité"].iter().any(|word| first.starts_with(word));
        let are_cells = row.cells.iter().filter(|cell| units::is_any(cell)).count() > 2;
        are_cells || (is_named && row.cells.iter().map(of).sum::<usize>() > 0)
    };
    let line = found.above.iter().find(says_units)?.line;
    let message = format!(
        "units above the header, where {} has its own in its name: write each unit in brackets behind its name, or delete this line",
        own.name
    );
    Some(Failure::input(message).at_line(line))
}

/// The units of a row below the header that has nothing but units, without brackets; `None` for a row of data.
pub(super) fn units_of(row: &Row, header: &Header, names: &Names<'_>) -> Option<Vec<String>> {
    let cells = row.to_cells();
    let bare = |cell: &str| cell.trim_matches(['[', ']', '(', ')', ' ']).to_owned();
    let of_numbers: Vec<String> =
        names.number_columns(&header.names).iter().filter_map(|n| cells.get(*n)).map(|c| bare(c)).collect();
    let begins_a_number =
        |cell: &String| cell.trim_start_matches(['+', '-', '.']).starts_with(|c: char| c.is_ascii_digit());
    let are_units = !of_numbers.iter().any(begins_a_number) && of_numbers.iter().any(|cell| units::is_any(cell));
    are_units.then(|| cells.iter().map(|cell| bare(cell)).collect())
}

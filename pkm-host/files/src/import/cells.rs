//! Cells as others write them: what was not measured, signs, directions, units.

use super::names::Use;
use super::units;
use crate::csv::{Sheet, is_grouped};
use crate::csv_rows::Row;
use crate::error::Failure;

/// How people and spreadsheets write that there is no value.
const BLANKS: [&str; 16] =
    ["-", "--", "---", "–", "—", "−", "n/a", "n.a.", "na", "k.a.", "null", "none", "#n/a", "#nv", "#n/v", "#n/d"];

/// Instruments write 9.9e37 (SCPI) for a value that is too great for them.
const OVERFLOWS: std::ops::RangeInclusive<f64> = 9e36..=1e38;

/// How they write states of a point, in small letters.
const STATES: [(&str, &str); 8] = [
    ("unloaded", "unloaded"),
    ("loaded", "loaded"),
    ("unbelastet", "unloaded"),
    ("belastet", "loaded"),
    ("before", "unloaded"),
    ("after", "loaded"),
    ("vorher", "unloaded"),
    ("nachher", "loaded"),
];

/// How they write directions of the load, in small letters.
const DIRECTIONS: [(&str, &str); 12] = [
    ("load", "load"),
    ("up", "load"),
    ("loading", "load"),
    ("belastung", "load"),
    ("auf", "load"),
    ("charge", "load"),
    ("ab", "unload"),
    ("décharge", "unload"),
    ("unload", "unload"),
    ("down", "unload"),
    ("unloading", "unload"),
    ("entlastung", "unload"),
];

/// Columns by their place in a sheet, and how they are read.
pub(super) type Uses = Vec<Option<Use>>;

/// Changes cells of the used columns; says in how many something was changed.
fn change(sheet: &mut Sheet, uses: &Uses, new: impl Fn(&Use, &str) -> Option<String>) -> usize {
    let mut count = 0;
    for row in &mut sheet.rows {
        let changed: Vec<Option<String>> =
            (row.cells.iter().zip(uses)).map(|(cell, used)| used.as_ref().and_then(|used| new(used, cell))).collect();
        count += changed.iter().flatten().count();
        if changed.iter().any(Option::is_some) {
            let cells = row.cells.iter().zip(changed).map(|(old, new)| new.unwrap_or_else(|| old.to_owned()));
            row.cells = cells.collect();
        }
    }
    count
}

/// A dash for a direction where others are called `load` and none `unload`: it may say the other direction, or none.
pub(super) fn refuse_dashes(sheet: &Sheet) -> Option<Failure> {
    let column = sheet.header.iter().position(|name| name == "direction")?;
    let cells = || sheet.rows.iter().map(|row| (row, row.cells[column].to_lowercase()));
    let has = |new: &str| cells().any(|(_, cell)| DIRECTIONS.contains(&(cell.as_str(), new)));
    let (row, cell) =
        cells().find(|(_, cell)| ["-", "–", "−"].contains(&cell.as_str())).filter(|_| has("load") && !has("unload"))?;
    let message =
        format!("is `{cell}` unloading? Write unload, or leave the cell empty where the direction is not known");
    Some(sheet.failure(row, message).at_column("direction"))
}

/// The used columns of numbers: their place, and how they are read.
fn number_columns(uses: &Uses) -> impl Iterator<Item = (usize, &Use)> {
    uses.iter()
        .enumerate()
        .filter_map(|(n, used)| Some((n, used.as_ref()?)))
        .filter(|(_, used)| used.column.is_number())
}

/// Their cells, row by row.
fn number_cells<'a>(sheet: &'a Sheet, uses: &'a Uses) -> impl Iterator<Item = (&'a Row, usize, &'a Use)> {
    sheet.rows.iter().flat_map(move |row| number_columns(uses).map(move |(n, used)| (row, n, used)))
}

/// Numbers that instruments write where there is none.
pub(super) fn refuse_overflows(sheet: &Sheet, uses: &Uses) -> Vec<Failure> {
    let is_overflow = |cell: &str| cell.parse::<f64>().is_ok_and(|v| OVERFLOWS.contains(&v.abs()));
    let failure = |(row, n, used): (&Row, usize, &Use)| {
        let message =
            format!("`{}` is what an instrument writes where it has no value: leave the cell empty", &row.cells[n]);
        sheet.failure(row, message).at_column(used.column.name)
    };
    number_cells(sheet, uses).filter(|(row, n, _)| is_overflow(&row.cells[*n])).map(failure).collect()
}

/// Brings blanks, minus signs and directions to the way of `docs/formats.md`, and says so.
pub(super) fn tidy(sheet: &mut Sheet, uses: &Uses) -> Vec<String> {
    let is_blank = |cell: &str| BLANKS.contains(&cell.to_lowercase().as_str());
    let blanks = change(sheet, uses, |used, cell| (!used.column.is_chosen() && is_blank(cell)).then(String::new));
    let signs = change(sheet, uses, |used, cell| {
        let rest = cell.strip_prefix(['\u{2212}', '\u{2010}', '\u{2011}']).filter(|_| used.column.is_number())?;
        Some(format!("-{rest}"))
    });
    let mut words = |column: &str, known: &[(&str, &str)]| {
        change(sheet, uses, |used, cell| {
            let known = known.iter().find(|(theirs, _)| *theirs == cell.to_lowercase());
            let (_, new) = known.filter(|(_, new)| used.column.name == column && *new != cell)?;
            Some((*new).to_owned())
        })
    };
    let directions = words("direction", &DIRECTIONS);
    let states = words("state", &STATES);
    [
        (blanks, "cells with - or n/a, not measured"),
        (signs, "cells with a typographic minus, read as -"),
        (directions, "directions written otherwise, read as load and unload"),
        (states, "states written otherwise, read as unloaded and loaded"),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{what}: {count}"))
    .collect()
}

/// Converts the numbers that have another unit than their column. What is no number stays, and is refused by whoever reads it.
pub(super) fn convert(sheet: &mut Sheet, uses: &Uses) {
    let commas = sheet.has_decimal_commas();
    let is_clear = |cell: &str| !(commas && is_grouped(cell, &['.'])) && (commas || !cell.contains(','));
    change(sheet, uses, |used, cell| {
        let (from, to) = (used.unit?, used.column.own_unit()?);
        if std::ptr::eq(from, to) || !is_clear(cell) {
            return None;
        }
        let new = units::converted(cell, from, to)?;
        Some(if commas { new.replace('.', ",") } else { new })
    });
}

/// Numbers such as 1,234 and 1.234, of which nobody can tell whether the mark is a decimal one: in the file are decimal marks of both
/// kinds, or none that could not stand before thousands.
pub(super) fn refuse_ambiguous(sheet: &mut Sheet, uses: &Uses) -> Vec<Failure> {
    // a program that writes commas between cells has points in numbers, unless it is told otherwise
    if sheet.delimiter() == b',' {
        return grouped_by_points(sheet, uses);
    }
    let is_number = |cell: &str| cell.replacen(',', ".", 1).parse::<f64>().is_ok();
    let cells = || number_cells(sheet, uses);
    let has = |mark: char| {
        let is_fraction = |cell: &str| cell.contains(mark) && is_number(cell) && !is_grouped(cell, &[mark]);
        cells().any(|(row, n, _)| is_fraction(&row.cells[n]))
    };
    let (has_commas, has_points) = (has(','), has('.'));
    let unclear: &[(char, &str)] = match (has_commas, has_points) {
        (true, false) => return Vec::new(),
        (false, false) => &[(',', "comma"), ('.', "point")],
        _ => &[(',', "comma")],
    };
    let mark_of = |cell: &str| unclear.iter().find(|(mark, _)| is_grouped(cell, &[*mark]));
    let failures = cells()
        .filter_map(|(row, n, used)| Some((row, n, used, mark_of(&row.cells[n])?.1)))
        .map(|(row, n, used, mark)| {
            let message = format!(
                "`{}`: decimal {mark} or thousands? Other numbers here do not tell: save the file without separators between \
                 thousands, and with one decimal mark",
                &row.cells[n]
            );
            sheet.failure(row, message).at_column(used.column.name)
        })
        .collect();
    if !has_commas {
        sheet.take_points();
    }
    failures
}

/// Numbers such as 1.234 beside 567 in one column, where no number of the file has a fraction: a German spreadsheet writes thousands so.
fn grouped_by_points(sheet: &Sheet, uses: &Uses) -> Vec<Failure> {
    let columns = || number_columns(uses);
    let is_grouped = |cell: &str| is_grouped(cell, &['.']);
    let has_fraction =
        |(n, _): (usize, &Use)| sheet.rows.iter().any(|r| r.cells[n].contains('.') && !is_grouped(&r.cells[n]));
    if columns().any(has_fraction) {
        return Vec::new();
    }
    let is_whole = |cell: &str| cell.parse::<i64>().is_ok_and(|v| v != 0);
    let is_mixed = |n: usize| sheet.rows.iter().any(|row| is_whole(&row.cells[n]));
    let failures = columns().filter(|(n, _)| is_mixed(*n)).flat_map(|(n, used)| {
        sheet.rows.iter().filter(move |row| is_grouped(&row.cells[n])).map(move |row| {
            let message = format!(
                "`{}`: thousands? No number of the file has a fraction, and others here have no point: save the file without separators \
                 between thousands",
                &row.cells[n]
            );
            sheet.failure(row, message).at_column(used.column.name)
        })
    });
    failures.collect()
}

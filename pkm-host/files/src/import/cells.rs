//! Cells as others write them: what was not measured, signs, directions, units.

use super::names::Use;
use super::units;
use crate::csv::{Sheet, is_grouped};
use crate::error::Failure;

/// How people and spreadsheets write that there is no value.
const BLANKS: [&str; 11] = ["-", "--", "---", "–", "—", "−", "n/a", "n.a.", "na", "#n/a", "#nv"];

/// How they write states of a point, in small letters.
const STATES: [(&str, &str); 4] =
    [("unloaded", "unloaded"), ("loaded", "loaded"), ("unbelastet", "unloaded"), ("belastet", "loaded")];

/// How they write directions of the load, in small letters.
const DIRECTIONS: [(&str, &str); 8] = [
    ("load", "load"),
    ("up", "load"),
    ("loading", "load"),
    ("belastung", "load"),
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

/// Brings blanks, minus signs and directions to the way of `docs/formats.md`, and says so.
pub(super) fn tidy(sheet: &mut Sheet, uses: &Uses) -> Vec<String> {
    let is_blank = |cell: &str| BLANKS.contains(&cell.to_lowercase().as_str());
    let blanks = change(sheet, uses, |used, cell| (!used.column.is_chosen() && is_blank(cell)).then(String::new));
    let signs = change(sheet, uses, |used, cell| {
        let rest = cell.strip_prefix('\u{2212}').filter(|_| used.column.is_number())?;
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
    // a program that writes commas between cells has points in numbers
    if sheet.delimiter() == b',' {
        return Vec::new();
    }
    let is_number = |cell: &str| cell.replacen(',', ".", 1).parse::<f64>().is_ok();
    let cells = || {
        let of = |row| (uses.iter().enumerate()).filter_map(move |(n, used)| Some((row, n, used.as_ref()?)));
        sheet.rows.iter().flat_map(of).filter(|(_, _, used)| used.column.is_number())
    };
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

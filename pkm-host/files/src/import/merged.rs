//! Merged cells of a spreadsheet: it saves what stands in them with their first row alone.

use super::columns::{POINT_LIST, TIMED};
use crate::csv::{LENGTH_COLUMNS, POSE_COLUMNS, Sheet};
use crate::dataset::{LOAD_POINT_COLUMNS, POINT_COLUMNS, WRENCH_COLUMNS};
use crate::error::{Failure, lines_text, printable};

/// What is carried down with a pose where it is empty too. Not the direction: without it, the load history tells.
const WITH_POSE: [&str; 5] = ["series", "load", "temperature_c", "sigma_linear_um", "sigma_angular_urad"];

/// What rows of means, scatters and sums below a block of readings are called: letters and digits alone.
const MEANS_AND_SUMS: [&str; 33] = [
    "mean",
    "meanvalue",
    "avg",
    "average",
    "averagevalue",
    "sd",
    "std",
    "stdev",
    "stddev",
    "standarddeviation",
    "variance",
    "varianz",
    "cv",
    "rms",
    "median",
    "mittel",
    "mittelwert",
    "mw",
    "durchschnitt",
    "moyenne",
    "ecarttype",
    "écarttype",
    "stabw",
    "stdabw",
    "standardabweichung",
    "streuung",
    "sum",
    "total",
    "summe",
    "anzahl",
    "ergebnis",
    "subtotal",
    "teilergebnis",
];
/// What rows of extremes are called. A pose may well be called `max`.
const EXTREMES: [&str; 7] = ["min", "max", "minimum", "maximum", "maxmin", "range", "spannweite"];
/// Signs for such rows, beside the number of a repeat. A series may well be called `s` or `n`.
const SIGNS: [&str; 10] = ["n", "s", "σ", "ø", "x̄", "x̅", "2σ", "3σ", "6σ", "6sigma"];
/// Columns in which they say so. A load may well be called `max` or `mean`.
const NAMED: [&str; 5] = [POSE_COLUMNS[0], "target", "series", "reading", "repeat"];
/// Those of them whose names people choose.
const CHOSEN: [&str; 2] = [POSE_COLUMNS[0], "target"];

/// Letters and digits alone, small ones.
fn word(text: &str) -> String {
    let is_of_word = |c: &char| !(c.is_whitespace() || c.is_ascii_punctuation());
    text.to_lowercase().chars().filter(is_of_word).collect()
}

/// Whether a text says that it is of means and sums: `p01 Average`, `mean of 8`, and not `mean position`.
fn is_of_means(text: &str) -> bool {
    let is = |text: &str| MEANS_AND_SUMS.contains(&word(text).as_str());
    let is_beside = |part: &&str| ["n", "of", "aus", "de"].contains(part) || part.bytes().all(|b| b.is_ascii_digit());
    let lower = text.to_lowercase();
    let mut parts = lower.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty());
    is(text)
        || parts.clone().next_back().is_some_and(is)
        || (parts.clone().any(is) && parts.all(|p| is(p) || is_beside(&p)))
}

/// Columns of remarks, which the program does not use, and which call some rows means and sums; where they call most so, each reading is a mean.
fn remarks(sheet: &Sheet) -> Vec<usize> {
    let is_known = |name: &String| TIMED.iter().chain(POINT_LIST).any(|c| c.name == *name);
    let of_means = |n: &usize| sheet.rows.iter().filter(|row| is_of_means(&row.cells[*n])).count();
    let is_remark =
        |n: &usize| !is_known(&sheet.header[*n]) && (1..).contains(&of_means(n)) && 2 * of_means(n) < sheet.rows.len();
    (0..sheet.header.len()).filter(is_remark).collect()
}

/// Refuses rows of statistics, such as means: they are no readings, and would stand for some.
pub(crate) fn refuse_statistics(sheet: &mut Sheet) -> Vec<Failure> {
    let remarks = remarks(sheet);
    let is_named = |n: &usize| NAMED.contains(&sheet.header[*n].as_str()) || remarks.contains(n);
    let named: Vec<usize> = (0..sheet.header.len()).filter(is_named).collect();
    let mut failures = Vec::new();
    sheet.rows.retain(|row| {
        let is_chosen = |n: usize| CHOSEN.contains(&sheet.header[n].as_str());
        let is_statistic = |n: &&usize| {
            let (cell, word) = (&row.cells[**n], word(&row.cells[**n]));
            match sheet.header[**n].as_str() {
                "series" | "reading" | "repeat" if MEANS_AND_SUMS.contains(&word.as_str()) => true,
                "repeat" if SIGNS.contains(&word.as_str()) => true,
                "series" | "reading" | "repeat" => EXTREMES.contains(&word.as_str()),
                _ => is_of_means(cell),
            }
        };
        let found = named.iter().find(is_statistic);
        failures.extend(found.map(|n| {
            let column = &sheet.header[*n];
            let or = if is_chosen(*n) { format!("; if it is a {column}, name it otherwise") } else { String::new() };
            let message =
                format!("`{}` is no reading: leave out rows that are computed from others{or}", &row.cells[*n]);
            Failure::input(message).in_file(&sheet.source.name).at_line(row.line).at_column(column)
        }));
        found.is_none()
    });
    failures
}

/// Fills empty poses, and empty loads at the same pose, from the row above; says where. The coordinates of a pose, its point, and a load
/// are carried down as a whole: a single empty cell is a mistake, and stays one. So does a row of numbers alone, as one of means is, below
/// one with a number of its repeat.
pub(super) fn carry_down(sheet: &mut Sheet) -> Vec<String> {
    let place = |names: &[&str]| -> Vec<usize> {
        (0..sheet.header.len()).filter(|n| names.contains(&sheet.header[*n].as_str())).collect()
    };
    let name = place(&POSE_COLUMNS[..1]);
    let coordinates = place(&[&POSE_COLUMNS[1..], &LENGTH_COLUMNS].concat());
    let (point, load) = (place(&POINT_COLUMNS), place(&[&WRENCH_COLUMNS[..], &LOAD_POINT_COLUMNS].concat()));
    let with_pose = place(&WITH_POSE);
    let numbered = place(&["reading", "repeat"]);
    let mut carried = [Vec::new(), Vec::new()];
    for n in 1..sheet.rows.len() {
        let (above, below) = sheet.rows.split_at_mut(n);
        let (above, row) = (&above[n - 1].cells, &mut below[0]);
        let is_empty = |columns: &[usize]| !columns.is_empty() && columns.iter().all(|c| row.cells[*c].is_empty());
        let is_as_above = |columns: &[usize]| columns.iter().all(|c| row.cells[*c] == above[*c]);
        // a name of its own, such as that of a sum, belongs to no merged cell
        let lacks_pose = is_empty(&coordinates) && (is_empty(&name) || is_as_above(&name));
        let is_of_pose_above = is_as_above(&coordinates) && (is_as_above(&name) || is_empty(&name));
        let lacks_load = is_empty(&load) && (lacks_pose || is_of_pose_above);
        if lacks_pose && lacks_load && numbered.iter().any(|c| row.cells[*c].is_empty() && !above[*c].is_empty()) {
            continue;
        }
        let mut columns = Vec::new();
        if !lacks_pose && is_of_pose_above && is_empty(&name) {
            columns.extend(&name);
            carried[0].push(row.line);
        }
        if lacks_pose {
            columns.extend(name.iter().chain(&coordinates).chain(point.iter().filter(|_| is_empty(&point))));
            columns.extend(with_pose.iter().filter(|c| row.cells[**c].is_empty()));
            carried[0].push(row.line);
        }
        if lacks_load {
            columns.extend(&load);
            carried[1].push(row.line);
        }
        if !columns.is_empty() {
            let cells = row.cells.iter().enumerate();
            row.cells = cells.map(|(c, cell)| if columns.contains(&c) { &above[c] } else { cell }).collect();
        }
    }
    let file = printable(&sheet.source.name);
    let warning = |(lines, what): (&Vec<u64>, &str)| {
        let (first, rest) = lines.split_first()?;
        let more = if rest.is_empty() { String::new() } else { format!(", and in {}", lines_text(rest)) };
        Some(format!("{file}:{first}: empty {what} taken from the row above{more}, as in merged cells: is that right?"))
    };
    carried.iter().zip(["pose", "load"]).filter_map(warning).collect()
}

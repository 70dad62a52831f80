//! Merged cells of a spreadsheet: it saves what stands in them with their first row alone.

use crate::csv::{LENGTH_COLUMNS, POSE_COLUMNS, Sheet};
use crate::dataset::{LOAD_POINT_COLUMNS, POINT_COLUMNS, WRENCH_COLUMNS};
use crate::error::{Failure, lines_text, printable};

/// What is carried down with a pose where it is empty too. Not the direction: without it, the load history tells.
const WITH_POSE: [&str; 5] = ["series", "load", "temperature_c", "sigma_linear_um", "sigma_angular_urad"];

/// What rows of means, scatters and sums below a block of readings are called: letters and digits alone.
const MEANS_AND_SUMS: [&str; 30] = [
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
];
/// What rows of extremes are called. A pose may well be called `max`.
const EXTREMES: [&str; 7] = ["min", "max", "minimum", "maximum", "maxmin", "range", "spannweite"];
/// Signs for such rows, beside the number of a repeat. A series may well be called `s` or `n`.
const SIGNS: [&str; 10] = ["n", "s", "σ", "ø", "x̄", "x̅", "2σ", "3σ", "6σ", "6sigma"];
/// Columns in which they say so. A load may well be called `max` or `mean`.
const NAMED: [&str; 5] = [POSE_COLUMNS[0], "target", "series", "reading", "repeat"];
/// Those of them whose names people choose.
const CHOSEN: [&str; 2] = [POSE_COLUMNS[0], "target"];

/// Refuses rows of statistics, such as means: they are no readings, and would stand for some.
pub(crate) fn refuse_statistics(sheet: &mut Sheet) -> Vec<Failure> {
    let named: Vec<usize> = (0..sheet.header.len()).filter(|n| NAMED.contains(&sheet.header[*n].as_str())).collect();
    let mut failures = Vec::new();
    sheet.rows.retain(|row| {
        let is_chosen = |n: usize| CHOSEN.contains(&sheet.header[n].as_str());
        let is_statistic = |n: &&usize| {
            let is_of_word = |c: &char| !(c.is_whitespace() || c.is_ascii_punctuation());
            let word: String = row.cells[**n].to_lowercase().chars().filter(is_of_word).collect();
            MEANS_AND_SUMS.contains(&word.as_str())
                || (!is_chosen(**n) && EXTREMES.contains(&word.as_str()))
                || (sheet.header[**n] == "repeat" && SIGNS.contains(&word.as_str()))
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

//! Merged cells of a spreadsheet: it saves what stands in them with their first row alone.

use crate::error::printable;
use crate::files::csv::{LENGTH_COLUMNS, POSE_COLUMNS, Sheet};
use crate::files::dataset::{POINT_COLUMNS, WRENCH_COLUMNS};

/// Fills empty poses, and empty loads at the same pose, from the row above; says where. A pose or a load is carried down as a whole:
/// a single empty cell is a mistake, and stays one.
pub(super) fn carry_down(sheet: &mut Sheet) -> Vec<String> {
    let place = |names: &[&str]| -> Vec<usize> {
        (0..sheet.header.len()).filter(|n| names.contains(&sheet.header[*n].as_str())).collect()
    };
    let pose = place(&[&POSE_COLUMNS[..], &LENGTH_COLUMNS, &POINT_COLUMNS].concat());
    let load = place(&WRENCH_COLUMNS);
    let with_pose = place(&["series", "load"]);
    let mut carried = [Vec::new(), Vec::new()];
    for n in 1..sheet.rows.len() {
        let (above, below) = sheet.rows.split_at_mut(n);
        let (above, row) = (&above[n - 1].cells, &mut below[0]);
        let is_empty = |columns: &[usize]| !columns.is_empty() && columns.iter().all(|c| row.cells[*c].is_empty());
        let has_pose = !is_empty(&pose);
        let same_pose = !has_pose || pose.iter().all(|c| row.cells[*c] == above[*c]);
        let has_load = !is_empty(&load);
        if has_pose && (has_load || !same_pose) {
            continue;
        }
        let mut columns = Vec::new();
        if !has_pose {
            columns.extend(pose.iter().chain(with_pose.iter().filter(|c| row.cells[**c].is_empty())).copied());
            carried[0].push(row.line);
        }
        if !has_load {
            columns.extend(&load);
            carried[1].push(row.line);
        }
        row.cells = (row.cells.iter().enumerate())
            .map(|(c, cell)| if columns.contains(&c) { &above[c] } else { cell })
            .collect();
    }
    let file = printable(&sheet.source.name);
    let warning = |(lines, what): (&Vec<u64>, &str)| {
        let first = lines.first()?;
        let more = if lines.len() > 1 { format!(", and in {} more lines", lines.len() - 1) } else { String::new() };
        Some(format!("{file}:{first}: empty {what} taken from the row above{more}, as in merged cells: is that right?"))
    };
    carried.iter().zip(["pose", "load"]).filter_map(warning).collect()
}

//! Which way the load of a reading acts: as its row says.

use std::collections::BTreeMap;

use crate::csv::{Row, Sheet};
use crate::dataset::WRENCH_COLUMNS;
use crate::error::Result;
use crate::load_log::Cell;

/// Direction, in A-uvw, in which a positive force of the cell acts on the platform.
pub(super) const DIRECTION_COLUMNS: [&str; 3] = ["force_u", "force_v", "force_w"];
/// Share of the greatest load below which a sign tells nothing.
const SIGNED: f64 = 0.2;

/// What a row says of its load.
#[derive(Clone, Copy, Debug)]
pub(super) enum Meant {
    /// That there was none.
    Unloaded,
    /// Nothing: the log has all components.
    Anything,
    /// The direction of a positive force, of length 1.
    Direction([f64; 6]),
    /// The load as it was meant, N and N·m.
    Nominal([f64; 6]),
}

/// What all rows say.
///
/// # Errors
/// Neither direction nor nominal load for a cell along one axis; both; a direction of length 0 that is not 0, 0, 0.
pub(super) fn of_rows(sheet: &Sheet, cell: Cell) -> Result<Vec<Meant>> {
    let has_direction = DIRECTION_COLUMNS.iter().any(|c| sheet.has(c));
    let has_nominal = WRENCH_COLUMNS.iter().any(|c| sheet.has(c));
    let fail = |column: &str, message: &str| {
        let failure = crate::error::Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line());
        Err(failure.at_column(column))
    };
    match (cell, has_direction, has_nominal) {
        (Cell::Components(_) | Cell::Moment, true, _) => {
            fail(DIRECTION_COLUMNS[0], "not expected: the direction of a force, and the log is of no cell that has one force")
        }
        (_, true, true) => fail(
            DIRECTION_COLUMNS[0],
            "the direction of the force and nominal loads fx_n, … beside each other: leave one of them",
        ),
        (Cell::Force | Cell::Moment, false, false) => Err(sheet.missing(
            if cell == Cell::Force { DIRECTION_COLUMNS[0] } else { WRENCH_COLUMNS[3] },
            ": nothing says which way the cell pulls. Write the nominal load of each reading (fx_n, … mz_nm; 0 where there is none), or \
             the direction of the force (force_u, force_v, force_w in A-uvw)",
        )),
        (_, true, false) => sheet.rows.iter().map(|row| direction(sheet, row)).collect(),
        (_, false, true) => sheet.rows.iter().map(|row| nominal(sheet, row, cell)).collect(),
        (Cell::Components(_), false, false) => Ok(vec![Meant::Anything; sheet.rows.len()]),
    }
}

fn direction(sheet: &Sheet, row: &Row) -> Result<Meant> {
    let [u, v, w] = sheet.numbers(row, DIRECTION_COLUMNS)?;
    let length = u.hypot(v).hypot(w);
    Ok(if length > 0.0 {
        Meant::Direction([u / length, v / length, w / length, 0.0, 0.0, 0.0])
    } else {
        Meant::Unloaded
    })
}

fn nominal(sheet: &Sheet, row: &Row, cell: Cell) -> Result<Meant> {
    let load = sheet.load(row)?;
    if load.iter().all(|v| *v == 0.0) {
        return Ok(Meant::Unloaded);
    }
    if axial_size(&load, cell) == Some(0.0) {
        let (column, what, other) = match cell {
            Cell::Force => (WRENCH_COLUMNS[0], "force", "moments"),
            _ => (WRENCH_COLUMNS[3], "moment", "forces"),
        };
        let message = format!("the nominal load has {other} alone, and the log is of a cell that reads one {what}");
        return Err(sheet.failure(row, message).at_column(column));
    }
    Ok(Meant::Nominal(load))
}

/// What a cell along one axis reads of a load, without its sign; `None` of components.
fn axial_size(load: &[f64; 6], cell: Cell) -> Option<f64> {
    let [fx, fy, fz, mx, my, mz] = *load;
    match cell {
        Cell::Force => Some(fx.hypot(fy).hypot(fz)),
        Cell::Moment => Some(mx.hypot(my).hypot(mz)),
        Cell::Components(_) => None,
    }
}

/// What a cell along one axis read, with its sign; `None` of components.
fn axial(read: &[f64; 6], cell: Cell) -> Option<f64> {
    let (_, component) = *cell.columns().first()?;
    axial_size(read, cell).map(|_| read[component])
}

/// The load of each row, by what was read of it; and the rows whose sign differs from that of others under the same nominal load.
///
/// A nominal load says the direction with its sense: many cells are pulled whichever way the machine is. So its sense counts, and the
/// size of what was read, unless the sign differs from that of most readings of the same direction.
pub(super) fn wrenches(meant: &[Meant], read: &[[f64; 6]], cell: Cell) -> (Vec<[f64; 6]>, Vec<usize>) {
    let flipped = flipped(meant, read, cell);
    let wrench = |n: usize| match (meant[n], axial(&read[n], cell)) {
        (Meant::Unloaded, _) => [0.0; 6],
        (Meant::Direction(direction), Some(force)) => direction.map(|d| d * force),
        (Meant::Nominal(nominal), Some(value)) => {
            let sign = if flipped.contains(&n) { -1.0 } else { 1.0 };
            let size = axial_size(&nominal, cell).unwrap_or(1.0);
            nominal.map(|v| sign * v * value.abs() / size)
        }
        _ => read[n],
    };
    ((0..meant.len()).map(wrench).collect(), flipped)
}

/// Readings whose sign differs from that of most under nominal loads of the same direction, as far as they are large enough to have one.
fn flipped(meant: &[Meant], read: &[[f64; 6]], cell: Cell) -> Vec<usize> {
    let of_nominal = |n: usize| match (meant[n], axial(&read[n], cell)) {
        (Meant::Nominal(nominal), Some(value)) => Some((n, nominal, value)),
        _ => None,
    };
    let all: Vec<(usize, [f64; 6], f64)> = (0..meant.len()).filter_map(of_nominal).collect();
    let greatest = all.iter().map(|(.., value)| value.abs()).fold(0.0, f64::max);
    let mut ways: BTreeMap<[i64; 6], Vec<(usize, f64)>> = BTreeMap::new();
    for (n, nominal, value) in all.into_iter().filter(|(.., value)| value.abs() > SIGNED * greatest) {
        let largest = nominal.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        ways.entry(nominal.map(|v| (1e3 * v / largest).round() as i64)).or_default().push((n, value));
    }
    let odd = |way: Vec<(usize, f64)>| {
        let positive = way.iter().filter(|(_, value)| *value > 0.0).count();
        let is_usual = |value: f64| (value > 0.0) == (2 * positive >= way.len());
        way.iter().filter(|(_, value)| !is_usual(*value)).map(|(n, _)| *n).collect::<Vec<_>>()
    };
    ways.into_values().flat_map(odd).collect()
}

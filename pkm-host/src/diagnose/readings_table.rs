//! The readings one by one: a row leads to its points in the charts of the residuals, and a point to its row.

use maud::Markup;

use super::compare::Rival;
use super::{Diagnosis, text};
use crate::files::readings::{CHANNELS, Readings};
use crate::page::keyed_table;
use crate::pose::written_units;

/// Rows, at most: more would make a page slow.
const ROWS: usize = 1500;

/// Greatest residual of a reading over its standard deviation, and whether it was left out.
fn worst(d: &Diagnosis, readings: &Readings, n: usize) -> (f64, bool) {
    let r = &readings.readings[n];
    let own = |c: usize| {
        Some(((r.observed[c]? - d.own.of(Rival::After)[r.condition][c]) / d.standard_deviations[n][c]).abs())
    };
    ((0..CHANNELS).filter_map(own).fold(0.0, f64::max), d.left_out.iter().any(|(reading, _)| *reading == n))
}

/// The table, the farthest off first.
pub(super) fn list(readings: &Readings, d: &Diagnosis) -> Markup {
    let mut order: Vec<(usize, f64, bool)> = (0..readings.readings.len())
        .map(|n| {
            let (size, left_out) = worst(d, readings, n);
            (n, size, left_out)
        })
        .collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    order.truncate(ROWS);
    let length = |predictions: &[[f64; CHANNELS]], n: usize| {
        let r = &readings.readings[n];
        let squares = (0..3).filter_map(|c| r.observed[c].map(|read| (read - predictions[r.condition][c]).powi(2)));
        format!("{:.2}", squares.sum::<f64>().sqrt() * 1e6)
    };
    let row = |(n, size, left_out): &(usize, f64, bool)| {
        let r = &readings.readings[*n];
        let c = &readings.conditions[r.condition];
        let [theta, sigma, z0] = written_units(&readings.poses[c.pose].pose).map(|v| v.to_string());
        let cells = vec![
            theta,
            sigma,
            z0,
            text::load(&c.wrench),
            length(d.own.of(Rival::Declared), *n),
            length(d.own.of(Rival::After), *n),
            format!("{size:.1}"),
            if *left_out { "left out".to_owned() } else { String::new() },
        ];
        (format!("line {}", r.line), cells)
    };
    let rows: Vec<_> = order.iter().map(row).collect();
    let keys: Vec<usize> = order.iter().map(|(n, ..)| *n).collect();
    let heads = ["θ °", "σ °", "Z0 mm", "load", "declared, µm", "identified, µm", "worst residual, sd", "note"];
    keyed_table(
        "Readings, the farthest off first: length of the translation error of the model as declared and as identified, and the greatest residual \
         over its standard deviation. All of them are in residuals.csv.",
        &heads,
        &rows,
        &keys,
    )
}

//! What repeats say: too few of them, some that differ far more than the rest, rows that stand in the file twice.

use std::collections::{BTreeMap, HashMap, HashSet};

use pkm_diagnosis::Rules;

use super::DataWarning;
use crate::diagnose::WarningKind;
use crate::diagnose::checks_of_noise::{WideRepeats, wide_repeats};
use crate::error::lines_text;
use crate::files::dataset::{READ_COLUMNS, Sheet};
use crate::files::readings::{CHANNELS, KINDS, Reading, Readings};

/// Indices of readings that repeat one another.
fn groups(readings: &Readings) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (n, r) in readings.readings.iter().enumerate() {
        groups.entry(r.repeat_of).or_default().push(n);
    }
    groups.into_values().collect()
}

pub(super) fn check(sheet: &Sheet, readings: &Readings, rules: &Rules) -> Vec<DataWarning> {
    few(readings, &groups(readings), rules).into_iter().chain(wide(readings)).chain(duplicates(sheet)).collect()
}

/// Too few repeats to take the noise from, where none is declared: fewer than leave a diagnosis something that counts as explained, counted
/// in rows, of which each channel has as many.
fn few(readings: &Readings, groups: &[Vec<usize>], rules: &Rules) -> Option<DataWarning> {
    let least = rules.min_dof_of_verdict as usize;
    let has_own = |r: &Reading, c: usize| r.sigma[KINDS[c]].is_some() || r.covariance.is_some();
    let is_declared = readings.readings.iter().all(|r| (0..CHANNELS).all(|c| r.observed[c].is_none() || has_own(r, c)));
    let freedom: usize = groups.iter().map(|g| g.len() - 1).sum();
    if is_declared || freedom >= least {
        return None;
    }
    // large loads show the noise of an experiment best, and a pose of its own each its zero
    let size = |n: usize| {
        let wrench = readings.conditions[readings.readings[n].condition].wrench.to_vector();
        wrench.iter().map(|f| f * f).sum::<f64>()
    };
    let mut single: Vec<usize> = groups.iter().filter(|g| g.len() == 1).map(|g| g[0]).collect();
    single.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let mut poses = HashSet::new();
    single.retain(|n| poses.insert(readings.conditions[readings.readings[*n].condition].pose));
    let lines: Vec<u64> = single.iter().take(least - freedom).map(|n| readings.readings[*n].line).collect();
    let which = if lines.is_empty() { String::new() } else { format!(", such as those of {}", lines_text(&lines)) };
    let message = format!(
        "{freedom} repeated rows to take the noise of a channel from, fewer than {least}: read {} more under the same pose, load and \
         direction{which}, or add the columns sigma_linear_um and sigma_angular_urad",
        least - freedom
    );
    Some(DataWarning::new(WarningKind::FewRepeats, message))
}

/// Repeats of which one differs from the others far more than repeats do elsewhere.
fn wide(readings: &Readings) -> Vec<DataWarning> {
    let warning = |WideRepeats { channel, lines, size, ratio }: WideRepeats| {
        let message = format!(
            "repeats in {} differ by {:.1} µm or µrad, {ratio:.0} times as much as repeats elsewhere: is one of them mistyped, \
             or of another load?",
            lines_text(&lines),
            size * 1e6
        );
        DataWarning::new(WarningKind::RepeatsDiffer, message).at_lines(lines).at_column(READ_COLUMNS[channel])
    };
    wide_repeats(readings, &[]).into_iter().map(warning).collect()
}

/// Rows that agree in every cell but the numbers of reading and repeat: no two readings do.
pub(super) fn duplicates(sheet: &Sheet) -> Option<DataWarning> {
    let counted: Vec<usize> =
        (0..sheet.header.len()).filter(|n| !["reading", "repeat"].contains(&sheet.header[*n].as_str())).collect();
    let measured: Vec<usize> =
        counted.iter().copied().filter(|n| READ_COLUMNS.contains(&sheet.header[*n].as_str())).collect();
    let mut seen: HashMap<Vec<&str>, u64> = HashMap::new();
    let (mut again, mut first_line) = (Vec::new(), 0);
    for row in &sheet.rows {
        let is_number = |n: &&usize| sheet.number(row, &sheet.header[**n]).is_ok_and(|v| v != 0.0);
        // zeros, and a channel or two, agree by chance
        if measured.iter().filter(is_number).count() < 3 {
            continue;
        }
        let key = counted.iter().map(|n| &row.cells[*n]).collect();
        if let Some(first) = seen.get(&key) {
            if again.is_empty() {
                first_line = *first;
            }
            again.push(row.line);
        } else {
            seen.insert(key, row.line);
        }
    }
    let others = match again.as_slice() {
        [] => return None,
        [_] => String::new(),
        [_, rest @ ..] => format!(", and as often in {}", lines_text(rest)),
    };
    let message =
        format!("the same reading as in line {first_line}{others}: delete one of two if it was not read twice");
    Some(DataWarning::new(WarningKind::DuplicateRow, message).at_lines(again))
}

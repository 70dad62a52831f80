//! Exports that hold no readings, told by their columns, with what is missing.

use super::header;
use super::names::{Names, Renames};
use crate::csv::{LENGTH_COLUMNS, POSE_COLUMNS, Sheet};
use crate::dataset::{DEFLECTION_COLUMNS, WRENCH_COLUMNS};
use crate::error::Failure;
use crate::source::Source;

/// How a column of times is called.
const TIMES: [&str; 7] = ["time", "zeit", "t", "timestamp", "date", "datum", "uhrzeit"];

/// What is said of a log of loads.
const LOAD_LOG: &str = "a log of loads over time: it has no pose and no deflection. `pkm-host import --data READINGS --loads` joins it to the \
                        readings by their times, or write the load of each reading into the columns fx, fy, fz (mx, my, mz) of the \
                        file with the readings";

/// Columns that tell the time in a log.
const TIME_COLUMNS: [&str; 4] = ["time_s", "time", "date", "sample"];

/// Why a file whose header has no names of readings cannot be read, where it is a log of loads.
pub(super) fn load_log(source: &Source, text: &str, names: &Names<'_>) -> Option<Failure> {
    let renames = Renames::default();
    let of_log = Names::of_load_log(&renames);
    let found = header::find(source, text, &of_log).ok()?;
    let own: Vec<&str> = found.header.names.iter().filter_map(|cell| of_log.own_name(cell)).collect();
    let (has_time, has_load) =
        (own.iter().any(|n| TIME_COLUMNS.contains(n)), own.iter().any(|n| !TIME_COLUMNS.contains(n)));
    let of_readings = found.header.names.iter().filter(|cell| names.is_known(cell)).count();
    (has_time && has_load && of_readings < 2)
        .then(|| Failure::input(LOAD_LOG).in_file(&source.name).at_line(found.header.line))
}

/// Why a file cannot be read as measured data, where it is a tracker's list of points or a log of loads.
pub(super) fn other_than_readings(sheet: &Sheet) -> Option<Failure> {
    let has_any = |names: &[&str]| names.iter().any(|n| sheet.has(n));
    let has_word = |word: &str| {
        sheet
            .header
            .iter()
            .any(|h| h.split(['[', '(', ' ', '_']).next().is_some_and(|name| name.eq_ignore_ascii_case(word)))
    };
    let has_pose = has_any(&POSE_COLUMNS[1..]) || has_any(&LENGTH_COLUMNS);
    let (has_load, has_deflection) = (has_any(&WRENCH_COLUMNS), has_any(&DEFLECTION_COLUMNS));
    let message = if ["x", "y", "z"].iter().all(|axis| has_word(axis)) && !has_load && !has_deflection {
        if has_pose && has_word("target") {
            "places of targets at unloaded poses: `pkm-host diagnose --unloaded` finds the geometry from them; a diagnosis of the \
             stiffness needs deflections under loads"
        } else {
            "a tracker's list of points: x, y, z are positions in its own frame, and a diagnosis needs deflections of A in A-uvw, \
             loaded minus unloaded, with pose and load: `pkm-host import --points` makes them of this list, with the reflectors \
             (--reflectors) and with pose and load of each reading (--readings)"
        }
    } else if has_load && !has_pose && !has_deflection && TIMES.iter().any(|t| has_word(t)) {
        LOAD_LOG
    } else {
        return None;
    };
    Some(Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line))
}

//! When readings were taken, by the clock of a log.

use crate::clock::{Clock, DAY_S, Times};
use crate::error::{Failure, Result};
use crate::load_log::LoadLog;

/// Times of readings by the log's clock, where both clocks agree; and what is doubtful about that.
pub(super) fn by_log(readings: &Times, log: &LoadLog) -> Result<(Vec<f64>, Option<String>)> {
    let began = log.samples.first().map_or(0.0, |s| s.time_s);
    let earliest = readings.seconds.iter().copied().fold(f64::INFINITY, f64::min);
    let midnight = |seconds: f64| (seconds / DAY_S).floor() * DAY_S;
    let shifted = |by_s: f64| readings.seconds.iter().map(|t| t + by_s).collect::<Vec<f64>>();
    let one_zone = "one file has the zone of its clock and the other has none: taken for the same. If they differ, say by how \
                    much: --load-clock-s";
    Ok(match (readings.clock, log.clock) {
        (Clock::Date { zone_min: Some(own) }, Clock::Date { zone_min: Some(of_log) }) => {
            (shifted(60.0 * f64::from(of_log - own)), None)
        }
        (Clock::Date { zone_min: own }, Clock::Date { zone_min: of_log }) => {
            (shifted(0.0), (own != of_log).then(|| one_zone.to_owned()))
        }
        (Clock::Date { .. }, Clock::Day) => (shifted(-midnight(earliest)), None),
        (Clock::Day, Clock::Date { .. } | Clock::Day) => {
            let by_clock = |t: &f64| {
                let same_day = midnight(began) + t;
                // past midnight, unless the reading lies a little before the log
                if began - same_day > 0.5 * DAY_S { same_day + DAY_S } else { same_day }
            };
            (readings.seconds.iter().map(by_clock).collect(), None)
        }
        (Clock::Elapsed, Clock::Elapsed) => (
            shifted(0.0),
            Some("both files count seconds: taken from one start. If the log began later, say --load-clock-s".into()),
        ),
        (_, Clock::Elapsed) => {
            let message = "the log counts seconds from its start: say when that was by the clock of the readings, such as \
                           --load-start 2026-03-14T09:26:53, or --load-start 09:26:53";
            return Err(Failure::input(message).in_file(&log.name).at_column(log.time_column));
        }
        (Clock::Elapsed, _) => {
            let message = "the readings count seconds from a start that the log, which has a clock, does not tell: write the \
                           clock's time of each reading";
            return Err(Failure::input(message));
        }
    })
}

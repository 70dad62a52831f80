//! When readings were taken, by the clock of a log.

use crate::clock::{Clock, DAY_S, Times};
use crate::error::{Failure, Result};
use crate::load_log::{LoadLog, Sample};

/// The shift by whole days that brings the times from `first_s` to `last_s` into the log, or nearest to it where none does; `None` where
/// several do.
fn days_s([begins_s, ends_s]: [f64; 2], [first_s, last_s]: [f64; 2]) -> Option<f64> {
    let outside_s = |shift_s: f64| (begins_s - first_s - shift_s).max(0.0) + (last_s + shift_s - ends_s).max(0.0);
    let [first_day, last_day] = [((begins_s - first_s) / DAY_S).ceil(), ((ends_s - last_s) / DAY_S).floor()];
    let shifts_s = [first_day, last_day].map(|days| days * DAY_S);
    let nearest_s = shifts_s.into_iter().min_by(|a, b| outside_s(*a).total_cmp(&outside_s(*b)));
    nearest_s.filter(|_| last_day <= first_day)
}

/// Times of readings by the log's clock, where both clocks agree; and what is doubtful about that.
///
/// # Arguments
/// * `ahead_s`: by how much the readings' clock is ahead of the log's.
pub(super) fn by_log(readings: &Times, log: &LoadLog, ahead_s: f64) -> Result<(Vec<f64>, Option<String>)> {
    let times_s: Vec<f64> = readings.seconds.iter().map(|t| t - ahead_s).collect();
    let shifted = |by_s: f64| times_s.iter().map(|t| t + by_s).collect::<Vec<f64>>();
    let time_s = |sample: Option<&Sample>| sample.map_or(0.0, |s| s.time_s);
    let log_s = [time_s(log.samples.first()), time_s(log.samples.last())];
    let many_days = |what: &str| {
        let message = format!("the log is longer than a day, and {what} have no date: write both with their dates");
        Failure::input(message).in_file(&log.name).at_column(log.time_column)
    };
    let one_zone = "one file has the zone of its clock and the other has none: taken for the same. If they differ, say by how \
                    much: --load-clock-s";
    Ok(match (readings.clock, log.clock) {
        (Clock::Date { zone_min: Some(own) }, Clock::Date { zone_min: Some(of_log) }) => {
            (shifted(60.0 * f64::from(of_log - own)), None)
        }
        (Clock::Date { zone_min: own }, Clock::Date { zone_min: of_log }) => {
            (shifted(0.0), (own != of_log).then(|| one_zone.to_owned()))
        }
        (Clock::Date { .. }, Clock::Day) => {
            let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
            let last_s = times_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let by_s = days_s(log_s, [first_s, last_s]).ok_or_else(|| many_days("its times"))?;
            (shifted(by_s), None)
        }
        (Clock::Day, Clock::Date { .. } | Clock::Day) => {
            let by_log = |t: &f64| days_s(log_s, [*t, *t]).map(|by_s| t + by_s);
            let by_log = times_s.iter().map(by_log).collect::<Option<_>>();
            (by_log.ok_or_else(|| many_days("the readings"))?, None)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_without_a_date_are_of_the_day_that_the_log_holds() {
        const HOUR_S: f64 = 3600.0;
        let found = |log: [f64; 2], times: [f64; 2]| {
            days_s(log.map(|h| h * HOUR_S), times.map(|h| h * HOUR_S)).map(|s| s / HOUR_S)
        };
        // from 18:00 to 7:00: what was read at 6:30 was read on the second day
        for (hour, shift) in [(19.0, 0.0), (23.9, 0.0), (0.1, 24.0), (6.5, 24.0)] {
            assert_eq!(found([18.0, 31.0], [hour, hour]), Some(shift), "{hour}");
        }
        // a little before, and a little after
        assert_eq!(found([18.0, 31.0], [17.5, 17.5]), Some(0.0));
        assert_eq!(found([18.0, 31.0], [7.5, 7.5]), Some(24.0));
        // dated readings, of which the first was read after midnight, beside a log from 23:00 to 1:30
        let day = 20_000.0 * 24.0;
        assert_eq!(found([23.0, 25.5], [day + 0.5, day + 1.4]), Some(24.0 - day));
        assert_eq!(found([23.0, 25.5], [day + 23.5, day + 25.4]), Some(-day));
        // at two places of a log of 26 h
        assert_eq!(found([8.0, 34.0], [9.0, 9.0]), None);
        assert_eq!(found([8.0, 34.0], [12.0, 12.0]), Some(0.0));
    }
}

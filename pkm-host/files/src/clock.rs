//! Times as loggers, spreadsheets and people write them.

use crate::csv::{Row, Sheet};
use crate::error::{Result, printable};

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;
/// Serial number that spreadsheets give to 1 January 1970.
const SERIAL_OF_1970: f64 = 25_569.0;
/// Serial numbers of dates from 1970 to 2100: numbers without a unit are taken for them.
const SERIALS: std::ops::Range<f64> = SERIAL_OF_1970..73_051.0;

/// What times of a file count from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// 1 January 1970 on the wall clock, whatever its zone.
    Date {
        /// Minutes east of Greenwich, where the zone is written. Beside a file without, the wall clock counts.
        zone_min: Option<i32>,
    },
    /// Midnight.
    Day,
    /// A start that the file does not tell.
    Elapsed,
}

/// A time, and what it counts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time {
    /// Seconds since then.
    pub seconds: f64,
    /// What it counts from.
    pub clock: Clock,
}

/// Days from 1 January 1970 of a day of the Gregorian calendar, after Howard Hinnant's days_from_civil; `None` for a day that does not
/// exist.
fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let longest = match month {
        2 => 28 + i64::from(is_leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return None,
    };
    if !(1900..=2200).contains(&year) || !(1..=longest).contains(&day) {
        return None;
    }
    let from_march = if month > 2 { year } else { year - 1 };
    let (era, year_of_era) = (from_march / 400, from_march % 400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    Some(era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468)
}

fn digits(text: &str) -> Option<i64> {
    (!text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())).then(|| text.parse().ok())?
}

/// `2026-03-14`, `2026/03/14`, `14.03.2026`. With slashes behind a day or a month nobody can tell which is which.
fn date(text: &str) -> Option<i64> {
    let parts = |mark: char| {
        let parts: Vec<&str> = text.split(mark).collect();
        let all: Option<Vec<i64>> = parts.iter().map(|p| digits(p)).collect();
        all.filter(|all| all.len() == 3)
    };
    match (parts('-').or_else(|| parts('/')), parts('.')) {
        (Some(ymd), _) => days(ymd[0], ymd[1], ymd[2]),
        (_, Some(dmy)) => days(dmy[2], dmy[1], dmy[0]),
        _ => None,
    }
}

/// `09:26`, `9:26:53`, `09:26:53,589`, `9:26:53.5 PM`: seconds since midnight.
fn time_of_day(text: &str) -> Option<f64> {
    let lower = text.to_lowercase();
    let (text, half) = match (lower.strip_suffix("am"), lower.strip_suffix("pm")) {
        (Some(rest), _) => (rest.trim_end(), Some(0.0)),
        (_, Some(rest)) => (rest.trim_end(), Some(0.5 * DAY_S)),
        _ => (lower.as_str(), None),
    };
    let parts: Vec<&str> = text.split(':').collect();
    let (hours, minutes, seconds) = match parts[..] {
        [hours, minutes] => (hours, minutes, "0"),
        [hours, minutes, seconds] => (hours, minutes, seconds),
        _ => return None,
    };
    let (whole, fraction) = seconds.split_once(['.', ',']).unwrap_or((seconds, "0"));
    digits(fraction)?;
    let [h, m, s] = [digits(hours)?, digits(minutes)?, digits(whole)?];
    let hours = match half {
        Some(_) if !(1..=12).contains(&h) => return None,
        Some(_) => h % 12,
        None => h,
    };
    if hours > 23 || m > 59 || s > 60 {
        return None;
    }
    let fraction: f64 = format!("0.{fraction}").parse().ok()?;
    Some((hours * 3600 + m * 60 + s) as f64 + fraction + half.unwrap_or(0.0))
}

/// Splits `Z`, `+01:00`, `+0100` or `+01` from a time; minutes east of Greenwich.
fn zone(text: &str) -> Option<(&str, Option<i32>)> {
    if let Some(rest) = text.strip_suffix(['Z', 'z']).or_else(|| text.strip_suffix(" UTC")) {
        return Some((rest.trim_end(), Some(0)));
    }
    let Some(at) = text.rfind(['+', '-', '\u{2212}']) else { return Some((text, None)) };
    let (rest, zone) = text.split_at(at);
    let sign = if zone.starts_with('+') { 1 } else { -1 };
    let figures: String = zone.chars().skip(1).filter(|c| *c != ':').collect();
    let number = i32::try_from(digits(&figures)?).ok()?;
    let minutes = match figures.len() {
        2 => number * 60,
        4 => number / 100 * 60 + number % 100,
        _ => return None,
    };
    Some((rest.trim_end(), Some(sign * minutes)))
}

/// A time of a clock, with a date or without.
pub fn parse(text: &str) -> Option<Time> {
    let text = text.trim();
    if let Some(seconds) = time_of_day(text) {
        return Some(Time { seconds, clock: Clock::Day });
    }
    let (day, rest) = text.split_once(['T', ' ']).unwrap_or((text, "00:00"));
    let (rest, zone_min) = zone(rest.trim_start())?;
    let seconds = date(day.trim_end_matches(','))? as f64 * DAY_S + time_of_day(rest)?;
    Some(Time { seconds, clock: Clock::Date { zone_min } })
}

/// Whether a time is written to the minute alone.
fn is_coarse(text: &str) -> bool {
    text.matches(':').count() == 1 && !text.contains(['+', '\u{2212}'])
}

/// Columns that say when a row was written.
pub const TIME_COLUMNS: [&str; 3] = ["time_s", "time", "date"];

/// The times of all rows.
pub struct Times {
    /// What they count from.
    pub clock: Clock,
    /// Of each row.
    pub seconds: Vec<f64>,
    /// The column that they stand in, for messages.
    pub column: &'static str,
    /// Whether all of them are written to the minute alone.
    pub to_the_minute: bool,
    /// What they were taken for, for the user.
    pub conversion: Option<&'static str>,
}

/// The times of a sheet with a column `time` or `time_s`; `None` without one.
///
/// # Errors
/// The first cell that is no time; another form than above.
pub fn times(sheet: &Sheet) -> Result<Option<Times>> {
    if sheet.has("time") || (sheet.has("date") && !sheet.has("time_s")) {
        return of_clock(sheet).map(Some);
    }
    if !sheet.has("time_s") {
        return Ok(None);
    }
    let seconds = sheet.rows.iter().map(|row| sheet.number(row, "time_s")).collect::<Result<Vec<f64>>>()?;
    Ok(Some(Times { clock: Clock::Elapsed, seconds, column: "time_s", to_the_minute: false, conversion: None }))
}

/// A cell with its date, if that has a column of its own.
fn cell(sheet: &Sheet, row: &Row) -> Result<String> {
    let time = if sheet.has("time") { sheet.cell(row, "time")? } else { "" };
    let date = if sheet.has("date") { sheet.cell(row, "date")? } else { "" };
    Ok(format!("{date} {time}").trim().to_owned())
}

fn of_clock(sheet: &Sheet) -> Result<Times> {
    let column = if sheet.has("time") { "time" } else { "date" };
    let cells = sheet.rows.iter().map(|row| cell(sheet, row)).collect::<Result<Vec<String>>>()?;
    let number = |text: &String| text.replace(',', ".").parse::<f64>().ok();
    if let Some(numbers) = cells.iter().map(number).collect::<Option<Vec<f64>>>() {
        return of_spreadsheet(sheet, numbers);
    }
    let mut first: Option<Clock> = None;
    let mut seconds = Vec::with_capacity(cells.len());
    for (row, text) in sheet.rows.iter().zip(&cells) {
        let expected = "expected a time such as 2026-03-14 09:26:53.5, 14.03.2026 09:26:53,5 or 09:26:53.5";
        let Some(time) = parse(text) else {
            let found = if text.is_empty() { "an empty cell".into() } else { format!("`{}`", printable(text)) };
            let slashes = if text.contains('/') { ": day or month first? Write the year first" } else { "" };
            return Err(sheet.failure(row, format!("{expected}, found {found}{slashes}")).at_column(column));
        };
        if *first.get_or_insert(time.clock) != time.clock {
            let message = format!("expected a time in the form of the rows above, found `{}`", printable(text));
            return Err(sheet.failure(row, message).at_column(column));
        }
        seconds.push(time.seconds);
    }
    let to_the_minute = cells.iter().all(|text| is_coarse(text));
    Ok(Times { clock: first.unwrap_or(Clock::Elapsed), seconds, column, to_the_minute, conversion: None })
}

/// Numbers without a unit: as spreadsheets keep dates and times.
fn of_spreadsheet(sheet: &Sheet, numbers: Vec<f64>) -> Result<Times> {
    let all_in = |range: std::ops::Range<f64>| numbers.iter().all(|v| range.contains(v));
    // rounded to the millisecond: a serial number has no more
    let seconds = |of: &dyn Fn(f64) -> f64| numbers.iter().map(|v| (of(*v) * DAY_S * 1e3).round() / 1e3).collect();
    let (clock, seconds, conversion) = if all_in(SERIALS) {
        let seconds = seconds(&|v| v - SERIAL_OF_1970);
        (Clock::Date { zone_min: None }, seconds, "times are serial numbers of a spreadsheet: days since 1900")
    } else if all_in(0.0..1.0) {
        (Clock::Day, seconds(&|v| v), "times are numbers of a spreadsheet: shares of a day")
    } else {
        let message = "no unit: write `time [s]` where it counts seconds";
        let failure = crate::error::Failure::input(message).in_file(&sheet.source.name);
        return Err(failure.at_line(sheet.header_line()).at_column("time"));
    };
    Ok(Times { clock, seconds, column: "time", to_the_minute: false, conversion: Some(conversion) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_they_are_written() {
        // by Python's datetime: 2026-03-14 09:26:53.589 is 1 773 480 413.589 s after 1970
        let at = 1_773_480_413.589;
        let date = |zone_min| Clock::Date { zone_min };
        for (text, seconds, clock) in [
            ("2026-03-14T09:26:53.589", at, date(None)),
            ("2026-03-14 09:26:53,589", at, date(None)),
            ("2026/03/14 09:26:53.589", at, date(None)),
            ("14.03.2026 09:26:53,589", at, date(None)),
            ("14.3.2026, 9:26:53,589", at, date(None)),
            ("2026-03-14T09:26:53.589Z", at, date(Some(0))),
            ("2026-03-14T09:26:53.589+01:00", at, date(Some(60))),
            ("2026-03-14T09:26:53.589-0530", at, date(Some(-330))),
            ("2026-03-14 09:26:53.589 PM", at + 43_200.0, date(None)),
            ("2024-02-29", 1_709_164_800.0, date(None)),
            ("09:26:53,589", 34_013.589, Clock::Day),
            ("9:26", 33_960.0, Clock::Day),
            ("12:00 am", 0.0, Clock::Day),
            ("12:30:00 PM", 45_000.0, Clock::Day),
        ] {
            let time = parse(text).unwrap_or_else(|| panic!("{text}"));
            assert!((time.seconds - seconds).abs() < 1e-6, "{text}: {}", time.seconds);
            assert_eq!(time.clock, clock, "{text}");
        }
        for text in [
            "",
            "3/4/2026 9:00",
            "2026-02-29",
            "2026-13-01",
            "25:00",
            "9:60",
            "13:00 PM",
            "9:26:53.",
            "2026-03-14T09:26:53+1",
            "500",
            "noon",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}

//! Arguments that several commands take, and how numbers are read.

use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::files::import::Renames;
use crate::page::dated;
use crate::plan::model::Form;

/// Columns of measured data that are called otherwise.
#[derive(clap::Args)]
pub(crate) struct ColumnsArgs {
    /// Names of columns that the program does not know, as new=theirs,… (`dx_um=Weg X,fx_n=Kraft 1`); a unit in their name or in
    /// a row of units is converted.
    #[arg(long, value_name = "NEW=THEIRS,…", requires = "data")]
    columns: Option<Renames>,
}

impl ColumnsArgs {
    /// None, if none was given.
    pub(crate) fn renames(&self) -> Renames {
        self.columns.clone().unwrap_or_default()
    }
}

/// When a report was made.
#[derive(clap::Args)]
pub(crate) struct DateArgs {
    /// Write date and time (UTC) into the report; without it the same input makes the same bytes.
    #[arg(long)]
    date: bool,
}

impl DateArgs {
    /// The page, with date and time if they are asked for.
    pub(crate) fn of(&self, html: String) -> String {
        if !self.date {
            return html;
        }
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        dated(&html, &utc(since.as_secs()))
    }
}

/// Seconds since 1970 as date and time, after Howard Hinnant's days_from_civil.
fn utc(seconds: u64) -> String {
    // days since 1 March of year 0: February with its leap day is the last month
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    let year = 400 * era + year_of_era + next;
    let (hour, minute) = (seconds / 3600 % 24, seconds / 60 % 60);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

/// A table and its form.
#[derive(clap::Args)]
pub(crate) struct TableArgs {
    /// coefficients.json of `fit`; without it the basic model.
    #[arg(long, value_name = "JSON")]
    pub(crate) table: Option<PathBuf>,
    /// How the table is applied.
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) form: Form,
}

pub(crate) fn positive(text: &str) -> Result<f64, String> {
    finite(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("expected a number above 0".into()) })
}

pub(crate) fn within(least: f64, most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = finite(text).ok().filter(|v| (least..=most).contains(v));
        number.ok_or_else(|| format!("expected a number from {least} to {most}"))
    }
}

pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err("expected a finite number".into()),
    }
}

/// Numbers with commas between.
pub(crate) fn list<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values = text.split(',').map(|t| finite(t.trim())).collect::<Result<Vec<_>, _>>()?;
    values.try_into().map_err(|v: Vec<f64>| format!("expected {N} numbers with commas between, found {}", v.len()))
}

#[cfg(test)]
mod tests {
    use super::utc;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // from `date -u -d @…`
        assert_eq!(utc(0), "1970-01-01 00:00 UTC");
        assert_eq!(utc(951_782_399), "2000-02-28 23:59 UTC");
        assert_eq!(utc(951_868_800), "2000-03-01 00:00 UTC");
        assert_eq!(utc(4_107_542_340), "2100-02-28 23:59 UTC");
        assert_eq!(utc(1_798_761_599), "2026-12-31 23:59 UTC");
    }
}

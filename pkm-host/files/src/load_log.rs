//! A load cell's log: loads over time, as amplifiers and loggers write them.

use crate::clock::{self, Clock, DAY_S, Time, Times};
use crate::csv::{Sheet, UNGROUPED, is_grouped};
use crate::dataset::WRENCH_COLUMNS;
use crate::error::{Failure, Result, printable};
use crate::import::{self, Imported, Renames};
use crate::source::Source;

/// Counts samples.
const SAMPLE_COLUMN: &str = "sample";
/// The load of a cell that measures along one axis, and its place among the components of a sample.
const AXIAL_COLUMNS: [(&str, usize); 2] = [("force_n", 0), ("moment_nm", 3)];

/// What the cell measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    /// A force along its axis: first component of a sample.
    Force,
    /// A moment about its axis: fourth component of a sample.
    Moment,
    /// Components in A-uvw; those without a column are 0.
    Components([bool; 6]),
}

impl Cell {
    /// Columns of the log that hold its loads, with their places in a sample.
    pub fn columns(self) -> Vec<(&'static str, usize)> {
        match self {
            Self::Force => vec![AXIAL_COLUMNS[0]],
            Self::Moment => vec![AXIAL_COLUMNS[1]],
            Self::Components(has) => {
                WRENCH_COLUMNS.into_iter().zip(0..).filter(|(_, component)| has[*component]).collect()
            }
        }
    }
}

/// A row of a log.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Line of the file, from 1.
    pub line: u64,
    /// By the log's clock.
    pub time_s: f64,
    /// N and N·m, as [`Cell`] has it.
    pub load: [f64; 6],
}

/// A log.
pub struct LoadLog {
    /// File, as the user named it.
    pub name: String,
    /// What it measured.
    pub cell: Cell,
    /// What its times count from.
    pub clock: Clock,
    /// The column that they stand in.
    pub time_column: &'static str,
    /// In order of time, at least one.
    pub samples: Vec<Sample>,
    /// What is doubtful in the file.
    pub warnings: Vec<String>,
    /// What was converted, for the user.
    pub conversions: Vec<String>,
}

impl LoadLog {
    /// Reads a log as it was exported. `start`: when a log began whose times count from there.
    ///
    /// # Errors
    /// No times, no loads, times that go back, a cell that is no number, and what no export may have.
    pub fn parse(source: Source, renames: &Renames, start: Option<Time>) -> Result<Self> {
        let (Imported { mut sheet, mut conversions, failures, .. }, above) = import::read_load_log(source, renames)?;
        if let Some(failure) = failures.into_iter().next() {
            return Err(failure);
        }
        let cell = cell(&sheet)?;
        let mut warnings = std::mem::take(&mut sheet.warnings);
        warnings.extend(drop_empty(&mut sheet, cell)?);
        let Times { mut clock, seconds, column, conversion, .. } = match clock::times(&sheet)? {
            Some(times) => times,
            None => counted(&sheet, &above, &mut conversions)?,
        };
        conversions.extend(conversion.map(str::to_owned));
        let began = start.or_else(|| (clock == Clock::Elapsed).then(|| began(&above, &mut conversions))?);
        let mut offset_s = 0.0;
        match began {
            Some(_) if clock != Clock::Elapsed => {
                let message =
                    "--load-start is for a log whose times count from its start: this one has times of a clock";
                return Err(Failure::usage(message));
            }
            Some(began) => (clock, offset_s) = (began.clock, began.seconds),
            None => {}
        }
        let mut samples: Vec<Sample> = Vec::with_capacity(sheet.rows.len());
        for (row, seconds) in sheet.rows.iter().zip(seconds) {
            let mut time_s = seconds + offset_s;
            if let Some(before) = samples.last().map(|s| s.time_s) {
                if clock == Clock::Day && before - time_s > 0.5 * DAY_S {
                    time_s += DAY_S * ((before - time_s) / DAY_S).round();
                }
                if time_s < before {
                    let message = format!(
                        "the time goes back by {:.3} s: is it the log of one run, in order of time?",
                        before - time_s
                    );
                    return Err(sheet.failure(row, message).at_column(column));
                }
            }
            let mut load = [0.0; 6];
            for (name, component) in cell.columns() {
                load[component] = sheet.number(row, name)?;
            }
            samples.push(Sample { line: row.line, time_s, load });
        }
        let name = sheet.source.name;
        Ok(Self { name, cell, clock, time_column: column, samples, warnings, conversions })
    }
}

/// What a log measured, by its columns.
fn cell(sheet: &Sheet) -> Result<Cell> {
    let has = WRENCH_COLUMNS.map(|c| sheet.has(c));
    let [force, moment] = AXIAL_COLUMNS.map(|(c, _)| sheet.has(c));
    match (has.contains(&true), force, moment) {
        (true, false, false) => Ok(Cell::Components(has)),
        (false, true, false) => Ok(Cell::Force),
        (false, false, true) => Ok(Cell::Moment),
        (false, false, false) => {
            let why = ": a log needs `force [N]` or `moment [N·m]` of a cell along one axis, or components such as `Fx [N]` in A-uvw; \
                       for other names say --columns force_n=theirs";
            Err(sheet.missing(AXIAL_COLUMNS[0].0, why))
        }
        _ => {
            let message = "force, moment and components beside each other: leave those of one cell";
            Err(Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line()))
        }
    }
}

/// Takes out the rows in which a channel has nothing, and says so.
fn drop_empty(sheet: &mut Sheet, cell: Cell) -> Result<Option<String>> {
    let mut lines = Vec::new();
    let mut rows = Vec::new();
    for row in std::mem::take(&mut sheet.rows) {
        let mut is_empty = false;
        for (name, _) in cell.columns() {
            is_empty |= sheet.cell(&row, name)?.is_empty();
        }
        if is_empty { lines.push(row.line) } else { rows.push(row) }
    }
    sheet.rows = rows;
    if sheet.rows.is_empty() {
        let message = "expected loads, found blank columns only";
        return Err(Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line()));
    }
    let file = printable(&sheet.source.name);
    Ok(lines.first().map(|first| {
        let what = if lines.len() == 1 {
            "a sample without a load is".into()
        } else {
            format!("{} samples without a load are", lines.len())
        };
        format!("{file}:{first}: {what} left out")
    }))
}

/// The number at the beginning of a text, and what follows it; its text where the mark in it may be one of thousands.
fn leading_number(text: &str) -> Option<(std::result::Result<f64, &str>, &str)> {
    let text = text.trim_start_matches([':', ';', ',', '=', '\t', ' ', '"']);
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.' && c != ',').unwrap_or(text.len());
    // a separator of cells, not a decimal comma
    let (number, rest) = (text[..end].trim_end_matches([',', '.']), &text[end..]);
    let value: f64 = number.replace(',', ".").parse().ok()?;
    let value = if is_grouped(number, &[',', '.']) { Err(number) } else { Ok(value) };
    Some((value, rest.trim_start_matches([';', ',', '\t', ' ', '"'])))
}

/// The time between two samples by the lines above a header, and the number of the line that says so: `Sample rate: 50 Hz`. A number that
/// may be read in two ways as it stands.
fn interval_s(above: &[String]) -> Option<(u64, std::result::Result<f64, String>)> {
    const RATES: [&str; 3] = ["rate", "frequen", "samples per second"];
    const INTERVALS: [&str; 4] = ["interval", "period", "sample time", "delta t"];
    (1..).zip(above).find_map(|(line, text)| {
        let lower = text.to_lowercase();
        // a filter has a frequency, too
        if ["filter", "cutoff", "cut-off", "grenz"].iter().any(|word| lower.contains(word)) {
            return None;
        }
        let behind = |names: &[&str]| {
            let (at, name) = names.iter().find_map(|n| Some((lower.find(n)?, n)))?;
            let rest = &lower[at + name.len()..];
            leading_number(&rest[rest.find(|c: char| c.is_ascii_digit())?..])
        };
        let is_unit = |rest: &str, units: &[&str]| {
            let word = rest.split([';', ',', '\t', ' ', '"', ')', ']']).next().unwrap_or("");
            let in_brackets = |u: &&str| lower.contains(&format!("[{u}]")) || lower.contains(&format!("({u})"));
            units.contains(&word) || (word.is_empty() && units.iter().any(in_brackets))
        };
        let in_seconds = |names: &[&str], units: [(&[&str], f64); 2], of: fn(f64) -> f64| {
            let (value, rest) = behind(names)?;
            let (_, scale) = units.into_iter().find(|(units, _)| is_unit(rest, units))?;
            Some(value.map(|value| of(value) * scale).map_err(str::to_owned))
        };
        let of_interval = in_seconds(&INTERVALS, [(&["s", "sec"], 1.0), (&["ms", "msec"], 1e-3)], |value| value);
        let hertz: &[&str] = &["hz", "1/s", "s/s", "sps", "samples/s", "werte/s"];
        let of_rate = in_seconds(&RATES, [(hertz, 1.0), (&["khz", "ks/s"], 1e-3)], f64::recip);
        let found = of_interval.or(of_rate)?;
        found.as_ref().map_or(true, |s| *s > 0.0 && s.is_finite()).then_some((line, found))
    })
}

/// Times of a log that counts its samples.
fn counted(sheet: &Sheet, above: &[String], conversions: &mut Vec<String>) -> Result<Times> {
    if !sheet.has(SAMPLE_COLUMN) {
        let why = ": a log needs the time of each sample, `time [s]` or a clock's, or `sample` with the rate in a line above the header";
        return Err(sheet.missing("time_s", why));
    }
    let Some((line, interval_s)) = interval_s(above) else {
        let message = "samples are counted, and no line above the header says how many a second: write one, such as \
                       `Sample rate: 50 Hz`";
        let failure = Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line());
        return Err(failure.at_column(SAMPLE_COLUMN));
    };
    let interval_s = interval_s.map_err(|number| {
        let message = format!("`{}`: point or thousands? Write it {UNGROUPED}", printable(&number));
        Failure::input(message).in_file(&sheet.source.name).at_line(line)
    })?;
    conversions.push(format!("samples are {} ms apart, by line {line}", crate::pose::tidy(interval_s * 1e3)));
    let counts = sheet.rows.iter().map(|row| sheet.number(row, SAMPLE_COLUMN)).collect::<Result<Vec<f64>>>()?;
    let first = counts.first().copied().unwrap_or(0.0);
    let seconds = counts.iter().map(|n| (n - first) * interval_s).collect();
    Ok(Times { clock: Clock::Elapsed, seconds, column: SAMPLE_COLUMN, to_the_minute: false, conversion: None })
}

/// When a log began, by the lines above its header: `Start;14.03.2026 09:26:53`, or date and time in lines of their own.
fn began(above: &[String], conversions: &mut Vec<String>) -> Option<Time> {
    let (mut day, mut time) = (None, None);
    for (line, text) in (1..).zip(above) {
        let lower = text.to_lowercase();
        if !["start", "begin"].iter().any(|key| lower.contains(key)) {
            continue;
        }
        let Some(first) = text.find(|c: char| c.is_ascii_digit()) else { continue };
        let value: String = text[first..].trim_end_matches(['"', ';', ',', '\t', ' ']).replace([';', '\t'], " ");
        match clock::parse(&value) {
            Some(Time { seconds, clock: Clock::Day }) => time = Some((line, seconds)),
            Some(found @ Time { .. }) if value.contains(':') => {
                conversions.push(format!("the log began at `{}`, by line {line}", printable(&value)));
                return Some(found);
            }
            Some(found) => day = Some(found.seconds),
            None => {}
        }
    }
    let (line, seconds) = time?;
    conversions.push(format!("the log began at the time in line {line}"));
    Some(match day {
        Some(day) => Time { seconds: day + seconds, clock: Clock::Date { zone_min: None } },
        None => Time { seconds, clock: Clock::Day },
    })
}

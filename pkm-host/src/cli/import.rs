//! `import`: measured data as they were exported → the file of docs/formats.md.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::session::{Output, Session, counted};
use crate::error::{Failure, Result, printable};
use crate::files::clock::{self, TIME_COLUMNS, Time};
use crate::files::csv::Sheet;
use crate::files::import::{self, Renames};
use crate::files::load_log::LoadLog;
use crate::files::log::TIME_COLUMN;
use crate::files::machine::MachineFile;
use crate::files::measured::{self, LoadCase, Measured};
use crate::files::points::PointList;
use crate::files::readings::Readings;
use crate::files::reflectors::Reflectors;
use crate::files::source::{self, Source};
use crate::loads::{self, Joined};
use crate::tracker::{self, Campaign};

/// Measured data as a laboratory or a shop exports them, written as the CSV of docs/formats.md.
///
/// Read as they are: commas, semicolons or tabs; decimal points or commas; UTF-8, UTF-16, Windows-1252; titles above the header; names
/// in any case with units in brackets or in a row below; merged cells; - and n/a for what was not measured. Prints what was converted.
/// What is ambiguous is refused, with its line and column.
///
/// A load cell's log (--loads) is joined to the readings by their times: the load of a reading is the mean of the log around its time,
/// less the cell's zero, and its scatter goes along.
///
/// A tracker's points (--points, --reflectors, --readings) become the deflection of A, with the covariance of its components.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The exported file: text of a spreadsheet, a tracker, a load cell.
    #[arg(long, value_name = "FILE", required_unless_present = "points")]
    data: Option<PathBuf>,
    /// A load cell's log over time, to take the loads of the readings from, which have a time each: `force [N]` (or kN, lbf, kgf) or
    /// `moment [N·m]` of one axis, in the direction that the readings say, or components in A-uvw.
    #[arg(long, value_name = "FILE", requires = "data")]
    loads: Option<PathBuf>,
    /// From when to when around the time of a reading its load is the mean of the log, s.
    #[arg(long, value_name = "FROM,TO", requires = "loads", default_value = "-1,1", value_parser = range, allow_hyphen_values = true)]
    load_window_s: [f64; 2],
    /// What is added to the log's times to have those of the readings, s.
    #[arg(long, value_name = "S", requires = "loads", default_value_t = 0.0, value_parser = seconds, allow_hyphen_values = true)]
    load_clock_s: f64,
    /// When a log that counts seconds from its start began, by the clock of the readings: 2026-03-14T09:26:53 or 09:26:53.
    #[arg(long, value_name = "TIME", requires = "loads", value_parser = start)]
    load_start: Option<Time>,
    /// From when to when nothing pulls at the cell, seconds from the log's first sample; else in the windows of the readings without load.
    #[arg(long, value_name = "FROM,TO", requires = "loads", value_parser = range, allow_hyphen_values = true)]
    load_zero_s: Option<[f64; 2]>,
    /// A tracker's list of points, unloaded and loaded, in its own frame: reading, state, point, x, y, z and U95.
    #[arg(long, value_name = "CSV", conflicts_with = "data", requires = "reflectors", requires = "readings")]
    points: Option<PathBuf>,
    /// Its reflectors on platform and base (TOML).
    #[arg(long, value_name = "TOML", requires = "points")]
    reflectors: Option<PathBuf>,
    /// Pose and load of each reading, without deflections.
    #[arg(long, value_name = "FILE", requires = "points")]
    readings: Option<PathBuf>,
    /// Names of columns that the program does not know, as new=theirs,… (`dx_um=Weg X,fx_n=Kraft 1`; of points `reading=Group`); a unit in
    /// their name or in a row of units is converted.
    #[arg(long, value_name = "NEW=THEIRS,…")]
    columns: Option<Renames>,
    /// CSV to write.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    text.trim().parse().ok().filter(|s: &f64| s.is_finite()).ok_or_else(|| "expected seconds, such as -2.5".to_owned())
}

fn range(text: &str) -> std::result::Result<[f64; 2], String> {
    let expected = || "expected seconds from,to in this order, such as -2,0".to_owned();
    let (from, to) = text.split_once(',').ok_or_else(expected)?;
    let [from, to] = [seconds(from)?, seconds(to)?];
    if from <= to { Ok([from, to]) } else { Err(expected()) }
}

fn start(text: &str) -> std::result::Result<Time, String> {
    clock::parse(text).ok_or_else(|| "expected a time such as 2026-03-14T09:26:53 or 09:26:53".to_owned())
}

/// What is written and said.
struct Imported {
    csv: String,
    conversions: Vec<String>,
    /// What a tracker's points or a load cell's log say, for people.
    text: String,
    readings: Readings,
    /// The same for programs, under its key.
    more: Option<(&'static str, Value)>,
}

/// Measured data in which nothing is wrong, or the first of what is.
fn complete(read: Measured, session: &Session) -> Result<(Sheet, Vec<LoadCase>)> {
    let more = read.failures.len().saturating_sub(1);
    read.complete().map_err(|mut failure| {
        if more > 0 {
            failure.message.push_str(&format!(" (and {more} more: `pkm-host check` lists them)"));
        }
        session.or_of_another_machine(failure)
    })
}

/// Says of readings in which nothing was measured what they are good for.
fn warn_of_no_deflections(readings: &Readings, sheet: &Sheet, session: &mut Session) {
    let why = readings.require_deflections(sheet).err();
    session.warn(why.map(|failure| {
        format!(
            "{failure}. Poses and loads alone are no readings: `diagnose` refuses what is written, and `predict` fills in what \
             the model says"
        )
    }));
}

/// Says of a controller's log that what is written is none.
fn warn_of_a_log(sheet: &Sheet, session: &mut Session) {
    let (file, line) = (printable(&sheet.source.name), sheet.header_line());
    session.warn(sheet.has(TIME_COLUMN).then(|| {
        format!(
            "{file}:{line}: {TIME_COLUMN}: not written, as measured data have no times: `replay`, which needs them, takes this file as it is"
        )
    }));
}

/// What is said of times that have found their loads.
fn times_left_out(sheet: &Sheet) -> String {
    let times: Vec<&str> = TIME_COLUMNS.into_iter().filter(|c| sheet.has(c)).collect();
    format!("not written: {}, as measured data have no times", times.join(", "))
}

/// From points to deflections.
fn of_points(
    [points, reflectors, readings]: [&Path; 3],
    renames: &Renames,
    machine: &MachineFile,
    out: &Path,
    session: &mut Session,
) -> Result<Imported> {
    let [of_readings, of_points] = renames.of_readings_and_points();
    let reflectors = Reflectors::parse(Source::read(reflectors)?)?;
    let points = PointList::parse(Source::read(points)?, &reflectors, &of_points)?;
    let source = Source::read(readings)?;
    let file = source.name.clone();
    let read = Measured::read(source, machine, &of_readings)?;
    let conversions = [&points.conversions[..], &read.conversions].concat();
    let (sheet, cases) = complete(read, session)?;
    session.warn(sheet.warnings.clone());
    let tasks = tracker::tasks(&sheet, &cases)?;
    let campaign = tracker::deflections(&tasks, &reflectors, &points, &file)?;
    session.warn(campaign.warnings.clone());
    let csv = tracker::with_deflections(&sheet, &campaign.deflections)?;
    // what is written is what the other commands read
    let written = Source::from_text(&out.display().to_string(), csv.clone());
    let (_, readings) = Readings::read_conditions(written, machine, &Renames::default())?;
    Ok(Imported { csv, conversions, text: text(&campaign), readings, more: Some(("tracker", document(&campaign))) })
}

/// Readings with the loads of a log.
fn of_log(data: &Path, log: &Path, args: &Args, machine: &MachineFile, session: &mut Session) -> Result<Imported> {
    let [of_readings, of_log] = args.columns.clone().unwrap_or_default().of_readings_and_log();
    let log = LoadLog::parse(Source::read(log)?, &of_log, args.load_start)?;
    session.warn(log.warnings.clone());
    let mut read = import::read_timed(Source::read(data)?, &of_readings)?;
    let options = loads::Options { window_s: args.load_window_s, clock_s: args.load_clock_s, zero_s: args.load_zero_s };
    let joined = loads::join(&mut read.sheet, &log, &options)?;
    let mut conversions = [&log.conversions[..], &read.conversions].concat();
    conversions.push(times_left_out(&read.sheet));
    let (sheet, cases) = complete(Measured::of(read, machine), session)?;
    session.warn(sheet.warnings.clone());
    session.warn(joined.warnings.clone());
    let readings = Readings::new(&sheet, &cases, machine.uncertainty.load_random)?;
    warn_of_no_deflections(&readings, &sheet, session);
    let (text, more) = (text_of_loads(&joined, &log), document_of_loads(&joined, &log, &options));
    Ok(Imported { csv: measured::to_csv(&sheet), conversions, text, readings, more: Some(("load_log", more)) })
}

/// Where loads come from, for people.
fn text_of_loads(joined: &Joined, log: &LoadLog) -> String {
    let [fewest, most] = joined.samples;
    let [median, greatest] = joined.random.map(|share| 100.0 * share);
    let lasts_s = log.samples.last().zip(log.samples.first()).map_or(0.0, |(last, first)| last.time_s - first.time_s);
    let units = |component: usize| if component < 3 { "N" } else { "N·m" };
    let zero: Vec<String> =
        log.cell.columns().iter().map(|(_, c)| format!("{:.3} {}", joined.zero[*c], units(*c))).collect();
    let zero = match joined.zeros {
        0 => "no zero taken off".to_owned(),
        1 => format!("zero {}, of one stretch without load", zero.join(", ")),
        n => {
            format!("zero {} in the mean of {n} stretches without load, each reading with the nearest", zero.join(", "))
        }
    };
    format!(
        "- loads from {} samples over {lasts_s:.1} s, {fewest} to {most} a reading; {zero}\n\
         - scatter of the loads {median:.2} % (median), {greatest:.2} % at most: column load_random\n",
        log.samples.len()
    )
}

/// The same for programs.
fn document_of_loads(joined: &Joined, log: &LoadLog, options: &loads::Options) -> Value {
    json!({
        "samples": log.samples.len(),
        "window_s": options.window_s,
        "clock_s": options.clock_s,
        "samples_per_reading": joined.samples,
        "zeros": joined.zeros,
        "zero": joined.zero,
        "load_random_median": joined.random[0],
        "load_random_max": joined.random[1],
    })
}

/// What a campaign says, for people.
fn text(campaign: &Campaign) -> String {
    let r = &campaign.registration;
    let [origin_m, rotation_rad] = r.deviations();
    let mut text = format!(
        "- registration from {} unloaded points: {:.1} µm rms are left; 1 sd {:.1} µm, {:.1} µrad\n",
        r.points,
        r.rms_m * 1e6,
        origin_m * 1e6,
        rotation_rad * 1e6
    );
    for (name, at_m) in &campaign.located {
        let [u, v, w] = at_m.map(|m| m * 1e3);
        text.push_str(&format!("- reflector {name} found at u, v, w = {u:.3}, {v:.3}, {w:.3} mm\n"));
    }
    if let Some(misfit) = campaign.misfit {
        text.push_str(&format!("- reflectors leave a rigid platform by {:.2} of their uncertainty\n", misfit.sqrt()));
    }
    let by_size = |a: &&tracker::BaseMotion, b: &&tracker::BaseMotion| a.translation_m.total_cmp(&b.translation_m);
    if let Some(most) = campaign.base.iter().max_by(by_size) {
        text.push_str(&format!(
            "- the base moved by up to {:.1} µm and {:.1} µrad (reading {}): taken out\n",
            most.translation_m * 1e6,
            most.rotation_rad * 1e6,
            most.reading
        ));
    }
    text
}

/// The same for programs.
fn document(campaign: &Campaign) -> Value {
    let r = &campaign.registration;
    let (rotation, origin_m) = r.transformation();
    let micro = |i: usize| (0..6).map(|j| r.covariance[(i, j)] * 1e12).collect::<Vec<f64>>();
    let base = campaign.base.iter().map(|b| {
        json!({ "reading": b.reading, "translation_um": b.translation_m * 1e6, "rotation_urad": b.rotation_rad * 1e6 })
    });
    let located = campaign.located.iter().map(|(name, m)| json!({ "name": name, "uvw_mm": m.map(|m| m * 1e3) }));
    json!({
        "registration": {
            "rotation": rotation,
            "origin_mm": origin_m.map(|m| m * 1e3),
            "covariance_um_urad": (0..6).map(micro).collect::<Vec<_>>(),
            "points": r.points,
            "rms_um": r.rms_m * 1e6,
            "chi2_per_dof": r.chi2_per_dof,
        },
        "located_reflectors": located.collect::<Vec<_>>(),
        "rigid_misfit_chi2_per_dof": campaign.misfit,
        "base_motion": base.collect::<Vec<_>>(),
    })
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let Args { data, loads, points, reflectors, readings, out, .. } = args;
    let machine = session.machine()?;
    let renames = args.columns.clone().unwrap_or_default();
    let imported = match (data, loads, points, reflectors, readings) {
        (Some(data), Some(log), ..) => of_log(data, log, args, &machine, session)?,
        (Some(data), ..) => {
            let read = Measured::read(Source::read(data)?, &machine, &renames)?;
            let conversions = read.conversions.clone();
            let (sheet, cases) = complete(read, session)?;
            session.warn(sheet.warnings.clone());
            warn_of_a_log(&sheet, session);
            let readings = Readings::new(&sheet, &cases, machine.uncertainty.load_random)?;
            warn_of_no_deflections(&readings, &sheet, session);
            Imported { csv: measured::to_csv(&sheet), conversions, text: String::new(), readings, more: None }
        }
        (None, _, Some(points), Some(reflectors), Some(readings)) => {
            of_points([points, reflectors, readings], &renames, &machine, out, session)?
        }
        _ => return Err(Failure::usage("--points needs --reflectors and --readings")),
    };
    let Imported { csv, conversions, text: of_more, readings: read, more } = imported;
    let files = [data, loads, points, reflectors, readings].map(Option::as_deref);
    let inputs = [&[session.machine_path()][..], &files].concat();
    source::write(out, csv, &inputs)?;
    let (rows, poses) = (read.readings.len(), read.poses.len());
    let (readings, at) = (counted(rows, "reading"), counted(poses, "pose"));
    let mut text: String = conversions.iter().map(|what| format!("- {what}\n")).collect();
    text.push_str(&of_more);
    text.push_str(&format!("wrote {readings} at {at} to {}\n", out.display()));
    let mut document =
        json!({ "readings": rows, "poses": poses, "conversions": conversions, "out": out.display().to_string() });
    if let Some((key, more)) = more {
        document[key] = more;
    }
    session.output(text, &document)
}

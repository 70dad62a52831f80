//! `replay`: a controller's log through its estimator.

use std::path::PathBuf;

use super::arguments::{ColumnsArgs, DateArgs, TableArgs};
use super::bar::bar;
use super::session::{Output, Session};
use crate::diagnose::quality;
use crate::error::{Failure, Result};
use crate::files::learn::Learn;
use crate::files::log;
use crate::files::measured;
use crate::files::source::{self, Source};
use crate::page::of_file;
use crate::plan::model::{Form, no_factor_form};
use crate::replay::{self, Ask};
use crate::report::replay as report;

/// What a controller would have learned from a log of readings under known loads: the same estimator, the same bits.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// CSV with time_s, poses, loads and deflections, as for diagnose.
    #[arg(id = "data", long = "log", value_name = "CSV")]
    log: PathBuf,
    #[command(flatten)]
    columns: ColumnsArgs,
    /// What is learned; without it the drives of the three limbs.
    #[arg(long, value_name = "TOML")]
    learn: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
    /// Proposes up to so many poses and loads to probe next, one after the other those that tell most of what is still unknown, in
    /// next.csv: a log with cells for times and readings. The loads are as great as the log's greatest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=50), allow_hyphen_values = true)]
    next: Option<u16>,
    /// Diagnoses the last readings that were taken in beside it, up to 200 since the last change that came at once: what it is that has
    /// changed. They are written to readings.csv, for a diagnose of its own.
    #[arg(long)]
    diagnose: bool,
    #[command(flatten)]
    date: DateArgs,
    /// Folder for replay.json, report.html, steps.csv (what was known after each reading), next.csv and readings.csv.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let model = session.model(&args.table)?;
    let applied = match (&model.table, model.applied()?) {
        (_, None) => None,
        (Some(table), Some((_, Form::Diagonal))) => return Err(no_factor_form(&table.source, "or leave it out")),
        (_, Some((table, _))) => Some(table),
    };
    let source = Source::read(&args.log)?;
    let mut facts = vec![("Machine", of_file(&model.machine.source)), ("Log", of_file(&source))];
    let (name, learn) = match &args.learn {
        Some(path) => {
            let file = Source::read(path)?;
            facts.push(("Learned", of_file(&file)));
            (file.name.clone(), Learn::parse(&file)?)
        }
        None => {
            let drives = Learn::drives(&model.machine.machine, &model.machine.pose_box.middle_pose());
            let failed = |e| Failure::input(format!("no compliance of the drives in the middle of the box: {e}"));
            (model.machine.source.name.clone(), drives.map_err(|e| failed(e).in_file(&model.machine.source.name))?)
        }
    };
    let log = log::read(source, &model.machine, &args.columns.renames())?;
    session.warn(log.warnings.iter().cloned());
    let (sheet, readings) = log.as_measured(model.machine.uncertainty.load_random)?;
    session.warn(quality::check_units(&model.machine, sheet, &readings).iter().map(|w| w.text(&readings.source.name)));
    // what is read outside of the table's box teaches by extrapolation
    let own = model.machine.pose_box;
    let pose_box = model.table.as_ref().and_then(|table| own.common(&table.pose_box)).unwrap_or(own);
    let ask = args.next.map(|count| Ask { count: count.into(), pose_box });
    let mut replay = replay::replay_and_propose(&model.machine.machine, applied.as_ref(), learn, &log.entries, ask)
        .map_err(|f| f.in_file(&name))?;
    let diagnosed = if args.diagnose { replay.diagnose(&model.machine, log, &bar())? } else { None };
    if args.next.is_some() && replay.next.is_empty() {
        session.warn(["next.csv has no probing: none would tell much more than is known, or the log has no force, or no deflection along an axis".to_owned()]);
    }
    if args.diagnose && diagnosed.is_none() {
        session.warn(["no diagnosis: no reading was taken in".to_owned()]);
    }
    let html = args.date.of(report::html(&replay, &facts, &session.warnings)?);
    let document = report::document(&replay);
    let mut files = vec![
        ("replay.json".to_owned(), format!("{document:#}\n").into_bytes()),
        ("report.html".to_owned(), html.into_bytes()),
        ("steps.csv".to_owned(), report::steps_csv(&replay).into_bytes()),
    ];
    if args.next.is_some() {
        files.push(("next.csv".to_owned(), report::next_csv(&replay).into_bytes()));
    }
    if let Some(readings) = &diagnosed {
        files.push(("readings.csv".to_owned(), measured::to_csv(readings).into_bytes()));
    }
    let inputs = [session.machine_path(), Some(args.log.as_path()), args.learn.as_deref(), args.table.table.as_deref()];
    source::write_all(&args.out, &files, &inputs)?;
    let mut text = report::text(&replay);
    let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
    text.push_str(&format!("wrote {} to {}\n", names.join(", "), args.out.display()));
    session.output(text, &document)
}

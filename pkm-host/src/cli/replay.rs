//! `replay`: a controller's log through its estimator.

use std::path::PathBuf;

use super::arguments::TableArgs;
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::files::learn::Learn;
use crate::files::log;
use crate::files::source::{self, Source};
use crate::plan::model::{Form, no_factor_form};
use crate::pose::pose_of;
use crate::replay;
use crate::report::page::of_file;
use crate::report::replay as report;

/// What a controller would have learned from a log of readings under known loads: the same estimator, the same bits.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// CSV with time_s, poses, loads and deflections, as for diagnose.
    #[arg(long, value_name = "CSV")]
    log: PathBuf,
    /// What is learned; without it the drives of the three limbs.
    #[arg(long, value_name = "TOML")]
    learn: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
    /// Folder for replay.json and report.html.
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
            let [theta_deg, sigma_deg, z0_mm] = model.machine.pose_box.middle();
            let middle = pose_of(theta_deg, sigma_deg, z0_mm);
            let drives = Learn::drives(&model.machine.machine, &middle);
            let failed = |e| Failure::input(format!("no compliance of the drives in the middle of the box: {e}"));
            (model.machine.source.name.clone(), drives.map_err(|e| failed(e).in_file(&model.machine.source.name))?)
        }
    };
    let entries = log::read(source, &model.machine)?;
    let replay =
        replay::replay(&model.machine.machine, applied.as_ref(), learn, &entries).map_err(|f| f.in_file(&name))?;
    let html = report::html(&replay, &facts, &session.warnings)?;
    let document = report::document(&replay);
    let files = vec![
        ("replay.json".to_owned(), format!("{document:#}\n").into_bytes()),
        ("report.html".to_owned(), html.into_bytes()),
    ];
    let inputs = [session.machine_path(), Some(args.log.as_path()), args.learn.as_deref(), args.table.table.as_deref()];
    source::write_all(&args.out, &files, &inputs)?;
    let mut text = report::text(&replay);
    text.push_str(&format!("wrote replay.json, report.html to {}\n", args.out.display()));
    session.output(text, &document)
}

//! `verify`: two diagnoses of one machine compared, before and after a repair.

use std::path::{Path, PathBuf};

use super::arguments::DateArgs;
use super::session::{Output, Session};
use crate::diagnose::verify::verify;
use crate::error::{Failure, Result, printable};
use crate::files::source::{self, Source};
use crate::files::verified::Diagnosed;
use crate::page::of_file;
use crate::report::verify as report;

/// What has changed between two diagnoses of one machine, such as before and after a repair, beyond uncertainty.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// diagnosis.json of the machine before, or the folder that it is in.
    #[arg(long, value_name = "JSON")]
    before: PathBuf,
    /// diagnosis.json of the machine after, made with the same machine file.
    #[arg(long, value_name = "JSON")]
    after: PathBuf,
    #[command(flatten)]
    date: DateArgs,
    /// Folder for verify.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn read(path: &Path) -> Result<(Source, Diagnosed)> {
    let source = if path.is_dir() { Source::read(&path.join("diagnosis.json"))? } else { Source::read(path)? };
    let found = Diagnosed::parse(&source)?;
    Ok((source, found))
}

/// Refuses the folder of a diagnosis: its report has the name of ours.
fn keep_report(out: &Path, of: &Path) -> Result<()> {
    let (Ok(folder), Ok(read)) = (out.canonicalize(), of.canonicalize()) else { return Ok(()) };
    if read == folder || read.parent() == Some(&folder) {
        let message = format!("--out {}: the report of a diagnosis is there: give another folder", out.display());
        return Err(Failure::usage(message));
    }
    Ok(())
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    if let Some(out) = &args.out {
        keep_report(out, &args.before)?;
        keep_report(out, &args.after)?;
    }
    let ((first, before), (second, after)) = (read(&args.before)?, read(&args.after)?);
    if before.machine_sha256 != after.machine_sha256 {
        let message = format!(
            "is of machine `{}` from another machine file than {}: diagnose both with one machine file, unchanged to its comments \
             and line ends, and not the second with the machine.toml that the first wrote",
            printable(&after.machine),
            first.name
        );
        return Err(Failure::input(message).in_file(&second.name).at_column("machine_sha256"));
    }
    if let Some(path) = session.machine_path()
        && Source::read(path)?.sha256() != before.machine_sha256
    {
        let message = format!(
            "is of machine `{}` from another file than --machine {}: leave --machine out, or give the file that it was made \
             from. A comment or a line end that was changed since makes another file of it",
            printable(&before.machine),
            path.display()
        );
        return Err(Failure::input(message).in_file(&first.name).at_column("machine_sha256"));
    }
    if before.condition.shared_with != after.condition.shared_with {
        let message = format!("has other declared values than {}", first.name);
        return Err(Failure::input(message).in_file(&second.name).at_column("condition.shared_with"));
    }
    let no_covariance = || {
        let wrong = if verify(&before, &before).is_none() { &first } else { &second };
        Failure::input("expected covariances of the deviations from what was declared").in_file(&wrong.name)
    };
    let found = verify(&before, &after).ok_or_else(no_covariance)?;
    let facts = vec![("Before", of_file(&first)), ("After", of_file(&second))];
    let document = report::document(&found, &facts);
    let mut text = report::text(&found);
    if let Some(out) = &args.out {
        let html = args.date.of(report::html(&found, &printable(&after.machine), facts, &session.warnings));
        let files = [("verify.json", source::json(&document)), ("report.html", html)];
        text += &source::write_all(out, &files, &[Some(args.before.as_path()), Some(args.after.as_path())])?;
    }
    session.output(text, &document)
}

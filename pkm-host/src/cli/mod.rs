//! The command line: one file a command, which reads, has computed, has reported, and writes. Nothing else prints.

use std::ffi::OsString;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use serde_json::json;

pub use self::session::Output;
use self::session::Session;
use crate::error::{Failure, Result};

mod arguments;
mod bar;
mod check;
mod compensate;
mod completions;
mod demo;
mod diagnose;
mod fem;
mod fit;
mod fk;
mod hil;
mod ik;
mod import;
mod map;
mod place;
mod plan;
mod predict;
mod replay;
mod session;
mod stiffness;
mod verify;
mod view;

/// Kinematics and stiffness of an Exechon-like parallel kinematic machine: fits, checks and writes the tables
/// that a controller compiles in.
///
/// Every command takes --json (one document on stdout) and --machine (default: the reference machine).
/// Exit 0: success; 2: bad usage, bad input or a refused pose; 1: anything else.
#[derive(Parser)]
#[command(name = "pkm-host", version)]
struct Cli<C: Subcommand> {
    /// One JSON document on stdout, messages on stderr.
    #[arg(long, global = true)]
    json: bool,
    /// Machine file (TOML); default: the reference machine.
    #[arg(long, global = true, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(subcommand)]
    command: C,
}

// What computes from files alone: for other programs, too. (A doc comment would be the text of `--help`.)
#[derive(Subcommand)]
enum Computation {
    Ik(ik::Args),
    Fk(fk::Args),
    Stiffness(stiffness::Args),
    Predict(predict::Args),
    Plan(plan::Args),
    Fit(fit::Args),
    Import(import::Args),
    Check(check::Args),
    Diagnose(diagnose::Args),
    Map(map::Args),
    Place(place::Args),
    Compensate(compensate::Args),
    Replay(replay::Args),
    Verify(verify::Args),
}

#[derive(Subcommand)]
enum Command {
    #[command(flatten)]
    Computation(Computation),
    View(view::Args),
    Demo(demo::Args),
    Fem(fem::Args),
    Hil(hil::Args),
    Completions(completions::Args),
    Man(completions::ManArgs),
}

trait Run: Subcommand {
    fn run(&self, session: &mut Session) -> Result<Output>;
}

impl Run for Computation {
    fn run(&self, s: &mut Session) -> Result<Output> {
        match self {
            Self::Ik(args) => ik::run(args, s),
            Self::Fk(args) => fk::run(args, s),
            Self::Stiffness(args) => stiffness::run(args, s),
            Self::Predict(args) => predict::run(args, s),
            Self::Plan(args) => plan::run(args, s),
            Self::Fit(args) => fit::run(args, s),
            Self::Import(args) => import::run(args, s),
            Self::Check(args) => check::run(args, s),
            Self::Diagnose(args) => diagnose::run(args, s),
            Self::Map(args) => map::run(args, s),
            Self::Place(args) => place::run(args, s),
            Self::Compensate(args) => compensate::run(args, s),
            Self::Replay(args) => replay::run(args, s),
            Self::Verify(args) => verify::run(args, s),
        }
    }
}

impl Run for Command {
    fn run(&self, s: &mut Session) -> Result<Output> {
        match self {
            Self::Computation(computation) => computation.run(s),
            Self::View(args) => view::run(args, s),
            Self::Demo(args) => demo::run(args, s),
            Self::Fem(args) => fem::run(args, s),
            Self::Hil(args) => hil::run(args, s),
            Self::Completions(args) => completions::run(args, s),
            Self::Man(args) => completions::man(args, s),
        }
    }
}

impl<C: Run> Cli<C> {
    /// What the command prints, and the warnings.
    fn run(self, prints: bool) -> (Result<Output>, Vec<String>) {
        let mut session = Session { machine_path: self.machine, warnings: Vec::new(), prints };
        (self.command.run(&mut session), session.warnings)
    }
}

/// Runs a command as the program does, given its arguments without the program's name, and returns what it would print. Warnings are
/// in the document and not printed.
///
/// # Errors
/// The failure that the program would print.
pub fn run<A: Into<OsString>>(args: impl IntoIterator<Item = A>) -> Result<Output> {
    parsed::<Command, A>(args)?.run(false).0
}

/// The same of the commands that compute from files, so that a program links nothing of the others.
///
/// # Errors
/// The failure that the program would print.
pub fn compute<A: Into<OsString>>(args: impl IntoIterator<Item = A>) -> Result<Output> {
    parsed::<Computation, A>(args)?.run(false).0
}

fn parsed<C: Run, A: Into<OsString>>(args: impl IntoIterator<Item = A>) -> Result<Cli<C>> {
    let args = std::iter::once("pkm-host".into()).chain(args.into_iter().map(Into::into));
    Cli::try_parse_from(args).map_err(|e| unusable(&e))
}

/// Bad options in one line, without the usage that clap prints below.
fn unusable(error: &clap::Error) -> Failure {
    let text = error.to_string();
    let first = text.split("\n\n").next().unwrap_or("").trim_start_matches("error: ");
    Failure::usage(first.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Whether what was printed has arrived. A reader that closes the pipe early is no failure.
fn on_stdout(printed: std::io::Result<()>) -> Result<()> {
    match printed {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::other(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Writes to standard error. Where nobody can read it the work goes on.
pub(crate) fn say(text: &str) {
    drop(std::io::stderr().lock().write_all(text.as_bytes()));
}

/// The program.
pub fn main() -> ExitCode {
    let wants_json = std::env::args_os().any(|a| a == "--json");
    let print = |output: Output| {
        let text = if wants_json { format!("{}\n", output.json) } else { output.text };
        on_stdout(std::io::stdout().lock().write_all(text.as_bytes()))
    };
    let (printed, warnings) = match Cli::<Command>::try_parse() {
        Ok(cli) => {
            let (result, warnings) = cli.run(true);
            (result.and_then(print), warnings)
        }
        // clap's own `exit` would not tell that nothing could be printed
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            (on_stdout(e.print()), Vec::new())
        }
        // what is endless is clipped below
        Err(e) if !wants_json && e.to_string().len() < 4000 => e.exit(),
        Err(e) => (Err(unusable(&e)), Vec::new()),
    };
    let Err(failure) = printed else { return ExitCode::SUCCESS };
    say(&format!("error: {failure}\n"));
    for other in failure.others.iter().flat_map(|others| &others.failures) {
        say(&format!("error: {other}\n"));
    }
    if wants_json {
        let mut document = failure.to_json();
        document["warnings"] = json!(warnings);
        // nothing is left to tell when standard output itself failed
        drop(writeln!(std::io::stdout().lock(), "{document}"));
    }
    ExitCode::from(failure.exit_code())
}

//! `completions` and `man`: what a shell and `man` need of the program.

use std::path::PathBuf;

use clap::CommandFactory;
use serde_json::json;

use super::session::{Output, Session};
use super::{Cli, Command};
use crate::error::{Failure, Result};
use crate::files::source;

/// Completions for a shell, on standard output.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// For which.
    shell: clap_complete::Shell,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::<Command>::command(), "pkm-host", &mut script);
    let text = String::from_utf8(script).map_err(|e| Failure::other(e.to_string()))?;
    let json = json!({ "shell": args.shell.to_string(), "script": &text });
    session.output(text, &json)
}

/// Manual pages: one of the program and one of each command.
#[derive(clap::Args)]
pub(crate) struct ManArgs {
    /// Folder for pkm-host.1, pkm-host-fit.1 and so on.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(crate) fn man(ManArgs { out }: &ManArgs, session: &mut Session) -> Result<Output> {
    let mut program = Cli::<Command>::command().disable_help_subcommand(true);
    program.build();
    let mut pages = Vec::new();
    for command in std::iter::once(&program).chain(program.get_subcommands()) {
        let page = clap_mangen::Man::new(command.clone());
        let mut roff = Vec::new();
        page.render(&mut roff).map_err(|e| Failure::other(e.to_string()))?;
        pages.push((page.get_filename(), roff));
    }
    source::write_all(out, &pages, &[])?;
    let text =
        format!("wrote {} pages to {}: man -l {}\n", pages.len(), out.display(), out.join(&pages[0].0).display());
    session.output(text, &json!({ "files": pages.iter().map(|(name, _)| name).collect::<Vec<_>>() }))
}

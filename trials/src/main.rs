//! `pkm-trials`: random data sets, and how well a diagnosis does on them.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use pkm_trials::set::{Kind, Set, Wish};

#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write one set
    Make {
        /// What it is meant to show
        #[arg(long)]
        kind: Kind,
        /// All of it follows from this
        #[arg(long)]
        seed: u64,
        #[command(flatten)]
        wish: Wish,
        /// Folder for machine.toml, measured.csv, heldout.csv, heldout_zones.csv and truth.json
        #[arg(long)]
        out: PathBuf,
    },
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Make { kind, seed, wish, out } => Set::new(kind, seed, &wish).and_then(|s| s.write(&out)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

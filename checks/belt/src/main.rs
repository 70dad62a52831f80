//! Diagnoses the belt machine from its published readings, and says what it found.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use pkm_belt::study::Study;
use pkm_belt::{files, picture, report};

/// Where the files are beside a checkout of this repository.
const SHARED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/belt");

/// What the model of a real machine on four belts lacks, from readings that its maker published.
///
/// The readings are the files '10X Calibration Test.txt' and 'Tension testing.txt' of the public repository
/// BarbourSmith/Calibration-Simulation at commit 95c920117bac714edc935c37ce9f88cbc9b3332d. They have no licence and are no
/// part of this project: clone that repository and name the folder. Each of the runs is diagnosed alone and predicts the
/// others; the tension test judges the findings.
///
/// Exit 0: success; 2: bad usage or a bad file, with its line; 1: anything else.
#[derive(Parser)]
#[command(name = "pkm-belt", version)]
struct Cli {
    /// Folder with both files; 'ten-runs.txt' and 'tension.txt' are read as well.
    #[arg(default_value = SHARED)]
    folder: PathBuf,
    /// One JSON document on stdout instead of text.
    #[arg(long)]
    json: bool,
    /// Writes a picture of the machine and of the errors (SVG).
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// A message, and whether the user can mend it in the call or the files.
struct Failure {
    message: String,
    exit: u8,
}

fn run(cli: &Cli) -> Result<String, Failure> {
    let bad = |message: String| Failure { message, exit: 2 };
    let published = files::read(&cli.folder).map_err(|e| bad(e.to_string()))?;
    let study = Study::new(&published).map_err(|e| bad(e.to_string()))?;
    if let Some(path) = &cli.svg {
        write_picture(&study, path).map_err(|message| Failure { message, exit: 1 })?;
    }
    Ok(if cli.json { format!("{:#}\n", report::json(&study)) } else { report::text(&study) })
}

fn write_picture(study: &Study, path: &Path) -> Result<(), String> {
    let svg = picture::svg(study).map_err(|e| format!("the picture cannot be drawn: {e}"))?;
    std::fs::write(path, svg).map_err(|e| format!("{}: cannot be written: {e}", path.display()))
}

fn main() -> ExitCode {
    let failed = match run(&Cli::parse()) {
        // a closed pipe is the reader's choice
        Ok(text) => {
            return std::io::stdout().write_all(text.as_bytes()).map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS);
        }
        Err(failed) => failed,
    };
    eprintln!("error: {}", failed.message);
    ExitCode::from(failed.exit)
}

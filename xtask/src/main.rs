//! The project's own chores: `cargo xtask <chore>`.

mod qemu;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use pkm_host::commands;
use pkm_host::fit::TermChoice;

/// What a chore returns: a message when it failed.
pub type Outcome = Result<(), String>;

const USAGE: &str = "\
cargo xtask <chore>
  regenerate   fit the fixtures and commit the result as pkm-core/src/tables/reference.rs
  qemu         run the firmware on a Cortex-M4F and a Cortex-M7 in QEMU, compare every bit with the host";

fn main() -> ExitCode {
    let chore = std::env::args().nth(1);
    let outcome = match chore.as_deref() {
        Some("regenerate") => regenerate(),
        Some("qemu") => qemu::run(),
        _ => Err(USAGE.to_owned()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// The top of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the repository").to_owned()
}

/// Fits the fixtures into a folder.
pub fn fit_fixtures(out: &Path) -> Outcome {
    commands::fit(None, None, None, TermChoice::Paper, out).map(drop).map_err(|e| e.to_string())
}

fn regenerate() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    fit_fixtures(folder.path())?;
    let table = root().join("pkm-core/src/tables/reference.rs");
    std::fs::copy(folder.path().join("coefficients.rs"), &table).map_err(|e| format!("{}: {e}", table.display()))?;
    println!("wrote {}", table.display());
    Ok(())
}

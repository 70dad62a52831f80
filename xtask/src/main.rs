//! The project's own chores: `cargo xtask <chore>`.

mod hil;
mod qemu;
mod showcase;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use pkm_host::commands;
use pkm_host::fit::TermChoice;

/// What a chore returns: a message when it failed.
pub type Outcome = Result<(), String>;

const USAGE: &str = "\
cargo xtask <chore>
  regenerate   fit the fixtures; write pkm-core/src/tables/reference.rs and docs/deflection-error.svg
  qemu         run the firmware on a Cortex-M4F and a Cortex-M7 in QEMU, compare every bit with the host
  hil          drive the cyclic firmware over its serial line: 2,000 poses on each of QEMU's boards, or --poses N, --seed N
  trials       random measured data from other solvers: how often a diagnosis is right. Takes the options of
               `pkm-trials run`, such as --sets 100 --kinds none,one --verbose; alone: the sets of fixtures/measured and
               a few random ones
  showcase     diagnose the finite-element solids of fixtures/stiffness as readings without noise
  no-panic     link the core so that a reachable panic is a link error, and check that a planted one is";

fn main() -> ExitCode {
    let chore = std::env::args().nth(1);
    let outcome = match chore.as_deref() {
        Some("regenerate") => regenerate(),
        Some("qemu") => qemu::run(),
        Some("hil") => hil::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("no-panic") => no_panic(),
        Some("showcase") => showcase::run(),
        Some("trials") => trials(&std::env::args().skip(2).collect::<Vec<_>>()),
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

fn trials(options: &[String]) -> Outcome {
    let cargo = |args: &[&str]| {
        let status = Command::new(env!("CARGO")).args(args).current_dir(root()).status();
        status.map_err(|e| format!("cargo: {e}")).and_then(|s| if s.success() { Ok(()) } else { Err("failed".into()) })
    };
    cargo(&["build", "--release", "--locked", "-p", "pkm-host", "-p", "pkm-trials"])?;
    let program = root().join("target/release/pkm-host").display().to_string();
    let harness =
        |args: &[&str]| cargo(&[&["run", "--release", "--locked", "-q", "-p", "pkm-trials", "--"], args].concat());
    if options.is_empty() {
        harness(&["score", "--program", &program, "--dir", "fixtures/measured", "--verbose"])?;
        return harness(&["run", "--program", &program, "--sets", "3", "--verbose"]);
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    harness(&[&["run", "--program", program.as_str()], options.as_slice()].concat())
}

/// The top of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the repository").to_owned()
}

/// Fits the fixtures' data into a folder, for the reference machine or another.
pub fn fit_fixtures(machine: Option<&Path>, out: &Path) -> Outcome {
    commands::fit(machine, None, None, TermChoice::Paper, out).map(drop).map_err(|e| e.to_string())
}

fn regenerate() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    fit_fixtures(None, folder.path())?;
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).map_err(|e| format!("{name}: {e}"));
    let report = read("report.html")?;
    let picture = report.find("<svg").zip(report.find("</svg>")).map(|(from, to)| &report[from..to + 6]);
    let picture = picture.ok_or("the report has no picture")?;
    for (name, content) in
        [("pkm-core/src/tables/reference.rs", read("coefficients.rs")?), ("docs/deflection-error.svg", picture.into())]
    {
        std::fs::write(root().join(name), content).map_err(|e| format!("{name}: {e}"))?;
        println!("wrote {name}");
    }
    Ok(())
}

/// A release build in the firmware's workspace, to be completed.
pub fn firmware_build() -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(root().join("pkm-fw")).args(["build", "--release", "--locked", "--quiet"]);
    command
}

/// Builds a binary of the firmware for a `target-cpu`, with a feature, with a table other than the reference's.
pub fn firmware(
    binary: &str,
    cpu: Option<&str>,
    feature: Option<&str>,
    coefficients: Option<&Path>,
) -> Result<PathBuf, String> {
    const TARGET: &str = "thumbv7em-none-eabihf";
    let target_dir = root().join("pkm-fw/target").join(cpu.or(feature).unwrap_or("plain"));
    let mut command = firmware_build();
    command.args(["--bin", binary, "--target-dir"]).arg(&target_dir);
    command.args(feature.iter().flat_map(|f| ["--features", f]));
    if let Some(coefficients) = coefficients {
        command.env("PKM_COEFFICIENTS", coefficients);
    }
    if let Some(cpu) = cpu {
        command.env("RUSTFLAGS", format!("-C link-arg=-Tlink.x -C link-arg=--nmagic -C target-cpu={cpu}"));
    }
    let status = command.status().map_err(|e| format!("cargo: {e}"))?;
    if !status.success() {
        return Err(format!(
            "the firmware does not build; if rustc lacks its target, run `rustup toolchain install --no-self-update` \
             ({TARGET} stands in rust-toolchain.toml)"
        ));
    }
    Ok(target_dir.join(TARGET).join("release").join(binary))
}

fn no_panic() -> Outcome {
    let build = |features: &[&str]| {
        let mut command = firmware_build();
        command.args(["--bin", "no_panic"]).args(features).output().map_err(|e| format!("cargo: {e}"))
    };
    let proof = build(&[])?;
    if !proof.status.success() {
        return Err(format!("the core has a reachable panic:\n{}", String::from_utf8_lossy(&proof.stderr)));
    }
    let planted = build(&["--features", "planted-panic"])?;
    let message = String::from_utf8_lossy(&planted.stderr);
    if planted.status.success() || !message.contains("a_panic_is_reachable") {
        return Err(format!("a planted panic was not caught:\n{message}"));
    }
    println!("no panic is reachable from the core's public functions, f64 and f32; a planted one is caught");
    Ok(())
}

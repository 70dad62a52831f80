//! The project's own chores: `cargo xtask <chore>`.

mod axe;
mod browser;
mod c;
mod carried;
mod cycles;
mod debugger;
mod firefox;
mod fuzz;
mod guards;
mod hil;
mod image;
mod learning;
mod line;
mod linuxcnc;
mod mutants;
mod proofs;
mod python;
mod qemu;
mod reports;
mod sensitivity;
mod sets;
mod showcase;
mod single;
mod stack;
mod user;
mod view;
mod wasm;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use pkm_host::cli;

/// What a chore returns: a message when it failed.
pub type Outcome = Result<(), String>;

const USAGE: &str = "\
cargo xtask <chore>
  regenerate   fit the fixtures; write pkm-core/src/tables/reference.rs and docs/deflection-error.svg
  qemu         run the firmware on a Cortex-M4F and a Cortex-M7 in QEMU, compare every bit with the host
  cycles       count the instructions of a controller's cycle on both in QEMU, and of the compensator on this computer (--updates N), and
               hold them against limits
  hil          drive the cyclic firmware over its serial line: 2,000 poses on each of QEMU's boards, or --poses N, --swept N, --seed N
  guards       make the cyclic firmware panic, fault, overrun its stack, hang and miss periods in QEMU; flip bits of its flash;
               have it learn from readings as `replay` does, and keep that over a restart
  trials       random measured data from other solvers: how often a diagnosis is right. Takes the options of
               `pkm-trials run`, such as --sets 100 --kinds none,one --verbose; alone: the sets of fixtures/measured and
               a few random ones. `trials unloaded --sets 500`: geometry from unloaded poses
  sets         diagnose the sets of fixtures/measured, but the easy ones, and hold what is found against their truth
  sensitivity  every number that decides something in a diagnosis halved and doubled, on the sets of fixtures/measured or of a folder:
               what is wrong more or less often, as a table; half an hour for 20 sets
  c            build the C library, its examples and tests, run them here and in QEMU, compare with the host
  linuxcnc     build LinuxCNC's modules and configurations for two machines, drive them in simulation, compare with the host;
               build, run: see cargo xtask linuxcnc help
  python       build the wheel of embed/python in a clean environment, test it against this build of the core, execute its notebook
  header       write embed/c/include/pkm.h
  f32          errors of a controller's cycle in f32 against f64, as tables; write docs/f32.svg
  showcase     diagnose the finite-element solids of fixtures/stiffness as readings without noise
  fuzz         every target of checks/fuzz for ten seconds; with --executions 1e8 until all together have done so many
  miri         core, protocol and C library under Miri
  mutants      small mistakes in the core and in the diagnosis' statistics: which the tests find; takes cargo-mutants' options, such as
               --shard 0/8 for a sample
  reports      write every report from the fixtures, look at it in Chromium (screens, dark and light, paper); pictures in out/reports;
               with --gallery those of docs/gallery too
  view         the page of `view` alone, driven in Chromium, and in Firefox where it is installed: drag, type, open files, play a path
  no-panic     link the core so that a reachable panic is a link error, and check that a planted one is
  no-alloc     look for an allocator, and for memory that the core takes, in every image
  stack        stack of every public function, by call graph and measured in QEMU, against checks/budgets.toml
  size         flash of kinematics and K_m against checks/budgets.toml
  targets      build core and C library for every target that is claimed
  wasm         build embed/wasm and write it to pkm-host/src/report/view/core.wasm; with --check compare it with what is there";

fn main() -> ExitCode {
    let chore = std::env::args().nth(1);
    let outcome = match chore.as_deref() {
        Some("regenerate") => regenerate(),
        Some("qemu") => qemu::run(),
        Some("cycles") => cycles::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("hil") => hil::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("guards") => guards::run(),
        Some("no-panic") => proofs::no_panic(),
        Some("no-alloc") => proofs::no_alloc(),
        Some("size") => proofs::size(),
        Some("stack") => stack::run(),
        Some("targets") => proofs::targets(),
        Some("wasm") => wasm::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("c") => c::run(),
        Some("fuzz") => fuzz::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("miri") => miri(),
        Some("mutants") => mutants::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("header") => c::header(),
        Some("showcase") => showcase::run(),
        Some("reports") => reports::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("view") => view::run(),
        Some("f32") => single::run(),
        Some("linuxcnc") => linuxcnc::run(&std::env::args().skip(2).collect::<Vec<_>>()),
        Some("python") => python::run(),
        Some("sets") => sets::run(),
        Some("sensitivity") => sensitivity::run(&std::env::args().skip(2).collect::<Vec<_>>()),
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
    let run = |program: &str, args: &[&str]| {
        let status = Command::new(program).args(args).current_dir(root()).status();
        status
            .map_err(|e| format!("{program}: {e}"))
            .and_then(|s| if s.success() { Ok(()) } else { Err("failed".into()) })
    };
    // both in one build: cargo would build the harness alone again, with other features of what it depends on
    run(env!("CARGO"), &["build", "--release", "--locked", "-p", "pkm-host", "-p", "pkm-trials"])?;
    let [program, trials] =
        ["pkm-host", "pkm-trials"].map(|n| root().join("target/release").join(n).display().to_string());
    let harness = |args: &[&str]| run(&trials, args);
    if options.is_empty() {
        harness(&["score", "--program", &program, "--dir", "fixtures/measured", "--verbose"])?;
        return harness(&["run", "--program", &program, "--sets", "3", "--verbose"]);
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let (command, options) = match options.split_first() {
        Some((&"unloaded", rest)) => ("unloaded", rest),
        _ => ("run", options.as_slice()),
    };
    harness(&[&[command, "--program", program.as_str()], options].concat())
}

/// The top of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("xtask lies in checks").to_owned()
}

/// What a command prints; an error with what it complained of when it fails.
pub fn output(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.stdin(Stdio::null()).output().map_err(|e| format!("{name}: {e}"))?;
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    if output.status.success() {
        Ok(text(&output.stdout))
    } else {
        Err(format!("{name}: {}\n{}{}", output.status, text(&output.stdout), text(&output.stderr)))
    }
}

/// Of fuzzing and Miri; nothing else needs one.
const NIGHTLY: &str = "nightly-2026-05-20";

/// Runs a subcommand of the nightly's cargo in a folder. `install` says how to come by the subcommand.
pub fn nightly(arguments: &[&str], folder: &Path, install: &str) -> Outcome {
    let subcommand = arguments.first().copied().unwrap_or_default();
    output(Command::new("rustup").args(["run", NIGHTLY, "cargo", subcommand, "--version"])).map_err(|e| {
        let toolchain =
            format!("rustup toolchain install {NIGHTLY} --no-self-update --profile minimal -c miri -c rust-src");
        format!("cargo {subcommand} is needed, of Rust's {NIGHTLY}:\n{toolchain}\n{install}\n\n{e}")
    })?;
    let mut command = Command::new("rustup");
    let status = command.args(["run", NIGHTLY, "cargo"]).args(arguments).current_dir(folder).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("cargo {}: {status}", arguments.join(" "))),
        Err(e) => Err(format!("rustup: {e}")),
    }
}

/// With a target of 32 bit, as a controller is: on x86-64 libm has inline assembly, which Miri can't run.
fn miri() -> Outcome {
    let target = ["--target", "armv7-unknown-linux-gnueabihf"];
    let test = ["miri", "test", "--locked"];
    let packages = ["-p", "pkm-core", "-p", "pkm-protocol", "--tests"];
    nightly(&[&test[..], &target, &packages].concat(), &root(), "")?;
    nightly(&[&test[..], &target].concat(), &root().join("embed/c"), "")
}

/// Fits the fixtures' data into a folder, for the reference machine or another.
pub fn fit_fixtures(machine: Option<&Path>, out: &Path) -> Outcome {
    let mut args = vec!["fit".as_ref(), "--out".as_ref(), out.as_os_str()];
    args.extend(machine.into_iter().flat_map(|path| ["--machine".as_ref(), path.as_os_str()]));
    cli::run(args).map(drop).map_err(|e| e.to_string())
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

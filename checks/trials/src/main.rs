//! `pkm-trials`: random data sets, and how well a diagnosis does on them.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Parser, Subcommand};
use pkm_trials::effects::{COUPLING, LISTED, OUTSIDE};
use pkm_trials::score::{self, Outcome};
use pkm_trials::set::{Kind, Set, SetOptions};
use pkm_trials::stiffness::{self, Stiff};
use pkm_trials::unloaded::{self, Case};
use pkm_trials::{life, uncertainty, unloaded_score};

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
        conditions: SetOptions,
        /// Folder for machine.toml, measured.csv, heldout.csv, heldout_zones.csv and truth.json
        #[arg(long)]
        out: PathBuf,
    },
    /// Make sets, run the program on them and print the rates
    Run {
        /// What has a command `diagnose`
        #[arg(long)]
        program: PathBuf,
        /// Sets of each kind
        #[arg(long, default_value_t = 20)]
        sets: u64,
        /// Of the first set of each kind; the others follow one by one
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Kinds of sets
        #[arg(long, value_delimiter = ',', default_value = "none,one,two,declared,outside,load-errors")]
        kinds: Vec<Kind>,
        #[command(flatten)]
        conditions: SetOptions,
        /// Sets at a time
        #[arg(long, default_value_t = 2)]
        jobs: usize,
        /// Keep the sets in this folder
        #[arg(long)]
        keep: Option<PathBuf>,
        /// A line for each set
        #[arg(long)]
        verbose: bool,
        /// Write the tables as Markdown too
        #[arg(long)]
        markdown: Option<PathBuf>,
    },
    /// Write the sets that the project keeps: every effect easy and hard to see, and what else there is
    Fixtures {
        /// Folder for the folders `own-…`
        #[arg(long)]
        out: PathBuf,
    },
    /// Make sets of unloaded poses, have the program find the geometry, and print how often it is right
    Unloaded {
        /// What has a command `diagnose`
        #[arg(long)]
        program: PathBuf,
        /// Sets of each case
        #[arg(long, default_value_t = 20)]
        sets: u64,
        /// Of the first set of each case; the others follow one by one
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// What is measured, and what is wrong
        #[arg(long, value_delimiter = ',', default_value = "five,parallel,bar,five-axes,parallel-axes")]
        cases: Vec<Case>,
        /// Poses of each file
        #[arg(long, default_value_t = 60)]
        poses: usize,
        /// 1 sd of a coordinate or a distance, µm
        #[arg(long, default_value_t = 10.0)]
        noise_um: f64,
        /// Sets at a time
        #[arg(long, default_value_t = 2)]
        jobs: usize,
    },
    /// Make machines whose truth has other formulas, have the program fit tables or diagnose readings, and print how often the
    /// uncertainty that it gives to the tables' deflections covers the error
    Uncertainty {
        /// What has the commands `fit`, `diagnose` and `predict`
        #[arg(long)]
        program: PathBuf,
        /// Machines
        #[arg(long, default_value_t = 40)]
        sets: u64,
        /// Of the first machine; the others follow one by one
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Terms of the tables that are fitted
        #[arg(long, default_value = "full")]
        terms: String,
        /// Diagnose readings of sets of these kinds, as many of each, instead of fitting tables
        #[arg(long, value_delimiter = ',')]
        kinds: Vec<Kind>,
        /// Machines at a time
        #[arg(long, default_value_t = 2)]
        jobs: usize,
        /// A line for each machine
        #[arg(long)]
        verbose: bool,
    },
    /// Live lives of machines: a nut wears, a part comes loose, seasons pass, the probe is replaced and fails; print how well `replay`
    /// follows
    Life {
        /// What has a command `replay`
        #[arg(long)]
        program: PathBuf,
        /// Lives
        #[arg(long, default_value_t = 20)]
        sets: u64,
        /// Of the first life; the others follow one by one
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Days of a life
        #[arg(long, default_value_t = 400)]
        days: usize,
        /// Readings in a day
        #[arg(long, default_value_t = 4)]
        readings: usize,
        /// A part comes loose that is not learned
        #[arg(long)]
        foreign: bool,
        /// Lives at a time
        #[arg(long, default_value_t = 2)]
        jobs: usize,
        /// A line for each life
        #[arg(long)]
        verbose: bool,
    },
    /// Write one set of unloaded poses
    MakeUnloaded {
        /// What is measured, and what is wrong
        #[arg(long, value_enum)]
        case: Case,
        /// All of it follows from this
        #[arg(long)]
        seed: u64,
        /// Poses of each file
        #[arg(long, default_value_t = 60)]
        poses: usize,
        /// 1 sd of a coordinate or a distance, µm
        #[arg(long, default_value_t = 10.0)]
        noise_um: f64,
        /// Folder for machine.toml, unloaded.csv, heldout.csv and truth.json
        #[arg(long)]
        out: PathBuf,
    },
    /// Write the stiffness of a machine with elastic platforms and limbs over a wide box: data of the case study, and of the
    /// X150
    Stiffness {
        /// Machine
        #[arg(long, value_enum, default_value_t = Stiff::Reference)]
        machine: Stiff,
        /// CSV
        #[arg(long)]
        out: PathBuf,
    },
    /// Run the program on the sets in a folder and print the rates
    Score {
        /// Holds folders with machine.toml, measured.csv, heldout.csv and truth.json
        #[arg(long)]
        dir: PathBuf,
        /// What has a command `diagnose`
        #[arg(long)]
        program: PathBuf,
        /// Sets at a time
        #[arg(long, default_value_t = 2)]
        jobs: usize,
        /// A line for each set
        #[arg(long)]
        verbose: bool,
        /// Write the tables as Markdown too
        #[arg(long)]
        markdown: Option<PathBuf>,
    },
}

/// A reader may have seen enough and be gone.
fn say(text: &str) {
    _ = writeln!(std::io::stdout(), "{text}");
}

/// Does all tasks, a few at a time; outcomes in the order of the tasks.
fn all_of<T: Sync, O: Send>(
    tasks: &[T],
    jobs: usize,
    line: impl Fn(&O) -> Option<String> + Sync,
    work: impl Fn(&T) -> Result<O, String> + Sync,
) -> Result<Vec<O>, String> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(tasks.len()));
    std::thread::scope(|scope| {
        for _ in 0..jobs.max(1) {
            scope.spawn(|| {
                while let Some((i, task)) =
                    Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, tasks.get(i)?)))
                {
                    let outcome = work(task);
                    if let Some(line) = outcome.as_ref().ok().and_then(&line) {
                        say(&line);
                    }
                    done.lock().expect("no other thread panicked").push((i, outcome));
                }
            });
        }
    });
    let mut done = done.into_inner().expect("no thread panicked");
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, outcome)| outcome).collect()
}

fn show(outcomes: &[Outcome], markdown: Option<PathBuf>) -> Result<(), String> {
    say(&score::report(outcomes, false));
    let write = |path: PathBuf| {
        std::fs::write(&path, score::report(outcomes, true)).map_err(|e| format!("{}: {e}", path.display()))
    };
    markdown.map_or(Ok(()), write)
}

/// Folders that hold a set, in order.
fn folders(dir: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(dir).map_err(|e| format!("{}: {e}", dir.display()))?;
    let mut all: Vec<PathBuf> =
        entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.join("truth.json").is_file()).collect();
    all.sort();
    Ok(all)
}

/// λ of sets that are easy and hard to name.
const SIZES: [(&str, f64); 2] = [("easy", 500.0), ("hard", 60.0)];
/// Seeds of the sets that are kept; nothing was chosen by what comes out.
const SEEDS: [u64; 2] = [1, 2];

/// Writes the sets that the project keeps.
fn fixtures(out: &Path) -> Result<(), String> {
    let conditions = |effect: Option<&str>, lambda| SetOptions {
        effect: effect.map(str::to_owned),
        lambda,
        poses: Some(10),
        ..SetOptions::default()
    };
    let write = |name: &str, kind, seed, conditions: &SetOptions| {
        Set::new(kind, seed, conditions)
            .and_then(|set| set.write(&out.join(name), false))
            .map_err(|e| format!("{name}: {e}"))
    };
    for spec in LISTED.iter().chain([&COUPLING]) {
        for (size, lambda) in SIZES {
            write(&format!("own-{}-{size}", spec.id), Kind::One, SEEDS[0], &conditions(Some(spec.id), Some(lambda)))?;
        }
    }
    for spec in &OUTSIDE {
        write(&format!("own-outside-{}", spec.id), Kind::Outside, SEEDS[0], &conditions(Some(spec.id), Some(200.0)))?;
    }
    for kind in [Kind::None, Kind::LoadErrors, Kind::Declared, Kind::Two] {
        for seed in SEEDS {
            write(&format!("own-{}-{seed}", kind.name()), kind, seed, &conditions(None, None))?;
        }
    }
    Ok(())
}

fn run(command: Command) -> Result<(), String> {
    match command {
        Command::Make { kind, seed, conditions, out } => {
            Set::new(kind, seed, &conditions).and_then(|s| s.write(&out, false))
        }
        Command::Fixtures { out } => fixtures(&out),
        Command::Stiffness { machine, out } => {
            let csv = stiffness::csv(machine);
            csv.and_then(|csv| std::fs::write(&out, csv).map_err(|e| format!("{}: {e}", out.display())))
        }
        Command::Run { program, sets, seed, kinds, conditions, jobs, keep, verbose, markdown } => {
            say(&format!("seed {seed}, {sets} sets of each kind"));
            let tasks: Vec<(Kind, u64)> = kinds.iter().flat_map(|k| (seed..seed + sets).map(|s| (*k, s))).collect();
            let work = |(kind, seed): &(Kind, u64)| {
                let folder = tempfile::tempdir().map_err(|e| format!("temporary folder: {e}"))?;
                let folder = keep.as_deref().unwrap_or(folder.path()).join(format!("{}-{seed}", kind.name()));
                Set::new(*kind, *seed, &conditions)?.write(&folder, true)?;
                Outcome::of(&program, &folder)
            };
            all_of(&tasks, jobs, |o: &Outcome| verbose.then(|| o.line()), work)
                .and_then(|outcomes| show(&outcomes, markdown))
        }
        Command::Unloaded { program, sets, seed, cases, poses, noise_um, jobs } => {
            say(&format!("seed {seed}, {sets} sets of each case, {poses} poses, noise {noise_um} µm"));
            cases.iter().try_for_each(|case| {
                let seeds: Vec<u64> = (seed..seed + sets).collect();
                let work = |seed: &u64| {
                    let folder = tempfile::tempdir().map_err(|e| format!("temporary folder: {e}"))?;
                    let set = unloaded::Set::new(*case, *seed, poses, noise_um);
                    let outcome = unloaded_score::Outcome::of(&program, &set, folder.path());
                    outcome.map_err(|e| format!("{}, seed {seed}: {e}", case.name()))
                };
                let outcomes = all_of(&seeds, jobs, |_| None, work)?;
                say(&unloaded_score::report(case.name(), &outcomes));
                Ok(())
            })
        }
        Command::Uncertainty { program, sets, seed, terms, kinds, jobs, verbose } => {
            let what =
                if kinds.is_empty() { format!("machines, terms {terms}") } else { "sets of each kind".to_owned() };
            say(&format!("seed {seed}, {sets} {what}"));
            let kinds: Vec<Option<Kind>> =
                if kinds.is_empty() { vec![None] } else { kinds.into_iter().map(Some).collect() };
            let tasks: Vec<_> = kinds.iter().flat_map(|k| (seed..seed + sets).map(|s| (*k, s))).collect();
            let work = |(kind, seed): &(Option<Kind>, u64)| {
                let folder = tempfile::tempdir().map_err(|e| format!("temporary folder: {e}"))?;
                let outcome = match kind {
                    None => uncertainty::Outcome::of_fit(&program, *seed, &terms, folder.path()),
                    Some(kind) => uncertainty::Outcome::of_diagnosis(&program, *kind, *seed, folder.path()),
                };
                outcome.map_err(|e| format!("seed {seed}: {e}"))
            };
            all_of(&tasks, jobs, |o: &uncertainty::Outcome| verbose.then(|| o.line()), work)
                .map(|outcomes| say(&uncertainty::report(&outcomes)))
        }
        Command::Life { program, sets, seed, days, readings, foreign, jobs, verbose } => {
            say(&format!("seed {seed}, {sets} lives of {days} days with {readings} readings each"));
            let seeds: Vec<u64> = (seed..seed + sets).collect();
            let plan = life::Plan { days, readings: readings.max(1), foreign };
            let work = |seed: &u64| {
                let folder = tempfile::tempdir().map_err(|e| format!("temporary folder: {e}"))?;
                life::live(&program, *seed, &plan, folder.path()).map_err(|e| format!("seed {seed}: {e}"))
            };
            all_of(&seeds, jobs, |o: &life::Outcome| verbose.then(|| o.line()), work)
                .map(|outcomes| say(&life::report(&outcomes)))
        }
        Command::MakeUnloaded { case, seed, poses, noise_um, out } => {
            unloaded::Set::new(case, seed, poses, noise_um).write(&out)
        }
        Command::Score { dir, program, jobs, verbose, markdown } => folders(&dir)
            .and_then(|all| {
                all_of(&all, jobs, |o: &Outcome| verbose.then(|| o.line()), |folder| Outcome::of(&program, folder))
            })
            .and_then(|outcomes| show(&outcomes, markdown)),
    }
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

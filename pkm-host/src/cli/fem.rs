//! `fem`: stiffness by finite elements.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pkm_core::effects::Effects;
use serde_json::json;

use super::arguments::{DateArgs, list, positive, within};
use super::bar::bar;
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::fem::deck::Plates;
use crate::fem::readings::{Loads, Simulation};
use crate::fem::{self, Case, Model, Settings, ccx, slurm};
use crate::files::machine::MachineFile;
use crate::files::source::{self, Source};
use crate::files::{dataset, machine_edit};
use crate::page::of_file;
use crate::pose::NamedPose;
use crate::report::fem::{self as report, Facts};

/// Stiffness by finite elements: the machine in solids at each pose, computed by CalculiX, which must be installed.
///
/// Writes the stiffness CSV, and beside it a manifest (.manifest.json) and a page with a drawing of the machine (.html).
/// What the solids are made of stands in the machine file's section [solid], all of which has defaults. A run that was
/// interrupted goes on when it is started again.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// CSV with pose,theta_deg,sigma_deg,z0_mm or pose,q1_mm,q2_mm,q3_mm.
    #[arg(long, value_name = "CSV", required_unless_present = "loads", conflicts_with = "loads")]
    poses: Option<PathBuf>,
    #[command(flatten)]
    date: DateArgs,
    /// Stiffness CSV to write, 21 columns.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
    /// Changes the machine file for this run, e.g. solid.limb=uniform, solid.platform.kind=rigid,
    /// solid.platform.thickness_mm=30, solid.nut.axial_n_per_m=[1e9,7e8,1e9], solid.offset_mm=[20,20,20],
    /// limb.2.platform_joint.linear_n_per_m=[1e8,1e8,1e8]. May be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Size of the elements, relative to the usual: 0.5 is twice as fine.
    #[arg(long, default_value_t = 1.0, value_parser = within(0.1, 5.0), allow_hyphen_values = true)]
    mesh: f64,
    /// Poses at a time, one core each; default: as many as there are cores.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// The program CalculiX.
    #[arg(long, value_name = "PATH", default_value = "ccx")]
    ccx: PathBuf,
    /// Folder for the cases, one each pose; default: named after --out, and gone in the end.
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// Keep the decks and all that CalculiX wrote.
    #[arg(long)]
    keep: bool,
    /// Compute nothing: check that the solids fit at every pose, and write the page with the drawing.
    #[arg(long, conflicts_with_all = ["emit", "collect", "readings"])]
    dry_run: bool,
    /// Compute nothing: write the decks and an array job for a cluster.
    #[arg(long, value_enum, conflicts_with = "collect")]
    emit: Option<Emit>,
    /// Compute nothing: gather what the cluster has computed. All other options as with --emit.
    #[arg(long)]
    collect: bool,
    /// Measured data to write besides: deflections under loads at every pose, with noise.
    #[arg(long, value_name = "CSV")]
    readings: Option<PathBuf>,
    /// Poses and loads of the readings, from a measured file or from `plan --kind discriminate`. Default: along and about
    /// every axis both ways, half the load, the whole and half on the way back.
    #[arg(long, value_name = "CSV", requires = "readings")]
    loads: Option<PathBuf>,
    /// Greatest force of the default loads.
    #[arg(
        long,
        default_value_t = 500.0,
        value_parser = positive,
        allow_hyphen_values = true,
        requires = "readings",
        conflicts_with = "loads"
    )]
    force_n: f64,
    /// Greatest moment of the default loads.
    #[arg(
        long,
        default_value_t = 50.0,
        value_parser = positive,
        allow_hyphen_values = true,
        requires = "readings",
        conflicts_with = "loads"
    )]
    moment_nm: f64,
    /// How often the default loads are taken.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=100), requires = "readings", conflicts_with = "loads")]
    repeats: u32,
    /// 1 sd of a reading, translations in um and rotations in urad.
    #[arg(long, default_value = "0.2,0.5", value_parser = list::<2>, allow_hyphen_values = true, requires = "readings", value_name = "UM,URAD")]
    noise: [f64; 2],
    /// 1 sd of the error that all readings of a series share.
    #[arg(long, default_value = "0.2,0.5", value_parser = list::<2>, allow_hyphen_values = true, requires = "readings", value_name = "UM,URAD")]
    zero: [f64; 2],
    /// Random seed of the errors; default: random, printed.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 53), requires = "readings")]
    seed: Option<u64>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Emit {
    /// For Slurm.
    Slurm,
}

/// Poses, and the loads of readings, if there are to be any.
struct Poses {
    /// Of the list, or of the loads.
    poses: Vec<NamedPose>,
    loads: Option<Loads>,
    /// Their file, with its checksum.
    from: String,
}

/// Files to write beside `--out`.
struct Beside {
    work: PathBuf,
    html: PathBuf,
    manifest: PathBuf,
}

impl Args {
    fn simulation(&self) -> Result<Simulation> {
        if self.noise.iter().chain(&self.zero).any(|v| *v < 0.0) {
            return Err(Failure::usage("--noise, --zero: expected standard deviations of at least 0"));
        }
        Ok(Simulation {
            force_n: self.force_n,
            moment_nm: self.moment_nm,
            repeats: self.repeats,
            noise: self.noise,
            zero: self.zero,
            seed: self.seed.unwrap_or_else(|| fastrand::u64(..1 << 53)),
        })
    }

    fn read_poses(&self, file: &MachineFile, simulation: &Simulation, session: &mut Session) -> Result<Poses> {
        let Some(path) = self.poses.as_deref().or(self.loads.as_deref()) else {
            return Err(Failure::usage("--poses: which poses? Give a CSV, such as `plan` writes"));
        };
        let source = Source::read(path)?;
        let from = of_file(&source);
        let (mut poses, warnings) = match self.poses {
            Some(_) => dataset::read_poses(source, file)?,
            None => (Vec::new(), Vec::new()),
        };
        session.warn(warnings);
        let loads = match &self.readings {
            Some(_) => {
                let given = self.loads.as_deref().map(Source::read).transpose()?;
                Some(Loads::new(simulation, given, &poses, file)?)
            }
            None => None,
        };
        if let Some(loads) = &loads {
            session.warn(loads.warnings().to_vec());
            if self.poses.is_none() {
                poses = loads.poses().to_vec();
            }
        }
        dataset::refuse_doubled_ids(&path.display().to_string(), &poses)?;
        Ok(Poses { poses, loads, from })
    }

    fn beside(&self) -> Beside {
        Beside {
            work: self.work.clone().unwrap_or_else(|| self.out.with_extension("work")),
            html: self.out.with_extension(if self.dry_run { "drawing.html" } else { "html" }),
            manifest: self.out.with_extension("manifest.json"),
        }
    }

    fn inputs<'a>(&'a self, session: &'a Session) -> [Option<&'a Path>; 3] {
        [session.machine_path(), self.poses.as_deref(), self.loads.as_deref()]
    }
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let simulation = args.simulation()?;
    // it runs in other folders than this one
    let named = args.ccx.components().count() > 1;
    let ccx = std::path::absolute(&args.ccx).ok().filter(|_| named).unwrap_or_else(|| args.ccx.clone());
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let settings = Settings {
        set: &args.set,
        size: args.mesh,
        jobs: args.jobs.map_or_else(cores, |n| n as usize),
        ccx: &ccx,
        keep: args.keep,
    };
    let source = Source::read_or(session.machine_path(), pkm_fixtures::MACHINE)?;
    let file = MachineFile::parse(machine_edit::changed(source, &args.set)?)?;
    session.warn(file.warnings.clone());
    let solid = file.solid.as_ref().map_err(Clone::clone)?;
    let Poses { poses, loads, from } = args.read_poses(&file, &simulation, session)?;
    if file.parameters.effects != Effects::NONE {
        let name = &file.source.name;
        session.warn([format!("{name}: its effects are the core's; they are not built in solids")]);
    }
    let plates = Plates::new(solid, &file.parameters, settings.size);
    let plates = plates.map_err(|message| Failure::input(message).in_file(&file.source.name).at_column("solid"))?;
    let model = Model { file: &file, solid, plates };
    let name = args.poses.as_deref().or(args.loads.as_deref()).map_or(String::new(), |p| p.display().to_string());
    let cases = fem::cases_of(&model, &poses, &name)?;
    let beside = args.beside();
    let written: Vec<&Path> =
        [&args.out, &beside.html, &beside.manifest].into_iter().chain(&args.readings).map(PathBuf::as_path).collect();
    check_names(&written, &args.inputs(session))?;
    let facts = Facts {
        file: &file,
        solid,
        settings: &settings,
        cases: &cases,
        solved: None,
        poses_from: &from,
        version: "nothing yet",
    };
    if args.dry_run {
        return draw(args, session, &facts, &beside.html);
    }
    if args.emit.is_some() {
        return emit(session, &model, &beside.work, &cases);
    }
    let mut computed = 0;
    if !args.collect {
        let version = ccx::version(&ccx)?;
        // two seconds a pose: it is told before them what can't be written after them
        written.iter().try_for_each(|path| source::check_writable(path))?;
        computed = fem::compute(&settings, &version, &beside.work, &model, &cases, &bar())?;
    }
    finish(args, session, facts, &beside, (loads.as_ref(), &simulation), computed)
}

/// "2 poses, up to 5000 nodes each: …".
fn about(cases: &[Case], what: &str) -> String {
    format!("{} poses, up to {} nodes each: {what}\n", cases.len(), largest(cases).0)
}

fn largest(cases: &[Case]) -> (usize, usize) {
    cases.iter().map(|c| c.size).max().unwrap_or_default()
}

/// `--dry-run`.
fn draw(args: &Args, session: &Session, facts: &Facts<'_>, html: &Path) -> Result<Output> {
    source::write(html, args.date.of(report::page(facts, &session.warnings)?), &args.inputs(session))?;
    let (nodes, elements) = largest(facts.cases);
    let json = json!({
        "poses": facts.cases.len(), "nodes": nodes, "elements": elements, "report": html.display().to_string(),
    });
    let what = format!("nothing computed; the machine is drawn in {}", html.display());
    session.output(about(facts.cases, &what), &json)
}

/// `--emit slurm`: decks and a job script for a cluster.
fn emit(session: &Session, model: &Model<'_>, work: &Path, cases: &[Case]) -> Result<Output> {
    let tasks = slurm::emit(model, work, cases)?;
    let what = format!(
        "decks and {0} are in {1}. There, `sbatch {0}` starts {tasks} tasks; then run the same command with --collect in \
         place of --emit slurm",
        slurm::SCRIPT,
        work.display()
    );
    let json =
        json!({ "poses": cases.len(), "tasks": tasks, "work": work.display().to_string(), "script": slurm::SCRIPT });
    session.output(about(cases, &what), &json)
}

/// Writes what was computed.
fn finish(
    args: &Args,
    session: &Session,
    facts: Facts<'_>,
    Beside { work, html, manifest }: &Beside,
    (loads, simulation): (Option<&Loads>, &Simulation),
    computed: usize,
) -> Result<Output> {
    let cases = facts.cases;
    let solved = fem::gather(work, cases)?;
    let versions: BTreeSet<&str> = solved.iter().map(|(_, s)| s.version.as_str()).collect();
    let version = versions.into_iter().collect::<Vec<_>>().join(", ");
    let facts = Facts { solved: Some(&solved), version: &version, ..facts };
    let read = args.inputs(session);
    let mut text = about(
        cases,
        &format!(
            "{computed} computed, {} taken over\n{}wrote {}, {} and {}",
            cases.len() - computed,
            facts.summary(),
            args.out.display(),
            manifest.display(),
            html.display()
        ),
    );
    let page = args.date.of(report::page(&facts, &session.warnings)?);
    if let (Some(out), Some(loads)) = (&args.readings, loads) {
        let (csv, count) = loads.csv(simulation, facts.file, &args.set, &solved)?;
        source::write(out, csv, &read)?;
        text.push_str(&format!("wrote {count} readings to {}, seed {}\n", out.display(), simulation.seed));
    }
    source::write(manifest, source::json(&report::manifest(&facts)), &read)?;
    source::write(html, page, &read)?;
    source::write(&args.out, report::stiffness_csv(&facts, &solved), &read)?;
    if !args.collect && args.work.is_none() && !args.keep {
        fem::clear(work, cases);
    }
    let skew = solved.iter().map(|(_, s)| s.skew).fold(0.0, f64::max);
    let (nodes, elements) = largest(cases);
    let json = json!({
        "poses": cases.len(), "computed": computed, "nodes": nodes, "elements": elements, "asymmetry": skew,
        "basic_model": facts.against_core(), "out": args.out.display().to_string(),
        "readings": args.readings.as_ref().map(|p| p.display().to_string()),
        "seed": args.readings.as_ref().map(|_| simulation.seed),
    });
    session.output(text, &json)
}

/// Refuses files to write that are read, or are one.
fn check_names(written: &[&Path], read: &[Option<&Path>]) -> Result<()> {
    source::keep_inputs(written, read)?;
    for (i, path) in written.iter().enumerate() {
        if written[..i].contains(path) {
            let message = "two files of this call have this name: name --out otherwise, such as k.csv";
            return Err(Failure::usage(message).in_file(path.display().to_string()));
        }
    }
    Ok(())
}

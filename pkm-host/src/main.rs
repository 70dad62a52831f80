//! Reads the command line and calls the library. See `--help`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser, Subcommand};
use pkm_host::cli::commands::{self, Form};
use pkm_host::cli::output::Output;
use pkm_host::error::{Failure, Result};
use pkm_host::fem;
use pkm_host::files::source;
use pkm_host::fit::TermChoice;
use pkm_host::hil::{self, Target};
use pkm_host::plan::compensate::Request;
use pkm_host::plan::ik;
use pkm_host::plan::map::Window;
use pkm_host::plan::place::{Method, Objective};
use pkm_host::pose::PoseBox;
use serde_json::json;

/// Kinematics and stiffness of an Exechon-like parallel kinematic machine: fits, checks and writes the tables
/// that a controller compiles in.
///
/// Every command takes --json (one document on stdout) and --machine (default: the reference machine).
/// Exit 0: success; 2: bad usage, bad input or a refused pose; 1: anything else.
#[derive(Parser)]
#[command(version)]
struct Cli {
    /// One JSON document on stdout, messages on stderr.
    #[arg(long, global = true)]
    json: bool,
    /// Machine file (TOML); default: the reference machine.
    #[arg(long, global = true, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Screw lengths of a pose; or of a tool, with the wrist's joints.
    Ik(IkArgs),
    /// Pose of three screw lengths; with the wrist's joints also the tool.
    Fk {
        /// q1,q2,q3 in mm.
        #[arg(long, value_parser = list::<3>, allow_hyphen_values = true, value_name = "A,B,C")]
        q_mm: [f64; 3],
        /// β1,β2 of the wrist in °: gives the tool's tip and axis too.
        #[arg(long, value_parser = list::<2>, allow_hyphen_values = true, value_name = "B1,B2")]
        beta_deg: Option<[f64; 2]>,
    },
    /// Terminal stiffness at poses: basic, or corrected by a table.
    Stiffness {
        /// CSV with pose,theta_deg,sigma_deg,z0_mm or pose,q1_mm,q2_mm,q3_mm.
        #[arg(long, value_name = "CSV")]
        poses: PathBuf,
        #[command(flatten)]
        table: TableArgs,
        /// Stiffness CSV to write, 21 columns.
        #[arg(long, value_name = "CSV")]
        out: Option<PathBuf>,
    },
    /// Measured data with the model's deflections in place of the readings.
    Predict {
        /// CSV with poses and wrenches; default, for the reference machine alone: simulated readings.
        #[arg(long, value_name = "CSV")]
        data: Option<PathBuf>,
        #[command(flatten)]
        table: TableArgs,
        /// CSV to write.
        #[arg(long, value_name = "CSV")]
        out: PathBuf,
    },
    /// Poses to measure or to compute finite elements at.
    Plan {
        /// l49, l49-balanced, verify, levels N (N² poses, N from 4 to 50), or discriminate: poses and loads that best
        /// tell apart what --data leave undecided.
        #[arg(long, num_args = 1..=2, required = true, allow_negative_numbers = true, value_name = "KIND")]
        kind: Vec<String>,
        /// θ, σ in ° and Z0 in mm, least and greatest of each; default: the machine's box.
        #[arg(long = "box", value_parser = list::<6>, allow_hyphen_values = true, value_name = "T0,T1,S0,S1,Z0,Z1")]
        pose_box: Option<[f64; 6]>,
        /// Measured CSV, for discriminate; default, for the reference machine alone: simulated readings.
        #[arg(long, value_name = "CSV")]
        data: Option<PathBuf>,
        /// CSV to write.
        #[arg(long, value_name = "CSV")]
        out: PathBuf,
    },
    /// Correction tables from stiffness data (Eqs. 10-14).
    Fit {
        /// Stiffness CSV to fit; default, for the reference machine alone: its finite elements at 49 poses.
        #[arg(long, value_name = "CSV")]
        data: Option<PathBuf>,
        /// Stiffness CSV to judge by; default: 25 other poses when --data is not given.
        #[arg(long, value_name = "CSV")]
        verify: Option<PathBuf>,
        /// Which terms the polynomials get.
        #[arg(long, value_enum, default_value = "paper")]
        terms: TermChoice,
        /// Folder for coefficients.rs, coefficients.json, fit.json and report.html.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// From measured deflections to the physics that the model lacks: adds it, and compares before and after.
    Diagnose {
        /// Measured CSV; default, for the reference machine alone: simulated readings.
        #[arg(long, value_name = "CSV")]
        data: Option<PathBuf>,
        /// Measured CSV to compare on; default: whole poses of --data in turn (cross-validation).
        #[arg(long, value_name = "CSV")]
        holdout: Option<PathBuf>,
        /// Folder for diagnosis.json, machine.toml, coefficients.rs and report.html.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Maps of k11…k66 over the workspace (Fig. 7), and whether the paper's Section 5.2 is true of this machine.
    Map {
        #[command(flatten)]
        table: TableArgs,
        /// σ in °, within ±90; several with commas between: a picture each.
        #[arg(long, value_parser = finite, allow_hyphen_values = true, value_delimiter = ',', default_value = "0")]
        sigma_deg: Vec<f64>,
        /// Least and greatest X0 of the window in mm; default: the machine's workspace.
        #[arg(long, value_parser = list::<2>, allow_hyphen_values = true, value_name = "LEAST,GREATEST")]
        x0_mm: Option<[f64; 2]>,
        /// Least and greatest Z0 of the window in mm; default: the machine's workspace.
        #[arg(long, value_parser = list::<2>, allow_hyphen_values = true, value_name = "LEAST,GREATEST")]
        z0_mm: Option<[f64; 2]>,
        /// Between points of the CSV in mm; default: 100 to 250 points along the longer side.
        #[arg(long, value_parser = finite, allow_hyphen_values = true)]
        step_mm: Option<f64>,
        /// Folder for map.csv, map.svg, map.png (with several σ map-sigma-….svg and .png) and report.html.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Puts the workpiece where the machine is stiff: the best position of a cross slide, a rotary axis, or both, for each
    /// series of holes.
    Place {
        /// The job (TOML), its loads on the tool at the tip in the tool's axes (z along the tool); default, for the reference
        /// machine alone: the case study of fixtures/jobs.
        #[arg(long, value_name = "TOML")]
        job: Option<PathBuf>,
        #[command(flatten)]
        table: TableArgs,
        /// What should be small; several may be given. Default: paper and tip-worst.
        #[arg(long, value_enum, num_args = 1..)]
        objective: Vec<Objective>,
        /// How the optimum is searched for; the grid certifies it in any case. Default: grid, and de when cross slide and
        /// rotary axis both move.
        #[arg(long, value_enum)]
        method: Option<Method>,
        /// Of the grid (ten times as much, and five times the angle, when cross slide and rotary axis both move).
        #[arg(long, default_value_t = 2.0, value_parser = positive, allow_hyphen_values = true)]
        step_mm: f64,
        /// The same for a rotary axis.
        #[arg(long, default_value_t = 1.0, value_parser = positive, allow_hyphen_values = true)]
        step_deg: f64,
        /// Of an evolution; default: drawn, and printed.
        #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 53))]
        seed: Option<u64>,
        /// Count positions outside of the table's box as well.
        #[arg(long)]
        allow_extrapolation: bool,
        /// Folder for placement.json and report.html.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// A tool path that cancels the deflection that the model predicts along it; beside it a plot of the tip's error.
    ///
    /// The machine is led along the path step by step and never changes sides of a singularity. G-code, in mm:
    /// G0 and G1 with X Y Z, the tip in B, and I J K, the tool's axis in B, or A B, the wrist's β1 and β2 in degrees; a comment
    /// (wrench fx,fy,fz,mx,my,mz) sets the load from there on; G0 has none. F S T M N, comments and modes that change nothing
    /// are passed on; arcs, inches, increments, offsets, cycles and all else are refused with their line.
    Compensate {
        /// CSV with x_mm,y_mm,z_mm,i,j,k (tip and axis in B) and fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm (on the tool at the tip, in
        /// the tool's frame), or G-code (.ngc, .nc, .gcode, .cnc, .tap).
        #[arg(long, value_name = "FILE")]
        path: PathBuf,
        /// coefficients.json of `fit`; without it the basic model with the machine file's effects.
        #[arg(long, value_name = "JSON")]
        table: Option<PathBuf>,
        /// For G-code: the cutting load on the tool at its tip, in the tool's frame, N and N·m.
        #[arg(long, value_parser = list::<6>, allow_hyphen_values = true, value_name = "FX,FY,FZ,MX,MY,MZ")]
        wrench: Option<[f64; 6]>,
        /// Cuts are divided so that from point to point the tip goes no farther than this and the axis (or a wrist's joint)
        /// turns by no more than 1°. Default: 2 for G-code; a CSV keeps its rows as they are unless this is given.
        #[arg(long, value_parser = finite, allow_hyphen_values = true, value_name = "MM")]
        step_mm: Option<f64>,
        /// Lets points pass that lie outside the table's box, and says so in the file.
        #[arg(long)]
        allow_extrapolation: bool,
        /// File to write, in the path's format; the plot goes to the same name with .svg.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Stiffness by finite elements: the machine in solids at each pose, computed by CalculiX, which must be installed.
    ///
    /// Writes the stiffness CSV, and beside it a manifest (.manifest.json) and a page with a drawing of the machine (.html).
    /// What the solids are made of stands in the machine file's section [solid], all of which has defaults. A run that was
    /// interrupted goes on when it is started again.
    Fem(FemArgs),
    /// Drives firmware that runs the core (pkm-fw's `cyclic`) and compares every bit with the host.
    Hil {
        /// Serial port of the board, such as /dev/ttyACM0.
        #[arg(long, value_name = "PORT", required_unless_present = "qemu", conflicts_with = "qemu")]
        port: Option<String>,
        /// Bits a second of the port.
        #[arg(long, default_value_t = 115_200, requires = "port")]
        baud: u32,
        /// Start QEMU with the firmware.
        #[arg(long)]
        qemu: bool,
        /// The firmware for QEMU.
        #[arg(long, value_name = "ELF", requires = "qemu", default_value = hil::DEFAULT_ELF)]
        elf: PathBuf,
        /// QEMU's machine.
        #[arg(long, value_name = "NAME", requires = "qemu", default_value = "mps2-an386")]
        board: String,
        /// Poses to draw: half of them computed in f32, half in f64.
        #[arg(long, default_value_t = 2000)]
        poses: u64,
        /// Poses a command: more than one makes sweeps from pose to pose, answered by a checksum of all results, for long runs.
        #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
        steps: u32,
        /// Repeats a run; default: drawn, and printed.
        #[arg(long)]
        seed: Option<u64>,
        /// coefficients.json of the firmware's table; default: the reference machine's.
        #[arg(long, value_name = "JSON")]
        table: Option<PathBuf>,
        /// Folder for hil.json.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Completions for a shell, on standard output.
    Completions {
        /// For which.
        shell: clap_complete::Shell,
    },
    /// Manual pages: one of the program and one of each command.
    Man {
        /// Folder for pkm-host.1, pkm-host-fit.1 and so on.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

#[derive(Args)]
struct IkArgs {
    /// θ in °, about y of B, within ±90.
    #[arg(long, required_unless_present_any = ["tip_mm", "axis"], value_parser = finite, allow_hyphen_values = true)]
    theta_deg: Option<f64>,
    /// σ in °, about u, within ±90.
    #[arg(long, required_unless_present_any = ["tip_mm", "axis"], value_parser = finite, allow_hyphen_values = true)]
    sigma_deg: Option<f64>,
    /// Height of A over B in mm, above 0.
    #[arg(long, required_unless_present_any = ["tip_mm", "axis"], value_parser = finite, allow_hyphen_values = true)]
    z0_mm: Option<f64>,
    /// The tool's tip in B in mm, in place of a pose.
    #[arg(
        long,
        requires = "axis",
        conflicts_with_all = ["theta_deg", "sigma_deg", "z0_mm"],
        value_parser = list::<3>,
        allow_hyphen_values = true,
        value_name = "X,Y,Z"
    )]
    tip_mm: Option<[f64; 3]>,
    /// The tool's axis in B, from the flange toward the tip, of any length.
    #[arg(long, requires = "tip_mm", value_parser = list::<3>, allow_hyphen_values = true, value_name = "I,J,K")]
    axis: Option<[f64; 3]>,
    /// q1,q2,q3 in mm and β1,β2 in °: of several ways to hold the tool on the home side the nearest to it (θ, σ, β1, β2 in rad
    /// and Z0 as a share of home's); default: the zero pose, Z0 in the middle of the box.
    #[arg(
        long,
        requires = "tip_mm",
        value_parser = list::<5>,
        allow_hyphen_values = true,
        value_name = "Q1,Q2,Q3,B1,B2"
    )]
    near: Option<[f64; 5]>,
    /// Every way to hold the tool within travel and limits, on either side of the singular surface.
    #[arg(long, requires = "tip_mm")]
    all: bool,
}

#[derive(Args)]
struct FemArgs {
    /// CSV with pose,theta_deg,sigma_deg,z0_mm or pose,q1_mm,q2_mm,q3_mm.
    #[arg(long, value_name = "CSV", required_unless_present = "loads", conflicts_with = "loads")]
    poses: Option<PathBuf>,
    /// Stiffness CSV to write, 21 columns.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
    /// Changes the machine file for this run, e.g. solid.limb=uniform, solid.platform.kind=rigid,
    /// solid.platform.thickness_mm=30, solid.nut.axial_n_per_m=[1e9,7e8,1e9], solid.offset_mm=[20,20,20],
    /// limb.2.platform_joint.linear_n_per_m=[1e8,1e8,1e8]. May be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Size of the elements, relative to the usual: 0.5 is twice as fine.
    #[arg(long, default_value_t = 1.0, value_parser = mesh_size, allow_hyphen_values = true)]
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
    #[arg(long, default_value_t = 500.0, value_parser = positive, requires = "readings", conflicts_with = "loads")]
    force_n: f64,
    /// Greatest moment of the default loads.
    #[arg(long, default_value_t = 50.0, value_parser = positive, requires = "readings", conflicts_with = "loads")]
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
    /// Of the errors; default: drawn, and printed.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 53), requires = "readings")]
    seed: Option<u64>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Emit {
    /// For Slurm.
    Slurm,
}

#[derive(Args)]
struct TableArgs {
    /// coefficients.json of `fit`; without it the basic model.
    #[arg(long, value_name = "JSON")]
    table: Option<PathBuf>,
    /// How the table is applied.
    #[arg(long, value_enum, default_value = "auto")]
    form: Form,
}

fn mesh_size(text: &str) -> std::result::Result<f64, String> {
    finite(text)
        .and_then(|v| if (0.1..=5.0).contains(&v) { Ok(v) } else { Err("expected a number from 0.1 to 5".into()) })
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    finite(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("expected a number above 0".into()) })
}

fn finite(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err("expected a finite number".into()),
    }
}

fn list<const N: usize>(text: &str) -> std::result::Result<[f64; N], String> {
    let values = text.split(',').map(|t| finite(t.trim())).collect::<std::result::Result<Vec<_>, _>>()?;
    values.try_into().map_err(|v: Vec<f64>| format!("expected {N} numbers with commas between, found {}", v.len()))
}

fn completions(shell: clap_complete::Shell) -> Result<Output> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "pkm-host", &mut script);
    let text = String::from_utf8(script).map_err(|e| Failure::other(e.to_string()))?;
    let json = json!({ "shell": shell.to_string(), "script": &text });
    Output::new(text, &json)
}

fn man(out: &Path) -> Result<Output> {
    let mut program = Cli::command().disable_help_subcommand(true);
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
    Output::new(text, &json!({ "files": pages.iter().map(|(name, _)| name).collect::<Vec<_>>() }))
}

fn run(cli: &Cli) -> Result<Output> {
    let machine = cli.machine.as_deref();
    match &cli.command {
        Command::Ik(IkArgs { theta_deg: Some(theta_deg), sigma_deg: Some(sigma_deg), z0_mm: Some(z0_mm), .. }) => {
            ik::ik(machine, *theta_deg, *sigma_deg, *z0_mm)
        }
        Command::Ik(IkArgs { tip_mm: Some(tip_mm), axis: Some(axis), near, all, .. }) => {
            ik::of_tool(machine, *tip_mm, *axis, *near, *all)
        }
        Command::Ik(_) => Err(Failure::usage("give a pose or a tool, see --help")),
        Command::Fk { q_mm, beta_deg } => ik::fk(machine, *q_mm, *beta_deg),
        Command::Stiffness { poses, table, out } => {
            commands::stiffness(machine, poses, table.table.as_deref(), table.form, out.as_deref())
        }
        Command::Predict { data, table, out } => {
            commands::predict(machine, data.as_deref(), table.table.as_deref(), table.form, out)
        }
        Command::Plan { kind, pose_box, data, out } => {
            let pose_box = pose_box.map(|b| PoseBox::from([[b[0], b[1]], [b[2], b[3]], [b[4], b[5]]]));
            if let Some(b) = pose_box.filter(|b| b.ranges().iter().any(|[low, high]| low >= high)) {
                return Err(Failure::usage(format!("--box: expected least,greatest of each, found {:?}", b.ranges())));
            }
            commands::plan(machine, kind, pose_box, data.as_deref(), out)
        }
        Command::Diagnose { data, holdout, out } => {
            commands::diagnose(machine, data.as_deref(), holdout.as_deref(), out)
        }
        Command::Map { table, sigma_deg, x0_mm, z0_mm, step_mm, out } => {
            for (option, range) in [("--x0-mm", x0_mm), ("--z0-mm", z0_mm)] {
                if let Some([low, high]) = range.filter(|[low, high]| low >= high || low.abs().max(high.abs()) > 1e6) {
                    let message = format!("{option}: expected least,greatest within ±1e6 mm, found {low:?},{high:?}");
                    return Err(Failure::usage(message));
                }
            }
            if let Some(step) = step_mm.filter(|step| *step <= 0.0) {
                return Err(Failure::usage(format!("--step-mm: expected a number above 0, found {step}")));
            }
            for (i, sigma) in sigma_deg.iter().enumerate() {
                if sigma.abs() >= 90.0 || sigma_deg[..i].contains(sigma) {
                    let message = format!("--sigma-deg: expected different angles within ±90, found {sigma}");
                    return Err(Failure::usage(message));
                }
            }
            let window = Window { x0_mm: *x0_mm, z0_mm: *z0_mm, step_mm: *step_mm };
            commands::map(machine, table.table.as_deref(), table.form, sigma_deg, &window, out)
        }
        Command::Compensate { path, table, wrench, step_mm, allow_extrapolation, out } => {
            let (wrench, step_mm, allow_extrapolation) = (*wrench, *step_mm, *allow_extrapolation);
            let table = table.as_deref();
            let request = Request { machine, table, path, wrench, step_mm, allow_extrapolation, out };
            commands::compensate(&request)
        }
        Command::Fem(a) => {
            let mode = match (a.dry_run, a.emit, a.collect) {
                (true, ..) => fem::Mode::DryRun,
                (_, Some(Emit::Slurm), _) => fem::Mode::EmitSlurm,
                (_, _, true) => fem::Mode::Collect,
                _ => fem::Mode::Run,
            };
            if a.noise.iter().chain(&a.zero).any(|v| *v < 0.0) {
                return Err(Failure::usage("--noise, --zero: expected standard deviations of at least 0"));
            }
            let readings = a.readings.as_deref().map(|out| fem::readings::Wish {
                out,
                loads: a.loads.as_deref(),
                force_n: a.force_n,
                moment_nm: a.moment_nm,
                repeats: a.repeats,
                noise: a.noise,
                zero: a.zero,
                seed: a.seed.unwrap_or_else(|| fastrand::u64(..1 << 53)),
            });
            // it runs in other folders than this one
            let named = a.ccx.components().count() > 1;
            let ccx = std::path::absolute(&a.ccx).ok().filter(|_| named).unwrap_or_else(|| a.ccx.clone());
            let cores = || std::thread::available_parallelism().map_or(1, usize::from);
            let request = fem::Request {
                poses: a.poses.as_deref(),
                out: &a.out,
                set: &a.set,
                size: a.mesh,
                jobs: a.jobs.map_or_else(cores, |n| n as usize),
                ccx: &ccx,
                work: a.work.as_deref(),
                keep: a.keep,
                mode,
                readings,
            };
            fem::fem(machine, &request)
        }
        Command::Hil { port, baud, qemu: _, elf, board, poses, steps, seed, table, out } => {
            let target = match port {
                Some(name) => Target::Port { name: name.clone(), baud: *baud },
                None => Target::Qemu { board: board.clone(), elf: elf.clone() },
            };
            let seed = seed.unwrap_or_else(|| fastrand::u64(..));
            commands::hil(machine, table.as_deref(), &target, seed, *poses, *steps, out.as_deref())
        }
        Command::Place { job, table, objective, method, step_mm, step_deg, seed, allow_extrapolation, out } => {
            let ask = commands::PlaceOptions {
                objectives: objective,
                method: *method,
                step_mm: *step_mm,
                step_deg: *step_deg,
                seed: seed.unwrap_or_else(|| fastrand::u64(..1 << 53)),
                extrapolate: *allow_extrapolation,
            };
            commands::place(machine, job.as_deref(), table.table.as_deref(), table.form, &ask, out)
        }
        Command::Fit { data, verify, terms, out } => {
            commands::fit(machine, data.as_deref(), verify.as_deref(), *terms, out)
        }
        Command::Completions { shell } => completions(*shell),
        Command::Man { out } => man(out),
    }
}

fn main() -> ExitCode {
    let wants_json = std::env::args_os().any(|a| a == "--json");
    let result = match Cli::try_parse() {
        Ok(cli) => run(&cli),
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => e.exit(),
        // what is endless is clipped below
        Err(e) if !wants_json && e.to_string().len() < 4000 => e.exit(),
        Err(e) => {
            let text = e.to_string();
            let first = text.split("\n\n").next().unwrap_or("").trim_start_matches("error: ");
            Err(Failure::usage(first.split_whitespace().collect::<Vec<_>>().join(" ")))
        }
    };
    let printed = result.and_then(|output| {
        let text = if wants_json { format!("{}\n", output.json) } else { output.text };
        match std::io::stdout().lock().write_all(text.as_bytes()) {
            // a reader that closes the pipe early is no failure
            Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
                Err(Failure::other(format!("standard output: {e}")))
            }
            _ => Ok(()),
        }
    });
    if let Err(failure) = printed {
        eprintln!("error: {failure}");
        if wants_json {
            // nothing is left to tell when standard output itself failed
            drop(writeln!(std::io::stdout().lock(), "{}", failure.to_json()));
        }
        return ExitCode::from(failure.exit_code());
    }
    ExitCode::SUCCESS
}

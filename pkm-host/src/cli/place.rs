//! `place`: where the workpiece should stand.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::{DateArgs, TableArgs, positive};
use super::bar::bar;
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::files::job::Job;
use crate::files::limits::JointLimits;
use crate::files::source::{self, Source};
use crate::plan::model::Form;
use crate::plan::place::{self, Limits, Method, Objective, Options, PlacementModel};
use crate::report::place as report;

/// Puts the workpiece where the machine is stiff: the best position of a cross slide, a rotary axis, or both, for each
/// series of holes, and one for all of them where the job says `together = true`. Where the
/// job says under `robust` what is not sure, also where the worst case is least.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The job (TOML), its loads on the tool at the tip in the tool's axes (z along the tool); default, for the reference
    /// machine alone: the case study of fixtures/jobs.
    #[arg(long, value_name = "TOML")]
    job: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
    /// What should be small; several may be given. Default: paper and tip-worst.
    #[arg(long, value_enum, num_args = 1..)]
    objective: Vec<Objective>,
    /// How the optimum is searched for; a grid is computed in any case. Default: grid, and de when cross slide and rotary axis
    /// both move.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// For `certified`: by how much another position may be better, in % of the optimum, when the search ends. Default: 0.1,
    /// and 0.5 when cross slide and rotary axis both move; 1 for points of a front.
    #[arg(long, value_name = "PERCENT", value_parser = positive, allow_hyphen_values = true)]
    gap: Option<f64>,
    /// For `certified`: cells of positions that are looked at, at the most, for an optimum or a front; then the search ends with the gap that it has.
    /// Default: 400000.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    max_cells: Option<u32>,
    /// Grid spacing in mm; ten times coarser when cross slide and rotary axis both move. Default: 2, and 10 for `certified`, which
    /// needs it for the map alone.
    #[arg(long, value_parser = positive, allow_hyphen_values = true)]
    step_mm: Option<f64>,
    /// Grid spacing of a rotary axis in °; five times coarser when a cross slide moves too. Default: 1.
    #[arg(long, value_parser = positive, allow_hyphen_values = true)]
    step_deg: Option<f64>,
    /// Random seed for `ga` and `de`; default: random, printed.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 53))]
    seed: Option<u64>,
    /// Also a Pareto front for each series: how much tip deflection (tip-worst) a better value of this objective takes, each point
    /// with a proof. Takes `--method certified`, the default then.
    #[arg(long, value_enum, value_name = "OBJECTIVE")]
    pareto: Option<Objective>,
    /// Points of the front, at the most.
    #[arg(long, requires = "pareto", default_value_t = 10, value_parser = clap::value_parser!(u8).range(2..=100))]
    points: u8,
    /// For `cycle-time`: greatest velocity and acceleration of each joint, TOML, as for `compensate`.
    #[arg(long, value_name = "TOML")]
    limits: Option<PathBuf>,
    /// Count positions outside of the table's box as well.
    #[arg(long)]
    allow_extrapolation: bool,
    #[command(flatten)]
    date: DateArgs,
    /// Folder for placement.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// What is asked for, each once.
fn objectives(args: &Args) -> Result<Vec<Objective>> {
    let mut objectives: Vec<Objective> = Vec::new();
    let ends = args.pareto.map(|other| [other, Objective::TipWorst]);
    if ends.is_some_and(|[other, tip]| other == tip) {
        return Err(Failure::usage(
            "--pareto tip-worst: the front is of tip-worst against another objective: give that one",
        ));
    }
    for objective in args.objective.iter().chain(ends.iter().flatten()) {
        if !objectives.contains(objective) {
            objectives.push(*objective);
        }
    }
    if objectives.is_empty() {
        objectives = vec![Objective::Paper, Objective::TipWorst];
    }
    Ok(objectives)
}

fn limits(args: &Args, objectives: &[Objective]) -> Result<Option<JointLimits>> {
    if args.limits.is_some() && !objectives.contains(&Objective::CycleTime) {
        return Err(Failure::usage("--limits is for cycle times: add --pareto cycle-time or --objective cycle-time"));
    }
    let limits = args.limits.as_deref().map(Source::read).transpose()?;
    limits.as_ref().map(JointLimits::parse).transpose()
}

fn method(args: &Args, job: &Job) -> Method {
    let usual = if args.pareto.is_some() {
        Method::Certified
    } else if job.slides_and_turns() {
        Method::De
    } else {
        Method::Grid
    };
    args.method.unwrap_or(usual)
}

/// What a method can't do for a job.
fn refused(args: &Args, method: Method, objectives: &[Objective], placement: &PlacementModel<'_>) -> Result<()> {
    let (job, is_proof) = (placement.job, method == Method::Certified);
    if args.pareto.is_some() {
        let unsure = job.robust.is_some();
        let why = (!is_proof).then_some("it is a proof: give --method certified, or leave it out");
        let why = why.or(unsure.then_some("it is without uncertainty: leave `robust` out of the job"));
        if let Some(why) = why {
            return Err(Failure::usage(format!("--pareto: {why}")));
        }
    }
    if is_proof && let Some(why) = placement.why_not_certified() {
        let asked = if args.method.is_some() { "--method certified" } else { "--pareto takes --method certified" };
        return Err(Failure::usage(format!("{asked}: {why}")));
    }
    if job.robust.is_some() {
        let certified = (!is_proof).then_some("it is a proof: give --method certified, or leave it out");
        let judged = !objectives.contains(&Objective::TipWorst);
        let judged = judged.then_some("it is about deflections: add --objective tip-worst, or leave it out");
        if let Some(why) = certified.or(judged).or(placement.why_not_robust()) {
            return Err(Failure::input(why).in_file(&job.source.name).at_column("robust"));
        }
    }
    Ok(())
}

/// Options that the method has no use for.
fn idle(args: &Args, method: Method, placement: &PlacementModel<'_>) -> impl Iterator<Item = String> {
    let is_proof = method == Method::Certified;
    let is_random = matches!(method, Method::Ga | Method::De);
    let idle = [
        (args.gap.is_some() && !is_proof).then_some("--gap has no part here: it is for --method certified"),
        (args.seed.is_some() && !is_random).then_some("--seed has no part here: it is for --method ga and de"),
        (args.max_cells.is_some() && !is_proof).then_some("--max-cells has no part here: it is for --method certified"),
        (args.step_deg.is_some() && placement.job.rotary.is_none())
            .then_some("--step-deg has no part here: the job has no rotary axis"),
        (args.allow_extrapolation && placement.table.is_none())
            .then_some("--allow-extrapolation has no part here: no table says where it ends"),
    ];
    idle.into_iter().flatten().map(str::to_owned)
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let model = session.model(&args.table)?;
    let job = session.read_or_fixture(args.job.as_deref(), pkm_fixtures::JOB, "--job", &model.machine)?;
    let job = Job::parse(&job)?;
    session.warn(model.machine.wrist_warning());
    let objectives = objectives(args)?;
    let table = model.table.as_ref().map(|t| (&t.numbers, t.form == Form::Diagonal));
    let limits = limits(args, &objectives)?;
    let placement = PlacementModel::new(&model.machine, table, &job, &objectives, args.allow_extrapolation, limits)?;
    let method = method(args, &job);
    refused(args, method, &objectives, &placement)?;
    session.warn(idle(args, method, &placement));
    let cells = args.max_cells.unwrap_or(400_000) as usize;
    let usual_gap = if job.slides_and_turns() { 0.5 } else { 0.1 };
    let usual_step = if method == Method::Certified { 10.0 } else { 2.0 };
    let options = Options {
        method,
        step_m: args.step_mm.unwrap_or(usual_step) / 1e3,
        step_rad: args.step_deg.unwrap_or(1.0).to_radians(),
        limits: Limits { gap: args.gap.unwrap_or(usual_gap) / 100.0, cells },
        seed: args.seed.unwrap_or_else(|| fastrand::u64(..1 << 53)),
        front: args.pareto.map(|other| {
            let points = usize::from(args.points);
            // as many cells for the whole front as for one optimum
            (other, points, Limits { gap: args.gap.unwrap_or(1.0) / 100.0, cells: cells / points })
        }),
    };
    let placed = place::place(&placement, &objectives, &options, &bar())?;
    let mut json = report::document(&placement, &options, &placed);
    let table_source = model.table.as_ref().map(|t| &t.source);
    json["table_sha256"] = json!(table_source.map(Source::sha256));
    let html = args.date.of(report::html(&placement, table_source, &options, &placed, &session.warnings)?);
    let inputs = [session.machine_path(), args.job.as_deref(), args.table.table.as_deref(), args.limits.as_deref()];
    let files = [("placement.json", source::json(&json)), ("report.html", html)];
    let wrote = source::write_all(&args.out, &files, &inputs)?;
    session.output(report::text(&placement, &options, &placed) + &wrote, &json)
}

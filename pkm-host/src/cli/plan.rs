//! `plan`: poses to measure or compute at; with loads where the plan is to tell rivals apart.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::ColumnsArgs;
use super::arguments::list;
use super::bar::bar;
use super::session::{Output, Session};
use crate::diagnose::{self, Method, design::Proposal};
use crate::error::{Failure, Result};
use crate::files::dataset::{self, DEFLECTION_COLUMNS, POSE_COLUMNS, WRENCH_COLUMNS};
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;
use crate::files::source;
use crate::plan::poses::{self, PlanKind};
use crate::pose::PoseBox;

/// Poses to measure or to compute finite elements at.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// l49, l49-balanced, verify, levels N (N² poses, N from 4 to 50), or discriminate: poses and loads that best
    /// tell apart what --data leave undecided.
    #[arg(long, num_args = 1..=2, required = true, allow_negative_numbers = true, value_name = "KIND")]
    kind: Vec<String>,
    /// θ, σ in ° and Z0 in mm, least and greatest of each; default: the machine's box.
    #[arg(long = "box", value_parser = list::<6>, allow_hyphen_values = true, value_name = "T0,T1,S0,S1,Z0,Z1")]
    pose_box: Option<[f64; 6]>,
    /// Measured data, also as exported, for discriminate; default, for the reference machine alone: simulated readings.
    #[arg(long, value_name = "CSV")]
    data: Option<PathBuf>,
    #[command(flatten)]
    columns: ColumnsArgs,
    /// CSV to write.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let Args { kind, pose_box, data, columns: _, out } = args;
    let pose_box = pose_box.map(|b| PoseBox::from([[b[0], b[1]], [b[2], b[3]], [b[4], b[5]]]));
    if let Some(b) = pose_box.filter(|b| b.ranges().iter().any(|[low, high]| low >= high)) {
        return Err(Failure::usage(format!("--box: expected least,greatest of each, found {:?}", b.ranges())));
    }
    let kind = PlanKind::parse(kind)?;
    let mut machine = session.machine()?;
    machine.pose_box = pose_box.unwrap_or(machine.pose_box);
    let mut header = POSE_COLUMNS.map(str::to_owned).to_vec();
    let mut separates = Vec::new();
    let rows: Vec<Vec<String>> = if kind == PlanKind::Discriminate {
        // with cells to write the readings in
        header.extend(WRENCH_COLUMNS.into_iter().chain(DEFLECTION_COLUMNS).map(str::to_owned));
        let proposals = proposals(args, &machine, session)?;
        separates = proposals.iter().map(|p| p.separates.clone()).collect();
        proposals.iter().enumerate().map(proposal_row).collect()
    } else {
        if data.is_some() {
            return Err(Failure::usage("--data goes with --kind discriminate alone"));
        }
        let poses = poses::plan(kind, &machine)?;
        poses.iter().map(|p| [p.id.clone()].into_iter().chain(dataset::pose_cells(&p.pose)).collect()).collect()
    };
    let count = rows.len();
    source::write(out, dataset::to_csv(b',', &header, rows), &[session.machine_path(), data.as_deref()])?;
    let mut text = format!("wrote {count} poses to {}\n", out.display());
    for (n, [a, b]) in separates.iter().enumerate() {
        text.push_str(&format!("  N{:02} tells {a} from {b}\n", n + 1));
    }
    session.output(text, &json!({ "poses": count, "separates": separates, "out": out.display().to_string() }))
}

/// What a diagnosis of the readings would measure next.
fn proposals(args: &Args, machine: &MachineFile, session: &mut Session) -> Result<Vec<Proposal>> {
    let source = session.read_or_fixture(args.data.as_deref(), pkm_fixtures::MEASURED, "--data", machine)?;
    let readings = Readings::read_renamed(source, machine, &args.columns.renames())?;
    session.warn(readings.warnings.clone());
    let diagnosis = diagnose::diagnose(machine, &readings, None, Method::Formulas, &bar())?;
    if diagnosis.proposals.is_empty() {
        let message = "these readings leave no two rivals to tell apart";
        return Err(Failure::other(message).in_file(readings.source.name));
    }
    Ok(diagnosis.proposals)
}

fn proposal_row((n, p): (usize, &Proposal)) -> Vec<String> {
    let load = <[f64; 6]>::from(p.wrench.to_vector()).map(|v| v.to_string());
    let load = load.into_iter().chain(DEFLECTION_COLUMNS.map(|_| String::new()));
    [format!("N{:02}", n + 1)].into_iter().chain(dataset::pose_cells(&p.pose)).chain(load).collect()
}

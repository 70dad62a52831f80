//! `plan`: poses to measure or compute at; with loads where the plan is to tell rivals apart.

use std::collections::BTreeSet;
use std::path::PathBuf;

use serde_json::json;

use super::arguments::{ColumnsArgs, list, within};
use super::bar::bar;
use super::session::{Output, Session, counted};
use crate::diagnose::badges::{Badge, Grade};
use crate::diagnose::campaign::{self, Means, Stated};
use crate::diagnose::{self, Method, Rules, design::Proposal, quality};
use crate::error::{Failure, Result};
use crate::files::dataset::{self, DEFLECTION_COLUMNS, POSE_COLUMNS, WRENCH_COLUMNS};
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;
use crate::files::source;
use crate::plan::poses::{self, PlanKind};
use crate::pose::PoseBox;

/// What a campaign may do.
#[derive(clap::Args)]
struct CampaignArgs {
    /// For campaign: one standard deviation of a reading of translation, its zero reading included.
    #[arg(long, value_name = "µM", value_parser = within(0.001, 10_000.0), allow_hyphen_values = true)]
    sigma_um: Option<f64>,
    /// For campaign: the same of rotation; without it rotations are not read.
    #[arg(long, value_name = "µRAD", value_parser = within(0.001, 10_000.0), allow_hyphen_values = true)]
    sigma_urad: Option<f64>,
    /// For campaign: largest force that is applied; default 200.
    #[arg(long, value_name = "N", value_parser = within(1.0, 100_000.0), allow_hyphen_values = true)]
    force_n: Option<f64>,
    /// For campaign: distance from A at which a force makes a moment; 0 for no moments; default 200.
    #[arg(long, value_name = "MM", value_parser = within(0.0, 10_000.0), allow_hyphen_values = true)]
    lever_mm: Option<f64>,
    /// For campaign: most poses; default 20.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(4..=75), allow_hyphen_values = true)]
    most_poses: Option<u16>,
    /// For campaign: an amplitude to be found, in SI units, such as limb-1-axial.axial_m_per_n=2e-10; may be repeated. Default:
    /// every effect at its plausible size.
    #[arg(long, value_name = "EFFECT.PARAMETER=SIZE")]
    detect: Vec<Stated>,
}

impl CampaignArgs {
    /// The first option that is given.
    fn given(&self) -> Option<&'static str> {
        [
            ("--sigma-um", self.sigma_um.is_some()),
            ("--sigma-urad", self.sigma_urad.is_some()),
            ("--force-n", self.force_n.is_some()),
            ("--lever-mm", self.lever_mm.is_some()),
            ("--most-poses", self.most_poses.is_some()),
            ("--detect", !self.detect.is_empty()),
        ]
        .into_iter()
        .find_map(|(option, is_given)| is_given.then_some(option))
    }
}

/// Poses to measure or to compute finite elements at.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// l49, l49-balanced, verify, levels N (N² poses, N from 4 to 50); discriminate: poses and loads that best tell apart
    /// what --data leave undecided; campaign: what to measure before anything is read, so that effects are found.
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
    /// For discriminate (default 1) and campaign (default 2): series at each pose, each with a zero reading of its own.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=20), allow_hyphen_values = true)]
    series: Option<u16>,
    /// For discriminate and campaign: readings of each load in a series; default 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=20), allow_hyphen_values = true)]
    repeats: Option<u16>,
    #[command(flatten)]
    campaign: CampaignArgs,
    /// CSV to write.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

/// Refuses options of another kind of plan.
fn check_options(args: &Args, kind: PlanKind) -> Result<()> {
    let has_loads = matches!(kind, PlanKind::Discriminate | PlanKind::Campaign);
    let alone = |option: &str, kinds: &str| Err(Failure::usage(format!("{option} goes with --kind {kinds} alone")));
    match args.campaign.given() {
        Some(option) if kind != PlanKind::Campaign => return alone(option, "campaign"),
        _ => {}
    }
    if args.data.is_some() && kind != PlanKind::Discriminate {
        return alone("--data", "discriminate");
    }
    for (option, is_given) in [("--series", args.series.is_some()), ("--repeats", args.repeats.is_some())] {
        if is_given && !has_loads {
            return alone(option, "discriminate or campaign");
        }
    }
    Ok(())
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let Args { kind, pose_box, .. } = args;
    let pose_box = pose_box.map(|b| PoseBox::from([[b[0], b[1]], [b[2], b[3]], [b[4], b[5]]]));
    let ranges = pose_box.iter().flat_map(|b| ["θ", "σ", "Z0"].into_iter().zip(b.ranges()));
    if let Some((name, [low, high])) = ranges.into_iter().find(|(_, [low, high])| low >= high) {
        return Err(Failure::usage(format!("--box: expected least,greatest of each, found {low},{high} of {name}")));
    }
    let kind = PlanKind::parse(kind)?;
    check_options(args, kind)?;
    let mut machine = session.machine()?;
    machine.pose_box = pose_box.unwrap_or(machine.pose_box);
    match kind {
        PlanKind::Campaign => return run_campaign(args, &machine, session),
        PlanKind::Discriminate => return run_discriminate(args, &machine, session),
        _ => {}
    }
    let header = POSE_COLUMNS.map(str::to_owned);
    let rows: Vec<Vec<String>> = (poses::plan(kind, &machine)?.iter())
        .map(|p| [p.id.clone()].into_iter().chain(dataset::pose_cells(&p.pose)).collect())
        .collect();
    let (count, out) = (rows.len(), args.out.display().to_string());
    source::write(&args.out, dataset::to_csv(b',', &header, rows), &[session.machine_path()])?;
    let text = format!("wrote {count} poses to {out}\n");
    let document = json!({ "poses": count, "readings": null, "separates": [], "measurement": null, "out": out });
    session.output(text, &document)
}

fn run_discriminate(args: &Args, machine: &MachineFile, session: &mut Session) -> Result<Output> {
    let (measurement, poses) = proposals(args, machine, session)?;
    let (header, rows) = sheet(args, &poses);
    let (readings, out) = (rows.len(), args.out.display().to_string());
    source::write(&args.out, dataset::to_csv(b',', &header, rows), &[session.machine_path(), args.data.as_deref()])?;
    let mut text = check_first(&measurement);
    text.push_str(&format!("wrote {} at {} to {out}\n", counted(readings, "reading"), counted(poses.len(), "pose")));
    for (n, loads) in poses.iter().enumerate() {
        let pairs: BTreeSet<&[String; 2]> = loads.iter().map(|p| &p.separates).collect();
        pairs.iter().for_each(|[a, b]| text.push_str(&format!("  {} tells {a} from {b}\n", pose_name(n))));
    }
    let separates: Vec<&[String; 2]> = poses.iter().flatten().map(|p| &p.separates).collect();
    let document = json!({ "poses": poses.len(), "readings": readings, "separates": separates, "measurement": measurement,
        "out": out });
    session.output(text, &document)
}

/// What is wrong with the readings that a plan stands on.
fn check_first(measurement: &Badge) -> String {
    if measurement.grade == Grade::Good {
        return String::new();
    }
    let reasons: String = measurement.reasons.iter().map(|reason| format!("  - {reason}\n")).collect();
    format!("The measurement is {}, and what follows stands on it. Check first:\n{reasons}", measurement.verdict)
}

/// What a pose is called in the file.
fn pose_name(n: usize) -> String {
    format!("N{:02}", n + 1)
}

/// The file to write the readings in: at every pose each series goes through all of its loads.
fn sheet(args: &Args, poses: &[Vec<Proposal>]) -> (Vec<String>, Vec<Vec<String>>) {
    let columns = POSE_COLUMNS.into_iter().chain(WRENCH_COLUMNS).chain(DEFLECTION_COLUMNS);
    let header = columns.chain(["series", "repeat", "direction"]).map(str::to_owned).collect();
    let (series, repeats) = (args.series.unwrap_or(1), args.repeats.unwrap_or(1));
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (n, loads) in poses.iter().enumerate() {
        for s in 0..series {
            for (load, r) in loads.iter().flat_map(|load| (0..repeats).map(move |r| (load, r))) {
                let mut row = vec![pose_name(n)];
                row.extend(dataset::pose_cells(&load.pose));
                row.extend(<[f64; 6]>::from(load.wrench.to_vector()).map(|v| v.to_string()));
                row.extend(DEFLECTION_COLUMNS.map(|_| String::new()));
                // no series of the data that it may be put behind has such a name
                row.push(format!("{}-{}", pose_name(n), s + 1));
                row.extend([(s * repeats + r + 1).to_string(), "load".to_owned()]);
                rows.push(row);
            }
        }
    }
    (header, rows)
}

fn run_campaign(args: &Args, machine: &MachineFile, session: &mut Session) -> Result<Output> {
    let own = &args.campaign;
    let Some(sigma_um) = own.sigma_um else {
        return Err(Failure::usage("--kind campaign needs --sigma-um: one standard deviation of a reading, in µm"));
    };
    let means = Means {
        force_n: own.force_n.unwrap_or(200.0),
        lever_m: 1e-3 * own.lever_mm.unwrap_or(200.0),
        sigma_m: 1e-6 * sigma_um,
        sigma_rad: own.sigma_urad.map(|s| 1e-6 * s),
        repeats: args.repeats.map_or(1, usize::from),
        series: args.series.map_or(2, usize::from),
        poses: own.most_poses.map_or(20, usize::from),
    };
    if means.repeats * means.series == 1 {
        session.warn(["nothing is read twice: the noise will have to be the declared one".to_owned()]);
    }
    let campaign = campaign::plan(machine, &means, &own.detect)?;
    source::write(&args.out, campaign.csv.clone(), &[session.machine_path()])?;
    let (poses, readings) = campaign.size;
    let mut text = format!("wrote {readings} readings at {poses} poses to {}\n", args.out.display());
    campaign.shown.iter().for_each(|s| text.push_str(&format!("  {}\n", s.text())));
    let shown: Vec<_> = (campaign.shown.iter())
        .map(|s| {
            let [first, end, grid] = s.smallest;
            json!({ "id": s.stated.id, "parameter": s.stated.parameter, "stated": s.stated.value, "found": s.is_found(),
                "smallest_before": first, "smallest_after": end, "smallest_of_grid": grid })
        })
        .collect();
    let document = json!({ "poses": poses, "readings": readings, "series": means.series, "repeats": means.repeats,
        "force_n": means.force_n, "detectable": shown, "out": args.out.display().to_string() });
    session.output(text, &document)
}

/// What a diagnosis says of the readings, and what it would measure next: by pose, each with at least one load.
fn proposals(args: &Args, machine: &MachineFile, session: &mut Session) -> Result<(Badge, Vec<Vec<Proposal>>)> {
    let source = session.read_or_fixture(args.data.as_deref(), pkm_fixtures::MEASURED, "--data", machine)?;
    let (sheet, readings) = Readings::read_conditions(source, machine, &args.columns.renames())?;
    readings.require_deflections(&sheet)?;
    let name = &readings.source.name;
    session.warn(readings.warnings.clone());
    session.warn(quality::check_rows(&sheet).iter().map(|w| w.text(name)));
    let diagnosis = diagnose::diagnose(machine, &readings, None, Method::Formulas, &Rules::DEFAULT, &bar())?;
    session.warn(diagnosis.warnings.iter().map(|w| format!("{name}: {}", w.message)));
    let measurement = Badge::measurement(&diagnosis);
    if diagnosis.proposals.is_empty() {
        let why = measurement.reasons.first();
        let why = why.map_or(String::new(), |why| format!("; the measurement is {}: {why}", measurement.verdict));
        let message = format!("these readings leave no two rivals to tell apart{why}");
        return Err(Failure::other(message).in_file(readings.source.name));
    }
    let mut poses: Vec<Vec<Proposal>> = Vec::new();
    for proposal in diagnosis.proposals {
        match poses.iter_mut().find(|loads| loads[0].pose == proposal.pose) {
            Some(loads) => loads.push(proposal),
            None => poses.push(vec![proposal]),
        }
    }
    Ok((measurement, poses))
}

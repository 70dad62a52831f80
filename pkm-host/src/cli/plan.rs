//! `plan`: poses to measure or compute at; with loads where the plan is to tell rivals apart.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::{ColumnsArgs, list, within};
use super::bar::bar;
use super::session::{Output, Session};
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
    let Args { kind, pose_box, data, out, .. } = args;
    let pose_box = pose_box.map(|b| PoseBox::from([[b[0], b[1]], [b[2], b[3]], [b[4], b[5]]]));
    let ranges = pose_box.iter().flat_map(|b| ["θ", "σ", "Z0"].into_iter().zip(b.ranges()));
    if let Some((name, [low, high])) = ranges.into_iter().find(|(_, [low, high])| low >= high) {
        return Err(Failure::usage(format!("--box: expected least,greatest of each, found {low},{high} of {name}")));
    }
    let kind = PlanKind::parse(kind)?;
    check_options(args, kind)?;
    let mut machine = session.machine()?;
    machine.pose_box = pose_box.unwrap_or(machine.pose_box);
    if kind == PlanKind::Campaign {
        return run_campaign(args, &machine, session);
    }
    let mut header = POSE_COLUMNS.map(str::to_owned).to_vec();
    let (mut separates, mut measurement) = (Vec::new(), None);
    let rows: Vec<Vec<String>> = if kind == PlanKind::Discriminate {
        // with cells to write the readings in
        header.extend(WRENCH_COLUMNS.into_iter().chain(DEFLECTION_COLUMNS).map(str::to_owned));
        let (badge, proposals) = proposals(args, &machine, session)?;
        measurement = Some(badge);
        separates = proposals.iter().map(|p| p.separates.clone()).collect();
        let rows = proposals.iter().enumerate().map(proposal_row).collect();
        with_repeats(args, &mut header, rows)
    } else {
        let poses = poses::plan(kind, &machine)?;
        poses.iter().map(|p| [p.id.clone()].into_iter().chain(dataset::pose_cells(&p.pose)).collect()).collect()
    };
    let count = if separates.is_empty() { rows.len() } else { separates.len() };
    source::write(out, dataset::to_csv(b',', &header, rows), &[session.machine_path(), data.as_deref()])?;
    let mut text = measurement.as_ref().map_or(String::new(), check_first);
    text.push_str(&format!("wrote {count} poses to {}\n", out.display()));
    for (n, [a, b]) in separates.iter().enumerate() {
        text.push_str(&format!("  N{:02} tells {a} from {b}\n", n + 1));
    }
    let document =
        json!({ "poses": count, "separates": separates, "measurement": measurement, "out": out.display().to_string() });
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

/// Each row in all repeats of all series, where these were asked for.
fn with_repeats(args: &Args, header: &mut Vec<String>, rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    if args.series.is_none() && args.repeats.is_none() {
        return rows;
    }
    header.extend(["series", "repeat"].map(str::to_owned));
    let (series, repeats) = (args.series.unwrap_or(1), args.repeats.unwrap_or(1));
    let mut all = Vec::new();
    for (n, row) in rows.iter().enumerate() {
        for s in 0..series {
            // every pose has series of its own
            let number = n * usize::from(series) + usize::from(s) + 1;
            for r in 0..repeats {
                all.push([row.clone(), vec![number.to_string(), (s * repeats + r + 1).to_string()]].concat());
            }
        }
    }
    all
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

/// What a diagnosis of the readings would measure next, and what it says of them.
fn proposals(args: &Args, machine: &MachineFile, session: &mut Session) -> Result<(Badge, Vec<Proposal>)> {
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
    Ok((measurement, diagnosis.proposals))
}

fn proposal_row((n, p): (usize, &Proposal)) -> Vec<String> {
    let load = <[f64; 6]>::from(p.wrench.to_vector()).map(|v| v.to_string());
    let load = load.into_iter().chain(DEFLECTION_COLUMNS.map(|_| String::new()));
    [format!("N{:02}", n + 1)].into_iter().chain(dataset::pose_cells(&p.pose)).chain(load).collect()
}

//! `ik`: screw lengths of a pose, joint values of a tool.

use pkm_core::{Configuration, JointValues, KinematicsError, Machine, Pose, ScrewLengths, Tool, ToolSolution};
use serde_json::{Value, json};

use super::arguments::{finite, list};
use super::session::{Output, Session};
use crate::error::{Failure, Result, status, tool_status};
use crate::files::path::unit;
use crate::plan::reach::{Reach, shown};
use crate::pose::{file_units, pose_of};

/// Arguments that ask about a tool: a pose is not needed then.
const TOOL: [&str; 4] = ["tip_mm", "axis", "near", "all"];

/// Screw lengths of a pose; or of a tool, with the wrist's joints.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// θ in °, about y of B, within ±90.
    #[arg(long, required_unless_present_any = TOOL, value_parser = finite, allow_hyphen_values = true)]
    theta_deg: Option<f64>,
    /// σ in °, about u, within ±90.
    #[arg(long, required_unless_present_any = TOOL, value_parser = finite, allow_hyphen_values = true)]
    sigma_deg: Option<f64>,
    /// Height of A over B in mm, above 0.
    #[arg(long, required_unless_present_any = TOOL, value_parser = finite, allow_hyphen_values = true)]
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
    /// q1,q2,q3 in mm and β1,β2 in °: of several solutions in the home working mode the nearest to it is taken (θ, σ, β1, β2 in rad
    /// and Z0 as a share of home's); default: the zero pose, Z0 in the middle of the box.
    #[arg(
        long,
        value_parser = list::<5>,
        allow_hyphen_values = true,
        value_name = "Q1,Q2,Q3,B1,B2"
    )]
    near: Option<[f64; 5]>,
    /// Every inverse-kinematics solution within travel and limits, in either working mode, of a tool: with --tip-mm and --axis.
    #[arg(long)]
    all: bool,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    match args {
        Args { tip_mm: Some(tip_mm), axis: Some(axis), .. } => of_tool(session, args, *tip_mm, *axis),
        // clap would put them into one usage line with the pose, which excludes a tool
        Args { all: true, .. } | Args { near: Some(_), .. } => {
            let message = "--all and --near ask about a tool: give it with --tip-mm and --axis, in place of --theta-deg, --sigma-deg and \
                           --z0-mm";
            Err(Failure::usage(message))
        }
        Args { theta_deg: Some(theta_deg), sigma_deg: Some(sigma_deg), z0_mm: Some(z0_mm), .. } => {
            of_pose(session, *theta_deg, *sigma_deg, *z0_mm)
        }
        _ => Err(Failure::usage("give a pose or a tool, see --help")),
    }
}

pub(super) fn refused(e: KinematicsError, what: &str) -> Failure {
    Failure::refused(status(e), format!("{what}: {e}"))
}

/// What the engineer wants to know besides: how far travel and singularities are.
pub(super) fn margins(
    machine: &Machine<f64>,
    pose: &Pose<f64>,
    lengths: &ScrewLengths<f64>,
) -> Result<(Value, String)> {
    let (margin_m, limb) = machine.travel_margin_m(lengths).map_err(|e| refused(e, "travel"))?;
    let distance = machine.singularity_distance(pose).map_err(|e| refused(e, "singularity"))?;
    let json = json!({
        "travel_margin_mm": margin_m * 1e3,
        "travel_margin_limb": limb,
        "singularity_distance": { "limbs_1_2": distance.limbs_1_2, "limb_3": distance.limb_3 },
    });
    let text = format!(
        "travel left: {:.3} mm (limb {}); distance to singularity (0…1): limbs 1 and 2 {:.3}, limb 3 {:.3}\n",
        margin_m * 1e3,
        limb,
        distance.limbs_1_2,
        distance.limb_3
    );
    Ok((json, text))
}

fn of_pose(session: &mut Session, theta_deg: f64, sigma_deg: f64, z0_mm: f64) -> Result<Output> {
    let file = session.machine()?;
    let machine = file.machine;
    let pose = pose_of(theta_deg, sigma_deg, z0_mm);
    let lengths = machine.inverse(&pose).map_err(|e| {
        let why = file.refusal(e, &pose);
        Failure::refused(status(e), format!("θ = {theta_deg}°, σ = {sigma_deg}°, Z0 = {z0_mm} mm: {why}"))
    })?;
    let q_mm: [f64; 3] = (lengths.q_m * 1e3).into();
    let (mut json, margins) = margins(&machine, &pose, &lengths)?;
    json["status"] = "ok".into();
    json["q_mm"] = json!(q_mm);
    session.output(format!("q = {:.4} {:.4} {:.4} mm\n{margins}", q_mm[0], q_mm[1], q_mm[2]), &json)
}

fn solution_json(reach: &Reach<'_>, solution: &ToolSolution<f64>) -> Value {
    let [theta_deg, sigma_deg, z0_mm] = file_units(&solution.configuration.pose);
    let [beta1_deg, beta2_deg] = solution.configuration.beta_rad.map(f64::to_degrees).into();
    let q_mm: [f64; 3] = (solution.joints.lengths.q_m * 1e3).into();
    json!({
        "q_mm": q_mm,
        "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm,
        "beta1_deg": beta1_deg, "beta2_deg": beta2_deg,
        "normalised_determinant": solution.normalised_determinant,
        "clear_of_singularity": solution.normalised_determinant >= reach.margin(),
    })
}

fn in_words(solution: &ToolSolution<f64>) -> String {
    let q = solution.joints.lengths.q_m * 1e3;
    let [theta, sigma, z0] = file_units(&solution.configuration.pose);
    let [beta1, beta2] = solution.configuration.beta_rad.map(f64::to_degrees).into();
    format!(
        "q = {:.4} {:.4} {:.4} mm  β1 = {beta1:.6}°  β2 = {beta2:.6}°\n\
         θ = {theta:.6}°  σ = {sigma:.6}°  Z0 = {z0:.4} mm  normalised determinant {:.4}\n",
        q.x, q.y, q.z, solution.normalised_determinant
    )
}

fn of_tool(session: &mut Session, args: &Args, tip_mm: [f64; 3], axis: [f64; 3]) -> Result<Output> {
    let file = session.machine()?;
    session.warn(file.wrist_warning());
    let reach = Reach::new(&file)?;
    if axis == [0.0; 3] {
        return Err(Failure::usage("--axis: expected a direction, found 0, 0, 0"));
    }
    let tool = Tool { tip_m: tip_mm.map(|v| v / 1e3).into(), axis: unit(axis).into() };
    let near = match args.near {
        None => reach.home(),
        Some([q1, q2, q3, beta1, beta2]) => {
            let joints = joint_values([q1, q2, q3], [beta1, beta2]);
            let near = forward(&reach, &joints);
            near.map_err(|f| Failure { message: format!("--near: {}", f.message), ..f })?.0
        }
    };
    let ways = reach.ways(&tool, &near);
    let solution = match reach.chosen(&ways, &tool) {
        // in the other working mode alone
        Err(_) if args.all && !ways.is_empty() => ways[0],
        chosen => chosen.map_err(|f| Failure { message: format!("{}: {}", shown(&tool), f.message), ..f })?,
    };
    let pose = &solution.configuration.pose;
    let (mut json, margins) = margins(&file.machine, pose, &solution.joints.lengths)?;
    let mut text = format!("{}{margins}", in_words(&solution));
    json["status"] = "ok".into();
    if let (Value::Object(json), Value::Object(solution)) = (&mut json, solution_json(&reach, &solution)) {
        json.extend(solution);
    }
    if args.all {
        json["solutions"] = ways.iter().map(|solution| solution_json(&reach, solution)).collect();
        text.push_str(&format!("\ninverse-kinematics solutions: {}, the nearest first:\n", ways.len()));
        for solution in &ways {
            let side = if solution.normalised_determinant >= reach.margin() { "" } else { "opposite working mode:\n" };
            text.push_str(&format!("{side}{}", in_words(solution)));
        }
    }
    session.output(text, &json)
}

pub(super) fn joint_values(q_mm: [f64; 3], beta_deg: [f64; 2]) -> JointValues<f64> {
    let lengths = ScrewLengths { q_m: q_mm.map(|q| q / 1e3).into() };
    JointValues { lengths, beta_rad: beta_deg.map(f64::to_radians).into() }
}

pub(super) fn forward(reach: &Reach<'_>, joints: &JointValues<f64>) -> Result<(Configuration<f64>, Tool<f64>)> {
    reach.five.forward(joints).map_err(|e| {
        let (_, excess) = reach.excess(joints);
        Failure::refused(tool_status(e), if excess.is_empty() { e.to_string() } else { excess })
    })
}

//! The commands `ik` and `fk`, of three axes and of five.

use std::path::Path;

use pkm_core::{Configuration, Hold, JointValues, KinematicsError, Machine, Pose, ScrewLengths, Tool, ToolError};
use serde_json::{Value, json};

use crate::cli::output::Output;
use crate::error::{Failure, Result, status, tool_status};
use crate::files::machine::MachineFile;
use crate::files::path::unit;
use crate::plan::reach::{Reach, shown};
use crate::pose::{file_units, pose_of};

fn refused(e: KinematicsError, what: &str) -> Failure {
    Failure::refused(status(e), format!("{what}: {e}"))
}

/// What the engineer wants to know besides: how far travel and singularities are.
fn margins(machine: &Machine<f64>, pose: &Pose<f64>, lengths: &ScrewLengths<f64>) -> Result<(Value, String)> {
    let (margin_m, limb) = machine.travel_margin_m(lengths);
    let distance = machine.singularity_distance(pose).map_err(|e| refused(e, "singularity"))?;
    let json = json!({
        "travel_margin_mm": margin_m * 1e3,
        "travel_margin_limb": limb + 1,
        "singularity_distance": { "limbs_1_2": distance.limbs_1_2, "limb_3": distance.limb_3 },
    });
    let text = format!(
        "travel left: {:.3} mm (limb {}); distance to singularity (0…1): limbs 1 and 2 {:.3}, limb 3 {:.3}\n",
        margin_m * 1e3,
        limb + 1,
        distance.limbs_1_2,
        distance.limb_3
    );
    Ok((json, text))
}

/// `ik`: screw lengths of a pose.
///
/// # Errors
/// A pose that the machine cannot take.
pub fn ik(machine: Option<&Path>, theta_deg: f64, sigma_deg: f64, z0_mm: f64) -> Result<Output> {
    let file = MachineFile::read(machine)?;
    let machine = file.machine;
    let pose = pose_of(theta_deg, sigma_deg, z0_mm);
    let lengths = machine.inverse(&pose).map_err(|e| {
        let why = file.refusal(e, &pose);
        Failure::refused(status(e), format!("θ = {theta_deg}°, σ = {sigma_deg}°, Z0 = {z0_mm} mm: {why}"))
    })?;
    let q_mm = lengths.q_m.map(|q| q * 1e3);
    let (mut json, margins) = margins(&machine, &pose, &lengths)?;
    json["status"] = "ok".into();
    json["q_mm"] = json!(q_mm);
    Output::new(format!("q = {:.4} {:.4} {:.4} mm\n{margins}", q_mm[0], q_mm[1], q_mm[2]), &json)
}

/// `fk`: pose of screw lengths; with the wrist's joints also tip and axis.
///
/// # Errors
/// Lengths out of travel, or that don't assemble.
pub fn fk(machine: Option<&Path>, q_mm: [f64; 3], beta_deg: Option<[f64; 2]>) -> Result<Output> {
    let file = MachineFile::read(machine)?;
    let machine = file.machine;
    let lengths = ScrewLengths { q_m: q_mm.map(|q| q / 1e3) };
    let what = format!("q = {}, {}, {} mm", q_mm[0], q_mm[1], q_mm[2]);
    let pose = machine.forward(&lengths).map_err(|e| match e {
        KinematicsError::OutOfTravel { limb } => {
            Failure::refused(status(e), format!("{what}: {e}: {}", file.travel_of(limb, &lengths)))
        }
        e => refused(e, &what),
    })?;
    let [theta_deg, sigma_deg, z0_mm] = file_units(&pose);
    let (mut json, margins) = margins(&machine, &pose, &lengths)?;
    json["status"] = "ok".into();
    json["theta_deg"] = theta_deg.into();
    json["sigma_deg"] = sigma_deg.into();
    json["z0_mm"] = z0_mm.into();
    let mut text = format!("θ = {theta_deg:.6}°  σ = {sigma_deg:.6}°  Z0 = {z0_mm:.4} mm\n{margins}");
    if let Some(beta_deg) = beta_deg {
        let (in_words, held) = tool_of(&file, q_mm, beta_deg)?;
        text.push_str(&in_words);
        if let (Value::Object(json), Value::Object(held)) = (&mut json, held) {
            json.extend(held);
        }
    }
    Output::new(text, &json)
}

fn solution(reach: &Reach<'_>, hold: &Hold<f64>) -> Value {
    let [theta_deg, sigma_deg, z0_mm] = file_units(&hold.configuration.pose);
    let [beta1_deg, beta2_deg] = hold.configuration.beta_rad.map(f64::to_degrees);
    json!({
        "q_mm": hold.joints.lengths.q_m.map(|q| q * 1e3),
        "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm,
        "beta1_deg": beta1_deg, "beta2_deg": beta2_deg,
        "home_share": hold.home_share,
        "home_side": hold.home_share >= reach.margin(),
    })
}

fn in_words(hold: &Hold<f64>) -> String {
    let q = hold.joints.lengths.q_m.map(|q| q * 1e3);
    let [theta, sigma, z0] = file_units(&hold.configuration.pose);
    let [beta1, beta2] = hold.configuration.beta_rad.map(f64::to_degrees);
    format!(
        "q = {:.4} {:.4} {:.4} mm  β1 = {beta1:.6}°  β2 = {beta2:.6}°\n\
         θ = {theta:.6}°  σ = {sigma:.6}°  Z0 = {z0:.4} mm  home share {:.4}\n",
        q[0], q[1], q[2], hold.home_share
    )
}

/// `ik --tip-mm --axis`: joint values that hold a tool.
///
/// # Errors
/// No axis, `near` that the machine cannot take, a tool that it cannot hold.
pub fn of_tool(
    machine: Option<&Path>,
    tip_mm: [f64; 3],
    axis: [f64; 3],
    near: Option<[f64; 5]>,
    all: bool,
) -> Result<Output> {
    let file = MachineFile::read(machine)?;
    let reach = Reach::new(&file)?;
    if axis == [0.0; 3] {
        return Err(Failure::usage("--axis: expected a direction, found 0, 0, 0"));
    }
    let tool = Tool { tip_m: tip_mm.map(|v| v / 1e3), axis: unit(axis) };
    let near = match near {
        None => reach.home(),
        Some([q1, q2, q3, beta1, beta2]) => {
            let joints = joint_values([q1, q2, q3], [beta1, beta2]);
            let near = forward(&reach, &joints);
            near.map_err(|f| Failure { message: format!("--near: {}", f.message), ..f })?.0
        }
    };
    let ways = reach.ways(&tool, &near);
    let hold =
        reach.chosen(&ways, &tool).map_err(|f| Failure { message: format!("{}: {}", shown(&tool), f.message), ..f })?;
    let pose = &hold.configuration.pose;
    let (mut json, margins) = margins(&file.machine, pose, &hold.joints.lengths)?;
    let mut text = format!("{}{margins}", in_words(&hold));
    json["status"] = "ok".into();
    if let (Value::Object(json), Value::Object(solution)) = (&mut json, solution(&reach, &hold)) {
        json.extend(solution);
    }
    if all {
        json["solutions"] = ways.iter().map(|hold| solution(&reach, hold)).collect();
        text.push_str(&format!("\nways to hold it: {}, the nearest first:\n", ways.len()));
        for hold in &ways {
            let side = if hold.home_share >= reach.margin() { "" } else { "not on the home side:\n" };
            text.push_str(&format!("{side}{}", in_words(hold)));
        }
    }
    Output::new(text, &json)
}

fn joint_values(q_mm: [f64; 3], beta_deg: [f64; 2]) -> JointValues<f64> {
    JointValues { lengths: ScrewLengths { q_m: q_mm.map(|q| q / 1e3) }, beta_rad: beta_deg.map(f64::to_radians) }
}

fn forward(reach: &Reach<'_>, joints: &JointValues<f64>) -> Result<(Configuration<f64>, Tool<f64>)> {
    reach.five.forward(joints).map_err(|e| {
        let (_, excess) = reach.excess(joints);
        Failure::refused(tool_status(e), if excess.is_empty() { e.to_string() } else { excess })
    })
}

/// `fk --beta-deg`: tip and axis of joint values, and how far the singular surface is: for the pose's document and its text.
fn tool_of(file: &MachineFile, q_mm: [f64; 3], beta_deg: [f64; 2]) -> Result<(String, Value)> {
    let reach = Reach::new(file)?;
    let refused = |e: ToolError| Failure::refused(tool_status(e), e.to_string());
    let (configuration, tool) = forward(&reach, &joint_values(q_mm, beta_deg))?;
    let home_share = reach.five.home_share(&configuration).map_err(refused)?;
    let tip_mm = tool.tip_m.map(|v| v * 1e3);
    let side = if home_share >= reach.margin() { "" } else { ": not on the home side" };
    let ([x, y, z], [i, j, k]) = (tip_mm, tool.axis);
    Ok((
        format!("tip {x:.4}, {y:.4}, {z:.4} mm  axis {i:.9}, {j:.9}, {k:.9}  home share {home_share:.4}{side}\n"),
        json!({ "tip_mm": tip_mm, "axis": tool.axis, "home_share": home_share }),
    ))
}

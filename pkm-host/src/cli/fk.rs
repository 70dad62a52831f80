//! `fk`: the pose of screw lengths; with the wrist's joints also tip and axis.

use pkm_core::{KinematicsError, ScrewLengths, ToolError};
use serde_json::{Value, json};

use super::arguments::list;
use super::ik::{forward, joint_values, margins, refused};
use super::session::{Output, Session};
use crate::error::{Failure, Result, status, tool_status};
use crate::files::machine::MachineFile;
use crate::plan::reach::Reach;
use crate::pose::file_units;

/// Pose of three screw lengths; with the wrist's joints also the tool.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// q1,q2,q3 in mm.
    #[arg(long, value_parser = list::<3>, allow_hyphen_values = true, value_name = "A,B,C")]
    q_mm: [f64; 3],
    /// β1,β2 of the wrist in °: gives the tool's tip and axis too.
    #[arg(long, value_parser = list::<2>, allow_hyphen_values = true, value_name = "B1,B2")]
    beta_deg: Option<[f64; 2]>,
}

pub(crate) fn run(&Args { q_mm, beta_deg }: &Args, session: &mut Session) -> Result<Output> {
    let file = session.machine()?;
    let machine = file.machine;
    let lengths = ScrewLengths { q_m: q_mm.map(|q| q / 1e3).into() };
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
        session.warn(file.wrist_warning());
        let (in_words, held) = tool_of(&file, q_mm, beta_deg)?;
        text.push_str(&in_words);
        if let (Value::Object(json), Value::Object(held)) = (&mut json, held) {
            json.extend(held);
        }
    }
    session.output(text, &json)
}

/// `fk --beta-deg`: tip and axis of joint values, and how far a singularity is: for the pose's document and its text.
fn tool_of(file: &MachineFile, q_mm: [f64; 3], beta_deg: [f64; 2]) -> Result<(String, Value)> {
    let reach = Reach::new(file)?;
    let refused = |e: ToolError| Failure::refused(tool_status(e), e.to_string());
    let (configuration, tool) = forward(&reach, &joint_values(q_mm, beta_deg))?;
    let normalised_determinant = reach.five.normalised_determinant(&configuration).map_err(refused)?;
    let (tip_mm, axis): ([f64; 3], [f64; 3]) = ((tool.tip_m * 1e3).into(), tool.axis.into());
    let side = if normalised_determinant >= reach.margin() { "" } else { ": opposite working mode" };
    // no sign of what rounds to 0
    let [x, y, z] = tip_mm.map(|v| (v * 1e4).round() / 1e4 + 0.0);
    let [i, j, k] = axis;
    Ok((
        format!(
            "tip {x:.4}, {y:.4}, {z:.4} mm  axis {i:.9}, {j:.9}, {k:.9}  normalised determinant {normalised_determinant:.4}{side}\n"
        ),
        json!({ "tip_mm": tip_mm, "axis": axis, "normalised_determinant": normalised_determinant }),
    ))
}

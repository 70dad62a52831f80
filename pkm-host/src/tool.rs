//! Holding a tool: the commands `ik` and `fk` with the wrist, which of the ways is taken, and by how much there is none.

use pkm_core::{
    Configuration, FiveAxis, Hold, JointValues, KinematicsError, Machine, Pose, ScrewLengths, Tool, ToolError, Wrist,
    WristParameters,
};
use serde_json::{Value, json};

use crate::commands::{Output, margins};
use crate::error::{Failure, Result, tool_status};
use crate::holds::holds;
use crate::machine_file::MachineFile;
use crate::pose::{file_units, tidy};

/// A machine with its wrist, and the same without limits: it says how far beyond them a tool lies.
pub struct Reach<'a> {
    /// The machine's file.
    pub file: &'a MachineFile,
    /// The machine as it is.
    pub five: FiveAxis<'a, f64>,
    machine: Machine<f64>,
    wrist: Wrist<f64>,
    wrist_parameters: WristParameters,
}

impl<'a> Reach<'a> {
    /// Of a machine file.
    ///
    /// # Errors
    /// A wrist that is singular at home.
    pub fn new(file: &'a MachineFile) -> Result<Self> {
        file.warn_of_wrist();
        let failed = |e: String| Failure::input(e).in_file(&file.source.name);
        let pi = std::f64::consts::PI;
        let wrist_parameters =
            WristParameters { min_rad: [-pi; 2], max_rad: [pi; 2], singularity_margin: 0.0, ..file.wrist_parameters };
        Ok(Self {
            five: file.five_axis()?,
            machine: file.without_travel().ok_or_else(|| failed("no machine without travel".to_owned()))?,
            wrist: Wrist::<f64>::new(&wrist_parameters).map_err(|e| failed(e.to_string()))?,
            wrist_parameters,
            file,
        })
    }

    /// The same without travel, limits and margin.
    pub fn unlimited(&self) -> FiveAxis<'_, f64> {
        FiveAxis { machine: &self.machine, wrist: &self.wrist }
    }

    /// The zero pose: θ = σ = β1 = β2 = 0, Z0 in the middle of the box.
    pub fn home(&self) -> Configuration<f64> {
        let z0_m = self.file.wrist_parameters.home_z0_m;
        Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m }, beta_rad: [0.0; 2] }
    }

    /// Least home share, as the machine file has it.
    fn margin(&self) -> f64 {
        self.file.wrist_parameters.singularity_margin
    }

    /// How far two configurations are apart: angles in rad, Z0 as a share of home's.
    fn apart(&self, a: &Configuration<f64>, b: &Configuration<f64>) -> f64 {
        let all = |c: &Configuration<f64>| {
            let z0 = c.pose.z0_m / self.file.wrist_parameters.home_z0_m;
            [c.pose.theta_rad, c.pose.sigma_rad, z0, c.beta_rad[0], c.beta_rad[1]]
        };
        all(a).iter().zip(all(b)).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }

    /// Every way to hold a tool.
    fn all(&self, tool: &Tool<f64>) -> Vec<Hold<f64>> {
        holds(&self.five, &self.file.wrist_parameters, tool)
    }

    /// Every way to hold a tool on home's side of the singular surface.
    pub fn on_home_side(&self, tool: &Tool<f64>) -> impl Iterator<Item = Hold<f64>> {
        self.all(tool).into_iter().filter(|hold| hold.home_share >= self.margin())
    }

    /// Every way to hold a tool, the nearest first.
    fn ways(&self, tool: &Tool<f64>, near: &Configuration<f64>) -> Vec<Hold<f64>> {
        let mut ways = self.all(tool);
        ways.sort_by(|a, b| self.apart(&a.configuration, near).total_cmp(&self.apart(&b.configuration, near)));
        ways
    }

    /// The way to hold a tool that is nearest to a configuration, on home's side of the singular surface.
    ///
    /// # Errors
    /// Refused, with the amount: see [`refusal`](Self::refusal).
    pub fn nearest(&self, tool: &Tool<f64>, near: &Configuration<f64>) -> Result<Hold<f64>> {
        self.chosen(&self.ways(tool, near), tool)
    }

    fn chosen(&self, ways: &[Hold<f64>], tool: &Tool<f64>) -> Result<Hold<f64>> {
        if let Some(hold) = ways.iter().find(|hold| hold.home_share >= self.margin()) {
            return Ok(*hold);
        }
        let best = |ways: &[Hold<f64>]| ways.iter().map(|hold| hold.home_share).fold(f64::NEG_INFINITY, f64::max);
        let singular = |share: f64| {
            let margin = self.margin();
            let message = format!(
                "only beyond the singular surface of the five axes or too near to it: home share {share:.4}, at least \
                 {margin} is asked (wrist.singularity_margin): turn the axis or move the tip"
            );
            Err(Failure::refused("singular", message))
        };
        if !ways.is_empty() {
            return singular(best(ways));
        }
        let beyond = holds(&self.unlimited(), &self.wrist_parameters, tool);
        let on_home_side = beyond.iter().filter(|hold| hold.home_share >= self.margin());
        let least = on_home_side.map(|hold| self.excess(&hold.joints)).min_by(|a, b| a.0.total_cmp(&b.0));
        let hint = || {
            let tool = self.farthest(tool);
            tool.map_or(String::new(), |t| {
                format!("; on the straight way from home's tool it gets as far as {}", shown(&t))
            })
        };
        match least {
            Some((_, message)) => Err(Failure::refused("out_of_travel", message + &hint())),
            None if !beyond.is_empty() => singular(best(&beyond)),
            None => Err(Failure::refused("unreachable", format!("no posture holds this tool{}", hint()))),
        }
    }

    /// How far a tool is beyond travel and limits: a measure, and in words. `None` where it is out of reach whatever they are.
    pub fn shortfall(&self, tool: &Tool<f64>) -> Option<(f64, String)> {
        let hold = self.unlimited().search(tool, &self.home()).ok()?;
        Some(self.excess(&hold.joints))
    }

    /// How far joint values are beyond the limits: a measure, and in words.
    fn excess(&self, joints: &JointValues<f64>) -> (f64, String) {
        let (mut sum, mut words) = (0.0, Vec::new());
        let travel = &self.file.parameters.travel;
        for (i, q) in joints.lengths.q_m.into_iter().enumerate() {
            let by = (travel.min_m[i] - q).max(q - travel.max_m[i]);
            if by > 0.0 {
                sum += by / self.file.wrist_parameters.home_z0_m;
                let length = self.file.travel_of(i as u8 + 1, &joints.lengths);
                words.push(format!(
                    "the screw of limb {} would be {:.3} mm beyond its travel: {length}",
                    i + 1,
                    by * 1e3
                ));
            }
        }
        let wrist = &self.file.wrist_parameters;
        for (i, beta) in joints.beta_rad.into_iter().enumerate() {
            let by = (wrist.min_rad[i] - beta).max(beta - wrist.max_rad[i]);
            if by > 0.0 {
                sum += by;
                let [beta, by, low, high] =
                    [beta, by, wrist.min_rad[i], wrist.max_rad[i]].map(|rad: f64| tidy(rad.to_degrees()));
                let n = i + 1;
                words.push(format!("β{n} would be {by:.3}° beyond its limits: {beta:.3}°, limits {low} to {high}°"));
            }
        }
        (sum, words.join("; "))
    }

    /// As far as the machine gets on the straight way from home's tool to another.
    fn farthest(&self, tool: &Tool<f64>) -> Option<Tool<f64>> {
        let mut near = self.home();
        let home = self.five.tool(&near).ok()?;
        let place = |tool: &Tool<f64>| Place { tip_m: tool.tip_m, toward: Toward::Axis(tool.axis) };
        let (mut share, mut step) = (0.0, 1.0 / 64.0);
        while step > 1e-6 && share < 1.0 {
            match self.stand(&place(&home).between(&place(tool), share + step), &near) {
                Ok(hold) => (near, share) = (hold.configuration, share + step),
                Err(_) => step *= 0.5,
            }
        }
        self.five.tool(&near).ok()
    }

    /// Why the core refuses, with the amount: a status and a message. `there` is where the machine would stand
    /// [without limits](Self::unlimited), if anywhere.
    pub fn refusal(&self, error: ToolError, there: Option<&Hold<f64>>) -> (&'static str, String) {
        let message = match (error, there) {
            (ToolError::WristLimit { .. } | ToolError::Kinematics(KinematicsError::OutOfTravel { .. }), Some(hold)) => {
                self.excess(&hold.joints).1
            }
            (ToolError::Singular, there) => {
                let share = there.map_or("it would change sides".to_owned(), |hold| {
                    format!("the home share would be {:.4}", hold.home_share)
                });
                format!(
                    "it crosses the singular surface of the five axes or comes too near: {share}, at least {} is asked \
                     (wrist.singularity_margin): turn the axis or move the tip",
                    self.margin()
                )
            }
            (error, _) => error.to_string(),
        };
        (tool_status(error), message)
    }

    /// The configuration in a place, next to `near` where there are several.
    ///
    /// # Errors
    /// Those of [`FiveAxis::inverse`] and [`FiveAxis::inverse_at`].
    pub fn stand(&self, place: &Place, near: &Configuration<f64>) -> std::result::Result<Hold<f64>, ToolError> {
        stood(&self.five, place, near)
    }

    /// The same [without limits](Self::unlimited).
    pub fn stand_anywhere(&self, place: &Place, near: &Configuration<f64>) -> Option<Hold<f64>> {
        stood(&self.unlimited(), place, near).ok()
    }
}

fn stood(
    five: &FiveAxis<'_, f64>,
    place: &Place,
    near: &Configuration<f64>,
) -> std::result::Result<Hold<f64>, ToolError> {
    match place.toward {
        Toward::Axis(axis) => five.inverse(&Tool { tip_m: place.tip_m, axis }, near),
        Toward::Wrist(beta_rad) => five.inverse_at(place.tip_m, beta_rad),
    }
}

/// Where a path asks the tool to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The tip in B, m.
    pub tip_m: [f64; 3],
    /// What says where its axis points.
    pub toward: Toward,
}

/// What says where a tool points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Toward {
    /// Its axis in B, of any length above 0.
    Axis([f64; 3]),
    /// β1 and β2 of the wrist, rad.
    Wrist([f64; 2]),
}

impl Place {
    /// The place on the straight way to another, given in the same manner: the tip goes straight, the axis turns evenly in the
    /// plane of both, the wrist's joints turn evenly.
    pub fn between(&self, to: &Self, share: f64) -> Self {
        let part = |a: f64, b: f64| a + share * (b - a);
        let toward = match (self.toward, to.toward) {
            (Toward::Axis(a), Toward::Axis(b)) => Toward::Axis(turned(a, b, share)),
            (Toward::Wrist(a), Toward::Wrist(b)) => Toward::Wrist([part(a[0], b[0]), part(a[1], b[1])]),
            (_, toward) => toward,
        };
        Self { tip_m: std::array::from_fn(|i| part(self.tip_m[i], to.tip_m[i])), toward }
    }

    /// How far another is: of the tip in m, and of the axis or the joint that turns furthest in rad.
    pub fn apart(&self, to: &Self) -> [f64; 2] {
        let way = (0..3).map(|i| (to.tip_m[i] - self.tip_m[i]).powi(2)).sum::<f64>().sqrt();
        let turn = match (self.toward, to.toward) {
            (Toward::Axis(a), Toward::Axis(b)) => angle(a, b),
            (Toward::Wrist(a), Toward::Wrist(b)) => (a[0] - b[0]).abs().max((a[1] - b[1]).abs()),
            _ => 0.0,
        };
        [way, turn]
    }
}

/// A tool in the units of files.
fn shown(tool: &Tool<f64>) -> String {
    let [x, y, z] = tool.tip_m.map(|m| (m * 1e6).round() / 1e3 + 0.0);
    let [i, j, k] = unit(tool.axis).map(|v| (v * 1e6).round() / 1e6 + 0.0);
    format!("tip {x}, {y}, {z} mm, axis {i}, {j}, {k}")
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let longest = v.iter().fold(0.0_f64, |longest, v| longest.max(v.abs()));
    let v = v.map(|v| v / longest);
    let size = v.iter().map(|v| v * v).sum::<f64>().sqrt();
    v.map(|v| v / size)
}

/// Angle between two axes, rad.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [a, b] = [unit(a), unit(b)];
    let size = |sign: f64| (0..3).map(|i| (a[i] + sign * b[i]).powi(2)).sum::<f64>().sqrt();
    2.0 * size(-1.0).atan2(size(1.0))
}

/// A share of the turn from one axis to another, in the plane of both.
fn turned(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    let angle = angle(from, to);
    let part = |share: f64| if angle.sin() > 1e-6 { (share * angle).sin() / angle.sin() } else { share };
    let [from, to] = [unit(from), unit(to)];
    std::array::from_fn(|i| part(1.0 - share) * from[i] + part(share) * to[i])
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
pub fn ik(file: &MachineFile, tip_mm: [f64; 3], axis: [f64; 3], near: Option<[f64; 5]>, all: bool) -> Result<Output> {
    let reach = Reach::new(file)?;
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
    Ok(Output { text, json })
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
///
/// # Errors
/// Joint values that the machine cannot take.
pub fn fk(file: &MachineFile, q_mm: [f64; 3], beta_deg: [f64; 2]) -> Result<Output> {
    let reach = Reach::new(file)?;
    let refused = |e: ToolError| Failure::refused(tool_status(e), e.to_string());
    let (configuration, tool) = forward(&reach, &joint_values(q_mm, beta_deg))?;
    let home_share = reach.five.home_share(&configuration).map_err(refused)?;
    let tip_mm = tool.tip_m.map(|v| v * 1e3);
    let side = if home_share >= reach.margin() { "" } else { ": not on the home side" };
    let ([x, y, z], [i, j, k]) = (tip_mm, tool.axis);
    Ok(Output {
        text: format!("tip {x:.4}, {y:.4}, {z:.4} mm  axis {i:.9}, {j:.9}, {k:.9}  home share {home_share:.4}{side}\n"),
        json: json!({ "tip_mm": tip_mm, "axis": tool.axis, "home_share": home_share }),
    })
}

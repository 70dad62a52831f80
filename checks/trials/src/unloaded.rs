//! Unloaded poses of a machine with errors of its geometry, as a tracker or a ball bar reads them.
//!
//! Loops of three limbs are closed joint by joint and solved by Gauss and Newton for the platform's six coordinates and the five free
//! joint angles: no formula of the core. With joint axes that are not parallel the loops do not close; the parts then give where it
//! costs least, axially a tenth of what they give sideways.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use serde_json::{Map, Value, json};

use crate::Random;

/// The machine file that all sets declare.
const MACHINE: &str = include_str!("../../../fixtures/machines/reference.toml");
/// a1, a2, b1, b2 as declared there, m.
const SIZES_M: [f64; 4] = [0.18, 0.22, 0.35, 0.38];
/// offset, first d, first b, second b, flange, m.
const WRIST_M: [f64; 5] = [-0.02, 0.417, -0.035, -0.15, 0.19];
/// Screws, m, with a margin at both ends.
const TRAVEL_M: [f64; 2] = [0.43, 0.76];
/// 1 sd of errors of lengths and zeros, and of zeros of the wrist, as declared.
const GEOMETRY_SD_M: f64 = 1e-3;
const ZERO_SD_RAD: f64 = 1e-3;
/// Greatest turn of a joint's axis.
const AXIS_RAD: f64 = 1e-3;
/// What a length sideways, and an angle, count for beside one along the limb.
const SIDEWAYS: f64 = 0.1;
const ANGLE_ARM_M: f64 = 0.03;
/// Targets on the platform, in A-uvw, m.
const TARGETS_M: [[f64; 3]; 3] = [[0.15, 0.0, 0.05], [-0.1, 0.12, 0.06], [-0.1, -0.12, 0.04]];
/// Balls on the spindle's axis, from the tip, m.
const TOOLS_M: [f64; 2] = [0.0, -0.08];
/// 1 sd of the places of sockets.
const SOCKET_SD_M: f64 = 2e-4;
/// Balls on the base for the ball bar, in B, m.
const BALLS_M: [[f64; 3]; 3] = [[0.3, 0.25, 0.1], [-0.35, 0.1, 0.05], [0.05, -0.35, 0.15]];

/// What is measured, and what is wrong beside sizes and zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Case {
    /// Two balls on the spindle.
    Five,
    /// Three reflectors on the platform, at places that nobody knows.
    Parallel,
    /// Sockets on the platform, at places that are known to 0.2 mm, read as distances from three balls on the base.
    Bar,
    /// As `five`, with joint axes that are up to 1 mrad off.
    FiveAxes,
    /// As `parallel`, with joint axes that are up to 1 mrad off.
    ParallelAxes,
}

impl Case {
    fn has_wrist(self) -> bool {
        matches!(self, Self::Five | Self::FiveAxes)
    }

    /// Whether joint axes are off.
    fn has_axes(self) -> bool {
        matches!(self, Self::FiveAxes | Self::ParallelAxes)
    }

    /// As in the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Five => "five",
            Self::Parallel => "parallel",
            Self::Bar => "bar",
            Self::FiveAxes => "five-axes",
            Self::ParallelAxes => "parallel-axes",
        }
    }
}

/// A machine as it stands there.
#[derive(Clone, Debug)]
pub struct Machine {
    sizes_m: [f64; 4],
    zeros_m: [f64; 3],
    wrist_m: [f64; 5],
    beta_rad: [f64; 2],
    tool_y_m: f64,
    /// Turns of the axes: of limbs 1 and 2 the outer and inner one of the universal joint and that on the platform, of limb 3
    /// the base joint's.
    axes_rad: [Vector3<f64>; 7],
    /// Targets on the platform beside their declared places.
    targets_m: [Vector3<f64>; 3],
}

const DECLARED: Machine = Machine {
    sizes_m: SIZES_M,
    zeros_m: [0.0; 3],
    wrist_m: WRIST_M,
    beta_rad: [0.0; 2],
    tool_y_m: 0.0,
    axes_rad: [Vector3::new(0.0, 0.0, 0.0); 7],
    targets_m: [Vector3::new(0.0, 0.0, 0.0); 3],
};

/// A command: θ, σ in rad, Z0 in m, β1, β2.
type Command = ([f64; 3], [f64; 2]);

/// Place of A, rotation of the platform, and the free angles: of limb 1, limb 2 two each, of limb 3 one.
type Assembly = DVector<f64>;

fn turn(v: Vector3<f64>) -> Matrix3<f64> {
    *Rotation3::new(v).matrix()
}

impl Machine {
    fn random(case: Case, random: &mut Random) -> Self {
        let mut this = DECLARED;
        let length = |random: &mut Random| GEOMETRY_SD_M * random.normal();
        this.sizes_m.iter_mut().for_each(|v| *v += length(random));
        this.zeros_m.iter_mut().for_each(|v| *v += length(random));
        this.wrist_m.iter_mut().for_each(|v| *v += length(random));
        this.beta_rad.iter_mut().for_each(|v| *v += ZERO_SD_RAD * random.normal());
        this.tool_y_m = length(random);
        if case == Case::Bar {
            this.targets_m.iter_mut().for_each(|t| *t = Vector3::from_fn(|_, _| SOCKET_SD_M * random.normal()));
        }
        if case.has_axes() {
            this.axes_rad.iter_mut().for_each(|v| *v = Vector3::from_fn(|_, _| random.between(-AXIS_RAD, AXIS_RAD)));
        }
        this
    }

    /// B_i and A_i, m.
    fn joints(&self) -> [(Vector3<f64>, Vector3<f64>); 3] {
        let [a1, a2, b1, b2] = self.sizes_m;
        let at = |x, y| Vector3::new(x, y, 0.0);
        [(at(0.0, -b1), at(0.0, -a1)), (at(0.0, b1), at(0.0, a1)), (at(b2, 0.0), at(a2, 0.0))]
    }

    /// Platform at a pose: A and its rotation.
    fn platform([theta, sigma, z0]: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let rotation = turn(Vector3::y() * theta) * turn(Vector3::x() * sigma);
        (Vector3::new(z0 * theta.tan(), 0.0, z0), rotation)
    }

    /// Distances of the joints at a pose: what a controller commands that takes this for the machine.
    fn lengths(&self, pose: [f64; 3]) -> [f64; 3] {
        let (a, rotation) = Self::platform(pose);
        self.joints().map(|(base, platform)| (a + rotation * platform - base).norm())
    }

    /// By how much an assembly does not close at given lengths, weighed.
    fn gaps(&self, q_m: [f64; 3], x: &Assembly) -> DVector<f64> {
        let a = Vector3::new(x[0], x[1], x[2]);
        let platform = turn(Vector3::new(x[3], x[4], x[5]));
        let mut gaps = Vec::new();
        let mut close = |body: Matrix3<f64>, gap: Vector3<f64>| {
            // in the axes of the body: sideways it gives more than along
            let own = body.transpose() * gap;
            gaps.extend([SIDEWAYS * own.x, SIDEWAYS * own.y, own.z]);
        };
        let mut axes = Vec::new();
        for (limb, (base, joint)) in self.joints().into_iter().enumerate() {
            let end = |body: Matrix3<f64>| a + platform * joint - base - body * Vector3::z() * q_m[limb];
            if limb == 2 {
                let outer = turn(self.axes_rad[6]) * Vector3::y();
                let body = turn(outer * x[10]);
                close(body, end(body));
                continue;
            }
            let [outer, inner, last] = [0, 1, 2].map(|n| turn(self.axes_rad[3 * limb + n]));
            let body = turn(outer * Vector3::y() * x[6 + 2 * limb]) * turn(inner * Vector3::x() * x[7 + 2 * limb]);
            close(body, end(body));
            let off = platform * (last * Vector3::x()) - body * Vector3::x();
            axes.extend((body.transpose() * off).iter().map(|v| ANGLE_ARM_M * v));
        }
        gaps.extend(axes);
        DVector::from_vec(gaps)
    }

    /// Where the machine goes at commanded lengths: the assembly that closes best, from the commanded pose.
    fn assembly(&self, commanded_m: [f64; 3], pose: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let q_m: [f64; 3] = std::array::from_fn(|i| commanded_m[i] + self.zeros_m[i]);
        let (a, rotation) = Self::platform(pose);
        let mut x = DVector::zeros(11);
        x.rows_mut(0, 3).copy_from(&a);
        x.rows_mut(3, 3).copy_from(&Rotation3::from_matrix_unchecked(rotation).scaled_axis());
        for (limb, (base, joint)) in self.joints().into_iter().enumerate() {
            let along = (a + rotation * joint - base).normalize();
            // about y, then about the turned x
            let outer = along.x.atan2(along.z);
            if limb == 2 {
                x[10] = outer;
            } else {
                x[6 + 2 * limb] = outer;
                x[7 + 2 * limb] = (-along.y).asin();
            }
        }
        for _ in 0..30 {
            let gaps = self.gaps(q_m, &x);
            let column = |i: usize| {
                let at = |h: f64| {
                    let mut y = x.clone();
                    y[i] += h;
                    self.gaps(q_m, &y)
                };
                (at(1e-5) - at(-1e-5)) / 2e-5
            };
            let slopes = DMatrix::from_columns(&(0..11).map(column).collect::<Vec<_>>());
            let step = slopes.svd(true, true).solve(&gaps, 1e-12).expect("both sides were asked for");
            x -= &step;
            if step.amax() < 1e-13 {
                break;
            }
        }
        (Vector3::new(x[0], x[1], x[2]), turn(Vector3::new(x[3], x[4], x[5])))
    }

    /// Where points are, in B, at commanded lengths near those of a pose and angles of the wrist: on the tool at distances from
    /// the tip, or on the platform.
    fn points(&self, case: Case, lengths_m: [f64; 3], (pose, beta): Command) -> Vec<Vector3<f64>> {
        let (a, rotation) = self.assembly(lengths_m, pose);
        if !case.has_wrist() {
            let at = TARGETS_M.iter().zip(&self.targets_m);
            return at.map(|(t, off)| a + rotation * (Vector3::from(*t) + off)).collect();
        }
        let [offset, d, b, second_b, flange] = self.wrist_m;
        let first = rotation * turn(Vector3::z() * (beta[0] + self.beta_rad[0]));
        let second = first * turn(Vector3::y() * -(beta[1] + self.beta_rad[1]));
        let axis = a + rotation * Vector3::x() * offset + first * Vector3::new(b, 0.0, d);
        TOOLS_M.iter().map(|z| axis + second * Vector3::new(second_b, self.tool_y_m, flange + z)).collect()
    }

    /// Errors by key of `geometry.json`, mm and mrad.
    fn truth(&self, case: Case) -> Map<String, Value> {
        let keys = ["a1", "a2", "b1", "b2"].map(|k| format!("geometry.{k}_mm"));
        let zeros = [1, 2, 3].map(|n| format!("zero.q{n}_mm"));
        let wrist = ["offset", "first.d", "first.b", "second.b", "flange"].map(|k| format!("wrist.{k}_mm"));
        let mut all: Vec<(String, f64)> = keys.into_iter().zip(self.sizes_m).collect();
        all.extend(zeros.into_iter().zip(self.zeros_m));
        if case.has_wrist() {
            all.extend(wrist.into_iter().zip(self.wrist_m));
            all.extend([1, 2].map(|n| format!("zero.beta{n}_mrad")).into_iter().zip(self.beta_rad));
            all.push(("tool.y_mm".into(), self.tool_y_m));
        }
        all.into_iter().map(|(k, v)| (k, json!(1e3 * v))).collect()
    }
}

/// A set: readings, others to judge by, and what is true.
pub struct Set {
    case: Case,
    machine: Machine,
    /// From B to the measuring frame.
    frame: Frame,
    /// `unloaded.csv`.
    pub measured: String,
    /// `heldout.csv`.
    pub held_out: String,
}

/// Commands all over the travel.
fn command(case: Case, random: &mut Random) -> Command {
    loop {
        let mut angle = |most: f64| random.between(-most, most).to_radians();
        let (theta, sigma, beta) = (angle(22.0), angle(22.0), [angle(80.0), angle(55.0)]);
        let pose = [theta, sigma, random.between(0.45, 0.64)];
        let inside = |q: f64| q > TRAVEL_M[0] && q < TRAVEL_M[1];
        if DECLARED.lengths(pose).into_iter().all(inside) {
            return (pose, if case.has_wrist() { beta } else { [0.0; 2] });
        }
    }
}

/// Rounded as it is written, so that the command is what the file says.
fn written((pose, beta): Command) -> Command {
    let angle = |v: f64| ((v.to_degrees() * 1e4).round() / 1e4).to_radians();
    let [theta, sigma, z0] = pose;
    ([angle(theta), angle(sigma), (z0 * 1e6).round() / 1e6], beta.map(angle))
}

impl Set {
    /// All of it follows from the seed.
    pub fn new(case: Case, seed: u64, poses: usize, noise_um: f64) -> Self {
        let mut random = Random::new(seed);
        let machine = Machine::random(case, &mut random);
        let rotation = turn(random.direction() * random.between(0.0, std::f64::consts::PI));
        let origin = Vector3::from_fn(|_, _| random.between(-2.0, 2.0));
        let frame = (rotation, origin);
        let measured = file(case, &machine, frame, poses, noise_um, &mut random);
        let held_out = file(case, &machine, frame, poses, noise_um, &mut random);
        Self { case, machine, frame, measured, held_out }
    }

    /// Errors of the machine by key, mm and mrad.
    pub fn truth(&self) -> Map<String, Value> {
        self.machine.truth(self.case)
    }

    /// Where the first point goes in the measuring frame, without noise, at commanded lengths near those of a pose (θ, σ, Z0; rad
    /// and m) and angles of the wrist.
    pub fn goes_to_m(&self, lengths_m: [f64; 3], pose: [f64; 3], beta_rad: [f64; 2]) -> Vector3<f64> {
        self.frame.0 * self.machine.points(self.case, lengths_m, (pose, beta_rad))[0] + self.frame.1
    }

    /// Writes machine.toml, unloaded.csv, heldout.csv and truth.json.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn write(&self, folder: &Path) -> Result<(), String> {
        let fail = |e: std::io::Error| format!("{}: {e}", folder.display());
        std::fs::create_dir_all(folder).map_err(fail)?;
        let axes: Vec<[f64; 3]> = self.machine.axes_rad.iter().map(|v| (v * 1e3).into()).collect();
        let truth = json!({ "case": self.case.name(), "parameters": self.truth(), "joint_axes_mrad": axes });
        let truth = serde_json::to_string_pretty(&truth).map_err(|e| e.to_string())? + "\n";
        let files = [
            ("machine.toml", MACHINE),
            ("unloaded.csv", &self.measured),
            ("heldout.csv", &self.held_out),
            ("truth.json", &truth),
        ];
        files.into_iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text).map_err(fail))
    }
}

/// From B to the measuring frame.
type Frame = (Matrix3<f64>, Vector3<f64>);

/// Readings at random commands.
fn file(case: Case, machine: &Machine, frame: Frame, poses: usize, noise_um: f64, random: &mut Random) -> String {
    let (rotation, origin) = frame;
    let tool = match case {
        Case::Bar => ",point_u_mm,point_v_mm,point_w_mm,target_sd_mm",
        _ if case.has_wrist() => ",beta1_deg,beta2_deg,tool_x_mm,tool_y_mm,tool_z_mm",
        _ => "",
    };
    let read = if case == Case::Bar { "ball,distance_mm" } else { "x_mm,y_mm,z_mm" };
    let mut csv = format!("pose,theta_deg,sigma_deg,z0_mm{tool},target,{read},sigma_linear_um\n");
    for n in 1..=poses {
        let command = written(command(case, random));
        let ([theta, sigma, z0], beta) = command;
        let [theta, sigma, beta1, beta2] = [theta, sigma, beta[0], beta[1]].map(f64::to_degrees);
        for (t, point) in machine.points(case, DECLARED.lengths(command.0), command).into_iter().enumerate() {
            let mut line = format!("P{n:02},{theta:.4},{sigma:.4},{:.3}", 1e3 * z0);
            if case.has_wrist() {
                _ = write!(line, ",{beta1:.4},{beta2:.4},0,0,{}", 1e3 * TOOLS_M[t]);
            }
            if case == Case::Bar {
                let [u, v, w] = TARGETS_M[t].map(|m| 1e3 * m);
                _ = write!(line, ",{u},{v},{w},{}", 1e3 * SOCKET_SD_M);
            }
            _ = write!(line, ",T{}", t + 1);
            let mut noise = || 1e-6 * noise_um * random.normal();
            if case == Case::Bar {
                for (b, ball) in BALLS_M.iter().enumerate() {
                    let distance = (point - Vector3::from(*ball)).norm() + noise();
                    _ = writeln!(csv, "{line},K{},{:.5},{noise_um}", b + 1, 1e3 * distance);
                }
                continue;
            }
            let seen = rotation * point + origin;
            let [x, y, z]: [f64; 3] = seen.map(|v| 1e3 * (v + noise())).into();
            _ = writeln!(csv, "{line},{x:.5},{y:.5},{z:.5},{noise_um}");
        }
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_as_declared_goes_where_it_is_told() {
        let mut random = Random::new(1);
        for _ in 0..20 {
            let (pose, _) = command(Case::Parallel, &mut random);
            let (a, rotation) =
                DECLARED.assembly(DECLARED.lengths(pose), [pose[0] + 0.02, pose[1] - 0.02, pose[2] + 0.01]);
            let (told, axes) = Machine::platform(pose);
            assert!((a - told).amax() < 1e-11 && (rotation - axes).amax() < 1e-11);
        }
    }
}

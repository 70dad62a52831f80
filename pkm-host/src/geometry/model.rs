//! The machine with its true sizes at commanded screw lengths, as the engine takes it.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3, Vector6};
use pkm_core::kinematics::platform_axes;
use pkm_core::machine::{Geometry, Travel};
use pkm_core::{Configuration, FiveAxis, Machine, MachineParameters, ScrewLengths, Wrist, WristParameters};
use pkm_diagnosis::{Candidate, CommonErrors, ForwardModel, Kind, Parameter, Prior, Role, Unknown};

use super::flaws::{self, Flaw, Give};
use crate::files::machine::MachineFile;
use crate::files::unloaded::{Commanded, Unloaded};
use crate::tracker::rigid::Motion;

/// x, y, z and distance.
pub const CHANNELS: usize = 4;
/// 1 sd of what nobody has declared: where the measuring frame stands, targets and balls; m and rad.
const UNDECLARED: f64 = 1.0;
/// Plausible turn of a joint's axis, rad.
const JOINT_AXIS_RAD: f64 = 1e-3;
/// Plausible distance of a joint from its place, m: what the sizes of the platforms can't say.
const JOINT_PLACE_M: f64 = 1e-4;
/// Plausible error of a screw's pitch, relative.
const PITCH: f64 = 1e-4;

/// What an unknown changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// a1, a2, b1, b2.
    Size(usize),
    /// True length less the commanded one.
    ScrewZero(usize),
    /// offset, first d, first b, second b, flange.
    Wrist(usize),
    /// True angle less the commanded one.
    Beta(usize),
    /// Tip beside the plane of the wrist's first axis and the spindle.
    ToolY,
    /// Where the measuring frame stands.
    Shift(usize),
    /// How it is turned.
    Turn(usize),
    /// Coordinate of a target.
    Target(usize, usize),
    /// Coordinate of a ball.
    Ball(usize, usize),
    /// See [`Flaw`].
    Flaw(usize),
    /// Relative, of a screw.
    Pitch(usize),
}

impl Meaning {
    /// Whether it is of the machine and not of the measurement or a candidate.
    pub fn is_of_machine(self) -> bool {
        matches!(self, Self::Size(_) | Self::ScrewZero(_) | Self::Wrist(_) | Self::Beta(_) | Self::ToolY)
    }

    /// Whether it is of the measurement.
    pub fn is_of_measurement(self) -> bool {
        matches!(self, Self::Shift(_) | Self::Turn(_) | Self::Target(..) | Self::Ball(..))
    }

    /// Whether it is an angle and not a length.
    pub fn is_angle(self) -> bool {
        matches!(self, Self::Beta(_) | Self::Turn(_))
    }

    /// As in files.
    pub fn key(self) -> String {
        const SIZES: [&str; 4] = ["a1_mm", "a2_mm", "b1_mm", "b2_mm"];
        const WRIST: [&str; 5] = ["offset_mm", "first.d_mm", "first.b_mm", "second.b_mm", "flange_mm"];
        const AXES: [&str; 3] = ["x", "y", "z"];
        match self {
            Self::Size(i) => format!("geometry.{}", SIZES[i]),
            Self::ScrewZero(i) => format!("zero.q{}_mm", i + 1),
            Self::Wrist(i) => format!("wrist.{}", WRIST[i]),
            Self::Beta(i) => format!("zero.beta{}_mrad", i + 1),
            Self::ToolY => "tool.y_mm".into(),
            Self::Shift(i) => format!("frame.{}_mm", AXES[i]),
            Self::Turn(i) => format!("frame.r{}_mrad", AXES[i]),
            Self::Target(n, i) => format!("target.{}.{}_mm", n + 1, AXES[i]),
            Self::Ball(n, i) => format!("ball.{}.{}_mm", n + 1, AXES[i]),
            Self::Flaw(n) => format!("joint.{}", n + 1),
            Self::Pitch(i) => format!("pitch.q{}", i + 1),
        }
    }
}

/// Numbers of the machine and the measurement together, SI.
#[derive(Clone)]
pub struct Values {
    pub sizes_m: [f64; 4],
    pub zeros_m: [f64; 3],
    pub wrist_m: [f64; 5],
    pub beta_rad: [f64; 2],
    pub tool_y_m: f64,
    shift_m: Vector3<f64>,
    turn_rad: Vector3<f64>,
    pub targets_m: Vec<Vector3<f64>>,
    pub balls_m: Vec<Vector3<f64>>,
    flaws: Vec<f64>,
    pitch: [f64; 3],
}

/// Where the measurement begins: the measuring frame, targets and balls, by the declared machine.
pub struct Start {
    pub frame: Motion,
    pub targets_m: Vec<Vector3<f64>>,
    pub balls_m: Vec<Vector3<f64>>,
}

/// All that may be unknown of a machine and its measurement.
pub struct Model {
    parameters_of_machine: MachineParameters,
    wrist: WristParameters,
    declared: Values,
    frame: Motion,
    pub parameters: Vec<Parameter>,
    pub meanings: Vec<Meaning>,
    pub candidates: Vec<Candidate>,
    flaws: Vec<Flaw>,
    /// For the motions that flaws cause.
    declared_machine: Machine<f64>,
}

impl Model {
    /// Of a machine and its unloaded readings. `None` for a machine without posture.
    pub fn new(file: &MachineFile, unloaded: &Unloaded, start: Start) -> Option<Self> {
        let wrist = file.wrist_parameters;
        let declared = Values::declared(file, &start);
        let mut this = Self {
            parameters_of_machine: without_geometry_effects(&file.parameters),
            wrist,
            declared,
            frame: start.frame,
            parameters: Vec::new(),
            meanings: Vec::new(),
            candidates: Vec::new(),
            flaws: [Flaw::turns(), Flaw::places()].concat(),
            declared_machine: file.without_travel()?,
        };
        let u = &file.uncertainty;
        let has_wrist = unloaded.has_wrist();
        (0..4).for_each(|i| this.declare(Meaning::Size(i), u.geometry_m));
        (0..3).for_each(|i| this.declare(Meaning::ScrewZero(i), u.geometry_m));
        if has_wrist {
            (0..5).for_each(|i| this.declare(Meaning::Wrist(i), u.geometry_m));
            (0..2).for_each(|i| this.declare(Meaning::Beta(i), u.geometry_rad));
            this.declare(Meaning::ToolY, u.geometry_m);
        }
        if unloaded.sights.iter().any(|s| s.ball.is_none()) {
            (0..3).for_each(|i| this.declare(Meaning::Shift(i), UNDECLARED));
            (0..3).for_each(|i| this.declare(Meaning::Turn(i), UNDECLARED));
        }
        for (n, target) in unloaded.targets.iter().enumerate() {
            let scale = if target.at_m.is_none() { UNDECLARED } else { target.sd_m };
            if scale > 0.0 {
                (0..3).for_each(|i| this.declare(Meaning::Target(n, i), scale));
            }
        }
        for n in 0..unloaded.balls.len() {
            (0..3).for_each(|i| this.declare(Meaning::Ball(n, i), UNDECLARED));
        }
        let turns = Flaw::turns().len();
        let (all, meaning) = (this.flaws.len(), |n| Meaning::Flaw(n));
        this.candidate("joint-axes", "joints", (0..turns).map(meaning).collect(), JOINT_AXIS_RAD);
        this.candidate("joint-places", "joints", (turns..all).map(meaning).collect(), JOINT_PLACE_M);
        this.candidate("screw-pitch", "screws", (0..3).map(Meaning::Pitch).collect(), PITCH);
        Some(this)
    }

    fn declare(&mut self, meaning: Meaning, scale: f64) {
        self.add(meaning, scale, Role::Declared);
    }

    fn add(&mut self, meaning: Meaning, scale: f64, role: Role) -> Unknown {
        self.meanings.push(meaning);
        self.parameters.push(Parameter { prior: Prior::Normal { scale }, role, ambiguous: false });
        Unknown(self.parameters.len() - 1)
    }

    fn candidate(&mut self, name: &str, place: &str, meanings: Vec<Meaning>, scale: f64) {
        let unknowns = meanings.into_iter().map(|m| self.add(m, scale, Role::Amplitude { one_sided: false })).collect();
        let (names, place) = (vec![name.to_owned()], place.to_owned());
        self.candidates.push(Candidate {
            names,
            kind: Kind::Effect,
            place,
            unknowns,
            start: Vec::new(),
            is_free: false,
        });
    }

    /// Unknowns of a kind.
    pub fn unknowns(&self, is: impl Fn(Meaning) -> bool) -> Vec<Unknown> {
        (0..self.meanings.len()).filter(|n| is(self.meanings[*n])).map(Unknown).collect()
    }

    /// Prior standard deviation, SI.
    pub fn scale(&self, unknown: Unknown) -> f64 {
        self.parameters[unknown.0].prior.value(1.0)
    }

    /// Numbers of the machine at `x`.
    pub fn values(&self, unknowns: &[Unknown], x: &[f64]) -> Values {
        let mut values = self.declared.clone();
        for (u, x) in unknowns.iter().zip(x) {
            *values.of(self.meanings[u.0]) += self.parameters[u.0].prior.value(*x);
        }
        values
    }

    /// Declared number of an unknown, SI; 0 for what is counted from the start of the fit.
    pub fn declared_value(&self, unknown: Unknown) -> f64 {
        *self.declared.clone().of(self.meanings[unknown.0])
    }

    /// The measuring frame at some numbers: from B to it.
    pub fn frame_at(&self, values: &Values) -> Motion {
        Motion {
            rotation: Rotation3::new(values.turn_rad) * self.frame.rotation,
            translation_m: self.frame.translation_m + values.shift_m,
        }
    }

    fn machine(&self, values: &Values) -> Option<Machine<f64>> {
        let [a1_m, a2_m, b1_m, b2_m] = values.sizes_m;
        let geometry = Geometry { a1_m, a2_m, b1_m, b2_m };
        let travel = Travel { min_m: [1e-9; 3], max_m: [1e9; 3] };
        Machine::<f64>::new(&MachineParameters { geometry, travel, ..self.parameters_of_machine }).ok()
    }

    fn wrist(&self, values: &Values) -> Option<Wrist<f64>> {
        let [offset_m, first_d_m, first_b_m, second_b_m, flange_m] = values.wrist_m;
        let pi = std::f64::consts::PI;
        let free = WristParameters { min_rad: [-pi; 2], max_rad: [pi; 2], ..self.wrist };
        Wrist::<f64>::new(&WristParameters { offset_m, first_d_m, first_b_m, second_b_m, flange_m, ..free }).ok()
    }
}

/// The sizes are taken from elsewhere.
fn without_geometry_effects(parameters: &MachineParameters) -> MachineParameters {
    let mut effects = parameters.effects;
    for (info, values) in pkm_core::effects::EFFECTS.iter().zip(&mut effects.parameters) {
        if info.id.starts_with("geometry-") {
            values.fill(0.0);
        }
    }
    MachineParameters { effects, ..*parameters }
}

impl Values {
    fn declared(file: &MachineFile, start: &Start) -> Self {
        let g = file.parameters.actual_geometry();
        let w = &file.wrist_parameters;
        Self {
            sizes_m: [g.a1_m, g.a2_m, g.b1_m, g.b2_m],
            zeros_m: [0.0; 3],
            wrist_m: [w.offset_m, w.first_d_m, w.first_b_m, w.second_b_m, w.flange_m],
            beta_rad: [0.0; 2],
            tool_y_m: 0.0,
            shift_m: Vector3::zeros(),
            turn_rad: Vector3::zeros(),
            targets_m: start.targets_m.clone(),
            balls_m: start.balls_m.clone(),
            flaws: vec![0.0; Flaw::turns().len() + Flaw::places().len()],
            pitch: [0.0; 3],
        }
    }

    fn of(&mut self, meaning: Meaning) -> &mut f64 {
        match meaning {
            Meaning::Size(i) => &mut self.sizes_m[i],
            Meaning::ScrewZero(i) => &mut self.zeros_m[i],
            Meaning::Wrist(i) => &mut self.wrist_m[i],
            Meaning::Beta(i) => &mut self.beta_rad[i],
            Meaning::ToolY => &mut self.tool_y_m,
            Meaning::Shift(i) => &mut self.shift_m[i],
            Meaning::Turn(i) => &mut self.turn_rad[i],
            Meaning::Target(n, i) => &mut self.targets_m[n][i],
            Meaning::Ball(n, i) => &mut self.balls_m[n][i],
            Meaning::Flaw(n) => &mut self.flaws[n],
            Meaning::Pitch(i) => &mut self.pitch[i],
        }
    }
}

/// Where the parts of a machine are at a command, in B.
pub struct Placed {
    a_m: Vector3<f64>,
    axes: Matrix3<f64>,
    /// Tip and axes of the tool.
    tool: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Of A, then rotation, in A-uvw: what flaws add.
    aside: Vector6<f64>,
}

impl Placed {
    /// Where a target is, at its place on the tool or on the platform.
    pub fn point_m(&self, at_m: &Vector3<f64>, tool_y_m: f64) -> Vector3<f64> {
        let point = match &self.tool {
            Some((tip, axes)) => tip + axes * (at_m + Vector3::y() * tool_y_m),
            None => self.a_m + self.axes * at_m,
        };
        let [shift, turn] = [0, 3].map(|first| self.axes * self.aside.fixed_rows::<3>(first));
        point + shift + turn.cross(&(point - self.a_m))
    }

    /// A, and u, v, w as columns.
    pub fn platform(&self) -> (Vector3<f64>, Matrix3<f64>) {
        (self.a_m, self.axes)
    }
}

/// A model under the conditions of some readings.
pub struct Experiment<'a> {
    pub model: &'a Model,
    unloaded: &'a Unloaded,
    /// Motions of the platform by unit flaws, by pose.
    responses: Vec<Vec<Vector6<f64>>>,
}

impl<'a> Experiment<'a> {
    /// `None` where the declared machine has no posture.
    pub fn new(model: &'a Model, unloaded: &'a Unloaded) -> Option<Self> {
        Self::with(model, unloaded, &[1.0; 8])
    }

    /// The same, whose limbs give otherwise where they strain.
    pub fn with(model: &'a Model, unloaded: &'a Unloaded, give: &Give) -> Option<Self> {
        let of = |p: &Commanded| flaws::responses(&model.declared_machine, &p.named.pose, &model.flaws, give);
        let responses = unloaded.poses.iter().map(of).collect::<Option<_>>()?;
        Some(Self { model, unloaded, responses })
    }

    /// Where the machine is at all commands.
    pub fn placed(&self, values: &Values) -> Option<Vec<Placed>> {
        let (machine, wrist) = (self.model.machine(values)?, self.model.wrist(values)?);
        let has_flaws = values.flaws.iter().any(|f| *f != 0.0);
        let of = |(n, p): (usize, &Commanded)| {
            let at = |i: usize| p.lengths.q_m[i] * (1.0 + values.pitch[i]) + values.zeros_m[i];
            let pose = machine.forward(&ScrewLengths { q_m: Vector3::from_fn(|i, _| at(i)) }).ok()?;
            let tool = match p.beta_rad {
                None => None,
                Some(beta) => {
                    let five = FiveAxis { machine: &machine, wrist: &wrist };
                    let beta_rad = beta + Vector2::from(values.beta_rad);
                    let frame = five.frame(&Configuration { pose, beta_rad }).ok()?;
                    Some((frame.tip_m, frame.axes))
                }
            };
            let aside = if has_flaws {
                self.responses[n].iter().zip(&values.flaws).map(|(r, f)| r * *f).sum()
            } else {
                Vector6::zeros()
            };
            let axes = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
            Some(Placed { a_m: pose.a_in_b_m(), axes, tool, aside })
        };
        self.unloaded.poses.iter().enumerate().map(of).collect()
    }

    /// What is read at all sights.
    fn read(&self, values: &Values) -> Option<Vec<f64>> {
        let placed = self.placed(values)?;
        let frame = self.model.frame_at(values);
        let mut all = vec![0.0; CHANNELS * self.unloaded.sights.len()];
        for (sight, read) in self.unloaded.sights.iter().zip(all.chunks_exact_mut(CHANNELS)) {
            let point = placed[sight.pose].point_m(&values.targets_m[sight.target], values.tool_y_m);
            match sight.ball {
                None => read[..3].copy_from_slice(frame.of(&point).as_slice()),
                Some(ball) => read[3] = (point - values.balls_m[ball]).norm(),
            }
        }
        Some(all)
    }
}

impl ForwardModel for Experiment<'_> {
    fn parameters(&self) -> &[Parameter] {
        &self.model.parameters
    }

    fn candidates(&self) -> &[Candidate] {
        &self.model.candidates
    }

    fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<Vec<f64>> {
        self.read(&self.model.values(unknowns, x))
    }

    fn common_errors(&self) -> Option<CommonErrors> {
        None
    }
}

//! The model with its unknowns: declared stiffnesses, amplitudes of effects, errors of the measurement.
//!
//! Every unknown is a number x with a standard normal prior, so that all of them weigh alike.

use pkm_core::effects::{EFFECTS, EffectInfo, MAX_PARAMETERS};
use pkm_core::machine::{Joint, Tube};
use pkm_core::{Deflection, LoadResponse, Machine, MachineParameters, Pose, StiffnessFactor, Wrench};

use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Condition};

/// Errors of the measurement: no part of the machine, and none of the model that the controller runs.
pub const MEASUREMENT: [EffectInfo; 4] = [
    EffectInfo { id: "sensor-rotation", parameters: &["about_u_rad", "about_v_rad", "about_w_rad"], signed: true },
    EffectInfo { id: "sensor-scale", parameters: &["translations", "rotations"], signed: true },
    EffectInfo { id: "load-gain", parameters: &["forces", "moments"], signed: true },
    EffectInfo { id: "load-point", parameters: &["along_u_m", "along_v_m", "along_w_m"], signed: true },
];

/// Effects of the machine, then of the measurement.
pub const COUNT: usize = EFFECTS.len() + MEASUREMENT.len();

/// What is known of a candidate.
pub fn info(effect: usize) -> EffectInfo {
    EFFECTS.get(effect).copied().unwrap_or_else(|| MEASUREMENT[effect - EFFECTS.len()])
}

/// Whether an effect belongs to the measurement.
pub fn is_measurement(effect: usize) -> bool {
    effect >= EFFECTS.len()
}

/// A declared stiffness of the machine file. Young's and shear modulus count for rod and screw together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Declared {
    /// 0, 1, 2.
    pub limb: usize,
    /// Which part.
    pub part: Part,
}

/// A part of a limb with a declared stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // the keys of the machine file
pub enum Part {
    BaseLinear(usize),
    BaseAngular(usize),
    PlatformLinear(usize),
    PlatformAngular(usize),
    Young,
    Shear,
}

impl Declared {
    /// Every declared stiffness that is not 0.
    pub fn all(parameters: &MachineParameters) -> Vec<Self> {
        let mut all = Vec::new();
        for (limb, l) in parameters.limbs.iter().enumerate() {
            let mut joint = |j: &Joint, linear: fn(usize) -> Part, angular: fn(usize) -> Part| {
                for axis in 0..3 {
                    all.push(Self { limb, part: linear(axis) });
                    if j.angular_nm_per_rad[axis] > 0.0 {
                        all.push(Self { limb, part: angular(axis) });
                    }
                }
            };
            joint(&l.base_joint, Part::BaseLinear, Part::BaseAngular);
            joint(&l.platform_joint, Part::PlatformLinear, Part::PlatformAngular);
            all.push(Self { limb, part: Part::Young });
            // the S joint of limb 3 passes no torque on
            if limb < 2 {
                all.push(Self { limb, part: Part::Shear });
            }
        }
        all
    }

    /// As in the machine file, without the axis.
    pub fn key(&self) -> String {
        let limb = self.limb + 1;
        match self.part {
            Part::BaseLinear(_) => format!("limb.{limb}.base_joint.linear_n_per_m"),
            Part::BaseAngular(_) => format!("limb.{limb}.base_joint.angular_nm_per_rad"),
            Part::PlatformLinear(_) => format!("limb.{limb}.platform_joint.linear_n_per_m"),
            Part::PlatformAngular(_) => format!("limb.{limb}.platform_joint.angular_nm_per_rad"),
            Part::Young => format!("limb.{limb}.body.young_gpa"),
            Part::Shear => format!("limb.{limb}.body.shear_gpa"),
        }
    }

    /// Axis of a joint's stiffness.
    pub fn axis(&self) -> Option<usize> {
        match self.part {
            Part::BaseLinear(i) | Part::BaseAngular(i) | Part::PlatformLinear(i) | Part::PlatformAngular(i) => Some(i),
            Part::Young | Part::Shear => None,
        }
    }

    /// Calls `change` with every number that it stands for.
    fn each(&self, parameters: &mut MachineParameters, mut change: impl FnMut(&mut f64)) {
        let l = &mut parameters.limbs[self.limb];
        let tubes = |b: &mut pkm_core::machine::Body, change: &mut dyn FnMut(&mut Tube)| {
            change(&mut b.rod);
            change(&mut b.screw);
        };
        match self.part {
            Part::BaseLinear(i) => change(&mut l.base_joint.linear_n_per_m[i]),
            Part::BaseAngular(i) => change(&mut l.base_joint.angular_nm_per_rad[i]),
            Part::PlatformLinear(i) => change(&mut l.platform_joint.linear_n_per_m[i]),
            Part::PlatformAngular(i) => change(&mut l.platform_joint.angular_nm_per_rad[i]),
            Part::Young => tubes(&mut l.body, &mut |t| change(&mut t.young_pa)),
            Part::Shear => tubes(&mut l.body, &mut |t| change(&mut t.shear_pa)),
        }
    }

    /// Its value, of the rod for a body; moduli in GPa.
    pub fn value(&self, parameters: &MachineParameters) -> f64 {
        let mut found = Vec::new();
        self.each(&mut parameters.clone(), |v| found.push(*v));
        let unit = if matches!(self.part, Part::Young | Part::Shear) { 1e-9 } else { 1.0 };
        found[0] * unit
    }
}

/// What is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unknown {
    /// ln of a declared stiffness over its declared value, in units of its uncertainty.
    Stiffness(Declared),
    /// A whole class of stiffnesses declared wrong, by its place in [`Model::classes`]: ln of a common factor in units
    /// of [`GROSS`].
    Class(usize),
    /// A parameter of an effect.
    Effect {
        /// Index over machine and measurement.
        effect: usize,
        /// Index into its parameters.
        parameter: usize,
    },
}

/// Standard deviation of ln of the common factor when a class of stiffnesses was declared wrong.
pub const GROSS: f64 = 0.5;

/// Declared stiffnesses that go wrong together: one stiffness, one part of a limb, the same part of two or three limbs.
#[derive(Clone, Debug, PartialEq)]
pub struct Class {
    /// What it holds.
    pub members: Vec<Declared>,
}

impl Class {
    fn all(parameters: &MachineParameters) -> Vec<Self> {
        let all = Declared::all(parameters);
        let mut classes: Vec<Self> = Vec::new();
        let mut add = |members: Vec<Declared>| {
            let class = Self { members };
            if !class.members.is_empty() && !classes.contains(&class) {
                classes.push(class);
            }
        };
        for limbs in [&[0][..], &[1], &[2], &[0, 1], &[0, 1, 2]] {
            let of = |d: &&Declared| limbs.contains(&d.limb);
            let like = |part: Part| all.iter().filter(of).filter(|d| d.part == part).copied().collect::<Vec<_>>();
            // the key without `limb.N.`
            let kind = |d: &Declared| d.key()[7..].to_owned();
            let mut kinds: Vec<String> = all.iter().filter(of).map(kind).collect();
            kinds.dedup();
            // joints of limb 3 are others than those of 1 and 2
            if limbs.len() < 3 {
                for d in all.iter().filter(of) {
                    add(like(d.part));
                }
                for k in &kinds {
                    add(all.iter().filter(of).filter(|d| kind(d) == *k).copied().collect());
                }
            } else {
                add(like(Part::Young));
            }
        }
        classes
    }

    /// Keys of the machine file, each once.
    pub fn keys(&self) -> Vec<String> {
        let mut keys: Vec<String> = self.members.iter().map(Declared::key).collect();
        keys.sort();
        keys.dedup();
        keys
    }
}

/// What is plausible for a parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Plausible {
    /// An amplitude: 0 for no effect, this much as one standard deviation.
    Amplitude(f64),
    /// The shape of an effect: a middle, and a standard deviation of the logarithm.
    Around(f64, f64),
    /// A length between 0 and a greatest one, most likely at three quarters of it.
    Within(f64),
}

/// A machine, with the scales that make its unknowns alike.
pub struct Model {
    /// As declared.
    pub declared: MachineParameters,
    /// Relative standard deviation of declared stiffnesses.
    pub uncertainty: f64,
    /// Stiffnesses that may be declared wrong together.
    pub classes: Vec<Class>,
    /// By effect and parameter.
    pub plausible: Vec<[Plausible; MAX_PARAMETERS]>,
}

/// Parameters of a machine and of a measurement, at which predictions are made.
#[derive(Clone, Debug)]
pub struct State {
    /// Of the machine.
    pub machine: MachineParameters,
    /// By effect and parameter, as in [`MEASUREMENT`].
    pub measurement: [[f64; MAX_PARAMETERS]; MEASUREMENT.len()],
}

impl Model {
    /// Scales of effects follow from the machine's own compliance in the middle of its box.
    pub fn new(file: &MachineFile) -> Option<Self> {
        let declared = file.parameters;
        let [theta, sigma, z0] = file.pose_box.middle();
        let pose = crate::pose::pose_of(theta, sigma, z0);
        let factor = file.machine.stiffness(&pose).ok()?.factor().ok()?;
        let mut own = [0.0; 6];
        for (i, own) in own.iter_mut().enumerate() {
            let unit = Wrench::from_array(std::array::from_fn(|k| f64::from(k == i)));
            *own = factor.deflection(&unit).ok()?.to_array()[i];
        }
        // three limbs share a load along w, and bend side by side along u
        let (axial, across) = (3.0 * own[2], 3.0 * own[0]);
        let turning = own[3..].iter().copied().fold(f64::INFINITY, f64::min);
        let g = &declared.geometry;
        let (arm, stroke) = (0.5 * (g.a1_m + g.a2_m), declared.travel.min_m[0]);
        let longest = declared.travel.max_m.into_iter().fold(0.0, f64::max);
        let angular = declared.limbs.iter().flat_map(|l| {
            let (b, p) = (l.base_joint.angular_nm_per_rad, l.platform_joint.angular_nm_per_rad);
            b.into_iter().chain(p).filter(|k| *k > 0.0)
        });
        let tilting = 2.0 / angular.fold(f64::INFINITY, f64::min);
        let scale = |id: &str, name: &str| -> Plausible {
            use Plausible::{Amplitude, Around, Within};
            match (id, name) {
                ("moving-platform-compliance", "hub_rad_per_nm") => Amplitude(turning),
                ("moving-platform-compliance", "bridge_m_per_n") => Amplitude(2.0 * axial),
                ("moving-platform-compliance", _) => Amplitude(6.0 * axial / arm.powi(3)),
                ("base-compliance", "mount_rad_per_nm") => Amplitude(axial / (g.b1_m * g.b1_m)),
                // the tube ends before the shortest limb does
                ("telescopic-limb", "tube_m") => Within(stroke),
                // and overlaps the ram at the longest
                ("telescopic-limb", "ram_m") => Around(longest - 0.75 * stroke + 0.12, 0.15),
                ("telescopic-limb", "ram_bending_per_nm2" | "ram_torsion_per_nm2") => {
                    Amplitude(3.0 * across / stroke.powi(3))
                }
                ("telescopic-limb", "guide_m_per_n") => Amplitude(axial),
                ("screw-position", _) | ("telescopic-limb", "screw_axial_per_n") => Amplitude(2.0 * axial / stroke),
                ("wrist-compliance", "angular_rad_per_nm") => Amplitude(turning),
                ("clearance", "play_m") => Amplitude(30e-6),
                ("clearance", _) => Around(20.0, 1.0),
                ("contact-stiffening", "reference_n") => Around(100.0, 1.0),
                ("friction-hysteresis", "lag_m") => Amplitude(5e-6),
                ("friction-hysteresis", "lag_m_per_n") => Amplitude(0.3 * axial),
                ("friction-hysteresis", "reversal_n") => Around(50.0, 1.0),
                ("preload", _) => Amplitude(1e4),
                ("platform-offset", name) if name.starts_with("aside") => Amplitude(3e-3),
                ("platform-offset", _) => Amplitude(20e-3),
                ("thermal-modulus", _) => Amplitude(0.01),
                ("thermal-expansion", _) => Amplitude(3e-5),
                (id, _) if id.starts_with("geometry-") => Amplitude(5e-3),
                ("sensor-rotation", _) => Amplitude(0.02),
                ("sensor-scale", _) => Amplitude(0.03),
                ("load-gain", _) => Amplitude(0.05),
                ("load-point", _) => Amplitude(5e-3),
                (_, name) if name.ends_with("rad_per_nm") => Amplitude(tilting),
                _ => Amplitude(2.0 * axial),
            }
        };
        let plausible = (0..COUNT)
            .map(|effect| {
                let info = info(effect);
                std::array::from_fn(|p| info.parameters.get(p).map_or(Plausible::Amplitude(1.0), |n| scale(info.id, n)))
            })
            .collect();
        let classes = Class::all(&declared);
        Some(Self { declared, uncertainty: file.uncertainty.stiffness, classes, plausible })
    }

    /// All declared stiffnesses as unknowns.
    pub fn stiffnesses(&self) -> Vec<Unknown> {
        Declared::all(&self.declared).into_iter().map(Unknown::Stiffness).collect()
    }

    /// The parameters of an effect as unknowns.
    pub fn of_effect(&self, effect: usize) -> Vec<Unknown> {
        (0..info(effect).parameters.len()).map(|parameter| Unknown::Effect { effect, parameter }).collect()
    }

    /// Whether an unknown is the amplitude of a candidate, and not a stiffness or a shape.
    pub fn is_amplitude(&self, unknown: &Unknown) -> bool {
        match *unknown {
            Unknown::Stiffness(_) => false,
            Unknown::Class(_) => true,
            Unknown::Effect { effect, parameter } => {
                matches!(self.plausible[effect][parameter], Plausible::Amplitude(_))
            }
        }
    }

    /// Whether an unknown must not be negative.
    pub fn is_one_sided(&self, unknown: &Unknown) -> bool {
        matches!(*unknown, Unknown::Effect { effect, .. } if self.is_amplitude(unknown) && !info(effect).signed)
    }

    /// A parameter of an effect from its unknown.
    pub fn amplitude(&self, effect: usize, parameter: usize, x: f64) -> f64 {
        match self.plausible[effect][parameter] {
            Plausible::Amplitude(scale) => scale * x,
            Plausible::Around(middle, deviation) => middle * (deviation * x).exp(),
            Plausible::Within(greatest) => greatest / (1.0 + (-x).exp() / 3.0),
        }
    }

    /// Standard error of a parameter from that of its unknown.
    pub fn amplitude_error(&self, effect: usize, parameter: usize, x: f64, error: f64) -> f64 {
        match self.plausible[effect][parameter] {
            Plausible::Amplitude(scale) => scale * error,
            Plausible::Around(_, deviation) => self.amplitude(effect, parameter, x) * deviation * error,
            Plausible::Within(greatest) => {
                let value = self.amplitude(effect, parameter, x);
                value * (1.0 - value / greatest) * error
            }
        }
    }

    /// Machine and measurement at `x`. Negative amplitudes of one-sided effects are left out, or with `mirrored` taken
    /// alone and with the opposite sign.
    pub fn state(&self, unknowns: &[Unknown], x: &[f64], mirrored: bool) -> State {
        let mut state = State { machine: self.declared, measurement: [[0.0; MAX_PARAMETERS]; MEASUREMENT.len()] };
        for (unknown, x) in unknowns.iter().zip(x) {
            match *unknown {
                Unknown::Stiffness(declared) => {
                    let ratio = (self.uncertainty * x).exp();
                    declared.each(&mut state.machine, |v| *v *= ratio);
                }
                Unknown::Class(class) => {
                    let ratio = (GROSS * x).exp();
                    self.classes[class].members.iter().for_each(|d| d.each(&mut state.machine, |v| *v *= ratio));
                }
                Unknown::Effect { effect, parameter } => {
                    let x = if !self.is_one_sided(unknown) {
                        *x
                    } else if mirrored {
                        (-x).max(0.0)
                    } else {
                        x.max(0.0)
                    };
                    let value = self.amplitude(effect, parameter, x);
                    match EFFECTS.get(effect) {
                        Some(_) => state.machine.effects.parameters[effect][parameter] += value,
                        None => state.measurement[effect - EFFECTS.len()][parameter] += value,
                    }
                }
            }
        }
        state
    }

    /// Predictions at `x`, by condition. An amplitude below 0 that has no physical meaning acts like its positive self
    /// with the opposite sign, so that a fit sees no edge at 0.
    pub fn predict(
        &self,
        poses: &[Pose<f64>],
        conditions: &[Condition],
        unknowns: &[Unknown],
        x: &[f64],
    ) -> Option<Vec<[f64; CHANNELS]>> {
        let mut found = self.state(unknowns, x, false).predict(poses, conditions)?;
        if unknowns.iter().zip(x).any(|(u, x)| *x < 0.0 && self.is_one_sided(u)) {
            let mirror = self.state(unknowns, x, true).predict(poses, conditions)?;
            let without: Vec<f64> =
                unknowns.iter().zip(x).map(|(u, x)| if self.is_one_sided(u) { 0.0 } else { *x }).collect();
            let none = self.state(unknowns, &without, false).predict(poses, conditions)?;
            for ((found, mirror), none) in found.iter_mut().zip(&mirror).zip(&none) {
                for c in 0..CHANNELS {
                    found[c] -= mirror[c] - none[c];
                }
            }
        }
        Some(found)
    }
}

/// What determines the deflections of a machine at a pose.
fn answer<'a>(machine: &'a Machine<f64>, pose: &Pose<f64>) -> Option<(StiffnessFactor<f64>, LoadResponse<'a, f64>)> {
    Some((machine.stiffness(pose).ok()?.factor().ok()?, machine.load_response(pose).ok()?))
}

impl State {
    /// What the sensor reads in each condition, m and rad.
    pub fn predict(&self, poses: &[Pose<f64>], conditions: &[Condition]) -> Option<Vec<[f64; CHANNELS]>> {
        let machine = Machine::<f64>::new(&self.machine).ok()?;
        let [rotation, scale, gain, point] = self.measurement;
        let loaded = |w: &Wrench<f64>, at: [f64; 3]| {
            let w = Wrench {
                force_n: w.force_n.map(|f| f * (1.0 + gain[0])),
                moment_nm: w.moment_nm.map(|m| m * (1.0 + gain[1])),
            };
            w.moved_to_a([at[0] + point[0], at[1] + point[1], at[2] + point[2]])
        };
        let on = |ids: &[&str]| {
            let parameters = self.machine.effects.parameters;
            EFFECTS.iter().zip(parameters).any(|(e, p)| ids.contains(&e.id) && p.iter().any(|v| *v != 0.0))
        };
        let warms = on(&["thermal-modulus"]);
        let grows = on(&["thermal-expansion"]);
        // one stiffness a pose, unless it changes with every temperature
        let mut at: Vec<Option<(StiffnessFactor<f64>, LoadResponse<'_, f64>)>> = vec![None; poses.len()];
        let mut found = Vec::with_capacity(conditions.len());
        for c in conditions {
            let pose = &poses[c.pose];
            let warm;
            let (machine, (factor, response)) = if warms {
                warm = machine.at_temperature(c.temperature_c).ok()?;
                (&warm, answer(&warm, pose)?)
            } else {
                let there = match at[c.pose] {
                    Some(there) => there,
                    None => *at[c.pose].insert(answer(&machine, pose)?),
                };
                (&machine, there)
            };
            let wrench = loaded(&c.wrench, c.point_m);
            let turned_at = loaded(&c.turned_at, c.point_m);
            let linear: Deflection<f64> = factor.deflection(&wrench).ok()?;
            let mut d = linear.plus(&response.deflection(&wrench, &turned_at).ok()?);
            if grows {
                d = d.plus(&machine.thermal_deflection(pose, c.rise_k).ok()?);
            }
            let d = d.seen_at(c.point_m);
            let turned = |v: [f64; 3], scale: f64| -> [f64; 3] {
                let [x, y, z, ..] = rotation;
                [
                    (v[0] + y * v[2] - z * v[1]) * (1.0 + scale),
                    (v[1] + z * v[0] - x * v[2]) * (1.0 + scale),
                    (v[2] + x * v[1] - y * v[0]) * (1.0 + scale),
                ]
            };
            let ([a, b, c], [d, e, f]) = (turned(d.translation_m, scale[0]), turned(d.rotation_rad, scale[1]));
            found.push([a, b, c, d, e, f]);
        }
        Some(found)
    }
}

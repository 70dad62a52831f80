//! The model with its unknowns: declared stiffnesses, amplitudes of effects, errors of the measurement.
//!
//! Every unknown is a number x with a standard normal prior, so that all of them weigh alike.

use std::collections::HashMap;

use nalgebra::DVector;
use pkm_core::effects::{
    EFFECTS, EffectInfo, Expected, LIMB_3, LIMBS_1_2, MachineScales, ParameterInfo, Plausible, ToldBy,
};
use pkm_core::machine::Machine;
use pkm_core::{MachineParameters, Pose, ScrewLengths};
use pkm_diagnosis::{Candidate, Kind, Parameter, Prior, Role, Unknown};

use super::declared::{Class, Declared};
use super::elements::{ElementParameter, Family, Usual, families};
use super::places::Whereabouts;
use super::state::{State, compliance};
use super::{ELEMENT, Method};
use crate::files::machine::{MachineFile, Uncertainty};
use crate::files::readings::{CHANNELS, Condition, Readings};

/// Errors of the measurement: no part of the machine, and none of the model that the controller runs.
pub const MEASUREMENT: [EffectInfo; 4] = [
    of_measurement(
        "sensor-rotation",
        &["sensor"],
        "the sensor: directions of its axes",
        &[normal("about_u_rad", |_| 0.02), normal("about_v_rad", |_| 0.02), normal("about_w_rad", |_| 0.02)],
    ),
    of_measurement(
        "sensor-scale",
        &["sensor"],
        "the sensor: its calibration, of rotations and of translations (the readings tell their ratio alone: where the translations are wrong, \
         every stiffness is by as much)",
        &[normal("translations", |_| 0.03), normal("rotations", |_| 0.03)],
    ),
    of_measurement(
        "load-gain",
        &["load"],
        "the load cell or weights: their calibration, of forces and of moments (the readings tell their ratio alone: where the forces are \
         wrong, every stiffness is by as much)",
        &[normal("forces", |_| 0.05), normal("moments", |_| 0.05)],
    ),
    of_measurement(
        "load-point",
        &["load"],
        "the loading gear: where the load acts",
        &[normal("along_u_m", lever_m), normal("along_v_m", lever_m), normal("along_w_m", lever_m)],
    ),
];

/// By how much a load may act beside its point: as a person sets it, or as a great machine is built.
fn lever_m(scales: &MachineScales) -> f64 {
    (scales.arm_m / 40.0).max(5e-3)
}

const fn normal(name: &'static str, sd: fn(&MachineScales) -> f64) -> ParameterInfo {
    ParameterInfo::new(name, f64::INFINITY, Plausible::Within(sd))
}

const fn of_measurement(
    id: &'static str,
    places: &'static [&'static str],
    inspect: &'static str,
    parameters: &'static [ParameterInfo],
) -> EffectInfo {
    EffectInfo {
        id,
        parameters,
        signed: true,
        expected: Expected {
            places,
            motion: "general",
            law: "constant",
            ln_prior: -3.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect,
        },
    }
}

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

/// What an unknown changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meaning {
    /// ln of a declared stiffness over its declared value, in units of its uncertainty.
    Stiffness(Declared),
    /// A whole class of stiffnesses declared wrong, by its place in [`Model::classes`]: ln of a common factor in units
    /// of [`CLASS_SD`].
    Class(usize),
    /// A parameter of elements, by its place in [`Model::elements`].
    Element(usize),
    /// A parameter of an effect.
    Effect {
        /// Index over machine and measurement.
        effect: usize,
        /// Index into its parameters.
        parameter: usize,
    },
}

/// Standard deviation of ln of the common factor when a class of stiffnesses was declared wrong.
pub const CLASS_SD: f64 = 0.5;

/// What the readings were taken with, as far as candidates depend on it.
#[derive(Clone, Copy, Debug)]
pub struct Recorded {
    /// Temperatures.
    pub temperatures: bool,
    /// Readings while the load went down.
    pub unloading: bool,
    /// Usual size of the loads, as a force, N.
    pub force_n: f64,
}

impl Default for Recorded {
    /// What is read of a machine of the reference's size.
    fn default() -> Self {
        Self { temperatures: false, unloading: false, force_n: 500.0 }
    }
}

impl Recorded {
    /// With some readings.
    pub fn of(file: &MachineFile, readings: &Readings) -> Self {
        let arm_m = 0.5 * (file.parameters.geometry.a1_m + file.parameters.geometry.a2_m);
        let size = |c: &Condition| {
            let at_a = c.wrench.moved_to_a(c.point_m.into());
            at_a.force_n.norm().max(at_a.moment_nm.norm() / arm_m)
        };
        let loads: Vec<f64> = readings.conditions.iter().map(size).filter(|size| *size > 0.0).collect();
        let rms = (loads.iter().map(|f| f * f).sum::<f64>() / loads.len() as f64).sqrt();
        let force_n = if rms.is_finite() { rms } else { Self::default().force_n };
        Self { temperatures: readings.has_temperature, unloading: readings.has_unloading, force_n }
    }
}

/// A machine, with the priors of its unknowns.
#[derive(Clone)]
pub struct Model {
    /// As declared.
    pub declared: MachineParameters,
    /// Of declared stiffnesses and of loads.
    pub uncertainty: Uncertainty,
    /// Stiffnesses that may be declared wrong together.
    pub classes: Vec<Class>,
    /// Parameters of elements.
    pub elements: Vec<ElementParameter>,
    /// Where the elements of a candidate are, by candidate.
    pub element_places: HashMap<usize, Whereabouts>,
    /// What may be missing.
    pub candidates: Vec<Candidate>,
    /// Poses all over the travel.
    reach: Vec<Pose<f64>>,
    /// What is known of each unknown.
    pub parameters: Vec<Parameter>,
    /// What each unknown changes.
    meanings: Vec<Meaning>,
}

/// The machine's own compliance in the middle of its box.
fn usual(file: &MachineFile) -> Option<Usual> {
    let own: [f64; 6] = compliance(&file.machine, &file.pose_box.middle_pose())?.diagonal().into();
    let travel = &file.parameters.travel;
    let travel_m =
        [0, 1, 2].map(|i| [0.5 * (travel.min_m[i] + travel.max_m[i]), 0.5 * (travel.max_m[i] - travel.min_m[i])]);
    // three limbs share a load along w, and bend side by side along u
    let (axial, across) = (3.0 * own[2], 3.0 * own[0]);
    Some(Usual { terminal: own, axial, across, travel_m })
}

/// Poses at which the declared machine has a stiffness, on a grid of screw lengths over the travel.
fn reach(file: &MachineFile) -> Vec<Pose<f64>> {
    let travel = &file.parameters.travel;
    let length = |limb: usize, step: usize| {
        travel.min_m[limb] + (travel.max_m[limb] - travel.min_m[limb]) * step as f64 / (REACH_STEPS - 1) as f64
    };
    let steps = || 0..REACH_STEPS;
    let all = steps().flat_map(|i| steps().flat_map(move |j| steps().map(move |k| [i, j, k])));
    let poses = all.filter_map(|[i, j, k]| {
        file.machine.forward(&ScrewLengths { q_m: [length(0, i), length(1, j), length(2, k)].into() }).ok()
    });
    poses.filter(|pose| file.machine.stiffness(pose).is_ok_and(|k| k.factor().is_ok())).collect()
}

/// Lengths of each screw on that grid.
const REACH_STEPS: usize = 5;

/// Sizes of the machine that those of effects go with.
fn scales(file: &MachineFile, usual: &Usual, force_n: f64) -> MachineScales {
    let declared = file.parameters;
    let angular = declared.limbs.iter().flat_map(|l| {
        let (b, p) = (l.base_joint.angular_nm_per_rad, l.platform_joint.angular_nm_per_rad);
        b.into_iter().chain(p).filter(|k| *k > 0.0)
    });
    MachineScales {
        axial_m_per_n: usual.axial,
        across_m_per_n: usual.across,
        turning_rad_per_nm: usual.terminal[3..].iter().copied().fold(f64::INFINITY, f64::min),
        tilting_rad_per_nm: 1.0 / angular.fold(f64::INFINITY, f64::min),
        arm_m: 0.5 * (declared.geometry.a1_m + declared.geometry.a2_m),
        b1_m: declared.geometry.b1_m,
        shortest_m: declared.travel.min_m[0],
        longest_m: declared.travel.max_m.into_iter().fold(0.0, f64::max),
        force_n,
    }
}

fn prior(plausible: Plausible, scales: &MachineScales) -> Prior {
    match plausible {
        Plausible::Within(sd) => Prior::Normal { scale: sd(scales) },
        Plausible::Below(greatest) => Prior::Below { greatest: greatest(scales) },
        Plausible::Around { median, ln_sd } => Prior::LogNormal { middle: median(scales), sd: ln_sd },
    }
}

/// Effects that readings with these columns hardly tell apart have the same class.
fn class(info: &EffectInfo, recorded: Recorded) -> &'static str {
    match info.expected.told_by {
        ToldBy::Unloading if recorded.unloading => info.id,
        _ => info.expected.class.unwrap_or(info.id),
    }
}

impl Model {
    /// Of a machine, for readings with some of the columns.
    pub fn new(file: &MachineFile, recorded: Recorded, method: Method) -> Option<Self> {
        let declared = file.parameters;
        let (mut meanings, mut parameters) = (Vec::new(), Vec::new());
        let mut add = |meaning: Meaning, prior: Prior, role: Role, ambiguous: bool| {
            meanings.push(meaning);
            parameters.push(Parameter { prior, role, ambiguous });
            Unknown(parameters.len() - 1)
        };
        for d in Declared::all(&declared) {
            let prior = Prior::LogNormal { middle: 1.0, sd: d.uncertainty(&file.uncertainty) };
            add(Meaning::Stiffness(d), prior, Role::Declared, false);
        }
        let usual = usual(file)?;
        let mut candidates = Vec::new();
        let scales = scales(file, &usual, recorded.force_n);
        for effect in 0..COUNT {
            let info = info(effect);
            let mut unknowns = Vec::new();
            for (parameter, own) in info.parameters.iter().enumerate() {
                let prior = prior(own.plausible, &scales);
                let role = match prior {
                    Prior::Normal { .. } => Role::Amplitude { one_sided: !info.signed },
                    Prior::LogNormal { .. } | Prior::Below { .. } => Role::Shape,
                };
                let unknown = add(Meaning::Effect { effect, parameter }, prior, role, own.ambiguous);
                if recorded.unloading || !own.needs_unloading {
                    unknowns.push(unknown);
                }
            }
            if recorded.temperatures || info.expected.told_by != ToldBy::Temperatures {
                candidates.push(Candidate {
                    names: vec![info.id.to_owned()],
                    kind: if is_measurement(effect) { Kind::Measurement } else { Kind::Effect },
                    place: class(&info, recorded).to_owned(),
                    unknowns,
                    start: Vec::new(),
                    is_free: is_measurement(effect),
                });
            }
        }
        let classes = Class::all(&declared);
        for (n, class) in classes.iter().enumerate() {
            let prior = Prior::LogNormal { middle: 1.0, sd: CLASS_SD };
            let unknown = add(Meaning::Class(n), prior, Role::Amplitude { one_sided: false }, false);
            let of_limb_3 = class.members.iter().all(|d| d.limb == 2);
            candidates.push(Candidate {
                names: class.keys(),
                kind: Kind::DeclaredValues,
                place: if of_limb_3 { LIMB_3 } else { LIMBS_1_2 }.to_owned(),
                unknowns: vec![unknown],
                start: Vec::new(),
                is_free: false,
            });
        }
        let reach = reach(file);
        let (elements, element_places, uncertainty) = (Vec::new(), HashMap::new(), file.uncertainty);
        let mut this =
            Self { declared, reach, uncertainty, classes, elements, element_places, candidates, parameters, meanings };
        if method == Method::Places {
            for family in families(&usual, &scales, recorded) {
                this.add_family(family);
            }
        }
        Some(this)
    }

    /// How much of a step of the declared values, in units of their priors, makes no compliance negative.
    pub fn share_of_step(&self, step: &DVector<f64>) -> f64 {
        let uncertainty = self.uncertainty.joint.max(self.uncertainty.body);
        1.0 / (uncertainty * step.amax()).max(1.0)
    }

    /// Adds elements as a candidate.
    pub fn add_family(&mut self, family: Family) {
        let mut unknowns = Vec::new();
        for p in family.parameters {
            self.meanings.push(Meaning::Element(self.elements.len()));
            self.parameters.push(Parameter { prior: p.prior, role: p.role, ambiguous: false });
            unknowns.push(Unknown(self.parameters.len() - 1));
            self.elements.push(p);
        }
        let Family { places, motion, law, start, .. } = family;
        let place = places.join(", ");
        let names = vec![format!("{ELEMENT} at {place}, {motion}, {law}")];
        self.element_places.insert(self.candidates.len(), Whereabouts { places, motion, law, ln_prior: 0.0 });
        // what goes with the load may take any form where its coefficients may take any size
        let is_free = matches!(law, "constant" | "extension");
        self.candidates.push(Candidate { names, kind: Kind::Element, place, unknowns, start, is_free });
    }

    /// What an unknown changes.
    pub fn meaning(&self, unknown: Unknown) -> Meaning {
        self.meanings[unknown.0]
    }

    /// The unknown of a meaning.
    pub fn unknown(&self, meaning: Meaning) -> Option<Unknown> {
        self.meanings.iter().position(|m| *m == meaning).map(Unknown)
    }

    /// The effect that a candidate is.
    pub fn effect_of(&self, candidate: usize) -> Option<usize> {
        match self.meaning(*self.candidates[candidate].unknowns.first()?) {
            Meaning::Effect { effect, .. } => Some(effect),
            Meaning::Stiffness(_) | Meaning::Class(_) | Meaning::Element(_) => None,
        }
    }

    /// The class of declared values that a candidate is.
    pub fn class_of(&self, candidate: usize) -> Option<&Class> {
        match self.meaning(*self.candidates[candidate].unknowns.first()?) {
            Meaning::Class(class) => Some(&self.classes[class]),
            Meaning::Stiffness(_) | Meaning::Effect { .. } | Meaning::Element(_) => None,
        }
    }

    fn is_one_sided(&self, unknown: Unknown) -> bool {
        self.parameters[unknown.0].is_one_sided()
    }

    /// Machine and measurement at `x`. Negative amplitudes of one-sided effects are left out, or with `mirrored` taken
    /// alone and with the opposite sign.
    pub fn state(&self, unknowns: &[Unknown], x: &[f64], mirrored: bool) -> State {
        let mut state = State::of(self.declared);
        for (unknown, x) in unknowns.iter().zip(x) {
            let x = if !self.is_one_sided(*unknown) {
                *x
            } else if mirrored {
                (-x).max(0.0)
            } else {
                x.max(0.0)
            };
            let value = self.parameters[unknown.0].prior.value(x);
            match self.meaning(*unknown) {
                Meaning::Stiffness(declared) => declared.each(&mut state.machine, |v| *v *= value),
                Meaning::Class(class) => {
                    self.classes[class].members.iter().for_each(|d| d.each(&mut state.machine, |v| *v *= value));
                }
                Meaning::Element(element) => self.elements[element].add_to(&mut state.machine, value),
                Meaning::Effect { effect, parameter } => match EFFECTS.get(effect) {
                    Some(_) => state.machine.effects.parameters[effect][parameter] += value,
                    None => state.measurement[effect - EFFECTS.len()][parameter] += value,
                },
            }
        }
        state
    }

    /// Whether the machine at `x` has a stiffness all over its travel: a compliance that shrinks with a limb's length may be
    /// negative beyond the readings.
    pub fn is_possible(&self, unknowns: &[Unknown], x: &[f64]) -> bool {
        let machine = Machine::<f64>::new(&self.state(unknowns, x, false).machine);
        let stands = |m: &Machine<f64>, pose: &Pose<f64>| m.stiffness(pose).is_ok_and(|k| k.factor().is_ok());
        machine.is_ok_and(|m| self.reach.iter().all(|pose| stands(&m, pose)))
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
        if unknowns.iter().zip(x).any(|(u, x)| *x < 0.0 && self.is_one_sided(*u)) {
            let mirror = self.state(unknowns, x, true).predict(poses, conditions)?;
            let none = if unknowns.iter().zip(x).any(|(u, x)| *x > 0.0 && self.is_one_sided(*u)) {
                let without: Vec<f64> =
                    unknowns.iter().zip(x).map(|(u, x)| if self.is_one_sided(*u) { 0.0 } else { *x }).collect();
                self.state(unknowns, &without, false).predict(poses, conditions)?
            } else {
                found.clone()
            };
            for ((found, mirror), none) in found.iter_mut().zip(&mirror).zip(&none) {
                for c in 0..CHANNELS {
                    found[c] -= mirror[c] - none[c];
                }
            }
        }
        Some(found)
    }
}

//! The machine file as TOML has it: what its keys are called, and where a number that is refused stands.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use nalgebra::Vector3;
use pkm_core::effects::{EFFECTS, Effects};
use pkm_core::machine::{
    Body, BodyKind, End, Geometry, Joint, LimbParameters, MachineError, Member, Parameter, Problem, Travel, Tube,
};
use pkm_core::{Machine, MachineParameters, ScrewLengths};
use serde::Deserialize;
use toml::Spanned;

use super::elements::{self, RawElement};
use super::solid::RawSolid;
use super::toml_error::{Numbers, float, is_near, place_of};
use super::wrist::{RawWrist, wrist_numbers};
use crate::error::clipped;
use crate::pose::PoseBox;

/// Standard deviations, as the machine file declares them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of declared stiffnesses of joints, relative.
    pub joint: f64,
    /// Of declared stiffnesses of bodies, relative.
    pub body: f64,
    /// Of the direction of a load, rad.
    pub load_direction_rad: f64,
    /// Of the size of a load, relative.
    pub load_gain: f64,
    /// Of the size of all loads together, relative: that of the load cell's calibration.
    pub load_calibration: f64,
    /// Of the size of a load, relative, drawn anew with each reading: the load cell's noise.
    pub load_random: f64,
    /// Of sizes of the platforms and of the wrist, and of the zeros of the screws, m.
    pub geometry_m: f64,
    /// Of the zeros of the wrist's joints, rad.
    pub geometry_rad: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMachine {
    pub(super) format: Spanned<i64>,
    pub(super) name: Spanned<String>,
    pub(super) geometry: RawGeometry,
    pub(super) travel: RawTravel,
    #[serde(rename = "box")]
    pub(super) pose_box: Option<RawBox>,
    pub(super) wrist: Option<Spanned<RawWrist>>,
    pub(super) uncertainty: Option<RawUncertainty>,
    pub(super) solid: Option<Spanned<RawSolid>>,
    pub(super) limb: Spanned<Vec<RawLimb>>,
    #[serde(default)]
    pub(super) effect: Vec<Spanned<RawEffect>>,
    #[serde(default)]
    pub(super) element: Vec<Spanned<RawElement>>,
}

pub(super) type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGeometry {
    pub(super) a1_mm: Number,
    pub(super) a2_mm: Number,
    pub(super) b1_mm: Number,
    pub(super) b2_mm: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTravel {
    pub(super) min_mm: Spanned<Numbers<3>>,
    pub(super) max_mm: Spanned<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBox {
    pub(super) theta_deg: Spanned<Numbers<2>>,
    pub(super) sigma_deg: Spanned<Numbers<2>>,
    pub(super) z0_mm: Spanned<Numbers<2>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawUncertainty {
    pub(super) stiffness: Option<Number>,
    pub(super) joint: Option<Number>,
    pub(super) body: Option<Number>,
    pub(super) load_direction_mrad: Option<Number>,
    pub(super) load_gain: Option<Number>,
    pub(super) load_calibration: Option<Number>,
    pub(super) load_random: Option<Number>,
    pub(super) geometry_mm: Option<Number>,
    pub(super) geometry_mrad: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLimb {
    pub(super) base_joint: RawJoint,
    pub(super) platform_joint: RawJoint,
    pub(super) body: RawBody,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawJoint {
    pub(super) linear_n_per_m: Spanned<Numbers<3>>,
    pub(super) angular_nm_per_rad: Spanned<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBody {
    pub(super) kind: RawBodyKind,
    pub(super) rod: RawTube,
    pub(super) screw: RawTube,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum RawBodyKind {
    Beam,
    Diagonal,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTube {
    pub(super) young_gpa: Number,
    pub(super) shear_gpa: Number,
    pub(super) outer_mm: Number,
    pub(super) inner_mm: Number,
}

#[derive(Deserialize)]
pub(super) struct RawEffect {
    pub(super) id: Spanned<String>,
    #[serde(flatten)]
    pub(super) parameters: BTreeMap<String, toml::Value>,
}

pub(super) fn metres(mm: f64) -> f64 {
    mm / 1e3
}

impl RawJoint {
    pub(super) fn parameters(&self) -> Joint {
        Joint {
            linear_n_per_m: self.linear_n_per_m.get_ref().0,
            angular_nm_per_rad: self.angular_nm_per_rad.get_ref().0,
        }
    }
}

impl RawTube {
    pub(super) fn parameters(&self) -> Tube {
        Tube {
            young_pa: self.young_gpa.get_ref() * 1e9,
            shear_pa: self.shear_gpa.get_ref() * 1e9,
            outer_m: metres(*self.outer_mm.get_ref()),
            inner_m: metres(*self.inner_mm.get_ref()),
        }
    }
}

impl RawLimb {
    pub(super) fn parameters(&self) -> LimbParameters {
        let kind = match self.body.kind {
            RawBodyKind::Beam => BodyKind::Beam,
            RawBodyKind::Diagonal => BodyKind::Diagonal,
        };
        LimbParameters {
            base_joint: self.base_joint.parameters(),
            platform_joint: self.platform_joint.parameters(),
            body: Body { kind, rod: self.body.rod.parameters(), screw: self.body.screw.parameters() },
        }
    }
}

/// Parameters of the `[[effect]]` tables.
pub(super) fn effects(
    text: &str,
    raw: &[Spanned<RawEffect>],
) -> std::result::Result<Effects, (String, Range<usize>, String)> {
    let mut effects = Effects::NONE;
    let mut seen = BTreeSet::new();
    for effect in raw {
        let RawEffect { id, parameters } = effect.get_ref();
        let fail = |key: &str, span: Range<usize>, message: String| Err((format!("effect.{key}"), span, message));
        let Some(index) = EFFECTS.iter().position(|e| e.id == id.get_ref()) else {
            let known = EFFECTS.map(|e| e.id);
            let near = known.iter().find(|known| is_near(id.get_ref(), known));
            let meant = near.map_or(String::new(), |meant| format!(", did you mean `{meant}`?"));
            let unknown = clipped(id.get_ref());
            return fail("id", id.span(), format!("unknown effect `{unknown}`{meant}; known are {}", known.join(", ")));
        };
        if !seen.insert(index) {
            return fail("id", id.span(), format!("duplicate effect `{}`", id.get_ref()));
        }
        for (name, value) in parameters {
            let key = format!("{}.{name}", id.get_ref());
            let known: Vec<&str> = EFFECTS[index].names().collect();
            let span = place_of(text, effect.span(), name);
            let Some(parameter) = known.iter().position(|p| p == name) else {
                return fail(&key, span, format!("unknown parameter; known are {}", known.join(", ")));
            };
            let Some(number) = float(value) else {
                return fail(&key, span, format!("expected a number, found {}", clipped(&value.to_string())));
            };
            effects.parameters[index][parameter] = number;
        }
        if parameters.is_empty() {
            let known = EFFECTS[index].names().collect::<Vec<_>>().join(", ");
            return fail(id.get_ref(), id.span(), format!("expected at least one of the parameters {known}"));
        }
    }
    Ok(effects)
}

/// A span, the key's name and the value that it holds.
pub(super) type Place = (String, Range<usize>, f64);

impl RawUncertainty {
    /// Where nothing is declared: stiffnesses to 10 %, loads exact, lengths to 1 mm, zeros of the wrist to 1 mrad.
    pub(super) fn values(&self) -> Uncertainty {
        let declared = |n: Option<&Number>, or: f64| n.map_or(or, |n| *n.get_ref());
        let stiffness = declared(self.stiffness.as_ref(), 0.10);
        Uncertainty {
            joint: declared(self.joint.as_ref(), stiffness),
            body: declared(self.body.as_ref(), stiffness),
            load_direction_rad: declared(self.load_direction_mrad.as_ref(), 0.0) / 1e3,
            load_gain: declared(self.load_gain.as_ref(), 0.0),
            load_calibration: declared(self.load_calibration.as_ref(), 0.0),
            load_random: declared(self.load_random.as_ref(), 0.0),
            geometry_m: metres(declared(self.geometry_mm.as_ref(), 1.0)),
            geometry_rad: declared(self.geometry_mrad.as_ref(), 1.0) / 1e3,
        }
    }
}

impl RawMachine {
    pub(super) fn parameters(&self, limbs: [&RawLimb; 3], effects: Effects) -> MachineParameters {
        let g = &self.geometry;
        MachineParameters {
            geometry: Geometry {
                a1_m: metres(*g.a1_mm.get_ref()),
                a2_m: metres(*g.a2_mm.get_ref()),
                b1_m: metres(*g.b1_mm.get_ref()),
                b2_m: metres(*g.b2_mm.get_ref()),
            },
            travel: Travel {
                min_m: self.travel.min_mm.get_ref().0.map(metres),
                max_m: self.travel.max_mm.get_ref().0.map(metres),
            },
            limbs: limbs.map(RawLimb::parameters),
            effects,
        }
    }

    /// Why platforms and screws do not fit together, if they don't.
    pub(super) fn impossible(
        &self,
        machine: &Machine<f64>,
        parameters: &MachineParameters,
        pose_box: &PoseBox,
    ) -> Option<Misplaced> {
        let g = parameters.geometry;
        let sizes = [g.a1_m, g.a2_m, g.b1_m, g.b2_m];
        let largest = sizes.into_iter().fold(0.0, f64::max);
        if parameters.travel.min_m.iter().all(|least| *least > 100.0 * largest) {
            let message = format!(
                "platforms of {} mm under screws a hundred times as long: are all lengths in mm?",
                1e3 * largest
            );
            return Some(("geometry.a1_mm", self.geometry.a1_mm.span(), message));
        }
        if can_assemble(machine, &parameters.travel, pose_box) {
            return None;
        }
        let mut message = "impossible machine: no screw lengths within travel assemble these platforms".to_owned();
        if sizes.into_iter().chain(parameters.travel.max_m).any(|m| m < 5e-3) {
            message.push_str(": are all lengths in mm?");
        }
        Some(("travel", self.travel.min_mm.span(), message))
    }

    pub(super) fn locate(&self, text: &str, error: MachineError) -> Place {
        let number = |key: String, n: &Number| (key, n.span(), *n.get_ref());
        let entry =
            |key: String, a: &Spanned<Numbers<3>>, i: usize| (format!("{key}[{i}]"), a.span(), a.get_ref().0[i]);
        let limb = |i: u8| &self.limb.get_ref()[usize::from(i) - 1];
        let joint = |i: u8, end: End| match end {
            End::Base => (format!("limb.{i}.base_joint"), &limb(i).base_joint),
            End::Platform => (format!("limb.{i}.platform_joint"), &limb(i).platform_joint),
        };
        let tube = |i: u8, member: Member| match member {
            Member::Rod => (format!("limb.{i}.body.rod"), &limb(i).body.rod),
            Member::Screw => (format!("limb.{i}.body.screw"), &limb(i).body.screw),
        };
        match error.parameter {
            Parameter::A1 => number("geometry.a1_mm".into(), &self.geometry.a1_mm),
            Parameter::A2 => number("geometry.a2_mm".into(), &self.geometry.a2_mm),
            Parameter::B1 => number("geometry.b1_mm".into(), &self.geometry.b1_mm),
            Parameter::B2 => number("geometry.b2_mm".into(), &self.geometry.b2_mm),
            Parameter::TravelMin { limb } => entry("travel.min_mm".into(), &self.travel.min_mm, usize::from(limb) - 1),
            Parameter::TravelMax { limb } => entry("travel.max_mm".into(), &self.travel.max_mm, usize::from(limb) - 1),
            Parameter::JointLinear { limb, end, axis } => {
                let (key, joint) = joint(limb, end);
                entry(format!("{key}.linear_n_per_m"), &joint.linear_n_per_m, axis.into())
            }
            Parameter::JointAngular { limb, end, axis } => {
                let (key, joint) = joint(limb, end);
                entry(format!("{key}.angular_nm_per_rad"), &joint.angular_nm_per_rad, axis.into())
            }
            Parameter::Young { limb, member } => {
                let (key, tube) = tube(limb, member);
                number(format!("{key}.young_gpa"), &tube.young_gpa)
            }
            Parameter::Shear { limb, member } => {
                let (key, tube) = tube(limb, member);
                number(format!("{key}.shear_gpa"), &tube.shear_gpa)
            }
            Parameter::Outer { limb, member } => {
                let (key, tube) = tube(limb, member);
                number(format!("{key}.outer_mm"), &tube.outer_mm)
            }
            Parameter::Effect { effect, parameter } => {
                let info = EFFECTS[usize::from(effect)];
                let name = info.parameters[usize::from(parameter)].name;
                let raw = self.effect.iter().find(|e| e.get_ref().id.get_ref() == info.id);
                let (span, value) = raw.map_or((0..0, f64::NAN), |e| {
                    let value = e.get_ref().parameters.get(name).and_then(float).unwrap_or(0.0);
                    (place_of(text, e.span(), name), value)
                });
                (format!("effect.{}.{name}", info.id), span, value)
            }
            Parameter::Element { element, parameter } => {
                elements::locate(text, &self.element[usize::from(element)], parameter.into())
            }
            // places, motions and laws were matched by name
            Parameter::ElementPlace { element }
            | Parameter::ElementMotion { element }
            | Parameter::ElementLaw { element } => {
                ("element".into(), self.element[usize::from(element)].span(), f64::NAN)
            }
            Parameter::Inner { limb, member } => {
                let (key, tube) = tube(limb, member);
                number(format!("{key}.inner_mm"), &tube.inner_mm)
            }
        }
    }
}

pub(super) fn expected(problem: Problem) -> &'static str {
    match problem {
        Problem::NotFinite => "a finite number",
        Problem::NotPositive => "a number above 0 of a sensible size",
        Problem::NotReleased => "0, since this joint releases that direction",
        Problem::Reversed => "a greatest length above the least",
        Problem::Negative => "a number of at least 0",
        Problem::TooLarge => "a smaller number, whatever its sign (are the units m, N, N·m, rad and K?)",
        Problem::NotOfPlace => "what this place has",
        Problem::Bore => "a bore of at least 0 and below the outer diameter",
    }
}

pub(super) type Misplaced = (&'static str, Range<usize>, String);

/// What the core does not know of: box, wrist, uncertainty.
pub(super) fn check_ranges(raw: &RawMachine) -> std::result::Result<(), Misplaced> {
    if let Some(b) = &raw.pose_box {
        for (key, limits) in [("box.theta_deg", &b.theta_deg), ("box.sigma_deg", &b.sigma_deg), ("box.z0_mm", &b.z0_mm)]
        {
            let [low, high] = limits.get_ref().0;
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err((key, limits.span(), format!("expected [least, greatest], found [{low}, {high}]")));
            }
            let possible = if key == "box.z0_mm" { low > 0.0 } else { low > -90.0 && high < 90.0 };
            if !possible {
                let message = "expected angles between -90 and 90, heights above 0".to_owned();
                return Err((key, limits.span(), format!("{message}, found [{low}, {high}]")));
            }
        }
    }
    let mut numbers: Vec<(&'static str, &Number, bool)> = Vec::new();
    if let Some(wrist) = &raw.wrist {
        numbers.extend(wrist_numbers(wrist.get_ref())?);
    }
    if let Some(u) = &raw.uncertainty {
        let of_loads = [
            ("uncertainty.load_direction_mrad", &u.load_direction_mrad),
            ("uncertainty.load_gain", &u.load_gain),
            ("uncertainty.load_calibration", &u.load_calibration),
            ("uncertainty.load_random", &u.load_random),
        ];
        numbers.extend(of_loads.into_iter().filter_map(|(key, n)| Some((key, n.as_ref()?, true))));
        let of_stiffnesses =
            [("uncertainty.stiffness", &u.stiffness), ("uncertainty.joint", &u.joint), ("uncertainty.body", &u.body)];
        for (key, n) in of_stiffnesses.into_iter().filter_map(|(key, n)| Some((key, n.as_ref()?))) {
            let value = *n.get_ref();
            if !(value > 0.0 && value <= 1.0) {
                let message = format!("expected a relative standard deviation above 0, at most 1, found {value}");
                return Err((key, n.span(), message));
            }
        }
        let of_geometry =
            [("uncertainty.geometry_mm", &u.geometry_mm), ("uncertainty.geometry_mrad", &u.geometry_mrad)];
        for (key, n) in of_geometry.into_iter().filter_map(|(key, n)| Some((key, n.as_ref()?))) {
            let value = *n.get_ref();
            if !(value > 0.0 && value <= 100.0) {
                let message = format!("expected a standard deviation above 0, at most 100, found {value}");
                return Err((key, n.span(), message));
            }
        }
    }
    for (key, n, not_negative) in numbers {
        let value = *n.get_ref();
        if !value.is_finite() || (not_negative && value < 0.0) {
            let kind = if not_negative { "a number of at least 0" } else { "a finite number" };
            return Err((key, n.span(), format!("expected {kind}, found {value}")));
        }
    }
    Ok(())
}

/// Whether the middle of the box, or any lengths of a grid over travel, close to a posture.
fn can_assemble(machine: &Machine<f64>, travel: &Travel, pose_box: &PoseBox) -> bool {
    const STEPS: usize = 16;
    if machine.inverse(&pose_box.middle_pose()).is_ok() {
        return true;
    }
    let length = |limb: usize, step: usize| {
        let (low, high) = (travel.min_m[limb], travel.max_m[limb]);
        low + (high - low) * step as f64 / STEPS as f64
    };
    (0..(STEPS + 1).pow(3)).any(|n| {
        let steps = [n % (STEPS + 1), n / (STEPS + 1) % (STEPS + 1), n / (STEPS + 1).pow(2)];
        machine.forward(&ScrewLengths { q_m: Vector3::from_fn(|i, _| length(i, steps[i])) }).is_ok()
    })
}

//! The machine file as TOML has it: what its keys are called, and where a number that is refused stands.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use pkm_core::effects::{EFFECTS, Effects};
use pkm_core::machine::{
    Body, BodyKind, End, Geometry, Joint, LimbParameters, MachineError, Member, Parameter, Problem, Travel, Tube,
};
use pkm_core::{Machine, MachineParameters, ScrewLengths, WristParameters};
use serde::Deserialize;
use toml::Spanned;

use super::elements::{self, RawElement};
use super::solid::RawSolid;
use super::toml_error::{Numbers, float, is_near, place_of};
use crate::error::clipped;
use crate::pose::{PoseBox, pose_of};

/// Standard deviations, as the machine file declares them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of declared stiffnesses, relative.
    pub stiffness: f64,
    /// Of the direction of a load, rad.
    pub load_direction_rad: f64,
    /// Of the size of a load, relative.
    pub load_gain: f64,
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
    pub(super) wrist: Option<RawWrist>,
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawWrist {
    pub(super) offset_mm: Option<Number>,
    pub(super) first: Option<RawFirstJoint>,
    pub(super) second: Option<RawSecondJoint>,
    pub(super) flange_mm: Option<Number>,
    pub(super) singularity_margin: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFirstJoint {
    pub(super) d_mm: Number,
    pub(super) b_mm: Number,
    pub(super) min_deg: Number,
    pub(super) max_deg: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSecondJoint {
    pub(super) b_mm: Number,
    pub(super) min_deg: Number,
    pub(super) max_deg: Number,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawUncertainty {
    pub(super) stiffness: Option<Number>,
    pub(super) load_direction_mrad: Option<Number>,
    pub(super) load_gain: Option<Number>,
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
            return fail("id", id.span(), format!("the effect `{}` stands twice", id.get_ref()));
        }
        for (name, value) in parameters {
            let key = format!("{}.{name}", id.get_ref());
            let known = EFFECTS[index].parameters;
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
            let known = EFFECTS[index].parameters.join(", ");
            return fail(id.get_ref(), id.span(), format!("expected at least one of the parameters {known}"));
        }
    }
    Ok(effects)
}

/// A span, the key's name and the value that it holds.
pub(super) type Place = (String, Range<usize>, f64);

impl RawUncertainty {
    /// Where nothing is declared: stiffnesses to 10 %, loads exact.
    pub(super) fn values(&self) -> Uncertainty {
        let declared = |n: Option<&Number>, or: f64| n.map_or(or, |n| *n.get_ref());
        Uncertainty {
            stiffness: declared(self.stiffness.as_ref(), 0.10),
            load_direction_rad: declared(self.load_direction_mrad.as_ref(), 0.0) / 1e3,
            load_gain: declared(self.load_gain.as_ref(), 0.0),
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
                let name = info.parameters[usize::from(parameter)];
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
    if let Some(w) = &raw.wrist {
        numbers.extend(w.offset_mm.iter().map(|n| ("wrist.offset_mm", n, false)));
        numbers.extend(w.flange_mm.iter().map(|n| ("wrist.flange_mm", n, true)));
        numbers.extend(w.singularity_margin.iter().map(|n| ("wrist.singularity_margin", n, true)));
        let mut limits = Vec::new();
        if let Some(j) = &w.first {
            numbers.extend([("wrist.first.d_mm", &j.d_mm, false), ("wrist.first.b_mm", &j.b_mm, false)]);
            limits.push(("wrist.first.min_deg", &j.min_deg, "wrist.first.max_deg", &j.max_deg));
        }
        if let Some(j) = &w.second {
            numbers.push(("wrist.second.b_mm", &j.b_mm, false));
            limits.push(("wrist.second.min_deg", &j.min_deg, "wrist.second.max_deg", &j.max_deg));
        }
        for (min_key, min, max_key, max) in limits {
            numbers.extend([(min_key, min, false), (max_key, max, false)]);
            if min.get_ref() >= max.get_ref() {
                let message = format!("expected a limit above {}, found {}", min.get_ref(), max.get_ref());
                return Err((max_key, max.span(), message));
            }
        }
    }
    if let Some(u) = &raw.uncertainty {
        let keys = ["uncertainty.stiffness", "uncertainty.load_direction_mrad", "uncertainty.load_gain"];
        for (key, n) in keys.into_iter().zip([&u.stiffness, &u.load_direction_mrad, &u.load_gain]) {
            numbers.extend(n.as_ref().map(|n| (key, n, true)));
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

/// What the paper's values stand in for. The margin has one of its own, the paper none.
pub(super) fn wrist_left_out(wrist: Option<&RawWrist>) -> Vec<&'static str> {
    let there = wrist
        .map_or([false; 4], |w| [w.offset_mm.is_some(), w.first.is_some(), w.second.is_some(), w.flange_mm.is_some()]);
    let keys = ["wrist.offset_mm", "wrist.first", "wrist.second", "wrist.flange_mm"];
    keys.into_iter().zip(there).filter_map(|(key, there)| (!there).then_some(key)).collect()
}

/// Table 1; what the file leaves out has the paper's values.
pub(super) fn wrist_parameters(wrist: Option<&RawWrist>, pose_box: &PoseBox) -> WristParameters {
    let [_, _, z0_mm] = pose_box.middle();
    let mut p = WristParameters { home_z0_m: metres(z0_mm), ..WristParameters::PAPER };
    let Some(wrist) = wrist else { return p };
    let put = |to: &mut f64, n: &Option<Number>, turned: fn(f64) -> f64| {
        if let Some(n) = n {
            *to = turned(*n.get_ref());
        }
    };
    put(&mut p.offset_m, &wrist.offset_mm, metres);
    put(&mut p.flange_m, &wrist.flange_mm, metres);
    put(&mut p.singularity_margin, &wrist.singularity_margin, |margin| margin);
    if let Some(j) = &wrist.first {
        (p.first_d_m, p.first_b_m) = (metres(*j.d_mm.get_ref()), metres(*j.b_mm.get_ref()));
        (p.min_rad[0], p.max_rad[0]) = (j.min_deg.get_ref().to_radians(), j.max_deg.get_ref().to_radians());
    }
    if let Some(j) = &wrist.second {
        p.second_b_m = metres(*j.b_mm.get_ref());
        (p.min_rad[1], p.max_rad[1]) = (j.min_deg.get_ref().to_radians(), j.max_deg.get_ref().to_radians());
    }
    p
}

/// Whether the middle of the box, or any lengths of a grid over travel, close to a posture.
fn can_assemble(machine: &Machine<f64>, travel: &Travel, pose_box: &PoseBox) -> bool {
    const STEPS: usize = 16;
    let [theta, sigma, z0] = pose_box.middle();
    if machine.inverse(&pose_of(theta, sigma, z0)).is_ok() {
        return true;
    }
    let length = |limb: usize, step: usize| {
        let (low, high) = (travel.min_m[limb], travel.max_m[limb]);
        low + (high - low) * step as f64 / STEPS as f64
    };
    (0..(STEPS + 1).pow(3)).any(|n| {
        let steps = [n % (STEPS + 1), n / (STEPS + 1) % (STEPS + 1), n / (STEPS + 1).pow(2)];
        machine.forward(&ScrewLengths { q_m: std::array::from_fn(|i| length(i, steps[i])) }).is_ok()
    })
}

//! The machine file (TOML): reading, checking, and turning it into the core's parameters.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use pkm_core::effects::{EFFECTS, Effects};
use pkm_core::machine::{
    Body, BodyKind, End, Geometry, Joint, LimbParameters, MachineError, Member, Parameter, Problem, Travel, Tube,
};
use pkm_core::{
    FiveAxis, KinematicsError, Machine, MachineParameters, Pose, ScrewLengths, Wrist, WristError, WristParameters,
};
use serde::Deserialize;
use toml::Spanned;

use crate::error::{Failure, Result, clipped, printable};
use crate::files::elements::{self, RawElement};
use crate::files::solid::{RawSolid, Solid};
use crate::files::source::Source;
use crate::files::toml_error::{Numbers, is_near, line_at, parsed};
use crate::pose::{PoseBox, pose_of};

/// A checked machine file.
pub struct MachineFile {
    /// Its `name`.
    pub name: String,
    /// Where it came from.
    pub source: Source,
    /// SI numbers for the core and for generated tables.
    pub parameters: MachineParameters,
    /// The core's machine made of them.
    pub machine: Machine<f64>,
    /// Where plans are laid.
    pub pose_box: PoseBox,
    /// What is declared of errors.
    pub uncertainty: Uncertainty,
    /// Table 1 as the file has it, SI.
    pub wrist_parameters: WristParameters,
    /// What is possible and yet looks like another unit.
    pub warnings: Vec<String>,
    /// Keys of `[wrist]` that the file leaves to the paper.
    wrist_left_out: Vec<&'static str>,
    /// The core's wrist made of them; an error only for one that is singular at home.
    pub wrist: std::result::Result<Wrist<f64>, WristError>,
    /// What limbs and platforms are made of; an error where the parts don't fit together.
    pub solid: Result<Solid>,
}

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
struct RawMachine {
    format: Spanned<i64>,
    name: Spanned<String>,
    geometry: RawGeometry,
    travel: RawTravel,
    #[serde(rename = "box")]
    pose_box: Option<RawBox>,
    wrist: Option<RawWrist>,
    uncertainty: Option<RawUncertainty>,
    solid: Option<Spanned<RawSolid>>,
    limb: Spanned<Vec<RawLimb>>,
    #[serde(default)]
    effect: Vec<Spanned<RawEffect>>,
    #[serde(default)]
    element: Vec<Spanned<RawElement>>,
}

type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGeometry {
    a1_mm: Number,
    a2_mm: Number,
    b1_mm: Number,
    b2_mm: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTravel {
    min_mm: Spanned<Numbers<3>>,
    max_mm: Spanned<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBox {
    theta_deg: Spanned<Numbers<2>>,
    sigma_deg: Spanned<Numbers<2>>,
    z0_mm: Spanned<Numbers<2>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWrist {
    offset_mm: Option<Number>,
    first: Option<RawFirstJoint>,
    second: Option<RawSecondJoint>,
    flange_mm: Option<Number>,
    singularity_margin: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFirstJoint {
    d_mm: Number,
    b_mm: Number,
    min_deg: Number,
    max_deg: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSecondJoint {
    b_mm: Number,
    min_deg: Number,
    max_deg: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawUncertainty {
    stiffness: Option<Number>,
    load_direction_mrad: Option<Number>,
    load_gain: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLimb {
    base_joint: RawJoint,
    platform_joint: RawJoint,
    body: RawBody,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawJoint {
    linear_n_per_m: Spanned<Numbers<3>>,
    angular_nm_per_rad: Spanned<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBody {
    kind: RawBodyKind,
    rod: RawTube,
    screw: RawTube,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum RawBodyKind {
    Beam,
    Diagonal,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTube {
    young_gpa: Number,
    shear_gpa: Number,
    outer_mm: Number,
    inner_mm: Number,
}

#[derive(Deserialize)]
struct RawEffect {
    id: Spanned<String>,
    #[serde(flatten)]
    parameters: BTreeMap<String, toml::Value>,
}

impl MachineFile {
    /// A machine file, or the reference machine's when none is named.
    ///
    /// # Errors
    /// Those of [`parse`](Self::parse).
    pub fn read(path: Option<&Path>) -> Result<Self> {
        Self::parse(Source::read_or(path, pkm_fixtures::MACHINE)?)
    }

    /// Reads and checks a machine file.
    ///
    /// # Errors
    /// One message with file, line and key: syntax, an unknown or missing key, a number out of its range, a
    /// geometry that no lengths within travel can assemble.
    pub fn parse(source: Source) -> Result<Self> {
        let text = source.text()?;
        let fail = |range: Option<Range<usize>>, key: &str, message: String| {
            let mut failure = Failure::input(message).in_file(&source.name);
            if let Some(range) = range {
                failure = failure.at_line(line_at(text, range.start) as u64);
            }
            if key.is_empty() { failure } else { failure.at_column(key) }
        };
        let raw: RawMachine = parsed(&source)?;

        if *raw.format.get_ref() != 1 {
            let found = raw.format.get_ref();
            return Err(fail(Some(raw.format.span()), "format", format!("expected 1, found {found}")));
        }
        let Ok([limb_1, limb_2, limb_3]) = <&[RawLimb; 3]>::try_from(raw.limb.get_ref().as_slice()) else {
            let found = raw.limb.get_ref().len();
            return Err(fail(Some(raw.limb.span()), "limb", format!("expected three [[limb]] tables, found {found}")));
        };
        if raw.name.get_ref().is_empty() || printable(raw.name.get_ref()) != *raw.name.get_ref() {
            let message = "expected a name of one line of ordinary text".to_owned();
            return Err(fail(Some(raw.name.span()), "name", message));
        }
        let misplaced = |(key, span, message): (String, _, _)| fail(Some(span), &key, message);
        let mut effects = effects(text, &raw.effect).map_err(misplaced)?;
        effects.elements = elements::elements(text, &raw.element).map_err(misplaced)?;
        check_ranges(&raw).map_err(|(key, span, message)| fail(Some(span), key, message))?;

        let g = &raw.geometry;
        let g = Geometry {
            a1_m: metres(*g.a1_mm.get_ref()),
            a2_m: metres(*g.a2_mm.get_ref()),
            b1_m: metres(*g.b1_mm.get_ref()),
            b2_m: metres(*g.b2_mm.get_ref()),
        };
        let parameters = MachineParameters {
            geometry: g,
            travel: Travel {
                min_m: raw.travel.min_mm.get_ref().0.map(metres),
                max_m: raw.travel.max_mm.get_ref().0.map(metres),
            },
            limbs: [limb_1, limb_2, limb_3].map(RawLimb::parameters),
            effects,
        };
        let machine = Machine::<f64>::new(&parameters).map_err(|e| {
            let (key, span, value) = raw.locate(text, e);
            fail(Some(span), &key, format!("expected {}, found {value}", expected(e.problem)))
        })?;
        let largest = [g.a1_m, g.a2_m, g.b1_m, g.b2_m].into_iter().fold(0.0, f64::max);
        if parameters.travel.min_m.iter().all(|least| *least > 100.0 * largest) {
            let message = format!(
                "platforms of {} mm under screws a hundred times as long: are all lengths in mm?",
                1e3 * largest
            );
            return Err(fail(Some(raw.geometry.a1_mm.span()), "geometry.a1_mm", message));
        }
        let pose_box = raw.pose_box.as_ref().map_or_else(PoseBox::default, |b| {
            [&b.theta_deg, &b.sigma_deg, &b.z0_mm].map(|range| range.get_ref().0).into()
        });
        if !can_assemble(&machine, &parameters.travel, &pose_box) {
            let mut message = "impossible machine: no screw lengths within travel assemble these platforms".to_owned();
            let mut lengths = [g.a1_m, g.a2_m, g.b1_m, g.b2_m].into_iter().chain(parameters.travel.max_m);
            if lengths.any(|m| m < 5e-3) {
                message.push_str(": are all lengths in mm?");
            }
            return Err(fail(Some(raw.travel.min_mm.span()), "travel", message));
        }
        let name = raw.name.into_inner();
        let wrist_parameters = wrist_parameters(raw.wrist.as_ref(), &pose_box);
        let wrist_left_out = wrist_left_out(raw.wrist.as_ref());
        let wrist = Wrist::<f64>::new(&wrist_parameters);
        if let Err(error) = wrist
            && error != WristError::HomeIsSingular
        {
            let span = text.find("[wrist]").unwrap_or(0);
            return Err(fail(Some(span..span), "wrist", error.to_string()));
        }
        let section = raw.solid.as_ref();
        let solid = match Solid::new(section.map_or(&RawSolid::default(), Spanned::get_ref), &parameters) {
            Ok(solid) => Ok(solid),
            Err(flaw) => {
                let place = flaw.place.or_else(|| section.map(Spanned::span));
                let failure = fail(place, &flaw.key, flaw.message);
                if flaw.of_value {
                    return Err(failure);
                }
                Err(failure)
            }
        };
        let declared = |pick: fn(&RawUncertainty) -> Option<&Number>, or: f64| {
            raw.uncertainty.as_ref().and_then(pick).map_or(or, |n| *n.get_ref())
        };
        let uncertainty = Uncertainty {
            stiffness: declared(|u| u.stiffness.as_ref(), 0.10),
            load_direction_rad: declared(|u| u.load_direction_mrad.as_ref(), 0.0) / 1e3,
            load_gain: declared(|u| u.load_gain.as_ref(), 0.0),
        };
        Ok(Self {
            name,
            parameters,
            machine,
            pose_box,
            uncertainty,
            wrist_parameters,
            warnings: unlikely_values(&source.name, &parameters),
            wrist_left_out,
            wrist,
            solid,
            source,
        })
    }

    /// For commands that need the wrist: a warning where the paper's values stand in for keys that the file leaves out.
    pub fn wrist_warning(&self) -> Option<String> {
        let (name, keys) = (&self.source.name, self.wrist_left_out.join(", "));
        let warning =
            || format!("{name}: no {keys}: the paper's Table 1 stands in, and the tool's tip follows from it");
        (!self.wrist_left_out.is_empty()).then(warning)
    }

    /// The machine with its wrist.
    ///
    /// # Errors
    /// The wrist is singular at home, so that nothing says which side of a singularity is home's.
    pub fn five_axis(&self) -> Result<FiveAxis<'_, f64>> {
        match &self.wrist {
            Ok(wrist) => Ok(FiveAxis { machine: &self.machine, wrist }),
            Err(e) => Err(Failure::input(e.to_string()).in_file(&self.source.name).at_column("wrist")),
        }
    }

    /// A screw's length beside its travel. Limbs count from 1.
    pub fn travel_of(&self, limb: u8, lengths: &ScrewLengths<f64>) -> String {
        let i = usize::from(limb) - 1;
        let mm = |m: f64| (m * 1e6).round() / 1e3;
        let travel = &self.parameters.travel;
        let (q_m, least_m, greatest_m) = (lengths.q_m[i], travel.min_m[i], travel.max_m[i]);
        // a thousandth of what may be
        let unit = if (least_m..=greatest_m).contains(&(1e3 * q_m)) { ": are lengths in mm?" } else { "" };
        format!("{} mm long, travel {} to {} mm{unit}", mm(q_m), mm(least_m), mm(greatest_m))
    }

    /// What sits below the tool alone: a table applies to it, and its data are the mechanism's at A.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn below_tool(&self) -> Result<Machine<f64>> {
        let parameters = MachineParameters { effects: self.parameters.effects.below_tool(), ..self.parameters };
        Machine::<f64>::new(&parameters).map_err(|e| Failure::other(e.to_string()))
    }

    /// The same machine with screws of any length.
    pub fn without_travel(&self) -> Option<Machine<f64>> {
        let travel = Travel { min_m: [1e-9; 3], max_m: [1e9; 3] };
        Machine::<f64>::new(&MachineParameters { travel, ..self.parameters }).ok()
    }

    /// Why the machine can't take a pose, with the numbers that say what to change.
    pub fn refusal(&self, error: KinematicsError, pose: &Pose<f64>) -> String {
        let lengths = self.without_travel().and_then(|m| m.inverse(pose).ok());
        match (error, lengths) {
            (KinematicsError::OutOfTravel { limb }, Some(lengths)) => {
                format!("{error}: {}", self.travel_of(limb, &lengths))
            }
            _ if pose.z0_m > 0.0 && pose.z0_m < 0.005 => {
                format!("{error}: Z0 is {} mm; are lengths in mm?", pose.z0_m * 1e3)
            }
            _ => error.to_string(),
        }
    }
}

/// Warnings about values that are possible and yet look like another unit.
fn unlikely_values(file: &str, parameters: &MachineParameters) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut check = |key: String, value: f64, unlikely: bool, question: &str| {
        if unlikely {
            warnings.push(format!("{file}: {key}: {value}: {question}"));
        }
    };
    let g = &parameters.geometry;
    for (key, m) in [("a1_mm", g.a1_m), ("a2_mm", g.a2_m), ("b1_mm", g.b1_m), ("b2_mm", g.b2_m)] {
        check(format!("geometry.{key}"), m * 1e3, m < 0.005, "is it in mm?");
    }
    for (n, limb) in (1..).zip(&parameters.limbs) {
        for (name, joint) in [("base_joint", &limb.base_joint), ("platform_joint", &limb.platform_joint)] {
            let softest = joint.linear_n_per_m.into_iter().fold(f64::INFINITY, f64::min);
            let question = "so soft a joint: is it in N/m (1 N/mm = 1000 N/m)?";
            check(format!("limb.{n}.{name}.linear_n_per_m"), softest, softest < 1e6, question);
        }
        for (name, tube) in [("rod", &limb.body.rod), ("screw", &limb.body.screw)] {
            let key = |what: &str| format!("limb.{n}.body.{name}.{what}");
            let [young, shear] = [tube.young_pa, tube.shear_pa].map(|pa| pa / 1e9);
            check(key("young_gpa"), young, !(1.0..=1200.0).contains(&young), "is it in GPa (steel has 206)?");
            check(key("shear_gpa"), shear, shear > young, "above young_gpa: is it in GPa (steel has 79)?");
            check(key("outer_mm"), tube.outer_m * 1e3, tube.outer_m < 0.001, "is it in mm?");
        }
    }
    warnings
}

/// What the paper's values stand in for. The margin has one of its own, the paper none.
fn wrist_left_out(wrist: Option<&RawWrist>) -> Vec<&'static str> {
    let there = wrist
        .map_or([false; 4], |w| [w.offset_mm.is_some(), w.first.is_some(), w.second.is_some(), w.flange_mm.is_some()]);
    let keys = ["wrist.offset_mm", "wrist.first", "wrist.second", "wrist.flange_mm"];
    keys.into_iter().zip(there).filter_map(|(key, there)| (!there).then_some(key)).collect()
}

/// Table 1; what the file leaves out has the paper's values.
fn wrist_parameters(wrist: Option<&RawWrist>, pose_box: &PoseBox) -> WristParameters {
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

fn metres(mm: f64) -> f64 {
    mm / 1e3
}

impl RawJoint {
    fn parameters(&self) -> Joint {
        Joint {
            linear_n_per_m: self.linear_n_per_m.get_ref().0,
            angular_nm_per_rad: self.angular_nm_per_rad.get_ref().0,
        }
    }
}

impl RawTube {
    fn parameters(&self) -> Tube {
        Tube {
            young_pa: self.young_gpa.get_ref() * 1e9,
            shear_pa: self.shear_gpa.get_ref() * 1e9,
            outer_m: metres(*self.outer_mm.get_ref()),
            inner_m: metres(*self.inner_mm.get_ref()),
        }
    }
}

impl RawLimb {
    fn parameters(&self) -> LimbParameters {
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
fn effects(text: &str, raw: &[Spanned<RawEffect>]) -> std::result::Result<Effects, (String, Range<usize>, String)> {
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

/// A TOML number, whole or not.
pub fn float(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

/// Where a key of an `[[effect]]` or `[[element]]` is written: the parameters' own spans are lost with their names free to
/// choose.
pub fn place_of(text: &str, table: Range<usize>, name: &str) -> Range<usize> {
    let start = table.start;
    let mut at = start;
    for line in text.get(start..).unwrap_or("").split_inclusive('\n') {
        if line.split('=').next().is_some_and(|key| key.trim() == name) {
            return at..at + line.len();
        }
        at += line.len();
    }
    table
}

/// A span, the key's name and the value that it holds.
type Place = (String, Range<usize>, f64);

impl RawMachine {
    fn locate(&self, text: &str, error: MachineError) -> Place {
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

fn expected(problem: Problem) -> &'static str {
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

type Misplaced = (&'static str, Range<usize>, String);

/// What the core does not know of: box, wrist, uncertainty.
fn check_ranges(raw: &RawMachine) -> std::result::Result<(), Misplaced> {
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

//! The machine file (TOML): reading, checking, and turning it into the core's parameters.

use std::ops::Range;
use std::path::Path;

use pkm_core::effects::{EFFECTS, Law};
use pkm_core::machine::Travel;
use pkm_core::{
    FiveAxis, KinematicsError, Machine, MachineParameters, Pose, ScrewLengths, Wrist, WristError, WristParameters,
};
use toml::Spanned;

use super::elements;
use super::machine_raw::{RawLimb, RawMachine, check_ranges, effects, expected};
use super::solid::{RawSolid, Solid};
use super::source::Source;
use super::toml_error::{line_at, parsed};
use super::wrist::{wrist_left_out, wrist_parameters};
use crate::error::{Failure, Result, printable};
use crate::pose::{MAX_RADIANS, PoseBox, tidy};

pub use super::machine_raw::Uncertainty;

/// A checked machine file.
#[derive(Clone)]
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

        let parameters = raw.parameters([limb_1, limb_2, limb_3], effects);
        let machine = Machine::<f64>::new(&parameters).map_err(|e| {
            let (key, span, value) = raw.locate(text, e);
            fail(Some(span), &key, format!("expected {}, found {value}", expected(e.problem)))
        })?;
        let pose_box = raw.pose_box.as_ref().map_or_else(PoseBox::default, |b| {
            [&b.theta_deg, &b.sigma_deg, &b.z0_mm].map(|range| range.get_ref().0).into()
        });
        if let Some((key, span, message)) = raw.impossible(&machine, &parameters, &pose_box) {
            return Err(fail(Some(span), key, message));
        }
        let name = raw.name.get_ref().clone();
        let own_wrist = raw.wrist.as_ref().map(Spanned::get_ref);
        let wrist_parameters = wrist_parameters(own_wrist, &pose_box);
        let wrist = Wrist::<f64>::new(&wrist_parameters);
        if let Err(error) = wrist
            && error != WristError::HomeIsSingular
        {
            return Err(fail(raw.wrist.as_ref().map(Spanned::span), "wrist", error.to_string()));
        }
        let warnings = unlikely_values(&source.name, &parameters)
            .into_iter()
            .chain(box_out_of_reach(&source.name, &machine, &pose_box))
            .chain(box_in_radians(&source.name, &pose_box))
            .chain(wrist_in_radians(&source.name, &wrist_parameters))
            .collect();
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
        Ok(Self {
            name,
            parameters,
            machine,
            pose_box,
            uncertainty: raw.uncertainty.unwrap_or_default().values(),
            wrist_parameters,
            warnings,
            wrist_left_out: wrist_left_out(own_wrist),
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

    /// For commands that say a stiffness: a warning where effects or elements depend on the load, which no stiffness has.
    pub fn load_warning(&self) -> Option<String> {
        let effects = &self.parameters.effects;
        let depends = |law: &str| Law::from_name(law).is_some_and(Law::depends_on_load);
        let is_on = |values: &[f64]| values.iter().any(|v| *v != 0.0);
        let of_list =
            EFFECTS.iter().zip(&effects.parameters).filter(|(info, v)| depends(info.expected.law) && is_on(&v[..]));
        let elements = effects.elements.iter().flatten().filter(|e| e.law.depends_on_load() && is_on(&e.parameters));
        let names: Vec<String> = (of_list.map(|(info, _)| info.id.to_owned()))
            .chain(elements.map(|e| format!("element at {} with law {}", e.place.name().unwrap_or("?"), e.law.name())))
            .collect();
        let (file, names) = (&self.source.name, names.join(", "));
        (!names.is_empty()).then(|| {
            format!("{file}: K is without what depends on the load ({names}): `predict` adds that to a deflection")
        })
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

    /// The same machine with a longer tool on its flange.
    ///
    /// # Errors
    /// A length with which nothing of the flange is left, or the wrist is singular at home.
    pub fn with_longer_tool(&self, longer_m: f64) -> Result<Self> {
        let flange_m = self.wrist_parameters.flange_m + longer_m;
        let wrist_parameters = WristParameters { flange_m, ..self.wrist_parameters };
        let wrist = Wrist::<f64>::new(&wrist_parameters).map_err(|e| {
            let message = format!("with a tool that makes flange_mm {:.3}: {e}", flange_m * 1e3);
            Failure::input(message).in_file(&self.source.name)
        })?;
        Ok(Self { wrist_parameters, wrist: Ok(wrist), ..self.clone() })
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

/// A warning where the machine cannot stand in the middle of its box, which is taken for its home.
fn box_out_of_reach(file: &str, machine: &Machine<f64>, pose_box: &PoseBox) -> Option<String> {
    let [theta, sigma, z0] = pose_box.middle();
    let error = machine.inverse(&pose_box.middle_pose()).err()?;
    Some(format!(
        "{file}: box: its middle, {theta}°, {sigma}°, {z0} mm, is out of reach ({error}): is it in degrees and mm, and of this machine?"
    ))
}

/// A warning where the angles of the box are too small to be in degrees.
fn box_in_radians(file: &str, pose_box: &PoseBox) -> Option<String> {
    let message =
        || format!("{file}: box: its angles are below {MAX_RADIANS}: are theta_deg and sigma_deg in degrees?");
    pose_box.may_be_in_radians().then(message)
}

/// Warnings about limits of the wrist that are too narrow for a machine and would be usual in radians.
fn wrist_in_radians(file: &str, wrist: &WristParameters) -> Vec<String> {
    let of_joint = |n: usize| {
        let (key, [low, high]) =
            (["first", "second"][n], [wrist.min_rad[n], wrist.max_rad[n]].map(|rad| tidy(rad.to_degrees())));
        // half a turn; a joint that is clamped has next to no range, and none that works has so little in degrees
        let may_be = low.abs().max(high.abs()) < 3.15 && high - low > 0.5;
        may_be.then(|| {
            format!("{file}: wrist.{key}: its limits are {low} to {high}: are min_deg and max_deg in degrees?")
        })
    };
    (0..2).filter_map(of_joint).collect()
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
            // 2 to 3, with leeway for values that a diagnosis has found
            let is_solid = (1.6..=4.0).contains(&(young / shear));
            let question = "of no solid with this young_gpa: a third to half of that is usual (steel has 79 and 206)";
            check(key("shear_gpa"), shear, shear <= young && !is_solid, question);
            check(key("outer_mm"), tube.outer_m * 1e3, tube.outer_m < 0.001, "is it in mm?");
        }
    }
    warnings
}

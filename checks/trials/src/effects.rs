//! What can be in a set, how strong it may plausibly be, and what counts as its right name.

use crate::Random;
use crate::forms::{self, FORMS};

/// What the readings must offer before an effect can be seen at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing in particular.
    Nothing,
    /// Moments too.
    Moments,
    /// Many levels of load.
    Levels,
    /// A branch of falling load.
    Unloading,
    /// A temperature column.
    Temperature,
}

/// A kind of physics that the declared model lacks.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Name in the contract; outside the list a name of our own.
    pub id: &'static str,
    /// How many physical forms it has here.
    pub variants: usize,
    /// Plausible amplitudes, in the unit of [`Effect::amplitude`].
    pub range: (f64, f64),
    /// Kind of readings.
    pub needs: Needs,
}

pub(crate) const fn spec(id: &'static str, variants: usize, range: (f64, f64), needs: Needs) -> Spec {
    Spec { id, variants, range, needs }
}

/// Effects of the contract.
pub const LISTED: [Spec; 25] = [
    spec("moving-platform-compliance", 2, (0.05, 20.0), Needs::Nothing), // tip compliance of an arm, nm/N
    spec("base-compliance", 2, (0.05, 15.0), Needs::Nothing),            // nm/N
    spec("telescopic-limb", 2, (0.2, 4.0), Needs::Nothing),              // looseness of guides, inequality of sections
    spec("screw-position", 2, (0.2, 20.0), Needs::Nothing),              // nm/N per metre of screw
    spec("limb-1-axial", 1, (0.2, 12.0), Needs::Nothing),                // nm/N
    spec("limb-2-axial", 1, (0.2, 12.0), Needs::Nothing),
    spec("limb-3-axial", 1, (0.2, 12.0), Needs::Nothing),
    spec("universal-joint", 2, (0.2, 12.0), Needs::Nothing), // nm/N; tilting 0.3 µrad/(N·m) for each
    spec("revolute-joint", 2, (0.2, 12.0), Needs::Nothing),
    spec("spherical-joint", 1, (0.2, 12.0), Needs::Nothing),
    spec("revolute-3-joint", 2, (0.2, 12.0), Needs::Nothing),
    spec("platform-offset", 2, (0.3, 25.0), Needs::Moments), // mm
    spec("clearance", 2, (0.5, 20.0), Needs::Levels),        // whole play, µm
    spec("contact-stiffening", 2, (0.2, 30.0), Needs::Levels), // nm/N at 100 N
    spec("friction-hysteresis", 2, (5.0, 250.0), Needs::Unloading), // N
    spec("preload", 2, (0.5, 12.0), Needs::Nothing),         // kN
    spec("thermal-modulus", 2, (0.01, 1.0), Needs::Temperature), // % per K
    spec("thermal-expansion", 2, (0.005, 5.0), Needs::Temperature), // µm/m per K that is not compensated
    spec("geometry-a1", 1, (0.1, 6.0), Needs::Nothing),      // mm
    spec("geometry-b1", 1, (0.1, 6.0), Needs::Nothing),
    spec("sensor-rotation", 1, (0.5, 20.0), Needs::Moments), // mrad
    spec("sensor-scale", 1, (0.2, 3.0), Needs::Nothing),     // %
    spec("load-gain", 1, (0.2, 5.0), Needs::Moments),        // %
    spec("load-point", 1, (0.2, 6.0), Needs::Moments),       // mm
    spec("wrist-compliance", 2, (0.05, 12.0), Needs::Nothing), // nm/N; angular 15 nrad/(N·m) for each
];

/// Also of the contract; apart because its amplitude is drawn the same way but it is rare.
pub const COUPLING: Spec = spec("limb-coupling", 2, (0.05, 12.0), Needs::Nothing);

/// Physics that no effect of the contract describes.
pub const OUTSIDE: [Spec; 10] = [
    spec("screw-torsion-with-extension", 1, (0.03, 0.95), Needs::Nothing), // correlation of the two compliances
    spec("lateral-axial-coupling", 2, (0.03, 0.95), Needs::Nothing),
    spec("misaligned-joint-axes", 1, (0.05, 4.0), Needs::Nothing), // degrees
    spec("cable-carrier-between-limbs", 1, (0.001, 10.0), Needs::Nothing), // N/µm
    spec("hose-from-base", 2, (0.001, 10.0), Needs::Nothing),      // N/µm along its line
    spec("cubic-hardening", 1, (0.05, 6.0), Needs::Levels),        // nm/N lost at 1 kN
    spec("resonant-bracket", 2, (0.1, 60.0), Needs::Nothing),      // nm/N at its angle
    spec("periodic-screw", 1, (0.2, 5.0), Needs::Nothing),         // nm/N, along the screw
    spec("loose-tool-holder", 2, (0.1, 60.0), Needs::Levels),      // nm/N
    spec("foot-that-lifts", 1, (0.1, 60.0), Needs::Levels),        // nm/N
];

/// Of any name in the lists.
pub fn find(id: &str) -> Option<Spec> {
    LISTED.iter().chain([&COUPLING]).chain(&OUTSIDE).chain(&FORMS).find(|s| s.id == id).copied()
}

/// An effect in a machine.
#[derive(Clone, Debug)]
pub struct Effect {
    /// Of its [`Spec`].
    pub id: &'static str,
    /// Which physical form.
    pub variant: usize,
    /// How much.
    pub amplitude: f64,
    /// Proportions, signs and directions: −1 to 1 each.
    pub shape: [f64; 8],
}

impl Effect {
    /// Amplitude in the middle of the plausible range.
    pub fn random(spec: &Spec, rng: &mut Random) -> Self {
        Self {
            id: spec.id,
            variant: rng.index(spec.variants),
            amplitude: (spec.range.0 * spec.range.1).sqrt(),
            shape: std::array::from_fn(|_| rng.between(-1.0, 1.0)),
        }
    }

    /// A proportion about 1: compliances of a real part differ between directions.
    pub fn share(&self, i: usize) -> f64 {
        (0.5 * self.shape[i]).exp()
    }

    /// 1 or −1.
    pub fn sign(&self, i: usize) -> f64 {
        self.shape[i].signum()
    }

    /// Ids that are right because nothing measured at the tool tells them apart.
    pub fn accepted(&self) -> Vec<&'static str> {
        let mut all = vec![self.id];
        // along its axis this joint is in a row with the spherical joint
        if self.id == "revolute-3-joint" && self.variant == 0 {
            all.extend(["spherical-joint", "limb-3-axial"]);
        }
        all
    }
}

/// Effects of the measurement, not of the machine.
pub fn is_of_the_measurement(id: &str) -> bool {
    ["sensor-rotation", "sensor-scale", "load-gain", "load-point"].contains(&id)
}

/// The class of an id in the contract.
pub fn class_of(id: &str, unloading: bool, rotations: bool) -> Vec<&str> {
    let classes: [(&[&str], bool); 5] = [
        (&["universal-joint", "revolute-joint", "screw-position"], true),
        (&["spherical-joint", "limb-3-axial"], true),
        (&["geometry-a1", "geometry-b1"], true),
        (&["clearance", "friction-hysteresis"], !unloading),
        (&["sensor-scale", "load-gain"], !rotations),
    ];
    let found = classes.iter().find(|(members, holds)| *holds && members.contains(&id));
    found.map_or_else(|| vec![id], |(members, _)| members.to_vec())
}

/// Where an effect may rightly be found, as the contract names places: those that it acts at, and those that deflections at
/// the tool do not tell from them.
pub fn places_of(effect: &Effect) -> Vec<String> {
    if let Some(places) = forms::places_of(effect.id, effect) {
        return places;
    }
    let limb_parts = |limbs: &[usize], parts: &[&str]| -> Vec<String> {
        limbs.iter().flat_map(|i| parts.iter().map(move |part| format!("limb.{i}.{part}"))).collect()
    };
    let (all, chain) = ([1, 2, 3], ["base_joint", "body", "platform_joint"]);
    let with = |others: &[&str], parts: Vec<String>| {
        others.iter().map(|s| (*s).to_owned()).chain(parts).collect::<Vec<String>>()
    };
    match effect.id {
        "moving-platform-compliance" => with(&["moving_platform"], vec![]),
        "base-compliance" => with(&["base"], vec![]),
        "limb-coupling" => with(&["base"], limb_parts(&all, &["base_joint"])),
        "wrist-compliance" => with(&["tool"], vec![]),
        "telescopic-limb" | "thermal-modulus" | "lateral-axial-coupling" | "screw-torsion-with-extension" => {
            limb_parts(&all, &["body"])
        }
        "limb-1-axial" => limb_parts(&[1], &chain),
        "limb-2-axial" => limb_parts(&[2], &chain),
        "limb-3-axial" | "spherical-joint" | "revolute-3-joint" => limb_parts(&[3], &chain),
        "universal-joint" | "revolute-joint" => limb_parts(&[1, 2], &chain),
        "preload" => limb_parts(&all, &["body", "platform_joint"]),
        "platform-offset" => with(&["geometry", "moving_platform"], limb_parts(&all, &["platform_joint"])),
        "geometry-a1" => with(&["geometry"], limb_parts(&[1, 2], &["platform_joint"])),
        "geometry-b1" => with(&["geometry"], limb_parts(&[1, 2], &["base_joint"])),
        "cable-carrier-between-limbs" => limb_parts(&[1, 3], &["body"]),
        "hose-from-base" => with(&["moving_platform", "base"], vec![]),
        "misaligned-joint-axes" => with(&["geometry"], limb_parts(&all, &["base_joint", "platform_joint"])),
        // it stands between the platform and the tool, and turns with them
        "resonant-bracket" => with(&["tool", "moving_platform"], vec![]),
        "loose-tool-holder" => with(&["tool"], vec![]),
        "foot-that-lifts" => with(&["base"], vec![]),
        "sensor-rotation" => with(&["sensor"], vec![]),
        "sensor-scale" | "load-gain" | "load-point" => with(&["sensor", "load"], vec![]),
        _ => limb_parts(&all, &chain),
    }
}

/// Declared values that may rightly be blamed for an effect.
pub fn declared_of(id: &str) -> &'static [&'static str] {
    match id {
        "universal-joint" | "revolute-joint" | "screw-position" => &["limb.1.", "limb.2."],
        // another limb is another repair
        "limb-1-axial" => &["limb.1."],
        "limb-2-axial" => &["limb.2."],
        "spherical-joint" | "limb-3-axial" | "revolute-3-joint" => &["limb.3."],
        _ => &[],
    }
}

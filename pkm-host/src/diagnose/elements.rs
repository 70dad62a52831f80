//! Elements as candidates: a compliance at a place of the machine for which no effect has a formula.

use pkm_core::MachineParameters;
use pkm_core::effects::{Element, Law, MAX_ELEMENT_PARAMETERS, MachineScales, Motion};
use pkm_diagnosis::{Prior, Role};

use super::model::Recorded;

/// A parameter that one or several elements have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementParameter {
    /// Without the amplitudes.
    pub elements: Vec<Element>,
    /// Index of the parameter.
    pub index: usize,
    /// Its prior.
    pub prior: Prior,
    /// What it is to the model.
    pub role: Role,
}

impl ElementParameter {
    /// As in reports: motion and parameter.
    pub fn name(&self) -> String {
        self.elements.first().map_or_else(String::new, |e| {
            format!("{}.{}", e.motion.name(), e.parameter_names().get(self.index).copied().unwrap_or_default())
        })
    }

    /// What its fit moves it from: 0 of an amplitude.
    pub fn origin(&self) -> f64 {
        self.elements.first().and_then(|e| e.parameters.get(self.index)).copied().unwrap_or(0.0)
    }

    /// Adds to the parameter in a machine, which gets the elements that it lacks. Where there is no room for them the machine
    /// becomes invalid.
    pub fn add_to(&self, machine: &mut MachineParameters, value: f64) {
        for template in &self.elements {
            let slots = &mut machine.effects.elements;
            let kind = |e: &Element| (e.place, e.motion, e.law);
            // coupled ones and ties at one place differ by their weights, others by what is not linear in them
            let is_alike = |e: &Element| {
                if e.motion == Motion::Coupled || e.motion.is_tie() {
                    return e.parameters[1..] == template.parameters[1..];
                }
                match e.law {
                    Law::Load => e.parameters[LOAD_SHAPES] == template.parameters[LOAD_SHAPES],
                    Law::Extension => is_same_stretch(e, template),
                    _ => true,
                }
            };
            let is_own = |e: &Element| kind(e) == kind(template) && is_alike(e);
            let at = slots.iter().position(|s| s.is_some_and(|e| is_own(&e)));
            let at = at.or_else(|| slots.iter().position(Option::is_none));
            match at {
                Some(at) => slots[at].get_or_insert(*template).parameters[self.index] += value,
                None => slots[0] = slots[0].map(|e| Element { parameters: [f64::NAN; MAX_ELEMENT_PARAMETERS], ..e }),
            }
        }
    }
}

/// Whether neither is worn over a stretch, or both over one, which a fit may have moved a little.
fn is_same_stretch(a: &Element, b: &Element) -> bool {
    let [[at_a, half_a], [at_b, half_b]] = [a, b].map(|e| [e.parameters[LOCAL + 1], e.parameters[LOCAL + 2]]);
    (half_a > 0.0) == (half_b > 0.0) && (half_b <= 0.0 || (at_a - at_b).abs() < half_b)
}

/// Elements that are found together.
pub struct Family {
    /// Places, the most affected first.
    pub places: Vec<String>,
    /// Motion, `general` for several.
    pub motion: &'static str,
    /// Law.
    pub law: &'static str,
    /// Parameters.
    pub parameters: Vec<ElementParameter>,
    /// Where a fit of them begins, if something else has said how large they are; else empty.
    pub start: Vec<f64>,
}

/// What compliances are usual in a machine.
pub struct Usual {
    /// Of the whole at A, along and about u, v, w, m/N and rad/(N·m).
    pub terminal: [f64; 6],
    /// Of a limb along and across it, m/N.
    pub axial: f64,
    /// See `axial`.
    pub across: f64,
    /// Middle and half of each limb's travel, m.
    pub travel_m: [[f64; 2]; 3],
}

/// Tensions above which laws of the load are straight, of the usual force. Nothing bends without end, and readings under some loads
/// say nothing of how it bends beyond them.
const STRAIGHT_ABOVE: [f64; 2] = [0.6, 0.2];
/// Parameters of a law of the load that are not linear in it: what takes up the play, and where the law is straight.
const LOAD_SHAPES: std::ops::Range<usize> = 5..7;
/// Index of the compliance over a worn stretch of a limb, that of its middle and half length come after it.
pub const LOCAL: usize = 4;
/// Lag that is plausible, of fits or in what a limb yields under the usual force, and the change of tension that turns it, of that force.
const LAG: ([f64; 2], f64) = ([5e-6, 1.0], 0.1);
/// Share of a compliance that a kelvin may add.
const SOFTENING_PER_K: f64 = 0.02;
/// Play that is plausible, as a lag, and the tension that takes it up, of the usual force.
const PLAY: ([f64; 2], f64) = ([30e-6, 6.0], 0.04);

/// All families of elements that a diagnosis looks for, in readings with some of the columns.
pub fn families(usual: &Usual, scales: &MachineScales, recorded: Recorded) -> Vec<Family> {
    let mut all: Vec<Family> = [
        ("tool", ["u", "v", "w", "ru", "rv", "rw"]),
        ("moving_platform", ["u", "v", "w", "ru", "rv", "rw"]),
        ("base", ["x", "y", "z", "rx", "ry", "rz"]),
    ]
    .into_iter()
    .map(|(place, motions)| {
        let of = |(motion, scale): (&&str, &f64)| parameter(&[place], motion, "constant", 0, *scale, true);
        let parameters = motions.iter().zip(&usual.terminal).filter_map(of).collect();
        Family { places: vec![place.into()], motion: "general", law: "constant", parameters, start: Vec::new() }
    })
    .collect();
    for part in ["base_joint", "platform_joint", "body"] {
        for limbs in [&[0][..], &[1], &[2], &[0, 1]] {
            all.push(of_limbs(usual, limbs, part));
        }
    }
    for limbs in [&[0][..], &[1], &[2], &[0, 1], &[0, 1, 2]] {
        for degree in 1..=2 {
            all.push(extension(usual, limbs, "axial", usual.axial, degree));
            all.push(extension(usual, limbs, "lateral", usual.across, degree));
        }
        all.extend(STRAIGHT_ABOVE.map(|share| load(scales, limbs, share * scales.force_n)));
        if recorded.unloading {
            all.push(direction(scales, limbs));
        }
        if recorded.temperatures {
            all.push(temperature(usual, limbs));
        }
    }
    all.retain(|family| !family.parameters.is_empty());
    all
}

fn parameter(
    places: &[&str],
    motion: &str,
    law: &str,
    index: usize,
    scale: f64,
    one_sided: bool,
) -> Option<ElementParameter> {
    let of = |place: &&str| Element::from_names(place, motion, law, []);
    let elements = places.iter().map(of).collect::<Option<Vec<Element>>>()?;
    Some(ElementParameter { elements, index, prior: Prior::Normal { scale }, role: Role::Amplitude { one_sided } })
}

fn names(limbs: &[usize], part: &str) -> Vec<String> {
    limbs.iter().map(|i| super::places::part(*i, part)).collect()
}

/// All that may yield in a limb's part.
fn of_limbs(usual: &Usual, limbs: &[usize], part: &str) -> Family {
    let places = names(limbs, part);
    let own: Vec<&str> = places.iter().map(String::as_str).collect();
    let turning = 3.0 * usual.terminal[3..].iter().fold(0.0_f64, |m, v| m.max(*v));
    let scales = [("axial", usual.axial), ("lateral", usual.across), ("tilting", turning), ("torsion", turning)];
    let of = |(motion, scale): (&str, f64)| parameter(&own, motion, "constant", 0, scale, false);
    let parameters = scales.into_iter().filter_map(of).collect();
    Family { places, motion: "general", law: "constant", parameters, start: Vec::new() }
}

/// A compliance of bodies that changes with their length, a polynomial of some degree.
fn extension(usual: &Usual, limbs: &[usize], motion: &'static str, scale: f64, degree: usize) -> Family {
    let places = names(limbs, "body");
    let own: Vec<&str> = places.iter().map(String::as_str).collect();
    // what several limbs have in common has one middle
    let own_m = limbs.iter().map(|i| usual.travel_m[*i]);
    let [middle, half] = own_m.fold([0.0; 2], |[a, b], [m, h]| [a + m, b + h]).map(|sum| sum / limbs.len() as f64);
    let scales = [scale, scale / half, scale / (half * half)];
    let of = |(index, scale): (usize, f64)| {
        let mut p = parameter(&own, motion, "extension", index, scale, false)?;
        p.elements.iter_mut().for_each(|e| e.parameters[3] = middle);
        Some(p)
    };
    let parameters = scales.into_iter().take(degree + 1).enumerate().filter_map(of).collect();
    Family { places, motion, law: "extension", parameters, start: Vec::new() }
}

/// An elongation of bodies that is not linear in their tension.
fn load(scales: &MachineScales, limbs: &[usize], straight_above_n: f64) -> Family {
    let places = names(limbs, "body");
    let own: Vec<&str> = places.iter().map(String::as_str).collect();
    let (c, n, [of_fits_m, of_limbs]) = (scales.axial_m_per_n, straight_above_n, PLAY.0);
    let taken_up_n = PLAY.1 * scales.force_n;
    let scales = [c, c / n, c / n, c / (n * n), scales.gap_m(of_fits_m, of_limbs)];
    let of = |(index, scale): (usize, f64)| {
        let mut p = parameter(&own, "axial", "load", index, scale, false)?;
        p.elements.iter_mut().for_each(|e| e.parameters[LOAD_SHAPES].copy_from_slice(&[taken_up_n, straight_above_n]));
        Some(p)
    };
    let parameters = scales.into_iter().enumerate().filter_map(of).collect();
    Family { places, motion: "axial", law: "load", parameters, start: Vec::new() }
}

/// An elongation of bodies that lags behind their tension.
fn direction(scales: &MachineScales, limbs: &[usize]) -> Family {
    let places = names(limbs, "body");
    let own: Vec<&str> = places.iter().map(String::as_str).collect();
    let ([of_fits_m, of_limbs], reversal_n) = (LAG.0, LAG.1 * scales.force_n);
    let of = |(index, scale): (usize, f64)| {
        let mut p = parameter(&own, "axial", "direction", index, scale, false)?;
        p.elements.iter_mut().for_each(|e| e.parameters[2] = reversal_n);
        Some(p)
    };
    let lag_m = scales.gap_m(of_fits_m, of_limbs);
    let parameters = [lag_m, 0.3 * scales.axial_m_per_n].into_iter().enumerate().filter_map(of).collect();
    Family { places, motion: "axial", law: "direction", parameters, start: Vec::new() }
}

/// Softening of a limb with temperature, wherever in it: bodies and joints pass the same forces.
fn temperature(usual: &Usual, limbs: &[usize]) -> Family {
    let places = names(limbs, "body");
    let own: Vec<&str> = places.iter().map(String::as_str).collect();
    let joints = names(limbs, "platform_joint");
    let at_joints: Vec<&str> = joints.iter().map(String::as_str).collect();
    let turning = 3.0 * usual.terminal[3..].iter().fold(0.0_f64, |m, v| m.max(*v));
    let of = |(at, motion, scale): (&[&str], &str, f64)| {
        parameter(at, motion, "temperature", 0, scale * SOFTENING_PER_K, false)
    };
    let all = [
        (&own[..], "axial", usual.axial),
        (&own, "tilting", turning),
        (&own, "torsion", turning),
        (&own, "lateral", usual.across),
        (&at_joints, "tilting", turning),
    ];
    let parameters = all.into_iter().filter_map(of).collect();
    Family { places, motion: "general", law: "temperature", parameters, start: Vec::new() }
}

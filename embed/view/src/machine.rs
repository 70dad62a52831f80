//! A machine as a row of numbers.

use pkm_core::effects::{COUNT, Effects, Element, Law, MAX_ELEMENT_PARAMETERS, MAX_ELEMENTS, MAX_PARAMETERS, Place};
use pkm_core::machine::{Body, BodyKind, Geometry, Joint, LimbParameters, Travel, Tube};
use pkm_core::{Machine, MachineParameters, Wrist, WristParameters};

use crate::answer::Links;
use crate::text::Text;

const LIMB_NUMBERS: usize = 6 + 6 + 1 + 4 + 4;
const WRIST_NUMBERS: usize = 11;
/// Of an element: its place from 1 (0: no element), motion, law, and its parameters.
pub const ELEMENT_NUMBERS: usize = 3 + MAX_ELEMENT_PARAMETERS;
/// Where the amplitudes of effects begin, six an effect.
pub const EFFECTS_AT: usize = 4 + 6 + 3 * LIMB_NUMBERS;
/// Where the elements begin.
pub const ELEMENTS_AT: usize = EFFECTS_AT + COUNT * MAX_PARAMETERS;
const WRIST_AT: usize = ELEMENTS_AT + MAX_ELEMENTS * ELEMENT_NUMBERS;
/// Numbers of a machine: geometry, travel, limbs, effects, elements, wrist, and its box of poses.
pub const MACHINE_NUMBERS: usize = WRIST_AT + WRIST_NUMBERS + 6;

/// Writes numbers one after another.
pub(crate) struct Row<'a>(pub core::slice::IterMut<'a, f64>);

impl Row<'_> {
    pub fn put(&mut self, values: &[f64]) {
        for (value, to) in values.iter().zip(self.0.by_ref()) {
            *to = *value;
        }
    }

    pub fn zeros(&mut self, count: usize) {
        self.0.by_ref().take(count).for_each(|to| *to = 0.0);
    }
}

/// Reads numbers one after another.
struct Numbers<'a>(core::slice::Iter<'a, f64>);

impl Numbers<'_> {
    fn take<const N: usize>(&mut self) -> [f64; N] {
        let mut values = [0.0; N];
        for (to, value) in values.iter_mut().zip(self.0.by_ref()) {
            *to = *value;
        }
        values
    }

    fn joint(&mut self) -> Joint {
        Joint { linear_n_per_m: self.take(), angular_nm_per_rad: self.take() }
    }

    fn tube(&mut self) -> Tube {
        let [young_pa, shear_pa, outer_m, inner_m] = self.take();
        Tube { young_pa, shear_pa, outer_m, inner_m }
    }

    fn limb(&mut self) -> LimbParameters {
        let (base_joint, platform_joint) = (self.joint(), self.joint());
        let [kind] = self.take();
        let kind = if kind == 0.0 { BodyKind::Beam } else { BodyKind::Diagonal };
        LimbParameters { base_joint, platform_joint, body: Body { kind, rod: self.tube(), screw: self.tube() } }
    }

    fn element(&mut self) -> Option<Element> {
        let [place, motion, law] = self.take().map(|v: f64| v as usize);
        let parameters = self.take();
        let place = *Place::ALL.get(place.checked_sub(1)?)?;
        Some(Element { place, motion: *place.motions().get(motion)?, law: *Law::ALL.get(law)?, parameters })
    }
}

/// Numbers of a machine; its box of poses as least and greatest θ, σ in rad and Z0 in m.
pub fn write_machine(
    machine: &MachineParameters,
    wrist: &WristParameters,
    pose_box: &[[f64; 2]; 3],
) -> [f64; MACHINE_NUMBERS] {
    let mut numbers = [0.0; MACHINE_NUMBERS];
    let mut row = Row(numbers.iter_mut());
    let g = &machine.geometry;
    row.put(&[g.a1_m, g.a2_m, g.b1_m, g.b2_m]);
    row.put(&machine.travel.min_m);
    row.put(&machine.travel.max_m);
    for limb in &machine.limbs {
        for joint in [&limb.base_joint, &limb.platform_joint] {
            row.put(&joint.linear_n_per_m);
            row.put(&joint.angular_nm_per_rad);
        }
        row.put(&[if limb.body.kind == BodyKind::Beam { 0.0 } else { 1.0 }]);
        for tube in [&limb.body.rod, &limb.body.screw] {
            row.put(&[tube.young_pa, tube.shear_pa, tube.outer_m, tube.inner_m]);
        }
    }
    for parameters in &machine.effects.parameters {
        row.put(parameters);
    }
    for element in &machine.effects.elements {
        row.put(&element.as_ref().map_or([0.0; ELEMENT_NUMBERS], element_numbers));
    }
    let w = wrist;
    row.put(&[w.offset_m, w.first_d_m, w.first_b_m, w.second_b_m, w.flange_m]);
    row.put(&w.min_rad);
    row.put(&w.max_rad);
    row.put(&[w.home_z0_m, w.singularity_margin]);
    for range in pose_box {
        row.put(range);
    }
    numbers
}

fn element_numbers(element: &Element) -> [f64; ELEMENT_NUMBERS] {
    let index = |found: Option<usize>| found.unwrap_or(0) as f64;
    let place = Place::ALL.iter().position(|p| *p == element.place);
    let motion = element.place.motions().iter().position(|m| *m == element.motion);
    let law = Law::ALL.iter().position(|l| *l == element.law);
    let mut numbers = [0.0; ELEMENT_NUMBERS];
    let own = [1.0 + index(place), index(motion), index(law)];
    numbers.iter_mut().zip(own.iter().chain(&element.parameters)).for_each(|(to, v)| *to = *v);
    numbers
}

/// Where a machine is sampled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ranges {
    /// Least and greatest θ, σ in rad, Z0 in m.
    pub(crate) pose: [[f64; 2]; 3],
    /// Least and greatest β1, β2 in rad.
    pub(crate) wrist: [[f64; 2]; 2],
}

type Parts = (Machine<f64>, Wrist<f64>, Ranges, Links);

/// The machine, its wrist, its ranges, the wrist's links.
pub(crate) fn read_machine(numbers: &[f64; MACHINE_NUMBERS]) -> Result<Parts, Text> {
    let mut n = Numbers(numbers.iter());
    let [a1_m, a2_m, b1_m, b2_m] = n.take();
    let geometry = Geometry { a1_m, a2_m, b1_m, b2_m };
    let travel = Travel { min_m: n.take(), max_m: n.take() };
    let limbs = [n.limb(), n.limb(), n.limb()];
    let mut effects = Effects::NONE;
    for parameters in &mut effects.parameters {
        *parameters = n.take();
    }
    for element in &mut effects.elements {
        *element = n.element();
    }
    let [offset_m, first_d_m, first_b_m, second_b_m, flange_m] = n.take();
    let (min_rad, max_rad) = (n.take(), n.take());
    let [home_z0_m, singularity_margin] = n.take();
    let wrist = WristParameters {
        offset_m,
        first_d_m,
        first_b_m,
        second_b_m,
        flange_m,
        min_rad,
        max_rad,
        home_z0_m,
        singularity_margin,
    };
    let wrist_range = [0, 1].map(|joint: usize| [min_rad[joint], max_rad[joint]]);
    let ranges = Ranges { pose: [n.take(), n.take(), n.take()], wrist: wrist_range };
    let links = [offset_m, first_d_m, first_b_m, second_b_m];
    let parameters = MachineParameters { geometry, travel, limbs, effects };
    let machine = Machine::<f64>::new(&parameters).map_err(|e| Text::of(&e))?;
    Ok((machine, Wrist::<f64>::new(&wrist).map_err(|e| Text::of(&e))?, ranges, links))
}

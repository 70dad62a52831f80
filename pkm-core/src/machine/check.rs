//! What [`Machine::new`](super::Machine::new) demands of the numbers, also at compile time.

use super::{End, Joint, MachineError, MachineParameters, Member, Parameter, Problem, Tube};
use crate::effects::{self, Misfit};

/// Directions that a joint releases, as a mask over its three angular axes.
const fn released(limb: usize, end: End) -> [bool; 3] {
    match (limb, end) {
        (2, End::Base) => [true, false, false],
        (2, End::Platform) => [true, true, true],
        (_, End::Base) => [true, true, false],
        (_, End::Platform) => [true, false, false],
    }
}

const fn check_positive(value: f64, parameter: Parameter) -> Result<(), MachineError> {
    let problem = if !value.is_finite() {
        Problem::NotFinite
    } else if value <= 1e-30 || value >= 1e30 {
        // f32 overflows beyond, and no length, modulus or stiffness of a machine is there
        Problem::NotPositive
    } else {
        return Ok(());
    };
    Err(MachineError { parameter, problem })
}

/// `?` does not work in a `const fn`.
macro_rules! check {
    ($e:expr) => {
        if let Err(error) = $e {
            return Err(error);
        }
    };
}

const fn check_joint(joint: &Joint, limb: usize, end: End) -> Result<(), MachineError> {
    let free = released(limb, end);
    let limb = limb as u8 + 1;
    let mut i = 0;
    while i < 3 {
        let axis = i as u8;
        check!(check_positive(joint.linear_n_per_m[i], Parameter::JointLinear { limb, end, axis }));
        let angular = Parameter::JointAngular { limb, end, axis };
        if !free[i] {
            check!(check_positive(joint.angular_nm_per_rad[i], angular));
        } else if joint.angular_nm_per_rad[i] != 0.0 {
            return Err(MachineError { parameter: angular, problem: Problem::NotReleased });
        }
        i += 1;
    }
    Ok(())
}

const fn check_tube(tube: &Tube, limb: usize, member: Member) -> Result<(), MachineError> {
    let limb = limb as u8 + 1;
    check!(check_positive(tube.young_pa, Parameter::Young { limb, member }));
    check!(check_positive(tube.shear_pa, Parameter::Shear { limb, member }));
    check!(check_positive(tube.outer_m, Parameter::Outer { limb, member }));
    let parameter = Parameter::Inner { limb, member };
    if !tube.inner_m.is_finite() {
        return Err(MachineError { parameter, problem: Problem::NotFinite });
    }
    if tube.inner_m < 0.0 || tube.inner_m >= tube.outer_m {
        return Err(MachineError { parameter, problem: Problem::Bore });
    }
    Ok(())
}

const fn check_element(found: &effects::Element, element: u8) -> Result<(), MachineError> {
    let parameter = match found.misfit() {
        None => {
            let mut i = 0;
            while i < effects::MAX_ELEMENT_PARAMETERS {
                let (value, limit) = (found.parameters[i], found.limit(i));
                let parameter = Parameter::Element { element, parameter: i as u8 };
                if !value.is_finite() {
                    return Err(MachineError { parameter, problem: Problem::NotFinite });
                }
                if value != 0.0 && value.abs() >= limit {
                    return Err(MachineError { parameter, problem: Problem::TooLarge });
                }
                // the pitch, and the half length of a worn stretch if there is one
                let is_length = match found.law {
                    effects::Law::Periodic => i == 2,
                    effects::Law::Extension => i == 6 && (value != 0.0 || found.parameters[4] != 0.0),
                    _ => false,
                };
                if is_length {
                    check!(check_positive(value, parameter));
                }
                i += 1;
            }
            return Ok(());
        }
        Some(Misfit::Limb) => Parameter::ElementPlace { element },
        Some(Misfit::Motion) => Parameter::ElementMotion { element },
        Some(Misfit::Law) => Parameter::ElementLaw { element },
    };
    Err(MachineError { parameter, problem: Problem::NotOfPlace })
}

impl MachineParameters {
    /// Checks every number: finite, positive where it must be, released directions 0, travel not reversed.
    ///
    /// # Errors
    /// The first number that fails, and why.
    pub const fn check(&self) -> Result<(), MachineError> {
        let g = &self.geometry;
        check!(check_positive(g.a1_m, Parameter::A1));
        check!(check_positive(g.a2_m, Parameter::A2));
        check!(check_positive(g.b1_m, Parameter::B1));
        check!(check_positive(g.b2_m, Parameter::B2));
        let mut i = 0;
        while i < 3 {
            let limb = i as u8 + 1;
            check!(check_positive(self.travel.min_m[i], Parameter::TravelMin { limb }));
            check!(check_positive(self.travel.max_m[i], Parameter::TravelMax { limb }));
            if self.travel.max_m[i] <= self.travel.min_m[i] {
                return Err(MachineError { parameter: Parameter::TravelMax { limb }, problem: Problem::Reversed });
            }
            let l = &self.limbs[i];
            check!(check_joint(&l.base_joint, i, End::Base));
            check!(check_joint(&l.platform_joint, i, End::Platform));
            check!(check_tube(&l.body.rod, i, Member::Rod));
            check!(check_tube(&l.body.screw, i, Member::Screw));
            i += 1;
        }
        let mut i = 0;
        while i < effects::COUNT * effects::MAX_PARAMETERS {
            let (effect, parameter) = (i / effects::MAX_PARAMETERS, i % effects::MAX_PARAMETERS);
            let value = self.effects.parameters[effect][parameter];
            let limit = match effects::SIZES[effect] {
                Some(size) => 0.5 * g.size(size),
                None => effects::LIMITS[effect][parameter],
            };
            let signed = effects::IS_SIGNED[effect];
            let parameter = Parameter::Effect { effect: effect as u8, parameter: parameter as u8 };
            if !value.is_finite() {
                return Err(MachineError { parameter, problem: Problem::NotFinite });
            }
            if value < 0.0 && !signed {
                return Err(MachineError { parameter, problem: Problem::Negative });
            }
            if value.abs() >= limit {
                return Err(MachineError { parameter, problem: Problem::TooLarge });
            }
            i += 1;
        }
        let mut i = 0;
        while i < effects::MAX_ELEMENTS {
            if let Some(element) = &self.effects.elements[i] {
                check!(check_element(element, i as u8));
            }
            i += 1;
        }
        Ok(())
    }
}

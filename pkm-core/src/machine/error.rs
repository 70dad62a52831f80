//! Which number of a machine is wrong, and why.

use core::fmt;

use crate::effects;

/// Which number of [`MachineParameters`](super::MachineParameters) an error is about. Limbs count from 1; axes, effects, elements and their parameters
/// from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs)] // the variants are the fields' own names
pub enum Parameter {
    A1,
    A2,
    B1,
    B2,
    TravelMin { limb: u8 },
    TravelMax { limb: u8 },
    JointLinear { limb: u8, end: End, axis: u8 },
    JointAngular { limb: u8, end: End, axis: u8 },
    Young { limb: u8, member: Member },
    Shear { limb: u8, member: Member },
    Outer { limb: u8, member: Member },
    Inner { limb: u8, member: Member },
    Effect { effect: u8, parameter: u8 },
    ElementPlace { element: u8 },
    ElementMotion { element: u8 },
    ElementLaw { element: u8 },
    Element { element: u8, parameter: u8 },
}

/// An end of a limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum End {
    /// At B_i.
    Base,
    /// At A_i.
    Platform,
}

/// A part of a limb's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Member {
    /// The tube that guides.
    Rod,
    /// The screw that drives.
    Screw,
}

/// What is wrong with a number of [`MachineParameters`](super::MachineParameters).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Problem {
    /// NaN or infinite.
    NotFinite,
    /// Zero or negative where only a positive number has a meaning, or too large or small to compute with.
    NotPositive,
    /// A released direction of a joint must have stiffness 0.
    NotReleased,
    /// The greatest screw length is not above the least.
    Reversed,
    /// Negative where only a number of at least 0 has a meaning.
    Negative,
    /// An effect's parameter far beyond what any machine has, either way: 1e-3 m/N or rad/(N·m), 1e3 /(N·m²), 0.1 m of
    /// offset, half of a platform's size, a stiffness of 5 % or a length of 1e-3 per kelvin, 1e6 otherwise.
    TooLarge,
    /// The bore is negative or not smaller than the outer diameter.
    Bore,
    /// An element's place has no such limb, motion or law: only a limb has a length, and only its axial motion may depend
    /// on the load.
    NotOfPlace,
}

/// Why [`Machine::new`](super::Machine::new) refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MachineError {
    /// The number.
    pub parameter: Parameter,
    /// What is wrong with it.
    pub problem: Problem,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut size = |size| write!(f, "the platform size {size}");
        match *self {
            Self::A1 => size("a1"),
            Self::A2 => size("a2"),
            Self::B1 => size("b1"),
            Self::B2 => size("b2"),
            Self::TravelMin { limb } => write!(f, "the least length of screw {limb}"),
            Self::TravelMax { limb } => write!(f, "the greatest length of screw {limb}"),
            Self::JointLinear { limb, end, axis } => {
                write!(f, "limb {limb}, {end} joint: the stiffness along axis {axis}")
            }
            Self::JointAngular { limb, end, axis } => {
                write!(f, "limb {limb}, {end} joint: the stiffness about axis {axis}")
            }
            Self::Young { limb, member } => write!(f, "limb {limb}, {member}: Young's modulus"),
            Self::Shear { limb, member } => write!(f, "limb {limb}, {member}: the shear modulus"),
            Self::Outer { limb, member } => write!(f, "limb {limb}, {member}: the outer diameter"),
            Self::Inner { limb, member } => write!(f, "limb {limb}, {member}: the inner diameter"),
            Self::Effect { effect, parameter } => {
                let info = effects::EFFECTS.get(usize::from(effect));
                let name = info.and_then(|info| info.parameters.get(usize::from(parameter)));
                write!(f, "effect {}: {}", info.map_or("?", |info| info.id), name.map_or("?", |p| p.name))
            }
            Self::ElementPlace { element } => write!(f, "element {element}: the limb"),
            Self::ElementMotion { element } => write!(f, "element {element}: the motion"),
            Self::ElementLaw { element } => write!(f, "element {element}: the law"),
            Self::Element { element, parameter } => write!(f, "element {element}: parameter {parameter}"),
        }
    }
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Base => "base",
            Self::Platform => "platform",
        })
    }
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rod => "rod",
            Self::Screw => "screw",
        })
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "is not a finite number",
            Self::NotPositive => "is not above 0, or far beyond any machine",
            Self::NotReleased => "must be 0, since the joint is free there",
            Self::Reversed => "is not above the least",
            Self::Negative => "is negative",
            Self::TooLarge => "is far beyond any machine",
            Self::Bore => "is negative or not below the outer one",
            Self::NotOfPlace => "is none that this place has",
        })
    }
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.parameter, self.problem)
    }
}

impl core::error::Error for MachineError {}

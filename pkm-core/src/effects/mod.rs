//! Physics beyond the basic model: [`EFFECTS`] lists it, `docs/theory.md` has its formulas.
//!
//! An effect is a file here and a line in the register at the end. Its parameters are amplitudes, mostly
//! compliances: all zero is the basic model. What is elastic inside a limb adds to the limb's compliance, what is in
//! series with the whole adds at an end. A machine file's `[[effect]]` and a `diagnose` of `pkm-host` name them by
//! [`id`](EffectInfo::id). What is on no list is an [`Element`]: a place, a motion and a law.

mod active;
mod active_elements;
mod effect;
mod elements;
mod info;
mod parameters;
#[macro_use]
mod register;

pub(crate) use active::ActiveEffects;
use effect::Effect;
pub(crate) use effect::Size;
pub(crate) use elements::Misfit;
pub use elements::{Element, Law, MAX_ELEMENT_PARAMETERS, MAX_ELEMENTS, Motion, Place, WEIGHT_STEPS};
pub use info::{EffectInfo, Expected, MachineScales, ParameterInfo, Plausible, ToldBy};
pub use parameters::Effects;

use nalgebra::{Matrix3, Vector6};

use crate::elastic::{Chain, Limb, LimbFrame};
use crate::scalar::Scalar;

/// Most parameters that an effect has.
pub const MAX_PARAMETERS: usize = 6;

/// Class of what yields in limbs 1 and 2.
pub const LIMBS_1_2: &str = "joints and screws of limbs 1 and 2";
/// Class of what yields in limb 3.
pub const LIMB_3: &str = "joints and screw of limb 3";

/// `==` of slices does not work in a `const fn`.
const fn same(a: &[u8], b: &[u8]) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

// The register: module and types. Their order is that of [`EFFECTS`] and of the parameters in [`Effects`].
effects! {
    moving_platform::{MovingPlatformCompliance},
    base::{BaseCompliance},
    telescopic::{TelescopicLimb},
    drive::{ScrewPosition, Limb1Axial, Limb2Axial, Limb3Axial},
    joints::{UniversalJoint, RevoluteJoint, SphericalJoint, Revolute3Joint},
    wrist::{WristCompliance},
    coupling::{LimbCoupling},
    load_dependent::{Clearance, ContactStiffening, FrictionHysteresis},
    preload::{Preload},
    geometry::{PlatformOffset, GeometryA1, GeometryA2, GeometryB1, GeometryB2},
    thermal::{ThermalModulus, ThermalExpansion},
}

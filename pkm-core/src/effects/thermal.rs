use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// Limb bodies and joints lose stiffness above 20 °C: in proportion, so that 1 − rate × rise of it is left.
pub(super) struct ThermalModulus;

impl Effect for ThermalModulus {
    const INFO: EffectInfo =
        EffectInfo { id: "thermal-modulus", parameters: &["bodies_per_k", "joints_per_k"], signed: true };
    const LIMITS: [f64; MAX_PARAMETERS] = [0.05, 0.05, f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY];

    fn softening<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [p[0], p[1]]
    }
}

/// Limbs and platforms grow while the screws' encoders read the same.
pub(super) struct ThermalExpansion;

impl Effect for ThermalExpansion {
    const INFO: EffectInfo =
        EffectInfo { id: "thermal-expansion", parameters: &["limbs_per_k", "platforms_per_k"], signed: true };
    const LIMITS: [f64; MAX_PARAMETERS] = [1e-3, 1e-3, f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY];

    fn growth<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [p[0], p[1]]
    }
}

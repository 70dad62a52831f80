use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::scalar::Scalar;

/// Limb bodies and joints lose stiffness above 20 °C: in proportion, so that 1 − rate × rise of it is left.
pub(super) struct ThermalModulus;

impl Effect for ThermalModulus {
    const INFO: EffectInfo = EffectInfo {
        id: "thermal-modulus",
        parameters: &[
            ParameterInfo::new("bodies_per_k", 0.05, Plausible::Within(|_| 0.01)),
            ParameterInfo::new("joints_per_k", 0.05, Plausible::Within(|_| 0.01)),
        ],
        signed: true,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "general",
            law: "temperature",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Temperatures,
            inspect: "temperatures of limbs and platforms during the readings",
        },
    };

    fn softening<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [p[0], p[1]]
    }
}

/// Limbs and platforms grow while the screws' encoders read the same.
pub(super) struct ThermalExpansion;

impl Effect for ThermalExpansion {
    const INFO: EffectInfo = EffectInfo {
        id: "thermal-expansion",
        parameters: &[
            ParameterInfo::new("limbs_per_k", 1e-3, Plausible::Within(|_| 3e-5)),
            ParameterInfo::new("platforms_per_k", 1e-3, Plausible::Within(|_| 3e-5)),
        ],
        signed: true,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "axial",
            law: "temperature",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Temperatures,
            inspect: "temperatures of limbs and platforms during the readings",
        },
    };

    fn growth<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [p[0], p[1]]
    }
}

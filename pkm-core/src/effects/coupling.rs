use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::scalar::Scalar;

/// The fixed platform gives where limbs 1 and 2 stand, so that the load of one moves the other.
pub(super) struct LimbCoupling;

impl Effect for LimbCoupling {
    const INFO: EffectInfo = EffectInfo {
        id: "limb-coupling",
        parameters: &[
            ParameterInfo::new("together_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
            ParameterInfo::new("opposed_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
        ],
        signed: false,
        expected: Expected {
            places: &["base"],
            motion: "general",
            law: "constant",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the base between the joints of limbs 1 and 2",
        },
    };

    fn between_bases_1_2<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 2]> {
        Some([p[0], p[1]])
    }
}

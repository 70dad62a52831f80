use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::scalar::Scalar;

/// Everything between A and the tool.
pub(super) struct WristCompliance;

impl Effect for WristCompliance {
    const INFO: EffectInfo = EffectInfo {
        id: "wrist-compliance",
        parameters: &[
            ParameterInfo::new("linear_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
            ParameterInfo::new("angular_rad_per_nm", 1e-3, Plausible::Within(|m| m.turning_rad_per_nm)),
        ],
        signed: false,
        expected: Expected {
            places: &["tool"],
            motion: "general",
            law: "constant",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the wrist and what is mounted at A",
        },
    };

    const AT_TOOL: bool = true;

    fn at_tool<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        Some([p[0], p[0], p[0], p[1], p[1], p[1]])
    }
}

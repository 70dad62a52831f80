use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// Everything between A and the tool.
pub(super) struct WristCompliance;

impl Effect for WristCompliance {
    const INFO: EffectInfo =
        EffectInfo { id: "wrist-compliance", parameters: &["linear_m_per_n", "angular_rad_per_nm"], signed: false };

    const AT_TOOL: bool = true;

    fn at_tool<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        Some([p[0], p[0], p[0], p[1], p[1], p[1]])
    }
}

use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// The fixed platform gives where limbs 1 and 2 stand, so that the load of one moves the other.
pub(super) struct LimbCoupling;

impl Effect for LimbCoupling {
    const INFO: EffectInfo =
        EffectInfo { id: "limb-coupling", parameters: &["together_m_per_n", "opposed_m_per_n"], signed: false };

    fn between_bases_1_2<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 2]> {
        Some([p[0], p[1]])
    }
}

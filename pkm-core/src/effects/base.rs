use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::elastic::Limb;
use crate::scalar::Scalar;

/// The machine's mount on the ground, common to all limbs, at B; and the fixed platform under each base joint.
pub(super) struct BaseCompliance;

impl Effect for BaseCompliance {
    const INFO: EffectInfo = EffectInfo {
        id: "base-compliance",
        parameters: &["mount_m_per_n", "mount_rad_per_nm", "under_joints_m_per_n"],
        signed: false,
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let o = T::ZERO;
        limb.chain.add_joint(&limb.base, &limb.base_axes, [p[2], p[2], p[2], o, o, o]);
    }

    fn at_base<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        Some([p[0], p[0], p[0], p[1], p[1], p[1]])
    }
}

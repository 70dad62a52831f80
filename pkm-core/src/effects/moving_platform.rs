use nalgebra::Vector3;

use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::elastic::Limb;
use crate::scalar::Scalar;

/// The moving platform as three arms from A to A_i, clamped to a hub at A that gives to moments; arms 1 and 2
/// on one bridge that gives to the sum of their forces.
pub(super) struct MovingPlatformCompliance;

impl Effect for MovingPlatformCompliance {
    const INFO: EffectInfo = EffectInfo {
        id: "moving-platform-compliance",
        // 1/EI of an arm for bending out of the platform's plane and in it, 1/GJ; turning of the hub; bridge
        parameters: &["bending_per_nm2", "in_plane_per_nm2", "torsion_per_nm2", "hub_rad_per_nm", "bridge_m_per_n"],
        signed: false,
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let o = T::ZERO;
        limb.chain.add_beam(&Vector3::zeros(), &limb.platform, &Vector3::z(), [o, p[1], p[0], p[2]]);
    }

    fn at_hub<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        let o = T::ZERO;
        Some([o, o, o, p[3], p[3], p[3]])
    }

    fn between_arms_1_2<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<T> {
        Some(p[4])
    }
}

use super::{Effect, EffectInfo, Limb, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// The moving platform as three arms from A to A_i, clamped at A.
pub(super) struct MovingPlatformCompliance;

impl Effect for MovingPlatformCompliance {
    const INFO: EffectInfo = EffectInfo {
        id: "moving-platform-compliance",
        // 1/EI of an arm for bending out of the platform's plane and in it, 1/GJ
        parameters: &["bending_per_nm2", "in_plane_per_nm2", "torsion_per_nm2"], signed: false
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let (o, w) = (T::ZERO, [T::ZERO, T::ZERO, T::ONE]);
        limb.chain.add_beam([o; 3], limb.platform, w, [o, p[1], p[0], p[2]]);
    }
}

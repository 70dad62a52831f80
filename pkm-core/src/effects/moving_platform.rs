use nalgebra::Vector3;

use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::elastic::Limb;
use crate::scalar::Scalar;

/// An arm that moves at its end by some of what a limb does.
const ARM: Plausible = Plausible::Within(|m| 6.0 * m.axial_m_per_n / (m.arm_m * m.arm_m * m.arm_m));

/// The moving platform as three arms from A to A_i, clamped to a hub at A that gives to moments; arms 1 and 2
/// on one bridge that gives to the sum of their forces.
pub(super) struct MovingPlatformCompliance;

impl Effect for MovingPlatformCompliance {
    const INFO: EffectInfo = EffectInfo {
        id: "moving-platform-compliance",
        parameters: &[
            // 1/EI of an arm for bending out of the platform's plane and in it, 1/GJ; turning of the hub; bridge
            ParameterInfo::new("bending_per_nm2", 1e3, ARM),
            ParameterInfo::new("in_plane_per_nm2", 1e3, ARM),
            ParameterInfo::new("torsion_per_nm2", 1e3, ARM),
            ParameterInfo::new("hub_rad_per_nm", 1e-3, Plausible::Within(|m| m.turning_rad_per_nm)),
            ParameterInfo::new("bridge_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
        ],
        signed: false,
        expected: Expected {
            places: &["moving_platform"],
            motion: "general",
            law: "constant",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the moving platform: its hub, its arms and the bridge between joints",
        },
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

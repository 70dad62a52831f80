use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::elastic::Limb;
use crate::scalar::Scalar;

/// The machine's mount on the ground, common to all limbs, at B; and the fixed platform under each base joint.
pub(super) struct BaseCompliance;

impl Effect for BaseCompliance {
    const INFO: EffectInfo = EffectInfo {
        id: "base-compliance",
        parameters: &[
            ParameterInfo::new("mount_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
            ParameterInfo::new("mount_rad_per_nm", 1e-3, Plausible::Within(|m| m.axial_m_per_n / (m.b1_m * m.b1_m))),
            ParameterInfo::new("under_joints_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
        ],
        signed: false,
        expected: Expected {
            places: &["base"],
            motion: "general",
            law: "constant",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the base: its frame, its mounts and the seats of the joints",
        },
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let o = T::ZERO;
        limb.chain.add_joint(&limb.base, &limb.base_axes, [p[2], p[2], p[2], o, o, o]);
    }

    fn at_base<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        Some([p[0], p[0], p[0], p[1], p[1], p[1]])
    }
}

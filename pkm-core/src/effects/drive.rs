use super::{Effect, EffectInfo, Expected, LIMB_3, LIMBS_1_2, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::elastic::Limb;
use crate::scalar::Scalar;

fn along<T: Scalar, const N: usize>(compliance: T, limb: &mut Limb<'_, T, N>) {
    let o = T::ZERO;
    limb.chain.add_joint(&limb.platform, &limb.axes, [o, o, compliance, o, o, o]);
}

/// The loaded part of every screw gets longer with its limb.
pub(super) struct ScrewPosition;

impl Effect for ScrewPosition {
    const INFO: EffectInfo = EffectInfo {
        id: "screw-position",
        parameters: &[ParameterInfo::new(
            "axial_per_n",
            1e-3,
            Plausible::Within(|m| 2.0 * m.axial_m_per_n / m.shortest_m),
        )],
        signed: false,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "axial",
            law: "extension",
            ln_prior: 0.0,
            class: Some(LIMBS_1_2),
            told_by: ToldBy::Loading,
            inspect: "the limbs: screw, nut and bearing",
        },
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        along(p[0] * limb.q, limb);
    }
}

macro_rules! softer_drive {
    ($name:ident, $index:literal, $id:literal, $place:literal, $class:ident, $inspect:literal) => {
        /// Nut, bearing or screw of one limb.
        pub(super) struct $name;

        impl Effect for $name {
            const INFO: EffectInfo = EffectInfo {
                id: $id,
                parameters: &[ParameterInfo::new("axial_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n))],
                signed: false,
                expected: Expected {
                    places: &[$place],
                    motion: "axial",
                    law: "constant",
                    ln_prior: 0.0,
                    class: Some($class),
                    told_by: ToldBy::Loading,
                    inspect: $inspect,
                },
            };

            fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
                if limb.index == $index {
                    along(p[0], limb);
                }
            }
        }
    };
}

softer_drive!(
    Limb1Axial,
    0,
    "limb-1-axial",
    "limb.1.body",
    LIMBS_1_2,
    "limb 1: joint, bearing or drive along its axis"
);
softer_drive!(
    Limb2Axial,
    1,
    "limb-2-axial",
    "limb.2.body",
    LIMBS_1_2,
    "limb 2: joint, bearing or drive along its axis"
);
softer_drive!(Limb3Axial, 2, "limb-3-axial", "limb.3.body", LIMB_3, "limb 3: joint, bearing or drive along its axis");

use super::{Effect, EffectInfo, Expected, LIMB_3, LIMBS_1_2, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::elastic::Limb;
use crate::scalar::Scalar;

macro_rules! softer_joint {
    ($name:ident, $id:literal, $what:literal, $parameters:expr, $limbs:pat, $place:ident, $axes:ident, $places:expr, $class:ident, $inspect:literal) => {
        #[doc = $what]
        pub(super) struct $name;

        impl Effect for $name {
            const INFO: EffectInfo = EffectInfo {
                id: $id,
                parameters: $parameters,
                signed: false,
                expected: Expected {
                    places: $places,
                    motion: "general",
                    law: "constant",
                    ln_prior: 0.0,
                    class: Some($class),
                    told_by: ToldBy::Loading,
                    inspect: $inspect,
                },
            };

            fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
                if matches!(limb.index, $limbs) {
                    // a released direction passes no moment on, so compliance about it has no effect
                    limb.chain.add_joint(&limb.$place, &limb.$axes, [p[0], p[0], p[0], p[1], p[1], p[1]]);
                }
            }
        }
    };
}

const RADIAL: ParameterInfo = ParameterInfo::new("radial_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n));
const TILTING: ParameterInfo =
    ParameterInfo::new("tilting_rad_per_nm", 1e-3, Plausible::Within(|m| 2.0 * m.tilting_rad_per_nm));
const BOTH: &[ParameterInfo] = &[RADIAL, TILTING];

softer_joint!(
    UniversalJoint,
    "universal-joint",
    "U joints of limbs 1 and 2.",
    BOTH,
    0 | 1,
    base,
    base_axes,
    &["limb.1.base_joint", "limb.2.base_joint"],
    LIMBS_1_2,
    "limbs 1 and 2: the universal joints at the base"
);
softer_joint!(
    RevoluteJoint,
    "revolute-joint",
    "R joints of limbs 1 and 2.",
    BOTH,
    0 | 1,
    platform,
    axes,
    &["limb.1.platform_joint", "limb.2.platform_joint"],
    LIMBS_1_2,
    "limbs 1 and 2: the revolute joints at the platform"
);
softer_joint!(
    SphericalJoint,
    "spherical-joint",
    "S joint of limb 3.",
    &[RADIAL],
    2,
    platform,
    axes,
    &["limb.3.platform_joint"],
    LIMB_3,
    "limb 3: the spherical joint at the platform"
);
softer_joint!(
    Revolute3Joint,
    "revolute-3-joint",
    "R joint of limb 3.",
    BOTH,
    2,
    base,
    base_axes,
    &["limb.3.base_joint"],
    LIMB_3,
    "limb 3: the revolute joint at the base"
);

use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::elastic::Limb;
use crate::scalar::Scalar;

macro_rules! softer_joint {
    ($name:ident, $id:literal, $what:literal, $parameters:expr, $limbs:pat, $place:ident, $axes:ident) => {
        #[doc = $what]
        pub(super) struct $name;

        impl Effect for $name {
            const INFO: EffectInfo = EffectInfo { id: $id, parameters: $parameters, signed: false };

            fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
                if matches!(limb.index, $limbs) {
                    // a released direction passes no moment on, so compliance about it has no effect
                    limb.chain.add_joint(&limb.$place, &limb.$axes, [p[0], p[0], p[0], p[1], p[1], p[1]]);
                }
            }
        }
    };
}

const BOTH: &[&str] = &["radial_m_per_n", "tilting_rad_per_nm"];

softer_joint!(UniversalJoint, "universal-joint", "U joints of limbs 1 and 2.", BOTH, 0 | 1, base, base_axes);
softer_joint!(RevoluteJoint, "revolute-joint", "R joints of limbs 1 and 2.", BOTH, 0 | 1, platform, axes);
softer_joint!(SphericalJoint, "spherical-joint", "S joint of limb 3.", &["radial_m_per_n"], 2, platform, axes);
softer_joint!(Revolute3Joint, "revolute-3-joint", "R joint of limb 3.", BOTH, 2, base, base_axes);

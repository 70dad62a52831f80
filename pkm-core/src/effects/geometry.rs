use super::{Effect, EffectInfo, MAX_PARAMETERS, Size};
use crate::scalar::Scalar;

/// A_i out of the uv plane, or joint axes that miss the limb's axis: stiffness changes, kinematics do not know.
pub(super) struct PlatformOffset;

impl Effect for PlatformOffset {
    const INFO: EffectInfo =
        EffectInfo { id: "platform-offset", parameters: &["limbs_1_2_m", "limb_3_m"], signed: true };
    const LIMITS: [f64; MAX_PARAMETERS] = [0.1, 0.1, f64::INFINITY, f64::INFINITY, f64::INFINITY];

    fn offset<T: Scalar>(p: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [p[0], p[1]]
    }
}

macro_rules! wrong_size {
    ($name:ident, $size:ident, $id:literal) => {
        /// True size less the declared one, which the controller uses. Refused from half the declared size on.
        pub(super) struct $name;

        impl Effect for $name {
            const INFO: EffectInfo = EffectInfo { id: $id, parameters: &["error_m"], signed: true };
            const SIZE: Option<Size> = Some(Size::$size);
        }
    };
}

wrong_size!(GeometryA1, A1, "geometry-a1");
wrong_size!(GeometryA2, A2, "geometry-a2");
wrong_size!(GeometryB1, B1, "geometry-b1");
wrong_size!(GeometryB2, B2, "geometry-b2");

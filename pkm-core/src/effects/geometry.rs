use nalgebra::Vector3;

use super::{Effect, EffectInfo, MAX_PARAMETERS, Size};
use crate::elastic::Limb;
use crate::linalg::axes;
use crate::scalar::Scalar;

/// A_i out of the uv plane, and bodies that lie beside the line from joint to joint, toward x of the limb: stiffness
/// changes, kinematics do not know.
pub(super) struct PlatformOffset;

impl Effect for PlatformOffset {
    const INFO: EffectInfo = EffectInfo {
        id: "platform-offset",
        parameters: &["limbs_1_2_m", "limb_3_m", "aside_1_m", "aside_2_m", "aside_3_m"],
        signed: true,
    };
    const LIMITS: [f64; MAX_PARAMETERS] = [0.1; MAX_PARAMETERS];

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let [_, _, one, two, three, ..] = *p;
        let aside = if limb.index == 0 {
            one
        } else if limb.index == 1 {
            two
        } else {
            three
        };
        if aside == T::ZERO {
            return;
        }
        let [x, ..] = axes(&limb.axes);
        let moved = |at: Vector3<T>| at + x * aside;
        let body = [limb.axial, limb.bending, limb.bending, limb.torsion];
        limb.chain.add_beam(&limb.base, &limb.platform, &x, body.map(|c| -c));
        limb.chain.add_beam(&moved(limb.base), &moved(limb.platform), &x, body);
    }

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

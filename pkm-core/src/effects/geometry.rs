use nalgebra::Vector3;

use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, Size, ToldBy};
use crate::elastic::Limb;
use crate::linalg::axes;
use crate::scalar::Scalar;

/// A_i out of the uv plane, and bodies that lie beside the line from joint to joint, toward x of the limb: stiffness
/// changes, kinematics do not know.
pub(super) struct PlatformOffset;

/// A body aside couples a limb's yielding along and across it, and so does much that is on no list.
const fn aside(name: &'static str) -> ParameterInfo {
    ParameterInfo { ambiguous: true, ..ParameterInfo::new(name, 0.1, Plausible::Within(|_| 3e-3)) }
}

impl Effect for PlatformOffset {
    const INFO: EffectInfo = EffectInfo {
        id: "platform-offset",
        parameters: &[
            ParameterInfo::new("limbs_1_2_m", 0.1, Plausible::Within(|_| 20e-3)),
            ParameterInfo::new("limb_3_m", 0.1, Plausible::Within(|_| 20e-3)),
            aside("aside_1_m"),
            aside("aside_2_m"),
            aside("aside_3_m"),
        ],
        signed: true,
        expected: Expected {
            places: &["geometry", "moving_platform"],
            motion: "general",
            law: "constant",
            ln_prior: -4.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the platform: where the joint centres lie",
        },
    };

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
    ($name:ident, $size:ident, $id:literal, $class:expr) => {
        /// True size less the declared one, which the controller uses. Refused from half the declared size on.
        pub(super) struct $name;

        impl Effect for $name {
            const INFO: EffectInfo = EffectInfo {
                id: $id,
                parameters: &[ParameterInfo::new("error_m", f64::INFINITY, Plausible::Within(|_| 5e-3))],
                signed: true,
                expected: Expected {
                    places: &["geometry"],
                    motion: "general",
                    law: "constant",
                    ln_prior: -6.0,
                    class: $class,
                    told_by: ToldBy::Loading,
                    inspect: "the declared geometry: measure it",
                },
            };
            const SIZE: Option<Size> = Some(Size::$size);
        }
    };
}

wrong_size!(GeometryA1, A1, "geometry-a1", Some("geometry of limbs 1 and 2"));
wrong_size!(GeometryA2, A2, "geometry-a2", None);
wrong_size!(GeometryB1, B1, "geometry-b1", Some("geometry of limbs 1 and 2"));
wrong_size!(GeometryB2, B2, "geometry-b2", None);

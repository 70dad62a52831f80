use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::elastic::Limb;
use crate::scalar::Scalar;

fn along<T: Scalar, const N: usize>(compliance: T, limb: &mut Limb<'_, T, N>) {
    let o = T::ZERO;
    limb.chain.add_joint(&limb.platform, &limb.axes, [o, o, compliance, o, o, o]);
}

/// The loaded part of every screw gets longer with its limb.
pub(super) struct ScrewPosition;

impl Effect for ScrewPosition {
    const INFO: EffectInfo = EffectInfo { id: "screw-position", parameters: &["axial_per_n"], signed: false };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        along(p[0] * limb.q, limb);
    }
}

macro_rules! softer_drive {
    ($name:ident, $index:literal, $id:literal) => {
        /// Nut, bearing or screw of one limb.
        pub(super) struct $name;

        impl Effect for $name {
            const INFO: EffectInfo = EffectInfo { id: $id, parameters: &["axial_m_per_n"], signed: false };

            fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
                if limb.index == $index {
                    along(p[0], limb);
                }
            }
        }
    };
}

softer_drive!(Limb1Axial, 0, "limb-1-axial");
softer_drive!(Limb2Axial, 1, "limb-2-axial");
softer_drive!(Limb3Axial, 2, "limb-3-axial");

use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// Tension (above 0) or compression in the limbs before any load. A limb under tension N holds its platform end back
/// by N/q in the direction across it in which its joints let it swing.
pub(super) struct Preload;

impl Effect for Preload {
    const INFO: EffectInfo = EffectInfo { id: "preload", parameters: &["limbs_1_2_n", "limb_3_n"], signed: true };

    fn tension<T: Scalar>(p: &[T; MAX_PARAMETERS], limb: usize) -> T {
        if limb == 2 { p[1] } else { p[0] }
    }
}

use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::scalar::Scalar;

/// Tension (above 0) or compression in the limbs before any load. A limb under tension N holds its platform end back
/// by N/q in the direction across it in which its joints let it swing.
pub(super) struct Preload;

impl Effect for Preload {
    const INFO: EffectInfo = EffectInfo {
        id: "preload",
        parameters: &[
            ParameterInfo::new("limbs_1_2_n", 1e6, Plausible::Within(|_| 1e4)),
            ParameterInfo::new("limb_3_n", 1e6, Plausible::Within(|_| 1e4)),
        ],
        signed: true,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "lateral",
            law: "constant",
            ln_prior: -5.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the limbs: forces in them without a load",
        },
    };

    fn tension<T: Scalar>(p: &[T; MAX_PARAMETERS], limb: usize) -> T {
        if limb == 2 { p[1] } else { p[0] }
    }
}

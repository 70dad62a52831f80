use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// Free play in the force path of every limb: half of it is taken up either way, within some `taken_up_n`
/// (at least 1 N) of load.
pub(super) struct Clearance;

impl Effect for Clearance {
    const INFO: EffectInfo = EffectInfo { id: "clearance", parameters: &["play_m", "taken_up_n"] };
    const DEPENDS_ON_LOAD: bool = true;

    fn elongation<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T) -> (T, T) {
        let half = p[0] * T::from_f64(0.5);
        let width = if p[1] > T::ONE { p[1] } else { T::ONE };
        let size = (tension * tension + width * width).sqrt();
        let share = width / size;
        (half * tension / size, half * share * share / size)
    }
}

/// Contacts along every limb that get stiffer as they are loaded: elongation goes with the load at first, with its
/// power 2/3 (Hertz) well above `reference_n` (at least 1 N).
pub(super) struct ContactStiffening;

impl Effect for ContactStiffening {
    const INFO: EffectInfo =
        EffectInfo { id: "contact-stiffening", parameters: &["unloaded_m_per_n", "reference_n"] };
    const DEPENDS_ON_LOAD: bool = true;

    fn elongation<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T) -> (T, T) {
        let reference = if p[1] > T::ONE { p[1] } else { T::ONE };
        let x = tension / reference;
        let grown = T::ONE + x * x;
        let softness = p[0] / grown.sqrt().cbrt();
        (softness * tension, softness * (T::ONE - x * x / (T::from_f64(3.0) * grown)))
    }
}

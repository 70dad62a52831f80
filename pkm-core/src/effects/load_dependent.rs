use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// Half of a free play is taken up either way, within some force (at least 1 N).
pub(super) fn taken_up<T: Scalar>(play: T, within: T, tension: T) -> T {
    let half = play * T::from_f64(0.5);
    let width = if within > T::ONE { within } else { T::ONE };
    half * tension / (tension * tension + width * width).sqrt()
}

/// A lag with a fixed part and one that grows with the load, built up within some force (at least 1 N) after the loading
/// has turned.
pub(super) fn lagging<T: Scalar>([fixed, growing, reversal]: [T; 3], tension: T, turned_at: T) -> T {
    let width = if reversal > T::ONE { reversal } else { T::ONE };
    let (here, there) = (tension.abs(), turned_at.abs());
    let most = fixed + growing * if here > there { here } else { there };
    let x = (tension - turned_at) / width;
    -(most * x / (T::ONE + x * x).sqrt())
}

/// Free play in the force path of every limb: half of it is taken up either way, within some `taken_up_n`
/// (at least 1 N) of load.
pub(super) struct Clearance;

impl Effect for Clearance {
    const INFO: EffectInfo = EffectInfo { id: "clearance", parameters: &["play_m", "taken_up_n"], signed: false };
    const DEPENDS_ON_LOAD: bool = true;

    fn elongation<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T) -> T {
        taken_up(p[0], p[1], tension)
    }
}

/// Contacts along every limb that get stiffer as they are loaded: elongation goes with the load at first, with its
/// power 2/3 (Hertz) well above `reference_n` (at least 1 N).
pub(super) struct ContactStiffening;

impl Effect for ContactStiffening {
    const INFO: EffectInfo =
        EffectInfo { id: "contact-stiffening", parameters: &["unloaded_m_per_n", "reference_n"], signed: false };
    const DEPENDS_ON_LOAD: bool = true;

    fn elongation<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T) -> T {
        let reference = if p[1] > T::ONE { p[1] } else { T::ONE };
        let x = tension / reference;
        let grown = T::ONE + x * x;
        p[0] / grown.sqrt().cbrt() * tension
    }
}

/// Every limb's elongation lags behind its load: by a fixed part and one that grows with the load, built up within
/// some `reversal_n` (at least 1 N) after the loading has turned.
pub(super) struct FrictionHysteresis;

impl Effect for FrictionHysteresis {
    const INFO: EffectInfo =
        EffectInfo { id: "friction-hysteresis", parameters: &["lag_m", "lag_m_per_n", "reversal_n"], signed: false };
    const DEPENDS_ON_LOAD: bool = true;

    fn lag<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T, turned_at: T) -> T {
        let [fixed, growing, reversal, ..] = *p;
        lagging([fixed, growing, reversal], tension, turned_at)
    }
}

use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::scalar::Scalar;

/// Half of a free play is taken up either way, within some force (at least 1 N).
pub(super) fn taken_up<T: Scalar>(play: T, within: T, tension: T) -> T {
    let half = play * T::from_f64(0.5);
    let width = if within > T::ONE { within } else { T::ONE };
    half * tension / (tension * tension + width * width).sqrt()
}

/// A lag with a fixed part and one that grows with the load, built up within some force (at least 1 N). After each turn it
/// follows the curve of the first loading from there at twice its size (Masing); beyond the first turn, that curve itself.
pub(super) fn lagging<T: Scalar>([fixed, growing, reversal]: [T; 3], tension: T, turns: &[T]) -> T {
    let width = if reversal > T::ONE { reversal } else { T::ONE };
    let first_loading = |tension: T| {
        let x = tension / width;
        x / (T::ONE + x * x).sqrt()
    };
    let most = |tension: T| fixed + growing * tension.abs();
    let outermost = turns.first().copied().unwrap_or(T::ZERO);
    if tension.abs() >= outermost.abs() {
        return -(most(tension) * first_loading(tension));
    }
    let (half, two) = (T::from_f64(0.5), T::from_f64(2.0));
    let (mut sum, mut from) = (first_loading(outermost), outermost);
    for to in turns.iter().skip(1).chain([&tension]) {
        sum += two * first_loading(half * (*to - from));
        from = *to;
    }
    -(most(outermost) * sum)
}

const PLAY_OR_FRICTION: &str = "play or friction";

/// Free play in the force path of every limb: half of it is taken up either way, within some `taken_up_n`
/// (at least 1 N) of load.
pub(super) struct Clearance;

impl Effect for Clearance {
    const INFO: EffectInfo = EffectInfo {
        id: "clearance",
        parameters: &[
            ParameterInfo::new("play_m", 1e-2, Plausible::Within(|m| m.gap_m(30e-6, 6.0))),
            ParameterInfo::new("taken_up_n", 1e6, Plausible::Around { median: |m| m.force_n / 25.0, ln_sd: 1.0 }),
        ],
        signed: false,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "axial",
            law: "load",
            ln_prior: 0.0,
            class: Some(PLAY_OR_FRICTION),
            told_by: ToldBy::Unloading,
            inspect: "the limbs: play in joints, nuts and bearings",
        },
    };
    const DEPENDS_ON_LOAD: bool = true;

    fn elongation<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T) -> T {
        taken_up(p[0], p[1], tension)
    }
}

/// Contacts along every limb that get stiffer as they are loaded: elongation goes with the load at first, with its
/// power 2/3 (Hertz) well above `reference_n` (at least 1 N).
pub(super) struct ContactStiffening;

impl Effect for ContactStiffening {
    const INFO: EffectInfo = EffectInfo {
        id: "contact-stiffening",
        parameters: &[
            ParameterInfo::new("unloaded_m_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n)),
            ParameterInfo::new("reference_n", 1e6, Plausible::Around { median: |m| m.force_n / 5.0, ln_sd: 1.0 }),
        ],
        signed: false,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "axial",
            law: "load",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the limbs: preload of joints, nuts and bearings",
        },
    };
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
    const INFO: EffectInfo = EffectInfo {
        id: "friction-hysteresis",
        parameters: &[
            ParameterInfo::new("lag_m", 1e-2, Plausible::Within(|m| m.gap_m(5e-6, 1.0))),
            // while the load only grows it is but a softer limb
            ParameterInfo {
                needs_unloading: true,
                ..ParameterInfo::new("lag_m_per_n", 1e-3, Plausible::Within(|m| 0.3 * m.axial_m_per_n))
            },
            ParameterInfo::new("reversal_n", 1e6, Plausible::Around { median: |m| m.force_n / 10.0, ln_sd: 1.0 }),
        ],
        signed: false,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "axial",
            law: "direction",
            ln_prior: 0.0,
            class: Some(PLAY_OR_FRICTION),
            told_by: ToldBy::Unloading,
            inspect: "the limbs: friction in joints, screws and guides",
        },
    };
    const DEPENDS_ON_LOAD: bool = true;

    fn lag<T: Scalar>(p: &[T; MAX_PARAMETERS], tension: T, turns: &[T]) -> T {
        let [fixed, growing, reversal, ..] = *p;
        lagging([fixed, growing, reversal], tension, turns)
    }
}

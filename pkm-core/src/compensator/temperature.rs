//! What is believed of a sensor of temperature.

use crate::scalar::Scalar;

/// A temperature rise beyond this is a broken sensor, K.
const MAX_RISE_K: f64 = 100.0;
/// Noise of a sensor is less, K.
const NOISE_K: f64 = 1.0;
/// No part of a machine warms up or cools down as fast, K/s: spindles and screws take minutes for a kelvin.
const MAX_WARMING_K_PER_S: f64 = 0.1;
/// A sensor that has just begun may say the same wrong value for as long, s: what it was reset to, until its first conversion.
const BEGINNING_S: f64 = 1.0;

/// What a machine can do in a period, and times in periods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pace<T> {
    /// The most that a part warms up, K.
    warming_k: T,
    /// For as long as this may have been noise.
    steady: u32,
    beginning: u32,
}

impl<T: Scalar> Pace<T> {
    pub fn new(period_s: f64) -> Self {
        Self {
            warming_k: T::from_f64(MAX_WARMING_K_PER_S * period_s),
            steady: (NOISE_K / MAX_WARMING_K_PER_S / period_s) as u32,
            beginning: (BEGINNING_S / period_s) as u32,
        }
    }
}

/// A sensor of temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RiseSensor<T> {
    /// The last reading that was good.
    good_k: T,
    /// A good reading from which the next ones are measured, and for how many periods it has been: the most at the beginning, when any
    /// reading may be the first. Were it the last one, small steps would lead anywhere.
    from_k: T,
    since: u32,
    /// Whether no good reading has confirmed the first one later on.
    young: bool,
    /// What a young one says instead, and how often in a row.
    other_k: T,
    other: u32,
}

impl<T: Scalar> RiseSensor<T> {
    pub const NEW: Self =
        Self { good_k: T::ZERO, from_k: T::ZERO, since: u32::MAX, young: true, other_k: T::ZERO, other: 0 };

    /// Any reading may be the next: nobody has read meanwhile.
    pub fn begin_again(&mut self) {
        *self = Self { good_k: self.good_k, ..Self::NEW };
    }

    /// The last reading that was good.
    pub fn good_k(&self) -> T {
        self.good_k
    }

    /// Takes a reading that is good, and says whether it is.
    pub fn update(&mut self, rise_k: T, pace: &Pace<T>) -> bool {
        let noise = T::from_f64(NOISE_K);
        let change = (rise_k - self.from_k).abs();
        let in_range = rise_k.abs() <= T::from_f64(MAX_RISE_K);
        let follows =
            in_range && (change <= noise || change <= noise + pace.warming_k * T::from_f64(f64::from(self.since)));
        if follows && self.since < pace.steady {
            (self.good_k, self.since, self.other) = (rise_k, self.since + 1, 0);
            return true;
        }
        if follows {
            // also the first of all
            let young = self.since == u32::MAX;
            *self = Self { good_k: rise_k, from_k: rise_k, since: 0, young, other_k: rise_k, other: 0 };
            return true;
        }
        self.since = self.since.saturating_add(1);
        self.young && self.is_outvoted(rise_k, in_range, pace)
    }

    /// Begins anew with what a young sensor says longer than what it said first.
    fn is_outvoted(&mut self, rise_k: T, in_range: bool, pace: &Pace<T>) -> bool {
        let same = in_range && (rise_k - self.other_k).abs() <= T::from_f64(NOISE_K);
        (self.other_k, self.other) = if same { (self.other_k, self.other + 1) } else { (rise_k, 0) };
        let outvoted = self.other >= pace.beginning && self.other >= self.since / 2;
        if outvoted {
            let young = Self { since: 0, young: true, ..Self::NEW };
            *self = Self { good_k: rise_k, from_k: rise_k, ..young };
        }
        outvoted
    }
}

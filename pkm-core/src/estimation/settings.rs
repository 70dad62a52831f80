//! What an integrator says of the amplitudes that are learned.

use core::fmt;

use super::Amplitude;
use crate::checksum::{over_byte, over_numbers};

/// Most amplitudes of an estimator.
pub const MAX_AMPLITUDES: usize = 8;

/// What is known of an amplitude before the first reading, and how it may move. In its own unit: m/N, rad/(N·m), K, or a share.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AmplitudeSettings {
    /// What it is of.
    pub amplitude: Amplitude,
    /// Its value when the table was accepted: 0 where table and machine hold all of it. Changes count from here, and they alone are
    /// compensated.
    pub accepted: f64,
    /// Standard deviation of the value before anything is read, above 0. No more than this is ever unknown of it.
    pub deviation: f64,
    /// Standard deviation of its drift in a day, at least 0.
    pub drift_per_day: f64,
    /// Least value that physics allows, at most `accepted`.
    pub least: f64,
    /// Greatest value that physics allows, at least `accepted`.
    pub most: f64,
    /// Fastest change of what is used for compensation, above 0, each second.
    pub rate_per_s: f64,
    /// A change by this is worth an alarm, above 0, and within reach of `least` or `most`. Of changes that are not far above a fifth of it less is compensated, see
    /// [`Estimator::targets`](super::Estimator::targets).
    pub alarm: f64,
}

/// Settings of an [`Estimator`](super::Estimator).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EstimatorSettings<const N: usize> {
    /// What is learned, no amplitude twice: a limb yields along its axis alike wherever it does.
    pub amplitudes: [AmplitudeSettings; N],
    /// Standard deviation of the model's own error as a share of the deflection, 0 to 1: what `pkm-host diagnose` reports of
    /// held-out poses.
    pub model_share: f64,
}

/// The first setting that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EstimatorSettingsError {
    /// None, or more than [`MAX_AMPLITUDES`].
    Count,
    /// A duplicate amplitude. They count from 1.
    Twice {
        /// The second one.
        amplitude: u8,
    },
    /// A number of an amplitude is out of its range or not finite.
    Amplitude {
        /// Its number, from 1.
        amplitude: u8,
        /// Name of the field.
        setting: &'static str,
    },
    /// The model's share.
    ModelShare,
}

impl fmt::Display for EstimatorSettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count => f.write_str("an estimator takes 1 to 8 amplitudes"),
            Self::Twice { amplitude } => write!(f, "amplitude {amplitude} is a duplicate"),
            Self::Amplitude { amplitude, setting } => {
                write!(f, "{setting} of amplitude {amplitude} is out of its range")
            }
            Self::ModelShare => f.write_str("the model's share is not from 0 to 1"),
        }
    }
}

impl core::error::Error for EstimatorSettingsError {}

impl AmplitudeSettings {
    /// The first number that is out of its range.
    fn wrong(&self) -> Option<&'static str> {
        let Self { accepted, deviation, drift_per_day, least, most, rate_per_s, alarm, .. } = *self;
        let above_zero = |value: f64| value > 0.0 && value < 1e6;
        [
            ("accepted", accepted.is_finite() && accepted.abs() < 1e6),
            ("deviation", above_zero(deviation) && deviation > 1e-18),
            ("drift_per_day", drift_per_day >= 0.0 && drift_per_day <= 1e3 * deviation),
            ("least", least <= accepted && least >= accepted - 1e3 * deviation),
            ("most", most >= accepted && most <= accepted + 1e3 * deviation),
            ("rate_per_s", above_zero(rate_per_s)),
            ("alarm", above_zero(alarm) && alarm < (most - accepted).max(accepted - least)),
        ]
        .into_iter()
        .find_map(|(setting, is_right)| (!is_right).then_some(setting))
    }
}

impl<const N: usize> EstimatorSettings<N> {
    /// Checks every number.
    ///
    /// # Errors
    /// The first setting that is out of its range, NaN included.
    pub fn check(&self) -> Result<(), EstimatorSettingsError> {
        if N == 0 || N > MAX_AMPLITUDES {
            return Err(EstimatorSettingsError::Count);
        }
        for (amplitude, (n, own)) in (1..).zip(self.amplitudes.iter().enumerate()) {
            if self.amplitudes.iter().take(n).any(|other| other.amplitude.is_same(own.amplitude)) {
                return Err(EstimatorSettingsError::Twice { amplitude });
            }
            if let Some(setting) = own.wrong() {
                return Err(EstimatorSettingsError::Amplitude { amplitude, setting });
            }
        }
        if self.model_share >= 0.0 && self.model_share <= 1.0 {
            Ok(())
        } else {
            Err(EstimatorSettingsError::ModelShare)
        }
    }

    /// What a saved state has to be of, to be read back: a model by its checksum, and amplitudes with their units.
    pub(super) fn fingerprint(&self, model: u64) -> u64 {
        self.amplitudes.iter().fold(model, |hash, own| {
            let hash = own.amplitude.code().into_iter().fold(hash, over_byte);
            over_numbers(hash, &[own.accepted, own.deviation])
        })
    }
}

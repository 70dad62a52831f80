//! What an estimator learns: a file for `replay --learn`.

use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{Amplitude, AmplitudeSettings, EstimatorSettings, EstimatorSettingsError, MAX_AMPLITUDES};
use pkm_core::{Machine, Pose, StiffnessError};
use serde::Deserialize;
use toml::Spanned;

use crate::error::{Failure, Result, clipped};
use crate::source::Source;
use crate::toml_error::{line_at, parsed};

/// The amplitudes, and the model's own error.
#[derive(Clone, Debug, PartialEq)]
pub struct Learn {
    /// In their order.
    pub amplitudes: Vec<AmplitudeSettings>,
    /// Share of the deflection.
    pub model_share: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    format: Spanned<i64>,
    model_share: Spanned<f64>,
    learn: Vec<Spanned<RawAmplitude>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAmplitude {
    place: Spanned<String>,
    motion: Option<Spanned<String>>,
    #[serde(default)]
    accepted: f64,
    deviation: f64,
    drift_per_day: f64,
    least: f64,
    most: f64,
    rate_per_s: f64,
    alarm: f64,
}

/// The place of a temperature.
const TEMPERATURE: &str = "temperature";
/// The place of a gain.
const PROBE: &str = "probe";
/// Of the compliance that the limb has along its axis: how far its drive may be off, and what is worth an alarm.
const UNKNOWN_SHARE: f64 = 0.2;
const ALARM_SHARE: f64 = 0.05;
/// It drifts by this much of itself in a day.
const DRIFT_SHARE: f64 = 0.002;
/// What is compensated follows by all of it in an hour.
const HOUR_S: f64 = 3600.0;

/// By how much each limb yields along itself at a pose.
///
/// # Errors
/// A pose that the machine cannot take.
pub fn limb_compliances_m_per_n(
    machine: &Machine<f64>,
    at: &Pose<f64>,
) -> std::result::Result<[f64; 3], StiffnessError> {
    let transmission = machine.transmission(at)?;
    // the first wrench of each limb is its axial force
    Ok([0, 3, 6].map(|first| transmission.compliance[(first, first)]))
}

impl Learn {
    /// Without a file: the drives of the three limbs, by the compliance along each limb at a pose.
    ///
    /// # Errors
    /// A pose that the machine cannot take.
    pub fn drives(machine: &Machine<f64>, at: &Pose<f64>) -> std::result::Result<Self, StiffnessError> {
        let compliances = limb_compliances_m_per_n(machine, at)?;
        let drive = |(limb, own): (u8, f64)| {
            Some(AmplitudeSettings {
                amplitude: Amplitude::compliance(Place::Body { limb }, Motion::Axial)?,
                accepted: 0.0,
                deviation: UNKNOWN_SHARE * own,
                drift_per_day: DRIFT_SHARE * own,
                least: -0.5 * own,
                most: 10.0 * own,
                rate_per_s: own / HOUR_S,
                alarm: ALARM_SHARE * own,
            })
        };
        let amplitudes = (1..).zip(compliances).filter_map(drive).collect();
        Ok(Self { amplitudes, model_share: 0.0 })
    }

    /// Reads a file.
    ///
    /// # Errors
    /// One message with file, line and key.
    pub fn parse(source: &Source) -> Result<Self> {
        let raw: Raw = parsed(source)?;
        let text = source.text()?;
        let fail = |start: usize, key: &str, message: String| {
            Failure::input(message).in_file(&source.name).at_line(line_at(text, start) as u64).at_column(key)
        };
        if *raw.format.get_ref() != 1 {
            let message = format!("expected 1, found {}", raw.format.get_ref());
            return Err(fail(raw.format.span().start, "format", message));
        }
        if raw.learn.is_empty() || raw.learn.len() > MAX_AMPLITUDES {
            let message = format!("expected 1 to {MAX_AMPLITUDES} tables [[learn]], found {}", raw.learn.len());
            return Err(Failure::input(message).in_file(&source.name).at_column("learn"));
        }
        let amplitude = |raw: &Spanned<RawAmplitude>| {
            let own = raw.get_ref();
            let wrong = |at: &Spanned<String>, key: &str, known: &[&str]| {
                let message = format!("expected one of {}, found `{}`", known.join(", "), clipped(at.get_ref()));
                fail(at.span().start, key, message)
            };
            let amplitude = match (&own.motion, own.place.get_ref().as_str()) {
                (None, TEMPERATURE) => Amplitude::RISE,
                (None, PROBE) => Amplitude::GAIN,
                (Some(motion), place @ (TEMPERATURE | PROBE)) => {
                    let message = format!("{place} has no motion: leave it out");
                    return Err(fail(motion.span().start, "learn.motion", message));
                }
                (motion, place) => {
                    let places: Vec<_> = Place::ALL.iter().filter(|place| !motions(**place).is_empty()).collect();
                    let names: Vec<_> =
                        places.iter().filter_map(|place| place.name()).chain([TEMPERATURE, PROBE]).collect();
                    let place = places.into_iter().find(|other| other.name() == Some(place));
                    let place = *place.ok_or_else(|| wrong(&own.place, "learn.place", &names))?;
                    let motions = motions(place);
                    let names: Vec<_> = motions.iter().map(|(motion, _)| motion.name()).collect();
                    let motion = motion.as_ref().ok_or_else(|| {
                        let message = format!("motion is missing: one of {}", names.join(", "));
                        fail(raw.span().start, "learn.motion", message)
                    })?;
                    let found = motions.iter().find(|(other, _)| other.name() == motion.get_ref());
                    found.ok_or_else(|| wrong(motion, "learn.motion", &names))?.1
                }
            };
            Ok(AmplitudeSettings {
                amplitude,
                accepted: own.accepted,
                deviation: own.deviation,
                drift_per_day: own.drift_per_day,
                least: own.least,
                most: own.most,
                rate_per_s: own.rate_per_s,
                alarm: own.alarm,
            })
        };
        let amplitudes: Vec<AmplitudeSettings> = raw.learn.iter().map(amplitude).collect::<Result<_>>()?;
        let learn = Self { amplitudes, model_share: *raw.model_share.get_ref() };
        let span = |n: Option<usize>| n.map_or(raw.model_share.span(), |n| raw.learn[n].span());
        learn.check(|n, key, message| fail(span(n).start, key, message))?;
        Ok(learn)
    }

    /// Refuses what the core's estimator would; `fail` is told the number of the amplitude, from 0; none of `model_share`.
    fn check(&self, fail: impl Fn(Option<usize>, &str, String) -> Failure) -> Result<()> {
        let model_share = self.model_share;
        for (n, own) in self.amplitudes.iter().enumerate() {
            match (EstimatorSettings { amplitudes: [*own], model_share }).check() {
                Ok(()) => {}
                Err(EstimatorSettingsError::Amplitude { setting, .. }) => {
                    return Err(fail(Some(n), &format!("learn.{setting}"), out_of_range(own, setting)));
                }
                Err(_) => {
                    let message = format!("expected a share from 0 to 1, found {model_share:?}");
                    return Err(fail(None, "model_share", message));
                }
            }
            let is_same = |other: &&AmplitudeSettings| {
                (EstimatorSettings { amplitudes: [**other, *own], model_share }).check().is_err()
            };
            if let Some(other) = self.amplitudes[..n].iter().find(is_same) {
                let [first, own] = [other, own].map(|own| named(own.amplitude));
                let same = if first == own { "" } else { ": a limb yields along its axis alike wherever it does" };
                let message = format!("{own} is {first} once more, which is learned already{same}");
                return Err(fail(Some(n), "learn.place", message));
            }
        }
        Ok(())
    }
}

/// What a setting may be, which is not.
fn out_of_range(own: &AmplitudeSettings, setting: &str) -> String {
    let (value, range) = match setting {
        "accepted" => (own.accepted, "a number between -1e6 and 1e6"),
        "deviation" => (own.deviation, "a standard deviation above 1e-18 and below 1e6"),
        "drift_per_day" => (own.drift_per_day, "a standard deviation from 0 to 1000 times `deviation`"),
        "least" => (own.least, "at most `accepted`, and within 1000 times `deviation` of it"),
        "most" => (own.most, "at least `accepted`, and within 1000 times `deviation` of it"),
        "rate_per_s" => (own.rate_per_s, "a rate above 0 and below 1e6"),
        _ => (own.alarm, "a change above 0 that `least` or `most` lets happen"),
    };
    format!("{setting} of {}: expected {range}, found {value:?}", named(own.amplitude))
}

/// The motions of a place that can be learned.
fn motions(place: Place) -> Vec<(Motion, Amplitude)> {
    place.motions().iter().filter_map(|motion| Some((*motion, Amplitude::compliance(place, *motion)?))).collect()
}

/// An amplitude in words.
pub fn named(amplitude: Amplitude) -> String {
    match amplitude.place() {
        Some((place, motion)) => format!("{} {}", place.name().unwrap_or_default(), motion.name()),
        None if amplitude == Amplitude::GAIN => PROBE.to_owned(),
        None => TEMPERATURE.to_owned(),
    }
}

/// Its unit in files, and one that is easily read with what it takes to get there.
pub fn units(amplitude: Amplitude) -> (&'static str, &'static str, f64) {
    match amplitude.place() {
        Some((_, motion)) if motion.is_rotation() => ("rad/(N·m)", "nrad/(N·m)", 1e9),
        Some(_) => ("m/N", "nm/N", 1e9),
        None if amplitude == Amplitude::GAIN => ("1", "%", 100.0),
        None => ("K", "K", 1.0),
    }
}

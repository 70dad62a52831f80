//! The load: readings are checked, filtered, and freed of what is within the dead band.

use nalgebra::{Vector3, Vector6};

use super::temperature::{Pace, RiseSensor};
use super::{CompensatorSettings, Fault, RETURN_S, Reading};
use crate::linalg::{is_finite, length};
use crate::scalar::Scalar;
use crate::thermal::TemperatureRise;
use crate::types::Wrench;

/// Filters of a compensator and what they remember.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LoadFilter<T> {
    /// Weight of a reading against the filtered wrench.
    weight: T,
    /// Of force and moment.
    dead_band: [T; 2],
    most: [T; 2],
    hold_periods: u32,
    pub return_periods: u32,
    /// 0 is never.
    stuck_periods: u32,
    filtered: Vector6<T>,
    last_good: Vector6<T>,
    last_read: Vector6<T>,
    /// Refused readings, equal readings, and good readings of a load that was given up, in a row.
    refused: u32,
    equal: u32,
    good: u32,
    /// Why the load counts as zero.
    given_up: Option<Fault>,
    /// Of limbs 1, 2, 3 and the platforms.
    sensors: [RiseSensor<T>; 4],
    pace: Pace<T>,
}

impl<T: Scalar> LoadFilter<T> {
    pub fn new(settings: &CompensatorSettings) -> Self {
        let zero = Vector6::zeros();
        Self {
            weight: T::from_f64(settings.period_s / (settings.period_s + settings.filter_s)),
            dead_band: [settings.dead_band_n, settings.dead_band_nm].map(T::from_f64),
            most: [settings.max_force_n, settings.max_moment_nm].map(T::from_f64),
            hold_periods: settings.periods(settings.hold_s),
            return_periods: settings.periods(RETURN_S),
            stuck_periods: settings.periods(settings.stuck_s),
            filtered: zero,
            last_good: zero,
            last_read: zero,
            refused: 0,
            equal: 0,
            good: 0,
            given_up: None,
            sensors: [RiseSensor::NEW; 4],
            pace: Pace::new(settings.period_s),
        }
    }

    /// Forgets the load: what acts while nothing is compensated must not act later. How long its sensor has said the same stays: a program
    /// that switches the compensation off and on would hide one that is stuck.
    pub fn forget_load(&mut self) {
        let zero = Vector6::zeros();
        (self.filtered, self.last_good) = (zero, zero);
        (self.refused, self.good, self.given_up) = (0, 0, None);
        self.sensors.iter_mut().for_each(RiseSensor::begin_again);
    }

    /// Forgets the load and all readings.
    pub fn reset(&mut self) {
        self.forget_load();
        (self.last_read, self.equal) = (Vector6::zeros(), 0);
        self.sensors = [RiseSensor::NEW; 4];
    }

    /// The wrench to compensate, the temperature rise, and what is wrong with the reading.
    #[inline(never)] // takes no stack while the stiffness is worked out
    pub fn update(&mut self, reading: &Reading<T>) -> (Wrench<T>, TemperatureRise<T>, Option<Fault>) {
        let mut fault = None;
        let TemperatureRise { limbs_k: [first, second, third], platforms_k } = reading.rise;
        for (sensor, rise_k) in self.sensors.iter_mut().zip([first, second, third, platforms_k]) {
            if !sensor.update(rise_k, &self.pace) {
                fault = Some(Fault::TemperatureLost);
            }
        }
        let [first, second, third, platforms] = self.sensors.map(|sensor| sensor.good_k());
        let rise = TemperatureRise { limbs_k: [first, second, third], platforms_k: platforms };
        match self.refusal(&reading.wrench) {
            None if self.is_back() => {
                self.refused = 0;
                self.last_good = reading.wrench.to_vector();
            }
            None => fault = self.given_up,
            refusal => {
                fault = refusal;
                self.good = 0;
                if self.refused < self.hold_periods {
                    self.refused += 1;
                } else {
                    self.last_good = Vector6::zeros();
                    self.given_up = refusal;
                }
            }
        }
        self.filtered += (self.last_good - self.filtered) * self.weight;
        let Wrench { force_n, moment_nm } = Wrench::from_vector(self.filtered);
        let [force, moment] = self.dead_band;
        let wrench = Wrench { force_n: beyond(force_n, force), moment_nm: beyond(moment_nm, moment) };
        (wrench, rise, fault)
    }

    /// Whether a good reading is used: the load was not given up, or its readings have been good for long enough.
    fn is_back(&mut self) -> bool {
        if self.given_up.is_some() {
            self.good += 1;
            if self.good < self.return_periods {
                return false;
            }
            (self.good, self.given_up) = (0, None);
        }
        true
    }

    /// Why a reading is not to be used.
    fn refusal(&mut self, wrench: &Wrench<T>) -> Option<Fault> {
        let read = wrench.to_vector();
        if !is_finite(&read) {
            return Some(Fault::WrenchNotFinite);
        }
        // noise changes every reading of a sensor that works
        self.equal = if read == self.last_read { self.equal.saturating_add(1) } else { 0 };
        self.last_read = read;
        let within = |v: &Vector3<T>, most: T| v.dot(v) <= most * most;
        if !(within(&wrench.force_n, self.most[0]) && within(&wrench.moment_nm, self.most[1])) {
            return Some(Fault::WrenchTooLarge);
        }
        let stuck = self.stuck_periods > 0 && self.equal >= self.stuck_periods;
        stuck.then_some(Fault::WrenchStuck)
    }
}

/// A vector shortened by `band`, and zero within it: continuous, so that no load makes the offset jump.
fn beyond<T: Scalar>(v: Vector3<T>, band: T) -> Vector3<T> {
    let size = length(&v);
    if size > band { v * (T::ONE - band / size) } else { Vector3::zeros() }
}

//! The estimator itself: long, as every part of it works on the same private state.

use nalgebra::Vector3;

use super::filter::Filter;
use super::reading::{Alarm, Learned, MAX_COMPONENTS, Refusal, TipReading, Touch};
use super::{Amplitude, EstimatorSettings, EstimatorSettingsError, MAX_AMPLITUDES};
use crate::compensation;
use crate::correction::{CorrectionError, CorrectionTable};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::{Deflection, Pose, Wrench};

/// Standard deviations of a sum of innovations from which on it is a change: one of 1e7 healthy readings has as much by chance.
pub const CHANGE_SD: f64 = 5.3;

/// Greatest χ² of a reading, by the number of its components: exceeded by 1e-7 of healthy readings.
const MAX_CHI_SQUARED: [f64; MAX_COMPONENTS] = [28.37, 32.24, 35.41, 38.24, 40.86, 43.34];
/// An innovation counts in the sums as this many deviations at most.
const MAX_COUNTED_SD: f64 = 3.0;
/// Forgetting factor of the sums, per reading.
const FORGETTING_FACTOR: f64 = 1.0 - 1.0 / 16.0;
/// A reading tells something when all that was unknown at the start shows in it by this share of its variance.
const EXCITED_SHARE: f64 = 1e-4;
/// Readings with the same numbers, from which on a probe is stuck.
const MIN_STUCK_READINGS: u8 = 5;
/// Least motion that is expected of a component, in standard deviations, for an unchanged number to count as stuck.
const MIN_EXPECTED_MOTION_SD: f64 = 5.0;
/// Readings from which on a change is believed: fewer may be those that a broken sensor has slipped in.
const MIN_READINGS_OF_CHANGE: u32 = 5;
/// Deviations by which the tip has to go against the load to be of the wrong sign.
const WRONG_SIGN_SD: f64 = 5.0;
/// Of χ²: an amplitude explains a change as well as another when it explains no less by this, a thousandth of the likelihood.
const MAX_CHI_SQUARED_BEHIND_BEST: f64 = 13.8;
/// As `CHANGE_SD`, of one amplitude where a change was shown: less may be what another's change leaves uncertain (99 %).
const MIN_CHANGE_SD: f64 = 2.58;
/// Deviations beyond what is worth an alarm, from which on the probability of that is 0.95.
const ALARM_SD: f64 = 1.644_853_6;
/// What of a change since acceptance is not compensated, squared, in variances of its estimate; see [`Estimator::targets`].
const WITHHELD_VARIANCES: f64 = 4.0;
/// The share of what is worth an alarm that counts as a deviation of every change: what no reading tells of, such as stiffnesses that are
/// not learned and are off.
const MISFIT_SHARE_OF_ALARM: f64 = 0.2;
const DAY_S: f64 = 86_400.0;

/// Displacement of A, by machine and table, under a wrench there.
#[inline(never)] // what comes before and after takes no stack while it is worked out
fn predict<T: Scalar>(
    machine: &Machine<T>,
    table: Option<&CorrectionTable<'_, T>>,
    pose: &Pose<T>,
    wrench: &Wrench<T>,
    predicted: &mut Deflection<T>,
) -> Result<(), CorrectionError> {
    *predicted = compensation::deflection(machine, table, pose, wrench, None, None)?;
    Ok(())
}

/// Greatest χ² of a reading that is taken in.
fn gate<T: Scalar>(readings: &[TipReading<T>]) -> T {
    T::from_f64(MAX_CHI_SQUARED.get(readings.len().wrapping_sub(1)).copied().unwrap_or(0.0))
}

/// Readings since the one that has shown a change, with it; all where nothing came at once.
fn readings_since(readings: u32, changed_at: u32) -> u32 {
    readings.saturating_sub(changed_at.max(1)).saturating_add(1)
}

/// Whether enough readings have come since a change, or since the first where nothing came at once.
fn is_believed(readings: u32, changed_at: u32) -> bool {
    let last = readings.saturating_sub(MIN_READINGS_OF_CHANGE - 1);
    last > 0 && changed_at <= last
}

/// One component of a reading, as the filter takes it in.
struct Component<T, const N: usize> {
    /// Of the amplitudes, in their deviations.
    weights: [T; N],
    /// By machine and table.
    expected: T,
    /// Variance.
    noise: T,
    /// What is learned of growth adds this, which no load turns round, and its variance.
    grown: [T; 2],
}

/// Numbers of an amplitude as they are computed with: in deviations of its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scaled<T> {
    pub(super) deviation: T,
    accepted: T,
    alarm: T,
    /// Of the square of a change, what the misfit leaves in doubt.
    doubt: T,
    drift_per_s: T,
    least: T,
    most: T,
    rate_per_s: T,
}

/// Learns `N` amplitudes. See the [module's documentation](super).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator<T, const N: usize> {
    pub(super) settings: EstimatorSettings<N>,
    pub(super) scaled: [Scaled<T>; N],
    model_share: T,
    /// Which amplitude is [`Amplitude::RISE`]; their number where none is.
    pub(super) warmth: usize,
    /// Of the values in deviations of the settings.
    pub(super) filter: Filter<T, N>,
    /// What is compensated of each change since acceptance, in the same unit.
    pub(super) applied: [T; N],
    /// Where `applied` goes.
    pub(super) targets: [T; N],
    /// Sums of innovations, and their variances.
    pub(super) sums: [[T; N]; 2],
    /// Readings when each amplitude was found to have changed; 0 when it never was.
    pub(super) changed_at: [u32; N],
    /// Until when each amplitude's covariance has grown by its drift.
    pub(super) drifted_at: [u32; N],
    pub(super) time_s: u32,
    pub(super) began_s: u32,
    pub(super) readings: u32,
    /// In a row.
    pub(super) refused: u32,
    /// Of each component of a reading what was read last, what was expected then, and how often in a row the same was read although it should
    /// have moved.
    last: [T; MAX_COMPONENTS],
    due: [T; MAX_COMPONENTS],
    still: [u8; MAX_COMPONENTS],
    /// Readings in a row with the same in all components.
    equal: u8,
}

impl<T: Scalar, const N: usize> Estimator<T, N> {
    /// Begins with nothing read.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn new(settings: &EstimatorSettings<N>) -> Result<Self, EstimatorSettingsError> {
        settings.check()?;
        let scaled = settings.amplitudes.map(|own| {
            let in_deviations = |value: f64| T::from_f64(value / own.deviation);
            let drift = own.drift_per_day / own.deviation;
            let misfit = MISFIT_SHARE_OF_ALARM * own.alarm / own.deviation;
            Scaled {
                deviation: T::from_f64(own.deviation),
                accepted: in_deviations(own.accepted),
                alarm: in_deviations(own.alarm),
                doubt: T::from_f64(WITHHELD_VARIANCES * misfit * misfit),
                drift_per_s: T::from_f64(drift * drift / DAY_S),
                least: in_deviations(own.least),
                most: in_deviations(own.most),
                rate_per_s: in_deviations(own.rate_per_s),
            }
        });
        let accepted = scaled.map(|own| own.accepted);
        Ok(Self {
            settings: *settings,
            scaled,
            model_share: T::from_f64(settings.model_share),
            warmth: settings.amplitudes.iter().position(|own| own.amplitude == Amplitude::RISE).unwrap_or(N),
            filter: Filter::new(accepted),
            applied: [T::ZERO; N],
            targets: [T::ZERO; N],
            sums: [[T::ZERO; N]; 2],
            changed_at: [0; N],
            drifted_at: [0; N],
            time_s: 0,
            began_s: 0,
            readings: 0,
            refused: 0,
            // no reading is equal to it
            last: [T::from_f64(f64::INFINITY); MAX_COMPONENTS],
            due: [T::ZERO; MAX_COMPONENTS],
            still: [0; MAX_COMPONENTS],
            equal: 0,
        })
    }

    /// What is learned, in the order of everything here.
    pub fn amplitudes(&self) -> [Amplitude; N] {
        self.settings.amplitudes.map(|own| own.amplitude)
    }

    /// The same without a copy: a period has no time for one.
    pub(super) fn each_amplitude(&self) -> impl Iterator<Item = Amplitude> {
        self.settings.amplitudes.iter().map(|own| own.amplitude)
    }

    /// Readings that were taken in.
    pub fn readings(&self) -> u32 {
        self.readings
    }

    /// Readings in a row that were refused as unexpected, stuck, of the wrong sign, or as older than the last: some twenty are a broken sensor or a
    /// machine beyond what it may learn, or a clock that was wrong once, by what was taken in then. [`restore`](Self::restore) of an older state
    /// mends that.
    pub fn refused(&self) -> u32 {
        self.refused
    }

    /// How many readings had been taken in when each amplitude was last found to have changed; 0 when it never was.
    pub fn changed_at(&self) -> [u32; N] {
        self.changed_at
    }

    /// When the last reading was taken in, s.
    pub fn time_s(&self) -> u32 {
        self.time_s
    }

    /// When the first reading was taken in, s: what was accepted is as old as that.
    pub fn began_s(&self) -> u32 {
        self.began_s
    }

    /// Standard deviations of the values at a later time without a further reading: with their drift since, up to what was unknown at the
    /// start.
    pub fn deviations_at(&self, time_s: u32) -> [f64; N] {
        let mut deviations = [0.0; N];
        let known = self.filter.variances().into_iter().zip(&self.scaled).zip(&self.drifted_at);
        for ((deviation, ((variance, own), drifted_at)), of) in
            deviations.iter_mut().zip(known).zip(&self.settings.amplitudes)
        {
            // nothing drifts before the first reading, at which all is unknown
            let silent_s = if self.readings > 0 { time_s.saturating_sub(*drifted_at) } else { 0 };
            let drifted = own.drift_per_s.to_f64() * f64::from(silent_s);
            let before = variance.to_f64();
            *deviation = of.deviation * libm::sqrt(if before < 1.0 { (before + drifted).min(1.0) } else { before });
        }
        deviations
    }

    /// Best values, and their standard deviations, in the amplitudes' units.
    pub fn values(&self) -> [(f64, f64); N] {
        let mut values = [(0.0, 0.0); N];
        for (n, (value, own)) in values.iter_mut().zip(&self.settings.amplitudes).enumerate() {
            let mean = self.filter.mean.get(n).map_or(0.0, |mean| mean.to_f64());
            *value = (own.deviation * mean, own.deviation * self.filter.variance(n).sqrt().to_f64());
        }
        values
    }

    /// What is compensated of each amplitude's change since acceptance, in the amplitudes' units: [`targets`](Self::targets), as far as
    /// [`follow`](Self::follow) has got.
    pub fn applied(&self) -> [f64; N] {
        self.in_units(&self.applied)
    }

    /// What is worth compensating of each amplitude's change since acceptance, in the amplitudes' units.
    ///
    /// Of a change x with a standard deviation s it is x (1 − 4 (s² + (a/5)²)/x²), a being what is worth an alarm, and nothing where that
    /// is below 0: nearly x where it is well known, and nothing of what may be no change at all. The value that was accepted is no part
    /// of it: it is what fitted the first readings best, with all that is off in the machine and not learned, and under other loads
    /// hardly nearer to the truth than 0. What the table is known to lack belongs into the machine or a new table. Until the fifth
    /// reading, and the fifth after a change that came at once, it does not grow.
    pub fn targets(&self) -> [f64; N] {
        self.in_units(&self.targets)
    }

    fn in_units(&self, scaled: &[T; N]) -> [f64; N] {
        let mut values = [0.0; N];
        for ((value, scaled), own) in values.iter_mut().zip(scaled).zip(&self.settings.amplitudes) {
            *value = own.deviation * scaled.to_f64();
        }
        values
    }

    /// A reading: what machine and table predict is worked out first.
    ///
    /// What is read is by how much the tip of the machine as it is has moved since the zero reading: by its load, and by what it has grown
    /// where the machine has `thermal-expansion` (see [`TipReading::read`]). Of a machine that is being compensated that is what its sensor
    /// reads and what the compensation has taken away. A pose outside the table's box is taken in as any other, with what the table says there;
    /// [`Learned::domain`] tells.
    ///
    /// # Errors
    /// Why it is not taken in.
    #[inline(never)]
    pub fn learn(
        &mut self,
        machine: &Machine<T>,
        table: Option<&CorrectionTable<'_, T>>,
        touch: &Touch<T>,
        readings: &[TipReading<T>],
    ) -> Result<Learned<T>, Refusal> {
        let wrench = touch.wrench.moved_to_a(touch.tip_m);
        let mut predicted = Deflection::ZERO;
        predict(machine, table, &touch.pose, &wrench, &mut predicted)?;
        let learned = self.absorb_at(machine, touch, &wrench, &predicted, readings)?;
        Ok(Learned { domain: table.map(|table| table.domain(&touch.pose)), ..learned })
    }

    /// A reading, with the displacement of A under its load alone.
    #[inline(never)] // takes no stack while that is worked out
    fn absorb_at(
        &mut self,
        machine: &Machine<T>,
        touch: &Touch<T>,
        wrench: &Wrench<T>,
        loaded: &Deflection<T>,
        readings: &[TipReading<T>],
    ) -> Result<Learned<T>, Refusal> {
        let posture = machine.posture(&touch.pose)?;
        let predicted = loaded.plus(&machine.thermal_deflection_at(&posture, &touch.rise_k.into())?);
        let mut sensitivities = [Deflection::ZERO; N];
        machine.put_sensitivities(&posture, wrench, self.each_amplitude(), &mut sensitivities)?;
        self.absorb(touch, &predicted, &sensitivities, readings)
    }

    /// A reading, with the displacement of A that machine and table predict, and that per unit of each amplitude. A controller
    /// that has them already saves them here; [`learn`](Self::learn) works them out. No domain is given.
    ///
    /// # Errors
    /// Why it is not taken in.
    #[inline(never)]
    pub fn absorb(
        &mut self,
        touch: &Touch<T>,
        predicted: &Deflection<T>,
        sensitivities: &[Deflection<T>; N],
        readings: &[TipReading<T>],
    ) -> Result<Learned<T>, Refusal> {
        if readings.is_empty() || readings.len() > MAX_COMPONENTS {
            return Err(Refusal::Components);
        }
        if self.readings > 0 && touch.time_s < self.time_s {
            self.refused = self.refused.saturating_add(1);
            return Err(Refusal::Backwards);
        }
        self.filter.remember();
        let drifted_at = self.drifted_at;
        if self.readings > 0 {
            self.widen_by_drift(touch.time_s);
        } else {
            self.drifted_at = [touch.time_s; N];
        }
        let what = (predicted, sensitivities);
        let (chi_squared, opened) = match self.take_in(what, touch.tip_m, readings) {
            Ok(chi_squared) => (chi_squared, None),
            Err(refusal) => {
                self.filter.recall();
                self.drifted_at = drifted_at;
                if refusal != Refusal::Unexpected {
                    let is_broken = matches!(refusal, Refusal::Stuck | Refusal::WrongSign);
                    self.refused = self.refused.saturating_add(u32::from(is_broken));
                    return Err(refusal);
                }
                self.take_in_changed(what, touch.tip_m, readings)?
            }
        };
        self.keep_possible();
        self.time_s = touch.time_s;
        if self.readings == 0 {
            self.began_s = touch.time_s;
        }
        self.readings = self.readings.saturating_add(1);
        self.refused = 0;
        let changed = opened.unwrap_or_else(|| self.open_changed(self.readings));
        self.set_targets();
        Ok(Learned { chi_squared, changed, domain: None })
    }

    /// Takes in a reading that nothing known explains, where a change does: with the amplitudes unknown again that explain the innovations of
    /// one sign up to it; gives χ², and which they are. Where they do not explain it either all stays as it was, but that the sums begin anew: that
    /// is no change, but a broken sensor, or more than may be learned.
    #[inline(never)] // one reading of thousands needs it
    fn take_in_changed(
        &mut self,
        what: (&Deflection<T>, &[Deflection<T>; N]),
        tip_m: Vector3<T>,
        readings: &[TipReading<T>],
    ) -> Result<(T, Option<[bool; MAX_AMPLITUDES]>), Refusal> {
        let changed_at = self.changed_at;
        let changed = self.open_changed(self.readings.saturating_add(1));
        if changed.contains(&true) {
            let mut chi_squared = T::ZERO;
            for reading in readings {
                let (_, [beyond, variance]) = self.absorb_component(what, tip_m, reading);
                chi_squared += beyond * beyond / variance;
            }
            if chi_squared <= gate(readings) && self.is_possible() {
                return Ok((chi_squared, Some(changed)));
            }
            self.filter.recall();
            self.changed_at = changed_at;
        }
        self.refused = self.refused.saturating_add(1);
        Err(Refusal::Unexpected)
    }

    /// Whether a component says what it said last, and whether it is stuck.
    fn is_still(&mut self, n: usize, read: T, expected: T, noise: T) -> [bool; 2] {
        let component = (self.last.get_mut(n), self.due.get_mut(n), self.still.get_mut(n));
        let (Some(last), Some(due), Some(still)) = component else { return [false; 2] };
        let (is_same, moved) = (*last == read, expected - *due);
        if !is_same {
            *still = 0;
        } else if moved * moved > T::from_f64(MIN_EXPECTED_MOTION_SD * MIN_EXPECTED_MOTION_SD) * noise {
            *still = still.saturating_add(1);
        }
        (*last, *due) = (read, expected);
        [is_same, *still >= MIN_STUCK_READINGS - 1]
    }

    /// Takes the components into the filter, and into the sums of innovations; gives χ². What it is refused for, the caller undoes in
    /// the filter.
    fn take_in(
        &mut self,
        (predicted, sensitivities): (&Deflection<T>, &[Deflection<T>; N]),
        tip_m: Vector3<T>,
        readings: &[TipReading<T>],
    ) -> Result<T, Refusal> {
        let [sums, variances] = self.sums;
        let mut sums = sums.map(|sum| sum * T::from_f64(FORGETTING_FACTOR));
        let mut variances = variances.map(|variance| variance * T::from_f64(FORGETTING_FACTOR * FORGETTING_FACTOR));
        let mut chi_squared = T::ZERO;
        let (mut excited, mut opposite, mut same, mut stuck) = (false, false, true, false);
        for (n, reading) in readings.iter().enumerate() {
            let TipReading { read, deviation, .. } = reading;
            let (Component { weights, expected, noise, grown }, [beyond, variance]) =
                self.absorb_component((predicted, sensitivities), tip_m, reading);
            if !(*deviation > T::ZERO && noise > T::ZERO && variance.is_finite() && beyond.is_finite()) {
                return Err(Refusal::NotFinite);
            }
            // one component that tells something is enough: a period has no time for the sums of the others
            excited = excited
                || weights.iter().fold(T::ZERO, |sum, weight| sum + *weight * *weight)
                    > T::from_f64(EXCITED_SHARE) * noise;
            let [is_same, is_stuck] = self.is_still(n, *read, expected, noise);
            same &= is_same;
            stuck |= is_stuck;
            let (due, least) = (expected + grown[0], T::from_f64(WRONG_SIGN_SD * WRONG_SIGN_SD) * (noise + grown[1]));
            opposite |= due * *read < T::ZERO && due * due > least && *read * *read > least;
            let squared = beyond * beyond / variance;
            chi_squared += squared;
            let most = T::from_f64(MAX_COUNTED_SD * MAX_COUNTED_SD);
            let counted = if squared > most { (most / squared).sqrt() } else { T::ONE };
            let (share, innovation) = (T::ONE / variance, beyond * counted);
            for ((sum, total), weight) in sums.iter_mut().zip(&mut variances).zip(&weights) {
                let shared = *weight * share;
                *sum += shared * innovation;
                *total += shared * *weight;
            }
        }
        if !excited {
            return Err(Refusal::NotExcited);
        }
        self.equal = if same { self.equal.saturating_add(1) } else { 0 };
        if stuck || self.equal >= MIN_STUCK_READINGS - 1 {
            return Err(Refusal::Stuck);
        }
        if opposite {
            return Err(Refusal::WrongSign);
        }
        self.sums = [sums, variances];
        if chi_squared <= gate(readings) { Ok(chi_squared) } else { Err(Refusal::Unexpected) }
    }

    /// Takes one component into the filter: what it is made of, what was read beyond what was expected, and the variance of that.
    #[inline(always)] // its parts stay in registers
    fn absorb_component(
        &mut self,
        (predicted, sensitivities): (&Deflection<T>, &[Deflection<T>; N]),
        tip_m: Vector3<T>,
        TipReading { direction, read, deviation }: &TipReading<T>,
    ) -> (Component<T, N>, [T; 2]) {
        // virtual work: at A a reading is weighted as a load along it is moved there
        let direction = Wrench::from_vector(*direction).moved_to_a(tip_m);
        let expected = direction.work(predicted);
        let own = self.model_share * expected;
        let noise = *deviation * *deviation + own * own;
        let mut weights = [T::ZERO; N];
        for (n, (weight, moved)) in weights.iter_mut().zip(sensitivities).enumerate() {
            let amplitude = self.settings.amplitudes[n].amplitude;
            *weight = amplitude.shown(direction.work(moved), expected) * self.scaled[n].deviation;
        }
        let grown = match (weights.get(self.warmth), self.filter.mean.get(self.warmth)) {
            (Some(weight), Some(mean)) => [*weight * *mean, *weight * *weight * self.filter.variance(self.warmth)],
            _ => [T::ZERO; 2],
        };
        let (beyond, variance) = self.filter.absorb(&weights, *read - expected, noise);
        (Component { weights, expected, noise, grown }, [beyond, variance])
    }

    /// Adds the drift of one amplitude since its last turn, up to what was unknown at the start. They take turns, reading by reading: a
    /// period has no time for all.
    fn widen_by_drift(&mut self, time_s: u32) {
        let turn = self.readings as usize % N.max(1);
        let (Some(own), Some(drifted_at)) = (self.scaled.get(turn), self.drifted_at.get_mut(turn)) else { return };
        let drift = own.drift_per_s * T::from_f64(f64::from(time_s - *drifted_at));
        *drifted_at = time_s;
        let room = T::ONE - self.filter.variance(turn);
        let added = if drift < room { drift } else { room };
        if added > T::ZERO {
            self.filter.widen(turn, added);
        }
    }

    /// Whether every mean is where physics allows it to be, but for its deviation.
    fn is_possible(&self) -> bool {
        self.filter.mean.iter().zip(&self.filter.variances()).zip(&self.scaled).all(|((mean, variance), own)| {
            let beyond = if *mean < own.least { own.least - *mean } else { *mean - own.most };
            !(beyond > T::ZERO && beyond * beyond > T::from_f64(MIN_CHANGE_SD * MIN_CHANGE_SD) * *variance)
        })
    }

    /// Moves the means to where physics allows them to be.
    pub(super) fn keep_possible(&mut self) {
        for (mean, own) in self.filter.mean.iter_mut().zip(&self.scaled) {
            if *mean < own.least {
                *mean = own.least;
            } else if *mean > own.most {
                *mean = own.most;
            }
        }
    }

    /// Lets the amplitudes be unknown again that explain innovations of one sign, if any does so by more than [`CHANGE_SD`]; `reading` is the
    /// number of the one that shows it.
    fn open_changed(&mut self, reading: u32) -> [bool; MAX_AMPLITUDES] {
        let mut changed = [false; MAX_AMPLITUDES];
        let [sums, variances] = &self.sums;
        let mut deviations = [T::ZERO; N];
        let mut most = T::ZERO;
        for ((squared, sum), variance) in deviations.iter_mut().zip(sums).zip(variances) {
            if *variance > T::ZERO {
                *squared = *sum * *sum / *variance;
            }
            if *squared > most {
                most = *squared;
            }
        }
        if !(most > T::from_f64(CHANGE_SD * CHANGE_SD)) {
            return changed;
        }
        self.sums = [[T::ZERO; N]; 2];
        for (n, (changed, squared)) in changed.iter_mut().zip(&deviations).enumerate() {
            *changed = *squared > most - T::from_f64(MAX_CHI_SQUARED_BEHIND_BEST);
            if !*changed {
                continue;
            }
            let has_alarm = self.has_alarm(n);
            let room = T::ONE - self.filter.variance(n);
            if room > T::ZERO {
                self.filter.widen(n, room);
            }
            if let Some(at) = self.changed_at.get_mut(n) {
                // what has changed already goes on counting from then
                *at = if has_alarm { *at } else { reading }.max(1);
            }
        }
        changed
    }

    /// Works out what is worth compensating. While a change is new, what is compensated may become less, and no more.
    pub(super) fn set_targets(&mut self) {
        let variances = self.filter.variances();
        for n in 0..N {
            let known = (self.filter.mean.get(n), variances.get(n), self.scaled.get(n), self.changed_at.get(n));
            let (Some(mean), Some(variance), Some(own), Some(changed_at)) = known else { return };
            let Some(target) = self.targets.get_mut(n) else { return };
            let change = *mean - own.accepted;
            let doubt = T::from_f64(WITHHELD_VARIANCES) * *variance + own.doubt;
            let worth = if change * change > doubt { change - doubt / change } else { T::ZERO };
            *target = if is_believed(self.readings, *changed_at) {
                worth
            } else if worth * *target > T::ZERO {
                if worth * worth < *target * *target { worth } else { *target }
            } else {
                T::ZERO
            };
        }
    }

    /// A period of the compensation: what it uses goes to its [`targets`](Self::targets), at most at the rates of the settings. A period
    /// that is not a finite number above 0 s moves nothing.
    pub fn follow(&mut self, period_s: T) {
        if !(period_s.is_finite() && period_s > T::ZERO) {
            return;
        }
        for ((applied, target), own) in self.applied.iter_mut().zip(&self.targets).zip(&self.scaled) {
            let most = own.rate_per_s * period_s;
            let step = *target - *applied;
            if step > most {
                *applied += most;
            } else if step < -most {
                *applied -= most;
            } else {
                *applied = *target;
            }
        }
    }

    /// Of each amplitude its change since acceptance, where it is worth an alarm: by more than its settings say with a probability of
    /// 0.95, and is of [`CHANGE_SD`] standard deviations, or of 2.58 where innovations had one sign. Five readings at least say so.
    pub fn alarms(&self) -> [Option<Alarm>; N] {
        let mut alarms = [None; N];
        let each = self.values().into_iter().zip(&self.settings.amplitudes).zip(&self.changed_at);
        for (n, (alarm, (((value, deviation), own), changed_at))) in alarms.iter_mut().zip(each).enumerate() {
            if !self.has_alarm(n) {
                continue;
            }
            let change = value - own.accepted;
            let probability = 0.5 * libm::erfc((own.alarm - change.abs()) / (deviation * core::f64::consts::SQRT_2));
            let readings = readings_since(self.readings, *changed_at);
            *alarm = Some(Alarm { change, deviation, probability, readings });
        }
        alarms
    }

    /// Whether an amplitude's change is proven, and worth an alarm.
    fn has_alarm(&self, n: usize) -> bool {
        let known = (self.filter.mean.get(n), self.scaled.get(n), self.changed_at.get(n));
        let (Some(mean), Some(own), Some(changed_at)) = known else { return false };
        let change = (*mean - own.accepted).abs();
        let deviation = self.filter.variance(n).sqrt();
        // innovations of one sign prove that something has changed; that it is this one, its own change
        let is_proven = change >= T::from_f64(if *changed_at > 0 { MIN_CHANGE_SD } else { CHANGE_SD }) * deviation;
        is_proven && is_believed(self.readings, *changed_at) && change - own.alarm >= T::from_f64(ALARM_SD) * deviation
    }
}

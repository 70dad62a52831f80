//! Readings thrown at an estimator: good ones, from which it learns that a drive is softer, and one of each kind that it has to refuse.

use core::fmt;

use pkm_core::checksum::{START, over_numbers};
use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{
    Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, Refusal, Slot, TipReading, Touch, newest, state_bytes,
};
use pkm_core::nalgebra::{Vector3, Vector6};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64};
use pkm_core::{CorrectionTable, Deflection, Machine, Pose, Scalar, Wrench};

use crate::{TIP_M, noise};

/// What came of the readings in one arithmetic.
pub struct Lesson {
    /// 32 or 64.
    pub float_bits: u8,
    /// Checksum of all that was learned, or what is not as it is defined.
    pub result: Result<u64, &'static str>,
}

impl fmt::Display for Lesson {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Learning f{}: ", self.float_bits)?;
        match self.result {
            Ok(checksum) => write!(f, "{checksum:016x}"),
            Err(wrong) => f.write_str(wrong),
        }
    }
}

/// In both arithmetics.
pub fn lessons() -> [Lesson; 2] {
    [
        Lesson { float_bits: 32, result: learn(&MACHINE_F32, &TABLE_F32) },
        Lesson { float_bits: 64, result: learn(&MACHINE_F64, &TABLE_F64) },
    ]
}

/// By what limb 2 yields more than the machine knows, m/N.
const SOFTER_M_PER_N: f64 = 2e-9;
const GAUGE_M: f64 = 0.3e-6;
const READINGS: u32 = 60;

/// The drives of the three limbs, the base across, and warmth.
fn settings() -> Option<EstimatorSettings<5>> {
    let of = |amplitude, unit: f64| AmplitudeSettings {
        amplitude,
        accepted: 0.0,
        deviation: unit,
        drift_per_day: 0.01 * unit,
        least: -5.0 * unit,
        most: 50.0 * unit,
        rate_per_s: 0.1 * unit,
        alarm: 0.3 * unit,
    };
    let yields = |place, motion| Some(of(Amplitude::compliance(place, motion)?, 1e-9));
    let drive = |limb| yields(Place::Body { limb }, Motion::Axial);
    let amplitudes = [drive(1)?, drive(2)?, drive(3)?, yields(Place::Base, Motion::X)?, of(Amplitude::RISE, 1.0)];
    Some(EstimatorSettings { amplitudes, model_share: 0.01 })
}

/// A reading of three gauges under a load that changes, the `n`-th, of a machine whose limb 2 is softer; `None` outside the table's box.
pub fn reading<T: Scalar>(
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
    n: u32,
) -> Option<(Touch<T>, [TipReading<T>; 3])> {
    let number = T::from_f64;
    let of = |seed: f64| noise(n as usize, seed);
    let pose = Pose {
        theta_rad: number(0.2 * of(1.0)),
        sigma_rad: number(0.2 * of(2.0)),
        z0_m: number(0.53 + 0.02 * of(3.0)),
    };
    let wrench = Wrench {
        force_n: Vector3::new(number(800.0 * of(4.0)), number(800.0 * of(5.0)), number(-900.0 + 100.0 * of(6.0))),
        moment_nm: Vector3::zeros(),
    };
    let tip_m = Vector3::from(TIP_M.map(number));
    let at_a = wrench.moved_to_a(tip_m);
    let known = table.factor_form(machine, &pose).ok()?.factor.deflection(&at_a).ok()?;
    let worn = Amplitude::compliance(Place::Body { limb: 2 }, Motion::Axial)?;
    let [moved] = machine.sensitivities(&pose, &at_a, &[worn]).ok()?;
    let all = known.to_vector() + moved.to_vector() * number(SOFTER_M_PER_N);
    let seen = Deflection::from_vector(all).seen_at(tip_m).to_vector();
    let readings = [Vector6::x(), Vector6::y(), Vector6::z()].map(|direction| {
        let off = GAUGE_M
            * of(direction
                .dot(&Vector6::new(number(7.0), number(8.0), number(9.0), T::ZERO, T::ZERO, T::ZERO))
                .to_f64());
        TipReading { direction, read: direction.dot(&seen) + number(off), deviation: number(GAUGE_M) }
    });
    Some((Touch { time_s: 600 * n, pose, tip_m, wrench, rise_k: T::ZERO }, readings))
}

fn learn<T: Scalar>(machine: &Machine<T>, table: &CorrectionTable<'_, T>) -> Result<u64, &'static str> {
    const MACHINE: u64 = 7;
    let settings = settings().ok_or("an amplitude is refused")?;
    let mut estimator = Estimator::<T, 5>::new(&settings).map_err(|_| "the settings are refused")?;
    let (mut a, mut b) = ([0; state_bytes(5)], [0xff; state_bytes(5)]);
    let mut sum = START;
    for n in 1..=READINGS {
        let (touch, readings) = reading(machine, table, n).ok_or("no reading at a pose of the box")?;
        refuse(machine, table, &estimator, &touch, &readings)?;
        if estimator.learn(machine, Some(table), &touch, &readings).is_err() {
            return Err("a good reading is refused");
        }
        estimator.follow(T::from_f64(1.0));
        // the power goes while a state is written: what was saved before is read back, and this reading is lost with it
        let (older, newer) = if n % 2 == 0 { (&mut b, &mut a) } else { (&mut a, &mut b) };
        if estimator.save(MACHINE, n, older).is_err() {
            return Err("a state is not saved");
        }
        if n % 10 == 0 {
            let cut = n as usize * state_bytes(5) / (READINGS as usize + 1);
            let mut torn = *older;
            torn.iter_mut().skip(cut).for_each(|byte| *byte = 0xff);
            if newest(5, &torn, newer) != Some((Slot::B, n - 1)) || estimator.restore(MACHINE, &torn).is_ok() {
                return Err("a torn state is read");
            }
            estimator.restore(MACHINE, newer).map_err(|_| "a whole state is refused")?;
            *older = *newer;
        }
        for (value, deviation) in estimator.values() {
            sum = over_numbers(sum, &[value, deviation]);
        }
        sum = over_numbers(sum, &estimator.applied());
    }
    match estimator.alarms() {
        [None, Some(alarm), None, None, None] if (alarm.change - SOFTER_M_PER_N).abs() < 0.3 * SOFTER_M_PER_N => {
            Ok(sum)
        }
        _ => Err("the softer drive is not found"),
    }
}

/// One reading of each kind that teaches nothing.
fn refuse<T: Scalar>(
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
    estimator: &Estimator<T, 5>,
    touch: &Touch<T>,
    readings: &[TipReading<T>; 3],
) -> Result<(), &'static str> {
    let read = |change: fn(T) -> T| readings.map(|r| TipReading { read: change(r.read), ..r });
    let nan = T::from_f64(f64::NAN);
    let no_load = Touch { wrench: Wrench::ZERO, ..*touch };
    let old = Touch { time_s: 0, ..*touch };
    let far = Touch { pose: Pose { z0_m: T::from_f64(9.0), ..touch.pose }, ..*touch };
    let is = |touch: &Touch<T>, readings: &[TipReading<T>], expected: fn(Refusal) -> bool| {
        let mut other = *estimator;
        let refused = other.learn(machine, Some(table), touch, readings).is_err_and(expected);
        refused && other.values() == estimator.values()
    };
    let all = is(touch, &[TipReading { read: nan, ..readings[0] }], |r| r == Refusal::NotFinite)
        && is(touch, &[], |r| r == Refusal::Components)
        && (estimator.readings() == 0 || is(&old, readings, |r| r == Refusal::Backwards))
        && is(&no_load, &read(|_| T::ZERO), |r| r == Refusal::NotExcited)
        && is(touch, &read(|read| -read), |r| r == Refusal::WrongSign)
        && is(touch, &read(|read| read * T::from_f64(100.0)), |r| r == Refusal::Unexpected)
        && is(&far, readings, |r| matches!(r, Refusal::Model(_)));
    if all { Ok(()) } else { Err("a reading that teaches nothing is taken in, or moves an amplitude") }
}

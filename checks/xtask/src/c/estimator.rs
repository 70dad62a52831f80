//! What `embed/c/tests/estimator.c` prints, by the Rust estimator: the same readings, and every bit of what is known.

use pkm_core::compensator::{Compensator, CompensatorSettings, Offset, Reading};
use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{
    Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, Learned, MAX_AMPLITUDES, Refusal, Slot, TipReading,
    Touch, newest, state_bytes,
};
use pkm_core::nalgebra::Vector6;
use pkm_core::{
    Configuration, CorrectionError, CorrectionTable, Domain, FiveAxis, KinematicsError, Model, Pose, Scalar,
    StiffnessError, TableUncertainty, Wrench,
};

use super::compensator::Random;
use crate::qemu::Host;

const READINGS: u32 = 120;
const COUNT: usize = 6;
/// Its checksum is no part of what is compared.
const MACHINE: u64 = 1;

/// As in the program.
fn settings() -> Result<EstimatorSettings<COUNT>, String> {
    let compliance = |place, motion| Amplitude::compliance(place, motion).ok_or("no such amplitude");
    let learned = [
        (compliance(Place::Body { limb: 1 }, Motion::Axial)?, 1e-9),
        (compliance(Place::Body { limb: 2 }, Motion::Axial)?, 1e-9),
        (compliance(Place::Body { limb: 3 }, Motion::Axial)?, 1e-9),
        (compliance(Place::Base, Motion::Z)?, 1e-9),
        (compliance(Place::Tool, Motion::Ru)?, 1e-8),
        (Amplitude::RISE, 1.0),
    ];
    let amplitudes = learned.map(|(amplitude, d)| AmplitudeSettings {
        amplitude,
        accepted: 0.0,
        deviation: d,
        drift_per_day: d / 128.0,
        least: -4.0 * d,
        most: 32.0 * d,
        rate_per_s: d / 64.0,
        alarm: d / 1024.0,
    });
    Ok(EstimatorSettings { amplitudes, model_share: 0.02 })
}

/// The number of a refusal in `pkm.h`.
fn number(refusal: Refusal) -> Result<u8, String> {
    Ok(match refusal {
        Refusal::NotFinite => 3,
        Refusal::Model(CorrectionError::Stiffness(StiffnessError::Kinematics(KinematicsError::OutOfTravel {
            limb,
        }))) => 11 + limb,
        Refusal::Components => 90,
        Refusal::Backwards => 91,
        Refusal::NotExcited => 92,
        Refusal::WrongSign => 94,
        Refusal::Unexpected => 95,
        other => return Err(format!("a refusal that the program should not meet: {other}")),
    })
}

/// What is read by the number of the reading, good or bad.
fn reading<T: Scalar>(
    (five, table): (&FiveAxis<'_, T>, &CorrectionTable<'_, T>),
    random: &mut Random,
    n: u32,
) -> Result<(Touch<T>, Vec<TipReading<T>>), String> {
    let mut scaled = |from, below, by: f64| T::from_f64(f64::from(random.next(from, below)) / by);
    let [theta_rad, sigma_rad, z0_m] = [scaled(-50, 51, 256.0), scaled(-50, 51, 256.0), scaled(520, 560, 1024.0)];
    let mut pose = Pose { theta_rad, sigma_rad, z0_m };
    if n % 20 == 9 {
        // outside the table's box
        pose.theta_rad = T::from_f64(0.375);
    }
    let force_n = [0; 3].map(|_| scaled(-1000, 1001, 1.0)).into();
    let wrench = Wrench { force_n, ..Wrench::ZERO };
    let factor = table.factor_form(five.machine, &pose).map_err(|e| e.to_string())?.factor;
    let linear = factor.deflection(&wrench).map_err(|e| e.to_string())?;
    let more = five.machine.load_dependent_deflection(&pose, &wrench, &Wrench::ZERO).map_err(|e| e.to_string())?;
    let moved = linear.plus(&more).translation_m;
    let share = T::from_f64(if n < READINGS / 2 { 1.0 } else { 1.0625 });
    let mut readings: Vec<TipReading<T>> = (0..3)
        .map(|i| {
            let read = moved[i] * share + scaled(-300, 301, 1_073_741_824.0);
            TipReading { direction: Vector6::ith(i, T::ONE), read, deviation: T::from_f64(1.0 / 4_194_304.0) }
        })
        .collect();
    let mut touch = Touch { time_s: 1000 + 600 * n, pose, tip_m: [T::ZERO; 3].into(), wrench, rise_k: T::ZERO };
    match n % 20 {
        3 | 13 => readings[1].read = T::from_f64(f64::NAN),
        4 | 14 => touch.time_s = 1000,
        5 | 15 => readings.resize(if n % 20 == 5 { 0 } else { 7 }, readings[0]),
        6 | 16 => readings.iter_mut().for_each(|reading| reading.direction.fill(T::ZERO)),
        7 | 17 => readings.iter_mut().for_each(|reading| reading.read = -reading.read),
        8 => readings[0].read *= T::from_f64(64.0),
        18 => touch.pose.z0_m = T::from_f64(9.0),
        _ => {}
    }
    Ok((touch, readings))
}

/// A sum over the bits of numbers.
#[derive(Default)]
struct Sum(u64);

impl Sum {
    fn add<T: Scalar>(&mut self, value: T) {
        self.0 = (self.0 ^ value.to_f64().to_bits()).wrapping_mul(0x100_0000_01b3);
    }

    fn add_state<T: Scalar>(&mut self, estimator: &Estimator<T, COUNT>, changed: [bool; MAX_AMPLITUDES]) {
        self.add(f64::from(estimator.began_s()));
        let (values, applied, alarms) = (estimator.values(), estimator.applied(), estimator.alarms());
        for n in 0..MAX_AMPLITUDES {
            let (value, deviation) = values.get(n).copied().unwrap_or_default();
            let alarm = alarms.get(n).copied().flatten();
            let told = alarm.map_or([0.0; 3], |alarm| [alarm.change, alarm.probability, f64::from(alarm.readings)]);
            let numbers = [value, deviation, applied.get(n).copied().unwrap_or_default()];
            let changed = f64::from(u8::from(changed[n]));
            numbers.into_iter().chain(told).chain([changed]).for_each(|number| self.add(number));
        }
    }

    fn add_offset<T: Scalar, const JOINTS: usize>(&mut self, offset: &Offset<T, JOINTS>) -> Result<T, String> {
        let known = offset.known.ok_or("nothing is known of an offset")?;
        for i in 0..3 {
            self.add(offset.joints[i]);
            self.add(known.uncertainty.u95_m()[i]);
        }
        offset.joints.iter().skip(3).for_each(|joint| self.add(*joint));
        Ok(known.share)
    }
}

/// Two slots, as a controller keeps them.
struct Slots([[u8; state_bytes(COUNT)]; 2]);

impl Slots {
    /// Saves over the older one; where the power goes, the one before is read back.
    fn save<T: Scalar>(&mut self, estimator: &mut Estimator<T, COUNT>, cut: Option<usize>) -> Result<(), String> {
        let said = |e: pkm_core::estimation::StateError| e.to_string();
        let last = newest(COUNT, &self.0[0], &self.0[1]);
        let (to, sequence) = last.map_or((0, 1), |(slot, sequence)| (usize::from(slot == Slot::A), sequence + 1));
        estimator.save(MACHINE, sequence, &mut self.0[to]).map_err(said)?;
        if let Some(cut) = cut {
            self.0[to][cut..].fill(0xff);
            estimator.restore(MACHINE, &self.0[1 - to]).map_err(said)?;
        }
        Ok(())
    }
}

fn lines<T: Scalar>(
    name: &str,
    (five, table): (&FiveAxis<'_, T>, &CorrectionTable<'_, T>),
    uncertainty: &TableUncertainty<T>,
) -> Result<Vec<String>, String> {
    let mut estimator = Estimator::<T, COUNT>::new(&settings()?).map_err(|e| e.to_string())?;
    let compensation = CompensatorSettings { stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let mut screws = Compensator::<T, 3>::new(&compensation).map_err(|e| e.to_string())?;
    let mut axes = Compensator::<T, 5>::new(&compensation).map_err(|e| e.to_string())?;
    let t = |numbers: [f64; 3]| numbers.map(T::from_f64);
    let wrench = Wrench { force_n: t([100.0, -50.0, -400.0]).into(), moment_nm: t([2.0, -8.0, 5.0]).into() };
    let period = Reading { enabled: true, wrench, rise: T::ZERO.into() };
    let [theta_rad, sigma_rad, z0_m] = t([0.125, -0.0625, 0.53125]);
    let beta_rad = [0.125, -0.125].map(T::from_f64).into();
    let stands = Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad };
    let tip_m = t([0.03125, -0.015625, 0.3125]).into();
    let (mut random, mut sum) = (Random(1), Sum::default());
    let mut slots = Slots([[0xff; state_bytes(COUNT)]; 2]);
    let (mut lines, mut errors, mut alarmed, mut outside) = (Vec::new(), Vec::new(), false, false);
    for n in 0..READINGS {
        let (touch, readings) = reading((five, table), &mut random, n)?;
        let learned = estimator.learn(five.machine, Some(table), &touch, &readings);
        estimator.follow(T::ONE);
        if n % 7 == 6 {
            slots.save(&mut estimator, (n % 14 == 13).then_some(n as usize))?;
        }
        let error = learned.map_or_else(number, |_| Ok(0))?;
        let nothing = Learned { chi_squared: T::ZERO, changed: [false; MAX_AMPLITUDES], domain: None };
        let Learned { chi_squared, changed, domain } = learned.unwrap_or(nothing);
        sum.add_state(&estimator, changed);
        let is_outside = domain == Some(Domain::Outside);
        sum.add(f64::from(u8::from(is_outside)));
        outside |= is_outside;
        let uncertainty = (n % 2 == 0).then_some(uncertainty);
        let model = Model { uncertainty, ..Model::new(five.machine, table).with_learned(&estimator) };
        let of_screws = screws.update(&model, &stands.pose, tip_m, &period);
        let of_axes = axes.update(&model, five.wrist, &stands, &period);
        let share = sum.add_offset(&of_screws)?;
        sum.add(share);
        sum.add_offset(&of_axes)?;
        let at_tool = five.touch(&stands, &wrench, 7, T::from_f64(2.0)).map_err(|e| e.to_string())?;
        for i in 0..3 {
            let numbers = [at_tool.tip_m[i], at_tool.wrench.force_n[i], at_tool.wrench.moment_nm[i]];
            numbers.into_iter().for_each(|number| sum.add(number));
            stands.base_axes().column(i).iter().for_each(|number| sum.add(*number));
        }
        let alarms = (0..).zip(estimator.alarms()).fold(0, |all, (n, alarm)| all | u32::from(alarm.is_some()) << n);
        let [readings, refused, time_s] = [estimator.readings(), estimator.refused(), estimator.time_s()];
        let (chi_squared, Sum(sum)) = (chi_squared.to_f64().to_bits(), &sum);
        lines
            .push(format!("{name} {n} {error} {readings} {refused} {time_s} {alarms:x} {chi_squared:016x} {sum:016x}"));
        errors.push(error);
        alarmed |= alarms > 0;
    }
    let met = [0, 3, 13, 90, 91, 92, 94, 95].iter().all(|n| errors.contains(n)) && alarmed && outside;
    if met {
        Ok(lines)
    } else {
        Err(format!(
            "{name}: not every refusal occurred, or no alarm ({alarmed}) or pose outside the box ({outside}): {errors:?}"
        ))
    }
}

/// Holds what the program printed against the host; returns the number of readings that are the same bits.
pub fn compare(text: &str, host: &Host) -> Result<usize, String> {
    let (in_double, in_single) = &host.uncertainty()?;
    let (double, single) =
        host.both(|m, t| lines("estimator_f64", (m, t), in_double), |m, t| lines("estimator_f32", (m, t), in_single))?;
    super::same_lines(text, &[double?, single?].concat())
}

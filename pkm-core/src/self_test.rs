//! A test for a controller's start: known poses of the reference machine, whose result bits are known, and some periods of a
//! compensator at each.
//!
//! What it finds: a processor in another rounding mode or one that flushes small numbers to zero, a broken or missing floating-point unit, a
//! compiler that reorders arithmetic, damaged code. What is in memory of the controller's own machine and table asks
//! [`FiveAxis::verify`]. The reference machine and its table come into the image with it, some 5 KB.

use core::fmt;
use core::hint::black_box;

use nalgebra::{Vector2, Vector3};

use crate::checksum::{START, over_byte, over_numbers};
use crate::compensator::{Compensator, CompensatorSettings, Fault, Offset, Reading};
use crate::five_axis::{Configuration, FiveAxis, Tool, ToolMotion};
use crate::machine::{Machine, MachineParameters};
use crate::model::Model;
use crate::scalar::Scalar;
use crate::tables::reference::{PARAMETERS, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use crate::thermal::TemperatureRise;
use crate::types::{Pose, Wrench};
use crate::wrist::Wrist;

/// What does not compute as it should. A fault code for a display is its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum SelfTestFault {
    /// Inverse and forward kinematics.
    Kinematics = 1,
    /// K_m, deflection, compensation.
    Stiffness = 2,
    /// Inverse kinematics and velocities of the five axes.
    FiveAxes = 3,
    /// The compensator, of three screws and of five axes.
    Compensator = 4,
}

impl fmt::Display for SelfTestFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Kinematics => "the self-test of the kinematics has other bits",
            Self::Stiffness => "the self-test of stiffness and compensation has other bits",
            Self::FiveAxes => "the self-test of the five axes has other bits",
            Self::Compensator => "the self-test of the compensator has other bits",
        })
    }
}

impl core::error::Error for SelfTestFault {}

/// The reference machine, which grows when it is warm.
const GROWING: MachineParameters = match PARAMETERS.effects.with("thermal-expansion", [11e-6, 14e-6]) {
    Some(effects) => MachineParameters { effects, ..PARAMETERS },
    None => panic!("the effect has another name"),
};
static MACHINE_F64: Machine<f64> = match Machine::<f64>::new(&GROWING) {
    Ok(machine) => machine,
    Err(_) => panic!("the growth is too large"),
};
static MACHINE_F32: Machine<f32> = match Machine::<f32>::new(&GROWING) {
    Ok(machine) => machine,
    Err(_) => panic!("the growth is too large"),
};

/// θ, σ in rad and Z0 in m.
static POSES: [[f64; 3]; 4] = [[0.0, 0.0, 0.53], [0.1, -0.05, 0.53], [-0.2, 0.15, 0.51], [0.25, 0.2, 0.55]];

/// The tip in A-uvw, m, and the load on it, N and N·m.
const TIP_M: [f64; 3] = [0.01, -0.02, 0.3];
const WRENCH: [f64; 6] = [100.0, -50.0, -400.0, 2.0, -8.0, 5.0];
/// Of limbs 1, 2, 3 and the platforms, K.
const RISES_K: [f64; 4] = [1.5, 2.0, -0.75, 0.5];
/// Periods of a compensator at each pose, with which every limit acts in one, and none in another.
const PERIODS: usize = 3;
const SETTINGS: CompensatorSettings = CompensatorSettings {
    filter_s: 1e-3,
    max_screw_m: 20e-6,
    max_wrist_rad: 150e-6,
    screw_rate_m_per_s: 10e-3,
    wrist_rate_rad_per_s: 100e-3,
    ..CompensatorSettings::DEFAULT
};

/// What the compensators keep while the self-test runs: in memory of the caller, since on top of an update's stack it would be more
/// than anything else in the core takes.
#[derive(Clone, Debug)]
pub struct SelfTestMemory<T> {
    screws: Option<Compensator<T, 3>>,
    axes: Option<Compensator<T, 5>>,
}

impl<T> SelfTestMemory<T> {
    /// Before the self-test.
    pub const fn new() -> Self {
        Self { screws: None, axes: None }
    }
}

impl<T> Default for SelfTestMemory<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Takes numbers into a checksum; an error is one as well.
fn over<T: Scalar, E>(hash: u64, numbers: Result<&[T], E>) -> u64 {
    let Ok(numbers) = numbers else { return 0 };
    numbers.iter().fold(hash, |hash, number| over_numbers(hash, &[number.to_f64()]))
}

#[inline(never)]
fn kinematics<T: Scalar>(machine: &Machine<T>, pose: &Pose<T>, hash: u64) -> u64 {
    let lengths = machine.inverse(pose);
    let back = lengths.and_then(|lengths| machine.forward(&lengths));
    let hash = over(hash, lengths.as_ref().map(|lengths| lengths.q_m.as_slice()));
    over(hash, back.map(|pose| [pose.theta_rad, pose.sigma_rad, pose.z0_m]).as_ref().map(|pose| &pose[..]))
}

#[inline(never)]
fn stiffness<T: Scalar>(model: &Model<'_, T>, pose: &Pose<T>, hash: u64) -> u64 {
    let wrench = Wrench::from_vector(WRENCH.map(T::from_f64).into());
    let tip = TIP_M.map(T::from_f64).into();
    let cycle = &model.table.cycle(model.machine, pose, &wrench, tip);
    let hash = over(hash, cycle.as_ref().map(|cycle| cycle.deflection.translation_m.as_slice()));
    let hash = over(hash, cycle.as_ref().map(|cycle| cycle.deflection.rotation_rad.as_slice()));
    over(hash, cycle.as_ref().map(|cycle| cycle.compensated.lengths.q_m.as_slice()))
}

#[inline(never)]
fn five_axes<T: Scalar>(five: &FiveAxis<'_, T>, pose: &Pose<T>, hash: u64) -> u64 {
    let near = turned(pose);
    let moved = five.tool(&near).and_then(|Tool { tip_m, axis }| {
        let step = Vector3::repeat(T::from_f64(1e-3));
        let solution = five.inverse(&Tool { tip_m: tip_m + step, axis: axis + step }, &near)?;
        let motion = ToolMotion { tip_m_per_s: step, axis_per_s: step, tip_m_per_s2: step, axis_per_s2: step };
        Ok((solution.joints, five.joint_motion(&solution.configuration, &motion)?))
    });
    let moved = &moved;
    let hash = over(hash, moved.as_ref().map(|(joints, _)| joints.lengths.q_m.as_slice()));
    let hash = over(hash, moved.as_ref().map(|(joints, _)| joints.beta_rad.as_slice()));
    let hash = over(hash, moved.as_ref().map(|(_, motion)| motion.velocity.as_slice()));
    over(hash, moved.as_ref().map(|(_, motion)| motion.acceleration.as_slice()))
}

/// Some periods at each pose; a fault of the compensator is an error.
fn offsets<T: Scalar, const JOINTS: usize>(
    mut hash: u64,
    mut update: impl FnMut(&Pose<T>) -> Offset<T, JOINTS>,
) -> u64 {
    for pose in &POSES {
        for _ in 0..PERIODS {
            let Offset { joints, limit, fault, .. } = update(&rounded(black_box(*pose)));
            hash = over::<T, Fault>(hash, fault.map_or(Ok(joints.as_slice()), Err));
            hash = over_byte(hash, limit as u8);
        }
    }
    hash
}

#[inline(never)] // takes no stack while the compensator runs
fn begin<T: Scalar, const JOINTS: usize>(memory: &mut Option<Compensator<T, JOINTS>>, settings: &CompensatorSettings) {
    *memory = Compensator::new(settings).ok();
}

#[inline(never)]
fn screws<T: Scalar>(model: &Model<'_, T>, memory: &mut Option<Compensator<T, 3>>, reading: &Reading<T>) -> u64 {
    let Some(compensator) = memory else { return 0 };
    let tip_m = TIP_M.map(T::from_f64).into();
    offsets(START, |pose| compensator.update(model, pose, tip_m, reading))
}

#[inline(never)]
fn axes<T: Scalar>(
    (model, wrist): (&Model<'_, T>, &Wrist<T>),
    memory: &mut Option<Compensator<T, 5>>,
    reading: &Reading<T>,
    hash: u64,
) -> u64 {
    let Some(compensator) = memory else { return 0 };
    offsets(hash, |pose| compensator.update(model, wrist, &turned(pose), reading))
}

fn compensators<T: Scalar>(
    (model, wrist): (&Model<'_, T>, &Wrist<T>),
    memory: &mut SelfTestMemory<T>,
    settings: &CompensatorSettings,
    reading: &Reading<T>,
) -> u64 {
    begin(&mut memory.screws, settings);
    begin(&mut memory.axes, settings);
    let hash = screws(model, &mut memory.screws, reading);
    axes((model, wrist), &mut memory.axes, reading, hash)
}

fn reading<T: Scalar>() -> Reading<T> {
    let [first, second, third, platforms_k] = black_box(RISES_K).map(T::from_f64);
    let rise = TemperatureRise { limbs_k: [first, second, third], platforms_k };
    Reading { enabled: true, wrench: Wrench::from_vector(WRENCH.map(T::from_f64).into()), rise }
}

fn rounded<T: Scalar>(pose: [f64; 3]) -> Pose<T> {
    let [theta_rad, sigma_rad, z0_m] = pose.map(T::from_f64);
    Pose { theta_rad, sigma_rad, z0_m }
}

/// With the wrist turned.
fn turned<T: Scalar>(pose: &Pose<T>) -> Configuration<T> {
    Configuration { pose: *pose, beta_rad: Vector2::new(T::from_f64(0.3), T::from_f64(-0.2)) }
}

const MODEL_F64: Model<'_, f64> = Model::new(&MACHINE_F64, &TABLE_F64);
const MODEL_F32: Model<'_, f32> = Model::new(&MACHINE_F32, &TABLE_F32);

/// Checksums of the four parts.
fn sums<T: Scalar>(model: &Model<'_, T>, wrist: &Wrist<T>, memory: &mut SelfTestMemory<T>) -> [u64; 4] {
    let [mut a, mut b, mut c] = [START; 3];
    for pose in &POSES {
        // or the compiler would compute it
        let pose = &rounded(black_box(*pose));
        let five = &FiveAxis { machine: model.machine, wrist };
        (a, b, c) = (kinematics(model.machine, pose, a), stiffness(model, pose, b), five_axes(five, pose, c));
    }
    [a, b, c, compensators((model, wrist), memory, black_box(&SETTINGS), &reading())]
}

const PARTS: [SelfTestFault; 4] =
    [SelfTestFault::Kinematics, SelfTestFault::Stiffness, SelfTestFault::FiveAxes, SelfTestFault::Compensator];

fn compared(found: [u64; 4], known: [u64; 4]) -> Result<(), SelfTestFault> {
    let wrong = found.into_iter().zip(known).zip(PARTS).find(|((found, known), _)| found != known);
    wrong.map_or(Ok(()), |(_, part)| Err(part))
}

/// In `f64`.
///
/// # Errors
/// The first part with other bits.
pub fn self_test_f64(memory: &mut SelfTestMemory<f64>) -> Result<(), SelfTestFault> {
    compared(
        sums(&MODEL_F64, &WRIST_F64, memory),
        [0x21a7_af54_61c6_0ca9, 0xeed0_2494_c638_920a, 0xc3db_05a1_6610_19ab, 0x89f9_4f46_1920_d43e],
    )
}

/// In `f32`.
///
/// # Errors
/// The first part with other bits.
pub fn self_test_f32(memory: &mut SelfTestMemory<f32>) -> Result<(), SelfTestFault> {
    compared(
        sums(&MODEL_F32, &WRIST_F32, memory),
        [0xcd57_b481_3825_a513, 0x49aa_a7d3_87f1_4532, 0x1e54_29e3_b927_e642, 0x9966_82cb_3871_d954],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a test of bits has to notice, and which part it names.
    #[test]
    #[cfg_attr(miri, ignore = "slow, and runs what the known bits run")]
    fn another_bit_is_found() {
        let mut memory = SelfTestMemory::new();
        let known = sums(&MODEL_F64, &WRIST_F64, &mut memory);
        assert_eq!(compared(known, known), Ok(()));
        for (part, fault) in PARTS.into_iter().enumerate() {
            let mut other = known;
            other[part] ^= 1;
            assert_eq!(compared(other, known), Err(fault));
        }
        // an error is no result
        assert_eq!(over::<f64, ()>(START, Err(())), 0);
        let mut machine = MACHINE_F64;
        machine.limbs[0].axial = f64::from_bits(machine.limbs[0].axial.to_bits() + (1 << 20));
        let [kinematics, stiffness, _, compensator] =
            sums(&Model { machine: &machine, ..MODEL_F64 }, &WRIST_F64, &mut memory);
        assert!(kinematics == known[0] && stiffness != known[1] && compensator != known[3]);
    }

    /// Whatever a compensator goes by is in its bits: filter, gain, dead bands, both limits of screws and wrist, load and temperatures.
    #[test]
    #[cfg_attr(miri, ignore = "slow, and runs what the known bits run")]
    fn another_bit_of_a_compensator_is_found() {
        let usual = reading();
        let of = |settings: &CompensatorSettings, reading: &Reading<f64>| {
            let mut memory = SelfTestMemory::new();
            begin(&mut memory.screws, settings);
            begin(&mut memory.axes, settings);
            let of_screws = screws(&MODEL_F64, &mut memory.screws, reading);
            [of_screws, axes((&MODEL_F64, &WRIST_F64), &mut memory.axes, reading, START)]
        };
        let known = of(&SETTINGS, &usual);
        let up = |number: f64| f64::from_bits(number.to_bits() + (1 << 20));
        let s = SETTINGS;
        let both = &[0, 1][..];
        for (settings, parts) in [
            (CompensatorSettings { gain: up(s.gain), ..s }, both),
            (CompensatorSettings { filter_s: up(s.filter_s), ..s }, both),
            (CompensatorSettings { period_s: up(s.period_s), ..s }, both),
            (CompensatorSettings { dead_band_n: up(s.dead_band_n), ..s }, both),
            (CompensatorSettings { dead_band_nm: up(s.dead_band_nm), ..s }, both),
            (CompensatorSettings { max_screw_m: up(s.max_screw_m), ..s }, &[0]),
            (CompensatorSettings { screw_rate_m_per_s: up(s.screw_rate_m_per_s), ..s }, &[0]),
            (CompensatorSettings { max_wrist_rad: up(s.max_wrist_rad), ..s }, &[1]),
            (CompensatorSettings { wrist_rate_rad_per_s: up(s.wrist_rate_rad_per_s), ..s }, &[1]),
        ] {
            let found = of(&settings, &usual);
            assert!(parts.iter().all(|part| found[*part] != known[*part]), "{settings:?}");
        }
        for limb in 0..3 {
            let mut warm = usual;
            warm.rise.limbs_k[limb] = up(warm.rise.limbs_k[limb]);
            let found = of(&SETTINGS, &warm);
            assert!(found[0] != known[0] && found[1] != known[1], "{limb}");
        }
        let mut loaded = usual;
        loaded.wrench.force_n.z = up(loaded.wrench.force_n.z);
        let found = of(&SETTINGS, &loaded);
        assert!(found[0] != known[0] && found[1] != known[1]);
        // a setting out of range, and a fault, are no result
        let wrong = CompensatorSettings { gain: 2.0, ..s };
        assert_eq!(compensators((&MODEL_F64, &WRIST_F64), &mut SelfTestMemory::new(), &wrong, &usual), 0);
        loaded.wrench.force_n.z = f64::NAN;
        assert!(of(&SETTINGS, &loaded) != known);
    }

    #[test]
    #[cfg_attr(miri, ignore = "slow, and runs what the known bits run")]
    fn every_limit_acts() {
        let (reading, tip_m) = (reading(), TIP_M.map(|component| component as f32).into());
        let (Ok(mut compensator), Ok(mut tools)) =
            (Compensator::<f32, 3>::new(&SETTINGS), Compensator::<f32, 5>::new(&SETTINGS))
        else {
            panic!("the settings are in range");
        };
        let (mut of_screws, mut of_axes) = ([0; 3], [0; 3]);
        offsets(START, |pose| {
            let offset = compensator.update(&MODEL_F32, pose, tip_m, &reading);
            of_screws[offset.limit as usize] += 1;
            offset
        });
        offsets(START, |pose| {
            let offset = tools.update(&MODEL_F32, &WRIST_F32, &turned(pose), &reading);
            of_axes[offset.limit as usize] += 1;
            assert_eq!(offset.fault, None);
            offset
        });
        assert!(of_screws.iter().chain(&of_axes).all(|count| *count > 0), "{of_screws:?} {of_axes:?}");
    }

    #[test]
    fn bits_are_those_that_are_known() {
        assert_eq!(
            (self_test_f32(&mut SelfTestMemory::new()), self_test_f64(&mut SelfTestMemory::new())),
            (Ok(()), Ok(())),
            "f64 {:#x?} f32 {:#x?}",
            sums(&MODEL_F64, &WRIST_F64, &mut SelfTestMemory::new()),
            sums(&MODEL_F32, &WRIST_F32, &mut SelfTestMemory::new())
        );
    }
}

//! A test for a controller's start: known poses of the reference machine, whose result bits are known.
//!
//! What it finds: a processor in another rounding mode or one that flushes small numbers to zero, a broken or missing floating-point unit, a
//! compiler that reorders arithmetic, damaged code. What is in memory of the controller's own machine and table asks
//! [`FiveAxis::verify`]. The reference machine and its table come into the image with it, some 5 KB.

use core::fmt;
use core::hint::black_box;

use nalgebra::{Vector2, Vector3};

use crate::checksum::{START, over_numbers};
use crate::correction::CorrectionTable;
use crate::five_axis::{Configuration, FiveAxis, Tool, ToolMotion};
use crate::scalar::Scalar;
use crate::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use crate::types::{Pose, Wrench};

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
}

impl fmt::Display for SelfTestFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Kinematics => "the self-test of the kinematics has other bits",
            Self::Stiffness => "the self-test of stiffness and compensation has other bits",
            Self::FiveAxes => "the self-test of the five axes has other bits",
        })
    }
}

impl core::error::Error for SelfTestFault {}

/// θ, σ in rad and Z0 in m.
const POSES: [[f64; 3]; 4] = [[0.0, 0.0, 0.53], [0.1, -0.05, 0.53], [-0.2, 0.15, 0.51], [0.25, 0.2, 0.55]];

/// Takes numbers into a checksum; an error is one as well.
fn over<T: Scalar, E>(hash: u64, numbers: Result<&[T], E>) -> u64 {
    let Ok(numbers) = numbers else { return 0 };
    numbers.iter().fold(hash, |hash, number| over_numbers(hash, &[number.to_f64()]))
}

#[inline(never)]
fn kinematics<T: Scalar>(five: &FiveAxis<'_, T>, pose: &Pose<T>, hash: u64) -> u64 {
    let lengths = five.machine.inverse(pose);
    let back = lengths.and_then(|lengths| five.machine.forward(&lengths));
    let hash = over(hash, lengths.as_ref().map(|lengths| lengths.q_m.as_slice()));
    over(hash, back.map(|pose| [pose.theta_rad, pose.sigma_rad, pose.z0_m]).as_ref().map(|pose| &pose[..]))
}

#[inline(never)]
fn stiffness<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>, pose: &Pose<T>, hash: u64) -> u64 {
    let wrench = Wrench::from_vector([100.0, -50.0, -400.0, 2.0, -8.0, 5.0].map(T::from_f64).into());
    let tip = [0.01, -0.02, 0.3].map(T::from_f64).into();
    let cycle = &table.cycle(five.machine, pose, &wrench, tip);
    let hash = over(hash, cycle.as_ref().map(|cycle| cycle.deflection.translation_m.as_slice()));
    let hash = over(hash, cycle.as_ref().map(|cycle| cycle.deflection.rotation_rad.as_slice()));
    over(hash, cycle.as_ref().map(|cycle| cycle.compensated.lengths.q_m.as_slice()))
}

#[inline(never)]
fn five_axes<T: Scalar>(five: &FiveAxis<'_, T>, pose: &Pose<T>, hash: u64) -> u64 {
    let near = Configuration { pose: *pose, beta_rad: Vector2::new(T::from_f64(0.3), T::from_f64(-0.2)) };
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

/// Checksums of the three parts.
fn sums<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>) -> [u64; 3] {
    let mut sums = [START; 3];
    for pose in POSES {
        // or the compiler would compute it
        let [theta_rad, sigma_rad, z0_m] = black_box(pose).map(T::from_f64);
        let pose = &Pose { theta_rad, sigma_rad, z0_m };
        let [a, b, c] = sums;
        sums = [kinematics(five, pose, a), stiffness(five, table, pose, b), five_axes(five, pose, c)];
    }
    sums
}

fn compared(found: [u64; 3], known: [u64; 3]) -> Result<(), SelfTestFault> {
    let parts = [SelfTestFault::Kinematics, SelfTestFault::Stiffness, SelfTestFault::FiveAxes];
    let wrong = found.into_iter().zip(known).zip(parts).find(|((found, known), _)| found != known);
    wrong.map_or(Ok(()), |(_, part)| Err(part))
}

/// In `f64`.
///
/// # Errors
/// The first part with other bits.
pub fn self_test_f64() -> Result<(), SelfTestFault> {
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    compared(sums(&five, &TABLE_F64), [0x21a7_af54_61c6_0ca9, 0xeed0_2494_c638_920a, 0xc3db_05a1_6610_19ab])
}

/// In `f32`.
///
/// # Errors
/// The first part with other bits.
pub fn self_test_f32() -> Result<(), SelfTestFault> {
    let five = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
    compared(sums(&five, &TABLE_F32), [0xcd57_b481_3825_a513, 0x49aa_a7d3_87f1_4532, 0x1e54_29e3_b927_e642])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a test of bits has to notice, and which part it names.
    #[test]
    fn another_bit_is_found() {
        let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
        let known = sums(&five, &TABLE_F64);
        assert_eq!(compared(known, known), Ok(()));
        for (part, fault) in
            [SelfTestFault::Kinematics, SelfTestFault::Stiffness, SelfTestFault::FiveAxes].into_iter().enumerate()
        {
            let mut other = known;
            other[part] ^= 1;
            assert_eq!(compared(other, known), Err(fault));
        }
        // an error is no result
        assert_eq!(over::<f64, ()>(START, Err(())), 0);
        let mut machine = MACHINE_F64;
        machine.limbs[0].axial = f64::from_bits(machine.limbs[0].axial.to_bits() + (1 << 20));
        let [kinematics, stiffness, _] = sums(&FiveAxis { machine: &machine, ..five }, &TABLE_F64);
        assert!(kinematics == known[0] && stiffness != known[1]);
    }

    #[test]
    fn bits_are_those_that_are_known() {
        let single = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
        let double = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
        assert_eq!(
            (self_test_f32(), self_test_f64()),
            (Ok(()), Ok(())),
            "f64 {:#x?} f32 {:#x?}",
            sums(&double, &TABLE_F64),
            sums(&single, &TABLE_F32)
        );
    }
}

//! Counts the instructions of the core's functions on a Cortex-M, for `cargo xtask cycles` to hold against their limits.
//!
//! Under QEMU's `-icount shift=7` an instruction takes 128 ns of the board's time, and SysTick counts 40 ns each. The
//! line of a function has its name and the greatest count over poses of the reference machine's box. On a real
//! board the numbers are 25/8 of its clock cycles and mean nothing else.

#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::hio;
use pkm_core::compensator::{Compensator, CompensatorSettings, OutsideBox, Reading};
use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{
    Configuration, CorrectionTable, FiveAxis, Pose, Scalar, Tool, ToolError, ToolFrame, ToolMotion, Wrench,
};

#[path = "../semihosting.rs"]
mod semihosting;

/// SysTick's ticks while `f` runs.
#[inline(never)]
fn ticks<R>(f: impl FnOnce() -> R) -> u32 {
    let before = SYST::get_current();
    black_box(&f());
    before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff
}

struct Counts {
    name: &'static str,
    greatest: u32,
}

/// The tool of the next point of a path: 1 mm and 0.1° on.
fn step<T: Scalar>(five: &FiveAxis<'_, T>, from: &Configuration<T>) -> Result<Tool<T>, ToolError> {
    let ToolFrame { tip_m, axes } = five.frame(from)?;
    let (along, turn) = (T::from_f64(5.8e-4), T::from_f64(1.75e-3));
    Ok(Tool { tip_m: tip_m.add_scalar(along), axis: axes.column(2) + axes.column(0) * turn })
}

/// Something across the tool's axis.
fn across<T: Scalar>(frame: &ToolFrame<T>) -> Vector3<T> {
    frame.axes.column(0) + frame.axes.column(1)
}

/// Instructions of the costliest compensation of a tool: too far for the looks that it has, and under loads that it does not
/// converge under.
fn worst_compensation<T: Scalar>(
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
    near: &Configuration<T>,
) -> Result<u32, ToolError> {
    let number = T::from_f64;
    let ToolFrame { tip_m, axes } = five.frame(near)?;
    let mut greatest = 0;
    for share in [0.003, 0.03, 0.1, 0.3, 0.6] {
        let aside = axes.column(0) * number(share) + axes.column(1) * number(-0.7 * share);
        let tool = &Tool { tip_m: tip_m + aside * number(0.3), axis: axes.column(2) + aside };
        for force_n in [1e3, 3e4, 1e5, 3e5, 1e6] {
            let wrench = &black_box(Wrench::from_vector(
                [0.3, -0.2, -1.0, 0.01, 0.02, 0.01].map(|c| number(c * force_n)).into(),
            ));
            greatest = greatest.max(ticks(|| five.compensated(Some(table), tool, wrench, near)));
        }
    }
    Ok(greatest)
}

fn count<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>) -> Result<[Counts; 11], ToolError> {
    let (machine, number) = (five.machine, T::from_f64);
    let wrench = Wrench::from_vector([100.0, -50.0, -400.0, 2.0, -8.0, 5.0].map(number).into());
    let tip = [0.01, -0.02, 0.3].map(number).into();
    let names = [
        "inverse",
        "k_p",
        "k_m",
        "cycle",
        "tool",
        "tool_frame",
        "tool_cycle",
        "compensate",
        "compensate_tool",
        "compensated_tool",
        "rates",
    ];
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let (Ok(mut compensator), Ok(mut tool_compensator)) =
        (Compensator::<T, 3>::new(&settings), Compensator::<T, 5>::new(&settings))
    else {
        return Err(ToolError::NotFinite);
    };
    let reading = black_box(Reading { enabled: true, wrench, rise_k: number(1.0) });
    let mut counts = names.map(|name| Counts { name, greatest: 0 });
    let angles = [-0.2618, -0.13, 0.05, 0.2618];
    for (theta, sigma) in angles.into_iter().flat_map(|theta| angles.map(|sigma| (theta, sigma))) {
        for z0 in [0.5, 0.53, 0.56] {
            let pose = Pose { theta_rad: number(theta), sigma_rad: number(sigma), z0_m: number(z0) };
            let beta_rad = Vector2::new(number(-3.0 * sigma), number(2.0 * theta));
            let near = &black_box(Configuration { pose, beta_rad });
            let (tool, frame, pose) = (&step(five, near)?, &five.frame(near)?, &near.pose);
            let motion = &black_box(ToolMotion {
                tip_m_per_s: tool.tip_m,
                axis_per_s: across(frame),
                tip_m_per_s2: tool.tip_m,
                axis_per_s2: across(frame),
            });
            let empty = ticks(|| ());
            let each = [
                ticks(|| machine.inverse(pose)),
                ticks(|| machine.stiffness(pose)),
                ticks(|| table.factor_form(machine, pose)),
                ticks(|| table.cycle(machine, pose, &wrench, tip)),
                ticks(|| five.inverse(tool, near)),
                ticks(|| five.inverse_frame(frame)),
                ticks(|| five.compensated(Some(table), tool, &wrench, near)),
                ticks(|| compensator.update(table, machine, pose, tip, &reading)),
                ticks(|| tool_compensator.update(table, five, near, &reading)),
                worst_compensation(five, table, near)?,
                ticks(|| five.joint_motion(near, motion)),
            ];
            for (count, ticks) in counts.iter_mut().zip(each) {
                count.greatest = count.greatest.max((ticks - empty) * 40 / 128);
            }
        }
    }
    Ok(counts)
}

fn run() -> Result<(), ()> {
    let mut clock = cortex_m::Peripherals::take().ok_or(())?.SYST;
    clock.set_clock_source(SystClkSource::Core);
    clock.set_reload(0x00ff_ffff);
    clock.clear_current();
    clock.enable_counter();
    let mut out = hio::hstdout()?;
    let double = count(&FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 }, &TABLE_F64);
    let single = count(&FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 }, &TABLE_F32);
    for (bits, counts) in [(64, double.map_err(drop)?), (32, single.map_err(drop)?)] {
        for Counts { name, greatest } in counts {
            writeln!(out, "{name}_f{bits} {greatest}").map_err(drop)?;
        }
    }
    Ok(())
}

#[entry]
fn main() -> ! {
    semihosting::end(run().is_ok())
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    semihosting::end(false)
}

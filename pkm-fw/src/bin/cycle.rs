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
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64};
use pkm_core::{CorrectionTable, Machine, Pose, Scalar, Wrench};

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

fn count<T: Scalar>(machine: &Machine<T>, table: &CorrectionTable<'_, T>) -> [Counts; 4] {
    let number = T::from_f64;
    let wrench = Wrench { force_n: [100.0, -50.0, -400.0].map(number), moment_nm: [2.0, -8.0, 5.0].map(number) };
    let tip = [0.01, -0.02, 0.3].map(number);
    let mut counts = ["inverse", "k_p", "k_m", "cycle"].map(|name| Counts { name, greatest: 0 });
    let angles = [-0.2618, -0.13, 0.05, 0.2618];
    for (theta, sigma) in angles.into_iter().flat_map(|theta| angles.map(|sigma| (theta, sigma))) {
        for z0 in [0.5, 0.53, 0.56] {
            let pose = Pose { theta_rad: number(theta), sigma_rad: number(sigma), z0_m: number(z0) };
            let pose = &black_box(pose);
            let empty = ticks(|| ());
            let each = [
                ticks(|| machine.inverse(pose)),
                ticks(|| machine.stiffness(pose)),
                ticks(|| table.factor_form(machine, pose)),
                ticks(|| table.cycle(machine, pose, &wrench, tip)),
            ];
            for (count, ticks) in counts.iter_mut().zip(each) {
                count.greatest = count.greatest.max((ticks - empty) * 40 / 128);
            }
        }
    }
    counts
}

fn run() -> Result<(), ()> {
    let mut clock = cortex_m::Peripherals::take().ok_or(())?.SYST;
    clock.set_clock_source(SystClkSource::Core);
    clock.set_reload(0x00ff_ffff);
    clock.clear_current();
    clock.enable_counter();
    let mut out = hio::hstdout()?;
    let (double, single) = (count(&MACHINE_F64, &TABLE_F64), count(&MACHINE_F32, &TABLE_F32));
    for (bits, counts) in [(64, double), (32, single)] {
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

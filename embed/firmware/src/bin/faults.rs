//! Throws faults and readings at a controller on a Cortex-M, for `cargo xtask qemu` to hold against the host: a line each over semihosting. Machine, wrist and
//! table are the core's reference.

#![no_std]
#![no_main]

use core::fmt::Write;

use cortex_m_rt::entry;
use cortex_m_semihosting::hio;

#[path = "../panic.rs"]
mod panic;
#[path = "../semihosting.rs"]
mod semihosting;

fn print_all() -> Result<(), ()> {
    let mut out = hio::hstdout()?;
    pkm_faults::outcomes().try_for_each(|outcome| writeln!(out, "{outcome}").map_err(drop))?;
    pkm_faults::lessons().iter().try_for_each(|lesson| writeln!(out, "{lesson}").map_err(drop))
}

#[entry]
fn main() -> ! {
    semihosting::end(print_all().is_ok())
}

//! The least that a controller takes: kinematics and K_m of one machine in `f64`. `cargo xtask size` weighs it.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m as _;
use cortex_m_rt::entry;
use pkm_core::Pose;
use pkm_core::tables::reference::{MACHINE_F64 as MACHINE, TABLE_F64 as TABLE};

#[path = "../handler.rs"]
mod handler;

#[entry]
fn main() -> ! {
    loop {
        let pose = black_box(Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.5 });
        if let Ok(lengths) = black_box(MACHINE.inverse(&pose)) {
            _ = black_box(MACHINE.forward(&lengths));
        }
        _ = black_box(MACHINE.jacobian(&pose));
        _ = black_box(TABLE.factor_form(&MACHINE, &pose));
    }
}

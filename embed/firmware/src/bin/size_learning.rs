//! What a controller takes that learns: a compensator of the screws, the table's uncertainty, and an estimator of six amplitudes whose state is
//! saved and read back, in `f64`. `cargo xtask size` weighs it.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m as _;
use cortex_m_rt::entry;
use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::estimation::{Estimator, Slot, TipReading, Touch, newest, state_bytes};
use pkm_core::nalgebra::{Vector3, Vector6};
use pkm_core::tables::reference::{MACHINE_F64 as MACHINE, TABLE_F64 as TABLE, UNCERTAINTY_F64 as UNCERTAINTY};
use pkm_core::{Model, Pose, Wrench};

#[path = "../handler.rs"]
mod handler;
#[path = "../learned.rs"]
mod learned;

const SLOT: usize = state_bytes(6);

#[entry]
fn main() -> ! {
    let mut slots = black_box([[0; SLOT]; 2]);
    let estimator = Estimator::<f64, 6>::new(&learned::SETTINGS);
    let compensator = Compensator::<f64, 3>::new(&CompensatorSettings::DEFAULT);
    let (Ok(mut estimator), Ok(mut compensator)) = (estimator, compensator) else { cortex_m::asm::udf() };
    let [a, b] = &slots;
    if let Some((slot, _)) = newest(6, a, b) {
        _ = black_box(estimator.restore(black_box(1), if slot == Slot::A { a } else { b }));
    }
    loop {
        let pose = black_box(Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.5 });
        let (tip_m, wrench) = black_box((Vector3::new(0.0, 0.0, 0.3), Wrench::ZERO));
        let touch = Touch { time_s: black_box(0), pose, tip_m, wrench, rise_k: 0.0 };
        let reading = black_box(TipReading { direction: Vector6::zeros(), read: 1e-6, deviation: 1e-6 });
        _ = black_box(estimator.learn(&MACHINE, Some(&TABLE), &touch, &[reading; 3]));
        black_box(estimator.alarms());
        estimator.follow(1e-3);
        let load = Reading { enabled: true, wrench, rise: 0.0.into() };
        let model = Model::new(&MACHINE, &TABLE).with_uncertainty(&UNCERTAINTY).with_learned(&estimator);
        black_box(compensator.update(&model, &pose, tip_m, &load));
        _ = black_box(estimator.save(black_box(1), black_box(1), &mut slots[1]));
    }
}

//! The firmware's compensation in two arithmetics.

use pkm_core::nalgebra::Vector3;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64};
use pkm_core::{Pose, Wrench};
use pkm_protocol::{Arithmetic, Demand};

use crate::estimation::drives;

#[path = "../../../embed/firmware/src/compensation.rs"]
mod firmware;

use firmware::{Compensation, Model};

const PERIOD_S: f64 = 1e-3;
/// Of a screw, by default.
const RATE_M_PER_S: f64 = 5e-3;

#[test]
fn an_offset_does_not_leap_between_arithmetics() {
    let model = Model { single: (&TABLE_F32, &MACHINE_F32), double: (&TABLE_F64, &MACHINE_F64) };
    // little is unknown, so that all is compensated
    let mut settings = drives();
    settings.amplitudes.iter_mut().for_each(|own| {
        (own.deviation, own.least, own.most) = (own.deviation / 100.0, 0.0, own.deviation);
        own.drift_per_day /= 100.0;
    });
    let mut task = Compensation::new(&settings, PERIOD_S).unwrap();
    task.narrow();
    let demand = |arithmetic| Demand {
        arithmetic,
        pose: Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 },
        wrench_at_tip: Wrench { force_n: Vector3::new(300.0, 0.0, -900.0), moment_nm: Vector3::zeros() },
        tip_m: Vector3::new(0.0, 0.0, 0.3),
    };
    let size = |offset: [f64; 3]| Vector3::from(offset).amax();
    let mut at_rest = Vec::new();
    for arithmetic in [Arithmetic::F64, Arithmetic::F32, Arithmetic::F64] {
        let mut least = f64::INFINITY;
        for _ in 0..600 {
            let before = Vector3::from(task.offset_m);
            task.period(&model, Some(demand(arithmetic)));
            let step = (Vector3::from(task.offset_m) - before).amax();
            assert!(step <= 1.001 * RATE_M_PER_S * PERIOD_S, "{step:e} m in a period");
            least = least.min(size(task.offset_m));
        }
        // it was gone, and has come again
        assert!(least < RATE_M_PER_S * PERIOD_S && size(task.offset_m) > 2.0 * RATE_M_PER_S * PERIOD_S, "{least:e}");
        at_rest.push(task.offset_m);
    }
    let apart = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) - Vector3::from(b)).amax();
    assert!(apart(at_rest[0], at_rest[2]) < 1e-8 && apart(at_rest[0], at_rest[1]) < 0.5e-6, "{at_rest:?}");
}

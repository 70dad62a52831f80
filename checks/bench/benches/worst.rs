//! Updates of the compensator, for callgrind to count each of them: `cargo xtask cycles` takes the worst.
//!
//! `worst f64|f32 SEED UPDATES`, at poses all over the box and beyond, under loads that go and turn, as the firmware's `cycle` has them.

use std::env;
use std::hint::black_box;

use nalgebra::{Vector2, Vector3};
use pkm_core::compensator::{Compensator, CompensatorSettings, Offset, OutsideBox, Reading};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{Configuration, CorrectionTable, FiveAxis, Pose, Scalar, Wrench};

// Callgrind knows these by their names: it counts from the beginning of one to the end of the next. A function that ended with a jump to
// another would have no end for it.
#[inline(never)]
fn count_from_here() {
    black_box(());
}

#[inline(never)]
fn counted_screws<T: Scalar>(
    compensator: &mut Compensator<T, 3>,
    (table, five): (&CorrectionTable<'_, T>, &FiveAxis<'_, T>),
    pose: &Pose<T>,
    tip_m: Vector3<T>,
    reading: &Reading<T>,
) -> Offset<T, 3> {
    black_box(compensator.update(table, five.machine, pose, tip_m, reading))
}

#[inline(never)]
fn counted_axes<T: Scalar>(
    compensator: &mut Compensator<T, 5>,
    (table, five): (&CorrectionTable<'_, T>, &FiveAxis<'_, T>),
    stands: &Configuration<T>,
    reading: &Reading<T>,
) -> Offset<T, 5> {
    black_box(compensator.update(table, five, stands, reading))
}

fn updates<T: Scalar>(with: (&CorrectionTable<'_, T>, &FiveAxis<'_, T>), mut state: u32, updates: usize) {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let mut screws = Compensator::<T, 3>::new(&settings).expect("settings");
    let mut axes = Compensator::<T, 5>::new(&settings).expect("settings");
    let tip_m = [0.01, -0.02, 0.3].map(T::from_f64).into();
    // the upper bits of a linear congruence
    let mut within = |middle: f64, half: f64| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        T::from_f64(middle + half * (f64::from(state >> 8) / f64::from(1 << 23) - 1.0))
    };
    for _ in 0..updates {
        let pose = Pose { theta_rad: within(0.0, 0.27), sigma_rad: within(0.0, 0.27), z0_m: within(0.53, 0.032) };
        let stands = Configuration { pose, beta_rad: Vector2::new(within(0.0, 1.2), within(-0.3, 0.3)) };
        let wrench = [500.0, 500.0, 500.0, 50.0, 50.0, 50.0].map(|half| within(0.0, half));
        let wrench = Wrench::from_vector(wrench.into());
        let reading = Reading { enabled: true, wrench, rise: within(0.0, 20.0).into() };
        count_from_here();
        counted_screws(&mut screws, with, &stands.pose, tip_m, &reading);
        count_from_here();
        counted_axes(&mut axes, with, &stands, &reading);
    }
}

fn main() {
    // of a plain `cargo bench` there are none, and nothing to do
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [width, seed, count] = arguments.as_slice() else { return };
    let (seed, count) = (seed.parse().expect("a seed"), count.parse().expect("a number of updates"));
    match width.as_str() {
        "f64" => updates((&TABLE_F64, &FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 }), seed, count),
        "f32" => updates((&TABLE_F32, &FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 }), seed, count),
        _ => panic!("f64 or f32"),
    }
}

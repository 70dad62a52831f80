//! Updates of the compensator, for callgrind to count each of them: `cargo xtask cycles` takes the worst.
//!
//! `worst f64|f32 SEED UPDATES [weight]`, at poses all over the box and beyond, under loads that go and turn, as the firmware's `cycle` has them.

use std::env;
use std::hint::black_box;

use nalgebra::{Vector2, Vector3};
use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Offset, OutsideBox, Reading, Weight};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{Configuration, Model, Pose, Scalar, Wrench, Wrist};

// Callgrind knows these by their names: it counts from the beginning of one to the end of the next. A function that ended with a jump to
// another would have no end for it.
#[inline(never)]
fn count_from_here() {
    black_box(());
}

#[inline(never)]
fn counted_screws<T: Scalar>(
    compensator: &mut Compensator<T, 3>,
    model: &Model<'_, T>,
    pose: &Pose<T>,
    tip_m: Vector3<T>,
    reading: &Reading<T>,
) -> Offset<T, 3> {
    black_box(compensator.update(model, pose, tip_m, reading))
}

#[inline(never)]
fn counted_axes<T: Scalar>(
    compensator: &mut Compensator<T, 5>,
    (model, wrist): (&Model<'_, T>, &Wrist<T>),
    stands: &Configuration<T>,
    reading: &Reading<T>,
) -> Offset<T, 5> {
    black_box(compensator.update(model, wrist, stands, reading))
}

/// Has both carry a platform and a tool.
fn carry<T: Scalar>(
    (model, wrist): (&Model<'_, T>, &Wrist<T>),
    tip_m: Vector3<T>,
    screws: &mut Compensator<T, 3>,
    axes: &mut Compensator<T, 5>,
) {
    let pose = Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) };
    let home = Configuration { pose, beta_rad: Vector2::zeros() };
    let weight = |force_n: [f64; 3], centre_m: [f64; 3]| Weight {
        force_n: force_n.map(T::from_f64).into(),
        centre_m: centre_m.map(T::from_f64).into(),
    };
    let platform = weight([100.0, -20.0, -700.0], [0.02, 0.01, 0.1]);
    let tool = weight([30.0, -6.0, -210.0], [0.1, 0.0, -0.2]);
    let of_screws = CarriedWeight::<T, 3>::new(model, &platform, &pose, tip_m);
    screws.set_weight(Some(of_screws.expect("a weight")));
    axes.set_weight(Some(CarriedWeight::<T, 5>::new(model, wrist, &platform, &tool, &home).expect("weights")));
}

fn updates<T: Scalar>(with: (&Model<'_, T>, &Wrist<T>), is_heavy: bool, mut state: u32, updates: usize) {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let mut screws = Compensator::<T, 3>::new(&settings).expect("settings");
    let mut axes = Compensator::<T, 5>::new(&settings).expect("settings");
    let tip_m = [0.01, -0.02, 0.3].map(T::from_f64).into();
    if is_heavy {
        carry(with, tip_m, &mut screws, &mut axes);
    }
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
        counted_screws(&mut screws, with.0, &stands.pose, tip_m, &reading);
        count_from_here();
        counted_axes(&mut axes, with, &stands, &reading);
    }
}

fn main() {
    // of a plain `cargo bench` there are none, and nothing to do
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [width, seed, count, rest @ ..] = arguments.as_slice() else { return };
    let is_heavy = rest.first().is_some_and(|word| word == "weight");
    let (seed, count) = (seed.parse().expect("a seed"), count.parse().expect("a number of updates"));
    match width.as_str() {
        "f64" => updates((&Model::new(&MACHINE_F64, &TABLE_F64), &WRIST_F64), is_heavy, seed, count),
        "f32" => updates((&Model::new(&MACHINE_F32, &TABLE_F32), &WRIST_F32), is_heavy, seed, count),
        _ => panic!("f64 or f32"),
    }
}

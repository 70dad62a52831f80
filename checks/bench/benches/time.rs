//! Time and cycles of the core's functions, to look at; limits stand in `instructions.rs`.
//!
//! `cargo bench -p pkm-bench --features time --bench time`, with `-- cycles` for cycles (x86-64's time stamp counter).

#![allow(missing_docs)] // the macros make items without any

use std::hint::black_box;

use criterion::measurement::Measurement;
use criterion::{Criterion, criterion_group, criterion_main};
use criterion_cycles_per_byte::CyclesPerByte;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64};
use pkm_core::{CorrectionTable, Machine, Pose, Scalar, Wrench};

fn functions<M: Measurement, T: Scalar>(
    c: &mut Criterion<M>,
    group: &str,
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
) {
    let pose = Pose { theta_rad: T::from_f64(0.1), sigma_rad: T::from_f64(-0.05), z0_m: T::from_f64(0.53) };
    let wrench = Wrench::from_vector([100.0, -50.0, -400.0, 2.0, -8.0, 5.0].map(T::from_f64).into());
    let lengths = machine.inverse(&pose).unwrap();
    let corrected = table.factor_form(machine, &pose).unwrap();
    let mut group = c.benchmark_group(group);
    group.bench_function("ik", |b| b.iter(|| machine.inverse(black_box(&pose))));
    group.bench_function("fk", |b| b.iter(|| machine.forward(black_box(&lengths))));
    group.bench_function("k_p", |b| b.iter(|| machine.stiffness(black_box(&pose))));
    group.bench_function("k_m", |b| b.iter(|| table.factor_form(machine, black_box(&pose))));
    group.bench_function("deflection", |b| b.iter(|| corrected.factor.deflection(black_box(&wrench))));
    group.finish();
}

fn time(c: &mut Criterion) {
    functions(c, "time f64", &MACHINE_F64, &TABLE_F64);
    functions(c, "time f32", &MACHINE_F32, &TABLE_F32);
}

fn cycles(c: &mut Criterion<CyclesPerByte>) {
    functions(c, "cycles f64", &MACHINE_F64, &TABLE_F64);
    functions(c, "cycles f32", &MACHINE_F32, &TABLE_F32);
}

criterion_group!(times, time);
criterion_group!(name = cycle_counts; config = Criterion::default().with_measurement(CyclesPerByte); targets = cycles);
criterion_main!(times, cycle_counts);

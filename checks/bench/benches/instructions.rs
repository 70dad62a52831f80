//! Instructions of the core's functions on x86-64, by callgrind: the project's measure of speed.
//!
//! `cargo bench -p pkm-bench --bench instructions` (needs valgrind and `cargo install gungraun-runner`).
//! A count above its limit fails the run.

#![allow(missing_docs)] // the macros make items without any

use std::hint::black_box;

use gungraun::prelude::*;
use gungraun::{Callgrind, EventKind};
use nalgebra::{Cholesky, Matrix6, U6, Vector2, Vector3, Vector6};
use pkm_core::compensator::{Compensator, CompensatorSettings, Offset, Reading};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{
    CompensatedTool, Configuration, Corrected, Cycle, Deflection, FiveAxis, Machine, Model, Pose, Scalar, ScrewLengths,
    Stiffness, StiffnessFactor, Tool, ToolFrame, ToolSolution, Wrench,
};

fn pose<T: Scalar>() -> Pose<T> {
    Pose { theta_rad: T::from_f64(0.1), sigma_rad: T::from_f64(-0.05), z0_m: T::from_f64(0.53) }
}

fn lengths<T: Scalar>(machine: &Machine<T>) -> ScrewLengths<T> {
    machine.inverse(&pose()).unwrap()
}

fn wrench<T: Scalar>() -> Wrench<T> {
    Wrench::from_vector([100.0, -50.0, -400.0, 2.0, -8.0, 5.0].map(T::from_f64).into())
}

macro_rules! counts {
    ($t:ty, $machine:ident, $table:ident, $ik:ident, $fk:ident, $k_p:ident, $k_m:ident, $load:ident, $cycle:ident) => {
        #[library_benchmark]
        #[bench::reference(pose())]
        fn $ik(p: Pose<$t>) -> ScrewLengths<$t> {
            black_box($machine.inverse(&black_box(p))).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(lengths(&$machine))]
        fn $fk(q: ScrewLengths<$t>) -> Pose<$t> {
            black_box($machine.forward(&black_box(q))).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(pose())]
        fn $k_p(p: Pose<$t>) -> Stiffness<$t> {
            black_box($machine.stiffness(&black_box(p))).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(pose())]
        fn $k_m(p: Pose<$t>) -> Corrected<$t> {
            black_box($table.factor_form(&$machine, &black_box(p))).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(pose())]
        fn $load(p: Pose<$t>) -> Deflection<$t> {
            let corrected = $table.factor_form(&$machine, &black_box(p)).unwrap();
            black_box(corrected.factor.deflection(&wrench())).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(pose())]
        fn $cycle(p: Pose<$t>) -> Cycle<$t> {
            let tip = Vector3::new(0.01, -0.02, 0.3);
            black_box($table.cycle(&$machine, &black_box(p), &black_box(wrench()), black_box(tip))).unwrap()
        }
    };
}

counts!(f64, MACHINE_F64, TABLE_F64, ik_f64, fk_f64, k_p_f64, k_m_f64, k_m_and_deflection_f64, cycle_f64);
counts!(f32, MACHINE_F32, TABLE_F32, ik_f32, fk_f32, k_p_f32, k_m_f32, k_m_and_deflection_f32, cycle_f32);

/// θ, σ, β1, β2 in rad and Z0 in m of where a machine stands on a path.
const STANDS: [[f64; 5]; 5] = [
    [0.0, 0.0, 0.0, 0.0, 0.53],
    [0.1, -0.05, 0.3, -0.2, 0.53],
    [-0.2, 0.15, -0.5, 0.3, 0.51],
    [0.25, 0.25, 0.8, -0.6, 0.55],
    [-0.1, -0.2, 1.2, -0.4, 0.54],
];

fn stand<T: Scalar>(number: usize) -> Configuration<T> {
    let [theta_rad, sigma_rad, beta1, beta2, z0_m] = STANDS[number].map(T::from_f64);
    Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad: Vector2::new(beta1, beta2) }
}

/// Where a machine stands, and the tool of the next point of its path: 1 mm and 0.1° on.
fn step<T: Scalar>(five: &FiveAxis<'_, T>, number: usize) -> (Tool<T>, Configuration<T>) {
    let near = stand(number);
    let ToolFrame { tip_m, axes } = five.frame(&near).unwrap();
    let (along, turn) = (T::from_f64(1e-3 / 3_f64.sqrt()), T::from_f64(0.1_f64.to_radians()));
    (Tool { tip_m: tip_m.add_scalar(along), axis: axes.column(2) + axes.column(0) * turn }, near)
}

fn frame<T: Scalar>(five: &FiveAxis<'_, T>) -> ToolFrame<T> {
    five.frame(&stand(1)).unwrap()
}

/// A compensator, and a period's reading for it.
fn switched_on<T: Scalar, const JOINTS: usize>() -> (Compensator<T, JOINTS>, Reading<T>) {
    let reading = Reading { enabled: true, wrench: wrench(), rise: T::ONE.into() };
    (Compensator::new(&CompensatorSettings::DEFAULT).unwrap(), reading)
}

macro_rules! five_axes {
    ($t:ty, $machine:ident, $table:ident, $wrist:ident, $five:ident, $warm:ident, $given:ident, $whole:ident, $loaded:ident,
     $screws:ident, $axes:ident) => {
        const $five: FiveAxis<'static, $t> = FiveAxis { machine: &$machine, wrist: &$wrist };

        #[library_benchmark]
        #[bench::home(step(&$five, 0))]
        #[bench::reference(step(&$five, 1))]
        #[bench::third(step(&$five, 2))]
        #[bench::corner(step(&$five, 3))]
        #[bench::turned(step(&$five, 4))]
        fn $warm(step: (Tool<$t>, Configuration<$t>)) -> ToolSolution<$t> {
            let (tool, near) = black_box(step);
            black_box($five.inverse(&tool, &near)).unwrap()
        }

        #[library_benchmark]
        #[bench::home(step(&$five, 0))]
        #[bench::corner(step(&$five, 3))]
        fn $given(step: (Tool<$t>, Configuration<$t>)) -> ToolSolution<$t> {
            let (tool, near) = black_box(step);
            black_box($five.inverse_at(tool.tip_m, near.beta_rad)).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(frame(&$five))]
        fn $whole(frame: ToolFrame<$t>) -> ToolSolution<$t> {
            black_box($five.inverse_frame(&black_box(frame))).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(step(&$five, 1))]
        fn $loaded(step: (Tool<$t>, Configuration<$t>)) -> CompensatedTool<$t> {
            let ((tool, near), load) = (black_box(step), black_box(wrench()));
            black_box($five.compensated(Some(&$table), &tool, &load, &near)).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(switched_on())]
        fn $screws(on: (Compensator<$t, 3>, Reading<$t>)) -> Offset<$t, 3> {
            let (mut compensator, reading) = black_box(on);
            black_box(compensator.update(
                &Model::new(&$machine, &$table),
                &black_box(pose()),
                black_box(Vector3::new(0.01, -0.02, 0.3)),
                &reading,
            ))
        }

        #[library_benchmark]
        #[bench::home(switched_on(), stand(0))]
        #[bench::corner(switched_on(), stand(3))]
        #[bench::turned(switched_on(), stand(4))]
        fn $axes(on: (Compensator<$t, 5>, Reading<$t>), stands: Configuration<$t>) -> Offset<$t, 5> {
            let (mut compensator, reading) = black_box(on);
            black_box(compensator.update(&Model::new(&$machine, &$table), $five.wrist, &black_box(stands), &reading))
        }
    };
}

five_axes!(
    f64,
    MACHINE_F64,
    TABLE_F64,
    WRIST_F64,
    FIVE_F64,
    inverse_tool_f64,
    inverse_at_f64,
    inverse_frame_f64,
    compensated_tool_f64,
    compensate_f64,
    compensate_tool_f64
);
five_axes!(
    f32,
    MACHINE_F32,
    TABLE_F32,
    WRIST_F32,
    FIVE_F32,
    inverse_tool_f32,
    inverse_at_f32,
    inverse_frame_f32,
    compensated_tool_f32,
    compensate_f32,
    compensate_tool_f32
);

/// K_p, for the core's factor and deflection beside nalgebra's.
fn stiffness<T: Scalar>(machine: &Machine<T>) -> Stiffness<T> {
    machine.stiffness(&pose()).unwrap()
}

macro_rules! kernels {
    ($t:ty, $machine:ident, $factor:ident, $deflection:ident, $factor_nalgebra:ident, $deflection_nalgebra:ident) => {
        #[library_benchmark]
        #[bench::reference(stiffness(&$machine))]
        fn $factor(k: Stiffness<$t>) -> StiffnessFactor<$t> {
            black_box(black_box(&k).factor()).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(stiffness(&$machine).factor().unwrap())]
        fn $deflection(factor: StiffnessFactor<$t>) -> Deflection<$t> {
            black_box(black_box(factor).deflection(&black_box(wrench()))).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(stiffness(&$machine).matrix())]
        fn $factor_nalgebra(k: Matrix6<$t>) -> Cholesky<$t, U6> {
            black_box(black_box(k).cholesky()).unwrap()
        }

        #[library_benchmark]
        #[bench::reference(stiffness(&$machine).matrix().cholesky().unwrap())]
        fn $deflection_nalgebra(factor: Cholesky<$t, U6>) -> Vector6<$t> {
            black_box(black_box(factor).solve(&black_box(wrench()).to_vector()))
        }
    };
}

kernels!(f64, MACHINE_F64, factor_f64, deflection_f64, factor_nalgebra_f64, deflection_nalgebra_f64);
kernels!(f32, MACHINE_F32, factor_f32, deflection_f32, factor_nalgebra_f32, deflection_nalgebra_f32);

// The paper's way has to invert a dense matrix of 24 rows.
#[library_benchmark]
#[bench::well_conditioned(nalgebra::SMatrix::<f64, 24, 24>::from_fn(|i, j| if i == j { 30.0 } else { 1.0 / (1 + i + j) as f64 }))]
fn dense_24x24_inverse_nalgebra(k: nalgebra::SMatrix<f64, 24, 24>) -> nalgebra::SMatrix<f64, 24, 24> {
    black_box(black_box(k).try_inverse()).unwrap()
}

fn at_most(instructions: u64) -> LibraryBenchmarkConfig {
    LibraryBenchmarkConfig::default().tool(Callgrind::default().hard_limits([(EventKind::Ir, instructions)])).clone()
}

library_benchmark_group!(name = inverse, config = at_most(400), benchmarks = [ik_f64, ik_f32]);
library_benchmark_group!(name = forward, config = at_most(700), benchmarks = [fk_f64, fk_f32]);
library_benchmark_group!(name = basic, config = at_most(1200), benchmarks = [k_p_f64, k_p_f32]);
library_benchmark_group!(
    name = corrected,
    config = at_most(3200),
    benchmarks = [k_m_f64, k_m_f32, k_m_and_deflection_f64, k_m_and_deflection_f32]
);
library_benchmark_group!(name = cycle, config = at_most(4000), benchmarks = [cycle_f64, cycle_f32]);
library_benchmark_group!(name = tool, config = at_most(4000), benchmarks = [inverse_tool_f64, inverse_tool_f32]);
library_benchmark_group!(name = given, config = at_most(2600), benchmarks = [inverse_at_f64, inverse_at_f32]);
library_benchmark_group!(name = frame, config = at_most(11500), benchmarks = [inverse_frame_f64, inverse_frame_f32]);
library_benchmark_group!(
    name = loaded,
    config = at_most(20000),
    benchmarks = [compensated_tool_f64, compensated_tool_f32]
);
library_benchmark_group!(name = compensator, config = at_most(4800), benchmarks = [compensate_f64, compensate_f32]);
library_benchmark_group!(
    name = tool_compensator,
    config = at_most(15000),
    benchmarks = [compensate_tool_f64, compensate_tool_f32]
);
library_benchmark_group!(
    name = kernels,
    config = at_most(560),
    benchmarks = [factor_f64, deflection_f64, factor_f32, deflection_f32]
);
library_benchmark_group!(
    name = peer,
    benchmarks = [
        factor_nalgebra_f64,
        deflection_nalgebra_f64,
        factor_nalgebra_f32,
        deflection_nalgebra_f32,
        dense_24x24_inverse_nalgebra
    ]
);
main!(
    library_benchmark_groups = [
        inverse,
        forward,
        basic,
        corrected,
        cycle,
        tool,
        given,
        frame,
        loaded,
        compensator,
        tool_compensator,
        kernels,
        peer
    ]
);

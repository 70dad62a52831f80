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
use pkm_core::compensator::{
    CarriedWeight, Compensator, CompensatorSettings, OutsideBox, Reading, Weight, WeightError,
};
use pkm_core::correction::TableWatch;
use pkm_core::estimation::{Estimator, TipReading, Touch};
use pkm_core::nalgebra::{Vector2, Vector3, Vector6};
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64, UNCERTAINTY_F32, UNCERTAINTY_F64, WRIST_F32, WRIST_F64,
};
use pkm_core::{
    Configuration, CorrectionTable, FiveAxis, Model, Pose, Scalar, TableUncertainty, Tool, ToolError, ToolFrame,
    ToolMotion, Wrench,
};

#[path = "../learned.rs"]
mod learned;
#[path = "../panic.rs"]
mod panic;
#[path = "../semihosting.rs"]
mod semihosting;

/// SysTick's ticks while `f` runs.
#[inline(never)]
fn ticks<R>(f: impl FnOnce() -> R) -> u32 {
    let before = SYST::get_current();
    black_box(&f());
    before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff
}

/// Of the tool, in A-uvw.
const TIP_M: [f64; 3] = [0.01, -0.02, 0.3];
/// No update takes so long with floating-point hardware: 30,000 instructions.
const TICKS_IN_SOFTWARE: u32 = 30_000 * 128 / 40;

#[derive(Clone, Copy)]
struct Count {
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

/// Moves the tool that way.
fn motion_along<T: Scalar>(tool: &Tool<T>, frame: &ToolFrame<T>) -> ToolMotion<T> {
    ToolMotion {
        tip_m_per_s: tool.tip_m,
        axis_per_s: across(frame),
        tip_m_per_s2: tool.tip_m,
        axis_per_s2: across(frame),
    }
}

/// Compensators of three screws and of five axes that go on beyond the box.
fn compensators<T: Scalar>() -> Result<(Compensator<T, 3>, Compensator<T, 5>), ToolError> {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    match (Compensator::new(&settings), Compensator::new(&settings)) {
        (Ok(screws), Ok(axes)) => Ok((screws, axes)),
        _ => Err(ToolError::NotFinite),
    }
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

/// Where doubles are computed in software an update takes many times as long, and fewer poses have to do.
const POSES: u32 = 100_000;
const POSES_IN_SOFTWARE: u32 = 100;

/// What the machine carries: of three screws, of five axes.
type Carried<T> = (CarriedWeight<T, 3>, CarriedWeight<T, 5>);

fn carried<T: Scalar>(
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
    tip_m: Vector3<T>,
) -> Result<Carried<T>, WeightError> {
    let home = Configuration {
        pose: Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) },
        beta_rad: Vector2::zeros(),
    };
    let weight = |force_n: [f64; 3], centre_m: [f64; 3]| Weight {
        force_n: force_n.map(T::from_f64).into(),
        centre_m: centre_m.map(T::from_f64).into(),
    };
    let platform = weight([100.0, -20.0, -700.0], [0.02, 0.01, 0.1]);
    let tool = weight([30.0, -6.0, -210.0], [0.1, 0.0, -0.2]);
    let model = &Model::new(five.machine, table);
    let of_screws = CarriedWeight::<T, 3>::new(model, &platform, &home.pose, tip_m)?;
    Ok((of_screws, CarriedWeight::<T, 5>::new(model, five.wrist, &platform, &tool, &home)?))
}

/// Ticks of the costliest updates of compensators of three screws and of five axes, without and with what the machine carries, at poses
/// all over the box and beyond, under loads that go and turn.
fn worst_updates<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>) -> Result<[u32; 4], ToolError> {
    let (mut screws, mut axes) = compensators()?;
    let model = &black_box(Model::new(five.machine, table));
    let tip = TIP_M.map(T::from_f64).into();
    let (mut heavy_screws, mut heavy_axes) = (screws, axes);
    let Ok((of_screws, of_axes)) = carried(five, table, tip) else { return Err(ToolError::NotFinite) };
    heavy_screws.set_weight(Some(of_screws));
    heavy_axes.set_weight(Some(of_axes));
    let mut state = 1_u32;
    // from -1 to 1: the upper bits of a linear congruence
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        T::from_f64(f64::from(state >> 8) / f64::from(1 << 23) - 1.0)
    };
    let mut greatest = [0; 4];
    let mut poses = POSES;
    let mut done = 0;
    while done < poses {
        let mut within = |middle: f64, half: f64| T::from_f64(middle) + T::from_f64(half) * random();
        let pose = Pose { theta_rad: within(0.0, 0.27), sigma_rad: within(0.0, 0.27), z0_m: within(0.53, 0.032) };
        let beta_rad = Vector2::new(within(0.0, 1.2), within(-0.3, 0.3));
        let wrench = [500.0, 500.0, 500.0, 50.0, 50.0, 50.0].map(|half| within(0.0, half));
        let reading = &black_box(Reading {
            enabled: true,
            wrench: Wrench::from_vector(wrench.into()),
            rise: within(0.0, 20.0).into(),
        });
        let stands = &black_box(Configuration { pose, beta_rad });
        let each = [
            ticks(|| screws.update(model, &stands.pose, tip, reading)),
            ticks(|| axes.update(model, five.wrist, stands, reading)),
            ticks(|| heavy_screws.update(model, &stands.pose, tip, reading)),
            ticks(|| heavy_axes.update(model, five.wrist, stands, reading)),
        ];
        if each[0] > TICKS_IN_SOFTWARE {
            poses = POSES_IN_SOFTWARE;
        }
        for (greatest, ticks) in greatest.iter_mut().zip(each) {
            *greatest = ticks.max(*greatest);
        }
        done += 1;
    }
    Ok(greatest)
}

/// The greatest count of each function over poses of the box.
fn count<T: Scalar>(
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
    uncertainty: &TableUncertainty<T>,
) -> Result<[Count; 20], ToolError> {
    let (machine, number) = (five.machine, T::from_f64);
    let wrench = Wrench::from_vector([100.0, -50.0, -400.0, 2.0, -8.0, 5.0].map(number).into());
    let tip = TIP_M.map(number).into();
    let [compensate, compensate_tool, compensate_weight, compensate_tool_weight] = worst_updates(five, table)?;
    let (mut compensator, mut tool_compensator) = compensators()?;
    let model = &black_box(Model::new(machine, table));
    let Ok(mut estimator) = Estimator::<T, 6>::new(&learned::SETTINGS) else { return Err(ToolError::NotFinite) };
    let reading = black_box(Reading { enabled: true, wrench, rise: number(1.0).into() });
    let amplitudes = &black_box(estimator.amplitudes());
    let mut watch = TableWatch::new(0);
    let mut time_s = 0;
    let mut counts = [Count { name: "", greatest: 0 }; 20];
    let angles = [-0.2618, -0.13, 0.05, 0.2618];
    for (theta, sigma) in angles.into_iter().flat_map(|theta| angles.map(|sigma| (theta, sigma))) {
        for z0 in [0.5, 0.53, 0.56] {
            let pose = Pose { theta_rad: number(theta), sigma_rad: number(sigma), z0_m: number(z0) };
            let beta_rad = Vector2::new(number(-3.0 * sigma), number(2.0 * theta));
            let near = &black_box(Configuration { pose, beta_rad });
            let (tool, frame, pose) = (&step(five, near)?, &five.frame(near)?, &near.pose);
            let motion = &black_box(motion_along(tool, frame));
            let known = machine.stiffness(pose).and_then(|k| k.factor()).and_then(|f| f.deflection(&wrench));
            let (Ok(known), Ok(moved)) = (known, machine.sensitivities(pose, &wrench, amplitudes)) else {
                return Err(ToolError::NotFinite);
            };
            time_s += 600;
            let touch = &black_box(Touch { time_s, pose: *pose, tip_m: tip, wrench, rise_k: T::ZERO });
            let readings = &black_box([Vector6::x(), Vector6::y(), Vector6::z()].map(|direction| TipReading {
                direction,
                read: direction.dot(&known.seen_at(tip).to_vector()),
                deviation: number(1e-6),
            }));
            let empty = ticks(|| ());
            let plain = ticks(|| compensator.update(model, pose, tip, &reading));
            let cycle = ticks(|| table.cycle(machine, pose, &wrench, tip));
            let with_u95 = ticks(|| table.cycle_known(machine, uncertainty, pose, &wrench, tip));
            let table_u95 = with_u95.saturating_sub(cycle) + empty;
            let knowing = &black_box(model.with_uncertainty(uncertainty));
            let in_doubt = ticks(|| compensator.update(knowing, pose, tip, &reading));
            let learning = &black_box(model.with_learned(&estimator));
            let learned = ticks(|| compensator.update(learning, pose, tip, &reading));
            let tool_learned = ticks(|| tool_compensator.update(learning, five.wrist, near, &reading));
            let each = [
                ("inverse", ticks(|| machine.inverse(pose))),
                ("k_p", ticks(|| machine.stiffness(pose))),
                ("k_m", ticks(|| table.factor_form(machine, pose))),
                ("cycle", cycle),
                ("tool", ticks(|| five.inverse(tool, near))),
                ("tool_frame", ticks(|| five.inverse_frame(frame))),
                ("tool_cycle", ticks(|| five.compensated(Some(table), tool, &wrench, near))),
                ("compensate", compensate),
                ("compensate_tool", compensate_tool),
                ("compensate_weight", compensate_weight),
                ("compensate_tool_weight", compensate_tool_weight),
                ("compensated_tool", worst_compensation(five, table, near)?),
                ("rates", ticks(|| five.joint_motion(near, motion))),
                ("absorb", ticks(|| estimator.absorb(touch, &known, &moved, readings))),
                ("u95", learned.saturating_sub(plain) + empty),
                ("compensate_learned", learned),
                ("compensate_tool_learned", tool_learned),
                ("table_u95", table_u95),
                ("known", in_doubt.saturating_sub(plain) + empty),
                ("watch", ticks(|| watch.look(table))),
            ];
            for (count, (name, ticks)) in counts.iter_mut().zip(each) {
                *count = Count { name, greatest: count.greatest.max((ticks - empty) * 40 / 128) };
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
    let double = count(&FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 }, &TABLE_F64, &UNCERTAINTY_F64);
    let single = count(&FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 }, &TABLE_F32, &UNCERTAINTY_F32);
    for (bits, counts) in [(64, double.map_err(drop)?), (32, single.map_err(drop)?)] {
        for Count { name, greatest } in counts {
            writeln!(out, "{name}_f{bits} {greatest}").map_err(drop)?;
        }
    }
    Ok(())
}

#[entry]
fn main() -> ! {
    semihosting::end(run().is_ok())
}

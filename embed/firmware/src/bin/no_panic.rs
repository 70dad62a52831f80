//! Proof that the core has no reachable panic: this image links only if the optimiser removed every one.
//!
//! The panic handler calls a function that does not exist. Every public function of the core that runs on a controller is called in `f64`
//! and `f32` with values that the compiler can't know. `planted_panic.rs`, which has one, must not link:
//! the test of the test. `cargo xtask no-panic` does both.

#![no_std]
#![no_main]

use core::fmt::Write as _;
use core::hint::black_box;

use cortex_m as _;
use cortex_m_rt::entry;
use pkm_core::checksum;
use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, LoopGain, Reading, Weight};
use pkm_core::correction::{
    TableBuffer, TableHeader, TableUncertainty, TableWatch, TransferError, UNCERTAINTY_SPREAD, narrow, spread_terms,
};
use pkm_core::effects::{EFFECTS, Element, Law, MachineScales, Motion, Place};
use pkm_core::estimation::{Amplitude, Estimator, TipReading, Touch, newest, state_bytes};
use pkm_core::five_axis::rest_to_rest_s;
use pkm_core::kinematics::platform_axes;
use pkm_core::nalgebra::{Matrix3, Matrix6, Vector2, Vector3, Vector6};
use pkm_core::self_test::{SelfTestMemory, self_test_f32, self_test_f64};
use pkm_core::stiffness::LoadHistory;
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, UNCERTAINTY_F32, UNCERTAINTY_F64, WRIST, WRIST_F32,
    WRIST_F64,
};
use pkm_core::{
    Basis, Configuration, CorrectionTable, Deflection, FiveAxis, JointValues, LimbFrame, Machine, Model, Pose, Scalar,
    ScrewLengths, Stiffness, Tool, ToolFrame, ToolMotion, Wrench, Wrist,
};

#[path = "../handler.rs"]
mod handler;
#[path = "../learned.rs"]
mod learned;

/// Takes formatted errors and forgets them.
struct Sink;

impl core::fmt::Write for Sink {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        black_box(text);
        Ok(())
    }
}

fn show(error: impl core::fmt::Display) {
    let _ = write!(Sink, "{error}");
}

fn call_everything<T: Scalar>(machine: &Machine<T>, table: &CorrectionTable<'_, T>, basis: &Basis<'_, T>) {
    let [a, b, c] = black_box([T::ONE; 3]);
    let pose = black_box(Pose { theta_rad: a, sigma_rad: b, z0_m: c });
    let (vector, other) = (Vector3::new(a, b, c), Vector3::new(c, b, a));
    let lengths = black_box(ScrewLengths { q_m: vector });
    let wrench = Wrench::from_vector(black_box(Wrench { force_n: vector, moment_nm: other }).to_vector());
    let wrench = wrench.moved_to_a(vector);
    black_box(pose.a_in_b_m());
    if let Err(e) = black_box(machine.inverse(&pose)) {
        show(e);
    }
    black_box(machine.forward(&lengths)).ok();
    black_box(machine.jacobian(&pose)).ok();
    black_box(machine.singularity_distance(&pose)).ok();
    let _ = black_box(machine.travel_margin_m(&lengths));
    black_box(machine.stiffness(&pose)).ok();
    if let Ok(transmitted) = machine.transmission(&pose) {
        let [first, second, _] = black_box(transmitted).limbs;
        black_box(LimbFrame::tied([&first, &second], &vector));
    }
    black_box(machine.load_dependent_deflection(&pose, &wrench, &black_box(wrench))).ok();
    black_box(machine.deflection(Some(table), &pose, &wrench, &black_box(wrench))).ok();
    black_box(machine.deflection(None, &pose, &wrench, &black_box(wrench))).ok();
    if let Ok(response) = machine.load_response(&black_box(pose)) {
        black_box(response.deflection(&black_box(wrench), &black_box(wrench))).ok();
        let mut history = black_box(LoadHistory::new());
        black_box(response.deflection_after(&black_box(wrench), &mut history)).ok();
        black_box(history);
    }
    black_box(machine.thermal_deflection(&pose, a)).ok();
    match black_box(machine.at_temperature(b)) {
        Ok(warm) => _ = black_box(warm.stiffness(&pose)),
        Err(e) => show(e),
    }
    let stiffness = Stiffness::from_lower(&black_box(Matrix6::repeat(a)));
    black_box((stiffness.matrix(), stiffness.principal()));
    if let Ok(factor) = stiffness.factor() {
        black_box((factor.stiffness(), factor.lower()));
        black_box(table.corrected(&factor, &pose)).ok();
        if let Ok(deflection) = factor.deflection(&wrench) {
            let seen = deflection.plus(&deflection).seen_at(vector);
            black_box(Deflection::from_vector(black_box(seen.to_vector())));
            if let Err(e) = black_box(machine.compensated(&pose, &deflection, vector)) {
                show(e);
            }
        }
    }
    let _ = black_box((table.domain(&pose), basis.domain(&pose)));
    black_box(basis.monomials(&pose));
    black_box((table.coefficients(&pose), table.has_factor_form()));
    if let Err(e) = black_box(table.diagonal_form(machine, &pose)) {
        show(e);
    }
    if let Err(e) = black_box(table.factor_form(machine, &pose)) {
        show(e);
    }
    if let Err(e) = black_box(table.cycle(machine, &pose, &wrench, vector)) {
        show(e);
    }
    if let Ok(factor) = stiffness.factor() {
        black_box(LoopGain::new(&factor, vector, a, b)).ok();
    }
    match Compensator::<T, 3>::new(&black_box(CompensatorSettings::DEFAULT)) {
        Err(e) => show(e),
        Ok(mut compensator) => {
            let reading = black_box(Reading { enabled: true, wrench, rise: a.into() });
            let weight = black_box(Weight { force_n: vector, centre_m: other });
            let model = black_box(Model::new(machine, table));
            match CarriedWeight::<T, 3>::new(&model, &weight, &pose, vector) {
                Ok(carried) => compensator.set_weight(Some(black_box(carried))),
                Err(e) => show(e),
            }
            if let Some(fault) = black_box(compensator.update(&model, &pose, vector, &reading)).fault {
                show(fault);
            }
            black_box(compensator.joints());
            compensator.reset();
        }
    }
}

/// A table with its uncertainty, from the program and from numbers at run time.
macro_rules! call_uncertainty {
    ($t:ident, $machine:expr, $table:expr, $uncertainty:ident) => {{
        let [a, b, c] = black_box([1.0 as $t; 3]);
        let (pose, tip_m) = (Pose { theta_rad: a, sigma_rad: b, z0_m: c }, Vector3::new(a, b, c));
        let wrench = Wrench { force_n: tip_m, moment_nm: tip_m };
        let built = TableUncertainty::<$t>::new(black_box([a; UNCERTAINTY_SPREAD]), a, black_box([[b; 21]; 4]));
        for uncertainty in [black_box($uncertainty), built.unwrap_or_else(|e| black_box((show(e), $uncertainty)).1)] {
            black_box(uncertainty.checksum());
            match black_box($table.cycle_known($machine, &uncertainty, &pose, &wrench, tip_m)) {
                Err(e) => show(e),
                Ok(known) => {
                    let factor = &known.cycle.corrected.factor;
                    black_box($table.tip_uncertainty(&uncertainty, factor, &pose, &wrench, tip_m)).ok();
                    black_box(uncertainty.of_tip(factor, black_box([a, b, c]), &wrench, tip_m)).ok();
                    black_box($table.stiffness_u95(&uncertainty, factor, &pose));
                    black_box((known.uncertainty.known_share(&tip_m), known.uncertainty.u95_m()));
                }
            }
            black_box(spread_terms(black_box([a, b, c])));
        }
    }};
}

fn call_five_axes<T: Scalar>(machine: &Machine<T>, table: &CorrectionTable<'_, T>, wrist: &Wrist<T>) {
    black_box(wrist.arm_m(black_box(T::ZERO), black_box(T::ONE)));
    black_box(platform_axes(black_box((T::ZERO, T::ONE)), black_box((T::ONE, T::ZERO))));
    let five = FiveAxis { machine, wrist };
    let [a, b, c] = black_box([T::ONE; 3]);
    let (vector, other, beta_rad) = (Vector3::new(a, b, c), Vector3::new(c, b, a), Vector2::new(a, b));
    black_box(wrist.wrench_at_a(beta_rad, &black_box(Wrench { force_n: vector, moment_nm: other })));
    let near = black_box(Configuration { pose: Pose { theta_rad: a, sigma_rad: b, z0_m: c }, beta_rad });
    let tool = black_box(Tool { tip_m: vector, axis: other });
    let frame = black_box(ToolFrame { tip_m: vector, axes: Matrix3::new(a, b, c, a, b, c, a, b, c) });
    let wrench = black_box(Wrench { force_n: vector, moment_nm: other });
    if let Err(e) = black_box(five.frame(&near)) {
        show(e);
    }
    black_box(five.tool(&near)).ok();
    black_box(five.forward(&black_box(JointValues { lengths: ScrewLengths { q_m: vector }, beta_rad }))).ok();
    black_box(five.joints(&near)).ok();
    black_box(five.normalised_determinant(&near)).ok();
    black_box(five.touch(&near, &wrench, black_box(7), a)).ok();
    black_box(near.base_axes());
    let motion = ToolMotion { tip_m_per_s: vector, axis_per_s: other, tip_m_per_s2: other, axis_per_s2: vector };
    if let Ok(joints) = black_box(five.joint_motion(&near, &black_box(motion))) {
        let limits = black_box([a, b, c, a, b]).into();
        black_box(joints.feed_share(&limits, &limits));
    }
    black_box(rest_to_rest_s(black_box(a), black_box(b), black_box(c)));
    black_box(five.inverse(&tool, &near)).ok();
    black_box(five.inverse_at(tool.tip_m, near.beta_rad)).ok();
    black_box(five.inverse_at_any_margin(tool.tip_m, near.beta_rad)).ok();
    black_box(five.search(&tool, &near)).ok();
    black_box(five.inverse_frame(&frame)).ok();
    black_box(five.tip_stiffness(&Stiffness::from_lower(&black_box(Matrix6::repeat(a))), &near)).ok();
    for table in [None, Some(table)] {
        black_box(five.deflection(table, &near, &wrench)).ok();
        if let Err(e) = black_box(five.compensated(table, &tool, &wrench, &near)) {
            show(e);
        }
        black_box(five.compensated_in_part(table, &tool, &wrench, black_box(a), &near)).ok();
    }
    black_box(self_test_f32(black_box(&mut SelfTestMemory::new()))).ok();
    black_box(self_test_f64(black_box(&mut SelfTestMemory::default()))).ok();
    black_box(CompensatorSettings::DEFAULT).check().ok();
    if let Ok(mut compensator) = Compensator::<T, 5>::new(&black_box(CompensatorSettings::DEFAULT)) {
        let reading = black_box(Reading { enabled: true, wrench, rise: a.into() });
        let [platform, tool] = black_box([Weight { force_n: wrench.force_n, centre_m: wrench.moment_nm }; 2]);
        let model = black_box(Model::new(machine, table));
        let carried = CarriedWeight::<T, 5>::new(&model, wrist, &platform, &tool, &near);
        compensator.set_weight(black_box(carried.ok()));
        black_box(compensator.update(&model, wrist, &near, &reading));
    }
}

/// An estimator that learns, is saved and goes on, and compensators that use it.
fn call_estimation<T: Scalar>(
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
    uncertainty: &TableUncertainty<T>,
) {
    let settings = black_box(learned::SETTINGS);
    settings.check().unwrap_or_else(show);
    let mut estimator = match Estimator::<T, 6>::new(&settings) {
        Ok(estimator) => estimator,
        Err(e) => return show(e),
    };
    let [a, b, c] = black_box([T::ONE; 3]);
    let (vector, pose) = (Vector3::new(a, b, c), Pose { theta_rad: a, sigma_rad: b, z0_m: c });
    let wrench = Wrench { force_n: vector, moment_nm: vector };
    let touch = black_box(Touch { time_s: 7, pose, tip_m: vector, wrench, rise_k: a });
    let reading = TipReading { direction: Vector6::repeat(a), read: b, deviation: c };
    if let Err(e) = black_box(estimator.learn(five.machine, Some(table), &touch, black_box(&[reading; 6]))) {
        show(e);
    }
    if let Ok(moved) = five.machine.sensitivities(&pose, &wrench, &estimator.amplitudes()) {
        let predicted = black_box(Deflection::ZERO);
        black_box(estimator.absorb(&touch, &predicted, &moved, black_box(&[reading; 3]))).ok();
        let tip = black_box(estimator.tip(&moved, vector));
        black_box((tip.known_share(&vector), tip.u95_m()));
    }
    estimator.follow(a);
    black_box((estimator.values(), estimator.applied(), estimator.targets(), estimator.alarms()));
    black_box((estimator.readings(), estimator.refused(), estimator.time_s(), estimator.changed_at()));
    black_box((estimator.began_s(), estimator.deviations_at(black_box(9))));
    black_box(Amplitude::compliance(black_box(Place::Base), black_box(Motion::X)));
    black_box(Amplitude::RISE.place());
    black_box(black_box(Amplitude::GAIN).shown(black_box(Deflection::<T>::ZERO), black_box(Deflection::ZERO)));
    let mut slot = [0; state_bytes(6)];
    if let Err(e) = estimator.save(black_box(1), black_box(2), black_box(&mut slot)) {
        show(e);
    }
    black_box(newest(black_box(6), black_box(&slot), black_box(&slot)));
    if let Err(e) = estimator.restore(black_box(1), black_box(&slot)) {
        show(e);
    }
    let reading = black_box(Reading { enabled: true, wrench, rise: a.into() });
    let model = Model::new(five.machine, table).with_uncertainty(uncertainty).with_learned(&estimator);
    if let Ok(mut compensator) = Compensator::<T, 3>::new(&CompensatorSettings::DEFAULT) {
        for model in black_box([model, Model { learned: None, ..model }]) {
            black_box(compensator.update(&model, &pose, vector, &reading));
        }
    }
    if let Ok(mut compensator) = Compensator::<T, 5>::new(&CompensatorSettings::DEFAULT) {
        let near = black_box(Configuration { pose, beta_rad: Vector2::new(a, b) });
        for model in black_box([model, Model { learned: None, ..model }]) {
            black_box(compensator.update(&model, five.wrist, &near, &reading));
        }
    }
}

/// A table that comes while the controller runs, and goes to another.
fn fill<T: Scalar>(buffer: &mut TableBuffer<T, 4>) -> Result<(), TransferError> {
    let header = black_box(TableHeader { machine: 1, table: 2, terms: 3, factor_form: true });
    buffer.begin(&header, black_box(1))?;
    for number in black_box(TABLE_F64).numbers() {
        buffer.push(number)?;
    }
    black_box(black_box(TABLE_F64).header(header.machine).numbers());
    buffer.finish()
}

/// Builds machine, basis, table and wrist at run time, and calls everything with them and with the generated ones.
macro_rules! call_everything {
    ($t:ident, $machine:ident, $table:ident, $uncertainty:ident, $wrist:ident, $parameters:ident, $wrist_parameters:ident) => {
        let (machine, table) = (black_box(&$machine), black_box(&$table));
        call_five_axes(machine, table, black_box(&$wrist));
        let five = FiveAxis { machine, wrist: black_box(&$wrist) };
        call_estimation(&five, table, black_box(&$uncertainty));
        call_uncertainty!($t, machine, table, $uncertainty);
        black_box((machine.checksum(), five.wrist.checksum(), table.checksum()));
        if let Err(damaged) = five.verify(table, &black_box(five.checksums(table))) {
            show(damaged);
        }
        if let Err(damaged) = black_box(&$uncertainty).verify(black_box($uncertainty.checksum())) {
            show(damaged);
        }
        match Wrist::<$t>::new(&$wrist_parameters) {
            Err(e) => show(e),
            Ok(wrist) => call_five_axes(machine, table, &wrist),
        }
        let mut buffer = TableBuffer::<$t, 4>::new();
        if let Err(e) = fill(&mut buffer) {
            show(e);
        }
        if let Some(table) = buffer.table() {
            black_box(table.factor_form(machine, black_box(&Pose { theta_rad: 0.1, sigma_rad: 0.1, z0_m: 0.5 }))).ok();
        }
        black_box((buffer.received(), *buffer.header(), buffer.is_intact()));
        let mut watch = buffer.watch().unwrap_or(TableWatch::new(table.checksum()));
        if let Err(damaged) = watch.look(table) {
            show(damaged);
        }
        let (numbers, terms) = black_box(([1.0 as $t; 64], [[1_u8; 3]; 4]));
        match Basis::<$t>::new([numbers[0]; 3], [numbers[1]; 3], black_box(&terms[..])) {
            Err(e) => show(e),
            Ok(basis) => {
                call_everything(machine, table, &basis);
                match CorrectionTable::<$t>::new(basis, black_box(&numbers[..]), Some(black_box(&numbers[..]))) {
                    Err(e) => show(e),
                    Ok(table) => call_everything(machine, &table, &basis),
                }
                match Machine::<$t>::new(&$parameters) {
                    Err(e) => show(e),
                    Ok(machine) => call_everything(&machine, table, &basis),
                }
            }
        }
    };
}

/// What an element's names say.
fn call_elements() {
    let (Some(place), Some(law)) = (Place::from_name(black_box("base")), Law::from_name(black_box("load"))) else {
        return;
    };
    black_box((place.name(), place.limb(), law.name(), law.depends_on_load()));
    for motion in place.motions() {
        black_box((motion.name(), motion.is_rotation(), motion.tied_to(), motion.is_tie()));
    }
    if let Some(element) =
        Element::from_names(black_box("tool"), black_box("u"), black_box("load"), black_box([1.0; 8]))
    {
        black_box(element.parameter_names());
    }
}

/// Machine, wrist and table in another number type.
macro_rules! call_conversions {
    ($t:ident) => {
        let machine: Machine<$t> = black_box(&MACHINE_F64).converted();
        let wrist: Wrist<$t> = black_box(&WRIST_F64).converted();
        let mut store: [$t; 512] = [0.0; 512];
        black_box((machine, wrist, black_box(&TABLE_F64).converted(&mut store).is_some()));
    };
}

#[entry]
fn main() -> ! {
    let parameters = black_box(PARAMETERS);
    black_box((parameters.check().is_ok(), parameters.checksum(), parameters.actual_geometry()));
    black_box(parameters.effects.with(black_box("preload"), black_box([1.0; 3])));
    black_box(EFFECTS.first().map(|effect| effect.names().len()));
    if let Some(effects) = parameters.effects.with_element(
        black_box("limb.1.body"),
        black_box("axial"),
        black_box("extension"),
        black_box([1.0; 8]),
    ) {
        black_box(effects);
    }
    black_box(checksum::over_text(checksum::START, black_box("text")));
    call_elements();
    let scales = black_box(MachineScales {
        axial_m_per_n: 1.0,
        across_m_per_n: 1.0,
        turning_rad_per_nm: 1.0,
        tilting_rad_per_nm: 1.0,
        arm_m: 1.0,
        b1_m: 1.0,
        shortest_m: 1.0,
        longest_m: 1.0,
        force_n: 1.0,
    });
    black_box(scales.gap_m(black_box(1.0), black_box(1.0)));
    let of_temperature = (parameters.effects.soften_with_temperature(), parameters.effects.grow_with_temperature());
    black_box((of_temperature, parameters.effects.preload_limbs()));
    black_box((parameters.effects.below_tool(), narrow(black_box(&[1.0; 8])), black_box(&TABLE_F64).checksum()));
    black_box(checksum::over_numbers(checksum::over_byte(checksum::START, black_box(1)), black_box(&[1.0; 3])));
    black_box(checksum::over_numbers_f32(checksum::START, black_box(&[1.0; 3])));
    let wrist = black_box(WRIST);
    black_box((wrist.check().is_ok(), wrist.checksum(), wrist.tip_at_zero_m()));
    call_conversions!(f32);
    call_conversions!(f64);
    call_everything!(f64, MACHINE_F64, TABLE_F64, UNCERTAINTY_F64, WRIST_F64, parameters, wrist);
    call_everything!(f32, MACHINE_F32, TABLE_F32, UNCERTAINTY_F32, WRIST_F32, parameters, wrist);
    loop {
        cortex_m::asm::wfi();
    }
}

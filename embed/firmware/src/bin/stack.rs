//! Measures the stack of every public function of the core that computes: paints it, calls, and looks how far down the
//! paint is gone. Prints `width name bytes` a line; `cargo xtask stack` holds it against this image's call graph.

#![no_std]
#![no_main]

use core::cell::RefCell;
use core::fmt::Write as _;
use core::hint::black_box;

use cortex_m::register::msp;
use cortex_m_rt::entry;
use cortex_m_semihosting::hio;
use pkm_core::effects::{EFFECTS, Effects};
use pkm_core::machine::MachineParameters;
use pkm_core::self_test::{SelfTestFault, SelfTestMemory, self_test_f32, self_test_f64};
use pkm_core::tables::reference::{PARAMETERS, WRIST};

#[path = "../handler.rs"]
mod handler;
#[path = "../learned.rs"]
mod learned;
#[path = "../semihosting.rs"]
mod semihosting;

/// Painted below the stack pointer: more than anything here may use.
const DEPTH: usize = 32 * 1024;
const PAINT: u32 = 0x5AFE_57AC;

/// Every effect on, a little, with a telescope of some length, and elements: all code is reached.
const EVERY_EFFECT: MachineParameters = {
    let mut effects = Effects::NONE;
    let mut i = 0;
    while i < EFFECTS.len() {
        let mut n = 0;
        while n < EFFECTS[i].parameters.len() {
            effects.parameters[i][n] = 1e-9;
            n += 1;
        }
        i += 1;
    }
    let Some(effects) = effects.with("telescopic-limb", [0.3, 0.3, 1e-9, 1e-9, 1e-9, 1e-9]) else {
        panic!("the effect has another name");
    };
    let Some(effects) = effects.with_element("limb.1.base_joint", "lateral", "constant", [1e-9]) else { panic!() };
    let Some(effects) = effects.with_element("limb.2.body", "tilting", "extension", [1e-9, 1e-9]) else { panic!() };
    let Some(effects) = effects.with_element("limb.3.body", "axial", "periodic", [0.0, 1e-9, 0.01]) else { panic!() };
    let Some(effects) = effects.with_element("limb.3.body", "tilting", "temperature", [1e-9]) else { panic!() };
    let Some(effects) = effects.with_element("limb.2.body", "axial", "load", [1e-9, 1e-12, 1e-12, 1e-15]) else {
        panic!()
    };
    let Some(effects) = effects.with_element("limb.3.body", "axial", "direction", [1e-9]) else { panic!() };
    let Some(effects) = effects.with_element("base", "coupled", "constant", [1e-6; 16]) else { panic!() };
    let Some(effects) = effects.with_element("tool", "coupled", "constant", [-1e-6; 7]) else { panic!() };
    MachineParameters { effects, ..PARAMETERS }
};

/// How much stack a call takes.
#[inline(never)]
fn measure(call: impl Fn()) -> usize {
    let top = msp::read() as usize & !3;
    let painted = || ((top - DEPTH)..top).step_by(4).map(|at| at as *mut u32);
    // SAFETY: RAM of the stack below the stack pointer; no interrupt is on, and nothing is called before it is painted
    painted().for_each(|word| unsafe { word.write_volatile(PAINT) });
    call();
    // SAFETY: as above
    let untouched = painted().take_while(|word| unsafe { word.read_volatile() } == PAINT).count();
    DEPTH - 4 * untouched
}

/// The self-test has a name for each width.
trait SelfTest: Sized {
    fn self_test(memory: &mut SelfTestMemory<Self>) -> Result<(), SelfTestFault>;
}

impl SelfTest for f32 {
    #[inline(always)]
    fn self_test(memory: &mut SelfTestMemory<Self>) -> Result<(), SelfTestFault> {
        self_test_f32(memory)
    }
}

impl SelfTest for f64 {
    #[inline(always)]
    fn self_test(memory: &mut SelfTestMemory<Self>) -> Result<(), SelfTestFault> {
        self_test_f64(memory)
    }
}

/// One function a public function of the core, for one width, and a list of them.
macro_rules! functions {
    ($width:ident, $t:ident, $machine:ident, $table:ident, $uncertainty:ident, $wrist:ident: $($name:ident($i:ident) $call:expr;)+) => {
        mod $width {
            type T = $t;

            use super::*;
            use pkm_core::checksum::MemoryChecksums;
            use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, LoopGain, Reading, Weight};
            use pkm_core::correction::{TableBuffer, TableHeader};
            use pkm_core::estimation::{Estimator, TipReading, Touch, newest, state_bytes};
            use pkm_core::kinematics::platform_axes as axes;
            use pkm_core::nalgebra::{Matrix6, Vector2, Vector3, Vector6};
            use pkm_core::self_test::SelfTestMemory;
            use pkm_core::tables::reference;
            use pkm_core::{
                Basis, Configuration, CorrectionTable, Deflection, FiveAxis, JointValues, Machine, Model, Pose, ScrewLengths,
                Stiffness, StiffnessFactor, TableUncertainty, Tool, ToolFrame, ToolMotion, Wrench, Wrist,
            };

            pub struct Inputs {
                machine: Machine<$t>,
                table: CorrectionTable<'static, $t>,
                uncertainty: TableUncertainty<$t>,
                basis: Basis<'static, $t>,
                pose: Pose<$t>,
                lengths: ScrewLengths<$t>,
                wrench: Wrench<$t>,
                deflection: Deflection<$t>,
                tip_m: Vector3<$t>,
                stiffness: Stiffness<$t>,
                factor: StiffnessFactor<$t>,
                matrix: Matrix6<$t>,
                rows: [Vector6<$t>; 2],
                numbers: [$t; 21],
                near: Configuration<$t>,
                joints: JointValues<$t>,
                tool: Tool<$t>,
                frame: ToolFrame<$t>,
                motion: ToolMotion<$t>,
                // where their state lies is the caller's choice
                compensator: RefCell<Compensator<$t, 3>>,
                tool_compensator: RefCell<Compensator<$t, 5>>,
                estimator: RefCell<Estimator<$t, 6>>,
                touch: Touch<$t>,
                tip_reading: TipReading<$t>,
                slot: RefCell<[u8; state_bytes(6)]>,
                buffer: RefCell<TableBuffer<$t, 9>>,
                self_test: RefCell<SelfTestMemory<$t>>,
                header: TableHeader,
                reading: Reading<$t>,
                checksums: MemoryChecksums,
            }

            impl Inputs {
                #[inline(always)]
                fn five(&self) -> FiveAxis<'_, $t> {
                    FiveAxis { machine: &self.machine, wrist: &reference::$wrist }
                }

                #[inline(always)]
                fn model(&self) -> Model<'_, $t> {
                    Model::new(&self.machine, &self.table)
                }
            }

            const MACHINE: Machine<$t> = match Machine::<$t>::new(&EVERY_EFFECT) {
                Ok(machine) => machine,
                Err(_) => panic!("an effect is too large"),
            };
            const BASIS: Basis<'static, $t> = match Basis::<$t>::new([0.0, 0.0, 0.53], [0.26, 0.26, 0.03], &[[2, 1, 0]]) {
                Ok(basis) => basis,
                Err(_) => panic!("no basis"),
            };

            /// For a machine without effects, or with every one.
            #[inline(never)]
            pub fn inputs(every_effect: bool) -> Option<Inputs> {
                let machine = if every_effect { MACHINE } else { reference::$machine };
                let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
                let stiffness = machine.stiffness(&pose).ok()?;
                let factor = stiffness.factor().ok()?;
                let wrench =
                    Wrench { force_n: Vector3::new(100.0, -50.0, -400.0), moment_nm: Vector3::new(2.0, -8.0, 5.0) };
                let five = FiveAxis { machine: &machine, wrist: &reference::$wrist };
                let stands = Configuration { pose, beta_rad: Vector2::new(0.4, -0.3) };
                let header = reference::TABLE_F64.header(1);
                let mut buffer = TableBuffer::new();
                buffer.begin(&header, 1).ok()?;
                reference::TABLE_F64.numbers().try_for_each(|number| buffer.push(number)).ok()?;
                Some(Inputs {
                    machine,
                    table: reference::$table,
                    uncertainty: reference::$uncertainty,
                    basis: BASIS,
                    pose,
                    lengths: machine.inverse(&pose).ok()?,
                    wrench,
                    deflection: factor.deflection(&wrench).ok()?,
                    tip_m: Vector3::new(0.03, -0.02, 0.3),
                    stiffness,
                    factor,
                    matrix: Matrix6::identity(),
                    rows: [Vector6::x(), Vector6::y()],
                    numbers: [0.5; 21],
                    near: Configuration { pose, beta_rad: Vector2::new(0.3, -0.2) },
                    joints: five.joints(&stands).ok()?,
                    tool: five.tool(&stands).ok()?,
                    frame: five.frame(&stands).ok()?,
                    motion: ToolMotion {
                        tip_m_per_s: Vector3::x(),
                        axis_per_s: Vector3::y(),
                        tip_m_per_s2: Vector3::z(),
                        axis_per_s2: Vector3::x(),
                    },
                    compensator: RefCell::new(Compensator::new(&CompensatorSettings::DEFAULT).ok()?),
                    tool_compensator: RefCell::new(Compensator::new(&CompensatorSettings::DEFAULT).ok()?),
                    estimator: RefCell::new(Estimator::new(&learned::SETTINGS).ok()?),
                    touch: Touch { time_s: 5, pose, tip_m: Vector3::new(0.03, -0.02, 0.3), wrench, rise_k: 4.5 },
                    tip_reading: TipReading { direction: Vector6::z(), read: -5e-6, deviation: 1e-6 },
                    slot: RefCell::new([0; state_bytes(6)]),
                    buffer: RefCell::new(buffer),
                    self_test: RefCell::new(SelfTestMemory::new()),
                    header,
                    reading: Reading { enabled: true, wrench, rise: 4.5.into() },
                    checksums: five.checksums(&reference::$table),
                })
            }

            $(
                #[inline(never)]
                fn $name($i: &Inputs) {
                    black_box(&$call);
                }
            )+

            pub const FUNCTIONS: &[(&str, fn(&Inputs))] = &[$((stringify!($name), $name)),+];
        }
    };
}

macro_rules! both_widths {
    ($($name:ident($i:ident) $call:expr;)+) => {
        functions! { f64, f64, MACHINE_F64, TABLE_F64, UNCERTAINTY_F64, WRIST_F64: $($name($i) $call;)+ }
        functions! { f32, f32, MACHINE_F32, TABLE_F32, UNCERTAINTY_F32, WRIST_F32: $($name($i) $call;)+ }
    };
}

both_widths! {
    inverse(i) i.machine.inverse(&i.pose);
    forward(i) i.machine.forward(&i.lengths);
    jacobian(i) i.machine.jacobian(&i.pose);
    singularity_distance(i) i.machine.singularity_distance(&i.pose);
    travel_margin_m(i) i.machine.travel_margin_m(&i.lengths);
    stiffness(i) i.machine.stiffness(&i.pose);
    load_dependent_deflection(i) i.machine.load_dependent_deflection(&i.pose, &i.wrench, &i.wrench);
    deflection_of_machine(i) i.machine.deflection(Some(&i.table), &i.pose, &i.wrench, &i.wrench);
    load_response(i) i.machine.load_response(&i.pose);
    thermal_deflection(i) i.machine.thermal_deflection(&i.pose, 4.5);
    at_temperature(i) i.machine.at_temperature(31.5);
    compensated(i) i.machine.compensated(&i.pose, &i.deflection, i.tip_m);
    new_machine(_i) Machine::<T>::new(black_box(&EVERY_EFFECT));
    from_lower(i) Stiffness::from_lower(&i.matrix);
    matrix(i) i.stiffness.matrix();
    principal(i) i.stiffness.principal();
    factor(i) i.stiffness.factor();
    stiffness_of_factor(i) i.factor.stiffness();
    lower(i) i.factor.lower();
    deflection(i) i.factor.deflection(&i.wrench);
    plus(i) i.deflection.plus(&i.deflection);
    seen_at(i) i.deflection.seen_at(i.tip_m);
    moved_to_a(i) i.wrench.moved_to_a(i.tip_m);
    wrench_to_vector(i) i.wrench.to_vector();
    wrench_from_vector(i) Wrench::from_vector(i.rows[0]);
    deflection_to_vector(i) i.deflection.to_vector();
    deflection_from_vector(i) Deflection::from_vector(i.rows[1]); // another row, or the linker would have one function for both
    domain(i) i.table.domain(&i.pose);
    coefficients(i) i.table.coefficients(&i.pose);
    diagonal_form(i) i.table.diagonal_form(&i.machine, &i.pose);
    factor_form(i) i.table.factor_form(&i.machine, &i.pose);
    cycle(i) i.table.cycle(&i.machine, &i.pose, &i.wrench, i.tip_m);
    cycle_known(i) i.table.cycle_known(&i.machine, &i.uncertainty, &i.pose, &i.wrench, i.tip_m);
    tip_uncertainty(i) i.table.tip_uncertainty(&i.uncertainty, &i.factor, &i.pose, &i.wrench, i.tip_m);
    stiffness_u95(i) i.table.stiffness_u95(&i.uncertainty, &i.factor, &i.pose);
    monomials(i) i.basis.monomials(&i.pose);
    new_basis(i) Basis::<T>::new(i.tip_m.into(), i.lengths.q_m.into(), black_box(&[[1, 2, 3]]));
    new_table(i) CorrectionTable::<T>::new(i.basis, &i.numbers[..6], Some(&i.numbers));
    finish_table(i) i.buffer.try_borrow_mut().map(|mut b| b.finish());
    begin_table(i) i.buffer.try_borrow_mut().map(|mut b| b.begin(&i.header, i.header.machine));
    push_number(i) i.buffer.try_borrow_mut().map(|mut b| b.push(i.header.machine as f64));
    tool_frame(i) i.five().frame(&i.near);
    tool(i) i.five().tool(&i.near);
    platform_axes(i) axes((i.numbers[0], i.numbers[1]), (i.numbers[2], i.numbers[3]));
    forward_tool(i) i.five().forward(&i.joints);
    joints(i) i.five().joints(&i.near);
    normalised_determinant(i) i.five().normalised_determinant(&i.near);
    inverse_tool(i) i.five().inverse(&i.tool, &i.near);
    inverse_at(i) i.five().inverse_at(i.tool.tip_m, i.near.beta_rad);
    search(i) i.five().search(&i.tool, &i.near);
    inverse_frame(i) i.five().inverse_frame(&i.frame);
    tip_stiffness(i) i.five().tip_stiffness(&i.stiffness, &i.near);
    deflection_of_tool(i) i.five().deflection(Some(&i.table), &i.near, &i.wrench);
    joint_motion(i) i.five().joint_motion(&i.near, &i.motion);
    compensated_tool(i) i.five().compensated(Some(&i.table), &i.tool, &i.wrench, &i.near);
    loop_gain(i) LoopGain::new(&i.factor, i.tip_m, 1e7, 0.7);
    new_compensator(_i) Compensator::<T, 5>::new(black_box(&CompensatorSettings::DEFAULT));
    carried(i) CarriedWeight::<T, 3>::new(&i.model(), &black_box(Weight { force_n: i.tip_m, centre_m: i.tip_m }), &i.pose, i.tip_m);
    carried_tool(i) CarriedWeight::<T, 5>::new(&i.model(), i.five().wrist, &Weight::ZERO, &black_box(Weight { force_n: i.tip_m, centre_m: i.tip_m }), &i.near);
    compensate(i) i.compensator.try_borrow_mut().map(|mut c| c.update(&i.model(), &i.pose, i.tip_m, &i.reading));
    compensate_tool(i) i.tool_compensator.try_borrow_mut().map(|mut c| c.update(&i.model(), i.five().wrist, &i.near, &i.reading));
    sensitivities(i) i.machine.sensitivities(&i.pose, &i.wrench, &learned::SETTINGS.amplitudes.map(|own| own.amplitude));
    new_estimator(_i) Estimator::<T, 6>::new(black_box(&learned::SETTINGS));
    learn(i) i.estimator.try_borrow_mut().map(|mut e| e.learn(&i.machine, Some(&i.table), &i.touch, &[i.tip_reading; 6]));
    absorb(i) i.estimator.try_borrow_mut().map(|mut e| e.absorb(&i.touch, &i.deflection, &[i.deflection; 6], &[i.tip_reading; 6]));
    follow(i) i.estimator.try_borrow_mut().map(|mut e| e.follow(1e-3));
    tip_of_estimator(i) i.estimator.try_borrow().map(|e| e.tip(&[i.deflection; 6], i.tip_m));
    values(i) i.estimator.try_borrow().map(|e| e.values());
    alarms(i) i.estimator.try_borrow().map(|e| e.alarms());
    save(i) i.slot.try_borrow_mut().map(|mut s| i.estimator.try_borrow().map(|e| e.save(i.header.machine, 1, &mut s[..])));
    restore(i) i.slot.try_borrow().map(|s| i.estimator.try_borrow_mut().map(|mut e| e.restore(i.header.machine, &s[..])));
    newest_state(i) i.slot.try_borrow().map(|s| newest(6, &s[..], &s[..]));
    compensate_learned(i) i.compensator.try_borrow_mut().map(|mut c| i.estimator.try_borrow().map(|e| c.update(&i.model().with_learned(&*e), &i.pose, i.tip_m, &i.reading)));
    compensate_tool_learned(i) i.tool_compensator.try_borrow_mut().map(|mut c| i.estimator.try_borrow().map(|e| c.update(&i.model().with_learned(&*e), i.five().wrist, &i.near, &i.reading)));
    compensate_known(i) i.compensator.try_borrow_mut().map(|mut c| i.estimator.try_borrow().map(|e| c.update(&i.model().with_uncertainty(&i.uncertainty).with_learned(&*e), &i.pose, i.tip_m, &i.reading)));
    compensate_tool_known(i) i.tool_compensator.try_borrow_mut().map(|mut c| i.estimator.try_borrow().map(|e| c.update(&i.model().with_uncertainty(&i.uncertainty).with_learned(&*e), i.five().wrist, &i.near, &i.reading)));
    checksums(i) i.five().checksums(&i.table);
    verify(i) i.five().verify(&i.table, &i.checksums);
    verify_uncertainty(i) i.uncertainty.verify(i.uncertainty.checksum());
    self_test(i) i.self_test.try_borrow_mut().map(|mut memory| T::self_test(&mut memory));
    new_wrist(_i) Wrist::<T>::new(black_box(&WRIST));
}

fn print_all() -> Option<()> {
    let mut out = hio::hstdout().ok()?;
    macro_rules! print {
        ($width:ident) => {
            let (plain, effects) = ($width::inputs(false)?, $width::inputs(true)?);
            for (name, call) in $width::FUNCTIONS {
                let bytes = measure(|| call(&plain)).max(measure(|| call(&effects)));
                writeln!(out, concat!(stringify!($width), " {} {}"), name, bytes).ok()?;
            }
        };
    }
    print!(f64);
    print!(f32);
    Some(())
}

#[entry]
fn main() -> ! {
    semihosting::end(print_all().is_some())
}

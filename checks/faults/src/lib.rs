//! Faults thrown at a compensator that runs, each with the reaction that `docs/stability.md` defines for it.
//!
//! Compensators of three screws and of five axes, with and without a weight, run through periods without the fault, with it, and without it
//! again. What comes of it is a checksum of all that was computed, or what was not as it is defined. The same code runs as a test on the
//! host, and in QEMU on a Cortex-M, where the checksums must be the host's. [`lessons`] does the same with readings and an estimator.

#![no_std]
#![forbid(unsafe_code)]

mod learning;

use core::fmt;

use pkm_core::checksum::{Damaged, MemoryChecksums, START, over_numbers};
use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Offset, Reading, Weight};
use pkm_core::correction::{TableBuffer, TransferError};
use pkm_core::nalgebra::{SVector, Vector2, Vector3, Vector6};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{
    Configuration, CorrectionTable, Fault, FiveAxis, Machine, MachineParameters, Model, Pose, Scalar, TemperatureRise,
    Wrench,
};

pub use learning::{Lesson, lessons, reading};

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Injected {
    /// The sensor of the load says the same over and over.
    SensorStuck,
    /// The sensor says NaN.
    SensorNotFinite,
    /// Every tenth reading is far too large.
    SensorSpike,
    /// The sensor's sign is reversed.
    SensorReversed,
    /// A program has ended, and its load is still set.
    LoadLeftOn,
    /// The tool is where the table was not fitted.
    OutsideBox,
    /// No update comes for a while, and the load is another one then.
    PeriodsSkipped,
    /// The sensors of all temperatures say NaN.
    TemperatureLost,
    /// One sensor of four temperatures jumps, and says NaN then.
    OneTemperatureLost,
    /// One bit of a table that comes, or of the one in memory, is another.
    BitOfTable,
    /// A table of another machine comes; machine, wrist or table in memory are another one's.
    OtherMachine,
}

const ALL: [Injected; 11] = [
    Injected::SensorStuck,
    Injected::SensorNotFinite,
    Injected::SensorSpike,
    Injected::SensorReversed,
    Injected::LoadLeftOn,
    Injected::OutsideBox,
    Injected::PeriodsSkipped,
    Injected::TemperatureLost,
    Injected::OneTemperatureLost,
    Injected::BitOfTable,
    Injected::OtherMachine,
];

/// Where the offset is at the end of the fault, compared with that before it.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Same,
    Zero,
    /// What the weight alone asks for.
    WithoutLoad,
    OppositeLoad,
}

/// Periods before, during and after the fault: each long enough for the filter and the rate limit.
const PERIODS: usize = 250;
/// A load that was given up comes back with its so many-th good reading.
const RETURN_PERIODS: usize = 100;
/// A computer's sensor is stuck after so many periods.
const STUCK_PERIODS: usize = 50;
/// A healthy load differs by this from period to period, N and N·m: the offset by less than a twentieth.
const NOISE: f64 = 2.0;
const LOAD: [f64; 6] = [100.0, -50.0, -400.0, 2.0, -8.0, 5.0];
const TIP_M: [f64; 3] = [0.01, -0.02, 0.3];
/// Of limbs 1, 2, 3 and the platforms.
const RISE_K: [f64; 4] = [2.5, 2.0, 1.0, 1.5];
/// θ, σ, Z0, β1, β2, in the box of the reference table and out of it.
const PLACE: [f64; 5] = [0.1, -0.05, 0.53, 0.3, -0.2];
const OUTSIDE: [f64; 5] = [0.3, -0.05, 0.53, 0.3, -0.2];
/// Where the machine was zeroed.
const ZERO: [f64; 5] = [0.0, 0.0, 0.53, 0.0, 0.0];
/// Force and centre of mass of what platform and tool weigh.
const PLATFORM: [[f64; 3]; 2] = [[600.0, -150.0, -480.0], [0.02, -0.01, 0.1]];
const TOOL: [[f64; 3]; 2] = [[150.0, -37.5, -120.0], [0.12, 0.01, -0.2]];

/// A period of a controller.
struct Period<T> {
    configuration: Configuration<T>,
    reading: Reading<T>,
}

impl Injected {
    /// What must be reported while the fault lasts: at its end, or now and then.
    fn code(self) -> Option<Fault> {
        match self {
            Self::SensorStuck => Some(Fault::WrenchStuck),
            Self::SensorNotFinite => Some(Fault::WrenchNotFinite),
            Self::SensorSpike => Some(Fault::WrenchTooLarge),
            Self::OutsideBox => Some(Fault::OutsideBox),
            Self::TemperatureLost | Self::OneTemperatureLost => Some(Fault::TemperatureLost),
            Self::SensorReversed | Self::LoadLeftOn | Self::PeriodsSkipped | Self::BitOfTable | Self::OtherMachine => {
                None
            }
        }
    }

    fn end(self) -> End {
        match self {
            Self::LoadLeftOn | Self::OutsideBox => End::Zero,
            Self::SensorStuck | Self::SensorNotFinite => End::WithoutLoad,
            Self::SensorReversed => End::OppositeLoad,
            Self::SensorSpike
            | Self::PeriodsSkipped
            | Self::TemperatureLost
            | Self::OneTemperatureLost
            | Self::BitOfTable
            | Self::OtherMachine => End::Same,
        }
    }

    /// Periods after the fault in which it is still reported.
    fn lasting(self) -> usize {
        if self.end() == End::WithoutLoad { RETURN_PERIODS - 1 } else { 0 }
    }

    /// A period's inputs; `None` where none comes. `faulty` counts from the beginning of the fault.
    fn period<T: Scalar>(self, period: usize, faulty: Option<usize>) -> Option<Period<T>> {
        let mut reading = LOAD.map(|load| load + NOISE * noise(period, load));
        let (mut enabled, mut place, mut rise_k) = (true, PLACE, RISE_K);
        if self == Self::PeriodsSkipped || self == Self::SensorReversed {
            // growth is no load, and does not turn with it
            rise_k = [0.0; 4];
        }
        if let Some(faulty) = faulty {
            match self {
                Self::SensorStuck => reading = LOAD,
                Self::SensorNotFinite => reading[faulty % 6] = f64::NAN,
                Self::SensorSpike if faulty % 10 == 0 => reading = reading.map(|load| 1e5 * load),
                Self::SensorReversed => reading = reading.map(|load| -load),
                Self::LoadLeftOn => enabled = false,
                Self::OutsideBox => place = OUTSIDE,
                Self::PeriodsSkipped if faulty < PERIODS / 4 => return None,
                Self::PeriodsSkipped if faulty < PERIODS / 2 => reading = reading.map(|load| 3.0 * load),
                Self::TemperatureLost => rise_k = [f64::NAN; 4],
                Self::OneTemperatureLost => rise_k[1] = if faulty < PERIODS / 2 { 60.0 } else { f64::NAN },
                _ => {}
            }
        }
        let [first, second, third, platforms_k] = rise_k.map(T::from_f64);
        Some(Period {
            configuration: configuration(place),
            reading: Reading {
                enabled,
                wrench: Wrench::from_vector(Vector6::from(reading.map(T::from_f64))),
                rise: TemperatureRise { limbs_k: [first, second, third], platforms_k },
            },
        })
    }
}

fn configuration<T: Scalar>(place: [f64; 5]) -> Configuration<T> {
    let [theta_rad, sigma_rad, z0_m, beta1, beta2] = place.map(T::from_f64);
    Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad: Vector2::new(beta1, beta2) }
}

fn weight<T: Scalar>([force_n, centre_m]: [[f64; 3]; 2]) -> Weight<T> {
    let vector = |v: [f64; 3]| v.map(T::from_f64).into();
    Weight { force_n: vector(force_n), centre_m: vector(centre_m) }
}

/// In −1…1, by a multiplicative hash.
fn noise(period: usize, load: f64) -> f64 {
    let mixed = (period as u32 ^ load as i32 as u32).wrapping_mul(2_654_435_769) >> 16;
    f64::from(mixed) / 32768.0 - 1.0
}

/// What came of a fault.
pub struct Outcome {
    /// The fault.
    pub fault: Injected,
    /// Of the arithmetic: 32 or 64.
    pub float_bits: u8,
    /// Checksum of all that was computed, or what is not as it is defined.
    pub result: Result<u64, &'static str>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} f{}: ", self.fault, self.float_bits)?;
        match self.result {
            Ok(checksum) => write!(f, "{checksum:016x}"),
            Err(wrong) => f.write_str(wrong),
        }
    }
}

static SINGLE: FiveAxis<'static, f32> = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
static DOUBLE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
/// Machines that grow: on them alone a temperature moves anything.
const GROWS: MachineParameters = match PARAMETERS.effects.with("thermal-expansion", [11e-6, 11e-6]) {
    Some(effects) => MachineParameters { effects, ..PARAMETERS },
    None => panic!("no such effect"),
};
static STEEL_F32: Machine<f32> = match Machine::<f32>::new(&GROWS) {
    Ok(machine) => machine,
    Err(_) => panic!("no machine"),
};
static STEEL_F64: Machine<f64> = match Machine::<f64>::new(&GROWS) {
    Ok(machine) => machine,
    Err(_) => panic!("no machine"),
};
const BUILT_F32: MemoryChecksums = SINGLE.checksums(&TABLE_F32);
const BUILT_F64: MemoryChecksums = DOUBLE.checksums(&TABLE_F64);

/// Throws every fault at the reference machine in either arithmetic.
pub fn outcomes() -> impl Iterator<Item = Outcome> {
    let single = Controller {
        five: &SINGLE,
        steel: &STEEL_F32,
        table: &TABLE_F32,
        built: BUILT_F32,
        verify: |built| SINGLE.verify(&TABLE_F32, built),
    };
    let double = Controller {
        five: &DOUBLE,
        steel: &STEEL_F64,
        table: &TABLE_F64,
        built: BUILT_F64,
        verify: |built| DOUBLE.verify(&TABLE_F64, built),
    };
    ALL.into_iter().flat_map(move |fault| {
        let single = Outcome { fault, float_bits: 32, result: inject(fault, &single) };
        [single, Outcome { fault, float_bits: 64, result: inject(fault, &double) }]
    })
}

/// What a fault is thrown at.
struct Controller<T: 'static> {
    five: &'static FiveAxis<'static, T>,
    /// The machine of the faults of temperature.
    steel: &'static Machine<T>,
    table: &'static CorrectionTable<'static, T>,
    /// Checksums as built.
    built: MemoryChecksums,
    /// Compares them with memory.
    verify: fn(&MemoryChecksums) -> Result<(), Damaged>,
}

fn inject<T: Scalar>(fault: Injected, controller: &Controller<T>) -> Result<u64, &'static str> {
    let Controller { five, steel, table, .. } = *controller;
    let of_temperature = fault.code() == Some(Fault::TemperatureLost);
    let five = &FiveAxis { machine: if of_temperature { steel } else { five.machine }, wrist: five.wrist };
    let stuck_s = STUCK_PERIODS as f64 * CompensatorSettings::DEFAULT.period_s;
    let settings = CompensatorSettings { stuck_s, ..CompensatorSettings::DEFAULT };
    let (Ok(screws), Ok(axes)) = (Compensator::<T, 3>::new(&settings), Compensator::<T, 5>::new(&settings)) else {
        return Err("the settings are refused");
    };
    let tip = Vector3::from(TIP_M.map(T::from_f64));
    let zero = configuration(ZERO);
    let model = &Model::new(five.machine, table);
    let of_screws = CarriedWeight::<T, 3>::new(model, &weight(PLATFORM), &zero.pose, tip);
    let of_axes = CarriedWeight::<T, 5>::new(model, five.wrist, &weight(PLATFORM), &weight(TOOL), &zero);
    let (Ok(of_screws), Ok(of_axes)) = (of_screws, of_axes) else { return Err("the weight is refused") };
    let mut sum = 0_u64;
    for (of_screws, of_axes) in [(None, None), (Some(of_screws), Some(of_axes))] {
        let (mut screws, mut axes) = (screws, axes);
        screws.set_weight(of_screws);
        axes.set_weight(of_axes);
        let of_screws = run(fault, &settings, screws, |screws, Period { configuration, reading }: &Period<T>| {
            screws.update(model, &configuration.pose, tip, reading)
        })?;
        let of_axes = run(fault, &settings, axes, |axes, Period { configuration, reading }: &Period<T>| {
            axes.update(model, five.wrist, configuration, reading)
        })?;
        sum = sum.rotate_left(2) ^ of_screws ^ of_axes.rotate_left(1);
    }
    guards(fault, controller)?;
    Ok(sum)
}

/// What a compensator asks for at rest without a load.
fn without_load<T: Scalar, const JOINTS: usize>(
    mut compensator: Compensator<T, JOINTS>,
    update: impl Fn(&mut Compensator<T, JOINTS>, &Period<T>) -> Offset<T, JOINTS>,
) -> SVector<f64, JOINTS> {
    let reading = Reading { enabled: true, wrench: Wrench::ZERO, rise: T::ZERO.into() };
    let period = Period { configuration: configuration(PLACE), reading };
    for _ in 0..PERIODS {
        update(&mut compensator, &period);
    }
    compensator.joints().map(T::to_f64)
}

/// All periods of one compensator.
fn run<T: Scalar, const JOINTS: usize>(
    fault: Injected,
    settings: &CompensatorSettings,
    mut compensator: Compensator<T, JOINTS>,
    update: impl Fn(&mut Compensator<T, JOINTS>, &Period<T>) -> Offset<T, JOINTS>,
) -> Result<u64, &'static str> {
    let alone = without_load(compensator, &update);
    let rounding = 1.0 + 1e-5;
    let largest: [f64; 2] = [settings.max_screw_m * rounding, settings.max_wrist_rad * rounding];
    let step =
        [settings.screw_rate_m_per_s, settings.wrist_rate_rad_per_s].map(|r| r * settings.period_s * rounding + 1e-10);
    let mut last = SVector::<f64, JOINTS>::zeros();
    let mut ends = [last; 3];
    let (mut reported, mut sum) = (false, START);
    for period in 0..3 * PERIODS {
        let faulty = period.checked_sub(PERIODS).filter(|faulty| *faulty < PERIODS);
        let lasts = (2 * PERIODS..2 * PERIODS + fault.lasting()).contains(&period);
        if let Some(inputs) = fault.period(period, faulty) {
            let offset = update(&mut compensator, &inputs);
            let now = offset.joints.map(T::to_f64);
            for (joint, (now, last)) in now.iter().zip(&last).enumerate() {
                let kind = usize::from(joint >= 3);
                if !(now.abs() <= largest[kind]) {
                    return Err("an offset is beyond its largest");
                }
                if !((now - last).abs() <= step[kind]) {
                    return Err("an offset steps by more than its rate limit");
                }
                sum = over_numbers(sum, &[*now]);
            }
            last = now;
            match (offset.fault, faulty) {
                (found, None) if lasts && found == fault.code() => {}
                (_, None) if lasts => return Err("a load that was given up comes back at once"),
                (None, _) => {}
                (found, Some(_)) if found == fault.code() => reported = true,
                (Some(_), Some(_)) => return Err("another fault is reported"),
                (Some(_), None) => return Err("a fault is reported where there is none"),
            }
        }
        if (period + 1) % PERIODS == 0
            && let Some(end) = ends.get_mut(period / PERIODS)
        {
            *end = last;
        }
    }
    if reported != fault.code().is_some() {
        return Err("the fault is not reported");
    }
    let [before, during, after] = ends;
    let near = |a: SVector<f64, JOINTS>, b: SVector<f64, JOINTS>| (a - b).amax() <= 0.05 * before.amax();
    let expected = match fault.end() {
        End::Same => before,
        End::Zero => before * 0.0,
        End::WithoutLoad => alone,
        End::OppositeLoad => alone * 2.0 - before,
    };
    if !(before.amax() > 1e-6) {
        return Err("nothing is compensated before the fault");
    }
    if !near(during, expected) {
        return Err("the offset does not end where it should while the fault lasts");
    }
    if !near(after, before) {
        return Err("the offset does not come back after the fault");
    }
    Ok(sum)
}

/// What guards memory and tables that come: each is asked with the fault and without it.
fn guards<T: Scalar>(fault: Injected, controller: &Controller<T>) -> Result<(), &'static str> {
    const MACHINE: u64 = 7;
    let mut buffer = TableBuffer::<T, 9>::new();
    let mut send = |fitted_for: u64, flipped: Option<usize>| {
        buffer.begin(&TABLE_F64.header(fitted_for), MACHINE)?;
        for (place, number) in TABLE_F64.numbers().enumerate() {
            let bit = u64::from(flipped == Some(place)) << (place % 52);
            buffer.push(f64::from_bits(number.to_bits() ^ bit))?;
        }
        buffer.finish()
    };
    let Controller { built, verify, .. } = controller;
    if send(MACHINE, None).is_err() || verify(built).is_err() {
        return Err("what is right is refused");
    }
    match fault {
        Injected::BitOfTable => {
            if (0..TABLE_F64.header(MACHINE).numbers()).any(|place| send(MACHINE, Some(place)).is_ok()) {
                return Err("a table with another bit is taken");
            }
            if verify(&MemoryChecksums { table: built.table ^ 1, ..*built }) != Err(Damaged::Table) {
                return Err("a damaged table is not noticed");
            }
        }
        Injected::OtherMachine => {
            if send(MACHINE + 1, None) != Err(TransferError::OtherMachine) {
                return Err("the table of another machine is taken");
            }
            if verify(&MemoryChecksums { machine: !built.machine, ..*built }) != Err(Damaged::Machine) {
                return Err("another machine is not noticed");
            }
        }
        _ => {}
    }
    // a refused table is not there
    match buffer.table() {
        Some(_) if matches!(fault, Injected::BitOfTable | Injected::OtherMachine) => Err("a refused table can be used"),
        _ => Ok(()),
    }
}

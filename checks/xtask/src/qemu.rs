//! The firmware in QEMU, compared with the host bit for bit.
//!
//! The firmware runs with the `coefficients.rs` of a fit; the host computes the same poses from the machine
//! file and the `coefficients.json` of that fit. So the generated source, the compiler and the target's
//! arithmetic are all in the comparison.

use std::path::Path;
use std::process::Command;

use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, OutsideBox, Reading, Weight};
use pkm_core::correction::narrow;
use pkm_core::effects::{EFFECTS, EffectInfo};
use pkm_core::nalgebra::Vector2;
use pkm_core::tables::reference::{UNCERTAINTY_F32, UNCERTAINTY_F64};
use pkm_core::{
    Configuration, CorrectionTable, CycleError, Domain, FiveAxis, KnownCycle, Machine, Model, Pose, Scalar, Stiffness,
    StiffnessError, TableUncertainty, Tool, ToolDeflectionError, ToolSolution, Wrench, Wrist,
};
use pkm_host::cli;
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_host::files::table_numbers::UncertaintyNumbers;
use serde_json::Value;

use crate::proofs::firmware;
use crate::{Outcome, fit_fixtures, output, root};

/// Where the firmware's machine and table come from.
enum Origin {
    /// A fit of the fixtures.
    Fit,
    /// The same with every effect on, and elements.
    EveryEffect,
    /// A diagnosis of measured data that lack two effects.
    Diagnosis,
}

/// Machine of QEMU, processor.
type Board = (&'static str, &'static str);

const M4F: Board = ("mps2-an386", "Cortex-M4F");

/// Origin, the `target-cpu` to build for (f64 in hardware needs the M7's), boards.
const RUNS: [(Origin, Option<&str>, &[Board]); 4] = [
    (Origin::Fit, None, &[M4F, ("mps2-an500", "Cortex-M7")]),
    (Origin::EveryEffect, None, &[M4F]),
    (Origin::Diagnosis, None, &[M4F]),
    (Origin::Fit, Some("cortex-m7"), &[("mps2-an500", "Cortex-M7 with f64 in hardware")]),
];

/// Machine of QEMU, processor, the `target-cpu` to build for.
pub const PROCESSORS: [(&str, &str, Option<&str>); 2] =
    [("mps2-an386", "Cortex-M4F", None), ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"))];

pub fn run() -> Outcome {
    for (origin, cpu, boards) in RUNS {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let with = match origin {
            Origin::Diagnosis => {
                let measured = root().join("fixtures/measured/p08");
                let [machine, data, holdout] =
                    ["machine.toml", "measured.csv", "heldout.csv"].map(|file| measured.join(file));
                let args = [
                    "diagnose".as_ref(),
                    "--machine".as_ref(),
                    machine.as_os_str(),
                    "--data".as_ref(),
                    data.as_os_str(),
                    "--holdout".as_ref(),
                    holdout.as_os_str(),
                    "--out".as_ref(),
                    folder.path().as_os_str(),
                ];
                cli::run(args).map_err(|e| e.to_string())?;
                ", the machine of a diagnosis"
            }
            Origin::Fit => {
                fit(&[], "", folder.path())?;
                ""
            }
            Origin::EveryEffect => {
                fit(&EFFECTS, ELEMENTS, folder.path())?;
                ", every effect on, elements of every law"
            }
        };
        let (mut build, elf) = firmware("parity", cpu);
        output(build.env("PKM_COEFFICIENTS", folder.path().join("coefficients.rs")))?;
        let host = Host::read(folder.path())?;
        for (board, processor) in boards {
            let lines = compare(&boot(board, &elf, &[])?, &host)?;
            println!("{processor} ({board}){with}: {lines} lines, every bit as on the host");
        }
    }
    faults()
}

/// Every fault on every processor, with the reaction and the bits that it has on the host.
fn faults() -> Outcome {
    let mut here: String = pkm_faults::outcomes().map(|outcome| format!("{outcome}\n")).collect();
    here.extend(pkm_faults::lessons().iter().map(|lesson| format!("{lesson}\n")));
    for (board, processor, cpu) in PROCESSORS {
        let (mut build, elf) = firmware("faults", cpu);
        output(&mut build)?;
        let there = boot(board, &elf, &[])?;
        if there != here {
            return Err(format!("{processor} ({board}): faults have another outcome than on the host:\n{there}{here}"));
        }
        println!("{processor} ({board}): {} faults, reactions and bits as on the host", here.lines().count());
    }
    Ok(())
}

/// Fits the fixtures' data with effects of modest size and elements on.
pub fn fit(effects: &[EffectInfo], elements: &str, folder: &Path) -> Outcome {
    let path = folder.join("machine.toml");
    let mut text = Source::embedded(pkm_fixtures::MACHINE).text().map_err(|e| e.to_string())?.to_owned();
    text.extend(effects.iter().map(one_of));
    text.push_str(elements);
    std::fs::write(&path, text).map_err(|e| e.to_string())?;
    fit_fixtures(Some(&path), folder)
}

/// An element of every law and outside the limbs.
pub const ELEMENTS: &str = r#"
[[element]]
place = "limb.1.base_joint"
motion = "tilting"
law = "constant"
compliance_rad_per_nm = 1e-7
[[element]]
place = "limb.2.body"
motion = "axial"
law = "extension"
compliance_m_per_n = 1e-10
slope_per_n = 1e-10
curvature_per_nm = -1e-10
length_m = 0.5
[[element]]
place = "limb.3.body"
motion = "tilting"
law = "periodic"
amplitude_rad_per_nm = 1e-8
pitch_m = 0.01
phase_rad = 0.3
[[element]]
place = "limb.1.platform_joint"
motion = "lateral"
law = "temperature"
compliance_m_per_n_per_k = 1e-11
[[element]]
place = "limb.2.body"
motion = "axial"
law = "load"
asymmetric_m_per_n = 1e-10
even_m_per_n2 = -1e-13
odd_m_per_n2 = 1e-13
cubic_m_per_n3 = 1e-16
play_m = 1e-6
straight_above_n = 300.0
[[element]]
place = "limb.3.platform_joint"
motion = "axial"
law = "direction"
lag_m = 1e-6
[[element]]
place = "base"
motion = "rz"
law = "constant"
compliance_rad_per_nm = 1e-8
[[element]]
place = "tool"
motion = "w"
law = "constant"
compliance_m_per_n = -1e-11
"#;

/// An `[[effect]]` of modest size.
fn one_of(effect: &EffectInfo) -> String {
    let value = |name: &str| match name {
        "tube_m" | "ram_m" => 0.3,
        "aside_1_m" | "aside_2_m" | "aside_3_m" => 1e-3,
        "play_m" => 1e-5,
        "taken_up_n" | "reference_n" | "reversal_n" => 50.0,
        "lag_m" => 1e-6,
        "limbs_1_2_n" | "limb_3_n" => 1e3,
        "limbs_1_2_m" | "limb_3_m" => -2e-3,
        "error_m" => 1e-4,
        "bodies_per_k" | "joints_per_k" => 3e-4,
        "limbs_per_k" | "platforms_per_k" => 12e-6,
        name if name.ends_with("rad_per_nm") => 1e-7,
        name if name.ends_with("per_nm2") => 1e-6,
        _ => 1e-10,
    };
    let values: String = effect.names().map(|p| format!("{p} = {:e}\n", value(p))).collect();
    format!("\n[[effect]]\nid = \"{}\"\n{values}", effect.id)
}

/// Runs an image to its end and returns what it printed.
pub fn boot(board: &str, elf: &Path, options: &[&str]) -> Result<String, String> {
    let mut command = Command::new("qemu-system-arm");
    command.args(["-M", board, "-nographic", "-monitor", "none", "-serial", "null"]).args(options);
    output(command.args(["-semihosting-config", "enable=on,target=native", "-kernel"]).arg(elf))
}

/// The host's side: machine and table of a fit or a diagnosis from their files, not from generated source.
pub struct Host {
    machine: MachineFile,
    table: TableFile,
}

impl Host {
    pub fn read(folder: &Path) -> Result<Self, String> {
        let read = |name: &str| Source::read(&folder.join(name)).map_err(|e| e.to_string());
        let table = TableFile::parse(&read("coefficients.json")?).map_err(|e| e.to_string())?;
        let machine = MachineFile::parse(read("machine.toml")?).map_err(|e| e.to_string())?;
        Ok(Self { machine, table })
    }

    /// How far the table may be off.
    pub fn uncertainty(&self) -> Result<(TableUncertainty<f64>, TableUncertainty<f32>), String> {
        let numbers = self.table.uncertainty.as_ref().ok_or("the table does not say how far it may be off")?;
        let UncertaintyNumbers { spread, rest, columns } = numbers;
        let single = TableUncertainty::<f32>::new(narrow(spread), *rest as f32, columns.map(|column| narrow(&column)));
        Ok((numbers.core().map_err(|e| e.to_string())?, single.map_err(|e| e.to_string())?))
    }

    /// Calls one with machine, wrist and table in `f64`, the other with those in `f32`, and gives what the calls give.
    pub fn both<R>(
        &self,
        double: impl FnOnce(&FiveAxis<'_, f64>, &CorrectionTable<'_, f64>) -> R,
        single: impl FnOnce(&FiveAxis<'_, f32>, &CorrectionTable<'_, f32>) -> R,
    ) -> Result<(R, R), String> {
        let numbers = self.table.numbers();
        let table = numbers.table().map_err(|e| e.to_string())?;
        let in_double = double(&self.machine.five_axis().map_err(|e| e.to_string())?, &table);
        let machine = Machine::<f32>::new(&self.machine.parameters).map_err(|e| e.to_string())?;
        let narrowed = numbers.narrowed();
        let table = narrowed.table().map_err(|e| e.to_string())?;
        let wrist = Wrist::<f32>::new(&self.machine.wrist_parameters).map_err(|e| e.to_string())?;
        Ok((in_double, single(&FiveAxis { machine: &machine, wrist: &wrist }, &table)))
    }
}

/// Checks every line; returns their number.
fn compare(text: &str, host: &Host) -> Result<usize, String> {
    let (mut lines, mut outside, mut refused, mut loaded) = (0, 0, 0, 0);
    for text in text.lines() {
        let line: Value = serde_json::from_str(text).map_err(|e| format!("not a line of the firmware: {e}: {text}"))?;
        let pose = bits(&line["pose"])?;
        let (double, single) = host
            .both(|m, t| expected(m, (t, &UNCERTAINTY_F64), &pose), |m, t| expected(m, (t, &UNCERTAINTY_F32), &pose))?;
        let expected = match line["float_bits"].as_u64() {
            Some(64) => double,
            Some(32) => single,
            other => return Err(format!("unknown width {other:?}")),
        };
        let found = |key: &str| bits(&line[key]);
        if expected.error != line["error"].is_string() || Some(expected.inside) != line["inside"].as_bool() {
            return Err(format!("another status than on the host: {text}"));
        }
        refused += usize::from(expected.error);
        outside += usize::from(!expected.inside && !expected.error);
        if !expected.error {
            loaded += usize::from(!found("loaded")?.is_empty());
            for (key, values) in expected.values {
                if found(key)? != values {
                    return Err(format!("{key} differs from the host's {values:?}: {text}"));
                }
            }
        }
        lines += 1;
    }
    if lines < 500 || outside < 100 || refused < 6 || loaded < 400 {
        return Err(format!(
            "the firmware stopped early: {lines} lines, {outside} outside, {refused} refused, {loaded} with five axes"
        ));
    }
    Ok(lines)
}

fn bits(value: &Value) -> Result<Vec<u64>, String> {
    let numbers = value.as_array().and_then(|a| a.iter().map(Value::as_u64).collect());
    numbers.ok_or_else(|| format!("expected bits, found {value}"))
}

struct Expected {
    error: bool,
    inside: bool,
    values: Vec<(&'static str, Vec<u64>)>,
}

fn expected<T: Scalar>(
    five: &FiveAxis<'_, T>,
    (table, uncertainty): (&CorrectionTable<'_, T>, &TableUncertainty<T>),
    pose: &[u64],
) -> Expected {
    let at = |i: usize| T::from_f64(f64::from_bits(pose[i]));
    let pose = Pose { theta_rad: at(0), sigma_rad: at(1), z0_m: at(2) };
    let values = values(five.machine, table, &pose).map(|mut values| {
        values.extend(five_axes(five, table, &pose));
        values.push(("offsets", offsets(five, table, &pose)));
        values.push(("known", known(five.machine, (table, uncertainty), &pose).unwrap_or_default()));
        values
    });
    Expected {
        error: values.is_err(),
        inside: table.domain(&pose) == Domain::Inside,
        values: values.unwrap_or_default(),
    }
}

/// The tip, the wrist's joints and the loads that embed/firmware/src/bin/parity.rs applies: m, rad, N and N·m.
const TIP_M: [f64; 3] = [0.01, -0.02, 0.3];
const BETA: [f64; 2] = [0.3, -0.2];
const WRENCH: [f64; 6] = [100.0, -50.0, -400.0, 2.0, -8.0, 5.0];
const TURNED_AT: [f64; 6] = [150.0, -20.0, -600.0, 3.0, -8.0, 9.0];
/// The weights of platform and tool there, N, and their centres of mass, m.
const PLATFORM: [[f64; 3]; 2] = [[785.0, 20.0, -30.0], [0.01, 0.02, 0.1]];
const TOOL: [[f64; 3]; 2] = [[196.0, 5.0, -8.0], [0.0, 0.01, -0.2]];

fn weight<T: Scalar>([force_n, centre_m]: [[f64; 3]; 2]) -> Weight<T> {
    Weight { force_n: force_n.map(T::from_f64).into(), centre_m: centre_m.map(T::from_f64).into() }
}

fn wrench<T: Scalar>(components: [f64; 6]) -> Wrench<T> {
    Wrench::from_vector(components.map(T::from_f64).into())
}

fn bits_of<T: Scalar>(values: &[T]) -> Vec<u64> {
    values.iter().map(|v| v.to_f64().to_bits()).collect()
}

fn lower_of<T: Scalar>(k: &Stiffness<T>) -> Vec<u64> {
    let k = k.matrix();
    bits_of(&(0..6).flat_map(|i| (0..=i).map(move |j| k[(i, j)])).collect::<Vec<_>>())
}

/// Configuration, screw lengths and normalised Jacobian determinant.
fn solution_numbers<T: Scalar>(solution: &ToolSolution<T>) -> Vec<T> {
    let Configuration { pose, beta_rad } = &solution.configuration;
    let stands = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
    [&stands, beta_rad.as_slice(), solution.joints.lengths.q_m.as_slice(), &[solution.normalised_determinant]].concat()
}

/// What the five axes do, with nothing from the first error on, as embed/firmware/src/bin/parity.rs has it.
fn five_axes<T: Scalar>(
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
    pose: &Pose<T>,
) -> [(&'static str, Vec<u64>); 4] {
    let mut found = ["solution", "frame_solution", "tip_stiffness", "loaded"].map(|name| (name, Vec::new()));
    let [(_, solution), (_, frame_solution), (_, tip_stiffness), (_, loaded)] = &mut found;
    let mut compute = || {
        let stands = Configuration { pose: *pose, beta_rad: BETA.map(T::from_f64).into() };
        let upright = Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) };
        let frame = five.frame(&stands)?;
        let tool = Tool { tip_m: frame.tip_m, axis: frame.axes.column(2).into() };
        let near = Configuration { pose: upright, beta_rad: Vector2::zeros() };
        *solution = bits_of(&solution_numbers(&five.inverse(&tool, &near)?));
        *frame_solution = bits_of(&solution_numbers(&five.inverse_frame(&frame)?));
        *tip_stiffness = lower_of(&five.tip_stiffness(&five.machine.stiffness(pose)?, &stands)?);
        let wrench = wrench(WRENCH);
        let table = table.has_factor_form().then_some(table);
        let command = five.compensated(table, &tool, &wrench, &stands)?;
        let (moved, turned) = (command.deflection.translation_m, command.deflection.rotation_rad);
        *loaded = bits_of(&[&solution_numbers(&command.solution), moved.as_slice(), turned.as_slice()].concat());
        Ok::<(), ToolDeflectionError>(())
    };
    // the firmware's error shows in what is empty there
    compute().ok();
    found
}

/// What the compensator asks for after three periods, for three screws and for five axes; and after three more with a weight, zeroed
/// upright.
fn offsets<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>, pose: &Pose<T>) -> Vec<u64> {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let mut screws = Compensator::<T, 3>::new(&settings).expect("the default is in range");
    let mut axes = Compensator::<T, 5>::new(&settings).expect("the default is in range");
    let stands = Configuration { pose: *pose, beta_rad: BETA.map(T::from_f64).into() };
    let reading = Reading { enabled: true, wrench: wrench(WRENCH), rise: T::from_f64(4.5).into() };
    let tip_m = TIP_M.map(T::from_f64).into();
    let upright = Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) };
    let zeroed_at = Configuration { pose: upright, beta_rad: Vector2::zeros() };
    let (platform, tool) = (weight(PLATFORM), weight(TOOL));
    let model = &Model::new(five.machine, table);
    let of_screws = CarriedWeight::<T, 3>::new(model, &platform, &upright, tip_m);
    let of_axes = CarriedWeight::<T, 5>::new(model, five.wrist, &platform, &tool, &zeroed_at);
    let carried = (of_screws.expect("a weight in range"), of_axes.expect("a weight in range"));
    let mut found = Vec::new();
    for carried in [None, Some(carried)] {
        screws.set_weight(carried.map(|of| of.0));
        axes.set_weight(carried.map(|of| of.1));
        for _ in 0..3 {
            screws.update(model, pose, tip_m, &reading);
            axes.update(model, five.wrist, &stands, &reading);
        }
        found.extend(bits_of(&[screws.joints().as_slice(), axes.joints().as_slice()].concat()));
    }
    found
}

/// The cycle and a period of the compensator that compensate no more than is known, as embed/firmware/src/bin/parity.rs has them.
fn known<T: Scalar>(
    machine: &Machine<T>,
    (table, uncertainty): (&CorrectionTable<'_, T>, &TableUncertainty<T>),
    pose: &Pose<T>,
) -> Option<Vec<u64>> {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let (wrench, tip_m) = (wrench(WRENCH), TIP_M.map(T::from_f64).into());
    let KnownCycle { cycle, uncertainty: of_cycle, share } =
        table.cycle_known(machine, uncertainty, pose, &wrench, tip_m).ok()?;
    let Pose { theta_rad, sigma_rad, z0_m } = cycle.compensated.pose;
    let mut compensator = Compensator::<T, 3>::new(&settings).ok()?;
    let reading = Reading { enabled: true, wrench, rise: T::from_f64(4.5).into() };
    let model = Model::new(machine, table).with_uncertainty(uncertainty);
    let offset = compensator.update(&model, pose, tip_m, &reading);
    let in_period = offset.known?;
    let numbers = [
        of_cycle.variance_m2.as_slice(),
        &[share, theta_rad, sigma_rad, z0_m],
        in_period.uncertainty.variance_m2.as_slice(),
        &[in_period.share],
        offset.joints.as_slice(),
    ];
    Some(bits_of(&numbers.concat()))
}

fn values<T: Scalar>(
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
    pose: &Pose<T>,
) -> Result<Vec<(&'static str, Vec<u64>)>, CycleError> {
    let (bits, lower) = (bits_of::<T>, lower_of::<T>);
    let (wrench, turned_at) = (wrench(WRENCH), wrench(TURNED_AT));
    let warm = machine.at_temperature(T::from_f64(31.5)).map_err(|_| StiffnessError::NotFinite)?;
    let grown = machine.thermal_deflection(pose, T::from_f64(4.5))?;
    let diagonal = table.diagonal_form(machine, pose)?;
    let factor = table.factor_form(machine, pose)?;
    let d = factor.factor.deflection(&wrench)?.plus(&machine.load_dependent_deflection(pose, &wrench, &turned_at)?);
    let lengths = machine.inverse(pose)?;
    let forward = machine.forward(&lengths)?;
    let cycle = table.cycle(machine, pose, &wrench, TIP_M.map(T::from_f64).into())?.compensated;
    Ok(vec![
        ("q", bits(lengths.q_m.as_slice())),
        ("forward", bits(&[forward.theta_rad, forward.sigma_rad, forward.z0_m])),
        ("jacobian", bits(machine.jacobian(pose)?.transpose().as_slice())),
        ("k_p", lower(&machine.stiffness(pose)?)),
        ("k_m_diagonal", lower(&diagonal.factor.stiffness())),
        ("k_m_factor", lower(&factor.factor.stiffness())),
        ("deflection", bits(d.to_vector().as_slice())),
        ("k_p_warm", lower(&warm.stiffness(pose)?)),
        ("thermal", bits(grown.to_vector().as_slice())),
        (
            "compensated",
            bits(
                &[&[cycle.pose.theta_rad, cycle.pose.sigma_rad, cycle.pose.z0_m], cycle.lengths.q_m.as_slice()]
                    .concat(),
            ),
        ),
    ])
}

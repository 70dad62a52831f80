//! Prints what the core computes on a Cortex-M, bit for bit, for `cargo xtask qemu` to hold against the host.
//!
//! One JSON object a line over semihosting: a pose, in `f64` and `f32`, with screw lengths, K_p, K_m in both
//! forms, the deflection under a wrench, the cycle that makes up for it, what warmth does, and the five axes. Numbers are the bits of
//! their `f64` value. The machine and its table are the `coefficients.rs` that `build.rs` was given.

#![no_std]
#![no_main]

use core::borrow::Borrow;
use core::fmt::Write;

use cortex_m_rt::entry;
use cortex_m_semihosting::hio;
use heapless::Vec;
use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, OutsideBox, Reading, Weight};
use pkm_core::nalgebra::Vector2;
use pkm_core::tables::reference::{UNCERTAINTY_F32, UNCERTAINTY_F64};
use pkm_core::{
    Configuration, CorrectionError, CorrectionTable, CycleError, Domain, FiveAxis, Machine, Model, Pose, Scalar,
    Stiffness, StiffnessError, TableUncertainty, Tool, ToolDeflectionError, ToolSolution, Wrench,
};
use serde::Serialize;

#[path = "../panic.rs"]
mod panic;
#[path = "../semihosting.rs"]
mod semihosting;

#[allow(dead_code)]
mod coefficients {
    include!(concat!(env!("OUT_DIR"), "/coefficients.rs"));
}

/// Longest line: 204 numbers of 20 digits and their commas, and the names.
const LINE: usize = 5056;

/// Of the cycle, in A-uvw.
const TIP_M: [f64; 3] = [0.01, -0.02, 0.3];
/// The load, N and N·m, and the one at which friction turned back.
const WRENCH: [f64; 6] = [100.0, -50.0, -400.0, 2.0, -8.0, 5.0];
const TURNED_AT: [f64; 6] = [150.0, -20.0, -600.0, 3.0, -8.0, 9.0];
/// Of the five axes, rad.
const BETA: [f64; 2] = [0.3, -0.2];
/// Weights of platform and tool, N along x, y, z of B, and their centres of mass in A-uvw and in the tool's axes, m.
const PLATFORM: [[f64; 3]; 2] = [[785.0, 20.0, -30.0], [0.01, 0.02, 0.1]];
const TOOL: [[f64; 3]; 2] = [[196.0, 5.0, -8.0], [0.0, 0.01, -0.2]];

#[derive(Serialize)]
struct Line {
    float_bits: u8,
    /// θ, σ in rad, Z0 in m.
    pose: [u64; 3],
    error: Option<&'static str>,
    inside: bool,
    q: Vec<u64, 3>,
    /// Pose of `q`, and the Jacobian there.
    forward: Vec<u64, 3>,
    jacobian: Vec<u64, 9>,
    k_p: Vec<u64, 21>,
    k_m_diagonal: Vec<u64, 21>,
    k_m_factor: Vec<u64, 21>,
    deflection: Vec<u64, 6>,
    k_p_warm: Vec<u64, 21>,
    thermal: Vec<u64, 6>,
    compensated: Vec<u64, 6>,
    /// The tool of the pose with [`BETA`], found from θ = σ = β1 = β2 = 0. This and what follows may be empty.
    solution: Vec<u64, 9>,
    frame_solution: Vec<u64, 9>,
    tip_stiffness: Vec<u64, 21>,
    loaded: Vec<u64, 15>,
    /// Of the compensator after three periods: of the screws alone, and of the five axes with [`BETA`]. Then with a weight, zeroed
    /// upright, after three more.
    offsets: Vec<u64, 16>,
    /// The cycle that compensates no more than is known: variances, share, pose to command; then the compensator that does so after a
    /// period, with variances and share.
    known: Vec<u64, 14>,
}

fn bits<T: Scalar, const N: usize>(values: impl IntoIterator<Item: Borrow<T>>) -> Vec<u64, N> {
    values.into_iter().map(|v| v.borrow().to_f64().to_bits()).collect()
}

fn wrench<T: Scalar>(components: [f64; 6]) -> Wrench<T> {
    Wrench::from_vector(components.map(T::from_f64).into())
}

fn solution_bits<T: Scalar, const N: usize>(solution: &ToolSolution<T>) -> Vec<u64, N> {
    let Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad } = solution.configuration;
    let pose = [theta_rad, sigma_rad, z0_m];
    bits::<T, N>(
        pose.iter().chain(&beta_rad).chain(&solution.joints.lengths.q_m).chain([&solution.normalised_determinant]),
    )
}

fn weight<T: Scalar>([force_n, centre_m]: [[f64; 3]; 2]) -> Weight<T> {
    Weight { force_n: force_n.map(T::from_f64).into(), centre_m: centre_m.map(T::from_f64).into() }
}

/// Empty where a weight is refused.
fn offsets<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>, pose: &Pose<T>) -> Vec<u64, 16> {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let (Ok(mut screws), Ok(mut axes)) = (Compensator::<T, 3>::new(&settings), Compensator::<T, 5>::new(&settings))
    else {
        return Vec::new();
    };
    let stands = Configuration { pose: *pose, beta_rad: BETA.map(T::from_f64).into() };
    let reading = Reading { enabled: true, wrench: wrench(WRENCH), rise: T::from_f64(4.5).into() };
    let tip_m = TIP_M.map(T::from_f64).into();
    let upright = Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) };
    let zeroed_at = Configuration { pose: upright, beta_rad: Vector2::zeros() };
    let platform = weight(PLATFORM);
    let model = &Model::new(five.machine, table);
    let carried = (
        CarriedWeight::<T, 3>::new(model, &platform, &upright, tip_m),
        CarriedWeight::<T, 5>::new(model, five.wrist, &platform, &weight(TOOL), &zeroed_at),
    );
    let (Ok(of_screws), Ok(of_axes)) = carried else { return Vec::new() };
    let mut found = Vec::new();
    for carried in [None, Some((of_screws, of_axes))] {
        screws.set_weight(carried.map(|of| of.0));
        axes.set_weight(carried.map(|of| of.1));
        for _ in 0..3 {
            screws.update(model, pose, tip_m, &reading);
            axes.update(model, five.wrist, &stands, &reading);
        }
        found.extend(bits::<T, 8>(screws.joints().iter().chain(&axes.joints())));
    }
    found
}

/// Empty with an error.
fn known<T: Scalar>(
    machine: &Machine<T>,
    (table, uncertainty): (&CorrectionTable<'_, T>, &TableUncertainty<T>),
    pose: &Pose<T>,
) -> Vec<u64, 14> {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let (wrench, tip_m) = (wrench(WRENCH), TIP_M.map(T::from_f64).into());
    let (Ok(cycle), Ok(mut compensator)) =
        (table.cycle_known(machine, uncertainty, pose, &wrench, tip_m), Compensator::<T, 3>::new(&settings))
    else {
        return Vec::new();
    };
    let Pose { theta_rad, sigma_rad, z0_m } = cycle.cycle.compensated.pose;
    let command = [cycle.share, theta_rad, sigma_rad, z0_m];
    let reading = Reading { enabled: true, wrench, rise: T::from_f64(4.5).into() };
    let model = Model::new(machine, table).with_uncertainty(uncertainty);
    let offset = compensator.update(&model, pose, tip_m, &reading);
    let Some(known) = offset.known else { return Vec::new() };
    let in_period = known.uncertainty.variance_m2.iter().chain([&known.share]).chain(&offset.joints);
    bits::<T, 14>(cycle.uncertainty.variance_m2.iter().chain(&command).chain(in_period))
}

fn lower<T: Scalar>(k: &Stiffness<T>) -> Vec<u64, 21> {
    // row by row, which in a symmetric matrix is column by column
    let columns = k.matrix().data.0;
    bits::<T, 21>(columns.iter().enumerate().flat_map(|(i, row)| row.iter().take(i + 1)))
}

impl Line {
    fn new<T: Scalar>(
        float_bits: u8,
        five: &FiveAxis<'_, T>,
        (table, uncertainty): (&CorrectionTable<'_, T>, &TableUncertainty<T>),
        [theta, sigma, z0]: [f64; 3],
    ) -> Self {
        let machine = five.machine;
        let pose = Pose { theta_rad: T::from_f64(theta), sigma_rad: T::from_f64(sigma), z0_m: T::from_f64(z0) };
        let mut line = Self {
            float_bits,
            pose: [theta, sigma, z0].map(f64::to_bits),
            error: None,
            inside: table.domain(&pose) == Domain::Inside,
            q: Vec::new(),
            forward: Vec::new(),
            jacobian: Vec::new(),
            k_p: Vec::new(),
            k_m_diagonal: Vec::new(),
            k_m_factor: Vec::new(),
            deflection: Vec::new(),
            k_p_warm: Vec::new(),
            thermal: Vec::new(),
            compensated: Vec::new(),
            solution: Vec::new(),
            frame_solution: Vec::new(),
            tip_stiffness: Vec::new(),
            loaded: Vec::new(),
            offsets: Vec::new(),
            known: Vec::new(),
        };
        if let Err(error) = line.compute(machine, table, &pose) {
            line.error = Some(match error {
                CycleError::Correction(CorrectionError::Stiffness(_)) => "stiffness",
                CycleError::Correction(CorrectionError::NotPositive { .. }) => "not_positive",
                _ => "other",
            });
        } else {
            // what was found before an error stays
            line.compute_five_axes(five, table, &pose).ok();
            line.offsets = offsets(five, table, &pose);
            line.known = known(machine, (table, uncertainty), &pose);
        }
        line
    }

    fn compute_five_axes<T: Scalar>(
        &mut self,
        five: &FiveAxis<'_, T>,
        table: &CorrectionTable<'_, T>,
        pose: &Pose<T>,
    ) -> Result<(), ToolDeflectionError> {
        let stands = Configuration { pose: *pose, beta_rad: BETA.map(T::from_f64).into() };
        let upright = Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) };
        let frame = five.frame(&stands)?;
        let tool = Tool { tip_m: frame.tip_m, axis: frame.axes.column(2).into() };
        self.solution =
            solution_bits(&five.inverse(&tool, &Configuration { pose: upright, beta_rad: Vector2::zeros() })?);
        self.frame_solution = solution_bits(&five.inverse_frame(&frame)?);
        self.tip_stiffness = lower(&five.tip_stiffness(&five.machine.stiffness(pose)?, &stands)?);
        let wrench = wrench(WRENCH);
        let table = table.has_factor_form().then_some(table);
        let loaded = five.compensated(table, &tool, &wrench, &stands)?;
        self.loaded = solution_bits(&loaded.solution);
        let moved = loaded.deflection.translation_m.iter().chain(&loaded.deflection.rotation_rad);
        self.loaded.extend(bits::<T, 6>(moved));
        Ok(())
    }

    fn compute<T: Scalar>(
        &mut self,
        machine: &Machine<T>,
        table: &CorrectionTable<'_, T>,
        pose: &Pose<T>,
    ) -> Result<(), CycleError> {
        let (wrench, turned_at) = (wrench(WRENCH), wrench(TURNED_AT));
        let lengths = machine.inverse(pose)?;
        self.q = bits::<T, 3>(&lengths.q_m);
        let forward = machine.forward(&lengths)?;
        self.forward = bits::<T, 3>([forward.theta_rad, forward.sigma_rad, forward.z0_m]);
        // row by row
        self.jacobian = bits::<T, 9>(&machine.jacobian(pose)?.transpose());
        self.k_p = lower(&machine.stiffness(pose)?);
        self.k_m_diagonal = lower(&table.diagonal_form(machine, pose)?.factor.stiffness());
        let corrected = if table.has_factor_form() {
            table.factor_form(machine, pose)?
        } else {
            table.diagonal_form(machine, pose)?
        };
        self.k_m_factor = lower(&corrected.factor.stiffness());
        let extra = machine.load_dependent_deflection(pose, &wrench, &turned_at)?;
        let d = corrected.factor.deflection(&wrench)?.plus(&extra);
        self.deflection = bits::<T, 6>(&d.to_vector());
        let warm = machine.at_temperature(T::from_f64(31.5)).map_err(|_| StiffnessError::NotFinite)?;
        self.k_p_warm = lower(&warm.stiffness(pose)?);
        let grown = machine.thermal_deflection(pose, T::from_f64(4.5))?;
        self.thermal = bits::<T, 6>(&grown.to_vector());
        let compensated = table.cycle(machine, pose, &wrench, TIP_M.map(T::from_f64).into())?.compensated;
        let Pose { theta_rad, sigma_rad, z0_m } = compensated.pose;
        let pose = [theta_rad, sigma_rad, z0_m];
        self.compensated = bits::<T, 6>(pose.iter().chain(&compensated.lengths.q_m));
        Ok(())
    }
}

fn print(line: &Line, out: &mut hio::HostStream) -> Result<(), ()> {
    let text = serde_json_core::to_string::<_, LINE>(line).map_err(drop)?;
    writeln!(out, "{text}").map_err(drop)
}

fn print_all() -> Result<(), ()> {
    let mut out = hio::hstdout()?;
    // a grid over the reference machine's box and a quarter beyond, in ° and mm
    let (angles, heights) = ([-18.75, -15.0, -7.3, 0.0, 4.1, 15.0, 18.75], [492.5, 500.0, 531.7, 560.0, 567.5]);
    let grid = angles
        .into_iter()
        .flat_map(|t| angles.into_iter().flat_map(move |s| heights.into_iter().map(move |z| (t, s, z))));
    let poses = grid.map(|(t, s, z): (f64, f64, f64)| [t.to_radians(), s.to_radians(), z / 1e3]);
    // the paper's Table 5, X0 and Z0 in mm: all outside its own box
    let table_5 = [
        (-307.38, 363.45),
        (-232.79, 375.90),
        (-263.39, 315.72),
        (-338.00, 300.14),
        (-156.24, 433.25),
        (-184.17, 447.83),
        (-206.45, 458.46),
    ];
    let table_5 = table_5.map(|(x0, z0): (f64, f64)| [Scalar::atan2(x0, z0), 0.0, z0 / 1e3]);
    // refusals: a NaN, too high, beyond a right angle
    let refused = [[f64::NAN, 0.0, 0.5], [0.0, 0.0, 0.9], [1.6, 0.0, 0.5]];
    let double = FiveAxis { machine: &coefficients::MACHINE_F64, wrist: &coefficients::WRIST_F64 };
    let single = FiveAxis { machine: &coefficients::MACHINE_F32, wrist: &coefficients::WRIST_F32 };
    for pose in poses.chain(table_5).chain(refused) {
        // not every table states its uncertainty
        let known = (&coefficients::TABLE_F64, &UNCERTAINTY_F64);
        print(&Line::new(64, &double, known, pose), &mut out)?;
        print(&Line::new(32, &single, (&coefficients::TABLE_F32, &UNCERTAINTY_F32), pose), &mut out)?;
    }
    Ok(())
}

#[entry]
fn main() -> ! {
    semihosting::end(print_all().is_ok())
}

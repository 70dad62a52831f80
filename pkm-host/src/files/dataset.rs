//! CSV files: poses, stiffness, measured readings.

use std::collections::HashMap;

use pkm_core::{KinematicsError, Pose, ScrewLengths, Stiffness};

use crate::error::{Failure, Result, status};
use crate::files::csv::LENGTH_COLUMNS;
pub use crate::files::csv::{POSE_COLUMNS, Row, Sheet, to_csv};
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::pose::{NamedPose, pose_of, written_units};

/// The wrench on the platform.
pub const WRENCH_COLUMNS: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];
/// The deflection, loaded minus unloaded.
pub const DEFLECTION_COLUMNS: [&str; 6] = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];
pub(crate) const POINT_COLUMNS: [&str; 3] = ["point_u_mm", "point_v_mm", "point_w_mm"];
const OTHER_MEASURED: [&str; 7] =
    ["series", "repeat", "load", "direction", "temperature_c", "sigma_linear_um", "sigma_angular_urad"];

/// Far beyond what a machine bears, and its square still a number.
pub(crate) const MOST_LOAD: f64 = 1e12;

/// Column of the stiffness k_ij, i ≤ j, from 1.
pub(crate) fn stiffness_column(i: usize, j: usize) -> String {
    format!("k{}{}", i.min(j) + 1, i.max(j) + 1)
}

/// The 21 stiffness columns in the order of the format: the upper triangle row by row.
pub fn stiffness_columns() -> impl Iterator<Item = (usize, usize, String)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j, stiffness_column(i, j))))
}

impl Sheet {
    /// Force and moment of a row.
    pub(crate) fn load(&self, row: &Row) -> Result<[f64; 6]> {
        let load = self.numbers(row, WRENCH_COLUMNS)?;
        match load.iter().position(|f| f.abs() > MOST_LOAD) {
            None => Ok(load),
            Some(i) => {
                let message = format!("expected a load within ±{MOST_LOAD:e} N or N·m, found {:e}", load[i]);
                Err(self.failure(row, message).at_column(WRENCH_COLUMNS[i]))
            }
        }
    }

    /// The pose of every row, each within the machine's reach.
    ///
    /// # Errors
    /// Missing columns, cells that are no numbers, and poses that the machine cannot take.
    pub fn poses(&self, machine: &MachineFile) -> Result<Vec<NamedPose>> {
        self.require(&["pose"])?;
        let angles = POSE_COLUMNS[1..].iter().any(|c| self.has(c));
        let lengths = LENGTH_COLUMNS.iter().any(|c| self.has(c));
        if angles && lengths {
            let column = LENGTH_COLUMNS.iter().find(|c| self.has(c)).expect("one is there");
            let message = "give the pose as theta_deg, sigma_deg, z0_mm or as q1_mm, q2_mm, q3_mm, not both";
            let failure = Failure::input(message).in_file(&self.source.name);
            return Err(failure.at_line(self.header_line).at_column(*column));
        }
        self.require(if lengths { &LENGTH_COLUMNS } else { &POSE_COLUMNS[1..] })?;
        self.rows
            .iter()
            .map(|row| {
                let id = self.cell(row, "pose")?.to_owned();
                let columns: &[&str] = if lengths { &LENGTH_COLUMNS } else { &POSE_COLUMNS[1..] };
                if columns.iter().all(|c| self.cell(row, c).is_ok_and(str::is_empty)) {
                    let message = format!("row `{id}` has no pose: if it is a sum or a note, delete it");
                    return Err(self.failure(row, message).at_column(columns[0]));
                }
                let refused = |e: KinematicsError, message: String| {
                    let column = match e {
                        KinematicsError::OutOfTravel { limb } if lengths => format!("q{limb}_mm"),
                        _ => "pose".to_owned(),
                    };
                    let failure = Failure::refused(status(e), format!("pose `{id}`: {message}"));
                    failure.in_file(&self.source.name).at_line(row.line).at_column(column)
                };
                let pose = if lengths {
                    let q_m = self.numbers(row, LENGTH_COLUMNS)?.map(|mm| mm / 1e3);
                    let forward = machine.machine.forward(&ScrewLengths { q_m });
                    forward.map_err(|e| match e {
                        KinematicsError::OutOfTravel { limb } => {
                            refused(e, format!("{e}: {}", machine.travel_of(limb, &ScrewLengths { q_m })))
                        }
                        e => refused(e, e.to_string()),
                    })?
                } else {
                    let [theta, sigma, z0] = self.numbers(row, ["theta_deg", "sigma_deg", "z0_mm"])?;
                    let pose = pose_of(theta, sigma, z0);
                    machine.machine.inverse(&pose).map_err(|e| refused(e, machine.refusal(e, &pose)))?;
                    pose
                };
                Ok(NamedPose { id, line: row.line, pose })
            })
            .collect()
    }
}

/// The cells of a pose, in the units of files.
pub fn pose_cells(pose: &Pose<f64>) -> [String; 3] {
    written_units(pose).map(|v| v.to_string())
}

/// Refuses two poses with one id, where the id has to tell them apart.
///
/// # Errors
/// The second of the two.
pub fn refuse_doubled_ids(file: &str, poses: &[NamedPose]) -> Result<()> {
    let mut seen: HashMap<&str, u64> = HashMap::new();
    for pose in poses {
        if let Some(first) = seen.insert(&pose.id, pose.line) {
            let message = format!("duplicate pose `{}`, first in line {first}", pose.id);
            return Err(Failure::input(message).in_file(file).at_line(pose.line).at_column("pose"));
        }
    }
    Ok(())
}

/// Reads a list of poses, with warnings. Ids may repeat, as in a measured file.
///
/// # Errors
/// See [`Sheet`].
pub fn read_poses(source: Source, machine: &MachineFile) -> Result<(Vec<NamedPose>, Vec<String>)> {
    let known = [&POSE_COLUMNS[..], &LENGTH_COLUMNS].concat();
    let sheet = Sheet::parse(source, &known)?;
    Ok((sheet.poses(machine)?, sheet.warnings))
}

/// What a stiffness file says of one pose.
#[derive(Clone, Debug)]
pub struct Target {
    /// k11…k66.
    pub principal: [f64; 6],
    /// The whole matrix, when the file has the couplings.
    pub full: Option<Stiffness<f64>>,
}

/// Stiffness at poses: the paper's K_a.
pub struct StiffnessData {
    /// File, as the user named it.
    pub source: Source,
    /// Poses in the file's order.
    pub poses: Vec<NamedPose>,
    /// Stiffness at each.
    pub targets: Vec<Target>,
    /// What is wrong with the file and yet not refused.
    pub warnings: Vec<String>,
}

/// Reads a stiffness file.
///
/// # Errors
/// See [`Sheet`]; a doubled pose id; some but not all couplings; a matrix that is not positive definite.
pub fn read_stiffness(source: Source, machine: &MachineFile) -> Result<StiffnessData> {
    let all: Vec<_> = stiffness_columns().collect();
    let mut known = [&POSE_COLUMNS[..], &LENGTH_COLUMNS].concat();
    known.extend(all.iter().map(|(_, _, name)| name.as_str()));
    let mirrored: Vec<(usize, usize, String)> =
        (0..6).flat_map(|i| (0..i).map(move |j| (i, j, format!("k{}{}", i + 1, j + 1)))).collect();
    known.extend(mirrored.iter().map(|(_, _, name)| name.as_str()));
    let sheet = Sheet::parse(source, &known)?;
    let poses = sheet.poses(machine)?;
    refuse_doubled_ids(&sheet.source.name, &poses)?;

    let diagonal: [String; 6] = std::array::from_fn(|i| stiffness_column(i, i));
    let diagonal: [&str; 6] = std::array::from_fn(|i| diagonal[i].as_str());
    sheet.require(&diagonal)?;
    let full = all.iter().any(|(i, j, name)| i != j && sheet.has(name));
    if let Some((_, _, name)) = all.iter().find(|(_, _, name)| full && !sheet.has(name)) {
        return Err(sheet.missing(name, ": give all 15 couplings or none"));
    }
    let read = |row: &Row| {
        let principal = sheet.numbers(row, diagonal)?;
        if let Some(i) = principal.iter().position(|k| !(1.0..=1e15).contains(k)) {
            let message = format!("expected a stiffness from 1 to 1e15 N/m or N·m/rad, found {:e}", principal[i]);
            return Err(sheet.failure(row, message).at_column(diagonal[i]));
        }
        if !full {
            return Ok(Target { principal, full: None });
        }
        let mut lower = [[0.0; 6]; 6];
        for (i, j, name) in &all {
            lower[*j][*i] = sheet.number(row, name)?;
        }
        for (i, j, name) in mirrored.iter().filter(|(_, _, name)| sheet.has(name)) {
            let (above, below) = (lower[*i][*j], sheet.number(row, name)?);
            if (above - below).abs() > 1e-6 * (principal[*i] * principal[*j]).sqrt() {
                let message =
                    format!("expected a symmetric matrix, found {below} here and {above} in k{}{}", j + 1, i + 1);
                return Err(sheet.failure(row, message).at_column(name));
            }
        }
        let k = Stiffness::from_lower(&lower);
        match k.factor() {
            Ok(_) => Ok(Target { principal, full: Some(k) }),
            Err(_) => Err(sheet
                .failure(row, "expected a symmetric positive definite matrix, found an indefinite one")
                .at_column("k11…k66")),
        }
    };
    let targets = sheet.rows.iter().map(read).collect::<Result<Vec<_>>>()?;
    Ok(StiffnessData { poses, targets, source: sheet.source, warnings: sheet.warnings })
}

/// A load case of a measured file.
pub struct LoadCase {
    /// Commanded pose.
    pub pose: NamedPose,
    /// Force in N and moment in N·m on the platform, at `point_m`, in A-uvw.
    pub wrench: pkm_core::Wrench<f64>,
    /// Where wrench and deflection are given, in A-uvw.
    pub point_m: [f64; 3],
}

/// Reads poses and wrenches of a measured file, and its cells as they stand.
///
/// # Errors
/// See [`Sheet`].
pub fn read_load_cases(source: Source, machine: &MachineFile) -> Result<(Sheet, Vec<LoadCase>)> {
    let known =
        [&POSE_COLUMNS[..], &LENGTH_COLUMNS, &WRENCH_COLUMNS, &DEFLECTION_COLUMNS, &POINT_COLUMNS, &OTHER_MEASURED]
            .concat();
    let sheet = Sheet::parse(source, &known)?;
    sheet.require(&WRENCH_COLUMNS)?;
    let elsewhere = POINT_COLUMNS.iter().any(|c| sheet.has(c));
    if elsewhere {
        sheet.require(&POINT_COLUMNS)?;
    }
    let poses = sheet.poses(machine)?;
    let numeric = DEFLECTION_COLUMNS.iter().chain(&["temperature_c", "sigma_linear_um", "sigma_angular_urad"]);
    for column in numeric.filter(|c| sheet.has(c)) {
        for row in sheet.rows.iter() {
            // a blank cell is a channel that was not measured
            if !sheet.cell(row, column)?.is_empty() {
                let value = sheet.number(row, column).map_err(|mut failure| {
                    failure.message.push_str(" (leave the cell empty where nothing was measured)");
                    failure
                })?;
                let wrong = if column.starts_with("sigma_") && value < 0.0 {
                    "a standard deviation of at least 0"
                } else if *column == "temperature_c" && value < -273.15 {
                    "a temperature above -273.15 °C"
                } else {
                    continue;
                };
                return Err(sheet.failure(row, format!("expected {wrong}, found {value}")).at_column(*column));
            }
        }
    }
    for row in sheet.rows.iter().filter(|_| sheet.has("direction")) {
        let direction = sheet.cell(row, "direction")?;
        if !["", "load", "unload"].contains(&direction) {
            let message = format!("expected `load` or `unload`, found `{direction}`");
            return Err(sheet.failure(row, message).at_column("direction"));
        }
    }
    let cases = sheet
        .rows
        .iter()
        .zip(poses)
        .map(|(row, pose)| {
            let wrench = pkm_core::Wrench::from_array(sheet.load(row)?);
            let point_m = if elsewhere { sheet.numbers(row, POINT_COLUMNS)?.map(|mm| mm / 1e3) } else { [0.0; 3] };
            Ok(LoadCase { pose, wrench, point_m })
        })
        .collect::<Result<Vec<_>>>()?;
    Ok((sheet, cases))
}

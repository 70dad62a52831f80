//! CSV files: poses, stiffness, measured readings.

use std::collections::HashMap;

use nalgebra::Matrix6;
use pkm_core::{KinematicsError, Pose, ScrewLengths, Stiffness};

use crate::csv::LENGTH_COLUMNS;
pub use crate::csv::{POSE_COLUMNS, Row, Sheet, to_csv};
use crate::error::{Failure, Result, printable, status};
use crate::machine::MachineFile;
use crate::pose::{NamedPose, pose_of, written_units};
use crate::source::Source;

/// The wrench on the platform.
pub const WRENCH_COLUMNS: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];
/// The deflection, loaded minus unloaded.
pub const DEFLECTION_COLUMNS: [&str; 6] = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];
/// The direction of a gauge.
pub const GAUGE_COLUMNS: [&str; 3] = ["gauge_u", "gauge_v", "gauge_w"];
/// Everything that may be read: the deflection, or its part along a gauge.
pub const READ_COLUMNS: [&str; 7] = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad", GAUGE_READING];
/// What a gauge reads.
pub const GAUGE_READING: &str = "gauge_um";
/// Expanded uncertainties of the translation, coverage 95 %, that `predict` writes.
pub const U95_COLUMNS: [&str; 3] = ["u95_dx_um", "u95_dy_um", "u95_dz_um"];
/// Standard deviations of the deflection, zero error included.
pub const SIGMA_COLUMNS: [&str; 6] =
    ["sigma_dx_um", "sigma_dy_um", "sigma_dz_um", "sigma_rx_urad", "sigma_ry_urad", "sigma_rz_urad"];
/// Its correlations, row by row above the diagonal.
#[rustfmt::skip] // a row of the matrix a line
pub const CORRELATION_COLUMNS: [&str; 15] = [
    "correlation_dx_dy", "correlation_dx_dz", "correlation_dx_rx", "correlation_dx_ry", "correlation_dx_rz",
    "correlation_dy_dz", "correlation_dy_rx", "correlation_dy_ry", "correlation_dy_rz",
    "correlation_dz_rx", "correlation_dz_ry", "correlation_dz_rz",
    "correlation_rx_ry", "correlation_rx_rz",
    "correlation_ry_rz",
];
/// Relative scatter of the recorded load.
pub const LOAD_RANDOM_COLUMN: &str = "load_random";
/// Share of the variance that the zero of the series has.
pub const ZERO_SHARE_COLUMN: &str = "zero_share";
/// Where the deflection is read, and the load given if it has no point of its own.
pub const POINT_COLUMNS: [&str; 3] = ["point_u_mm", "point_v_mm", "point_w_mm"];
/// Where the load is given.
pub const LOAD_POINT_COLUMNS: [&str; 3] = ["load_u_mm", "load_v_mm", "load_w_mm"];
/// How far the two halves of a stiffness matrix may differ, in √(k_ii k_jj).
const MAX_ASYMMETRY: f64 = 1e-6;
/// Far beyond what a machine bears, and its square still a number.
pub const MAX_LOAD: f64 = 1e12;

/// Column of the stiffness k_ij, i ≤ j, from 1.
pub fn stiffness_column(i: usize, j: usize) -> String {
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
        match load.iter().position(|f| f.abs() > MAX_LOAD) {
            None => Ok(load),
            Some(i) => {
                let message = format!("expected a load within ±{MAX_LOAD:e} N or N·m, found {:e}", load[i]);
                Err(self.failure(row, message).at_column(WRENCH_COLUMNS[i]))
            }
        }
    }

    /// The columns that the poses stand in.
    ///
    /// # Errors
    /// Missing columns; poses in both forms.
    pub(super) fn pose_columns(&self) -> Result<[&'static str; 3]> {
        self.require(&["pose"])?;
        let [_, theta, sigma, z0] = POSE_COLUMNS;
        let angles = [theta, sigma, z0].iter().any(|c| self.has(c));
        let length = LENGTH_COLUMNS.iter().find(|c| self.has(c));
        if let Some(column) = length.filter(|_| angles) {
            let message = "give the pose as theta_deg, sigma_deg, z0_mm or as q1_mm, q2_mm, q3_mm, not both";
            let failure = Failure::input(message).in_file(&self.source.name);
            return Err(failure.at_line(self.header_line).at_column(*column));
        }
        let columns = if length.is_some() { LENGTH_COLUMNS } else { [theta, sigma, z0] };
        self.require(&columns)?;
        Ok(columns)
    }

    /// The pose of a row, within the machine's reach.
    pub(super) fn pose(&self, row: &Row, columns: [&'static str; 3], machine: &MachineFile) -> Result<NamedPose> {
        let lengths = columns == LENGTH_COLUMNS;
        let id = self.cell(row, "pose")?.to_owned();
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
        let values = self.numbers(row, columns)?;
        let pose = if lengths {
            let q_m = values.map(|mm| mm / 1e3).into();
            let forward = machine.machine.forward(&ScrewLengths { q_m });
            forward.map_err(|e| match e {
                KinematicsError::OutOfTravel { limb } => {
                    refused(e, format!("{e}: {}", machine.travel_of(limb, &ScrewLengths { q_m })))
                }
                e => refused(e, e.to_string()),
            })?
        } else {
            let [theta, sigma, z0] = values;
            let pose = pose_of(theta, sigma, z0);
            machine.machine.inverse(&pose).map_err(|e| refused(e, machine.refusal(e, &pose)))?;
            pose
        };
        Ok(NamedPose { id, line: row.line, pose })
    }

    /// The pose of every row, each within the machine's reach.
    ///
    /// # Errors
    /// Missing columns, cells that are no numbers, and poses that the machine cannot take.
    pub fn poses(&self, machine: &MachineFile) -> Result<Vec<NamedPose>> {
        let columns = self.pose_columns()?;
        self.rows.iter().map(|row| self.pose(row, columns, machine)).collect()
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
    let diagonal: [String; 6] = std::array::from_fn(|i| stiffness_column(i, i));
    let diagonal: [&str; 6] = std::array::from_fn(|i| diagonal[i].as_str());
    if !diagonal.iter().any(|k| sheet.has(k)) && DEFLECTION_COLUMNS.iter().any(|d| sheet.has(d)) {
        let message = "these are deflections, and a table is fitted to stiffnesses k11 to k66: `pkm-host diagnose` takes deflections";
        return Err(Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line));
    }
    if let Some(found) = sheet.header.iter().find(|name| !sheet.has("k11") && name.to_lowercase().starts_with("k11")) {
        let message = format!("found `{}`: name the columns k11, k12 … k66, in N/m, N and N·m/rad", printable(found));
        return Err(Failure::input(message).in_file(&sheet.source.name).at_line(sheet.header_line).at_column("k11"));
    }
    let poses = sheet.poses(machine)?;
    refuse_doubled_ids(&sheet.source.name, &poses)?;
    sheet.require(&diagonal)?;
    // above the diagonal, below it, or both
    let couplings: Vec<[(usize, usize, &str); 2]> = (all.iter().filter(|(i, j, _)| i != j))
        .filter_map(|(i, j, above)| {
            let (_, _, below) = mirrored.iter().find(|(k, l, _)| (k, l) == (j, i))?;
            Some([(*i, *j, above.as_str()), (*i, *j, below.as_str())])
        })
        .collect();
    let is_there = |pair: &[(usize, usize, &str); 2]| pair.iter().any(|(_, _, name)| sheet.has(name));
    let full = couplings.iter().any(is_there);
    if let Some([(_, _, name), _]) = couplings.iter().find(|pair| full && !is_there(pair)) {
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
        let mut lower = Matrix6::from_diagonal(&principal.into());
        for pair in &couplings {
            let there: Vec<_> = pair.iter().filter(|(_, _, name)| sheet.has(name)).collect();
            let values = there.iter().map(|(_, _, name)| sheet.number(row, name)).collect::<Result<Vec<f64>>>()?;
            let (i, j, first) = *there[0];
            lower[(j, i)] = values[0];
            let most = MAX_ASYMMETRY * (principal[i] * principal[j]).sqrt();
            if let Some(other) = values.get(1).filter(|other| (values[0] - **other).abs() > most) {
                let message = format!(
                    "expected a symmetric matrix, found {other} here and {} in {first}, which differ by more than {MAX_ASYMMETRY:e} of \
                     √(k_ii k_jj): leave out the columns of one triangle, or write the mean into both",
                    values[0]
                );
                return Err(sheet.failure(row, message).at_column(there[1].2));
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
    let mut warnings = sheet.warnings;
    warnings.extend(same_poses(&sheet.source.name, &poses, &targets));
    Ok(StiffnessData { poses, targets, source: sheet.source, warnings })
}

/// Poses that are named at the most because they stand in a file twice.
const MAX_DUPLICATES_NAMED: usize = 3;

/// Warnings of poses that stand in a file twice under two names.
fn same_poses(file: &str, poses: &[NamedPose], targets: &[Target]) -> Vec<String> {
    let mut seen: HashMap<[i64; 3], usize> = HashMap::new();
    let mut warnings = Vec::new();
    for (n, pose) in poses.iter().enumerate() {
        let key = written_units(&pose.pose).map(|v| (v * 1e6).round() as i64);
        let Some(first) = seen.insert(key, n) else { continue };
        let most = (targets[first].principal.iter().zip(&targets[n].principal))
            .map(|(a, b)| (b / a - 1.0).abs())
            .fold(0.0, f64::max);
        warnings.push(format!(
            "{}:{}: pose `{}` is pose `{}` of line {} once more{}",
            printable(file),
            pose.line,
            printable(&pose.id),
            printable(&poses[first].id),
            poses[first].line,
            if most > 1e-3 {
                format!(", and its stiffness differs by up to {:.1} %: one of the two is wrong", 100.0 * most)
            } else {
                ", and counts twice in a fit".to_owned()
            }
        ));
    }
    let more = warnings.len().saturating_sub(MAX_DUPLICATES_NAMED);
    warnings.truncate(MAX_DUPLICATES_NAMED);
    if more > 0 {
        warnings.push(format!("{}: {more} more poses stand there twice", printable(file)));
    }
    warnings
}

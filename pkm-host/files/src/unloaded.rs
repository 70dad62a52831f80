//! Unloaded readings: where points are that move with the machine, or how far they are from balls on the base, at commanded poses.

use std::collections::{HashMap, HashSet};

use nalgebra::Vector2;
use pkm_core::{Configuration, ScrewLengths};

use crate::csv::{LENGTH_COLUMNS, POSE_COLUMNS, decimals};
use crate::dataset::{POINT_COLUMNS, Row, Sheet};
use crate::error::{Failure, Result, lines_text, printable, tool_status};
use crate::import::refuse_statistics;
use crate::machine::MachineFile;
use crate::pose::NamedPose;
use crate::source::Source;

/// Angles of the wrist: with them a point is on the tool.
const BETA_COLUMNS: [&str; 2] = ["beta1_deg", "beta2_deg"];
/// Where a point is in the frame of the measurement.
pub const AT_COLUMNS: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
/// How far it is from a ball on the base.
pub const DISTANCE_COLUMN: &str = "distance_mm";
/// 1 sd of each coordinate, or of the distance.
pub const SIGMA_COLUMN: &str = "sigma_linear_um";
/// Where a point is in the frame of the tool, from the tip.
const TOOL_COLUMNS: [&str; 3] = ["tool_x_mm", "tool_y_mm", "tool_z_mm"];
/// 1 sd of a target's given place; exact without.
const TARGET_SD_COLUMN: &str = "target_sd_mm";
/// Farthest place that is read, mm: no tracker reaches so far.
const MAX_MM: f64 = 1e6;

/// A point that moves with the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Empty where the file has no names.
    pub name: String,
    /// In A-uvw, or on a machine with a wrist in the tool's frame from the tip, m; `None` where the readings have to tell.
    pub at_m: Option<[f64; 3]>,
    /// Declared standard deviation of each coordinate of a given place, m; 0 where it is exact.
    pub sd_m: f64,
    /// Line of the file where it is first, from 1.
    pub line: u64,
}

/// What the machine was told, and which point was measured from which ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Index of the pose.
    pub pose: usize,
    /// Index of the target.
    pub target: usize,
    /// Index of the ball; `None` where a place was measured.
    pub ball: Option<usize>,
}

/// A line of the file.
#[derive(Clone, Copy, Debug)]
pub struct UnloadedReading {
    /// From 1.
    pub line: u64,
    /// Index of its sight; readings with one sight are repeats.
    pub sight: usize,
    /// x, y, z and distance, m.
    pub observed: [Option<f64>; 4],
    /// Declared standard deviation of each number, m.
    pub sigma_m: Option<f64>,
}

/// A commanded pose.
#[derive(Clone, Debug)]
pub struct Commanded {
    /// Name, line, and pose by the declared geometry.
    pub named: NamedPose,
    /// Lengths that the controller commanded.
    pub lengths: ScrewLengths<f64>,
    /// Angles of the wrist; `None` where nothing of it was measured.
    pub beta_rad: Option<Vector2<f64>>,
}

/// A file of unloaded readings.
#[derive(Clone)]
pub struct Unloaded {
    /// The file.
    pub source: Source,
    /// Different poses, in the order in which they appear.
    pub poses: Vec<Commanded>,
    /// Different targets.
    pub targets: Vec<Target>,
    /// Names of the balls on the base.
    pub balls: Vec<String>,
    /// Different sights.
    pub sights: Vec<Sight>,
    /// Rows.
    pub readings: Vec<UnloadedReading>,
    /// Least step of the numbers as written, m.
    pub resolution_m: f64,
    /// What is wrong with the file and yet not refused.
    pub warnings: Vec<String>,
}

/// Place of an item in a list, which it joins if it is new.
fn place_in<T>(list: &mut Vec<T>, is_it: impl Fn(&T) -> bool, new: impl FnOnce() -> T) -> usize {
    list.iter().position(is_it).unwrap_or_else(|| {
        list.push(new());
        list.len() - 1
    })
}

impl Unloaded {
    /// Whether the points are on the tool.
    pub fn has_wrist(&self) -> bool {
        self.poses.iter().any(|p| p.beta_rad.is_some())
    }

    /// Reads a file of unloaded readings.
    ///
    /// # Errors
    /// One message with file, line and column: missing columns, rows of means and other statistics, poses out of reach, a row without place and distance or with
    /// both, a target with two places, a deviation that is not above 0.
    pub fn read(source: Source, machine: &MachineFile) -> Result<Self> {
        let known = [
            &POSE_COLUMNS[..],
            &LENGTH_COLUMNS,
            &BETA_COLUMNS,
            &["target", TARGET_SD_COLUMN, "ball", DISTANCE_COLUMN, SIGMA_COLUMN],
            &AT_COLUMNS,
            &POINT_COLUMNS,
            &TOOL_COLUMNS,
        ]
        .concat();
        let mut sheet = Sheet::parse(source, &known)?;
        if let Some(failure) = refuse_statistics(&mut sheet).into_iter().next() {
            return Err(failure);
        }
        let pose_columns = sheet.pose_columns()?;
        let has_wrist = BETA_COLUMNS.iter().any(|c| sheet.has(c));
        if has_wrist {
            sheet.require(&BETA_COLUMNS)?;
        }
        let (own, other) = if has_wrist { (TOOL_COLUMNS, POINT_COLUMNS) } else { (POINT_COLUMNS, TOOL_COLUMNS) };
        if let Some(column) = other.iter().find(|c| sheet.has(c)) {
            let message = if has_wrist {
                "points on the tool, at angles of the wrist, have their places in tool_x_mm, tool_y_mm, tool_z_mm"
            } else {
                "points on the platform have their places in point_u_mm, point_v_mm, point_w_mm; points on the tool \
                 need the angles beta1_deg, beta2_deg"
            };
            let failure = Failure::input(message).in_file(&sheet.source.name);
            return Err(failure.at_line(sheet.header_line).at_column(*column));
        }
        if own.iter().any(|c| sheet.has(c)) {
            sheet.require(&own)?;
        }
        if sheet.has(DISTANCE_COLUMN) {
            sheet.require(&["ball"])?;
        } else {
            sheet.require(&AT_COLUMNS)?;
        }
        let mut this = Self {
            source: sheet.source.clone(),
            poses: Vec::new(),
            targets: Vec::new(),
            balls: Vec::new(),
            sights: Vec::new(),
            readings: Vec::new(),
            resolution_m: resolution_m(&sheet)?,
            warnings: sheet.warnings.clone(),
        };
        for row in &sheet.rows {
            this.add(&sheet, row, machine, pose_columns, own, has_wrist)?;
        }
        this.warnings.extend(this.copies());
        Ok(this)
    }

    fn add(
        &mut self,
        sheet: &Sheet,
        row: &Row,
        machine: &MachineFile,
        pose_columns: [&'static str; 3],
        place_columns: [&'static str; 3],
        has_wrist: bool,
    ) -> Result<()> {
        let fail = |column: &str, message: String| sheet.failure(row, message).at_column(column);
        let cell = |column: &str| if sheet.has(column) { sheet.cell(row, column) } else { Ok("") };
        let named = sheet.pose(row, pose_columns, machine)?;
        let refused = |e: pkm_core::KinematicsError| fail("pose", machine.refusal(e, &named.pose));
        let lengths = machine.machine.inverse(&named.pose).map_err(refused)?;
        let beta_rad = if has_wrist {
            let beta = Vector2::from(sheet.numbers(row, BETA_COLUMNS)?.map(f64::to_radians));
            let configuration = Configuration { pose: named.pose, beta_rad: beta };
            machine.five_axis()?.joints(&configuration).map_err(|e| {
                let failure = Failure::refused(tool_status(e), format!("pose `{}`: {e}", named.id));
                failure.in_file(&sheet.source.name).at_line(row.line).at_column(BETA_COLUMNS[0])
            })?;
            Some(beta)
        } else {
            None
        };
        let is_same = |p: &Commanded| p.named.pose == named.pose && p.beta_rad == beta_rad;
        let pose = place_in(&mut self.poses, is_same, || Commanded { named: named.clone(), lengths, beta_rad });

        let name = cell("target")?;
        let blank = |column: &&str| cell(column).is_ok_and(str::is_empty);
        let at_m = if place_columns.iter().all(&blank) {
            // what a tool's tip is says the machine file
            has_wrist.then_some([0.0; 3])
        } else {
            Some(numbers_within(sheet, row, place_columns)?.map(|mm| mm / 1e3))
        };
        let sd_m = if blank(&TARGET_SD_COLUMN) { 0.0 } else { sheet.number(row, TARGET_SD_COLUMN)? / 1e3 };
        if sd_m < 0.0 || (sd_m > 0.0 && at_m.is_none()) {
            let message = "expected a deviation of at least 0, and only of a target whose place is given";
            return Err(fail(TARGET_SD_COLUMN, message.into()));
        }
        let new = || Target { name: name.to_owned(), at_m, sd_m, line: row.line };
        let target = place_in(&mut self.targets, |t| t.name == name, new);
        if (self.targets[target].at_m, self.targets[target].sd_m) != (at_m, sd_m) {
            let first = self.targets[target].line;
            let message =
                format!("target `{name}` has another place in line {first}: give each target a name of its own");
            return Err(fail(place_columns[0], message));
        }

        let (observed, ball) = self.observed(sheet, row)?;
        let sigma_m = if blank(&SIGMA_COLUMN) { None } else { Some(sheet.number(row, SIGMA_COLUMN)? / 1e6) };
        if let Some(sigma) = sigma_m.filter(|s| !(*s > 0.0)) {
            let message = format!("expected a standard deviation above 0, found {}", sigma * 1e6);
            return Err(fail(SIGMA_COLUMN, message));
        }
        let wanted = Sight { pose, target, ball };
        let sight = place_in(&mut self.sights, |s| *s == wanted, || wanted);
        self.readings.push(UnloadedReading { line: row.line, sight, observed, sigma_m });
        Ok(())
    }

    /// What a row reads, m, and the ball that a distance is from.
    fn observed(&mut self, sheet: &Sheet, row: &Row) -> Result<([Option<f64>; 4], Option<usize>)> {
        let fail = |column: &str, message: &str| Err(sheet.failure(row, message).at_column(column));
        let has = |column: &str| sheet.has(column) && sheet.cell(row, column).is_ok_and(|c| !c.is_empty());
        let mut observed = [None; 4];
        match (AT_COLUMNS.iter().any(|c| has(c)), has(DISTANCE_COLUMN)) {
            (true, false) => {
                observed[..3].copy_from_slice(&numbers_within(sheet, row, AT_COLUMNS)?.map(|mm| Some(mm / 1e3)));
                Ok((observed, None))
            }
            (false, true) => {
                let [distance_mm] = numbers_within(sheet, row, [DISTANCE_COLUMN])?;
                if distance_mm <= 0.0 {
                    return fail(DISTANCE_COLUMN, &format!("expected a distance above 0, found {distance_mm}"));
                }
                observed[3] = Some(distance_mm / 1e3);
                let name = sheet.cell(row, "ball")?;
                Ok((observed, Some(place_in(&mut self.balls, |b| b == name, || name.to_owned()))))
            }
            (true, true) => fail(DISTANCE_COLUMN, "expected x_mm, y_mm, z_mm or a distance, found both"),
            (false, false) => fail(AT_COLUMNS[0], "expected a place or a distance, found empty cells"),
        }
    }

    /// Readings that stand in the file twice. Two places do not agree in three numbers; distances do by chance, but not all that are repeated.
    fn copies(&self) -> Option<String> {
        let (mut seen, mut sights) = (HashMap::new(), HashSet::new());
        let (mut copies, mut repeats) = (Vec::new(), 0);
        for r in &self.readings {
            repeats += usize::from(!sights.insert(r.sight));
            let first = *seen.entry((r.sight, r.observed.map(|v| v.map(f64::to_bits)))).or_insert(r.line);
            if first != r.line {
                copies.push((r, first));
            }
        }
        let are_all_copies = copies.len() == repeats;
        copies.retain(|(r, _)| are_all_copies || self.sights[r.sight].ball.is_none());
        let ((again, first), rest) = copies.split_first()?;
        let rest: Vec<u64> = rest.iter().map(|(r, _)| r.line).collect();
        let others = if rest.is_empty() { String::new() } else { format!(", and as often in {}", lines_text(&rest)) };
        Some(format!(
            "{}:{}: the same reading as in line {first}{others}: each counts as one of its own, delete one of two if it was not read twice",
            printable(&self.source.name),
            again.line
        ))
    }

    /// The same poses, targets and sights without some of the readings.
    pub fn without(&self, left_out: impl Fn(&UnloadedReading) -> bool) -> Self {
        let mut rest = self.clone();
        rest.readings.retain(|r| !left_out(r));
        rest
    }
}

/// Lengths in mm that a machine and its tracker can have.
fn numbers_within<const N: usize>(sheet: &Sheet, row: &Row, columns: [&'static str; N]) -> Result<[f64; N]> {
    let values = sheet.numbers(row, columns)?;
    match values.iter().position(|v| v.abs() > MAX_MM) {
        None => Ok(values),
        Some(i) => {
            let message = format!("expected a number within ±{MAX_MM} mm, found {}", values[i]);
            Err(sheet.failure(row, message).at_column(columns[i]))
        }
    }
}

/// Least step of measured numbers, by the digits behind their points.
fn resolution_m(sheet: &Sheet) -> Result<f64> {
    let mut digits = 0;
    for row in &sheet.rows {
        for column in AT_COLUMNS.iter().chain(&[DISTANCE_COLUMN]).filter(|c| sheet.has(c)) {
            digits = digits.max(decimals(sheet.cell(row, column)?));
        }
    }
    Ok(1e-3 * 10_f64.powi(-(digits.min(12) as i32)))
}

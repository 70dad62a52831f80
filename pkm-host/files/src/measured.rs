//! Rows of a measured file: pose, load and deflection of each, and all that is wrong with them.

use nalgebra::DMatrix;
use pkm_core::Wrench;
use pkm_diagnosis::Covariance;

use crate::csv::{self, Row, Sheet};
use crate::dataset::{
    CORRELATION_COLUMNS, DEFLECTION_COLUMNS, GAUGE_COLUMNS, LOAD_POINT_COLUMNS, LOAD_RANDOM_COLUMN, POINT_COLUMNS,
    READ_COLUMNS, SIGMA_COLUMNS, WRENCH_COLUMNS, ZERO_SHARE_COLUMN,
};
use crate::error::{Failure, Result};
use crate::import::{self, Imported, Renames};
use crate::machine::MachineFile;
use crate::pose::NamedPose;
use crate::source::Source;

/// Columns of numbers whose cells may be empty.
const OPTIONAL: [&str; 4] = ["temperature_c", "sigma_linear_um", "sigma_angular_urad", LOAD_RANDOM_COLUMN];

/// A load case of a measured file.
pub struct LoadCase {
    /// Commanded pose.
    pub pose: NamedPose,
    /// Force in N and moment in N·m on the platform, at `point_m`, in A-uvw.
    pub wrench: Wrench<f64>,
    /// Where the deflection is read, in A-uvw.
    pub point_m: [f64; 3],
    /// Unit direction, in A-uvw, of the gauge that reads it; `None` where components are read.
    pub gauge: Option<[f64; 3]>,
    /// Declared errors of the components, where they go together.
    pub covariance: Option<Covariance>,
}

/// A measured file as far as it can be read.
pub struct Measured {
    /// The rows that are right, with the columns of `docs/formats.md`.
    pub sheet: Sheet,
    /// What was converted, for the user.
    pub conversions: Vec<String>,
    /// A load case of each of these rows.
    pub cases: Vec<LoadCase>,
    /// Everything that is wrong, in the file's order.
    pub failures: Vec<Failure>,
}

impl Measured {
    /// Reads a measured file, also as laboratories export it.
    ///
    /// # Errors
    /// A file in which no rows of readings can be found: see [`import::read`].
    pub fn read(source: Source, machine: &MachineFile, renames: &Renames) -> Result<Self> {
        Ok(Self::of(import::read(source, renames)?, machine))
    }

    /// Reads the rows of a file that was exported.
    pub fn of(imported: Imported, machine: &MachineFile) -> Self {
        let Imported { mut sheet, conversions, mut failures, .. } = imported;
        let mut cases = Vec::new();
        let (mut right, rows) = (Vec::new(), std::mem::take(&mut sheet.rows));
        match Columns::of(&sheet) {
            Err(missing) => failures.extend(missing),
            Ok(columns) => {
                for row in rows {
                    let (case, wrong) = columns.load_case(&sheet, &row, machine);
                    if let Some(case) = case.filter(|_| wrong.is_empty()) {
                        cases.push(case);
                        right.push(row);
                    }
                    failures.extend(wrong);
                }
            }
        }
        sheet.rows = right;
        failures.sort_by_key(|f| f.line);
        Self { sheet, conversions, cases, failures }
    }

    /// The whole of a file in which nothing is wrong.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn complete(self) -> Result<(Sheet, Vec<LoadCase>)> {
        match self.failures.into_iter().next() {
            None => Ok((self.sheet, self.cases)),
            Some(failure) => Err(failure),
        }
    }
}

/// The canonical file of `docs/formats.md`: its columns in their order, commas between cells, decimal points, LF. Columns that are not
/// used are left out.
pub fn to_csv(sheet: &Sheet) -> String {
    let columns: Vec<(usize, bool)> = import::COLUMNS
        .iter()
        .filter_map(|column| Some((sheet.header.iter().position(|h| h == column.name)?, column.is_number())))
        .collect();
    let header: Vec<String> = columns.iter().map(|(n, _)| sheet.header[*n].clone()).collect();
    let cell = |row: &Row, (n, is_number): &(usize, bool)| {
        let cell = &row.cells[*n];
        if *is_number { cell.replace(',', ".") } else { cell.to_owned() }
    };
    let rows = sheet.rows.iter().map(|row| columns.iter().map(|c| cell(row, c)).collect::<Vec<_>>());
    csv::to_csv(b',', &header, rows)
}

/// What the rows of a sheet have of pose and points.
struct Columns {
    pose: [&'static str; 3],
    has_point: bool,
    has_load_point: bool,
    has_gauge: bool,
    has_covariance: bool,
}

impl Columns {
    /// Or all that are missing.
    fn of(sheet: &Sheet) -> std::result::Result<Self, Vec<Failure>> {
        let mut missing = Vec::new();
        let pose = sheet.pose_columns().map_err(|failure| missing.push(failure)).ok();
        missing.extend(sheet.require(&WRENCH_COLUMNS).err());
        let gauge = [&GAUGE_COLUMNS[..], &READ_COLUMNS[DEFLECTION_COLUMNS.len()..]].concat();
        let covariance = [&SIGMA_COLUMNS[..], &CORRELATION_COLUMNS, &[ZERO_SHARE_COLUMN]].concat();
        let sets = [&POINT_COLUMNS[..], &LOAD_POINT_COLUMNS, &gauge, &covariance];
        let [has_point, has_load_point, has_gauge, has_covariance] = sets.map(|columns| {
            let has_some = columns.iter().any(|c| sheet.has(c));
            if has_some {
                missing.extend(sheet.require(columns).err());
            }
            has_some
        });
        match pose {
            Some(pose) if missing.is_empty() => Ok(Self { pose, has_point, has_load_point, has_gauge, has_covariance }),
            _ => Err(missing),
        }
    }

    /// What a row says, and everything that is wrong with it.
    fn load_case(&self, sheet: &Sheet, row: &Row, machine: &MachineFile) -> (Option<LoadCase>, Vec<Failure>) {
        let mut wrong = Vec::new();
        let pose = sheet.pose(row, self.pose, machine).map_err(|f| wrong.push(f)).ok();
        for column in READ_COLUMNS.iter().chain(&OPTIONAL).filter(|c| sheet.has(c)) {
            wrong.extend(optional_number(sheet, row, column).err());
        }
        if sheet.has("direction") {
            wrong.extend(direction(sheet, row).err());
        }
        let wrench = sheet.load(row).map_err(|f| wrong.push(f)).ok();
        let mut point = |has_it: bool, columns: [&'static str; 3]| {
            let mm = if has_it { sheet.numbers(row, columns) } else { Ok([0.0; 3]) };
            mm.map_err(|f| wrong.push(f)).ok().map(|mm| mm.map(|mm| mm / 1e3))
        };
        let (point_m, load_m) = (point(self.has_point, POINT_COLUMNS), point(self.has_load_point, LOAD_POINT_COLUMNS));
        let gauge = if self.has_gauge { gauge(sheet, row) } else { Ok(None) };
        let covariance = if self.has_covariance { covariance(sheet, row) } else { Ok(None) };
        let (gauge, covariance) = match (gauge, covariance) {
            (Ok(gauge), Ok(covariance)) => (gauge, covariance),
            (gauge, covariance) => {
                wrong.extend(gauge.err().into_iter().chain(covariance.err()));
                return (None, wrong);
            }
        };
        let case = pose.zip(wrench).zip(point_m.zip(load_m)).map(|((pose, wrench), (point_m, load_m))| {
            let given = Wrench::from_vector(wrench.into());
            // from here on both are at one point
            let lever: [f64; 3] = std::array::from_fn(|i| load_m[i] - point_m[i]);
            let wrench = if self.has_load_point { given.moved_to_a(lever.into()) } else { given };
            LoadCase { pose, wrench, point_m, gauge, covariance }
        });
        (case, wrong)
    }
}

/// The direction of a row's gauge, if it has one.
fn gauge(sheet: &Sheet, row: &Row) -> Result<Option<[f64; 3]>> {
    let reading = READ_COLUMNS[DEFLECTION_COLUMNS.len()];
    let is_given = |column: &&str| sheet.has(column) && sheet.cell(row, column).is_ok_and(|cell| !cell.is_empty());
    if !GAUGE_COLUMNS.iter().chain([&reading]).any(is_given) {
        return Ok(None);
    }
    let direction = sheet.numbers(row, GAUGE_COLUMNS).map_err(|mut failure| {
        failure.message.push_str(" (the direction in which the gauge reads, in A-uvw)");
        failure
    })?;
    let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        let message = "expected the direction in which the gauge reads, such as 0, 0, 1, found no direction: 0, 0, 0";
        return Err(sheet.failure(row, message).at_column(GAUGE_COLUMNS[0]));
    }
    if let Some(column) = DEFLECTION_COLUMNS.iter().find(|c| is_given(c)) {
        let message = format!("expected an empty cell: the row is that of a gauge, which reads {reading} alone");
        return Err(sheet.failure(row, message).at_column(*column));
    }
    Ok(Some(direction.map(|v| v / length)))
}

/// The errors that a row declares for its components, if it does.
fn covariance(sheet: &Sheet, row: &Row) -> Result<Option<Covariance>> {
    let is_empty = |column: &str| sheet.cell(row, column).is_ok_and(str::is_empty);
    let all_empty = |columns: &[&str]| columns.iter().all(|c| is_empty(c));
    if all_empty(&SIGMA_COLUMNS) && all_empty(&CORRELATION_COLUMNS) {
        return Ok(None);
    }
    let read: Vec<usize> =
        (DEFLECTION_COLUMNS.iter().enumerate()).filter(|(_, c)| sheet.has(c) && !is_empty(c)).map(|(n, _)| n).collect();
    // what was not read has any deviation and no correlation
    let mut deviations = [1.0; READ_COLUMNS.len()];
    let mut correlation = DMatrix::identity(READ_COLUMNS.len(), READ_COLUMNS.len());
    let mut columns = CORRELATION_COLUMNS.iter();
    for i in 0..DEFLECTION_COLUMNS.len() {
        if read.contains(&i) {
            deviations[i] = sheet.number(row, SIGMA_COLUMNS[i])? * 1e-6;
            if !(deviations[i] > 0.0) {
                let message = format!("expected a standard deviation above 0, found {}", deviations[i] * 1e6);
                return Err(sheet.failure(row, message).at_column(SIGMA_COLUMNS[i]));
            }
        }
        for (j, column) in (i + 1..DEFLECTION_COLUMNS.len()).zip(&mut columns) {
            if !(read.contains(&i) && read.contains(&j)) {
                continue;
            }
            let value = sheet.number(row, column)?;
            if !(-1.0..=1.0).contains(&value) {
                let message = format!("expected a correlation from -1 to 1, found {value}");
                return Err(sheet.failure(row, message).at_column(*column));
            }
            (correlation[(i, j)], correlation[(j, i)]) = (value, value);
        }
    }
    let zero_share = sheet.number(row, ZERO_SHARE_COLUMN)?;
    if !(0.0..1.0).contains(&zero_share) {
        let message = format!("expected a share of the variance from 0 to below 1, found {zero_share}");
        return Err(sheet.failure(row, message).at_column(ZERO_SHARE_COLUMN));
    }
    let covariance = Covariance::new(&deviations, correlation, zero_share).ok_or_else(|| {
        let message = "expected correlations of a positive definite matrix: no errors go together like this, unless the numbers \
                       have too few digits";
        sheet.failure(row, message).at_column(CORRELATION_COLUMNS[0])
    })?;
    Ok(Some(covariance))
}

/// Refuses a cell that is neither empty nor a number that its column may have.
fn optional_number(sheet: &Sheet, row: &Row, column: &str) -> Result<()> {
    // a blank cell is a channel that was not measured
    let cell = sheet.cell(row, column)?;
    if cell.is_empty() {
        return Ok(());
    }
    let value = sheet.number(row, column).map_err(|mut failure| {
        if !cell.contains(|c: char| c.is_ascii_digit()) {
            failure.message.push_str(" (leave the cell empty where nothing was measured)");
        }
        failure
    })?;
    let wrong = if column.starts_with("sigma_") && value < 0.0 {
        "a standard deviation of at least 0"
    } else if column == LOAD_RANDOM_COLUMN && value < 0.0 {
        "a share of the load of at least 0"
    } else if column == "temperature_c" && value < -273.15 {
        "a temperature above -273.15 °C"
    } else {
        return Ok(());
    };
    Err(sheet.failure(row, format!("expected {wrong}, found {value}")).at_column(column))
}

fn direction(sheet: &Sheet, row: &Row) -> Result<()> {
    let direction = sheet.cell(row, "direction")?;
    if ["", "load", "unload"].contains(&direction) {
        return Ok(());
    }
    let message = format!("expected `load` or `unload`, found `{direction}`");
    Err(sheet.failure(row, message).at_column("direction"))
}

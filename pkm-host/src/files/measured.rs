//! Rows of a measured file: pose, load and deflection of each, and all that is wrong with them.

use pkm_core::Wrench;

use crate::error::{Failure, Result};
use crate::files::csv::{self, Row, Sheet};
use crate::files::dataset::{DEFLECTION_COLUMNS, LOAD_POINT_COLUMNS, POINT_COLUMNS, WRENCH_COLUMNS};
use crate::files::import::{self, Imported, Renames};
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::pose::NamedPose;

/// Columns of numbers whose cells may be empty.
const OPTIONAL: [&str; 3] = ["temperature_c", "sigma_linear_um", "sigma_angular_urad"];

/// A load case of a measured file.
pub struct LoadCase {
    /// Commanded pose.
    pub pose: NamedPose,
    /// Force in N and moment in N·m on the platform, at `point_m`, in A-uvw.
    pub wrench: Wrench<f64>,
    /// Where the deflection is read, in A-uvw.
    pub point_m: [f64; 3],
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
        let Imported { mut sheet, conversions, mut failures } = import::read(source, renames)?;
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
        Ok(Self { sheet, conversions, cases, failures })
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
}

impl Columns {
    /// Or all that are missing.
    fn of(sheet: &Sheet) -> std::result::Result<Self, Vec<Failure>> {
        let mut missing = Vec::new();
        let pose = sheet.pose_columns().map_err(|failure| missing.push(failure)).ok();
        missing.extend(sheet.require(&WRENCH_COLUMNS).err());
        let [has_point, has_load_point] = [POINT_COLUMNS, LOAD_POINT_COLUMNS].map(|columns| {
            let has_some = columns.iter().any(|c| sheet.has(c));
            if has_some {
                missing.extend(sheet.require(&columns).err());
            }
            has_some
        });
        match pose {
            Some(pose) if missing.is_empty() => Ok(Self { pose, has_point, has_load_point }),
            _ => Err(missing),
        }
    }

    /// What a row says, and everything that is wrong with it.
    fn load_case(&self, sheet: &Sheet, row: &Row, machine: &MachineFile) -> (Option<LoadCase>, Vec<Failure>) {
        let mut wrong = Vec::new();
        let pose = sheet.pose(row, self.pose, machine).map_err(|f| wrong.push(f)).ok();
        for column in DEFLECTION_COLUMNS.iter().chain(&OPTIONAL).filter(|c| sheet.has(c)) {
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
        let case = pose.zip(wrench).zip(point_m.zip(load_m)).map(|((pose, wrench), (point_m, load_m))| {
            let given = Wrench::from_vector(wrench.into());
            // from here on both are at one point
            let lever: [f64; 3] = std::array::from_fn(|i| load_m[i] - point_m[i]);
            let wrench = if self.has_load_point { given.moved_to_a(lever.into()) } else { given };
            LoadCase { pose, wrench, point_m }
        });
        (case, wrong)
    }
}

/// Refuses a cell that is neither empty nor a number that its column may have.
fn optional_number(sheet: &Sheet, row: &Row, column: &str) -> Result<()> {
    // a blank cell is a channel that was not measured
    if sheet.cell(row, column)?.is_empty() {
        return Ok(());
    }
    let value = sheet.number(row, column).map_err(|mut failure| {
        failure.message.push_str(" (leave the cell empty where nothing was measured)");
        failure
    })?;
    let wrong = if column.starts_with("sigma_") && value < 0.0 {
        "a standard deviation of at least 0"
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

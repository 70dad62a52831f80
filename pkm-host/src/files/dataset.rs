//! CSV files: poses, stiffness, measured readings.

use std::collections::HashMap;
use std::fmt::Display;

use pkm_core::{KinematicsError, Pose, ScrewLengths, Stiffness};

use crate::error::{Failure, MAX_TYPO_BYTES, Result, advice, printable, status};
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::pose::{NamedPose, pose_of, written_units};

/// The pose columns, in the order in which they are written.
pub const POSE_COLUMNS: [&str; 4] = ["pose", "theta_deg", "sigma_deg", "z0_mm"];
const LENGTH_COLUMNS: [&str; 3] = ["q1_mm", "q2_mm", "q3_mm"];
/// The wrench on the platform.
pub const WRENCH_COLUMNS: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];
/// The deflection, loaded minus unloaded.
pub const DEFLECTION_COLUMNS: [&str; 6] = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];
pub(crate) const POINT_COLUMNS: [&str; 3] = ["point_u_mm", "point_v_mm", "point_w_mm"];
const OTHER_MEASURED: [&str; 6] =
    ["series", "repeat", "direction", "temperature_c", "sigma_linear_um", "sigma_angular_urad"];

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

/// A CSV as cells, checked for shape: one header, no doubled column, every row as wide as the header.
pub struct Sheet {
    pub(crate) source: Source,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Rows in the file's order.
    pub rows: Vec<Row>,
    header_line: u64,
    /// Semicolons between cells: a decimal comma is as good as a point.
    semicolons: bool,
    /// Some number has one.
    decimal_commas: bool,
    columns: HashMap<String, usize>,
    /// Names the columns that are not used, and comments that look like rows.
    pub warnings: Vec<String>,
}

/// The first comment with as many cells as the header, most of them numbers: a row that was switched off, or one whose name begins
/// with #, which is read in quotes alone.
fn commented_rows(text: &str, semicolons: bool, width: usize) -> Option<String> {
    let is_number = |cell: &&str| cell.trim().replace(',', ".").parse::<f64>().is_ok();
    let is_row = |line: &str| {
        let cells: Vec<&str> = line.split(if semicolons { ';' } else { ',' }).collect();
        line.starts_with('#') && cells.len() == width && 2 * cells.iter().filter(|c| is_number(c)).count() > width
    };
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| is_row(line)).map(|(n, _)| n);
    let first: u64 = lines.next()?;
    let more = match lines.count() {
        0 => String::new(),
        n => format!(", and {n} more"),
    };
    Some(format!("{first}: a comment that looks like a row is skipped{more}: put a name that begins with # in quotes"))
}

/// A line of a [`Sheet`].
pub struct Row {
    /// Line in the file, from 1.
    pub line: u64,
    /// Cells without the spaces around them.
    pub cells: csv::StringRecord,
}

impl Row {
    /// The cells, to be changed.
    pub(crate) fn to_cells(&self) -> Vec<String> {
        self.cells.iter().map(str::to_owned).collect()
    }
}

impl Sheet {
    /// Reads a CSV and holds its header against the `known` columns.
    ///
    /// # Errors
    /// The line and column that are wrong; a column that looks like a misspelt known one.
    pub fn parse(source: Source, known: &[&str]) -> Result<Self> {
        let text = source.text()?;
        let fail = |line: u64, message: String| Failure::input(message).in_file(&source.name).at_line(line);
        // what is no line of data, here and below
        let is_skipped =
            |line: &str| line.starts_with('#') || line.chars().all(|c| c.is_whitespace() || c == ';' || c == ',');
        let Some(header_line) = text.lines().find(|l| !is_skipped(l)) else {
            return Err(fail(1, "expected a header line with column names, found nothing".into()));
        };
        let unquoted: String = header_line.split('"').step_by(2).collect();
        let semicolons = unquoted.contains(';');
        if header_line.matches('"').count() % 2 == 1 {
            let line = 1 + text.lines().take_while(|l| is_skipped(l)).count() as u64;
            return Err(fail(line, "a quote in the header is not closed".into()));
        }
        // no list of columns that the program reads has but one
        if !semicolons && !unquoted.contains(',') {
            let line = 1 + text.lines().take_while(|l| is_skipped(l)).count() as u64;
            let title: String = unquoted.chars().take(40).collect();
            let found = if unquoted.contains('\t') {
                "tabs".into()
            } else {
                format!("`{}`: put # before lines above the header", printable(&title))
            };
            let message = format!("expected a header with commas or semicolons between its cells, found {found}");
            return Err(fail(line, message));
        }
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(if semicolons { b';' } else { b',' })
            .comment(Some(b'#'))
            .has_headers(false)
            .flexible(true)
            .from_reader(text.as_bytes());
        // the reader's position is where it began to look: comments and empty lines may come first
        let line_of = |position: Option<&csv::Position>| {
            let Some(p) = position else { return 1 };
            let rest = text.get(usize::try_from(p.byte()).unwrap_or(usize::MAX)..).unwrap_or("");
            p.line() + rest.lines().take_while(|l| l.is_empty() || l.starts_with('#')).count() as u64
        };
        let read = |e: csv::Error| fail(line_of(e.position()), format!("not a CSV line: {e}"));
        // spaces around a cell, and quotes that came behind a space
        let tidy = |cell: &str| {
            let cell = cell.trim();
            let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
            inner.unwrap_or(cell).trim().to_owned()
        };
        let mut records =
            reader.records().filter(|r| !r.as_ref().is_ok_and(|r| r.iter().all(|cell| cell.trim().is_empty())));
        let Some(header) = records.next() else { return Err(fail(1, "expected a header line, found none".into())) };
        let header = header.map_err(read)?;
        let at = line_of(header.position());
        let mut header: Vec<String> = header.iter().map(tidy).collect();
        // a spreadsheet keeps columns that once held something
        while header.last().is_some_and(String::is_empty) {
            header.pop();
        }
        let mut columns = HashMap::new();
        for (i, name) in header.iter().enumerate() {
            if name.parse::<f64>().is_ok_and(f64::is_finite) {
                let message = format!("expected a header with names of columns, found numbers such as `{name}`");
                return Err(fail(at, message));
            }
            if name.is_empty() {
                return Err(fail(at, format!("column {} of the header has no name", i + 1)));
            }
            if columns.insert(name.clone(), i).is_some() {
                return Err(fail(at, "duplicate column in the header".into()).at_column(name));
            }
        }
        // a file with the pose in one form needs no column of the other
        let has_any = |names: &[&str]| names.iter().any(|n| columns.contains_key(*n));
        let (angles, lengths) = (has_any(&POSE_COLUMNS[1..]), has_any(&LENGTH_COLUMNS));
        let of_other_form = |name: &str| {
            (angles && LENGTH_COLUMNS.contains(&name)) || (lengths && !angles && POSE_COLUMNS[1..].contains(&name))
        };
        let (mut unused, mut misspelt) = (Vec::new(), Vec::new());
        for name in header.iter().filter(|n| !known.contains(&n.as_str())) {
            if name.len() > MAX_TYPO_BYTES {
                unused.push(name.as_str());
                continue;
            }
            let meant = known.iter().filter(|k| {
                looks_the_same(name, k) || (!columns.contains_key(**k) && !of_other_form(k) && looks_like(name, k))
            });
            match meant.min_by_key(|k| strsim::osa_distance(name, k)) {
                Some(meant) => misspelt.push((name, meant)),
                None => unused.push(name.as_str()),
            }
        }
        if let Some(((name, meant), more)) = misspelt.split_first() {
            let more: String = more.iter().map(|(name, meant)| format!("; `{meant}` for `{name}`?")).collect();
            return Err(fail(at, format!("unknown column: did you mean `{meant}`?{more}")).at_column(*name));
        }
        if unused.len() == header.len() {
            let (some, found) = (known.iter().take(4).copied().collect::<Vec<_>>().join(", "), header.join(", "));
            let message = format!("expected a header with column names such as {some}, found `{found}`");
            return Err(fail(at, format!("{message}: put # before lines above the header")));
        }
        let warning = || format!("{}:{at}: not used: {}", printable(&source.name), printable(&unused.join(", ")));
        let mut warnings: Vec<String> = (!unused.is_empty()).then(warning).into_iter().collect();
        warnings.extend(
            commented_rows(text, semicolons, header.len()).map(|what| format!("{}:{what}", printable(&source.name))),
        );

        let mut rows = Vec::new();
        for record in records {
            let record = record.map_err(read)?;
            let line = line_of(record.position());
            let mut cells: csv::StringRecord = record.iter().map(tidy).collect();
            while cells.len() > header.len() && cells[cells.len() - 1].is_empty() {
                cells.truncate(cells.len() - 1);
            }
            if cells.len() != header.len() {
                let (found, wide) = (cells.len(), header.len());
                let advice = if record.iter().any(|cell| cell.contains('\n')) {
                    ": is a quote not closed?"
                } else if found > wide && !semicolons {
                    ": for decimal commas write semicolons between cells"
                } else {
                    ""
                };
                return Err(fail(line, format!("expected {wide} cells as in the header, found {found}{advice}")));
            }
            rows.push(Row { line, cells });
        }
        if rows.is_empty() {
            return Err(fail(at, "expected rows of data below the header, found none".into()));
        }
        let is_number = |cell: &str| cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok();
        let numbers = columns.iter().filter(|(name, _)| **name != "pose" && known.contains(&name.as_str()));
        let decimal_commas =
            semicolons && numbers.into_iter().any(|(_, i)| rows.iter().any(|r| is_number(&r.cells[*i])));
        Ok(Self { header, header_line: at, rows, semicolons, decimal_commas, columns, warnings, source })
    }

    /// As this file has between cells.
    pub fn delimiter(&self) -> u8 {
        if self.semicolons { b';' } else { b',' }
    }

    /// A number as this file writes them.
    pub fn written(&self, value: impl Display) -> String {
        let text = value.to_string();
        if self.decimal_commas { text.replace('.', ",") } else { text }
    }

    pub(crate) fn has(&self, column: &str) -> bool {
        self.columns.contains_key(column)
    }

    pub(crate) fn failure(&self, row: &Row, message: impl Into<String>) -> Failure {
        Failure::input(message).in_file(&self.source.name).at_line(row.line)
    }

    /// A failure at the header, about a column that is not there.
    pub(crate) fn missing(&self, column: &str, why: &str) -> Failure {
        let failure = Failure::input(format!("missing column{why}")).in_file(&self.source.name);
        failure.at_line(self.header_line).at_column(column)
    }

    pub(crate) fn require(&self, columns: &[&str]) -> Result<()> {
        columns.iter().find(|c| !self.has(c)).map_or(Ok(()), |c| Err(self.missing(c, "")))
    }

    pub(crate) fn cell<'a>(&self, row: &'a Row, column: &str) -> Result<&'a str> {
        let index = self.columns.get(column).ok_or_else(|| self.missing(column, ""))?;
        Ok(&row.cells[*index])
    }

    /// A finite number. With semicolons between cells a decimal comma is as good as a point.
    pub(crate) fn number(&self, row: &Row, column: &str) -> Result<f64> {
        let cell = self.cell(row, column)?;
        if self.decimal_commas && is_grouped(cell, &['.']) {
            let message = format!("`{cell}`: point or thousands? Other numbers here have decimal commas");
            return Err(self.failure(row, format!("{message}: save the file {UNGROUPED}")).at_column(column));
        }
        let text = if self.semicolons { cell.replace(',', ".") } else { cell.to_owned() };
        let digits = text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
        match text.parse::<f64>() {
            Ok(value) if digits && value.is_finite() => Ok(value),
            _ => {
                let shown: String = cell.chars().take(40).collect();
                let grouped = is_grouped(cell, &['.', ',', '\'', '’', ' ', '\u{a0}', '\u{202f}']);
                let found = if cell.is_empty() {
                    "an empty cell".into()
                } else if grouped {
                    format!("`{shown}`: save the file {UNGROUPED}")
                } else {
                    format!("`{shown}`{}", advice(cell))
                };
                Err(self.failure(row, format!("expected a finite number, found {found}")).at_column(column))
            }
        }
    }

    pub(crate) fn numbers<const N: usize>(&self, row: &Row, columns: [&str; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.number(row, column)?;
        }
        Ok(values)
    }

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

const UNGROUPED: &str = "without separators between thousands";

/// Whether a cell is a number with digits in groups of three.
fn is_grouped(cell: &str, separators: &[char]) -> bool {
    let mut groups = cell.trim_start_matches(['+', '-']).split(separators);
    let digits = |group: &str| !group.is_empty() && group.bytes().all(|b| b.is_ascii_digit());
    let first = groups.next().is_some_and(|group| group.len() <= 3 && digits(group) && !group.starts_with('0'));
    // what is behind the last may be a fraction
    let rest: Vec<&str> = groups.collect();
    first && rest.first().is_some_and(|group| group.len() == 3) && rest.iter().all(|group| digits(group))
}

/// The cells of a pose, in the units of files.
pub fn pose_cells(pose: &Pose<f64>) -> [String; 3] {
    written_units(pose).map(|v| v.to_string())
}

/// Whether two names differ in case, spaces and underscores alone.
fn looks_the_same(name: &str, known: &str) -> bool {
    let plain = |s: &str| s.to_lowercase().replace(['_', '-', ' '], "");
    plain(name) == plain(known)
}

/// Whether an unknown name is probably a typing error for a known one: another unit, a letter, in long names two.
fn looks_like(name: &str, known: &str) -> bool {
    // `k12 [N/m]`
    let name = name.split(['[', '(']).next().map(str::trim_end).filter(|n| !n.is_empty()).unwrap_or(name);
    let stem = |s: &str| s.rsplit_once('_').map(|(stem, _)| stem.to_lowercase());
    let allowed = if known.len() < 7 { 1 } else { 2 };
    let other_number = |a: &str, b: &str| {
        let letters = |s: &str| s.chars().filter(|c| !c.is_ascii_digit()).collect::<String>();
        letters(a) == letters(b) && a.len() == b.len()
    };
    (stem(known).is_some() && (stem(name) == stem(known) || stem(known) == Some(name.to_lowercase())))
        || (strsim::osa_distance(&name.to_lowercase(), known) <= allowed && !other_number(name, known))
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

/// CSV text. An id that starts with `#` is quoted, so that it is not read back as a comment.
pub fn to_csv<R: AsRef<[String]>>(delimiter: u8, header: &[String], rows: impl IntoIterator<Item = R>) -> String {
    let mut writer = csv::WriterBuilder::new().delimiter(delimiter).comment(Some(b'#')).from_writer(Vec::new());
    let mut write = |cells: &[String]| writer.write_record(cells).expect("writing to memory");
    write(header);
    for row in rows {
        write(row.as_ref());
    }
    String::from_utf8(writer.into_inner().expect("writing to memory")).expect("cells are UTF-8")
}

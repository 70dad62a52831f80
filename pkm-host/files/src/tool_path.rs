//! A tool path, CSV or G-code: read for `compensate`, and written again with other places.

use std::ffi::OsStr;
use std::path::Path;

use pkm_core::Wrench;

use crate::csv::Row;
use crate::dataset::{self, Sheet, WRENCH_COLUMNS};
use crate::error::{Failure, Result, printable};
use crate::gcode::{Program, Setup, Writer};
use crate::import::encoding;
use crate::path::{FeedMode, Load, Move, Place, Toward};
use crate::source::{Source, folder_of};

/// How a program's comment begins that says that it went through `compensate`.
pub const MARK: &str = "pkm-host compensate";
/// The column of a CSV that says the same: others read its lines one by one, and a comment would be in their way.
const MARK_COLUMN: &str = "compensated";
const TOOL_COLUMNS: [&str; 6] = ["x_mm", "y_mm", "z_mm", "i", "j", "k"];

/// A path as it was read.
pub enum ToolPath {
    /// A move a row.
    Csv {
        /// The cells.
        sheet: Sheet,
        /// In the rows' order.
        moves: Vec<Move>,
    },
    /// G-code.
    Program(Program),
}

/// A point of a new path.
#[derive(Clone, Copy)]
pub struct Point {
    /// Where the tool is commanded to.
    pub place: Place,
    /// Its load there, in the axes of T_h.
    pub wrench: Wrench<f64>,
    /// Where a move begins under another load than the one before ended with: a small move to it, before the move's own parts.
    pub is_begin: bool,
}

/// Whether a file is a program by its name, or else a CSV, if that says either.
pub fn is_program(file: &Path) -> Option<bool> {
    match file.extension().and_then(OsStr::to_str).unwrap_or("").to_lowercase().as_str() {
        "csv" => Some(false),
        "ngc" | "nc" | "gcode" | "cnc" | "tap" | "mpf" | "eia" | "min" => Some(true),
        _ => None,
    }
}

/// The same, where it has to say either.
fn kind_of(path: &Path) -> Result<bool> {
    let message =
        "expected a name that ends in .csv, or for G-code in .ngc, .nc, .gcode, .cnc, .tap, .mpf, .eia or .min";
    is_program(path).ok_or_else(|| Failure::usage(message).in_file(path.display().to_string()))
}

/// That a path is compensated already.
fn compensated_already(name: &str, line: u64) -> Failure {
    Failure::input("this path is compensated already: give the one that it was made from").in_file(name).at_line(line)
}

/// Refuses a path with the [mark](MARK), however a control has changed its case, its line numbers or its comments' brackets.
pub(crate) fn refuse_compensated(path: &Source) -> Result<()> {
    let mark = format!("{MARK}:");
    let marked = path.text()?.lines().position(|l| l.to_ascii_lowercase().contains(&mark));
    marked.map_or(Ok(()), |line| Err(compensated_already(&path.name, line as u64 + 1)))
}

/// Whether a program's line is ASCII but for its comments.
fn has_plain_code(line: &str) -> bool {
    let mut parts = line.split(';').next().unwrap_or("").split('(');
    let is_plain = parts.next().is_none_or(str::is_ascii);
    is_plain && parts.all(|part| part.split_once(')').is_none_or(|(_, behind)| behind.is_ascii()))
}

/// A program as text, and its encoding unless that is UTF-8: controls have one of their own for comments.
fn decoded(given: &Source) -> Result<(Source, Option<&'static str>)> {
    let Err(failure) = given.text() else { return Ok((given.clone(), None)) };
    let text = encoding::from_windows_1252(given.bytes()).filter(|text| text.lines().all(has_plain_code));
    Ok((Source::from_text(&given.name, text.ok_or(failure)?), Some("Windows-1252")))
}

impl ToolPath {
    /// Reads a path, its kind by its name, and says from what. `wrench` is a program's load until a comment sets another, `setup` what it does not
    /// say of the machine. A program is read by LinuxCNC's interpreter where that is given.
    ///
    /// # Errors
    /// See [`read_csv`], [`Program::parse`] and [`Program::parse_by`]; another name; a path that is compensated already.
    pub fn read(path: &Path, wrench: Option<[f64; 6]>, setup: &Setup, rs274: Option<&Path>) -> Result<(Self, Source)> {
        let is_program = kind_of(path)?;
        let given = Source::read(path)?;
        let (source, encoding) = if is_program { decoded(&given)? } else { (given.clone(), None) };
        refuse_compensated(&source)?;
        if is_program {
            let wrench = wrench.map(|w| Wrench::from_vector(w.into()));
            let mut program = match rs274 {
                Some(rs274) => Program::parse_by(rs274, &source, folder_of(path), wrench, setup)?,
                None => Program::parse_with(&source, wrench, setup)?,
            };
            let name = printable(&source.name);
            program.warnings.extend(encoding.map(|of| format!("{name}: read as {of}, and written as UTF-8")));
            return Ok((Self::Program(program), given));
        }
        if wrench.is_some() {
            return Err(Failure::usage("--wrench is for G-code: a CSV gives the load in its columns fx_n … mz_nm"));
        }
        let (sheet, moves) = read_csv(source.clone())?;
        if sheet.header.iter().any(|name| name == MARK_COLUMN) {
            return Err(compensated_already(&source.name, sheet.header_line));
        }
        Ok((Self::Csv { sheet, moves }, source))
    }

    /// Reads a path to be played by `view`, compensated or not; a program that says no load has none.
    ///
    /// # Errors
    /// Those of [`read`](Self::read) beside that.
    pub fn read_any(path: &Path) -> Result<(Self, Source)> {
        let is_program = kind_of(path)?;
        let source = Source::read(path)?;
        if is_program {
            let setup = Setup { is_only_played: true, ..Setup::default() };
            let program = Program::parse_with(&decoded(&source)?.0, Some(Wrench::ZERO), &setup)?;
            return Ok((Self::Program(program), source));
        }
        let (sheet, moves) = read_csv(source.clone())?;
        Ok((Self::Csv { sheet, moves }, source))
    }

    /// In the file's order.
    pub fn moves(&self) -> &[Move] {
        match self {
            Self::Csv { moves, .. } => moves,
            Self::Program(program) => &program.moves,
        }
    }

    /// What is wrong with the file and yet not refused.
    pub fn warnings(&self) -> &[String] {
        match self {
            Self::Csv { sheet, .. } => &sheet.warnings,
            Self::Program(program) => &program.warnings,
        }
    }

    /// The path to be written with other places.
    pub fn writer(&self) -> PathWriter<'_> {
        match self {
            Self::Csv { sheet, .. } => PathWriter::Csv { sheet, rows: Vec::new(), next: 0, is_compensated: false },
            Self::Program(program) => PathWriter::Program(program.writer()),
        }
    }
}

/// A path as a CSV has it: its cells and its moves.
///
/// # Errors
/// See [`Sheet`]; an axis without direction.
pub fn read_csv(source: Source) -> Result<(Sheet, Vec<Move>)> {
    let needed = [&TOOL_COLUMNS[..], &WRENCH_COLUMNS].concat();
    let sheet = Sheet::parse(source, &[&needed[..], &[MARK_COLUMN]].concat())?;
    sheet.require(&needed)?;
    let mut moves: Vec<Move> = Vec::new();
    for row in &sheet.rows {
        let [x, y, z, i, j, k] = sheet.numbers(row, TOOL_COLUMNS)?;
        if [i, j, k] == [0.0; 3] {
            return Err(sheet.failure(row, "i, j, k are all 0 and give the tool no direction").at_column("i"));
        }
        let wrench = Wrench::from_vector(sheet.load(row)?.into());
        let to = Place { tip_m: [x, y, z].map(|v| v / 1e3), toward: Toward::Axis([i, j, k]) };
        let before = moves.last().and_then(|m| m.load.given(1.0)).unwrap_or(wrench);
        moves.push(Move {
            line: row.line,
            to,
            load: Load::Given([before, wrench]),
            longer_m: 0.0,
            is_fresh: false,
            continues: false,
            feed_per_min: None,
            feed_mode: FeedMode::OfAMinute,
            is_rapid: false,
        });
    }
    Ok((sheet, moves))
}

/// A path that is written move by move with other places.
pub enum PathWriter<'a> {
    /// Its rows so far, and which row of the sheet comes next.
    Csv {
        /// As it was read.
        sheet: &'a Sheet,
        /// Their cells.
        rows: Vec<Vec<String>>,
        /// From 0.
        next: usize,
        /// Some row has a load, for which its place is another.
        is_compensated: bool,
    },
    /// G-code.
    Program(Writer<'a>),
}

impl PathWriter<'_> {
    /// The next move's points, several where it was divided.
    pub fn push(&mut self, points: &[Point]) {
        match self {
            Self::Program(writer) => {
                let begins = points.first().is_some_and(|point| point.is_begin);
                writer.push(points.iter().map(|p| p.place).collect(), begins);
            }
            Self::Csv { sheet, rows, next, is_compensated } => {
                *is_compensated |= points.iter().any(|point| point.wrench != Wrench::ZERO);
                if let Some(row) = sheet.rows.get(*next) {
                    push_rows(sheet, row, points, rows);
                }
                *next += 1;
            }
        }
    }

    /// The new path, with notes at its head.
    pub fn finish(self, notes: &[String]) -> String {
        match self {
            Self::Program(writer) => writer.finish(notes),
            Self::Csv { sheet, mut rows, is_compensated, .. } => {
                let notes: String = notes.iter().map(|note| format!("# {note}\n")).collect();
                let mut header = sheet.header.clone();
                if is_compensated {
                    header.push(MARK_COLUMN.to_owned());
                    rows.iter_mut().for_each(|cells| cells.push("1".to_owned()));
                }
                notes + &dataset::to_csv(sheet.delimiter(), &header, rows)
            }
        }
    }
}

/// A row with other places, several where its cut was divided.
fn push_rows(sheet: &Sheet, row: &Row, points: &[Point], rows: &mut Vec<Vec<String>>) {
    let place = |name: &str| sheet.header.iter().position(|h| h == name);
    let columns: Vec<Option<usize>> = TOOL_COLUMNS.iter().chain(&WRENCH_COLUMNS).map(|name| place(name)).collect();
    for (n, point) in points.iter().enumerate() {
        let mut cells = row.to_cells();
        let Toward::Axis(axis) = point.place.toward else { continue };
        let tip = point.place.tip_m.map(|m| (m * 1e12).round() / 1e9);
        let wrench: [f64; 6] = point.wrench.to_vector().into();
        // a row's own wrench stays as it was written
        let values = tip.into_iter().chain(axis).chain(wrench);
        let values = if n + 1 == points.len() { values.take(6) } else { values.take(12) };
        for (column, value) in columns.iter().zip(values) {
            if let Some(column) = column {
                cells[*column] = sheet.written(value + 0.0);
            }
        }
        rows.push(cells);
    }
}

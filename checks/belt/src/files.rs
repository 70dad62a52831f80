//! The text files of the public repository BarbourSmith/Calibration-Simulation, read as they are.

use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::Vector4;

use crate::machine::{Anchors, COORDINATES, OFFSETS_M};

/// Readings at one place of the sled, one after another.
pub const READINGS_PER_POINT: usize = 4;
/// Largest difference between readings of one point, m: the points are at least 100 mm apart, and readings repeat within 2 mm.
const MAX_SPREAD_M: f64 = 0.01;
/// Longest belt, m: far beyond the frame, but a length in micrometres is none.
const MAX_LENGTH_M: f64 = 10.0;

/// Names of the file with the runs: in the public repository, and as it is kept here.
const RUN_FILES: [&str; 2] = ["10X Calibration Test.txt", "ten-runs.txt"];
/// The same of the file with the tension test.
const TENSION_FILES: [&str; 2] = ["Tension testing.txt", "tension.txt"];

/// A file that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadError {
    /// File or folder.
    pub path: PathBuf,
    /// Line from 1, where one is at fault.
    pub line: Option<usize>,
    /// What is wrong, and what was expected.
    pub message: String,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, "{line}:")?;
        }
        write!(f, " {}", self.message)
    }
}

impl std::error::Error for ReadError {}

/// Four lengths that were read at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lengths {
    /// In the order of [`crate::machine::BELTS`], m.
    pub at_m: Vector4<f64>,
    /// Line of the file, from 1.
    pub line: usize,
}

/// One run: the machine was switched off and disconnected before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Points in the order in which they were taken.
    pub points: Vec<[Lengths; READINGS_PER_POINT]>,
    /// Anchors as the maker's tool identified them from this run.
    pub tool: Anchors,
}

/// Pull of the lower belts in the tension test. The file gives no forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tension {
    /// Slack.
    Low,
    /// Pulled.
    High,
}

/// Two readings at one place of the sled.
pub type TensionPair = [(Tension, Lengths); 2];

/// Both files.
#[derive(Clone, Debug, PartialEq)]
pub struct Published {
    /// The runs.
    pub runs: Vec<Run>,
    /// Their file.
    pub runs_path: PathBuf,
    /// The tension test.
    pub tension: Vec<TensionPair>,
    /// Its file.
    pub tension_path: PathBuf,
}

/// Reads both files from a folder: a clone of the public repository, or one with the files under shorter names.
///
/// # Errors
/// A file that is missing or that has a line that cannot be used.
pub fn read(folder: &Path) -> Result<Published, ReadError> {
    let text = |names: [&str; 2]| {
        let Some(path) = names.map(|n| folder.join(n)).into_iter().find(|p| p.exists()) else {
            let message = format!("neither '{}' nor '{}' is in this folder", names[0], names[1]);
            return Err(ReadError { path: folder.to_owned(), line: None, message });
        };
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok((path, text)),
            Err(e) => Err(ReadError { path, line: None, message: format!("cannot be read: {e}") }),
        }
    };
    let (runs_path, runs) = text(RUN_FILES)?;
    let runs = parse_runs(&runs).map_err(|e| e.at(&runs_path))?;
    let (tension_path, tension) = text(TENSION_FILES)?;
    let tension = parse_tension(&tension).map_err(|e| e.at(&tension_path))?;
    Ok(Published { runs, runs_path, tension, tension_path })
}

/// What is wrong with a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParseError {
    /// Line from 1, where one is at fault.
    pub line: Option<usize>,
    /// What is wrong, and what was expected.
    pub message: String,
}

impl ParseError {
    fn new(line: usize, message: impl Into<String>) -> Self {
        Self { line: Some(line), message: message.into() }
    }

    fn at(self, path: &Path) -> ReadError {
        ReadError { path: path.to_owned(), line: self.line, message: self.message }
    }
}

/// A run that is being read.
#[derive(Default)]
struct OpenRun {
    line: usize,
    readings: Vec<Lengths>,
    /// Coordinates that the tool found, by line.
    tool: Vec<Vec<f64>>,
}

/// Reads the file with the runs.
///
/// # Errors
/// A line that is neither a heading, a reading nor anchors; runs that are not alike.
pub fn parse_runs(text: &str) -> Result<Vec<Run>, ParseError> {
    let mut runs: Vec<OpenRun> = Vec::new();
    for (line, content) in numbered(text) {
        if content.starts_with("Average of all") {
            break;
        }
        if content.starts_with("Run ") && content.ends_with(':') {
            runs.push(OpenRun { line, ..OpenRun::default() });
            continue;
        }
        // the title and a remark stand before the first run
        let Some(run) = runs.last_mut() else { continue };
        if content.starts_with('{') {
            run.readings.push(reading(line, content.trim_end_matches(','))?);
        } else if content.starts_with('(') {
            run.tool.push(coordinates(line, content)?);
        } else {
            return Err(ParseError::new(line, format!("'{content}' is neither 'Run …:', a reading nor anchors")));
        }
    }
    if runs.len() < 2 {
        let message = "fewer than two runs, each under a line 'Run …:': none could predict another".into();
        return Err(ParseError { line: None, message });
    }
    let lines: Vec<usize> = runs.iter().map(|r| r.line).collect();
    let runs = runs.into_iter().map(closed).collect::<Result<Vec<_>, _>>()?;
    let points = runs[0].points.len();
    match runs.iter().zip(lines).find(|(r, _)| r.points.len() != points) {
        Some((other, line)) => {
            let message = format!("this run has {} points and the first has {points}", other.points.len());
            Err(ParseError::new(line, message))
        }
        None => Ok(runs),
    }
}

/// Groups the readings of a run by point.
fn closed(run: OpenRun) -> Result<Run, ParseError> {
    let (points, rest) = run.readings.as_chunks::<READINGS_PER_POINT>();
    if points.is_empty() || !rest.is_empty() {
        let message = format!("{} readings are not {READINGS_PER_POINT} a point", run.readings.len());
        return Err(ParseError::new(run.line, message));
    }
    for point in points {
        let far = |r: &&Lengths| (r.at_m - point[0].at_m).amax() > MAX_SPREAD_M;
        if let Some(far) = point.iter().find(far) {
            let message = format!("more than 10 mm from line {}, which is of the same point", point[0].line);
            return Err(ParseError::new(far.line, message));
        }
    }
    // tl, tr, then bl, which is the origin, and br, which is on the x axis
    let [&[tl_x, tl_y, tr_x, tr_y], &[0.0, 0.0, br_x, 0.0]] = *run.tool.iter().map(Vec::as_slice).collect::<Vec<_>>()
    else {
        let message = "after this run two lines '(tl x, tl y), (tr x, tr y)' and '(0, 0), (br x, 0)' are expected";
        return Err(ParseError::new(run.line, message));
    };
    let coordinates_m: [f64; COORDINATES] = [br_x, tr_x, tr_y, tl_x, tl_y].map(|v| 1e-3 * v);
    Ok(Run { points: points.to_vec(), tool: Anchors { coordinates_m } })
}

/// Reads the file with the tension test. Its other lines are remarks.
///
/// # Errors
/// A reading that cannot be used or does not say how tight it was; a reading without a second one.
pub fn parse_tension(text: &str) -> Result<Vec<TensionPair>, ParseError> {
    let mut rows = Vec::new();
    for (line, content) in numbered(text).filter(|l| l.1.starts_with('{')) {
        let (lengths, remark) = content.split_once("//").unwrap_or((content, ""));
        let tension = match remark.split_whitespace().next() {
            Some("Low") => Tension::Low,
            Some("High") => Tension::High,
            _ => return Err(ParseError::new(line, "a reading ends with '//Low tension …' or '//High tension …'")),
        };
        rows.push((tension, reading(line, lengths.trim_end())?));
    }
    let (pairs, rest) = rows.as_chunks::<2>();
    match rest.first() {
        Some((_, alone)) => Err(ParseError::new(alone.line, "readings come in pairs, and this one has no second")),
        None => Ok(pairs.to_vec()),
    }
}

/// Lines with their numbers, without those that are blank.
fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(n, l)| (n + 1, l.trim())).filter(|l| !l.1.is_empty())
}

/// `{bl:1800.25,   br:1801.00,   tr:1802.50,   tl:1803.75}`, mm.
fn reading(line: usize, text: &str) -> Result<Lengths, ParseError> {
    let form = || ParseError::new(line, "a reading has the form '{bl:…, br:…, tr:…, tl:…}' with lengths in mm");
    let inner = text.strip_prefix('{').and_then(|t| t.strip_suffix('}')).ok_or_else(form)?;
    let fields: Vec<&str> = inner.split(',').map(str::trim).collect();
    let mut at_m = Vector4::zeros();
    if fields.len() != 4 {
        return Err(form());
    }
    for (k, (field, name)) in fields.iter().zip(crate::machine::BELTS).enumerate() {
        let number = field.strip_prefix(name).and_then(|f| f.trim_start().strip_prefix(':')).ok_or_else(form)?;
        let length_m = 1e-3 * number.trim().parse::<f64>().map_err(|_| form())?;
        if !(length_m > OFFSETS_M[k] && length_m < MAX_LENGTH_M) {
            let shortest = 1e3 * OFFSETS_M[k];
            let message = format!("{name} is {} mm, not between {shortest:.0} and 10000", number.trim());
            return Err(ParseError::new(line, message));
        }
        at_m[k] = length_m;
    }
    Ok(Lengths { at_m, line })
}

/// `(1.5, 2), (3, 4)`, mm.
fn coordinates(line: usize, text: &str) -> Result<Vec<f64>, ParseError> {
    let numbers = text.split(['(', ')', ',']).map(str::trim).filter(|t| !t.is_empty());
    let parsed: Result<Vec<f64>, _> = numbers.map(str::parse::<f64>).collect();
    match parsed {
        Ok(numbers) if numbers.len() == 4 && numbers.iter().all(|v| v.is_finite()) => Ok(numbers),
        _ => Err(ParseError::new(line, "anchors have the form '(x, y), (x, y)' in mm")),
    }
}

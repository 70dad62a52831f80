//! A tracker's list of points: one row a point, in the tracker's own frame.

use std::collections::HashMap;

use crate::error::Result;
use crate::import::{self, Imported, Renames};
use crate::reflectors::Reflectors;
use crate::source::Source;

/// Columns that a list needs.
const COLUMNS: [&str; 6] = ["reading", "state", "point", "x_mm", "y_mm", "z_mm"];
/// Expanded uncertainty of a point.
const U95_COLUMN: &str = "u95_um";
/// Farthest point, mm: no tracker reaches so far.
const MAX_MM: f64 = 1e6;
/// Standard deviations in an expanded uncertainty.
const COVERAGE: f64 = 2.0;

/// When a point was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Before the load.
    Unloaded,
    /// Under it.
    Loaded,
}

impl State {
    /// As in the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unloaded => "unloaded",
            Self::Loaded => "loaded",
        }
    }

    fn named(text: &str) -> Option<Self> {
        [Self::Unloaded, Self::Loaded].into_iter().find(|state| text == state.name())
    }
}

/// A measured point.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Line of the file, from 1.
    pub line: u64,
    /// Index of its reflector.
    pub reflector: usize,
    /// In the tracker's frame.
    pub at_m: [f64; 3],
    /// Standard deviation of each coordinate.
    pub sd_m: f64,
}

/// A list of points.
pub struct PointList {
    /// The file.
    pub source: Source,
    /// Points by the reading or series that they name and by state, each reflector once.
    pub sets: HashMap<(String, State), Vec<Point>>,
    /// Names of readings and series with the line of their first point, in the file's order.
    pub names: Vec<(String, u64)>,
    /// What is wrong with the file and yet not refused.
    pub warnings: Vec<String>,
    /// What was converted, for the user.
    pub conversions: Vec<String>,
}

impl PointList {
    /// Reads a list of points of some reflectors, as it was exported.
    ///
    /// # Errors
    /// One message with file, line and column: another unit, a point that is no reflector, an uncertainty that is missing or not
    /// above 0, a reflector twice in one state of one reading.
    pub fn parse(source: Source, reflectors: &Reflectors, renames: &Renames) -> Result<Self> {
        let Imported { sheet, conversions, failures, .. } = import::read_points(source, renames)?;
        if let Some(failure) = failures.into_iter().next() {
            return Err(failure);
        }
        sheet.require(&COLUMNS)?;
        let mut sets: HashMap<(String, State), Vec<Point>> = HashMap::new();
        let mut names: Vec<(String, u64)> = Vec::new();
        for row in &sheet.rows {
            let fail = |column: &str, message: String| sheet.failure(row, message).at_column(column);
            let reading = sheet.cell(row, "reading")?.to_owned();
            if reading.is_empty() {
                let message = "expected the name of a reading, or of a series for unloaded points, found an empty cell";
                return Err(fail("reading", message.into()));
            }
            let text = sheet.cell(row, "state")?;
            let state = State::named(text)
                .ok_or_else(|| fail("state", format!("expected `unloaded` or `loaded`, found `{text}`")))?;
            let name = sheet.cell(row, "point")?;
            let reflector = reflectors.all.iter().position(|r| r.name == name).ok_or_else(|| {
                let there = reflectors.all.iter().map(|r| r.name.as_str()).collect::<Vec<_>>().join(", ");
                fail("point", format!("no reflector `{name}` in {}: there are {there}", reflectors.source.name))
            })?;
            let at_mm = sheet.numbers(row, ["x_mm", "y_mm", "z_mm"])?;
            if let Some(i) = at_mm.iter().position(|v| v.abs() > MAX_MM) {
                return Err(fail(
                    COLUMNS[3 + i],
                    format!("expected a coordinate within ±{MAX_MM} mm, found {}", at_mm[i]),
                ));
            }
            let has_own = sheet.has(U95_COLUMN) && !sheet.cell(row, U95_COLUMN)?.is_empty();
            let u95_m = if has_own {
                sheet.number(row, U95_COLUMN)? / 1e6
            } else {
                reflectors.u95_m.ok_or_else(|| {
                    let message = format!("no uncertainty of this point, and no u95_um in {}", reflectors.source.name);
                    fail(U95_COLUMN, message)
                })?
            };
            if !(u95_m > 0.0) {
                let message = format!("expected an expanded uncertainty above 0 (k = 2), found {}", u95_m * 1e6);
                return Err(fail(U95_COLUMN, message));
            }
            let set = sets.entry((reading.clone(), state)).or_default();
            if let Some(first) = set.iter().find(|p| p.reflector == reflector) {
                let message =
                    format!("duplicate `{name}` in reading {reading}, {}: first in line {}", state.name(), first.line);
                return Err(fail("point", message));
            }
            set.push(Point { line: row.line, reflector, at_m: at_mm.map(|v| v / 1e3), sd_m: u95_m / COVERAGE });
            if !names.iter().any(|(n, _)| *n == reading) {
                names.push((reading, row.line));
            }
        }
        Ok(Self { warnings: sheet.warnings.clone(), source: sheet.source, sets, names, conversions })
    }
}

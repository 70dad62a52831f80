//! The job file (TOML): workpiece, holes, loads, and what moves the workpiece.

use std::ops::{Index, IndexMut, Range};

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use pkm_core::Wrench;
use serde::Deserialize;
use toml::Spanned;

use crate::dataset::MAX_LOAD;
use crate::error::{Failure, Result, printable};
use crate::job_program::{self, ProgramJob, RawOffsets};
use crate::source::Source;
use crate::toml_error::{Numbers, line_at, parsed};

/// Greatest limit, mm or °: far beyond any machine.
const MAX_LIMIT: f64 = 1e6;
/// Of a series, and 1 over the least.
const MAX_WEIGHT: f64 = 1e3;
/// How far a matrix may be from a rotation.
const RIGID: f64 = 1e-6;

/// Where a frame stands in another.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Its axes, as columns.
    pub rotation: Matrix3<f64>,
    /// Its origin, m.
    pub origin_m: Vector3<f64>,
}

impl Frame {
    /// The other way round.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, origin_m: -rotation * self.origin_m }
    }

    /// This frame's own `inner` as seen from where this frame stands.
    pub fn then(&self, inner: &Self) -> Self {
        Self { rotation: self.rotation * inner.rotation, origin_m: self.origin_m + self.rotation * inner.origin_m }
    }
}

/// What moves the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The cross slide along x of W.
    Dx,
    /// The cross slide along y of W.
    Dy,
    /// The rotary axis.
    Rotary,
}

impl Axis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Dx, Self::Dy, Self::Rotary];
}

/// Something of each [`Axis`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerAxis<T> {
    /// Of [`Axis::Dx`].
    pub dx_m: T,
    /// Of [`Axis::Dy`].
    pub dy_m: T,
    /// Of [`Axis::Rotary`].
    pub rotary_rad: T,
}

/// A position of the table.
pub type Position = PerAxis<f64>;

impl<T> PerAxis<T> {
    /// Axis by axis.
    pub fn of(mut each: impl FnMut(Axis) -> T) -> Self {
        Self { dx_m: each(Axis::Dx), dy_m: each(Axis::Dy), rotary_rad: each(Axis::Rotary) }
    }
}

impl<T> Index<Axis> for PerAxis<T> {
    type Output = T;

    fn index(&self, axis: Axis) -> &T {
        match axis {
            Axis::Dx => &self.dx_m,
            Axis::Dy => &self.dy_m,
            Axis::Rotary => &self.rotary_rad,
        }
    }
}

impl<T> IndexMut<Axis> for PerAxis<T> {
    fn index_mut(&mut self, axis: Axis) -> &mut T {
        match axis {
            Axis::Dx => &mut self.dx_m,
            Axis::Dy => &mut self.dy_m,
            Axis::Rotary => &mut self.rotary_rad,
        }
    }
}

/// A rotary axis under the table, in W.
#[derive(Clone, Copy, Debug)]
pub struct Rotary {
    /// Of length 1.
    pub axis: Unit<Vector3<f64>>,
    /// A point of it while dx = dy = 0, m: the axis moves with the cross slide.
    pub through_m: Vector3<f64>,
}

/// A place on the workpiece that the tool has to reach, in U.
#[derive(Clone, Copy, Debug)]
pub struct Hole {
    /// m.
    pub tip_m: Vector3<f64>,
    /// The tool's axis, of length 1.
    pub axis: Vector3<f64>,
}

/// Holes that are machined with the table at rest.
#[derive(Clone, Debug)]
pub struct Series {
    /// As in the file.
    pub name: String,
    /// On the tool at its tip, in the axes of T_h.
    pub wrench: Wrench<f64>,
    /// At least one.
    pub holes: Vec<Hole>,
    /// How much its holes count where series are placed together.
    pub weight: f64,
}

/// What a robust placement counts with, each 0 where it is sure.
#[derive(Clone, Copy, Debug)]
pub struct Uncertain {
    /// By what share the machine may be softer or stiffer than its model, all of it alike.
    pub stiffness: f64,
    /// How far the force's direction may be off.
    pub load_cone_rad: f64,
    /// How far holes may be from where they are meant, along x and y of W.
    pub hole_radius_m: f64,
}

/// A checked job file.
#[derive(Clone, Debug)]
pub struct Job {
    /// Where it came from.
    pub source: Source,
    /// T_B^W.
    pub base_in_world: Frame,
    /// T_U^W with all axes at 0.
    pub table_in_world: Frame,
    /// T_C^W.
    pub cross_slide_in_world: Frame,
    /// Least and greatest, equal where nothing moves.
    pub limits: PerAxis<[f64; 2]>,
    /// None: it stands at 0.
    pub rotary: Option<Rotary>,
    /// At least one.
    pub series: Vec<Series>,
    /// One position for all series as well.
    pub together: bool,
    /// None: placements are not judged by their worst case.
    pub robust: Option<Uncertain>,
    /// For `compensate`.
    pub program: ProgramJob,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawJob {
    format: Spanned<i64>,
    base_in_world: Spanned<Vec<Vec<f64>>>,
    table_in_world: Spanned<Vec<Vec<f64>>>,
    cross_slide_in_world: Spanned<Vec<Vec<f64>>>,
    dx_mm: Option<Spanned<Numbers<2>>>,
    dy_mm: Option<Spanned<Numbers<2>>>,
    rotary: Option<RawRotary>,
    series: Spanned<Vec<RawSeries>>,
    together: Option<Spanned<bool>>,
    robust: Option<Spanned<RawUncertain>>,
    offsets: Option<RawOffsets>,
    axes: Option<Spanned<[String; 3]>>,
    head: Option<Spanned<String>>,
    tool_axis: Option<Spanned<Numbers<3>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawUncertain {
    stiffness: Option<Spanned<f64>>,
    load_cone_deg: Option<Spanned<f64>>,
    hole_radius_mm: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRotary {
    axis: Spanned<Numbers<3>>,
    through_mm: Spanned<Numbers<3>>,
    range_deg: Spanned<Numbers<2>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSeries {
    name: Spanned<String>,
    wrench: Spanned<RawWrench>,
    holes: Spanned<Vec<RawHole>>,
    weight: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWrench {
    fx_n: f64,
    fy_n: f64,
    fz_n: f64,
    mx_nm: f64,
    my_nm: f64,
    mz_nm: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHole {
    tip_mm: Spanned<Numbers<3>>,
    axis: Spanned<Numbers<3>>,
}

/// What is wrong: where, unless nothing is written there, which key, and why.
type Checked<T> = std::result::Result<T, (Option<Range<usize>>, String, String)>;

fn fail<T>(span: impl Into<Option<Range<usize>>>, key: impl Into<String>, message: impl Into<String>) -> Checked<T> {
    Err((span.into(), key.into(), message.into()))
}

fn rigid(key: &str, raw: &Spanned<Vec<Vec<f64>>>) -> Checked<Frame> {
    let rows = raw.get_ref();
    if rows.len() != 4 || rows.iter().any(|row| row.len() != 4) {
        return fail(raw.span(), key, "expected 4 rows of 4 numbers");
    }
    if rows.iter().flatten().any(|v| !v.is_finite()) {
        return fail(raw.span(), key, "expected finite numbers");
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return fail(raw.span(), key, format!("expected [0, 0, 0, 1] in the last row, found {:?}", rows[3]));
    }
    let rotation = Matrix3::from_fn(|i, j| rows[i][j]);
    let off = (rotation.transpose() * rotation - Matrix3::identity()).abs().max();
    if off > RIGID {
        let message = format!("not rigid: the columns are off by {off:.1e} from square to each other and of length 1");
        return fail(raw.span(), key, message);
    }
    if rotation.determinant() < 0.0 {
        return fail(raw.span(), key, "not rigid: a reflection (the determinant is -1)");
    }
    let origin_m = Vector3::from_fn(|i, _| rows[i][3] / 1e3);
    Ok(Frame { rotation, origin_m })
}

fn range(key: &str, raw: &Spanned<Numbers<2>>) -> Checked<[f64; 2]> {
    let [low, high] = raw.get_ref().0;
    if !(low.abs() <= MAX_LIMIT && high.abs() <= MAX_LIMIT) {
        return fail(raw.span(), key, format!("expected numbers within ±{MAX_LIMIT:e}, found [{low}, {high}]"));
    }
    if low > high {
        return fail(raw.span(), key, format!("reversed limits: expected [least, greatest], found [{low}, {high}]"));
    }
    Ok([low, high])
}

fn direction(key: String, raw: &Spanned<Numbers<3>>) -> Checked<Unit<Vector3<f64>>> {
    let v = Vector3::from(raw.get_ref().0);
    // squares of very long and very short ones would not do
    let v = v / v.amax();
    match Unit::try_new(v, 0.5) {
        Some(unit) if v.iter().all(|v| v.is_finite()) => Ok(unit),
        _ => fail(raw.span(), key, format!("expected a direction, found {:?}", raw.get_ref().0)),
    }
}

fn point(key: String, raw: &Spanned<Numbers<3>>) -> Checked<Vector3<f64>> {
    let v = Vector3::from(raw.get_ref().0) / 1e3;
    if v.iter().all(|v| v.is_finite()) { Ok(v) } else { fail(raw.span(), key, "expected three finite numbers") }
}

fn series(n: usize, raw: &RawSeries) -> Checked<Series> {
    let name = raw.name.get_ref();
    if name.is_empty() || printable(name) != *name {
        return fail(raw.name.span(), "series.name", "expected a name of one line of ordinary text");
    }
    let w = raw.wrench.get_ref();
    let wrench = Wrench::from_vector([w.fx_n, w.fy_n, w.fz_n, w.mx_nm, w.my_nm, w.mz_nm].into());
    if !wrench.to_vector().iter().all(|v| v.abs() <= MAX_LOAD) {
        return fail(
            raw.wrench.span(),
            format!("series.{name}.wrench"),
            format!("expected finite numbers within ±{MAX_LOAD:e}"),
        );
    }
    if raw.holes.get_ref().is_empty() {
        return fail(raw.holes.span(), format!("series.{name}.holes"), format!("series {} has no holes", n + 1));
    }
    let holes = raw.holes.get_ref().iter().enumerate().map(|(i, hole)| {
        let key = |what: &str| format!("series.{name}.holes[{}].{what}", i + 1);
        let axis = direction(key("axis"), &hole.axis)?.into_inner();
        Ok(Hole { tip_m: point(key("tip_mm"), &hole.tip_mm)?, axis })
    });
    let weight = match &raw.weight {
        None => 1.0,
        Some(weight) if (1.0 / MAX_WEIGHT..=MAX_WEIGHT).contains(weight.get_ref()) => *weight.get_ref(),
        Some(weight) => {
            let message = format!("expected {:e} to {MAX_WEIGHT:e}, found {}", 1.0 / MAX_WEIGHT, weight.get_ref());
            return fail(weight.span(), format!("series.{name}.weight"), message);
        }
    };
    Ok(Series { name: name.clone(), wrench, holes: holes.collect::<Checked<_>>()?, weight })
}

/// The three keys of `robust` and their greatest values.
fn uncertain(raw: &Spanned<RawUncertain>, series: &[Series]) -> Checked<Uncertain> {
    let of = |key: &str, raw: &Option<Spanned<f64>>, most: f64| match raw {
        None => Ok(0.0),
        Some(raw) if (0.0..=most).contains(raw.get_ref()) => Ok(*raw.get_ref()),
        Some(raw) => {
            fail(raw.span(), format!("robust.{key}"), format!("expected 0 to {most}, found {}", raw.get_ref()))
        }
    };
    let keys = raw.get_ref();
    let stiffness = of("stiffness", &keys.stiffness, 0.9)?;
    let load_cone_rad = of("load_cone_deg", &keys.load_cone_deg, 45.0)?.to_radians();
    let hole_radius_m = of("hole_radius_mm", &keys.hole_radius_mm, 20.0)? / 1e3;
    if stiffness + load_cone_rad + hole_radius_m == 0.0 {
        let message = "nothing is uncertain: give stiffness, load_cone_deg or hole_radius_mm above 0, or leave it out";
        return fail(raw.span(), "robust", message);
    }
    if let Some(series) = series.iter().find(|series| load_cone_rad > 0.0 && series.wrench.force_n.norm() == 0.0) {
        let message = format!("series `{}` has no force, whose direction could be off", series.name);
        return fail(raw.span(), "robust.load_cone_deg", message);
    }
    Ok(Uncertain { stiffness, load_cone_rad, hole_radius_m })
}

impl RawJob {
    fn checked(&self, source: &Source) -> Checked<Job> {
        if *self.format.get_ref() != 1 {
            return fail(self.format.span(), "format", format!("expected 1, found {}", self.format.get_ref()));
        }
        let slide = |key: &str, raw: &Option<Spanned<Numbers<2>>>| match raw {
            Some(raw) => range(key, raw).map(|limits| limits.map(|v| v / 1e3)),
            None if self.rotary.is_some() => Ok([0.0; 2]),
            None => fail(
                None,
                key,
                "missing key: expected [least, greatest], unless a rotary axis alone moves the workpiece",
            ),
        };
        let (dx_m, dy_m) = (slide("dx_mm", &self.dx_mm)?, slide("dy_mm", &self.dy_mm)?);
        let mut limits = PerAxis { dx_m, dy_m, rotary_rad: [0.0; 2] };
        let rotary = match &self.rotary {
            None => None,
            Some(raw) => {
                limits.rotary_rad = range("rotary.range_deg", &raw.range_deg)?.map(f64::to_radians);
                Some(Rotary {
                    axis: direction("rotary.axis".into(), &raw.axis)?,
                    through_m: point("rotary.through_mm".into(), &raw.through_mm)?,
                })
            }
        };
        let all = self.series.get_ref();
        if all.is_empty() {
            return fail(self.series.span(), "series", "expected at least one [[series]]");
        }
        let mut checked: Vec<Series> = Vec::new();
        for (n, raw) in all.iter().enumerate() {
            let series = series(n, raw)?;
            if checked.iter().any(|other| other.name == series.name) {
                return fail(raw.name.span(), "series.name", format!("duplicate series `{}`", series.name));
            }
            checked.push(series);
        }
        let together = self.together.as_ref().is_some_and(|together| *together.get_ref());
        if let Some(raw) = self.together.as_ref().filter(|_| together && all.len() < 2) {
            return fail(raw.span(), "together", "expected at least two series to be placed together");
        }
        if let Some((raw, weight)) = all.iter().find_map(|raw| Some((raw, raw.weight.as_ref()?))).filter(|_| !together)
        {
            let key = format!("series.{}.weight", raw.name.get_ref());
            return fail(weight.span(), key, "weights count among series placed together: give together = true");
        }
        let program = job_program::checked(
            self.offsets.as_ref(),
            self.axes.as_ref(),
            self.head.as_ref(),
            self.tool_axis.as_ref(),
        )
        .map_err(|(span, key, message)| (Some(span), key.to_owned(), message))?;
        Ok(Job {
            source: source.clone(),
            base_in_world: rigid("base_in_world", &self.base_in_world)?,
            table_in_world: rigid("table_in_world", &self.table_in_world)?,
            cross_slide_in_world: rigid("cross_slide_in_world", &self.cross_slide_in_world)?,
            limits,
            rotary,
            robust: self.robust.as_ref().map(|raw| uncertain(raw, &checked)).transpose()?,
            series: checked,
            together,
            program,
        })
    }
}

impl Job {
    /// Reads and checks a job file.
    ///
    /// # Errors
    /// One message with file, line and key: syntax, an unknown or missing key, a matrix that is not rigid, reversed
    /// limits, a series without holes.
    pub fn parse(source: &Source) -> Result<Self> {
        let text = source.text()?;
        let fail = |(span, key, message): (Option<Range<usize>>, String, String)| {
            let failure = Failure::input(message).in_file(&source.name).at_column(key);
            match span {
                Some(span) => failure.at_line(line_at(text, span.start) as u64),
                None => failure,
            }
        };
        parsed::<RawJob>(source)?.checked(source).map_err(fail)
    }

    /// Whether cross slide and rotary axis both move.
    pub fn slides_and_turns(&self) -> bool {
        let [dx, dy, rotary] = Axis::ALL.map(|axis| self.limits[axis][1] > self.limits[axis][0]);
        rotary && (dx || dy)
    }

    /// T_U^B at a position of the table, Eq. 15.
    pub fn table_in_base(&self, position: &Position) -> Frame {
        self.base_in_world.inverse().then(&self.table_in_world_at(position))
    }

    /// T_U^W at a position of the table.
    pub fn table_in_world_at(&self, position: &Position) -> Frame {
        let mut table = self.table_in_world;
        if let Some(Rotary { axis, through_m }) = &self.rotary {
            let turn = Rotation3::from_axis_angle(axis, position.rotary_rad).into_inner();
            table =
                Frame { rotation: turn * table.rotation, origin_m: through_m + turn * (table.origin_m - through_m) };
        }
        table.origin_m += Vector3::new(position.dx_m, position.dy_m, 0.0);
        table
    }

    /// x and y of U's origin in the cross slide's frame, m.
    pub fn in_cross_slide_m(&self, position: &Position) -> [f64; 2] {
        let origin = self.cross_slide_in_world.inverse().then(&self.table_in_world_at(position)).origin_m;
        [origin.x, origin.y]
    }
}

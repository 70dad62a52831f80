//! Stiffness over the workspace: the paper's Fig. 7 and its Section 5.2.
//!
//! A moves in the plane Y0 = 0 of B-xyz, where X0 = Z0·tan θ; a map shows that plane at one σ.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use pkm_core::{Machine, Pose};
use rayon::prelude::*;
use serde_json::json;

use crate::error::{Failure, Result};
use crate::files::dataset::stiffness_column;
use crate::files::machine::MachineFile;
use crate::pose::{pose_of, tidy};
use crate::progress::Progress;

pub mod claims;

/// Cells along the longer side of a map when no step is given, at least.
const MIN_CELLS: f64 = 100.0;
/// Most points of a run.
const MAX_POINTS: f64 = 2e6;

/// Units of k11…k66 in names of columns.
const UNITS: [&str; 6] = ["n_per_m", "n_per_m", "n_per_m", "nm_per_rad", "nm_per_rad", "nm_per_rad"];

/// What the model gives at a pose.
#[derive(Clone, Copy, Debug)]
pub struct Value {
    /// k11…k66 at A in A-uvw, N/m and N·m/rad.
    pub principal: [f64; 6],
    /// Whether a table was fitted here; `None` without a table.
    pub inside: Option<bool>,
    /// How far a table may be off there, see [`u95_m_per_n`](crate::plan::model::u95_m_per_n); `None` where no table says.
    pub u95_m_per_n: Option<f64>,
}

/// A model: the value of a machine at a pose, or the status that says why there is none.
pub type Model<'a> = dyn Fn(&Machine<f64>, &Pose<f64>) -> std::result::Result<Value, &'static str> + Sync + 'a;

/// A point of a map.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// x of A in B-xyz, mm.
    pub x0_mm: f64,
    /// z of A in B-xyz, mm.
    pub z0_mm: f64,
    /// θ of this place, °.
    pub theta_deg: f64,
    /// The value, or the status that says why there is none.
    pub value: std::result::Result<Value, &'static str>,
}

impl Point {
    /// As in the CSV.
    pub fn status(&self) -> &'static str {
        match self.value {
            Ok(Value { inside: Some(false), .. }) => "outside_box",
            Ok(_) => "ok",
            Err(status) => status,
        }
    }

    /// Expanded uncertainty of the tip's deflection, µm for each kN; `None` where no table says.
    pub fn u95_um_per_kn(&self) -> Option<f64> {
        self.value.ok()?.u95_m_per_n.map(|u95| u95 * 1e9)
    }
}

/// Where points lie: row by row from the least X0 and Z0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// X0 and Z0 of the first point, mm.
    pub least_mm: [f64; 2],
    /// Points along X0 and along Z0.
    pub count: [usize; 2],
    /// Between neighbours, mm.
    pub step_mm: f64,
}

impl Grid {
    /// X0 and Z0, mm.
    pub fn place(&self, column: usize, row: usize) -> [f64; 2] {
        let at = |axis: usize, n: usize| tidy(self.least_mm[axis] + n as f64 * self.step_mm);
        [at(0, column), at(1, row)]
    }

    /// Least and greatest of X0 and of Z0, mm.
    pub fn extent_mm(&self) -> [[f64; 2]; 2] {
        let [[x0, z0], [x1, z1]] = [self.place(0, 0), self.place(self.count[0] - 1, self.count[1] - 1)];
        [[x0, x1], [z0, z1]]
    }
}

/// What the caller leaves open is found from the machine.
#[derive(Clone, Copy, Debug, Default)]
pub struct Window {
    /// Least and greatest X0, mm.
    pub x0_mm: Option<[f64; 2]>,
    /// Least and greatest Z0, mm.
    pub z0_mm: Option<[f64; 2]>,
    /// Between points, mm.
    pub step_mm: Option<f64>,
}

/// The plane at one σ.
pub struct Map {
    /// °.
    pub sigma_deg: f64,
    /// Where the points lie.
    pub grid: Grid,
    /// Row by row.
    pub points: Vec<Point>,
}

impl Map {
    /// Computes a map.
    ///
    /// # Errors
    /// A window that is empty, too fine, or that the machine does not reach.
    pub fn new(
        file: &MachineFile,
        model: &Model<'_>,
        sigma_deg: f64,
        window: &Window,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        let grid = grid(file, sigma_deg, window)?;
        let total = grid.count[0] * grid.count[1];
        let done = AtomicUsize::new(0);
        progress("points", 0, total as u64);
        let row = |row: usize| {
            let point = |column| {
                let [x0_mm, z0_mm] = grid.place(column, row);
                let theta_deg = theta_deg([x0_mm, z0_mm]);
                let value = model(&file.machine, &pose_of(theta_deg, sigma_deg, z0_mm));
                Point { x0_mm, z0_mm, theta_deg, value }
            };
            let points: Vec<Point> = (0..grid.count[0]).map(point).collect();
            let before = done.fetch_add(points.len(), Ordering::Relaxed);
            progress("points", (before + points.len()) as u64, total as u64);
            points
        };
        let points = (0..grid.count[1]).into_par_iter().map(row).collect::<Vec<_>>().concat();
        if points.iter().all(|p| p.value.is_err()) {
            let [[x0, x1], [z0, z1]] = grid.extent_mm();
            return Err(Failure::usage(format!(
                "no stiffness at any of {total} points of X0 {x0} to {x1} mm, Z0 {z0} to {z1} mm at σ = {sigma_deg}°: {}; \
                 take another window or a smaller step",
                counted(&points)
            )));
        }
        Ok(Self { sigma_deg, grid, points })
    }

    /// Where each stiffness is least and greatest, among points that can be trusted if there are any.
    pub(crate) fn extremes(&self) -> [[&Point; 2]; 6] {
        std::array::from_fn(|k| self.ends(|value| value.principal[k]))
    }

    /// Where the uncertainty of the tip is least and greatest, likewise; none where no table says.
    pub(crate) fn u95_extremes(&self) -> Option<[&Point; 2]> {
        let ends = self.ends(|value| value.u95_m_per_n.unwrap_or(f64::NAN));
        ends[0].u95_um_per_kn().map(|_| ends)
    }

    fn ends(&self, quantity: impl Fn(&Value) -> f64) -> [&Point; 2] {
        let any_ok = self.points.iter().any(|p| p.status() == "ok");
        let counts = |p: &&Point| if any_ok { p.status() == "ok" } else { p.value.is_ok() };
        let of = |p: &&Point| p.value.map_or(f64::NAN, |v| quantity(&v));
        let points = || self.points.iter().filter(counts);
        let least = points().min_by(|a, b| of(a).total_cmp(&of(b)));
        let greatest = points().max_by(|a, b| of(a).total_cmp(&of(b)));
        // a map has at least one point with a value
        [least, greatest].map(|p| p.unwrap_or(&self.points[0]))
    }

    /// For the terminal.
    pub fn summary(&self) -> String {
        let [[x0, x1], [z0, z1]] = self.grid.extent_mm();
        let mut text = format!(
            "σ = {}°: X0 {x0} to {x1} mm, Z0 {z0} to {z1} mm, every {} mm: {}\n",
            self.sigma_deg,
            self.grid.step_mm,
            counted(&self.points)
        );
        if self.points.iter().any(|p| p.status() == "outside_box") && self.points.iter().any(|p| p.status() == "ok") {
            text.push_str("  inside the table's box:\n");
        }
        for (k, ends) in self.extremes().iter().enumerate() {
            let at = |p: &Point| {
                let value = p.value.map_or(f64::NAN, |v| v.principal[k]);
                format!("{value:.4e} at X0 {:>6}, Z0 {:>6}", p.x0_mm, p.z0_mm)
            };
            let unit = if k < 3 { "N/m" } else { "N·m/rad" };
            text.push_str(&format!("  {} {unit:<8} {}   to   {}\n", stiffness_column(k, k), at(ends[0]), at(ends[1])));
        }
        if let Some(ends) = self.u95_extremes() {
            let [least, greatest] = ends.map(|p| {
                let value = p.u95_um_per_kn().unwrap_or(f64::NAN);
                format!("{value:.4} at X0 {:>6}, Z0 {:>6}", p.x0_mm, p.z0_mm)
            });
            text.push_str(&format!("  U95 of the tip, µm for each kN: {least}   to   {greatest}\n"));
        }
        text
    }

    /// For `--json`.
    pub fn to_json(&self) -> serde_json::Value {
        let [x0_mm, z0_mm] = self.grid.extent_mm();
        let end = |p: &Point, k: usize| json!({ "value": p.value.ok().map(|v| v.principal[k]), "x0_mm": p.x0_mm, "z0_mm": p.z0_mm });
        let extremes = self.extremes();
        let stiffness: serde_json::Map<_, _> = (0..6)
            .map(|k| {
                let [least, greatest] = extremes[k];
                (
                    format!("{}_{}", stiffness_column(k, k), UNITS[k]),
                    json!({ "least": end(least, k), "greatest": end(greatest, k) }),
                )
            })
            .collect();
        let u95_end = |p: &Point| json!({ "value": p.u95_um_per_kn(), "x0_mm": p.x0_mm, "z0_mm": p.z0_mm });
        let u95 = self
            .u95_extremes()
            .map(|[least, greatest]| json!({ "least": u95_end(least), "greatest": u95_end(greatest) }));
        json!({
            "sigma_deg": self.sigma_deg, "x0_mm": x0_mm, "z0_mm": z0_mm, "step_mm": self.grid.step_mm,
            "points": counts(&self.points), "stiffness": stiffness, "u95_um_per_kn": u95,
        })
    }

    /// Rows for the CSV, in the order of [`header`].
    pub fn rows(&self) -> impl Iterator<Item = Vec<String>> {
        self.points.iter().map(|p| {
            let inside = p.value.ok().and_then(|v| v.inside).map_or(String::new(), |inside| inside.to_string());
            let numbers = [p.x0_mm, p.z0_mm, p.theta_deg, self.sigma_deg].map(|v| v.to_string());
            let mut row = numbers.to_vec();
            row.extend([p.status().to_owned(), inside]);
            row.extend((0..6).map(|i| p.value.map_or(String::new(), |v| v.principal[i].to_string())));
            row.push(p.u95_um_per_kn().map_or(String::new(), |u95| u95.to_string()));
            row
        })
    }
}

fn counts(points: &[Point]) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for point in points {
        *counts.entry(point.status()).or_default() += 1;
    }
    counts
}

/// "12 ok, 3 out_of_travel".
pub(crate) fn counted(points: &[Point]) -> String {
    counts(points).iter().map(|(status, n)| format!("{n} {status}")).collect::<Vec<_>>().join(", ")
}

/// Columns of the CSV.
pub fn header() -> Vec<String> {
    let mut header =
        ["x0_mm", "z0_mm", "theta_deg", "sigma_deg", "status", "inside_domain"].map(str::to_owned).to_vec();
    header.extend((0..6).map(|i| format!("{}_{}", stiffness_column(i, i), UNITS[i])));
    header.push("u95_um_per_kn".to_owned());
    header
}

/// θ of a place of A.
pub(crate) fn theta_deg([x0_mm, z0_mm]: [f64; 2]) -> f64 {
    x0_mm.atan2(z0_mm).to_degrees()
}

/// 1, 2 or 5 times a power of ten, at most `limit`.
fn round_step(limit: f64) -> f64 {
    let power = 10_f64.powf(limit.log10().floor());
    [5.0, 2.0].into_iter().map(|n| n * power).find(|step| *step <= limit * (1.0 + 1e-9)).unwrap_or(power)
}

fn grid(file: &MachineFile, sigma_deg: f64, window: &Window) -> Result<Grid> {
    let found = || {
        workspace(file, sigma_deg)
            .ok_or_else(|| Failure::usage(format!("--sigma-deg: the machine takes no pose with σ = {sigma_deg}°")))
    };
    let given = [window.x0_mm, window.z0_mm];
    let open = if given.contains(&None) { found()? } else { [[0.0; 2]; 2] };
    let ranges: [[f64; 2]; 2] = std::array::from_fn(|axis| given[axis].unwrap_or(open[axis]));
    let lengths = ranges.map(|[low, high]| high - low);
    let (longest, shortest) = (lengths[0].max(lengths[1]), lengths[0].min(lengths[1]));
    let step_mm = window.step_mm.unwrap_or_else(|| round_step((longest / MIN_CELLS).min(shortest)));
    if shortest < step_mm {
        let [[x0, x1], [z0, z1]] = ranges;
        return Err(Failure::usage(format!(
            "a step of {step_mm} mm is longer than the window: X0 {x0} to {x1} mm, Z0 {z0} to {z1} mm"
        )));
    }
    let mut least_mm = [0.0; 2];
    let mut steps = [0.0; 2];
    for axis in 0..2 {
        let [low, high] = ranges[axis];
        if given[axis].is_some() {
            // to a length of whole steps but for rounding
            (least_mm[axis], steps[axis]) = (low, (lengths[axis] / step_mm + 1e-9).floor());
        } else {
            let first = (low / step_mm).floor();
            (least_mm[axis], steps[axis]) = (first * step_mm, (high / step_mm).ceil() - first);
        }
    }
    let total = (steps[0] + 1.0) * (steps[1] + 1.0);
    if total > MAX_POINTS {
        return Err(Failure::usage(format!(
            "a step of {step_mm} mm makes {total:.1e} points, more than {MAX_POINTS:.0e}: take more, or a part of the plane"
        )));
    }
    Ok(Grid { least_mm, count: steps.map(|n| n as usize + 1), step_mm })
}

/// Least and greatest X0 and Z0 of A, mm, at a σ; `None` when the machine takes no such pose.
///
/// Squares of the plane are divided until they are too small to matter. One whose middle is out of travel by more than
/// any screw changes on the way to its corners holds no pose.
fn workspace(file: &MachineFile, sigma_deg: f64) -> Option<[[f64; 2]; 2]> {
    let free = file.without_travel()?;
    let (g, longest) = (&file.parameters.geometry, &file.parameters.travel.max_m);
    let arms = [[g.a1_m, g.b1_m], [g.a1_m, g.b1_m], [g.a2_m, g.b2_m]];
    let reach_mm = arms.iter().zip(longest).map(|([a, b], q)| (a + b + q) * 1e3).fold(f64::INFINITY, f64::min);
    let arm_mm = g.a1_m.max(g.a2_m) * 1e3;

    let mut found = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let half = reach_mm / 2.0;
    let mut squares = vec![([-half, half], half), ([half, half], half)];
    while let Some((middle, half)) = squares.pop() {
        if (0..2).all(|i| found[i][0] <= middle[i] - half && middle[i] + half <= found[i][1]) {
            continue;
        }
        let lengths = free.inverse(&pose_of(theta_deg(middle), sigma_deg, middle[1]));
        match lengths.and_then(|lengths| file.machine.travel_margin_m(&lengths)) {
            Ok((margin_m, _)) => {
                let margin_mm = margin_m * 1e3;
                if margin_mm >= 0.0 {
                    for (range, at) in found.iter_mut().zip(middle) {
                        *range = [range[0].min(at), range[1].max(at)];
                    }
                }
                let (way, distance) = (half * f64::sqrt(2.0), middle[0].hypot(middle[1]));
                if way < distance && -margin_mm > way + arm_mm * (way / distance).asin() {
                    continue;
                }
            }
            // on the far side of a singularity, where nothing tells how far it is
            Err(_) if half < reach_mm / 1e3 => continue,
            Err(_) => {}
        }
        if half > reach_mm / 1.6e4 {
            let half = half / 2.0;
            let corners = [[-half, -half], [half, -half], [-half, half], [half, half]];
            squares.extend(corners.map(|[x, z]| ([middle[0] + x, middle[1] + z], half)));
        }
    }
    found.iter().all(|[low, high]| low <= high).then_some(found)
}

//! What speaks against the readings themselves: a frame, sign, point or unit other than the file's, a series that cannot be
//! one, single readings that stand out.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{DVector, Matrix3, Vector3};
use pkm_core::{Pose, Wrench};
use pkm_diagnosis::residuals::{Outlier, Structure};
use pkm_diagnosis::verdict::Judgement;
use pkm_diagnosis::{Fit, Problem, Rules, Whitener};
use rayon::prelude::*;
use serde::Serialize;

use super::experiment::{self, Experiment};
use super::findings::DeclaredFinding;
use super::model::Model;
use crate::files::dataset::READ_COLUMNS;
use crate::files::readings::{CHANNELS, KINDS, Readings};

/// Kind of the warning that the readings are in another frame, point, unit or sign.
pub const TAKEN_OTHERWISE: &str = "readings_taken_otherwise";
/// Residuals over their noise from which on another way to take the readings does not fit well either.
const BADLY_SD: f64 = 10.0;
/// Standard acceleration of gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// Pound-force in N, foot in m.
const POUND_N: f64 = 4.448_221_615_260_5;
const FOOT_M: f64 = 0.304_8;
/// Units that instruments show beside those of the file.
const ARCSECOND_URAD: f64 = 1e6 * PI / (180.0 * 3600.0);
const MILLIDEGREE_URAD: f64 = 1e3 * PI / 180.0;
const THOU_UM: f64 = 25.4;

/// A reason to look at the readings before the machine.
#[derive(Clone, Debug, Serialize)]
pub struct Warning {
    /// `readings_taken_otherwise`, `series_at_several_poses`, `pose_name_at_several_positions`, `few_degrees_of_freedom`,
    /// `repeats_that_differ`, `equal_repeats`, `declared_noise_too_great`, `order_of_readings`, `many_great_changes` or `held_out_contradicts`.
    pub kind: &'static str,
    /// For people.
    pub message: String,
}

impl Warning {
    /// With its full stop, where it is no question.
    pub fn sentence(&self) -> String {
        format!("{}{}", self.message, if self.message.ends_with('?') { "" } else { "." })
    }
}

/// A reading that stands out.
#[derive(Clone, Debug, Serialize)]
pub struct Suspect {
    /// Line of the file.
    pub line: u64,
    /// Its column.
    pub column: &'static str,
    /// As read, in µm or µrad.
    pub value: f64,
    /// As the final model gives it.
    pub expected: f64,
    /// Residual in robust standard deviations of its channel.
    pub residual_sd: f64,
    /// Whether it was left out: a gross error.
    pub excluded: bool,
}

impl Suspect {
    /// For people.
    pub fn text(&self) -> String {
        let left_out = if self.excluded { "; it was left out" } else { "" };
        format!(
            "line {}, {}: read {:.2}, expected {:.2}, {:.0} times the scatter of the others{left_out}",
            self.line, self.column, self.value, self.expected, self.residual_sd
        )
    }
}

/// Turns the readings of one kind, three channels; none where a blank one would have to be known.
fn turned(observed: &mut [Option<f64>; CHANNELS], kind: usize, turn: &Matrix3<f64>) -> Option<()> {
    let own: [Option<f64>; 3] = std::array::from_fn(|i| observed[3 * kind + i]);
    if own.iter().all(Option::is_none) {
        return Some(());
    }
    for row in 0..3 {
        let mut sum = 0.0;
        for (column, value) in own.iter().enumerate() {
            let share = turn[(row, column)];
            match value {
                Some(value) => sum += share * value,
                // a blank that stays where it is does no harm
                None if share == 0.0 || (row == column && share.abs() == 1.0) => {}
                None => return None,
            }
        }
        if own[row].is_some() {
            observed[3 * kind + row] = Some(sum);
        } else if turn[(row, row)].abs() != 1.0 {
            return None;
        }
    }
    Some(())
}

fn turned_load(w: &Wrench<f64>, turn: &Matrix3<f64>, axial: f64) -> Wrench<f64> {
    Wrench { force_n: turn * w.force_n, moment_nm: turn * w.moment_nm * axial }
}

/// From B-xyz to A-uvw.
fn into_a(pose: &Pose<f64>) -> Matrix3<f64> {
    let ((st, ct), (ss, cs)) = (pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
    // the transpose of R_y(θ) R_x(σ)
    Matrix3::new(ct, 0.0, -st, ss * st, cs, ss * ct, cs * st, -ss, cs * ct)
}

/// The 47 ways to exchange and reverse three axes, with their names, the plainest first.
fn exchanges() -> Vec<(String, Matrix3<f64>)> {
    let mut all = Vec::new();
    for order in [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]] {
        for signs in 0..8_u8 {
            let sign = |i: usize| if signs >> i & 1 == 1 { -1.0 } else { 1.0 };
            // what stands in column i is ±the component along axis order[i]
            let mut turn = Matrix3::zeros();
            (0..3).for_each(|i| turn[(order[i], i)] = sign(i));
            let name: Vec<String> = (0..3)
                .map(|i| format!("{}{}", if sign(i) < 0.0 { "−" } else { "" }, ["u", "v", "w"][order[i]]))
                .collect();
            if turn != Matrix3::identity() {
                all.push((name.join(", "), turn));
            }
        }
    }
    all
}

/// Whether two axes were exchanged, or one reversed: what a column under the wrong head does.
fn is_one_slip(turn: &Matrix3<f64>) -> bool {
    // such a turn is its own inverse and leaves one or two axes as they are
    let kept = (0..3).filter(|i| turn[(*i, *i)] == 1.0).count();
    turn * turn == Matrix3::identity() && turn.determinant() < 0.0 && kept > 0
}

/// Turns of translations and rotations, by pose.
type Turns = Box<dyn Fn(&Pose<f64>) -> [Matrix3<f64>; 2] + Send + Sync>;

/// Readings, made when they are asked for. `None` where a blank would have to be known.
type Taken<'a> = Box<dyn Fn() -> Option<Readings> + Send + Sync + 'a>;

/// Another way to take the readings, as `… fit the declared machine much better …`.
struct Way<'a> {
    how: String,
    /// The readings so taken: of tens of thousands there is no room for all ways at once.
    taken: Taken<'a>,
    /// Whether loads, points and gauges are those of the file, so that its predictions hold.
    is_as_predicted: bool,
}

/// With readings in turned axes, and loads with them if `axial`, the sign of a moment there, is given.
fn in_turned_axes(readings: &Readings, turns: &Turns, axial: Option<f64>) -> Option<Readings> {
    let mut other = readings.without(|_| false);
    for r in &mut other.readings {
        let [linear, angular] = turns(&readings.poses[readings.conditions[r.condition].pose].pose);
        turned(&mut r.observed, 0, &linear)?;
        turned(&mut r.observed, 1, &angular)?;
    }
    for c in &mut other.conditions {
        let [linear, _] = turns(&readings.poses[c.pose].pose);
        c.gauge = c.gauge.map(|direction| (linear * Vector3::from(direction)).into());
        if let Some(axial) = axial {
            c.wrench = turned_load(&c.wrench, &linear, axial);
            c.turned_at = turned_load(&c.turned_at, &linear, axial);
        }
    }
    Some(other)
}

/// With forces and moments so many times as large.
fn under_loads(readings: &Readings, force: f64, moment: f64) -> Readings {
    let mut other = readings.without(|_| false);
    let scaled = |w: &Wrench<f64>| Wrench { force_n: w.force_n * force, moment_nm: w.moment_nm * moment };
    for c in &mut other.conditions {
        (c.wrench, c.turned_at) = (scaled(&c.wrench), scaled(&c.turned_at));
    }
    other
}

/// With the components of forces, moments or both turned, which leaves displacements where they are.
fn under_turned_loads(readings: &Readings, force: &Matrix3<f64>, moment: &Matrix3<f64>) -> Readings {
    let mut other = readings.without(|_| false);
    let turned = |w: &Wrench<f64>| Wrench { force_n: force * w.force_n, moment_nm: moment * w.moment_nm };
    for c in &mut other.conditions {
        (c.wrench, c.turned_at) = (turned(&c.wrench), turned(&c.turned_at));
    }
    other
}

/// With translations and rotations so many times as large.
fn in_units(readings: &Readings, linear: f64, angular: f64) -> Readings {
    let mut other = readings.without(|_| false);
    for r in &mut other.readings {
        for (c, value) in r.observed.iter_mut().enumerate() {
            let factor = if KINDS[c] == 0 { linear } else { angular };
            *value = value.map(|v| factor * v);
        }
    }
    other
}

/// At poses that the file means otherwise. `None` where one is no pose.
fn at_poses(readings: &Readings, meant: impl Fn([f64; 2]) -> [f64; 2]) -> Option<Readings> {
    let mut other = readings.without(|_| false);
    for p in &mut other.poses {
        [p.pose.theta_rad, p.pose.sigma_rad] = meant([p.pose.theta_rad, p.pose.sigma_rad]);
        (p.pose.theta_rad.abs().max(p.pose.sigma_rad.abs()) < FRAC_PI_2).then_some(())?;
    }
    Some(other)
}

/// With displacements at a point of A-uvw, and loads that act there or at A.
fn at_point(readings: &Readings, point_m: Vector3<f64>, load_too: bool) -> Readings {
    let mut other = readings.without(|_| false);
    for c in &mut other.conditions {
        c.point_m = point_m.into();
        if !load_too {
            // the same load, seen from there
            (c.wrench, c.turned_at) = (c.wrench.moved_to_a(-point_m), c.turned_at.moved_to_a(-point_m));
        }
    }
    other
}

/// Other units of forces and moments, and what they are in N and N·m.
const UNITS_OF_LOADS: [(&str, f64, f64); 7] = [
    ("with forces in kgf or daN", GRAVITY, 1.0),
    ("with forces in kgf or daN and moments in kgf·m or daN·m", GRAVITY, GRAVITY),
    ("with forces in lbf", POUND_N, 1.0),
    ("with forces in lbf and moments in lbf·ft", POUND_N, POUND_N * FOOT_M),
    ("with forces in lbf and moments in lbf·in", POUND_N, POUND_N * FOOT_M / 12.0),
    ("with moments in N·mm", 1.0, 1e-3),
    ("with forces in kN", 1e3, 1.0),
];

/// All ways that are tried.
fn other_ways<'a>(readings: &'a Readings, tip_m: Vector3<f64>) -> Vec<Way<'a>> {
    let mut all = Vec::new();
    let has_gauges = readings.conditions.iter().any(|c| c.gauge.is_some());
    let mut turn = |how: String, turns: Turns, axial: Option<f64>| {
        let taken = Box::new(move || in_turned_axes(readings, &turns, axial));
        all.push(Way { how, taken, is_as_predicted: axial.is_none() && !has_gauges });
    };
    let plain = Matrix3::identity();
    turn("with all signs reversed".into(), Box::new(move |_| [-plain, -plain]), None);
    turn("as displacements in B".into(), Box::new(|p| [into_a(p); 2]), None);
    turn("with displacements and loads in B".into(), Box::new(|p| [into_a(p); 2]), Some(1.0));
    let has_rotations = readings.channels()[3..].contains(&true);
    if has_rotations {
        turn("with the signs of all rotations reversed".into(), Box::new(move |_| [plain, -plain]), None);
        turn("with the signs of all translations reversed".into(), Box::new(move |_| [-plain, plain]), None);
    }
    for (name, exchange) in exchanges() {
        let axial = exchange.determinant();
        let how = format!("with dx, dy, dz along {name}");
        if has_rotations {
            turn(format!("{how}, rotations as they are"), Box::new(move |_| [exchange, plain]), None);
            turn(format!("with rx, ry, rz about {name}"), Box::new(move |_| [plain, exchange * axial]), None);
        }
        turn(how, Box::new(move |_| [exchange, exchange * axial]), None);
        turn(
            format!("in B with dx, dy, dz along x, y, z taken as {name}"),
            Box::new(move |p| [into_a(p) * exchange, into_a(p) * exchange * axial]),
            None,
        );
        turn(
            format!("in axes that are {name}, loads as well"),
            Box::new(move |_| [exchange, exchange * axial]),
            Some(axial),
        );
    }
    let mut otherwise = |how: String, taken: Taken<'a>| {
        all.push(Way { how, taken, is_as_predicted: false });
    };
    for (how, force, moment) in UNITS_OF_LOADS {
        otherwise(how.into(), Box::new(move || Some(under_loads(readings, force, moment))));
    }
    for (how, linear, angular) in [
        ("with rotations in arcseconds", 1.0, ARCSECOND_URAD),
        ("with rotations in thousandths of a degree", 1.0, MILLIDEGREE_URAD),
        ("with translations in thousandths of an inch", THOU_UM, 1.0),
    ] {
        otherwise(how.into(), Box::new(move || Some(in_units(readings, linear, angular))));
    }
    for (name, turn) in exchanges().into_iter().filter(|(_, turn)| is_one_slip(turn)) {
        for (what, force, moment) in
            [("forces", turn, plain), ("moments", plain, turn), ("forces and moments", turn, turn)]
        {
            let how = format!("with {what} along {name}");
            otherwise(how, Box::new(move || Some(under_turned_loads(readings, &force, &moment))));
        }
    }
    for (how, meant) in [
        ("with theta and sigma exchanged", (|[t, s]| [s, t]) as fn([f64; 2]) -> [f64; 2]),
        ("with theta reversed", |[t, s]| [-t, s]),
        ("with sigma reversed", |[t, s]| [t, -s]),
        ("with theta and sigma reversed", |[t, s]| [-t, -s]),
        ("with theta and sigma in radians", |angles| angles.map(f64::to_degrees)),
    ] {
        otherwise(how.into(), Box::new(move || at_poses(readings, meant)));
    }
    if readings.conditions.iter().all(|c| c.point_m == [0.0; 3]) {
        let mm = tip_m * 1e3;
        let tip = format!("at the tool's tip (u, v, w = {:.0}, {:.0}, {:.0} mm)", mm.x, mm.y, mm.z);
        for (how, load_too) in
            [(format!("as displacements {tip}"), false), (format!("with displacements and loads {tip}"), true)]
        {
            otherwise(how, Box::new(move || Some(at_point(readings, tip_m, load_too))));
        }
    }
    all
}

/// What a linear form at the declared values leaves of some residuals when the stiffnesses move as their uncertainty lets
/// them, in noise variances a number. No step is so long that a compliance would become negative.
fn left(linear: &Fit, residuals: &DVector<f64>, uncertainty: f64) -> f64 {
    let along = linear.jacobian.tr_mul(residuals);
    let step = linear.information.solve(&along);
    let part = 1.0 / (uncertainty * step.amax()).max(1.0);
    let rest = residuals.norm_squared() - (2.0 - part) * part * along.dot(&step);
    rest.max(0.0) / residuals.len() as f64
}

/// Whether the readings fit the declared machine much better when they are taken otherwise. Linearised, so that there is
/// an answer even where no fit converges.
pub fn taken_otherwise(
    problem: &Problem<'_>,
    whitener: &Whitener,
    model: &Model,
    readings: &Readings,
    tip_m: Vector3<f64>,
) -> Option<Warning> {
    let stiffnesses = problem.model.declared();
    let declared = vec![0.0; stiffnesses.len()];
    let at_declared = |problem: &Problem<'_>| problem.linear(&stiffnesses, declared.clone().into());
    let as_said = at_declared(problem)?;
    let uncertainty = model.uncertainty.joint.max(model.uncertainty.body);
    let left = |linear: &Fit, residuals: &DVector<f64>| left(linear, residuals, uncertainty);
    let said = left(&as_said, &as_said.residuals);
    let found: Vec<(String, f64)> = other_ways(readings, tip_m)
        .into_par_iter()
        .filter_map(|way| {
            let taken = (way.taken)()?;
            let (observations, experiment) = (experiment::observations(&taken, model), Experiment::new(model, &taken));
            let other = Problem::new(&observations, whitener, &experiment, problem.rules);
            let residuals = other.residuals(&[], &[])?;
            // no stiffness mends what is worse to begin with
            if residuals.norm_squared() >= as_said.residuals.norm_squared() {
                return None;
            }
            let rest =
                if way.is_as_predicted { left(&as_said, &residuals) } else { left(&at_declared(&other)?, &residuals) };
            Some((way.how, rest))
        })
        .collect();
    // of what is alike the first two, which are the plainest
    let least = found.iter().map(|f| f.1).fold(f64::INFINITY, f64::min);
    let alike: Vec<&(String, f64)> = found.iter().filter(|f| f.1 <= 1.1 * least).take(2).collect();
    let (_, rest) = alike.first()?;
    let how = alike.iter().map(|f| f.0.as_str()).collect::<Vec<_>>().join(", or ");
    let times = |left: f64| format!("{:.1}", left.sqrt());
    let other =
        if rest.sqrt() > BADLY_SD { ", which is not well either: more than one thing may be otherwise" } else { "" };
    (*rest < said / problem.rules.min_rss_ratio).then(|| Warning {
        kind: TAKEN_OTHERWISE,
        message: format!(
            "the readings fit the declared machine much better {how} (residuals of {} times their noise{other}) than as the file says, \
             displacements of A in A-uvw under loads at A ({} times): are they?",
            times(*rest),
            times(said)
        ),
    })
}

/// What the file itself gives away: series and names of poses that stand at several poses.
pub fn of_file(readings: &Readings) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut poses_of: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for r in readings.readings.iter().filter(|r| !readings.series_names[r.series].is_empty()) {
        let poses = poses_of.entry(r.series).or_default();
        let pose = readings.conditions[r.condition].pose;
        if !poses.contains(&pose) {
            poses.push(pose);
        }
    }
    let wide: Vec<_> = poses_of.iter().filter(|(_, poses)| poses.len() > 1).collect();
    if let Some((series, poses)) = wide.first() {
        let others = if wide.len() > 1 { format!(", {} more at several", wide.len() - 1) } else { String::new() };
        warnings.push(Warning {
            kind: "series_at_several_poses",
            message: format!(
                "series {} stands at {} poses{others}: the readings of a series share the error of one zero reading; if the \
                 sensor was zeroed anew at each pose, number the series through",
                readings.series_names[**series],
                poses.len()
            ),
        });
    }
    let twice = (readings.poses.iter().enumerate())
        .filter_map(|(n, p)| Some((readings.poses[..n].iter().find(|o| o.id == p.id && !p.id.is_empty())?, p)));
    let twice: Vec<_> = twice.collect();
    if let Some((first, other)) = twice.first() {
        let more = if twice.len() > 1 { format!(" (and {} more)", twice.len() - 1) } else { String::new() };
        warnings.push(Warning {
            kind: "pose_name_at_several_positions",
            message: format!(
                "pose {} stands at other coordinates in line {} than in line {}{more}: they are taken as different poses: is \
                 one of them mistyped?",
                other.id, other.line, first.line
            ),
        });
    }
    warnings
}

/// What the result gives away.
pub fn of_result(
    judgement: &Judgement,
    declared: &[DeclaredFinding],
    structure: &[Structure],
    rules: &Rules,
) -> Vec<Warning> {
    let limit = rules.implausible_pull_sd;
    let mut warnings = Vec::new();
    let great = declared.iter().filter(|f| f.pull_sd.abs() > limit).count();
    if great > rules.max_implausible_pulls {
        warnings.push(Warning {
            kind: "many_great_changes",
            message: format!(
                "{great} declared values would have to change by more than {limit} standard deviations: a wrong frame, \
                 point, unit or sign of the readings is likelier than so many wrong stiffnesses"
            ),
        });
    }
    let order = structure.iter().find(|s| s.factor == "order");
    if order.is_some_and(|s| s.p < rules.max_order_p && s.share > rules.min_order_share)
        && judgement.after.p < rules.max_misfit_p
    {
        warnings.push(Warning {
            kind: "order_of_readings",
            message:
                "the residuals go with the order of the readings: a drift, or a zero that was read anew; give readings \
                      that share a zero reading one number in the column `series`"
                    .into(),
        });
    }
    warnings
}

/// Outliers as the file has them, left out or not; `expected` is by condition.
pub fn suspects(
    readings: &Readings,
    outliers: &[Outlier],
    expected: &[[f64; CHANNELS]],
    excluded: bool,
) -> Vec<Suspect> {
    let of = |o: &Outlier| {
        let r = &readings.readings[o.reading];
        Suspect {
            line: r.line,
            column: READ_COLUMNS[o.channel],
            value: r.observed[o.channel].unwrap_or(f64::NAN) * 1e6,
            expected: expected[r.condition][o.channel] * 1e6,
            residual_sd: o.studentised,
            excluded,
        }
    };
    outliers.iter().map(of).collect()
}

/// Gross errors in readings: each costs its number, and no channel its noise.
pub fn gross(readings: &Readings, model: &Model, rules: &Rules) -> Vec<Outlier> {
    let experiment = Experiment::new(model, readings);
    let said = model.predict(&experiment.poses, experiment.conditions, &[], &[]);
    said.map_or(Vec::new(), |said| {
        pkm_diagnosis::gross::gross(&experiment::observations(readings, model), said.as_flattened(), rules)
    })
}

//! Other ways to take the readings of a file than as displacements of A in A-uvw under loads at A: in other frames, units, signs,
//! at other points and poses.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Vector3};
use pkm_core::kinematics::platform_axes;
use pkm_core::{Pose, Wrench};

use crate::files::import::{FOOT_M, GRAVITY, POUND_N};
use crate::files::pose::NamedPose;
use crate::files::readings::{CHANNELS, GAUGE, KINDS, Readings};

/// Units that instruments show beside those of the file.
const ARCSECOND_URAD: f64 = 1e6 * PI / (180.0 * 3600.0);
const MILLIDEGREE_URAD: f64 = 1e3 * PI / 180.0;
const THOU_UM: f64 = 25.4;

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
    platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos()).transpose()
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
pub struct Way<'a> {
    /// For people.
    pub how: String,
    /// The readings so taken: of tens of thousands there is no room for all ways at once.
    pub taken: Taken<'a>,
    /// Whether loads, points and gauges are those of the file, so that its predictions hold.
    pub is_as_predicted: bool,
}

/// With readings in turned axes, and loads with them if `axial`, the sign of a moment there, is given.
fn in_turned_axes(readings: &Readings, turns: &Turns, axial: Option<f64>) -> Option<Readings> {
    let mut other = readings.clone();
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
    let mut other = readings.clone();
    let scaled = |w: &Wrench<f64>| Wrench { force_n: w.force_n * force, moment_nm: w.moment_nm * moment };
    for c in &mut other.conditions {
        (c.wrench, c.turned_at) = (scaled(&c.wrench), scaled(&c.turned_at));
    }
    other
}

/// With the components of forces, moments or both turned, which leaves displacements where they are.
fn under_turned_loads(readings: &Readings, force: &Matrix3<f64>, moment: &Matrix3<f64>) -> Readings {
    let mut other = readings.clone();
    let turned = |w: &Wrench<f64>| Wrench { force_n: force * w.force_n, moment_nm: moment * w.moment_nm };
    for c in &mut other.conditions {
        (c.wrench, c.turned_at) = (turned(&c.wrench), turned(&c.turned_at));
    }
    other
}

/// With translations and rotations so many times as large.
fn in_units(readings: &Readings, linear: f64, angular: f64) -> Readings {
    let mut other = readings.clone();
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
    let mut other = readings.clone();
    for p in &mut other.poses {
        [p.pose.theta_rad, p.pose.sigma_rad] = meant([p.pose.theta_rad, p.pose.sigma_rad]);
        (p.pose.theta_rad.abs().max(p.pose.sigma_rad.abs()) < FRAC_PI_2).then_some(())?;
    }
    Some(other)
}

/// With displacements at a point of A-uvw, and loads that act there or at A.
fn at_point(readings: &Readings, point_m: Vector3<f64>, load_too: bool) -> Readings {
    let mut other = readings.clone();
    for c in &mut other.conditions {
        c.point_m = point_m.into();
        if !load_too {
            // the same load, seen from there
            (c.wrench, c.turned_at) = (c.wrench.moved_to_a(-point_m), c.turned_at.moved_to_a(-point_m));
        }
    }
    other
}

/// With loads that act so far from where the file has them, in A-uvw.
pub fn with_lever(readings: &Readings, lever_m: Vector3<f64>) -> Readings {
    let mut other = readings.clone();
    for c in &mut other.conditions {
        (c.wrench, c.turned_at) = (c.wrench.moved_to_a(lever_m), c.turned_at.moved_to_a(lever_m));
    }
    other
}

/// The same as a way to take the readings.
pub fn levered(readings: &Readings, lever_m: Vector3<f64>) -> Way<'_> {
    let mm = lever_m.map(|m| (m * 1e3).round() + 0.0);
    let how = format!("with loads that act {}, {}, {} mm (u, v, w) from where the file has them", mm.x, mm.y, mm.z);
    Way { how, taken: Box::new(move || Some(with_lever(readings, lever_m))), is_as_predicted: false }
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

/// Columns of rotations that were exchanged or reversed, alone and as those of translations were: no turn of the axes does that.
fn of_columns(name: &str, exchange: &Matrix3<f64>) -> Vec<(String, Turns)> {
    if !is_one_slip(exchange) {
        return Vec::new();
    }
    let columns = name.replace('u', "rx").replace('v', "ry").replace('w', "rz");
    let (exchange, plain) = (*exchange, Matrix3::identity());
    vec![
        (format!("with {columns} in place of rx, ry, rz"), Box::new(move |_| [plain, exchange])),
        (
            format!("with dx, dy, dz along {name}, and {columns} in place of rx, ry, rz"),
            Box::new(move |_| [exchange, exchange]),
        ),
    ]
}

/// Most gauges of a file of which each may be reversed: more are no fixed gauges.
const MAX_GAUGES: usize = 48;

/// A gauge, or all along one direction.
#[derive(Clone, Copy, PartialEq)]
struct Gauge {
    direction: [f64; 3],
    point_m: Option<[f64; 3]>,
}

impl Gauge {
    /// Those of some readings: by direction, and by direction and point where there are several points.
    fn all(readings: &Readings) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for c in &readings.conditions {
            for point_m in [None, Some(c.point_m)] {
                let own = c.gauge.map(|direction| Self { direction, point_m });
                all.extend(own.filter(|own| !all.contains(own)));
            }
        }
        let points = |direction| all.iter().filter(|g| g.direction == direction && g.point_m.is_some()).count();
        let kept: Vec<Self> = all.iter().filter(|g| g.point_m.is_none() || points(g.direction) > 1).copied().collect();
        if kept.len() > MAX_GAUGES { Vec::new() } else { kept }
    }

    /// For people.
    fn name(&self) -> String {
        let [u, v, w] = self.direction;
        let axis = ["u", "v", "w"].into_iter().zip(self.direction).find(|(_, share)| share.abs() == 1.0);
        let along = match axis {
            Some((axis, share)) => format!("{}{axis}", if share < 0.0 { "−" } else { "" }),
            None => format!("({u:.2}, {v:.2}, {w:.2})"),
        };
        let at = self.point_m.map(|point_m| point_m.map(|v| 1e3 * v));
        at.map_or(format!("along {along}"), |[u, v, w]| format!("along {along} at ({u:.0}, {v:.0}, {w:.0}) mm"))
    }

    /// Each reversed.
    fn ways(readings: &Readings) -> Vec<Way<'_>> {
        let way = |gauge: Self| Way {
            how: format!("with the gauge {} reversed", gauge.name()),
            taken: Box::new(move || Some(gauge.reversed(readings))),
            is_as_predicted: true,
        };
        Self::all(readings).into_iter().map(way).collect()
    }

    /// The readings with it reversed.
    fn reversed(&self, readings: &Readings) -> Readings {
        let mut other = readings.clone();
        for r in &mut other.readings {
            let c = &readings.conditions[r.condition];
            if c.gauge == Some(self.direction) && self.point_m.is_none_or(|point_m| c.point_m == point_m) {
                r.observed[GAUGE] = r.observed[GAUGE].map(|v| -v);
            }
        }
        other
    }
}

/// All ways that are tried.
pub fn other_ways<'a>(readings: &'a Readings, tip_m: Vector3<f64>) -> Vec<Way<'a>> {
    // one gauge is plainer than an axis, which does the same where all are read by gauges
    let mut all = Gauge::ways(readings);
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
            for (how, turns) in of_columns(&name, &exchange) {
                turn(how, turns, None);
            }
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

/// Other units of the readings of one pose: where all are in these they are refused.
const UNITS_OF_ONE_POSE: [(&str, f64, f64); 11] = [
    ("with translations in mm", 1e3, 1.0),
    ("with translations in nm", 1e-3, 1.0),
    ("with rotations in mrad", 1.0, 1e3),
    ("with rotations in rad", 1.0, 1e6),
    ("with rotations in degrees", 1.0, 1e6 * PI / 180.0),
    ("with translations ten times as large", 10.0, 1.0),
    ("with translations a tenth as large", 0.1, 1.0),
    ("with rotations ten times as large", 1.0, 10.0),
    ("with rotations a tenth as large", 1.0, 0.1),
    ("with translations and rotations ten times as large", 10.0, 10.0),
    ("with translations and rotations a tenth as large", 0.1, 0.1),
];

/// Other loads at one pose.
const LOADS_OF_ONE_POSE: [(&str, f64); 4] = [
    ("as if no load had been put on", 0.0),
    ("with loads in kN and kN·m", 1e3),
    ("with loads ten times as large", 10.0),
    ("with loads a tenth as large", 0.1),
];

/// All ways that are tried for the readings of one pose, which may have been exchanged with those of others.
pub fn of_pose<'a>(own: &'a Readings, others: &[&'a NamedPose], tip_m: Vector3<f64>) -> Vec<Way<'a>> {
    let mut ways = other_ways(own, tip_m);
    let mut otherwise = |how: String, taken: Taken<'a>| {
        ways.push(Way { how, taken, is_as_predicted: false });
    };
    for (how, linear, angular) in UNITS_OF_ONE_POSE {
        otherwise(how.into(), Box::new(move || Some(in_units(own, linear, angular))));
    }
    for (how, factor) in LOADS_OF_ONE_POSE {
        otherwise(how.into(), Box::new(move || Some(under_loads(own, factor, factor))));
    }
    for other in others.iter().copied() {
        let at_other = move || {
            let mut taken = own.clone();
            taken.poses[0].pose = other.pose;
            Some(taken)
        };
        otherwise(format!("as those of {}", other.name()), Box::new(at_other));
    }
    ways
}

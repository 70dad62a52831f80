//! What to measure before anything was read: poses, loads that a person can apply, repeats and series, so that effects of a stated
//! size are found.

use nalgebra::Vector3;
use pkm_core::Pose;
use pkm_diagnosis::campaign::{Target, campaign};
use pkm_diagnosis::{Noise, Problem, Rules, Whitener};

use super::experiment::{Experiment, observations};
use super::model::{COUNT, Model, Recorded, info};
use super::{Method, design, text};
use crate::error::{Failure, Result};
use crate::files::csv::to_csv;
use crate::files::dataset::{DEFLECTION_COLUMNS, LOAD_POINT_COLUMNS, POSE_COLUMNS, WRENCH_COLUMNS, pose_cells};
use crate::files::machine::MachineFile;
use crate::files::readings::Readings;
use crate::files::source::Source;

/// Poses that a campaign begins with, where it may have so many: fewer leave little to compare models on.
const FIRST_POSES: usize = 8;

/// Share of the largest force that is read on the way up and on the way down: light loads tell what depends on the load, and the way
/// down what goes with its direction.
const LIGHT: f64 = 0.2;

/// What can be done at the machine.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// Largest force, N.
    pub force_n: f64,
    /// Distance from A at which a force is applied to make a moment, m; 0 for none.
    pub lever_m: f64,
    /// One standard deviation of a reading of translation, m, its zero included.
    pub sigma_m: f64,
    /// The same of rotation, rad; none where none is read.
    pub sigma_rad: Option<f64>,
    /// Readings of each load in a series.
    pub repeats: usize,
    /// Series at each pose, each with a zero reading of its own.
    pub series: usize,
    /// Most poses.
    pub poses: usize,
}

/// An amplitude that is to be found: effect, parameter, size in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// Of the effect.
    pub id: String,
    /// Of the parameter.
    pub parameter: String,
    /// That is to be found.
    pub value: f64,
}

impl std::str::FromStr for Stated {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let expected = || format!("expected effect.parameter=size in SI units, found `{text}`");
        let (name, value) = text.split_once('=').ok_or_else(expected)?;
        let (id, parameter) = name.split_once('.').ok_or_else(expected)?;
        let value = value.parse().ok().filter(|v: &f64| v.is_finite() && *v != 0.0).ok_or_else(expected)?;
        Ok(Self { id: id.into(), parameter: parameter.into(), value })
    }
}

/// What a campaign shows of an amplitude.
#[derive(Clone, Debug)]
pub struct Shown {
    /// That was to be found.
    pub stated: Stated,
    /// How many poses the campaign begins with.
    pub first_poses: usize,
    /// The smallest that is found with the first poses, with the campaign, and with every pose of the grid; none where no plausible
    /// one is.
    pub smallest: [Option<f64>; 3],
}

impl Shown {
    /// Whether the campaign finds what was to be found.
    pub fn is_found(&self) -> bool {
        self.smallest[1].is_some_and(|s| s.abs() <= self.stated.value.abs())
    }

    /// For people.
    pub fn text(&self) -> String {
        let size = |s: Option<f64>| s.map_or("none".into(), |s| text::amplitude(&self.stated.parameter, s, None));
        let [first, end, _] = self.smallest.map(size);
        let wanted = text::amplitude(&self.stated.parameter, self.stated.value, None);
        let first_poses = self.first_poses;
        let how = if self.is_found() { "found" } else { "NOT found" };
        format!("{}: {wanted} is {how}; smallest {first} with {first_poses} poses, {end} with all", self.stated.id)
    }
}

/// A campaign: the file to write the readings in, and what it shows.
pub struct Campaign {
    /// CSV with blank cells for the deflections.
    pub csv: String,
    /// Poses and readings.
    pub size: (usize, usize),
    /// By amplitude.
    pub shown: Vec<Shown>,
}

/// One load: where, force, and whether it is read on the way down.
struct Load {
    at_m: Vector3<f64>,
    force_n: Vector3<f64>,
    unload: bool,
}

/// Forces at A along each axis either way, up and down again, then forces at the lever's end, for moments about each axis.
fn loads(means: &Means) -> Vec<Load> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let mut all = Vec::new();
    for axis in axes {
        for force in [means.force_n, -means.force_n] {
            for (share, unload) in [(LIGHT, false), (1.0, false), (LIGHT, true)] {
                all.push(Load { at_m: Vector3::zeros(), force_n: axis * force * share, unload });
            }
        }
    }
    let [u, v, w] = axes;
    for (lever, across) in [(v, w), (u, w), (u, v)] {
        for force in [means.force_n, -means.force_n] {
            if means.lever_m > 0.0 {
                all.push(Load { at_m: lever * means.lever_m, force_n: across * force, unload: false });
            }
        }
    }
    all
}

/// Cells of a deflection: blank to be filled in, or any number to be planned with.
fn cells(means: &Means, value: &str) -> Vec<String> {
    let read = |n: usize| n < 3 || means.sigma_rad.is_some();
    (0..DEFLECTION_COLUMNS.len()).filter(|n| read(*n)).map(|_| value.to_owned()).collect()
}

/// The file of a campaign: at every pose each series goes through all loads.
fn file(means: &Means, poses: &[(String, Pose<f64>)], value: &str) -> (String, usize) {
    let sigma = [("sigma_linear_um", Some(means.sigma_m)), ("sigma_angular_urad", means.sigma_rad)];
    let mut header: Vec<String> =
        [&POSE_COLUMNS[..], &LOAD_POINT_COLUMNS, &WRENCH_COLUMNS].concat().iter().map(|c| (*c).to_owned()).collect();
    header.extend(DEFLECTION_COLUMNS.iter().take(cells(means, "").len()).map(|c| (*c).to_owned()));
    header.extend(["series", "repeat", "direction"].map(str::to_owned));
    header.extend(sigma.iter().filter(|s| s.1.is_some()).map(|s| s.0.to_owned()));
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (p, (id, pose)) in poses.iter().enumerate() {
        for series in 0..means.series {
            for load in loads(means) {
                for repeat in 0..means.repeats {
                    let mut row = vec![id.clone()];
                    row.extend(pose_cells(pose));
                    row.extend(load.at_m.iter().map(|m| crate::pose::tidy(m * 1e3).to_string()));
                    row.extend(load.force_n.iter().map(|n| crate::pose::tidy(*n).to_string()));
                    row.extend(["0", "0", "0"].map(str::to_owned));
                    row.extend(cells(means, value));
                    row.push((p * means.series + series + 1).to_string());
                    row.push((series * means.repeats + repeat + 1).to_string());
                    row.push(if load.unload { "unload" } else { "load" }.to_owned());
                    row.extend(sigma.iter().filter_map(|s| Some(crate::pose::tidy(s.1? * 1e6).to_string())));
                    rows.push(row);
                }
            }
        }
    }
    let count = rows.len();
    (to_csv(b',', &header, rows), count)
}

/// Every amplitude of an effect, at its plausible size.
fn plausible(model: &Model) -> Vec<Stated> {
    let candidates = (0..model.candidates.len()).filter_map(|c| Some((c, model.effect_of(c)?)));
    let of = |(candidate, effect): (usize, usize)| {
        let amplitudes = model.candidates[candidate].unknowns.iter().zip(info(effect).parameters);
        let amplitudes = amplitudes.filter(|(u, _)| model.parameters[u.0].is_amplitude());
        let stated = amplitudes.map(move |(u, parameter)| Stated {
            id: info(effect).id.to_owned(),
            parameter: parameter.name.to_owned(),
            value: model.parameters[u.0].prior.value(1.0),
        });
        stated.collect::<Vec<_>>()
    };
    candidates.flat_map(of).collect()
}

/// The amplitude that is meant.
fn target(model: &Model, stated: &Stated) -> Result<Target> {
    let fail = |message: String| Err(Failure::usage(format!("--detect {}.{}: {message}", stated.id, stated.parameter)));
    let Some(effect) = (0..COUNT).find(|e| info(*e).id == stated.id) else {
        let ids: Vec<&str> = (0..COUNT).map(|e| info(e).id).collect();
        return fail(format!("there is no effect of this name; there are {}", ids.join(", ")));
    };
    let Some(candidate) = (0..model.candidates.len()).find(|c| model.effect_of(*c) == Some(effect)) else {
        return fail("it shows with temperatures alone, which a campaign does not plan".into());
    };
    let unknowns = &model.candidates[candidate].unknowns;
    let mut named = info(effect).parameters.iter().zip(unknowns).filter(|(_, u)| model.parameters[u.0].is_amplitude());
    let Some((parameter, unknown)) = named.clone().find(|(p, _)| p.name == stated.parameter) else {
        let names: Vec<&str> = named.by_ref().map(|(p, _)| p.name).collect();
        return fail(format!("expected one of its amplitudes: {}", names.join(", ")));
    };
    if stated.value < 0.0 && !info(effect).signed {
        return fail(format!(
            "expected a size above 0, found {:e}: a machine has no less of it than none",
            stated.value
        ));
    }
    if stated.value.abs() >= parameter.refused_from {
        return fail(format!("expected less than {:e}, which no machine file may have", parameter.refused_from));
    }
    let x = (stated.value / model.parameters[unknown.0].prior.value(1.0)).abs();
    Ok(Target { candidate, unknown: *unknown, x })
}

/// Plans a campaign; without stated amplitudes every effect is to be found at its plausible size.
///
/// # Errors
/// An amplitude that there is not, a box out of reach.
pub fn plan(machine: &MachineFile, means: &Means, stated: &[Stated]) -> Result<Campaign> {
    let unreachable = || {
        let [[t0, t1], [s0, s1], [z0, z1]] = machine.pose_box.ranges();
        Failure::input(format!(
            "no pose of the box, θ {t0} to {t1}°, σ {s0} to {s1}°, Z0 {z0} to {z1} mm, is within travel: is it in degrees and mm, and of \
             {}?",
            machine.source.name
        ))
    };
    let model = Model::new(
        machine,
        Recorded { temperatures: false, unloading: true, force_n: means.force_n },
        Method::Formulas,
    );
    let model = model.ok_or_else(unreachable)?;
    let stated = if stated.is_empty() { plausible(&model) } else { stated.to_vec() };
    let targets: Vec<Target> = stated.iter().map(|s| target(&model, s)).collect::<Result<_>>()?;
    let grid: Vec<(String, Pose<f64>)> = design::grid(machine, 0.0).into_iter().map(|p| (String::new(), p)).collect();
    let (planned, _) = file(means, &grid, "0.000001");
    let readings = Readings::read(Source::from_text("the campaign", planned), machine)?;
    let rules = &Rules::DEFAULT;
    let read = observations(&readings, &model);
    let failed = || Failure::other("the declared machine gives no deflection at some pose of the box");
    let noise = Noise::as_declared(&read).map_err(|_| failed())?;
    let (whitener, experiment) = (Whitener::new(&read, &noise), Experiment::new(&model, &readings));
    let plain = Problem::new(&read, &whitener, &experiment, rules);
    // with the errors of the loads that are declared
    let whiteners = pkm_diagnosis::levels::whiteners(&plain);
    let problem = plain.with(whiteners.first().ok_or_else(failed)?);
    let first_poses = FIRST_POSES.min(means.poses);
    let found = campaign(&problem, &targets, first_poses, means.poses).ok_or_else(failed)?;
    let name = |(n, pose): (usize, &usize)| (format!("C{:02}", n + 1), readings.poses[*pose].pose);
    let poses: Vec<(String, Pose<f64>)> = found.poses.iter().enumerate().map(name).collect();
    let (csv, count) = file(means, &poses, "");
    let shown = (stated.into_iter().zip(&targets).zip(&found.smallest))
        .map(|((stated, target), smallest)| {
            let prior = model.parameters[target.unknown.0].prior;
            let size = |x: f64| (x <= rules.max_amplitude).then(|| prior.value(x));
            Shown { stated, first_poses, smallest: smallest.map(size) }
        })
        .collect();
    Ok(Campaign { csv, size: (poses.len(), count), shown })
}

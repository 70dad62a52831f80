//! What the search amounts to: lack of fit, verdict, structure of the residual, what cannot be seen.

use std::collections::BTreeMap;

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::model::{self, Unknown, info};
use super::noise::{Noise, NoiseSource, Whitener};
use super::search::{Candidate, Search};
use super::solve::{self, Fit, Levels, Problem};
use super::words;
use crate::files::machine::Uncertainty;
use crate::files::readings::{CHANNELS, Readings};

/// p at which a misfit counts as significant.
pub const P_MISFIT: f64 = 0.01;
/// Least share of the misfit that must be gone.
const LEAST_SHARE: f64 = 0.5;
/// Most effects that explain.
const MOST_EFFECTS: usize = 2;
/// Largest undeclared relative error of the loads beside which something counts as explained.
const LOAD_ERROR: f64 = 5e-4;
/// Pull beyond which a declared value is a finding, in standard deviations.
const LARGE_PULL: f64 = 3.0;
/// λ at which an amplitude is detected.
const DETECTABLE: f64 = 30.0;

/// A test of whether the misfit is more than noise.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LackOfFit {
    /// F by repeats, χ² over its freedoms with declared noise.
    pub statistic: f64,
    /// Probability of as much without misfit.
    pub p: f64,
    /// Where the noise is known from.
    pub noise_source: NoiseSource,
    /// Squared misfit beyond what noise may bring (its expectation and two standard deviations), in noise variances.
    #[serde(skip)]
    pub excess: f64,
}

/// Tests a fit.
pub fn lack_of_fit(problem: &Problem<'_>, noise: &Noise, fit: &Fit) -> LackOfFit {
    let n = problem.numbers() as f64;
    let (pure, freedom) = match noise.source {
        NoiseSource::Repeats => (problem.pure_error(), noise.freedom),
        NoiseSource::Declared => (0.0, 0.0),
    };
    let freedoms = (n - fit.used_freedoms() - freedom).max(1.0);
    let misfit = (problem.chi2(fit) - pure).max(0.0);
    let (statistic, p) = match noise.source {
        NoiseSource::Repeats => {
            // the noise that whitens is the repeats' own
            let f = misfit / freedoms;
            (f, FisherSnedecor::new(freedoms, freedom).map_or(f64::NAN, |d| d.sf(f)))
        }
        NoiseSource::Declared => (misfit / freedoms, ChiSquared::new(freedoms).map_or(f64::NAN, |d| d.sf(misfit))),
    };
    // the noise itself is known from so many freedoms only
    let unknown = if freedom > 0.0 { freedoms / freedom } else { 0.0 };
    let deviation = (2.0 * freedoms * (1.0 + unknown)).sqrt();
    LackOfFit { statistic, p, noise_source: noise.source, excess: (misfit - freedoms - 2.0 * deviation).max(0.0) }
}

/// The verdict of `formats.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Verdict {
    Adequate,
    Explained,
    PartlyExplained,
    Ambiguous,
    Unexplained,
}

/// What one repair mends: candidates of one kind are one class whatever is measured at the tool.
fn repair(candidate: &Candidate, problem: &Problem<'_>) -> String {
    match *candidate {
        Candidate::Effect(effect) => match info(effect).id {
            "universal-joint" | "revolute-joint" | "screw-position" => "joints and screws of limbs 1 and 2".into(),
            "limb-1-axial" | "limb-2-axial" => "joints and screws of limbs 1 and 2".into(),
            "spherical-joint" | "limb-3-axial" | "revolute-3-joint" => "joints and screw of limb 3".into(),
            "geometry-a1" | "geometry-b1" => "geometry of limbs 1 and 2".into(),
            "clearance" | "friction-hysteresis" if !problem.readings.has_unloading => "play or friction".into(),
            id => id.to_owned(),
        },
        Candidate::Class(class) => {
            if problem.model.classes[class].members.iter().all(|d| d.limb == 2) {
                "joints and screw of limb 3".into()
            } else {
                "joints and screws of limbs 1 and 2".into()
            }
        }
    }
}

/// Everything that the verdict rests on.
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Before anything was found.
    pub before: LackOfFit,
    /// With all that was found.
    pub after: LackOfFit,
    /// Share of the misfit that is gone.
    pub gone: f64,
}

/// Judges a search.
pub fn judge(levels: &Levels<'_>, noise: &Noise, search: &Search) -> Option<Judgement> {
    // by the noise and the load errors that were declared, and no others
    let problem = &levels.problems[0];
    let as_declared = |fit: &Fit| problem.linear(&fit.unknowns, fit.x.clone());
    let (base, end) = (as_declared(&search.base)?, as_declared(&search.fit)?);
    let before = lack_of_fit(problem, noise, &base);
    let after = lack_of_fit(problem, noise, &end);
    // what the search brought, against what was wrong to begin with
    let gained = (base.objective - end.objective).max(0.0);
    let gone = gained / (gained + after.excess).max(f64::MIN_POSITIVE);
    let effects = search.found.iter().filter(|f| matches!(f.candidate, Candidate::Effect(_))).count();
    let of_measurement = |c: &Candidate| matches!(c, Candidate::Effect(e) if model::is_measurement(*e));
    let measurement = search.found.iter().filter(|f| of_measurement(&f.candidate)).count();
    // a body aside couples a limb's yielding along and across it, and so does much that is on no list
    let aside = search.fit.unknowns.iter().any(|u| {
        matches!(*u, Unknown::Effect { effect, parameter } if info(effect).parameters[parameter].starts_with("aside"))
    });
    // nor may an effect lean on stiffnesses that are farther from the declared ones than these can be
    let leans = (search.fit.unknowns.iter().zip(search.fit.x.iter()))
        .any(|(u, x)| matches!(u, Unknown::Stiffness(_)) && x.abs() > LARGE_PULL);
    let ambiguous = aside
        || leans
        || search.found.iter().any(|f| {
            let own = repair(&f.candidate, problem);
            matches!(f.candidate, Candidate::Effect(_)) && f.class.iter().any(|c| repair(c, problem) != own)
        });
    let fits = after.p >= P_MISFIT;
    // what only errors of the loads that nobody declared could account for is not explained
    let loads_good = Levels::load_error(search.levels[1]) <= LOAD_ERROR;
    let verdict = match (effects, fits) {
        (0, true) => Verdict::Adequate,
        (0, false) => Verdict::Unexplained,
        // two errors of the measurement at once mimic much that is neither
        (n, true) if n <= MOST_EFFECTS && measurement < 2 && gone >= LEAST_SHARE && loads_good => {
            if ambiguous {
                Verdict::Ambiguous
            } else {
                Verdict::Explained
            }
        }
        _ => Verdict::PartlyExplained,
    };
    Some(Judgement { verdict, before, after, gone })
}

/// A declared value that is wrong.
#[derive(Clone, Debug, Serialize)]
pub struct DeclaredFinding {
    /// Key of the machine file, without the axis.
    pub parameter: String,
    /// Axis of a joint's stiffness, from 0; none for a modulus.
    pub axis: Option<usize>,
    /// What the data cannot tell from it.
    pub class: Vec<String>,
    /// As declared; moduli in GPa.
    pub declared: f64,
    /// As estimated.
    pub estimated: f64,
    /// ln of their ratio in units of the declared uncertainty.
    pub pull_sd: f64,
    /// Where to look on the machine.
    pub inspect: String,
}

/// Values that were declared wrong: classes that the search found, and pulls beyond three.
pub fn declared_findings(problem: &Problem<'_>, search: &Search) -> Vec<DeclaredFinding> {
    let model = problem.model;
    let state = model.state(&search.fit.unknowns, search.fit.x.as_slice(), false);
    let mut findings: Vec<DeclaredFinding> = Vec::new();
    let finding = |d: &model::Declared, class: Vec<String>| {
        let (declared, estimated) = (d.value(&model.declared), d.value(&state.machine));
        let pull_sd = (estimated / declared).ln() / model.uncertainty;
        let inspect = words::inspect_declared(d);
        DeclaredFinding { parameter: d.key(), axis: d.axis(), class, declared, estimated, pull_sd, inspect }
    };
    for f in &search.found {
        let Candidate::Class(class) = f.candidate else { continue };
        let mut names: Vec<String> = f.class.iter().chain([&f.candidate]).flat_map(|c| c.names(problem)).collect();
        names.sort();
        names.dedup();
        let members = &model.classes[class].members;
        for d in members {
            let own = finding(d, names.iter().filter(|n| **n != d.key()).cloned().collect());
            // one line a key: the axis that moved most
            match findings.iter_mut().find(|f| f.parameter == own.parameter) {
                Some(there) if there.pull_sd.abs() < own.pull_sd.abs() => *there = own,
                Some(_) => {}
                None => findings.push(own),
            }
        }
    }
    for (u, x) in search.fit.unknowns.iter().zip(search.fit.x.iter()) {
        let Unknown::Stiffness(d) = u else { continue };
        if x.abs() > LARGE_PULL && findings.iter().all(|f| f.parameter != d.key()) {
            // stiffnesses that look alike
            let alike = search.fit.alike(*u);
            let class = alike.iter().filter_map(|o| if let Unknown::Stiffness(d) = o { Some(d.key()) } else { None });
            let mut class: Vec<String> = class.filter(|k| *k != d.key()).collect();
            class.dedup();
            findings.push(finding(d, class));
        }
    }
    findings
}

/// What the data could show of an effect.
#[derive(Clone, Debug, Serialize)]
pub struct Detectable {
    /// The effect.
    pub id: String,
    /// Least amplitude of each parameter that would be found, alone; none when it could not be told from a re-tuned model.
    pub smallest: Vec<(String, Option<f64>)>,
    /// Why it is not looked for.
    pub why_not: Option<String>,
}

impl Detectable {
    /// Whether no plausible amplitude can be seen.
    pub fn is_hidden(&self) -> bool {
        self.smallest.iter().all(|(_, s)| s.is_none())
    }

    /// For people.
    pub fn text(&self) -> String {
        if let Some(why) = &self.why_not {
            return why.clone();
        }
        let shown = |(name, size): &(String, Option<f64>)| match size {
            Some(size) => words::amplitude(name, *size, None),
            None => format!("{name}: none that is plausible"),
        };
        self.smallest.iter().map(shown).collect::<Vec<_>>().join(", ")
    }
}

/// Smallest detectable amplitudes at the base fit.
pub fn detectable(problem: &Problem<'_>, search: &Search) -> Vec<Detectable> {
    (0..model::COUNT)
        .map(|effect| {
            let id = info(effect).id.to_owned();
            let Some(place) = search.candidates.iter().position(|c| *c == Candidate::Effect(effect)) else {
                let why = "needs the column temperature_c, with temperatures that differ".to_owned();
                return Detectable { id, smallest: Vec::new(), why_not: Some(why) };
            };
            let v = search.base.remaining(&search.columns[place].matrix);
            let amplitudes = Candidate::Effect(effect)
                .unknowns(problem)
                .into_iter()
                .filter(|u| problem.model.is_amplitude(u))
                .enumerate();
            let smallest = amplitudes
                .map(|(k, u)| {
                    let Unknown::Effect { parameter, .. } = u else { return (String::new(), None) };
                    let x = if v[(k, k)] > 0.0 { (DETECTABLE / v[(k, k)]).sqrt() } else { f64::INFINITY };
                    let size = (x <= super::search::LARGEST).then(|| problem.model.amplitude(effect, parameter, x));
                    (info(effect).parameters[parameter].to_owned(), size)
                })
                .collect();
            Detectable { id, smallest, why_not: None }
        })
        .collect()
}

/// A share of the misfit that goes with something.
#[derive(Clone, Debug, Serialize)]
pub struct Structure {
    /// What it goes with.
    pub factor: &'static str,
    /// Share of the misfit, 0…1.
    pub share: f64,
    /// Probability of as much by chance.
    pub p: f64,
}

/// What the end of a search leaves of every reading.
pub struct Residuals {
    /// By reading and channel, each in its own noise; 0 for a blank.
    pub by_reading: Vec<[f64; CHANNELS]>,
    /// Squared, beyond what noise brings.
    excess: f64,
}

impl Residuals {
    /// Of the model at the end of a search.
    pub fn new(problem: &Problem<'_>, noise: &Noise, uncertainty: &Uncertainty, search: &Search) -> Option<Self> {
        let readings = problem.readings;
        let by_reading = Whitener::by_reading(readings, noise);
        let plain = Problem::new(readings, &by_reading, problem.model);
        let whitener = solve::whiteners(&plain, uncertainty)?.swap_remove(search.levels[1]);
        let left = Problem::new(readings, &whitener, problem.model)
            .residuals(&search.fit.unknowns, search.fit.x.as_slice())?;
        let mut by_reading = vec![[0.0; CHANNELS]; readings.readings.len()];
        for (e, r) in whitener.entries.iter().zip(left.iter()) {
            by_reading[e.readings[0]][e.channel] = *r;
        }
        Some(Self { by_reading, excess: (left.norm_squared() - left.len() as f64).max(0.0) })
    }
}

/// Splits residuals by pose, load, sign, direction, temperature and order.
pub fn residual_structure(readings: &Readings, residuals: &Residuals) -> Vec<Structure> {
    let n = readings.readings.len();
    let largest = |i: usize| {
        let c = &readings.conditions[readings.readings[i].condition];
        let (f, m) = (c.wrench.force_n, c.wrench.moment_nm);
        let all = [f[0], f[1], f[2], m[0] * 5.0, m[1] * 5.0, m[2] * 5.0];
        (0..6).max_by(|a, b| all[*a].abs().total_cmp(&all[*b].abs())).map_or((0, 0.0), |k| (k, all[k]))
    };
    let temperatures: Vec<f64> = readings.conditions.iter().map(|c| c.temperature_c).collect();
    let (low, high) = temperatures.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(*t), h.max(*t)));
    // what turns round with the load is taken with its sign
    let signed = |i: usize| if largest(i).1 < 0.0 { -1.0 } else { 1.0 };
    let one = |_: usize| 1.0;
    type Level<'a> = Box<dyn Fn(usize) -> i64 + 'a>;
    let condition = |i: usize| &readings.conditions[readings.readings[i].condition];
    type Factor<'a> = (&'static str, Level<'a>, &'a dyn Fn(usize) -> f64);
    let factors: [Factor<'_>; 6] = [
        ("pose", Box::new(|i| condition(i).pose as i64), &signed),
        ("load", Box::new(|i| (4.0 * largest(i).1.abs().max(1e-9).log2()).round() as i64), &signed),
        ("sign", Box::new(|i| i64::from(largest(i).1 < 0.0)), &one),
        (
            "direction",
            Box::new(|i| {
                i64::from(condition(i).turned_at.force_n != [0.0; 3] || condition(i).turned_at.moment_nm != [0.0; 3])
            }),
            &signed,
        ),
        (
            "temperature",
            Box::new(
                move |i| if high > low { (5.0 * (condition(i).temperature_c - low) / (high - low)) as i64 } else { 0 },
            ),
            &signed,
        ),
        ("order", Box::new(move |i| (10 * i / n.max(1)) as i64), &one),
    ];
    let excess = residuals.excess;
    factors
        .iter()
        .map(|(factor, level, sign)| {
            let mut groups: BTreeMap<(i64, usize), ([f64; CHANNELS], f64)> = BTreeMap::new();
            for (i, r) in residuals.by_reading.iter().enumerate() {
                let group = groups.entry((level(i), largest(i).0)).or_insert(([0.0; CHANNELS], 0.0));
                group.1 += 1.0;
                for c in 0..CHANNELS {
                    group.0[c] += sign(i) * r[c];
                }
            }
            let between: f64 =
                groups.values().map(|(sums, count)| sums.iter().map(|s| s * s).sum::<f64>() / count).sum();
            let channels = readings.channels().iter().filter(|c| **c).count();
            let freedoms = (groups.len() * channels) as f64;
            let p = ChiSquared::new(freedoms).map_or(f64::NAN, |d| d.sf(between));
            let share = if excess > 0.0 { ((between - freedoms) / excess).clamp(0.0, 1.0) } else { 0.0 };
            Structure { factor, share, p }
        })
        .collect()
}

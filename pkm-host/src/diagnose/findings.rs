//! What a search found, in the machine's terms: declared values that are wrong, what cannot be seen, what residuals go with.

use pkm_diagnosis::residuals::{Factor, Residuals, Structure};
use pkm_diagnosis::verdict::smallest_detectable;
use pkm_diagnosis::{Levels, Observations, Problem, Search};
use rayon::prelude::*;
use serde::Serialize;

use super::declared::Declared;
use super::model::{self, Meaning, Model, info};
use super::text;
use crate::files::pose::ROTATION_ARM_M;
use crate::files::readings::Readings;

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
pub fn declared_findings(problem: &Problem<'_>, model: &Model, search: &Search) -> Vec<DeclaredFinding> {
    let state = model.state(&search.fit.unknowns, search.fit.x.as_slice(), false);
    let mut findings: Vec<DeclaredFinding> = Vec::new();
    let finding = |d: &Declared, class: Vec<String>| {
        let (declared, estimated) = (d.value(&model.declared), d.value(&state.machine));
        let pull_sd = (estimated / declared).ln() / d.uncertainty(&model.uncertainty);
        let inspect = text::inspect_declared(d, estimated / declared);
        DeclaredFinding { parameter: d.key(), axis: d.axis(), class, declared, estimated, pull_sd, inspect }
    };
    let signal = |d: &Declared, pull_sd: f64| {
        let own = search.fit.unknowns.iter().position(|u| model.meaning(*u) == Meaning::Stiffness(*d));
        own.map_or(0.0, |column| search.fit.jacobian.column(column).norm() * pull_sd.abs())
    };
    let mut seen: Vec<(f64, DeclaredFinding)> = Vec::new();
    for f in &search.found {
        let Some(class) = model.class_of(f.candidate) else { continue };
        let alike = f.class.iter().chain([&f.candidate]);
        let mut names: Vec<String> = alike.flat_map(|c| model.candidates[*c].names.clone()).collect();
        names.sort();
        names.dedup();
        for d in &class.members {
            let own = finding(d, names.iter().filter(|n| **n != d.key()).cloned().collect());
            let own = (signal(d, own.pull_sd), own);
            // one line a key: the axis whose deviation moves the readings most, as the others have it from their class
            match seen.iter_mut().find(|(_, there)| there.parameter == own.1.parameter) {
                Some(there) if there.0 < own.0 => *there = own,
                Some(_) => {}
                None => seen.push(own),
            }
        }
    }
    findings.extend(seen.into_iter().map(|(_, finding)| finding));
    for (u, x) in search.fit.unknowns.iter().zip(search.fit.x.iter()) {
        let Meaning::Stiffness(d) = model.meaning(*u) else { continue };
        if x.abs() > problem.rules.large_pull_sd && findings.iter().all(|f| f.parameter != d.key()) {
            // stiffnesses that look alike
            let alike = search.fit.alike(*u, problem.rules.alike_cosine);
            let key = |o| if let Meaning::Stiffness(d) = model.meaning(o) { Some(d.key()) } else { None };
            let class = alike.into_iter().filter_map(key);
            let mut class: Vec<String> = class.filter(|k| *k != d.key()).collect();
            class.dedup();
            findings.push(finding(&d, class));
        }
    }
    findings
}

/// What the data could show of an effect.
#[derive(Clone, Debug, Serialize)]
pub struct Detectable {
    /// The effect.
    pub id: String,
    /// Least amplitude of each parameter that would be found, alone; none when it cannot be told from re-identified stiffnesses.
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
            Some(size) => text::amplitude(name, *size, None),
            None => format!("{name}: none that is plausible"),
        };
        let sizes = self.smallest.iter().map(shown).collect::<Vec<_>>().join(", ");
        match text::ratio_alone(&self.id).filter(|_| !self.is_hidden()) {
            Some(ratio) => format!("{sizes} ({ratio})"),
            None => sizes,
        }
    }
}

/// Smallest detectable amplitudes at the base fit.
pub fn detectable(levels: &Levels<'_>, model: &Model, search: &Search) -> Vec<Detectable> {
    (0..model::COUNT)
        .into_par_iter()
        .map(|effect| {
            let id = info(effect).id.to_owned();
            let Some(candidate) = (0..model.candidates.len()).find(|c| model.effect_of(*c) == Some(effect)) else {
                let why = "needs the column temperature_c, with temperatures that differ".to_owned();
                return Detectable { id, smallest: Vec::new(), why_not: Some(why) };
            };
            let name = |unknown| match model.meaning(unknown) {
                Meaning::Effect { parameter, .. } => info(effect).parameters[parameter].name.to_owned(),
                Meaning::Stiffness(_) | Meaning::Class(_) | Meaning::Element(_) => String::new(),
            };
            let smallest = smallest_detectable(levels, search, candidate);
            let smallest = smallest.into_iter().map(|(unknown, size)| (name(unknown), size)).collect();
            Detectable { id, smallest, why_not: None }
        })
        .collect()
}

/// Splits residuals by pose, load, sign, direction, temperature and order.
pub fn residual_structure(readings: &Readings, observations: &Observations, residuals: &Residuals) -> Vec<Structure> {
    let n = readings.readings.len();
    let condition = |i: usize| &readings.conditions[readings.readings[i].condition];
    let largest = |i: usize| {
        let (f, m) = (condition(i).wrench.force_n, condition(i).wrench.moment_nm);
        let [mx, my, mz] = [0, 1, 2].map(|i| m[i] / ROTATION_ARM_M);
        let all = [f[0], f[1], f[2], mx, my, mz];
        (0..6).max_by(|a, b| all[*a].abs().total_cmp(&all[*b].abs())).map_or((0, 0.0), |k| (k, all[k]))
    };
    let temperatures: Vec<f64> = readings.conditions.iter().map(|c| c.temperature_c).collect();
    let (low, high) = temperatures.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(*t), h.max(*t)));
    let fifths = |t: f64| if high > low { (5.0 * (t - low) / (high - low)) as i64 } else { 0 };
    let unloading = |i: usize| condition(i).turned_at.to_vector().iter().any(|f| *f != 0.0);
    // what turns round with the load is taken with its sign
    let signed = |i: usize| if largest(i).1 < 0.0 { -1.0 } else { 1.0 };
    type Level<'a> = &'a dyn Fn(usize) -> i64;
    let levels: [(&'static str, Level<'_>, bool); 6] = [
        ("pose", &|i| condition(i).pose as i64, true),
        ("load", &|i| (4.0 * largest(i).1.abs().max(1e-9).log2()).round() as i64, true),
        ("sign", &|i| i64::from(largest(i).1 < 0.0), false),
        ("direction", &|i| i64::from(unloading(i)), true),
        ("temperature", &|i| fifths(condition(i).temperature_c), true),
        ("order", &|i| (10 * i / n.max(1)) as i64, false),
    ];
    let of = |(name, level, with_sign): (&'static str, Level<'_>, bool)| {
        let group = |i: usize| (level(i), largest(i).0);
        let sign = |i: usize| if with_sign { signed(i) } else { 1.0 };
        residuals.structure(observations, &Factor { name, group: &group, sign: &sign })
    };
    // what was not recorded has nothing to say
    let is_recorded = |name: &str| name != "temperature" || readings.has_temperature;
    levels.into_iter().filter(|l| is_recorded(l.0)).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gain of forces and moments alike is a factor of all stiffnesses, which no size of it tells.
    #[test]
    fn a_gain_that_readings_tell_as_a_ratio_says_so() {
        let of = |id: &str, sizes: [Option<f64>; 2]| {
            let smallest = ["forces", "moments"].into_iter().zip(sizes).map(|(n, s)| (n.to_owned(), s)).collect();
            Detectable { id: id.into(), smallest, why_not: None }.text()
        };
        let gain = of("load-gain", [Some(3.97e-3); 2]);
        assert!(gain.starts_with("forces 0.397 %, moments 0.397 % (of the ratio of forces to moments"), "{gain}");
        assert!(!of("load-gain", [None; 2]).contains("ratio"));
        assert!(!of("load-point", [Some(1e-3); 2]).contains("ratio"));
    }
}

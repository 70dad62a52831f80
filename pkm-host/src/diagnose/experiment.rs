//! Readings and model as the diagnosis engine takes them.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Vector3;
use pkm_core::{Pose, Wrench};
use pkm_diagnosis::{
    Candidate, Channel, CommonErrors, ForwardModel, Noise, Observations, Parameter, Reading, Rules, Unknown,
    UnknownNoise,
};

use super::model::Model;
use crate::files::readings::{CHANNELS, Condition, KINDS, Reading as Row, Readings};

/// Readings as scalar observations: lengths are channels of kind 0, rotations of kind 1. With each reading comes the error that
/// the load cell draws for it, as the declared machine answers it.
pub fn observations(readings: &Readings, model: &Model) -> Observations {
    let share = |r: &Row| r.load_random.unwrap_or(model.uncertainty.load_random);
    let of_load = || {
        // what grows with the load alone
        let cold: Vec<Condition> = readings.conditions.iter().map(|c| Condition { rise_k: 0.0, ..*c }).collect();
        model.predict(&poses(readings), &cold, &[], &[])
    };
    let of_load = readings.readings.iter().any(|r| share(r) > 0.0).then(of_load).flatten();
    let drawn = |r: &Row| {
        let said = of_load.as_ref().filter(|_| share(r) > 0.0).map(|said| said[r.condition]);
        said.map_or(Vec::new(), |said| said.iter().map(|d| share(r) * d).collect())
    };
    Observations {
        channels: (0..CHANNELS).map(|c| Channel { kind: KINDS[c], resolution: readings.resolution[c] }).collect(),
        pose_of: readings.conditions.iter().map(|c| c.pose).collect(),
        readings: (readings.readings.iter())
            .map(|r| Reading {
                condition: r.condition,
                repeat_of: r.repeat_of,
                series: r.series,
                observed: r.observed.to_vec(),
                sigma: r.sigma.to_vec(),
                covariance: r.covariance.clone(),
                drawn: drawn(r),
            })
            .collect(),
    }
}

/// Poses of readings.
pub fn poses(readings: &Readings) -> Vec<Pose<f64>> {
    readings.poses.iter().map(|p| p.pose).collect()
}

/// A model under some conditions.
pub struct Experiment<'a> {
    /// What predicts.
    pub model: &'a Model,
    /// Commanded poses.
    pub poses: Vec<Pose<f64>>,
    /// What predictions depend on.
    pub conditions: &'a [Condition],
}

impl<'a> Experiment<'a> {
    /// Under the conditions of some readings.
    pub fn new(model: &'a Model, readings: &'a Readings) -> Self {
        Self { model, poses: poses(readings), conditions: &readings.conditions }
    }

    /// Noise of readings, by repeats, what they leave open of the zeros by opposite or unlike loads, or as declared.
    ///
    /// # Errors
    /// Neither enough repeats nor declared deviations.
    pub fn noise(&self, read: &Observations, rules: &Rules) -> Result<Noise, UnknownNoise> {
        let nominal = self.at_nominal_loads(read);
        Ok(Noise::estimate(&nominal, rules)?.with_zeros(&nominal, &self.proportional(&nominal), rules))
    }

    /// For each reading what it shares its pose and instrument's place with, and its load, that of the first of its repeats.
    fn proportional(&self, nominal: &Observations) -> Vec<(usize, Vec<f64>)> {
        let mut first: HashMap<usize, usize> = HashMap::new();
        let mut groups: Vec<(usize, [f64; 3], Option<[f64; 3]>)> = Vec::new();
        let mut of = |r: &Reading| {
            let c = &self.conditions[*first.entry(r.repeat_of).or_insert(r.condition)];
            let key = (c.pose, c.point_m, c.gauge);
            let group = groups.iter().position(|g| *g == key).unwrap_or_else(|| {
                groups.push(key);
                groups.len() - 1
            });
            (group, c.wrench.to_vector().as_slice().to_vec())
        };
        nominal.readings.iter().map(&mut of).collect()
    }

    /// Readings as they would be if all repeats had the load of the first, by the declared machine: what repeats still differ
    /// by is noise. The same where it has no prediction.
    fn at_nominal_loads(&self, read: &Observations) -> Observations {
        let mut nominal = read.clone();
        let Some(said) = self.model.predict(&self.poses, self.conditions, &[], &[]) else { return nominal };
        let mut first: HashMap<usize, usize> = HashMap::new();
        for r in &mut nominal.readings {
            let there = *first.entry(r.repeat_of).or_insert(r.condition);
            for (c, value) in r.observed.iter_mut().enumerate() {
                *value = value.map(|v| v - (said[r.condition][c] - said[there][c]));
            }
        }
        nominal
    }
}

/// Which way along its line a load acts.
fn way(c: &Condition) -> f64 {
    c.wrench.to_vector().iter().find(|v| **v != 0.0).map_or(1.0, |v| v.signum())
}

/// The line of a load, whichever way along it and however large, and its pose.
fn line(c: &Condition) -> (usize, Vec<i64>) {
    let all = c.wrench.to_vector();
    let size = all.iter().map(|v| v * v).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    (c.pose, all.iter().map(|v| (1e3 * way(c) * v / size).round() as i64).collect())
}

/// Unit turn of a vector about an axis.
fn turned(v: Vector3<f64>, axis: usize) -> Vector3<f64> {
    Vector3::ith(axis, 1.0).cross(&v)
}

impl ForwardModel for Experiment<'_> {
    fn parameters(&self) -> &[Parameter] {
        &self.model.parameters
    }

    fn candidates(&self) -> &[Candidate] {
        &self.model.candidates
    }

    fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<Vec<f64>> {
        Some(self.model.predict(&self.poses, self.conditions, unknowns, x)?.into_flattened())
    }

    fn is_possible(&self, unknowns: &[Unknown], x: &[f64]) -> bool {
        self.model.is_possible(unknowns, x)
    }

    /// Errors of the loads: for every pose and line of load, three turns of its direction by 1 rad and a gain by 1. What is
    /// declared goes with the line. Of what nobody declares, half of the variance is another error for each way along the
    /// line, as a load that is put on from the other side is aimed anew: without it the difference passes for a law of the
    /// load.
    fn common_errors(&self) -> Option<CommonErrors> {
        let lines: Option<Vec<Vec<f64>>> = (0..4)
            .map(|kind| {
                let changed = |v: Vector3<f64>| if kind < 3 { turned(v, kind) } else { v };
                let conditions: Vec<Condition> = (self.conditions.iter())
                    .map(|c| {
                        let wrench =
                            Wrench { force_n: changed(c.wrench.force_n), moment_nm: changed(c.wrench.moment_nm) };
                        Condition { wrench, rise_k: 0.0, ..*c }
                    })
                    .collect();
                Some(self.model.predict(&self.poses, &conditions, &[], &[])?.into_flattened())
            })
            .collect();
        let uncertainty = &self.model.uncertainty;
        let (turn, gain) = (uncertainty.load_direction_rad, uncertainty.load_gain);
        let mut groups: BTreeMap<(usize, Vec<i64>), usize> = self.conditions.iter().map(|c| (line(c), 0)).collect();
        groups.values_mut().enumerate().for_each(|(n, group)| *group = n);
        let group_of = self.conditions.iter().map(|c| groups[&line(c)]).collect();
        let mut columns = lines?;
        for side in [1.0, -1.0] {
            let there = |n: usize| f64::from(way(&self.conditions[n / CHANNELS]) == side);
            columns.extend_from_within(..4);
            let last = columns.len() - 4;
            columns[last..].iter_mut().for_each(|c| c.iter_mut().enumerate().for_each(|(n, v)| *v *= there(n)));
        }
        let sd = [[turn, turn, turn, gain], [0.0; 4], [0.0; 4]].concat();
        let undeclared = vec![0.5_f64.sqrt(); 12];
        Some(CommonErrors { columns, sd, undeclared, group_of })
    }
}

//! Poses whose readings were taken otherwise than those of all others: in other units, with another sign, at another pose.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, Vector3};
use pkm_core::Pose;
use pkm_diagnosis::robust::median;
use pkm_diagnosis::{Noise, Problem, Rules, Whitener};
use rayon::prelude::*;

use super::experiment::{self, Experiment};
use super::model::Model;
use super::reading_rules::{MAX_MISTYPED_POSES, MAX_SHARE_OF_KNOWN_WAY, MIN_READINGS_OF_REPEAT, MIN_SUSPECT_RATIO};
use super::warning::{Warning, WarningKind};
use super::ways;
use crate::files::readings::{CHANNELS, Reading, Readings};

/// Poses, or one repeat of poses, that fit the others when their readings are taken otherwise.
pub struct TakenOtherwise {
    /// Their readings.
    rows: Vec<usize>,
    /// Which poses, for people.
    names: Vec<String>,
    /// As `… fit the others …`.
    pub how: String,
    /// What the declared machine leaves of them, in variances of their noise: as the file says, taken otherwise, and at other poses.
    left: [f64; 3],
}

impl TakenOtherwise {
    /// Its readings.
    pub fn rows<'a>(&'a self, readings: &'a Readings) -> impl Iterator<Item = (usize, &'a Reading)> {
        self.rows.iter().map(|n| (*n, &readings.readings[*n]))
    }

    /// Adds a pose; what is left is the most.
    fn add(&mut self, readings: &Readings, pose: usize, said: f64, rest: f64) {
        let is_own = |n: &usize| readings.conditions[readings.readings[*n].condition].pose == pose;
        self.rows.extend((0..readings.readings.len()).filter(is_own));
        self.names.push(readings.poses[pose].name());
        (self.left[0], self.left[1]) = (self.left[0].max(said), self.left[1].max(rest));
    }

    /// As a diagnosis has it.
    pub fn warning(&self, readings: &Readings) -> Warning {
        let lines = self.rows(readings).map(|(_, r)| r.line).collect();
        Warning { lines, ..Warning::new(WarningKind::PoseTakenOtherwise, self.text()) }
    }

    /// For people.
    pub fn text(&self) -> String {
        let [said, rest, usual] = self.left.map(f64::sqrt);
        format!(
            "the readings at {} fit the declared machine much better {} (residuals of {rest:.1} times their noise) than as the file says \
             ({said:.1} times, at other poses {usual:.1} times): are they?",
            self.names.join(", "),
            self.how
        )
    }
}

/// The linear form of a pose's readings at the declared values.
struct Linear {
    jacobian: DMatrix<f64>,
    residuals: DVector<f64>,
    /// JᵀJ and Jᵀr.
    information: DMatrix<f64>,
    along: DVector<f64>,
}

impl Linear {
    fn new(readings: &Readings, model: &Model, noise: &Noise, rules: &Rules) -> Option<Self> {
        let read = experiment::observations(readings, model);
        let (experiment, whitener) = (Experiment::new(model, readings), Whitener::new(&read, noise));
        let problem = Problem::new(&read, &whitener, &experiment, rules);
        let stiffnesses = problem.model.declared();
        let declared = vec![0.0; stiffnesses.len()];
        let fit = problem.linear(&stiffnesses, declared.into())?;
        let (information, along) = (fit.jacobian.tr_mul(&fit.jacobian), fit.jacobian.tr_mul(&fit.residuals));
        (!fit.residuals.is_empty()).then_some(Self {
            jacobian: fit.jacobian,
            residuals: fit.residuals,
            information,
            along,
        })
    }

    /// What stiffnesses that have moved leave, in noise variances a number.
    fn left(&self, step: &DVector<f64>) -> f64 {
        (&self.residuals - &self.jacobian * step).norm_squared() / self.residuals.len() as f64
    }
}

/// Readings by pose, against the declared machine.
struct ByPose<'a> {
    readings: &'a Readings,
    model: &'a Model,
    noise: Noise,
    rules: &'a Rules,
    /// Pose and linear form, of those that have any reading.
    all: Vec<(usize, Linear)>,
}

impl<'a> ByPose<'a> {
    /// Of poses that have `least` readings, with the noise of the same readings or of some of them.
    fn new(
        readings: &'a Readings,
        noise_of: &Readings,
        model: &'a Model,
        rules: &'a Rules,
        least: usize,
    ) -> Option<Self> {
        let noise = Experiment::new(model, noise_of).noise(&experiment::observations(noise_of, model), rules).ok()?;
        let linear = |pose| {
            let own = readings.at_pose(pose);
            (own.readings.len() >= least).then(|| Linear::new(&own, model, &noise, rules)).flatten().map(|l| (pose, l))
        };
        let all = (0..readings.poses.len()).into_par_iter().filter_map(linear).collect();
        Some(Self { readings, model, noise, rules, all })
    }

    /// JᵀJ and Jᵀr of all poses but those that are out, and of the stiffnesses' prior.
    fn sums(&self, out: &[usize]) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let unknowns = self.all.first()?.1.along.len();
        let (mut information, mut along) = (DMatrix::identity(unknowns, unknowns), DVector::zeros(unknowns));
        for (_, linear) in self.all.iter().filter(|(pose, _)| !out.contains(pose)) {
            information += &linear.information;
            along += &linear.along;
        }
        Some((information, along))
    }

    /// How far some poses move the stiffnesses, as their uncertainty lets them.
    fn step(&self, information: DMatrix<f64>, along: &DVector<f64>) -> Option<DVector<f64>> {
        let step = information.cholesky()?.solve(along);
        let share = self.model.share_of_step(&step);
        Some(step * share)
    }

    /// Poses of which more is left than is usual by a factor, with what is left, and what is usual: each by stiffnesses of the others,
    /// but for those that are out.
    fn beyond(&self, ratio: f64, out: &[usize]) -> Option<(Vec<(usize, f64)>, f64)> {
        let (information, along) = self.sums(out)?;
        let left = |(pose, linear): &(usize, Linear)| {
            let of_others = if out.contains(pose) {
                self.step(information.clone(), &along)?
            } else {
                self.step(&information - &linear.information, &(&along - &linear.along))?
            };
            Some((*pose, linear.left(&of_others)))
        };
        let mut left: Vec<(usize, f64)> = self.all.iter().filter_map(left).collect();
        let usual = median(&mut left.iter().map(|(_, left)| *left).collect::<Vec<f64>>())?;
        left.retain(|(_, left)| *left > ratio * usual);
        Some((left, usual))
    }

    /// Those that fit the others when they are taken otherwise.
    fn taken_otherwise(&self, tip_m: Vector3<f64>) -> Option<Vec<TakenOtherwise>> {
        // those that stand out have no part in what is usual
        let ratio = self.rules.min_pose_ratio;
        let out: Vec<usize> = self.beyond(ratio, &[])?.0.into_iter().map(|(pose, _)| pose).collect();
        let (found, usual) = self.beyond(ratio, &out)?;
        let poses: Vec<usize> = found.iter().map(|(pose, _)| *pose).collect();
        let (information, along) = self.sums(&poses)?;
        let of_others = self.step(information, &along)?;
        let mut all: Vec<TakenOtherwise> = Vec::new();
        for (pose, said) in found {
            let Some((how, rest)) = self.as_others(pose, &poses, &of_others, [said, usual], tip_m) else { continue };
            let known = all.iter().position(|other| other.how == how).unwrap_or_else(|| {
                all.push(TakenOtherwise { rows: Vec::new(), names: Vec::new(), how, left: [said, rest, usual] });
                all.len() - 1
            });
            all[known].add(self.readings, pose, said, rest);
        }
        Some(all)
    }

    /// The way to take the readings of a pose that fits stiffnesses of others, and what it leaves.
    fn as_others(
        &self,
        pose: usize,
        beyond: &[usize],
        of_others: &DVector<f64>,
        [said, usual]: [f64; 2],
        tip_m: Vector3<f64>,
    ) -> Option<(String, f64)> {
        let own = self.readings.at_pose(pose);
        let others: Vec<_> = beyond.iter().filter(|p| **p != pose).map(|p| &self.readings.poses[*p]).collect();
        let left = |taken: &Readings| Some(Linear::new(taken, self.model, &self.noise, self.rules)?.left(of_others));
        let most = self.rules.max_pose_share * (said * usual).sqrt();
        // no way leaves less than noise: readings in mm seem to be of no load
        let from_usual = |rest: f64| (rest.max(f64::MIN_POSITIVE) / usual).ln().abs();
        let known = (ways::of_pose(&own, &others, tip_m).into_iter())
            .filter_map(|way| Some((way.how, left(&(way.taken)()?)?)))
            .min_by(|a, b| from_usual(a.1).total_cmp(&from_usual(b.1)));
        let is_better = |rest: f64| known.as_ref().is_none_or(|known| rest < MAX_SHARE_OF_KNOWN_WAY * known.1);
        let are_few = beyond.len() <= MAX_MISTYPED_POSES;
        let may_be_mistyped = are_few && !own.has_lengths && own.readings.len() >= MIN_READINGS_OF_REPEAT;
        let mistyped = may_be_mistyped.then(|| mistyped(&own, left)).flatten();
        mistyped.filter(|(_, rest)| is_better(*rest)).or(known).filter(|(_, rest)| *rest < most)
    }
}

/// A coordinate of a pose, as a file has it: name, unit, how far from it another is looked for, and what moves it.
type Coordinate = (&'static str, &'static str, f64, fn(&mut Pose<f64>) -> (&mut f64, f64));

const COORDINATES: [Coordinate; 3] = [
    ("theta", "deg", 20.0, |pose| (&mut pose.theta_rad, 180.0 / PI)),
    ("sigma", "deg", 20.0, |pose| (&mut pose.sigma_rad, 180.0 / PI)),
    ("z0", "mm", 150.0, |pose| (&mut pose.z0_m, 1e3)),
];

/// The one number of a pose with another value, by which its readings fit best, and what they leave then.
fn mistyped(own: &Readings, left: impl Fn(&Readings) -> Option<f64> + Sync) -> Option<(String, f64)> {
    let best = |(name, unit, range, of): Coordinate| {
        let at = |moved: f64| {
            let mut taken = own.clone();
            let (value, per_unit) = of(&mut taken.poses[0].pose);
            *value += moved / per_unit;
            let value = *value * per_unit;
            Some((value, left(&taken)?))
        };
        let (said, _) = at(0.0)?;
        let (mut middle, mut half) = (0.0, range);
        let mut best = None;
        // each round between the neighbours of the best of nine
        for _ in 0..5 {
            let tried = (-4..=4).map(|k| middle + 0.25 * half * f64::from(k));
            let (moved, found) =
                tried.filter_map(|moved| Some((moved, at(moved)?))).min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
            (middle, half, best) = (moved, 0.25 * half, Some(found));
        }
        let (value, rest) = best?;
        Some((format!("with {name} at {value:.1} {unit}, not {said:.1}"), rest))
    };
    COORDINATES.into_par_iter().filter_map(best).min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Single poses that the declared machine fits much worse than the others, and as well when they are taken otherwise; where there are
/// none, single repeats of poses.
pub fn taken_otherwise(readings: &Readings, model: &Model, rules: &Rules, tip_m: Vector3<f64>) -> Vec<TakenOtherwise> {
    let by_pose = ByPose::new(readings, readings, model, rules, 1);
    let whole = by_pose.and_then(|by_pose| by_pose.taken_otherwise(tip_m)).unwrap_or_default();
    if whole.is_empty() { of_repeats(readings, model, rules, tip_m).unwrap_or_default() } else { whole }
}

/// The same of single repeats of poses. These make the noise that they are held against: those that may be wrong have no part in it.
fn of_repeats(readings: &Readings, model: &Model, rules: &Rules, tip_m: Vector3<f64>) -> Option<Vec<TakenOtherwise>> {
    let parts = readings.by_repeat()?;
    let least = MIN_READINGS_OF_REPEAT;
    let suspects = ByPose::new(&parts, &parts, model, rules, least)?.beyond(MIN_SUSPECT_RATIO, &[])?.0;
    if suspects.is_empty() {
        return None;
    }
    let is_suspect = |r: &Reading| suspects.iter().any(|(pose, _)| parts.conditions[r.condition].pose == *pose);
    let numbers: Vec<(usize, usize)> = (parts.readings.iter().enumerate())
        .filter(|(_, r)| is_suspect(r))
        .flat_map(|(n, _)| (0..CHANNELS).map(move |c| (n, c)))
        .collect();
    let rest = parts.without_numbers(&numbers);
    let mut found = ByPose::new(&parts, &rest, model, rules, least)?.taken_otherwise(tip_m)?;
    found.iter_mut().flat_map(|part| &mut part.names).for_each(|name| name.push_str(", one repeat of it,"));
    Some(found)
}

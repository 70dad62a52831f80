//! All runs: each is diagnosed alone and predicts the others, and the tension test judges the findings.

use nalgebra::{DVector, Vector4};
use pkm_diagnosis::places::Finding;
use pkm_diagnosis::robust::median;
use pkm_diagnosis::{Channel, Noise, NoiseSource, Observations, Reading, validation};

use crate::diagnosis::{Diagnosis, DiagnosisError, Identified, RULES, diagnose};
use crate::files::{Published, READINGS_PER_POINT, ReadError, Run, Tension, TensionPair};
use crate::machine::{Anchors, COORDINATES, Machine};
use crate::model::{CONDITIONS, Model, NoPlace, closure_errors_m};
use crate::recursive::{Step, one_by_one};

/// Least probability of a place that is named; below it the places are rivals.
pub const NAMED_PROBABILITY: f64 = 0.9;
/// Half of a 95 % interval, in standard deviations.
const HALF_INTERVAL_SD: f64 = 1.96;

/// Conditions of the readings of a point.
const PER_POINT: usize = READINGS_PER_POINT * CONDITIONS;

/// How well a machine that was identified in one run predicts others.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Root mean square over the two conditions of the readings, by run; m.
    pub by_run_m: Vec<f64>,
    /// The same by point, m.
    pub by_point_m: Vec<f64>,
    /// Over all these runs, m.
    pub rms_m: f64,
    /// 95 % interval of that over places of the sled, m.
    pub interval_m: Option<[f64; 2]>,
}

/// One run.
pub struct RunResult {
    /// What its readings say.
    pub diagnosis: Diagnosis,
    /// The other runs by anchors alone.
    pub before: Prediction,
    /// The other runs with the identified model.
    pub after: Prediction,
}

/// How much longer the lower belts bl and br come out when slack, for one pair of the tension test; m.
#[derive(Clone, Copy, Debug)]
pub struct Slack {
    /// Whether the pull changed between the two readings; else they are a control.
    pub is_test: bool,
    /// As read: first less second.
    pub read_m: [f64; 2],
    /// The same of the upper belts tr and tl.
    pub upper_read_m: [f64; 2],
    /// Predicted if friction holds the sled where it is.
    pub held_m: [f64; 2],
    /// Predicted if the sled follows the upper belts as they get shorter.
    pub free_m: [f64; 2],
    /// 95 % interval of a difference of two readings: from the sled held to the sled free, with the errors of the identified
    /// values and of both visits.
    pub interval_m: [[f64; 2]; 2],
}

/// Everything that follows from the files.
pub struct Study {
    /// Each run by itself.
    pub runs: Vec<RunResult>,
    /// All runs taken for one, with the anchors in common.
    pub together: Diagnosis,
    /// The tension test, as all runs together predict it.
    pub tension: Vec<Slack>,
    /// The runs one by one.
    pub steps: Vec<Step>,
}

impl Study {
    /// Diagnoses all runs.
    ///
    /// # Errors
    /// A run that cannot be diagnosed, with file and line.
    pub fn new(published: &Published) -> Result<Self, ReadError> {
        let runs = &published.runs;
        let result = |(own, run): (usize, &Run)| {
            let diagnosis = diagnose(run)?;
            let others: Vec<&Run> = runs.iter().enumerate().filter(|(n, _)| *n != own).map(|r| r.1).collect();
            let before = predict(&diagnosis.before.machine, &others)?;
            let after = predict(&diagnosis.after.machine, &others)?;
            Ok(RunResult { diagnosis, before, after })
        };
        let results = runs.iter().enumerate().map(result).collect::<Result<Vec<_>, DiagnosisError>>();
        let in_runs = |e: DiagnosisError| e.at(&published.runs_path);
        let results = results.map_err(in_runs)?;
        let mean = |i: usize| runs.iter().map(|r| r.tool.coordinates_m[i]).sum::<f64>() / runs.len() as f64;
        let pooled = Run {
            points: runs.iter().flat_map(|r| r.points.iter().copied()).collect(),
            tool: Anchors { coordinates_m: std::array::from_fn(mean) },
        };
        let together = diagnose(&pooled).map_err(in_runs)?;
        let tension = published.tension.iter().map(|pair| slack(&together, pair)).collect::<Result<_, _>>();
        let tension = tension.map_err(|e: NoPlace| DiagnosisError::from(e).at(&published.tension_path))?;
        let steps = one_by_one(published).map_err(in_runs)?;
        Ok(Self { runs: results, together, tension, steps })
    }

    /// Median over all predictions of a run by another, before and after; m.
    pub fn median_rms_m(&self) -> [f64; 2] {
        let of: [fn(&RunResult) -> &Prediction; 2] = [|r| &r.before, |r| &r.after];
        of.map(|of| {
            let mut all: Vec<f64> = self.runs.iter().flat_map(|r| of(r).by_run_m.clone()).collect();
            median(&mut all).unwrap_or(f64::NAN)
        })
    }

    /// Greatest less least value over the runs of an anchor coordinate: of the maker's tool, of anchors alone, with what was
    /// found; m.
    pub fn scatter_m(&self, coordinate: usize) -> [f64; 3] {
        let range = |of: &dyn Fn(&Diagnosis) -> Anchors| {
            let values = self.runs.iter().map(|r| of(&r.diagnosis).coordinates_m[coordinate]);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            high - low
        };
        [range(&|d| d.model.anchors()), range(&|d| d.before.machine.anchors), range(&|d| d.after.machine.anchors)]
    }
}

/// The place that a finding names, if it is likely enough.
pub fn named(finding: &Finding) -> Option<&str> {
    let likeliest = finding.rivals.first().filter(|r| r.probability >= NAMED_PROBABILITY)?;
    likeliest.places.first().map(String::as_str)
}

/// Errors of a machine on runs that had no part in it.
pub(crate) fn predict(machine: &Machine, runs: &[&Run]) -> Result<Prediction, NoPlace> {
    let points = runs.first().map_or(0, |r| r.points.len());
    let (mut by_run_m, mut by_point) = (Vec::new(), vec![0.0; points]);
    let mut observations = Observations {
        channels: vec![Channel { kind: 0, resolution: 0.0 }; CONDITIONS],
        pose_of: (0..points).collect(),
        readings: Vec::new(),
    };
    for run in runs {
        let mut squares = 0.0;
        for (point, readings) in run.points.iter().enumerate() {
            for r in readings {
                let errors = closure_errors_m(machine, &r.at_m).ok_or(NoPlace { line: r.line })?;
                squares += errors.norm_squared();
                by_point[point] += errors.norm_squared();
                let observed = errors.iter().copied().map(Some).collect();
                let sigma = vec![None];
                observations.readings.push(Reading {
                    condition: point,
                    repeat_of: point,
                    series: 0,
                    observed,
                    sigma,
                    covariance: None,
                    drawn: Vec::new(),
                });
            }
        }
        by_run_m.push((squares / (points * PER_POINT) as f64).sqrt());
    }
    let unit = vec![1.0; CONDITIONS];
    let noise = Noise {
        source: NoiseSource::Declared,
        within: unit.clone(),
        unrounded: unit,
        between: vec![0.0; CONDITIONS],
        dof: 0.0,
        declared_share: [1.0; 2],
        is_zero_open: vec![false; CONDITIONS],
    };
    let zeros = vec![0.0; CONDITIONS * observations.pose_of.len()];
    // of the length of both conditions' error; a condition has half of its square
    let errors = validation::errors(&observations, &noise, &zeros, |_| true, &RULES);
    let half = |v: f64| v / (CONDITIONS as f64).sqrt();
    let (rms, interval) = errors.map_or((f64::NAN, None), |e| (e.kinds[0].rms, e.kinds[0].rms_interval));
    let by_point_m = by_point.iter().map(|s| (s / (runs.len() * PER_POINT) as f64).sqrt()).collect();
    Ok(Prediction { by_run_m, by_point_m, rms_m: half(rms), interval_m: interval.map(|i| i.map(half)) })
}

/// How much longer bl and br come out at the place of a reading when the pull is gone, m.
fn slack_m(machine: &Machine, lengths_m: &Vector4<f64>, held: bool) -> Option<[f64; 2]> {
    let start = machine.anchors.below_upper_belts(lengths_m)?;
    let pulled = machine.anchors.sled(machine.place_m(lengths_m, &Vector4::repeat(1.0), start)?);
    let (read, slack) = (machine.read_m(&pulled), machine.slack());
    // the upper belts are locked, so that their lengths as read stay
    let upper_alone = Vector4::new(0.0, 0.0, 1.0, 1.0);
    let place = if held { pulled.place_m } else { slack.place_m(&read, &upper_alone, pulled.place_m)? };
    let longer = slack.read_m(&slack.anchors.sled(place)) - read;
    Some([longer.x, longer.y])
}

/// Variances of what follows from identified values, by central differences.
fn variances<const N: usize>(
    model: &Model,
    identified: &Identified,
    of: impl Fn(&Machine) -> Option<[f64; N]>,
) -> Option<[f64; N]> {
    const STEP: f64 = 1e-3;
    let x = &identified.x;
    let mut slopes = vec![DVector::zeros(x.len()); N];
    for i in 0..x.len() {
        let at = |step: f64| {
            let mut x = x.clone();
            x[i] += step;
            of(&model.machine(&identified.unknowns, &x))
        };
        let (high, low) = (at(STEP)?, at(-STEP)?);
        slopes.iter_mut().enumerate().for_each(|(k, s)| s[i] = (high[k] - low[k]) / (2.0 * STEP));
    }
    Some(std::array::from_fn(|k| slopes[k].dot(&(&identified.covariance * &slopes[k]))))
}

/// A pair of the tension test, as a diagnosis predicts it.
fn slack(diagnosis: &Diagnosis, pair: &TensionPair) -> Result<Slack, NoPlace> {
    let [(first_tension, first), (second_tension, second)] = pair;
    let after = &diagnosis.after;
    let is_test = first_tension != second_tension;
    let longer = if *first_tension == Tension::Low { 1.0 } else { -1.0 };
    let difference = (first.at_m - second.at_m) * if is_test { longer } else { 1.0 };
    let pulled = if *first_tension == Tension::High { first } else { second };
    let no_place = NoPlace { line: pulled.line };
    let visit = after.between_visits_m.hypot(0.5 * (diagnosis.repeat_sd_m[0] + diagnosis.repeat_sd_m[1]));
    let predicted = |held: bool| -> Option<[[f64; 2]; 2]> {
        if !is_test {
            return Some([[0.0; 2]; 2]);
        }
        let of = |m: &Machine| slack_m(m, &pulled.at_m, held);
        Some([of(&after.machine)?, variances(&diagnosis.model, after, of)?])
    };
    let ([held_m, held_var], [free_m, free_var]) =
        (predicted(true).ok_or(no_place)?, predicted(false).ok_or(no_place)?);
    let half = |variance: f64| HALF_INTERVAL_SD * (variance + 2.0 * visit * visit).sqrt();
    let interval = |k: usize| {
        let ends = [(held_m[k], half(held_var[k])), (free_m[k], half(free_var[k]))];
        [
            ends.map(|e| e.0 - e.1).into_iter().fold(f64::INFINITY, f64::min),
            ends.map(|e| e.0 + e.1).into_iter().fold(f64::NEG_INFINITY, f64::max),
        ]
    };
    Ok(Slack {
        is_test,
        read_m: [difference[0], difference[1]],
        upper_read_m: [difference[2], difference[3]],
        held_m,
        free_m,
        interval_m: [interval(0), interval(1)],
    })
}

/// Place of tl y among the anchor coordinates.
pub const TL_Y: usize = COORDINATES - 1;

//! The runs one by one: a belief about anchors and stretch that each run improves, and how well it predicts the run that comes next.
//!
//! The estimator of `pkm-core` learns amplitudes in which the deflection is linear, of one kind of machine; its filter is private to
//! it. Anchors are not of that kind, and a visit's error is Student. What is needed of a filter are some lines for six numbers, with
//! the measurement linearised about the best values of a run, as often as a batch fit would.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::{ForwardModel, Unknown};

use crate::diagnosis::{DiagnosisError, identify, repeat_sd_m};
use crate::files::{Published, READINGS_PER_POINT, Run};
use crate::machine::{Anchors, Machine};
use crate::model::{CONDITIONS, Model, VISIT_DOF, amplitude};
use crate::study::predict;

/// Passes through a run: the values about which it is linear, and the spreads of its visits, change little after these.
const PASSES: usize = 5;
/// Step of differences, in units of the priors.
const STEP: f64 = 1e-4;
/// Place of the stretch of all belts under the pull among the candidates.
const STRETCH: usize = 0;

/// Standard deviations of a condition, m: of repeats' mean, and between visits.
#[derive(Clone, Copy, Debug)]
struct Noise {
    within_m: f64,
    between_m: f64,
}

/// Normal, in units of the priors.
#[derive(Clone, Debug)]
struct Belief {
    x: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Belief {
    fn new(count: usize) -> Self {
        Self { x: DVector::zeros(count), covariance: DMatrix::identity(count, count) }
    }

    /// Takes in a number that is linear in the unknowns.
    fn absorb(&mut self, row: &DVector<f64>, innovation: f64, variance: f64) {
        let gain = &self.covariance * row / (row.dot(&(&self.covariance * row)) + variance);
        self.x += &gain * innovation;
        self.covariance -= &gain * (row.transpose() * &self.covariance);
    }

    /// Takes in a run. `None` where the model has no prediction.
    fn learn(&mut self, model: &Model, unknowns: &[Unknown], read: &[f64], noise: Noise) -> Option<()> {
        let (prior, mut spread) = (self.clone(), vec![1.0_f64; read.len() / CONDITIONS]);
        for _ in 0..PASSES {
            let about = self.x.clone();
            let predicted = model.predict(unknowns, about.as_slice())?;
            let mut rows = vec![DVector::zeros(about.len()); read.len()];
            for n in 0..about.len() {
                let at = |step: f64| {
                    let mut x = about.clone();
                    x[n] += step;
                    model.predict(unknowns, x.as_slice())
                };
                let (high, low) = (at(STEP)?, at(-STEP)?);
                rows.iter_mut().enumerate().for_each(|(i, row)| row[n] = (high[i] - low[i]) / (2.0 * STEP));
            }
            *self = prior.clone();
            let variance = |spread: f64| noise.within_m.powi(2) + (spread * noise.between_m).powi(2);
            for (i, row) in rows.iter().enumerate() {
                let innovation = read[i] - predicted[i] - row.dot(&(&self.x - &about));
                self.absorb(row, innovation, variance(spread[i / CONDITIONS]));
            }
            for (visit, spread) in spread.iter_mut().enumerate() {
                let left = |i: usize| read[i] - predicted[i] - rows[i].dot(&(&self.x - &about));
                let squares: f64 = (0..CONDITIONS).map(|k| left(CONDITIONS * visit + k).powi(2)).sum();
                let share = squares / variance(*spread);
                // the most likely variance of a Student error, as in `Model::spread`
                *spread = ((VISIT_DOF + share * *spread * *spread) / (VISIT_DOF + CONDITIONS as f64)).sqrt();
            }
        }
        Some(())
    }
}

/// What was known after a run, and how well the run had been predicted before it was seen.
pub struct Step {
    /// Anchors after the run: of the filter, and of a fit of all runs up to it at once.
    pub anchors: [Anchors; 2],
    /// Stretch of all belts under the pull likewise, as a share of the length.
    pub stretch: [f64; 2],
    /// Its standard error by the filter.
    pub stretch_error: f64,
    /// Root mean square of a condition of the run, m: as predicted by the filter, by the fit at once of the runs before it, and by a fit of
    /// the first run alone; `None` for the first run.
    pub predicted_m: Option<[f64; 3]>,
}

/// Means of the repeats of each visit.
fn means(model: &Model, run: &Run) -> Vec<f64> {
    let mut sums = vec![0.0; CONDITIONS * run.points.len()];
    for reading in model.observations(run).readings {
        for (k, value) in reading.observed.iter().enumerate() {
            sums[CONDITIONS * reading.condition + k] += value.unwrap_or(0.0) / READINGS_PER_POINT as f64;
        }
    }
    sums
}

/// Feeds the runs in one by one. Declared: the anchors of the maker's tool from the first run.
///
/// # Errors
/// A run that cannot be fitted.
pub fn one_by_one(published: &Published) -> Result<Vec<Step>, DiagnosisError> {
    let runs = &published.runs;
    let declared = runs[0].tool;
    let [bl, br, tr, tl] = repeat_sd_m(&runs[0])?;
    let upper_weight = bl.hypot(br) / tr.hypot(tl);
    let unknowns = |model: &Model| [model.declared(), vec![amplitude(STRETCH)]].concat();
    let mut belief: Option<Belief> = None;
    let mut steps: Vec<Step> = Vec::new();
    let mut machines: Option<[Machine; 3]> = None;
    let mut noise = Noise { within_m: 0.5 * (bl + br) / (READINGS_PER_POINT as f64).sqrt(), between_m: 0.0 };
    for (n, run) in runs.iter().enumerate() {
        let rms = |machine: &Machine| predict(machine, &[run]).map(|p| p.rms_m);
        let predicted_m = match &machines {
            Some([filter, batch, first]) => Some([rms(filter)?, rms(batch)?, rms(first)?]),
            None => None,
        };
        let seen = Run { points: runs[..=n].iter().flat_map(|r| r.points.iter().copied()).collect(), tool: declared };
        let batch = identify(&seen, upper_weight, &[amplitude(STRETCH)])?;
        if n == 0 {
            noise.between_m = batch.between_visits_m;
        }
        let model = Model::new(run, declared, upper_weight)?;
        let own = unknowns(&model);
        let belief = belief.get_or_insert_with(|| Belief::new(own.len()));
        belief.learn(&model, &own, &means(&model, run), noise).ok_or(DiagnosisError::NoFit)?;
        let filter = model.machine(&own, belief.x.as_slice());
        let first = machines.take().map_or_else(|| batch.machine.clone(), |[_, _, first]| first);
        let last = own.len() - 1;
        let value = |x: f64| model.parameters()[own[last].0].prior.value(x);
        let batch_stretch = batch.value(&model, own[last]).map_or(f64::NAN, |(value, _)| value);
        steps.push(Step {
            anchors: [filter.anchors, batch.machine.anchors],
            stretch: [value(belief.x[last]), batch_stretch],
            stretch_error: value(belief.covariance[(last, last)].sqrt()) - value(0.0),
            predicted_m,
        });
        machines = Some([filter, batch.machine, first]);
    }
    Ok(steps)
}

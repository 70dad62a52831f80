//! What the readings of one run say that the model lacks.

use std::fmt;
use std::path::Path;

use nalgebra::DMatrix;
use pkm_diagnosis::places::{self, Inferred};
use pkm_diagnosis::{
    Channel, Fit, ForwardModel, Levels, Noise, Observations, Problem, Reading, Rules, Unknown, Whitener, columns,
    levels, search, verdict,
};

use crate::files::{ReadError, Run};
use crate::machine::Machine;
use crate::model::{Blocks, COMMON_SCALE, Model, NoPlace, amplitude};

/// Standard deviations between visits to a point that are considered, m: in steps of √2, at which the evidence of 50
/// conditions loses less than 2 in ln, from well below the repeats to twice what a model without stretch leaves.
const BETWEEN_VISITS_M: [f64; 13] =
    [0.0, 1e-4, 1.4e-4, 2e-4, 2.8e-4, 4e-4, 5.7e-4, 8e-4, 1.13e-3, 1.6e-3, 2.26e-3, 3.2e-3, 4.5e-3];
const ALL_LEVELS: [usize; BETWEEN_VISITS_M.len()] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12];
/// Where fits begin.
const FIRST_LEVEL: usize = BETWEEN_VISITS_M.len() - 1;
/// Turns of naming and of settling the spreads of visits, and fits in each.
const TURNS: usize = 3;
/// See `TURNS`.
const FITS: usize = 5;

/// Rules of the statistics. What differs from a stiffness diagnosis: the error that readings share is that of a visit, not of
/// a load, and no size of it is likelier than another. The variance between visits takes what a form leaves, so that evidence needs no
/// tempering.
pub const RULES: Rules = Rules {
    load_error_levels: &BETWEEN_VISITS_M,
    block_levels: &ALL_LEVELS,
    ln_prior_of_level: 0.0,
    temper_of_places: 1.0,
    ..Rules::DEFAULT
};

/// Why a run cannot be diagnosed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiagnosisError {
    /// Lengths that fit no place of the sled.
    NoPlace(NoPlace),
    /// Repeats that do not show the noise.
    UnknownNoise,
    /// No fit converged.
    NoFit,
}

impl fmt::Display for DiagnosisError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoPlace(_) => write!(f, "these lengths fit no place of the sled"),
            Self::UnknownNoise => write!(f, "the repeats of a run do not show the noise of its readings"),
            Self::NoFit => write!(f, "no fit of the anchors converged"),
        }
    }
}

impl std::error::Error for DiagnosisError {}

impl DiagnosisError {
    /// With the file whose readings they are.
    pub fn at(&self, path: &Path) -> ReadError {
        let line = if let Self::NoPlace(NoPlace { line }) = self { Some(*line) } else { None };
        ReadError { path: path.to_owned(), line, message: self.to_string() }
    }
}

impl From<NoPlace> for DiagnosisError {
    fn from(e: NoPlace) -> Self {
        Self::NoPlace(e)
    }
}

/// A model with identified values.
pub struct Identified {
    /// What was identified.
    pub unknowns: Vec<Unknown>,
    /// In units of the priors.
    pub x: Vec<f64>,
    /// Covariance of `x`.
    pub covariance: DMatrix<f64>,
    /// The machine with these values.
    pub machine: Machine,
    /// Standard deviation of a condition between visits to a point, m.
    pub between_visits_m: f64,
}

impl Identified {
    fn new(model: &Model, level: usize, fit: &Fit) -> Self {
        Self {
            unknowns: fit.unknowns.clone(),
            x: fit.x.as_slice().to_vec(),
            covariance: fit.information.inverse(),
            machine: model.machine(&fit.unknowns, fit.x.as_slice()),
            between_visits_m: BETWEEN_VISITS_M[level],
        }
    }

    /// Value and standard error of an unknown, in SI units.
    pub fn value(&self, model: &Model, unknown: Unknown) -> Option<(f64, f64)> {
        let at = self.unknowns.iter().position(|u| *u == unknown)?;
        let prior = model.parameters()[unknown.0].prior;
        Some((prior.value(self.x[at]), prior.error(self.x[at], self.covariance[(at, at)].sqrt())))
    }
}

/// What a run says.
pub struct Diagnosis {
    /// The model over the points of the run.
    pub model: Model,
    /// Standard deviation of repeats by belt, m.
    pub repeat_sd_m: [f64; 4],
    /// Anchors alone.
    pub before: Identified,
    /// With all findings.
    pub after: Identified,
    /// The findings.
    pub inferred: Inferred,
    /// Whether the readings can tell each candidate from other anchors at any plausible size.
    pub identifiable: Vec<bool>,
    /// Share of the signal of a common length scale that moved anchors do not take.
    pub common_scale_left: f64,
}

/// Scatter of repeats by belt, m.
pub(crate) fn repeat_sd_m(run: &Run) -> Result<[f64; 4], DiagnosisError> {
    let readings = run.points.iter().enumerate().flat_map(|(point, readings)| {
        readings.iter().map(move |r| Reading {
            condition: point,
            repeat_of: point,
            series: point,
            observed: r.at_m.iter().copied().map(Some).collect(),
            sigma: vec![None; 2],
            covariance: None,
            drawn: Vec::new(),
        })
    });
    let channels = [0, 0, 1, 1].map(|kind| Channel { kind, resolution: 1e-5 }).to_vec();
    let pose_of = (0..run.points.len()).collect();
    let observations = Observations { channels, pose_of, readings: readings.collect() };
    let noise = Noise::estimate(&observations, &RULES).map_err(|_| DiagnosisError::UnknownNoise)?;
    noise.within.try_into().map_err(|_| DiagnosisError::UnknownNoise)
}

/// Readings of a run with their noise.
struct Measured {
    observations: Observations,
    noise: Noise,
    whitener: Whitener,
}

impl Measured {
    fn new(model: &Model, run: &Run) -> Result<Self, DiagnosisError> {
        let observations = model.observations(run);
        let noise = Noise::estimate(&observations, &RULES).map_err(|_| DiagnosisError::UnknownNoise)?;
        let whitener = Whitener::new(&observations, &noise);
        Ok(Self { observations, noise, whitener })
    }

    /// What the readings say at every size of the errors of visits.
    fn with_levels<T>(&self, model: &Model, ask: impl FnOnce(&Levels<'_>) -> Option<T>) -> Result<T, DiagnosisError> {
        let plain = Problem::new(&self.observations, &self.whitener, model, &RULES);
        let whiteners = levels::whiteners(&plain);
        ask(&Levels::new(&plain, &whiteners)).ok_or(DiagnosisError::NoFit)
    }

    /// Squared whitened residuals by visit.
    fn squares(&self, fit: &Fit) -> Vec<f64> {
        let mut squares = vec![0.0; self.observations.pose_of.len()];
        for (entry, residual) in self.whitener.entries.iter().zip(fit.residuals.iter()) {
            squares[entry.condition] += residual * residual;
        }
        squares
    }

    /// Fits some unknowns and settles how far the error of each visit spreads, in turns.
    fn settled(&self, model: &mut Model, unknowns: &[Unknown]) -> Result<(usize, Fit), DiagnosisError> {
        let start = vec![0.0; unknowns.len()];
        let fit = |model: &Model| self.with_levels(model, |levels| levels.fit(unknowns, &start, FIRST_LEVEL));
        for _ in 1..FITS {
            let (_, fit) = fit(model)?;
            model.spread(&self.squares(&fit));
        }
        fit(model)
    }

    /// Names what is missing and identifies it with the anchors, again with the spreads of visits that follow.
    fn named(&self, model: &mut Model) -> Result<(Inferred, Identified), DiagnosisError> {
        let mut turn = 0;
        loop {
            let inferred = self.with_levels(model, |levels| {
                places::infer(levels, &self.noise, &Blocks { problem: levels.plain, model })
            })?;
            let mut unknowns = model.declared();
            unknowns.extend(inferred.findings.iter().map(|f| amplitude(f.block)));
            let (level, fit) = self.settled(model, &unknowns)?;
            turn += 1;
            if turn == TURNS {
                return Ok((inferred, Identified::new(model, level, &fit)));
            }
        }
    }
}

/// Fits the anchors that a run declares together with some other unknowns, without a search.
///
/// # Errors
/// Lengths that fit no place, or readings that say too little.
pub(crate) fn identify(run: &Run, upper_weight: f64, others: &[Unknown]) -> Result<Identified, DiagnosisError> {
    let mut model = Model::new(run, run.tool, upper_weight)?;
    let measured = Measured::new(&model, run)?;
    let unknowns = [&model.declared()[..], others].concat();
    let (level, fit) = measured.settled(&mut model, &unknowns)?;
    Ok(Identified::new(&model, level, &fit))
}

/// Diagnoses a run. Declared: the anchors of the maker's tool, and belts that do not stretch.
///
/// # Errors
/// Lengths that fit no place, or readings that say too little.
pub fn diagnose(run: &Run) -> Result<Diagnosis, DiagnosisError> {
    let repeat_sd_m = repeat_sd_m(run)?;
    let [bl, br, tr, tl] = repeat_sd_m;
    let upper_weight = bl.hypot(br) / tr.hypot(tl);
    let new = || Model::new(run, run.tool, upper_weight);
    let (mut model, mut anchors_alone) = (new()?, new()?);
    let measured = Measured::new(&model, run)?;
    let declared = anchors_alone.declared();
    let (level, fit) = measured.settled(&mut anchors_alone, &declared)?;
    let before = Identified::new(&anchors_alone, level, &fit);
    // a search that may name nothing: what each candidate would add to the anchors
    let (identifiable, common_scale_left) = measured.with_levels(&anchors_alone, |levels| {
        let base = search::search(levels, Some(&[]))?;
        let detectable = |c: usize| verdict::smallest_detectable(levels, &base, c).iter().all(|d| d.1.is_some());
        let identifiable = (0..model.candidates().len()).map(detectable).collect();
        let scale = columns(&levels.problems[base.levels[0]], &base.base, &model.candidates()[COMMON_SCALE])?.matrix;
        Some((identifiable, base.base.remaining(&scale).trace() / scale.norm_squared()))
    })?;
    let (inferred, after) = measured.named(&mut model)?;
    Ok(Diagnosis { model, repeat_sd_m, before, after, inferred, identifiable, common_scale_left })
}

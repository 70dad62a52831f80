//! What an identification ends with.

use pkm_diagnosis::Noise;
use pkm_diagnosis::validation::Errors;
use pkm_diagnosis::verdict::LackOfFit;

use super::directions::Direction;
use super::model::{CHANNELS, Meaning};
use crate::files::unloaded::{Target, Unloaded, UnloadedReading};
use crate::tracker::rigid::Motion;

/// Error of an identified machine on other poses, over the noise, above which the readings are not what the file says: joints that are off by
/// some mrad leave less.
const MAX_RATIO_TO_NOISE: f64 = 20.0;

/// Prior deviations beyond which an estimate says that the declared uncertainty was too small.
pub const MAX_PULL_SD: f64 = 3.0;

/// Where a point is, with the deviations of its coordinates: 0 where they were given; m.
pub type Located<T> = (T, [f64; 3], [f64; 3]);

/// From B to the measuring frame; deviations of its origin, m, and rotation, rad.
pub type Frame = (Motion, [[f64; 3]; 2]);

/// What predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rival {
    /// The declared geometry, measuring frame and targets fitted.
    Declared,
    /// The identified one, which the controller's kinematics can hold.
    Identified,
    /// With the findings beside it, which they cannot.
    WithFound,
}

/// All of them.
pub const RIVALS: [Rival; 3] = [Rival::Declared, Rival::Identified, Rival::WithFound];

/// What it amounts to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The residuals of the identified geometry are noise.
    Adequate,
    /// With findings in joints or screws beside it the residuals are noise.
    Explained,
    /// With findings beside it the residuals are more than noise.
    PartlyExplained,
    /// The residuals are more than noise, and no candidate accounts for them.
    Unexplained,
}

/// An estimated number of the machine, SI.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// What it is.
    pub meaning: Meaning,
    /// As declared; 0 for zeros of joints.
    pub declared: f64,
    /// As identified, beside the findings.
    pub value: f64,
    /// Standard deviation; with more misfit than noise, by as much more.
    pub sd: f64,
    /// Declared uncertainty.
    pub prior_sd: f64,
    /// Whether the readings tell it.
    pub identifiable: bool,
    /// What the controller's kinematics should hold: where a finding is beyond them, the value that makes up for as
    /// much of it as it can; the declared one where what was identified is [of no use](Identification::is_of_use); else the same.
    pub held: f64,
}

impl Estimate {
    /// Of the number in files.
    pub fn unit(&self) -> &'static str {
        if self.meaning.is_angle() { "mrad" } else { "mm" }
    }

    /// Distance from the declared value in declared deviations.
    pub fn pull_sd(&self) -> f64 {
        (self.value - self.declared) / self.prior_sd
    }
}

/// Something that the model may lack, tried.
pub struct Tried {
    /// Its name.
    pub id: String,
    /// Gain of 2 ln E over the identified geometry, by the noise that the better leaves.
    pub gain: f64,
    /// Share of the squared errors on poses left out that it saves.
    pub left_out_gain: f64,
    /// Whether it was taken, or can't be told from what was.
    pub state: TriedState,
}

/// What came of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TriedState {
    /// Taken.
    Found,
    /// The readings can't tell it from what was taken.
    Alike,
    /// Neither.
    Rejected,
}

/// Errors of the rivals on readings.
pub type RivalErrors = Vec<(Rival, Errors)>;

/// A reading that no noise explains.
pub struct Suspect {
    /// Line of the file.
    pub line: u64,
    /// Residual in standard deviations.
    pub residual_sd: f64,
    /// Whether it was left out, as a single gross error is.
    pub is_excluded: bool,
}

/// What unloaded readings say of a machine.
pub struct Identification {
    /// What it amounts to.
    pub verdict: Verdict,
    /// Of the readings.
    pub noise: Noise,
    /// Scalar observations, and different poses.
    pub size: (usize, usize),
    /// Numbers of the machine.
    pub estimates: Vec<Estimate>,
    /// Their covariance, SI, in their order, by the same fit.
    pub covariance: Vec<Vec<f64>>,
    /// Combinations of them, by the identified geometry alone.
    pub directions: Vec<Direction>,
    /// From B to the measuring frame, where places were measured; deviations of its origin, m, and rotation, rad.
    pub frame: Option<Frame>,
    /// Targets with the deviations of their coordinates, m; 0 where they were given.
    pub targets: Vec<Located<Target>>,
    /// Balls likewise, in B.
    pub balls: Vec<Located<String>>,
    /// Of the declared geometry, the identified one, and with the findings.
    pub lack_of_fit: [LackOfFit; 3],
    /// What was tried beside the geometry; nothing where that leaves only noise.
    pub tried: Vec<Tried>,
    /// On the readings themselves.
    pub errors: RivalErrors,
    /// Whether held-out readings were given, poses, errors on them or on poses left out in turn.
    pub held_out: (bool, usize, RivalErrors),
    /// That stand out, left out or too many for that.
    pub suspects: Vec<Suspect>,
    /// By reading and channel: what the identified geometry says, m; and errors of the places by declared and identified
    /// geometry in B, for pictures.
    pub said_m: Vec<[f64; CHANNELS]>,
    /// The same by the declared geometry.
    pub said_declared_m: Vec<[f64; CHANNELS]>,
    /// Standard deviation of each reading's numbers, m.
    pub sd_m: Vec<[f64; CHANNELS]>,
}

impl Identification {
    /// Findings beside the geometry.
    pub fn found(&self) -> impl Iterator<Item = &Tried> {
        self.tried.iter().filter(|t| t.state == TriedState::Found)
    }

    /// Whether nothing explains the readings, and they are so far from the identified machine that they are not what the file says.
    pub fn is_far_from_any_machine(&self) -> bool {
        let identified = self.held_out_of(Rival::Identified);
        self.verdict == Verdict::Unexplained && identified.is_some_and(|e| e.chi2_per_dof.sqrt() > MAX_RATIO_TO_NOISE)
    }

    /// Whether the controller should hold the identified numbers: not where nothing explains the readings and they are far from any machine,
    /// or predict places that had no part in the fit no better than the declared ones.
    pub fn is_of_use(&self) -> bool {
        let rms = |rival| self.held_out_of(rival).map(|e| e.kinds[0].rms);
        let is_better =
            || rms(Rival::Identified).zip(rms(Rival::Declared)).is_none_or(|(after, before)| after < before);
        self.verdict != Verdict::Unexplained || (!self.is_far_from_any_machine() && is_better())
    }

    /// Readings that were not left out, in the order of what is said of them.
    pub fn kept<'a>(&'a self, unloaded: &'a Unloaded) -> impl Iterator<Item = &'a UnloadedReading> {
        unloaded.readings.iter().filter(|r| self.suspects.iter().all(|s| !s.is_excluded || s.line != r.line))
    }

    /// Errors of a rival on held-out poses.
    pub fn held_out_of(&self, rival: Rival) -> Option<&Errors> {
        self.held_out.2.iter().find(|(r, _)| *r == rival).map(|(_, e)| e)
    }
}

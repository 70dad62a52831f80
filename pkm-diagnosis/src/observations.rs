//! Readings as scalar observations: which of them share a condition, a zero, a pose.

use std::sync::Arc;

use nalgebra::DMatrix;

/// One scalar that a sensor reads, such as a displacement along an axis.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Channels of one kind have the same unit, and noise of about the same size.
    pub kind: usize,
    /// Step in which its numbers are read, in SI units.
    pub resolution: f64,
}

/// What was read at once.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Index of the condition that determines the prediction.
    pub condition: usize,
    /// Readings with the same number, counted from 0, are repeats of one another.
    pub repeat_of: usize,
    /// Readings with the same number, counted from 0, share a zero error in each channel.
    pub series: usize,
    /// By channel, in SI units; `None` where nothing was read.
    pub observed: Vec<Option<f64>>,
    /// Declared standard deviation by kind of channel.
    pub sigma: Vec<Option<f64>>,
    /// Declared instead of `sigma`, where errors of the channels go together.
    pub covariance: Option<Arc<Covariance>>,
    /// One standard deviation of an error that acts in all channels at once and is drawn anew with each reading, such as that of
    /// a load cell, by channel in SI units; empty without one.
    pub drawn: Vec<f64>,
}

impl Reading {
    /// Declared standard deviations of a number, within its series and of the zero of its series.
    pub(crate) fn declared(&self, channel: usize, kind: usize) -> Option<(f64, f64)> {
        match &self.covariance {
            Some(covariance) => Some(covariance.deviations(channel)),
            None => Some((self.sigma[kind]?, 0.0)),
        }
    }
}

/// Declared errors of a reading that go through several of its channels, such as those of a motion that follows from points.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    /// In SI units: noise and zero error together.
    variance: Vec<f64>,
    correlation: DMatrix<f64>,
    zero_share: f64,
}

impl Covariance {
    /// From standard deviations by channel in SI units and their correlations, zero error included; `zero_share` is the share of
    /// the variance that the zero of the series has. A channel that was not read has any deviation and no correlation. `None`
    /// unless it is positive definite.
    pub fn new(deviations: &[f64], correlation: DMatrix<f64>, zero_share: f64) -> Option<Self> {
        let n = deviations.len();
        let is_matrix = correlation.shape() == (n, n) && correlation == correlation.transpose();
        let is_unit = (0..n).all(|c| correlation[(c, c)] == 1.0);
        let is_variance = deviations.iter().all(|s| *s > 0.0 && s.is_finite());
        let is_positive = is_matrix && is_unit && is_variance && correlation.clone().cholesky().is_some();
        let variance = deviations.iter().map(|s| s * s).collect();
        (is_positive && (0.0..1.0).contains(&zero_share)).then_some(Self { variance, correlation, zero_share })
    }

    /// Of a number within its series, and of its zero.
    pub(crate) fn deviations(&self, channel: usize) -> (f64, f64) {
        let variance = self.variance[channel];
        (((1.0 - self.zero_share) * variance).sqrt(), (self.zero_share * variance).sqrt())
    }

    /// Share of the variance that the zero of the series has.
    pub(crate) fn zero_share(&self) -> f64 {
        self.zero_share
    }

    /// L with L Lᵀ the correlations of some channels, where the errors that go together are a share of each deviation, at most all of
    /// it, and the rest goes by itself.
    pub(crate) fn factor(&self, channels: &[usize], share: impl Fn(usize) -> f64) -> DMatrix<f64> {
        let of = |i: usize, j: usize| {
            let (a, b) = (channels[i], channels[j]);
            if i == j { 1.0 } else { self.correlation[(a, b)] * share(a) * share(b) }
        };
        // part of a positive definite matrix, and smaller beside its diagonal
        DMatrix::from_fn(channels.len(), channels.len(), of).cholesky().expect("checked when it was made").unpack()
    }
}

/// All that was read.
#[derive(Clone, Debug)]
pub struct Observations {
    /// What the sensors read.
    pub channels: Vec<Channel>,
    /// Pose of each condition, counted from 0. Whole poses are held out, never single readings.
    pub pose_of: Vec<usize>,
    /// In the order of measurement.
    pub readings: Vec<Reading>,
}

/// What is wrong with a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// Not as many numbers in it as there are channels, or kinds of channels.
    Count,
    /// A condition, a series or a repeat that is not counted from 0 on: a number beyond those of conditions or of readings.
    Number,
    /// A value, or an error that it draws, that is not finite.
    NotFinite,
    /// A declared deviation that is not finite, or not above 0.
    Deviation,
}

/// A reading that the engine cannot take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadReading {
    /// Index of the reading.
    pub reading: usize,
    /// What is wrong with it.
    pub flaw: Flaw,
}

impl std::fmt::Display for BadReading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let what = match self.flaw {
            Flaw::Count => "does not have a number for each channel, and a deviation for each kind",
            Flaw::Number => "has a condition, series or repeat that is not counted from 0 on",
            Flaw::NotFinite => "has a number that is not finite",
            Flaw::Deviation => "has a declared deviation that is not finite and above 0",
        };
        write!(f, "reading {} {what}", self.reading)
    }
}

impl std::error::Error for BadReading {}

impl Observations {
    /// Whether the engine can take these. What a client makes itself of a file that it has checked needs no second look.
    ///
    /// # Errors
    /// The first reading that it cannot.
    pub fn check(&self) -> Result<(), BadReading> {
        let (channels, kinds, readings) = (self.channels.len(), self.kinds(), self.readings.len());
        let flaw = |r: &Reading| {
            let is_short = |n: usize| n != 0 && n != channels;
            if r.observed.len() != channels || r.sigma.len() != kinds || is_short(r.drawn.len()) {
                Some(Flaw::Count)
            } else if r.condition >= self.pose_of.len() || r.series.max(r.repeat_of) >= readings {
                Some(Flaw::Number)
            } else if !r.observed.iter().flatten().chain(&r.drawn).all(|value| value.is_finite()) {
                Some(Flaw::NotFinite)
            } else if !r.sigma.iter().flatten().all(|sigma| sigma.is_finite() && *sigma > 0.0) {
                Some(Flaw::Deviation)
            } else {
                None
            }
        };
        let mut all = self.readings.iter().enumerate();
        all.find_map(|(reading, r)| Some(BadReading { reading, flaw: flaw(r)? })).map_or(Ok(()), Err)
    }

    /// Number of kinds of channels.
    pub fn kinds(&self) -> usize {
        self.channels.iter().map(|c| c.kind + 1).max().unwrap_or(0)
    }

    /// Number of poses.
    pub fn poses(&self) -> usize {
        self.pose_of.iter().map(|p| p + 1).max().unwrap_or(0)
    }

    /// Pose of a reading.
    pub fn pose(&self, reading: &Reading) -> usize {
        self.pose_of[reading.condition]
    }

    /// Which channels have any reading.
    pub fn used_channels(&self) -> Vec<bool> {
        (0..self.channels.len()).map(|c| self.readings.iter().any(|r| r.observed[c].is_some())).collect()
    }

    /// The same poses and conditions without some of the readings.
    pub fn without(&self, left_out: impl Fn(&Reading) -> bool) -> Self {
        Self {
            channels: self.channels.clone(),
            pose_of: self.pose_of.clone(),
            readings: self.readings.iter().filter(|r| !left_out(r)).cloned().collect(),
        }
    }
}

//! Readings as scalar observations: which of them share a condition, a zero, a pose.

/// One scalar that a sensor reads, such as a displacement along an axis.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Channels of one kind have the same unit, and noise of about the same size.
    pub kind: usize,
    /// Least step of the numbers as written, in SI units.
    pub resolution: f64,
}

/// What was read at once.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Index of the condition that determines the prediction.
    pub condition: usize,
    /// Readings with the same number are repeats of one another.
    pub repeat_of: usize,
    /// Readings with the same number share a zero error in each channel.
    pub series: usize,
    /// By channel, in SI units; `None` where nothing was read.
    pub observed: Vec<Option<f64>>,
    /// Declared standard deviation by kind of channel.
    pub sigma: Vec<Option<f64>>,
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

impl Observations {
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

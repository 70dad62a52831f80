//! Poses and boxes of poses, in the core's units and in those of files.

use std::array::from_fn;

use pkm_core::Pose;
use serde::{Deserialize, Serialize};

/// Length that makes a rotation comparable with a translation, and at which a moment counts like a force.
pub const ROTATION_ARM_M: f64 = 0.2;

/// A pose from a file.
#[derive(Clone, Debug)]
pub struct NamedPose {
    /// Any text.
    pub id: String,
    /// Line in the file, from 1.
    pub line: u64,
    /// The pose.
    pub pose: Pose<f64>,
}

impl NamedPose {
    /// For people, as "pose P7 (line 12)".
    pub fn name(&self) -> String {
        if self.id.is_empty() {
            format!("the pose of line {}", self.line)
        } else {
            format!("pose {} (line {})", self.id, self.line)
        }
    }
}

/// A pose from the units of files: °, °, mm.
pub fn pose_of(theta_deg: f64, sigma_deg: f64, z0_mm: f64) -> Pose<f64> {
    Pose { theta_rad: theta_deg.to_radians(), sigma_rad: sigma_deg.to_radians(), z0_m: z0_mm / 1e3 }
}

/// A pose in the units of files: °, °, mm.
pub fn file_units(pose: &Pose<f64>) -> [f64; 3] {
    // without the sign of a zero
    [pose.theta_rad.to_degrees(), pose.sigma_rad.to_degrees(), pose.z0_m * 1e3].map(|v| v + 0.0)
}

/// The same as it was written: the way through rad and m costs the last digit.
pub fn written_units(pose: &Pose<f64>) -> [f64; 3] {
    file_units(pose).map(tidy)
}

/// ° and mm as the core has them, rad and m.
pub fn core_units([theta_deg, sigma_deg, z0_mm]: [f64; 3]) -> [f64; 3] {
    [theta_deg.to_radians(), sigma_deg.to_radians(), z0_mm / 1e3]
}

/// A number without the last digits' noise.
pub fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// A box of poses in the units of files, each range with its least and its greatest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseBox {
    /// θ.
    pub theta_deg: [f64; 2],
    /// σ.
    pub sigma_deg: [f64; 2],
    /// Z0.
    pub z0_mm: [f64; 2],
}

impl Default for PoseBox {
    /// The paper's Table 2.
    fn default() -> Self {
        Self { theta_deg: [-15.0, 15.0], sigma_deg: [-15.0, 15.0], z0_mm: [500.0, 560.0] }
    }
}

impl From<[[f64; 2]; 3]> for PoseBox {
    fn from([theta_deg, sigma_deg, z0_mm]: [[f64; 2]; 3]) -> Self {
        Self { theta_deg, sigma_deg, z0_mm }
    }
}

/// Largest angle of a machine that is probably in radians where one in degrees is expected and none is larger: 34°, and as degrees next to nothing.
pub const MAX_RADIANS: f64 = 0.6;

impl PoseBox {
    /// Whether its angles are so small that they are likely to be in radians.
    pub fn may_be_in_radians(&self) -> bool {
        let angles = [self.theta_deg, self.sigma_deg];
        let greatest = angles.as_flattened().iter().fold(0.0_f64, |most, angle| most.max(angle.abs()));
        greatest > 0.0 && greatest < MAX_RADIANS
    }

    /// Extent of poses.
    pub fn of<'a>(poses: impl IntoIterator<Item = &'a Pose<f64>>) -> Self {
        let mut extent = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for pose in poses {
            for (range, value) in extent.iter_mut().zip(written_units(pose)) {
                *range = [range[0].min(value), range[1].max(value)];
            }
        }
        extent.into()
    }

    /// Of θ, σ and Z0.
    pub fn ranges(&self) -> [[f64; 2]; 3] {
        [self.theta_deg, self.sigma_deg, self.z0_mm]
    }

    /// What it has in common with another; `None` if that is nothing.
    pub fn common(&self, other: &Self) -> Option<Self> {
        let (own, other) = (self.ranges(), other.ranges());
        let common = from_fn(|i| [own[i][0].max(other[i][0]), own[i][1].min(other[i][1])]);
        common.iter().all(|[low, high]| low <= high).then(|| common.into())
    }

    /// The middle.
    pub fn middle(&self) -> [f64; 3] {
        self.ranges().map(|[low, high]| (low + high) / 2.0)
    }

    /// The pose in the middle.
    pub fn middle_pose(&self) -> Pose<f64> {
        let [theta_deg, sigma_deg, z0_mm] = self.middle();
        pose_of(theta_deg, sigma_deg, z0_mm)
    }

    /// Half widths; 1 for what does not vary, so that it can be divided by.
    pub fn half_widths(&self) -> [f64; 3] {
        self.ranges().map(|[low, high]| if high > low { (high - low) / 2.0 } else { 1.0 })
    }

    /// One of `count` levels, from 0, of each variable.
    pub fn level(&self, count: [usize; 3], n: [usize; 3]) -> [f64; 3] {
        let ranges = self.ranges();
        from_fn(|i| ranges[i][0] + (ranges[i][1] - ranges[i][0]) * n[i] as f64 / (count[i] - 1) as f64)
    }
}

//! What to measure next to tell rivals apart.

use nalgebra::{Vector3, Vector6};
use pkm_core::thermal::DECLARED_TEMPERATURE_C;
use pkm_core::{Pose, Wrench};
use pkm_diagnosis::design::{self, Rival};
use pkm_diagnosis::{Noise, Rules};

use super::experiment::Experiment;
use super::model::Model;
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Condition, GAUGE, Readings};
use crate::pose::{PoseBox, pose_of};

/// How much wider than the box the poses may lie, half of it on either side.
const BEYOND: f64 = 0.3;
/// Levels of θ, σ and Z0 that are considered.
const LEVELS: [usize; 3] = [5, 5, 3];

/// One proposed measurement.
pub struct Proposal {
    /// Where.
    pub pose: Pose<f64>,
    /// Load at A, in A-uvw.
    pub wrench: Wrench<f64>,
    /// The two that it tells apart best.
    pub separates: [String; 2],
}

/// Loads along each axis either way, as great as those that were measured, and a fifth of them: light loads tell what
/// depends on the load from what does not.
fn loads(conditions: &[Condition]) -> Vec<Wrench<f64>> {
    let largest =
        |pick: fn(&Wrench<f64>) -> Vector3<f64>| conditions.iter().map(|c| pick(&c.wrench).amax()).fold(0.0, f64::max);
    let (force, moment) = (largest(|w| w.force_n), largest(|w| w.moment_nm));
    let mut loads = Vec::new();
    for axis in 0..6 {
        for sign in [1.0, -1.0] {
            let size = sign * if axis < 3 { force } else { moment };
            if size == 0.0 {
                continue;
            }
            let load = Vector6::from_fn(|i, _| if i == axis { size } else { 0.0 });
            loads.push(Wrench::from_vector(load));
        }
    }
    let light: Vec<_> =
        loads.iter().map(|w| Wrench { force_n: w.force_n * 0.2, moment_nm: w.moment_nm * 0.2 }).collect();
    loads.extend(light);
    loads
}

/// A grid of poses over the box and beyond it by a share of its width, those out of travel left out.
pub(super) fn grid(file: &MachineFile, beyond: f64) -> Vec<Pose<f64>> {
    let wider = PoseBox::from(file.pose_box.ranges().map(|[low, high]| {
        let more = 0.5 * beyond * (high - low);
        [low - more, high + more]
    }));
    let mut poses = Vec::new();
    for i in 0..LEVELS[0] {
        for j in 0..LEVELS[1] {
            for k in 0..LEVELS[2] {
                let [theta, sigma, z0] = wider.level(LEVELS, [i, j, k]).map(|v| (v * 10.0).round() / 10.0);
                let pose = pose_of(theta, sigma, z0);
                if file.machine.inverse(&pose).is_ok() {
                    poses.push(pose);
                }
            }
        }
    }
    poses
}

/// Measurements that tell rivals apart, under loads as great as those that were applied.
pub fn propose(
    model: &Model,
    readings: &Readings,
    noise: &Noise,
    file: &MachineFile,
    rivals: &[Rival],
    rules: &Rules,
) -> Vec<Proposal> {
    let (loads, poses) = (loads(&readings.conditions), grid(file, BEYOND));
    let conditions: Vec<Condition> = (0..poses.len())
        .flat_map(|pose| {
            loads.iter().map(move |wrench| Condition {
                pose,
                wrench: *wrench,
                point_m: [0.0; 3],
                turned_at: Wrench::ZERO,
                temperature_c: DECLARED_TEMPERATURE_C,
                rise_k: 0.0,
                gauge: None,
            })
        })
        .collect();
    let used = readings.channels();
    // who has nothing but gauges puts them along all axes
    let along_axes = used[GAUGE] && !used[..GAUGE].contains(&true);
    let scale: [f64; CHANNELS] = std::array::from_fn(|c| match c {
        0..3 if along_axes => 1.0 / noise.variance(GAUGE).sqrt(),
        _ if used[c] => 1.0 / noise.variance(c).sqrt(),
        _ => 0.0,
    });
    let experiment = Experiment { model, poses, conditions: &conditions };
    let proposals = design::propose(&experiment, &scale, rivals, rules.proposals);
    let of = |p: design::Proposal| {
        let c = &conditions[p.condition];
        let separates = p.separates.map(|r| rivals[r].name.clone());
        Proposal { pose: experiment.poses[c.pose], wrench: c.wrench, separates }
    };
    proposals.into_iter().map(of).collect()
}

//! Where to probe next: the loads that tell an estimator most, one after the other, by its own covariance.

use nalgebra::{Vector3, Vector6};
use pkm_core::estimation::{Estimator, EstimatorSettings, TipReading, Touch};
use pkm_core::{CorrectionTable, Deflection, Machine, Pose, Wrench};

use super::loaded;
use crate::files::log::Entry;
use crate::pose::{PoseBox, pose_of, tidy};

/// Levels of θ, σ and Z0 in the box.
const LEVELS: [usize; 3] = [5, 5, 3];
/// A probing that takes away less of the variance than this, as a share of all that was unknown at the start, is not worth the way.
const WORTH: f64 = 1e-4;

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Ask {
    /// How many probings.
    pub count: usize,
    /// Where the machine may stand.
    pub pose_box: PoseBox,
}

/// A pose and a load to probe under, with the tool and the sensor of the log's last reading.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// Where to stand.
    pub pose: Pose<f64>,
    /// Where the tip is in A-uvw.
    pub tip_m: Vector3<f64>,
    /// Force on the tip, in A-uvw; no moment.
    pub force_n: Vector3<f64>,
    /// Standard deviation of each of the three components.
    pub deviation_m: f64,
    /// Of each amplitude, the share of the variance before anything was read that is left after this and all before.
    pub variance_left: Vec<f64>,
}

/// A load that could be probed under.
struct Candidate<const N: usize> {
    touch: Touch<f64>,
    predicted: Deflection<f64>,
    sensitivities: [Deflection<f64>; N],
}

/// Axes, and the diagonals between two and three of them: the sign of a load tells nothing.
fn directions() -> Vec<Vector3<f64>> {
    let signs = [-1.0, 0.0, 1.0];
    let all = signs.into_iter().flat_map(|x| signs.into_iter().flat_map(move |y| signs.map(|z| Vector3::new(x, y, z))));
    let first = |d: &Vector3<f64>| d.iter().copied().find(|part| *part != 0.0);
    all.filter(|d| first(d) == Some(1.0)).map(|d| d.normalize()).collect()
}

/// Loads within reach: as great as the greatest force of the log.
fn candidates<const N: usize>(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    settings: &EstimatorSettings<N>,
    pose_box: &PoseBox,
    log: &[Entry],
) -> Vec<Candidate<N>> {
    let Some(last) = log.last() else { return Vec::new() };
    let greatest_n = log.iter().map(|entry| entry.touch.wrench.force_n.norm()).fold(0.0, f64::max);
    let amplitudes = settings.amplitudes.map(|own| own.amplitude);
    let mut found = Vec::new();
    for n in 0..LEVELS.iter().product() {
        let level = [n % LEVELS[0], n / LEVELS[0] % LEVELS[1], n / (LEVELS[0] * LEVELS[1])];
        let [theta_deg, sigma_deg, z0_mm] = pose_box.level(LEVELS, level).map(tidy);
        let pose = pose_of(theta_deg, sigma_deg, z0_mm);
        if machine.inverse(&pose).is_err() {
            continue;
        }
        for direction in directions() {
            let force_n = direction.map(|part| (part * greatest_n).round());
            let wrench = Wrench { force_n, ..Wrench::ZERO };
            let touch = Touch { pose, wrench, ..last.touch };
            let sensitivities = machine.sensitivities(&pose, &wrench.moved_to_a(touch.tip_m), &amplitudes);
            if let (Some(predicted), Ok(sensitivities)) = (loaded(machine, table, &touch), sensitivities) {
                found.push(Candidate { touch, predicted, sensitivities });
            }
        }
    }
    found
}

impl<const N: usize> Candidate<N> {
    /// What the estimator would be after it, if the reading is what it expects.
    fn after(&self, estimator: &Estimator<f64, N>, deviation: f64) -> Option<Estimator<f64, N>> {
        let mut expected = self.predicted.seen_at(self.touch.tip_m).to_vector();
        let amplitudes = estimator.amplitudes().into_iter().zip(estimator.values());
        for (moved, (amplitude, (value, _))) in self.sensitivities.iter().zip(amplitudes) {
            expected += amplitude.shown(*moved, self.predicted).seen_at(self.touch.tip_m).to_vector() * value;
        }
        let readings: [_; 3] = std::array::from_fn(|axis| TipReading {
            direction: Vector6::ith(axis, 1.0),
            read: expected[axis],
            deviation,
        });
        let mut after = *estimator;
        // the clock may have run ahead, and back
        let touch = Touch { time_s: self.touch.time_s.max(estimator.time_s()), ..self.touch };
        after.absorb(&touch, &self.predicted, &self.sensitivities, &readings).ok()?;
        Some(after)
    }
}

fn variance_left<const N: usize>(estimator: &Estimator<f64, N>, settings: &EstimatorSettings<N>) -> Vec<f64> {
    let own = estimator.values().into_iter().zip(&settings.amplitudes);
    own.map(|((_, deviation), own)| (deviation / own.deviation).powi(2)).collect()
}

/// The probings that take away most of the sum of the amplitudes' variances, as shares of what they were before anything was read,
/// each after those before it; fewer than were asked for where no more are worth it.
pub(super) fn propose<const N: usize>(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    (estimator, settings): (&Estimator<f64, N>, &EstimatorSettings<N>),
    ask: &Ask,
    log: &[Entry],
) -> Vec<Proposal> {
    let is_translation =
        |reading: &&TipReading<f64>| reading.direction.fixed_rows::<3>(3).iter().all(|part| *part == 0.0);
    let sensor = log.iter().rev().flat_map(|entry| &entry.readings).find(is_translation);
    let Some(deviation) = sensor.map(|reading| reading.deviation) else { return Vec::new() };
    let candidates = candidates(machine, table, settings, &ask.pose_box, log);
    let mut estimator = *estimator;
    let mut proposals = Vec::new();
    while proposals.len() < ask.count {
        let unknown = |estimator: &Estimator<f64, N>| variance_left(estimator, settings).iter().sum::<f64>();
        let after = candidates.iter().filter_map(|candidate| {
            let after = candidate.after(&estimator, deviation)?;
            Some((unknown(&after), candidate, after))
        });
        let Some((left, best, after)) = after.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if !(unknown(&estimator) - left > WORTH * N as f64) {
            break;
        }
        estimator = after;
        proposals.push(Proposal {
            pose: best.touch.pose,
            tip_m: best.touch.tip_m,
            force_n: best.touch.wrench.force_n,
            deviation_m: deviation,
            variance_left: variance_left(&estimator, settings),
        });
    }
    proposals
}

//! How far the table of a diagnosis may be off (`docs/estimation.md`): what its estimates and its correction may be off by, to first
//! order, and more where readings that had no part in a model show more.

use std::ops::Range;

use nalgebra::{DMatrix, Matrix6, SMatrix, SVector, SymmetricEigen, Vector3, Vector6};
use pkm_core::correction::{UNCERTAINTY_COLUMNS, UNCERTAINTY_ENTRIES, spread_terms};
use pkm_core::{K95, Machine, Pose, StiffnessFactor, Wrench};
use pkm_diagnosis::{Fit, Noise, Observations};

use super::compare::Fitted;
use super::model::Model;
use super::write::LEVELS;
use crate::files::readings::{CHANNELS, GAUGE, Readings};
use crate::files::table_numbers::UncertaintyNumbers;
use crate::fit::uncertainty::{Entries, Terms, entries, lower_triangle, spread_of};
use crate::pose::{PoseBox, file_units, pose_of};

/// Width of the grid of poses at which the errors are worked out, over the box of the readings: how they grow beyond it is known too.
const GRID_WIDTH_RATIO: f64 = 1.4;
/// Step of the derivatives, in standard deviations of what is estimated.
const STEP_SD: f64 = 0.1;
/// Factor of the estimates' variance, since the world has other formulas than the model that was found.
const OTHER_FORMULAS_FACTOR: f64 = 1.5;
/// What is added to this factor for each noise variance by which the readings surely miss the model, of each unknown: what misses is no
/// noise, and draws the estimates along.
const MISFIT_FACTOR: f64 = 6.0;
/// Least standard deviation of a tip's motion along each axis, as a share of what the load moves it by: two models that fit the same
/// readings differ elsewhere.
const MIN_DEFLECTION_SHARE: f64 = 0.002;
/// Greatest multiple of the variance that is looked for.
const MAX_VARIANCE_RATIO: f64 = 1e6;
/// Least deflection that an error is compared with, over the greatest under a load of its kind: by symmetry a moment may move the
/// tip nowhere.
const MIN_DEFLECTION_RATIO: f64 = 0.1;
/// Forces and moments among the loads.
const LOADS: [Range<usize>; 2] = [0..3, 3..6];
/// Translations of the tip under six loads.
const SEEN: usize = 18;

/// What entries of S make of the tip's translations, over the size of these.
type Seen = SVector<f64, SEEN>;

/// Readings with what models that had no part of them say.
pub(super) struct Unseen<'a> {
    pub(super) readings: &'a Readings,
    pub(super) observations: &'a Observations,
    pub(super) noise: &'a Noise,
    /// By condition.
    pub(super) said: &'a [[f64; CHANNELS]],
    /// What the readings that had a part miss the model by beyond what noise may bring, squared, in noise variances.
    pub(super) misfit: f64,
}

/// What is not known at a pose.
struct Example {
    /// Of the growth of the variance there.
    terms: Terms,
    /// Independent parts of S, one standard deviation each.
    parts: Vec<(Entries, Seen)>,
    /// What an S of the same variance in every direction, 1, makes of the tip: sum of variances.
    even: f64,
}

/// Of the model that a diagnosis ended with, with the tool's tip here in A-uvw; none where the machine has no stiffness nearby.
pub(super) fn of_table(
    model: &Model,
    fitted: &Fitted,
    extent: &PoseBox,
    tip_m: Vector3<f64>,
    unseen: &Unseen<'_>,
) -> Option<UncertaintyNumbers> {
    let unknowns = fitted.identified().unknowns.len().max(1) as f64;
    let wider = (OTHER_FORMULAS_FACTOR + MISFIT_FACTOR * unseen.misfit / unknowns).sqrt();
    let estimated = Estimated::new(model, fitted.identified())?;
    let correction = fitted.residual_table();
    let of_correction = correction.parts();
    let (middle, half) = (extent.middle(), extent.half_widths());
    let levels = || (0..LEVELS).map(|n| GRID_WIDTH_RATIO * (2.0 * n as f64 / (LEVELS - 1) as f64 - 1.0));
    let all = levels().flat_map(|t| levels().flat_map(move |s| levels().map(move |z| [t, s, z])));
    let examples = all.filter_map(|scaled| {
        let [theta, sigma, z0] = std::array::from_fn(|k| middle[k] + scaled[k] * half[k]);
        let pose = pose_of(theta, sigma, z0);
        let mut parts = estimated.errors(&pose)?;
        for part in of_correction.iter().flat_map(|parts| parts.column_iter()) {
            parts.push(correction.relative(part.as_slice(), &pose)?);
        }
        parts.iter_mut().for_each(|part| *part *= wider);
        Example::new(spread_terms(scaled), &parts, &estimated.factor(&pose)?, tip_m)
    });
    let examples: Vec<Example> = examples.collect();
    if examples.is_empty() {
        return None;
    }
    let mut numbers = covariance(&examples, MIN_DEFLECTION_SHARE.hypot(model.uncertainty.load_calibration));
    let excess = unseen.excess(&numbers, &estimated, (middle, half))?;
    numbers.spread.iter_mut().for_each(|s| *s *= excess);
    Some(numbers)
}

impl Example {
    /// Seen at the tip under a unit force or moment on it, one after the other.
    fn new(terms: Terms, parts: &[Matrix6<f64>], factor: &StiffnessFactor<f64>, tip_m: Vector3<f64>) -> Option<Self> {
        let lower = factor.lower();
        let at_tip = |n: usize| {
            lower.solve_lower_triangular(&Wrench::from_vector(Vector6::ith(n, 1.0)).moved_to_a(tip_m).to_vector())
        };
        let loads: Vec<Vector6<f64>> = (0..6).map(at_tip).collect::<Option<_>>()?;
        // what the tip moves by along an axis is what a unit force along it would do work on
        let axes = &loads[..3];
        let moved = |x: &Vector6<f64>| axes.iter().map(|y| y.dot(x).powi(2)).sum::<f64>().sqrt();
        let under = |kind: &'static Range<usize>| {
            let greatest = loads[kind.clone()].iter().map(moved).fold(0.0, f64::max);
            let scaled =
                move |x: &Vector6<f64>| x / moved(x).max(MIN_DEFLECTION_RATIO * greatest).max(f64::MIN_POSITIVE);
            loads[kind.clone()].iter().map(scaled)
        };
        let scaled = LOADS.iter().flat_map(under);
        let seen: Vec<(Vector6<f64>, Vector6<f64>)> = scaled.flat_map(|x| axes.iter().map(move |y| (*y, x))).collect();
        let of_part =
            |s: &Matrix6<f64>| (entries(s), Seen::from_iterator(seen.iter().map(|(y, x)| (y.transpose() * s * x)[0])));
        let even =
            |(y, x): &(Vector6<f64>, Vector6<f64>)| 0.5 * (y.norm_squared() * x.norm_squared() + y.dot(x).powi(2));
        Some(Self { terms, parts: parts.iter().map(of_part).collect(), even: seen.iter().map(even).sum() })
    }
}

/// Columns of what moves the tip most, the rest as it moves the tip in the mean, and how all of it grows; with a share of what the tip
/// moves by that is known from no part.
fn covariance(examples: &[Example], share: f64) -> UncertaintyNumbers {
    let unknown = SEEN as f64 * share.powi(2);
    let square = |e: &Example| (e.terms, unknown + e.parts.iter().map(|(_, seen)| seen.norm_squared()).sum::<f64>());
    let spread = spread_of(&examples.iter().map(square).collect::<Vec<(Terms, f64)>>());
    let mut seen = SMatrix::<f64, SEEN, SEEN>::zeros();
    let mut shared = SMatrix::<f64, UNCERTAINTY_ENTRIES, SEEN>::zeros();
    let mut unknown_over_variance = 0.0;
    for e in examples {
        let variance: f64 = e.terms.iter().zip(&spread).map(|(t, s)| t * s).sum();
        unknown_over_variance += unknown / variance / examples.len() as f64;
        for (s, z) in &e.parts {
            seen += z * z.transpose() / variance;
            shared += s * z.transpose() / variance;
        }
    }
    let eigen = SymmetricEigen::new(seen / examples.len() as f64);
    let mut order: Vec<usize> = (0..SEEN).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let (first, others) = order.split_at(UNCERTAINTY_COLUMNS);
    let mut columns = [[0.0; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS];
    for (column, n) in columns.iter_mut().zip(first) {
        let size = eigen.eigenvalues[*n];
        if size > 0.0 {
            let s = shared * eigen.eigenvectors.column(*n) / (size.sqrt() * examples.len() as f64);
            *column = lower_triangle(&s);
        }
    }
    let even = examples.iter().map(|e| e.even).sum::<f64>() / examples.len() as f64;
    let rest = unknown_over_variance + others.iter().map(|n| eigen.eigenvalues[*n].max(0.0)).sum::<f64>();
    UncertaintyNumbers { spread, rest: (rest / even).sqrt(), columns }
}

/// A machine, and how it changes with what of it is not known.
struct Estimated {
    machine: Machine<f64>,
    /// A step back and a step forward along each of the independent parts of the covariance.
    moved: Vec<[Machine<f64>; 2]>,
}

impl Estimated {
    fn new(model: &Model, fit: &Fit) -> Option<Self> {
        let machine = |x: &[f64]| Machine::<f64>::new(&model.state(&fit.unknowns, x, false).machine).ok();
        // with LLᵀ the inverse of the covariance, this is L⁻ᵀ
        let upper = fit.information.l().transpose();
        let parts = upper.solve_upper_triangular(&DMatrix::identity(fit.x.len(), fit.x.len()))?;
        let moved = parts.column_iter().map(|part| {
            let at = |step: f64| machine((&fit.x + part * step).as_slice());
            Some([at(-STEP_SD)?, at(STEP_SD)?])
        });
        Some(Self { machine: machine(fit.x.as_slice())?, moved: moved.collect::<Option<_>>()? })
    }

    fn factor(&self, pose: &Pose<f64>) -> Option<StiffnessFactor<f64>> {
        self.machine.stiffness(pose).ok()?.factor().ok()
    }

    /// Parts of S at a pose, one standard deviation each.
    fn errors(&self, pose: &Pose<f64>) -> Option<Vec<Matrix6<f64>>> {
        let own = self.factor(pose)?.lower();
        // with K = L Lᵀ of the machine and M Mᵀ of another, I + S = Lᵀ (M Mᵀ)⁻¹ L
        let relative = |machine: &Machine<f64>| {
            let ratio = machine.stiffness(pose).ok()?.factor().ok()?.lower().solve_lower_triangular(&own)?;
            Some(ratio.transpose() * ratio)
        };
        self.moved
            .iter()
            .map(|[back, forward]| Some((relative(forward)? - relative(back)?) / (2.0 * STEP_SD)))
            .collect()
    }
}

impl Unseen<'_> {
    /// What the variance has to be multiplied by, at least 1, so that with the noise it covers 95 % of the errors of translations.
    /// The axes of a gauge's direction count as independent.
    fn excess(
        &self,
        numbers: &UncertaintyNumbers,
        estimated: &Estimated,
        (middle, half): ([f64; 3], [f64; 3]),
    ) -> Option<f64> {
        let known = numbers.core().ok()?;
        let factors: Vec<_> = self.readings.poses.iter().map(|p| estimated.factor(&p.pose)).collect();
        let mut squares: Vec<[f64; 3]> = Vec::new();
        for (n, r) in self.readings.readings.iter().enumerate() {
            let c = &self.readings.conditions[r.condition];
            let at = file_units(&self.readings.poses[c.pose].pose);
            let scaled = std::array::from_fn(|k| (at[k] - middle[k]) / half[k]);
            let factor = factors[c.pose].as_ref()?;
            let [u, v, w] = known.of_tip(factor, scaled, &c.wrench, c.point_m.into()).ok()?.variance_m2.into();
            let along = c.gauge.map_or(0.0, |[a, b, c]| a * a * u + b * b * v + c * c * w);
            for (channel, variance) in [(0, u), (1, v), (2, w), (GAUGE, along)] {
                let Some(read) = r.observed[channel] else { continue };
                let off = read - self.said[r.condition][channel];
                squares.push([off * off, variance, self.noise.variance_of(self.observations, n, channel)]);
            }
        }
        let covers = |excess: f64| {
            let within = squares.iter().filter(|[off, model, noise]| *off <= K95 * K95 * (excess * model + noise));
            100 * within.count() >= 95 * squares.len()
        };
        if covers(1.0) {
            return Some(1.0);
        }
        let (mut low, mut high) = (0.0, MAX_VARIANCE_RATIO.ln());
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if covers(middle.exp()) { high = middle } else { low = middle }
        }
        Some(high.exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;
    use crate::files::machine::MachineFile;
    use crate::files::source::Source;

    const TIP_M: [f64; 3] = [0.05, -0.02, 0.3];

    /// Variances of the tip's translations under a load, summed over parts of S: a product of dense matrices, and no triangle.
    fn dense(parts: &[Matrix6<f64>], factor: &StiffnessFactor<f64>, load: &Wrench<f64>) -> Vector3<f64> {
        let [u, v, w] = TIP_M;
        let cross = nalgebra::Matrix3::new(0.0, -w, v, w, 0.0, -u, -v, u, 0.0);
        let mut of_tip = SMatrix::<f64, 3, 6>::identity();
        of_tip.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
        let inverse = factor.lower().try_inverse().unwrap();
        let moment = load.moment_nm + Vector3::from(TIP_M).cross(&load.force_n);
        let at_a = Vector6::from_iterator(load.force_n.iter().chain(moment.iter()).copied());
        let off = |s: &Matrix6<f64>| of_tip * inverse.transpose() * s * inverse * at_a;
        parts.iter().map(|s| off(s).map(|v| v * v)).sum()
    }

    fn some(rng: &mut fastrand::Rng) -> Matrix6<f64> {
        let half = Matrix6::from_fn(|_, _| rng.f64() - 0.5) * 1e-3;
        half + half.transpose()
    }

    /// Unit loads on the tip, each with what it moves that by, or a tenth of the most that one of its kind does.
    fn loads(factor: &StiffnessFactor<f64>) -> Vec<(Wrench<f64>, f64)> {
        let of_kind = |kind: std::ops::Range<usize>| {
            let loads = kind.map(|n| Wrench::from_vector(Vector6::ith(n, 1.0)));
            let moved_m = |load: &Wrench<f64>| {
                let moved = factor.deflection(&load.moved_to_a(TIP_M.into())).unwrap();
                moved.seen_at(TIP_M.into()).translation_m.norm()
            };
            let all: Vec<(Wrench<f64>, f64)> = loads.map(|load| (load, moved_m(&load))).collect();
            let greatest_m = all.iter().map(|(_, m)| *m).fold(0.0, f64::max);
            all.into_iter().map(move |(load, m)| (load, m.max(0.1 * greatest_m)))
        };
        of_kind(0..3).chain(of_kind(3..6)).collect()
    }

    fn factor() -> Result<StiffnessFactor<f64>> {
        let file = MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE))?;
        Ok(file.machine.stiffness(&pose_of(8.0, -5.0, 530.0)).unwrap().factor().unwrap())
    }

    const SCALED: [f64; 3] = [0.9, -0.8, 0.7];

    #[test]
    fn columns_and_rest_keep_what_the_tip_may_be_off_by() -> Result<()> {
        let factor = factor()?;
        let mut rng = fastrand::Rng::with_seed(5);
        for count in [1, 3, 4, 30] {
            let parts: Vec<Matrix6<f64>> = (0..count).map(|_| some(&mut rng)).collect();
            let examples = [Example::new(spread_terms(SCALED), &parts, &factor, TIP_M.into()).unwrap()];
            let known = covariance(&examples, 0.0).core()?;
            let (mut said, mut meant) = (0.0, 0.0);
            for (load, size_m) in loads(&factor) {
                let variance_m2 = known.of_tip(&factor, SCALED, &load, TIP_M.into()).unwrap().variance_m2;
                let dense_m2 = dense(&parts, &factor, &load);
                // four columns hold four parts as they are
                if count <= UNCERTAINTY_COLUMNS {
                    assert!((variance_m2 - dense_m2).norm() < 1e-9 * dense_m2.norm(), "{variance_m2} {dense_m2}");
                }
                said += variance_m2.sum() / size_m.powi(2);
                meant += dense_m2.sum() / size_m.powi(2);
            }
            assert!((said / meant - 1.0).abs() < 1e-9, "{count} parts: {said} for {meant}");
        }
        Ok(())
    }

    #[test]
    fn a_share_of_what_the_tip_moves_by_is_never_known() -> Result<()> {
        let factor = factor()?;
        let examples = [Example::new(spread_terms(SCALED), &[], &factor, TIP_M.into()).unwrap()];
        let known = covariance(&examples, 0.002).core()?;
        let relative = |(load, size_m): (Wrench<f64>, f64)| {
            known.of_tip(&factor, SCALED, &load, TIP_M.into()).unwrap().variance_m2.sum() / size_m.powi(2)
        };
        let said: f64 = loads(&factor).into_iter().map(relative).sum();
        // of six loads along three axes
        assert!((said / (18.0 * 0.002_f64.powi(2)) - 1.0).abs() < 1e-9, "{said}");
        Ok(())
    }
}

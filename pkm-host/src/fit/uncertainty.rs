//! How far a table of this kind is off at poses that it was not fitted on (`docs/estimation.md`).
//!
//! Each training pose is left out in turn, and so are all poses at each face of the box: the fit of the others extrapolates to
//! these, as a controller does beyond the box. Where a power passes through about all steps of a grid, no single pose shows what the table
//! does between them: there each step is left out as a whole. What the errors have in common is a covariance of the relative error S of the
//! compliance, and its growth away from the middle of the box.

use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, SVector, SymmetricEigen, Vector3, Vector6};
use pkm_core::correction::{
    FACTOR_ENTRIES, UNCERTAINTY_COLUMNS, UNCERTAINTY_ENTRIES, UNCERTAINTY_SPREAD, spread_terms,
};
use pkm_core::{K95, Stiffness, StiffnessFactor, Wrench};

use super::regression::{Regression, STEP, levels};
use crate::files::table_numbers::UncertaintyNumbers;

/// From here on a scaled variable is at a face of the box.
const FACE: f64 = 0.8;
/// Up to here it is away from them.
const INNER: f64 = 0.9;
/// Fewer poses than this away from the faces do not calibrate the variance there: then all do.
const MIN_INNER: usize = 8;
/// Iterations of the fit of the variance's growth: its likelihood no longer changes.
const ITERATIONS: usize = 2000;
/// Turns of the calibration of the whole and of its growth: each changes the other a little.
const CALIBRATIONS: usize = 20;
/// Least square of a relative error: what rounding leaves of an exact table.
const MIN_SQUARE: f64 = 1e-24;

/// Terms of the growth of the variance, and their coefficients.
pub(crate) type Terms = [f64; UNCERTAINTY_SPREAD];

/// A pose that was left out.
struct LeftOut {
    /// Whether it lay at a face all of which was left out.
    at_face: bool,
    /// Whether it lay inside the box of the others, away from its faces.
    is_inner: bool,
    /// Of the growth of the variance, in the box of the others.
    terms: Terms,
    /// S.
    error: Matrix6<f64>,
    /// Square of what the error is greater by in the whole box than in that of the others. A table of the second order lacks third
    /// powers, and a face that is left out narrows one of the variables: what has its square in it counts, between its third power
    /// and the first.
    larger: f64,
    /// Stiffness at A as the others say it, and as it is.
    stiffness: [StiffnessFactor<f64>; 2],
}

/// Training poses, as the fit has them.
pub(super) struct Training<'a> {
    /// θ, σ, Z0 of each pose.
    pub(super) variables: &'a [[f64; 3]],
    /// Exponents of the table's terms.
    pub(super) terms: &'a [[u8; 3]],
    /// Terms of the table at each pose.
    pub(super) design: &'a DMatrix<f64>,
    /// Terms that each entry of G uses.
    pub(super) used: &'a [Vec<bool>],
    /// Entries of G at each pose.
    pub(super) entries: &'a [[f64; FACTOR_ENTRIES]],
    /// K_p at each pose.
    pub(super) basic: &'a [StiffnessFactor<f64>],
    /// Where the tool's tip is in A-uvw.
    pub(super) tip_m: Vector3<f64>,
}

impl Training<'_> {
    /// What poses that are left out say of a table; none where too few could be left out.
    pub(super) fn uncertainty(&self) -> Option<UncertaintyNumbers> {
        let all = 0..self.entries.len();
        let mut left_out: Vec<LeftOut> = all.clone().flat_map(|one| self.errors_without(&[one], false)).collect();
        let (middle, half) = box_of(self.variables.iter())?;
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let at_face = |i: &usize| side * (self.variables[*i][axis] - middle[axis]) / half[axis] > FACE;
                left_out.extend(self.errors_without(&all.clone().filter(at_face).collect::<Vec<_>>(), true));
            }
            for step in self.blind_steps(axis) {
                let at_step = |i: &usize| (self.variables[*i][axis] - step).abs() <= 2.0 * half[axis] * STEP;
                left_out.extend(self.errors_without(&all.clone().filter(at_step).collect::<Vec<_>>(), false));
            }
        }
        if left_out.len() <= UNCERTAINTY_ENTRIES {
            return None;
        }
        let mut numbers = covariance(&left_out);
        self.calibrate(&left_out, &mut numbers)?;
        Some(numbers)
    }

    /// Steps of a variable between its outermost, where its powers pass through all steps or all but two.
    fn blind_steps(&self, axis: usize) -> Vec<f64> {
        let is_used = |j: &usize| self.used.iter().any(|used| used[*j]);
        let power = (0..self.terms.len()).filter(is_used).map(|j| usize::from(self.terms[j][axis])).max().unwrap_or(0);
        match levels(self.variables.iter().map(|v| v[axis])).as_slice() {
            [_, inner @ .., _] if power >= inner.len() => inner.to_vec(),
            _ => Vec::new(),
        }
    }

    /// Errors at some poses of a fit to the others, without the powers that pass through all steps which these have; none where the
    /// others do not determine it.
    fn errors_without(&self, some: &[usize], at_face: bool) -> Vec<LeftOut> {
        let kept: Vec<usize> = (0..self.entries.len()).filter(|i| !some.contains(i)).collect();
        let design = self.design.select_rows(&kept);
        let steps: [usize; 3] = std::array::from_fn(|k| levels(kept.iter().map(|i| self.variables[*i][k])).len());
        let is_determined = |j: usize| (0..3).all(|k| usize::from(self.terms[j][k]) < steps[k]);
        let coefficients: Option<Vec<DVector<f64>>> = (self.used.iter().enumerate())
            .map(|(entry, used)| {
                let values = DVector::from_iterator(kept.len(), kept.iter().map(|i| self.entries[*i][entry]));
                let used: Vec<bool> = used.iter().enumerate().map(|(j, used)| *used && is_determined(j)).collect();
                // as many poses as terms leave nothing to be seen
                (kept.len() > used.iter().filter(|used| **used).count()).then_some(())?;
                let fit = Regression::new(&design, &used, &values).ok()?;
                Some(DVector::from_vec(super::spread(&fit.coefficients, &used)))
            })
            .collect();
        let (Some(coefficients), Some((middle, half))) =
            (coefficients, box_of(kept.iter().map(|i| &self.variables[*i])))
        else {
            return Vec::new();
        };
        let Some((_, whole)) = box_of(self.variables.iter()) else { return Vec::new() };
        let larger = (0..3).map(|k| (whole[k] / half[k]).powi(4)).fold(1.0, f64::max);
        let error = |i: &usize| {
            let row = self.design.row(*i);
            let said: Vec<f64> = coefficients.iter().map(|c| (row * c)[0]).collect();
            // with G what was measured and P what was said, I + S = Pᵀ G⁻ᵀ G⁻¹ P
            let (found, said) = (triangle(&self.entries[*i]), triangle(&said));
            let ratio = found.solve_lower_triangular(&said)?;
            let stiffness = |g: Matrix6<f64>| {
                let half = self.basic[*i].lower() * g;
                Stiffness::from_lower(&(half * half.transpose())).factor().ok()
            };
            let at = self.variables[*i];
            let scaled: [f64; 3] = std::array::from_fn(|k| (at[k] - middle[k]) / half[k]);
            Some(LeftOut {
                at_face,
                is_inner: scaled.iter().all(|t| t.abs() < INNER),
                terms: spread_terms(scaled),
                larger,
                error: ratio.transpose() * ratio - Matrix6::identity(),
                stiffness: [stiffness(said)?, stiffness(found)?],
            })
        };
        some.iter().filter_map(error).collect()
    }

    /// Scales the variance so that the expanded uncertainty of the tip covers 95 % of its errors under a force or a moment: the whole
    /// by poses inside that were left out one by one, its growth by those at the faces.
    fn calibrate(&self, left_out: &[LeftOut], numbers: &mut UncertaintyNumbers) -> Option<()> {
        let unit =
            UncertaintyNumbers { spread: std::array::from_fn(|k| if k == 0 { 1.0 } else { 0.0 }), ..numbers.clone() }
                .core()
                .ok()?;
        // squared errors over the variances for v = 1
        let mut squares: [Vec<(Terms, f64)>; 2] = [Vec::new(), Vec::new()];
        let inner = |pose: &&LeftOut| pose.is_inner;
        let too_few = left_out.iter().filter(inner).count() < MIN_INNER;
        for pose in left_out.iter().filter(|pose| pose.is_inner || pose.at_face || too_few) {
            for n in 0..6 {
                let load = Wrench::from_vector(Vector6::ith(n, 1.0));
                let [said, found] = pose.stiffness.each_ref().map(|k| k.deflection(&load.moved_to_a(self.tip_m)));
                let off =
                    (found.ok()?.seen_at(self.tip_m).translation_m) - said.ok()?.seen_at(self.tip_m).translation_m;
                let known = unit.of_tip(&pose.stiffness[0], [0.0; 3], &load, self.tip_m).ok()?;
                let ratios =
                    off.iter().zip(&known.variance_m2).map(|(off, v)| (pose.terms, pose.larger * off * off / v));
                squares[usize::from(pose.at_face)].extend(ratios);
            }
        }
        let spread = &mut numbers.spread;
        for _ in 0..CALIBRATIONS {
            let whole = beyond(&squares[0], spread);
            spread.iter_mut().for_each(|s| *s *= whole);
            if squares[1].is_empty() {
                break;
            }
            let (mut low, mut high) = (-12.0_f64, 12.0_f64);
            let grown = |power: f64| std::array::from_fn(|k| if k == 0 { spread[0] } else { spread[k] * power.exp() });
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if beyond(&squares[1], &grown(middle)) > 1.0 { low = middle } else { high = middle }
            }
            *spread = grown(high);
        }
        Some(())
    }
}

/// 95th percentile of squared errors over their variance, over what it should be.
fn beyond(squares: &[(Terms, f64)], spread: &Terms) -> f64 {
    let mut all: Vec<f64> =
        squares.iter().map(|(terms, q)| q / terms.iter().zip(spread).map(|(t, s)| t * s).sum::<f64>()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() * 95 / 100).map_or(1.0, |q| q.max(MIN_SQUARE) / (K95 * K95))
}

/// Middle and half widths of some poses; none where one of the variables does not vary.
fn box_of<'a>(variables: impl Iterator<Item = &'a [f64; 3]> + Clone) -> Option<([f64; 3], [f64; 3])> {
    let end = |k: usize, pick: fn(f64, f64) -> f64| variables.clone().map(|v| v[k]).reduce(pick);
    let mut found = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let (least, most) = (end(k, f64::min)?, end(k, f64::max)?);
        found.0[k] = 0.5 * (least + most);
        found.1[k] = 0.5 * (most - least);
    }
    found.1.iter().all(|half| *half > 0.0).then_some(found)
}

/// The lower triangle of a matrix, row by row.
fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)))
}

/// Entries of a symmetric matrix, the norm of which is that of the matrix: what is off the diagonal counts twice.
pub(crate) type Entries = SVector<f64, UNCERTAINTY_ENTRIES>;

pub(crate) fn entries(s: &Matrix6<f64>) -> Entries {
    Entries::from_iterator(places().map(|(i, j)| s[(i, j)] * if i == j { 1.0 } else { std::f64::consts::SQRT_2 }))
}

/// The matrix of [`entries`], its lower triangle row by row.
pub(crate) fn lower_triangle(entries: &Entries) -> [f64; UNCERTAINTY_ENTRIES] {
    let mut lower = [0.0; UNCERTAINTY_ENTRIES];
    for ((to, from), (i, j)) in lower.iter_mut().zip(entries).zip(places()) {
        *to = from / if i == j { 1.0 } else { std::f64::consts::SQRT_2 };
    }
    lower
}

fn triangle(rows: &[f64]) -> Matrix6<f64> {
    let mut entries = rows.iter();
    let mut lower = Matrix6::zeros();
    for i in 0..6 {
        for j in 0..=i {
            lower[(i, j)] = entries.next().copied().unwrap_or(0.0);
        }
    }
    lower
}

/// Covariance of errors: columns of the greatest variance, and the mean of the other variances.
fn covariance(errors: &[LeftOut]) -> UncertaintyNumbers {
    let squares: Vec<(Terms, f64)> = errors.iter().map(|e| (e.terms, e.larger * e.error.norm_squared())).collect();
    let spread = spread_of(&squares);
    let variance = |e: &LeftOut| e.terms.iter().zip(&spread).map(|(t, s)| t * s).sum::<f64>();
    let mut sum = SMatrix::<f64, UNCERTAINTY_ENTRIES, UNCERTAINTY_ENTRIES>::zeros();
    for e in errors {
        let vector = entries(&e.error);
        sum += vector * vector.transpose() * (e.larger / (variance(e) * errors.len() as f64));
    }
    let eigen = SymmetricEigen::new(sum);
    let mut order: Vec<usize> = (0..UNCERTAINTY_ENTRIES).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let (first, others) = order.split_at(UNCERTAINTY_COLUMNS);
    let rest = others.iter().map(|i| eigen.eigenvalues[*i].max(0.0)).sum::<f64>() / others.len() as f64;
    let mut columns = [[0.0; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS];
    for (column, n) in columns.iter_mut().zip(first) {
        let size = (eigen.eigenvalues[*n] - rest).max(0.0).sqrt();
        *column = lower_triangle(&(eigen.eigenvectors.column(*n) * size));
    }
    UncertaintyNumbers { spread, rest: rest.sqrt(), columns }
}

/// Coefficients, none below 0, of the mean square of errors over their terms: the most likely ones if squares are exponentially
/// distributed, by multiplicative steps (Févotte and Idier, Neural Computation 23 (2011), 2421, with β = 0).
pub(crate) fn spread_of(squares: &[(Terms, f64)]) -> Terms {
    let mean = squares.iter().map(|(_, square)| square.max(MIN_SQUARE)).sum::<f64>() / squares.len() as f64;
    let mut spread = [mean; UNCERTAINTY_SPREAD];
    for _ in 0..ITERATIONS {
        let (mut up, mut down) = ([0.0; UNCERTAINTY_SPREAD], [0.0; UNCERTAINTY_SPREAD]);
        for (terms, square) in squares {
            let expected: f64 = terms.iter().zip(&spread).map(|(t, s)| t * s).sum();
            for k in 0..UNCERTAINTY_SPREAD {
                up[k] += terms[k] * square.max(MIN_SQUARE) / (expected * expected);
                down[k] += terms[k] / expected;
            }
        }
        for k in 0..UNCERTAINTY_SPREAD {
            spread[k] *= (up[k] / down[k]).sqrt();
        }
    }
    spread
}

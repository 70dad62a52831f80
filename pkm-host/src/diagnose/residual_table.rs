//! A correction table on what a model leaves unexplained, from deflections instead of stiffnesses.
//!
//! Below the tool the compliance becomes C = L⁻ᵀ (I + S) L⁻¹, K = L Lᵀ the model's, S symmetric with the terms of Eq. 11 in
//! its 21 entries. Deflections are linear in S, so that it follows from readings under any loads; how far S may go from 0 is
//! what makes the readings most likely.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, Vector6};
use pkm_core::correction::EQ_11;
use pkm_core::effects::Effects;
use pkm_core::{Basis, Deflection, Machine, MachineParameters, Pose, Stiffness, Wrench};

use pkm_diagnosis::{Problem, product};

use super::experiment::Experiment;
use crate::error::{Failure, Result};
use crate::files::readings::{CHANNELS, Condition};
use crate::pose::{PoseBox, core_units};

/// Standard deviations of the scaled coefficients that are tried.
const SPREADS: [f64; 7] = [1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3];

/// Entries of a symmetric 6×6.
const ENTRIES: usize = 21;

/// The correction S, or none.
#[derive(Clone)]
pub struct ResidualTable {
    machine: Machine<f64>,
    centre: [f64; 3],
    half_width: [f64; 3],
    coefficients: DVector<f64>,
    information: Option<Cholesky<f64, Dyn>>,
}

/// What sits below the tool alone.
fn below_tool(parameters: &MachineParameters) -> Option<Machine<f64>> {
    let effects: Effects = parameters.effects.below_tool();
    Machine::<f64>::new(&MachineParameters { effects, ..*parameters }).ok()
}

fn lower(machine: &Machine<f64>, pose: &Pose<f64>) -> Option<Matrix6<f64>> {
    let factor = machine.stiffness(pose).ok()?.factor().ok()?;
    Some(factor.lower())
}

impl ResidualTable {
    /// Fits S to the residuals of a model.
    pub fn fit(
        problem: &Problem<'_>,
        experiment: &Experiment<'_>,
        parameters: &MachineParameters,
        residuals: &DVector<f64>,
        extent: &PoseBox,
    ) -> Option<Self> {
        let mut this = Self {
            machine: below_tool(parameters)?,
            centre: core_units(extent.middle()),
            half_width: core_units(extent.half_widths()),
            coefficients: DVector::zeros(ENTRIES * EQ_11.len()),
            information: None,
        };
        let rows = this.rows(&experiment.poses, experiment.conditions)?;
        let mut design = DMatrix::zeros(residuals.len(), ENTRIES * EQ_11.len());
        for j in 0..design.ncols() {
            let mut column: Vec<f64> =
                problem.whitener.entries.iter().map(|e| rows[e.condition][(e.channel, j)]).collect();
            problem.whitener.whiten(&mut column);
            design.set_column(j, &DVector::from_vec(column));
        }
        let gram = product(&design, &design);
        let moment = design.tr_mul(residuals);
        let mut best: Option<(f64, DVector<f64>, Cholesky<f64, Dyn>)> = None;
        for spread in SPREADS {
            let information = (&gram + DMatrix::identity(gram.nrows(), gram.nrows()) / (spread * spread)).cholesky()?;
            let solution = information.solve(&moment);
            let evidence =
                solution.dot(&moment) - information.ln_determinant() - 2.0 * gram.nrows() as f64 * spread.ln();
            if best.as_ref().is_none_or(|b| evidence > b.0) {
                best = Some((evidence, solution, information));
            }
        }
        let (evidence, solution, information) = best?;
        // no table is as likely: then none
        if evidence > 0.0 {
            this.coefficients = solution;
            this.information = Some(information);
        }
        Some(this)
    }

    /// Derivatives of the deflection by the coefficients in each condition.
    fn rows(&self, poses: &[Pose<f64>], conditions: &[Condition]) -> Option<Vec<DMatrix<f64>>> {
        let basis = Basis::<f64>::new(self.centre, self.half_width, &EQ_11).ok()?;
        let mut factors = vec![None; poses.len()];
        conditions
            .iter()
            .map(|c| {
                let pose = &poses[c.pose];
                if factors[c.pose].is_none() {
                    factors[c.pose] = lower(&self.machine, pose);
                }
                let l = factors[c.pose]?;
                let w = at_a(&c.wrench, c.point_m);
                let y = l.solve_lower_triangular(&w)?;
                let upper = l.transpose();
                let terms = basis.monomials(pose);
                let mut rows = DMatrix::zeros(CHANNELS, ENTRIES * EQ_11.len());
                let mut entry = 0;
                for i in 0..6 {
                    for j in 0..=i {
                        let mut v = Vector6::zeros();
                        v[i] += y[j];
                        if i != j {
                            v[j] += y[i];
                        }
                        let d = c.read(seen_at(&upper.solve_upper_triangular(&v)?, c.point_m).into());
                        for (t, term) in terms.iter().take(EQ_11.len()).enumerate() {
                            for channel in 0..CHANNELS {
                                rows[(channel, entry * EQ_11.len() + t)] = d[channel] * term;
                            }
                        }
                        entry += 1;
                    }
                }
                Some(rows)
            })
            .collect()
    }

    /// What it adds to the deflection in each condition, m and rad.
    pub fn predict(&self, poses: &[Pose<f64>], conditions: &[Condition]) -> Option<Vec<[f64; CHANNELS]>> {
        if self.information.is_none() {
            return Some(vec![[0.0; CHANNELS]; conditions.len()]);
        }
        let rows = self.rows(poses, conditions)?;
        Some(
            rows.iter()
                .map(|r| (r * &self.coefficients).as_slice().try_into().unwrap_or([f64::NAN; CHANNELS]))
                .collect(),
        )
    }

    /// What the coefficients may be off by, one standard deviation of each independent part in a column; none without a correction.
    pub fn parts(&self) -> Option<DMatrix<f64>> {
        let size = self.coefficients.len();
        self.information.as_ref()?.l().transpose().solve_upper_triangular(&DMatrix::identity(size, size))
    }

    /// S of coefficients at a pose.
    pub fn relative(&self, coefficients: &[f64], pose: &Pose<f64>) -> Option<Matrix6<f64>> {
        let terms = Basis::<f64>::new(self.centre, self.half_width, &EQ_11).ok()?.monomials(pose);
        let mut entries =
            coefficients.chunks(EQ_11.len()).map(|c| c.iter().zip(terms).map(|(c, t)| c * t).sum::<f64>());
        let mut s = Matrix6::zeros();
        for i in 0..6 {
            for j in 0..=i {
                s[(i, j)] = entries.next()?;
                s[(j, i)] = s[(i, j)];
            }
        }
        Some(s)
    }

    /// The corrected stiffness below the tool at a pose.
    ///
    /// # Errors
    /// A correction that leaves no positive definite stiffness.
    pub fn stiffness(&self, pose: &Pose<f64>) -> Result<Stiffness<f64>> {
        let failed = || Failure::other("the residual correction table leaves no positive definite stiffness");
        let l = lower(&self.machine, pose).ok_or_else(failed)?;
        let s = self.relative(self.coefficients.as_slice(), pose).ok_or_else(failed)?;
        let k = l * (Matrix6::identity() + s).cholesky().ok_or_else(failed)?.inverse() * l.transpose();
        Ok(Stiffness::from_lower(&k))
    }
}

fn at_a(wrench: &Wrench<f64>, point_m: [f64; 3]) -> Vector6<f64> {
    wrench.moved_to_a(point_m.into()).to_vector()
}

fn seen_at(d: &Vector6<f64>, point_m: [f64; 3]) -> Vector6<f64> {
    Deflection::from_vector(*d).seen_at(point_m.into()).to_vector()
}

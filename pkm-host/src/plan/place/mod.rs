//! Where the workpiece should stand (paper, Section 6, Eqs. 15-16; `docs/theory.md`).

mod bound;
mod boxes;
mod certify;
mod cover;
mod cycle;
mod evolution;
mod front;
mod goal;
mod grid;
mod newton;
mod polish;
mod robust;
pub(crate) mod search;
mod targets;
mod taylor;
#[cfg(test)]
mod tests;
mod unreachable;
mod whitened;

use nalgebra::{Matrix3, Vector3};
use pkm_core::effects::Effects;
use pkm_core::{
    Configuration, CorrectionError, CorrectionTable, Domain, Scalar, Stiffness, Tool, ToolSolution, Wrench,
};

use crate::error::{Failure, Result};
use crate::files::job::{Job, Position, Series};
use crate::files::limits::JointLimits;
use crate::files::machine::MachineFile;
use crate::files::table_numbers::TableNumbers;
use crate::plan::reach::Reach;

use targets::Target;
use taylor::Taylor;

pub use certify::{Certificate, Limits};
pub use front::{Front, Point, Step};
pub use grid::Grid;
pub use robust::{Robust, Worst};
pub use search::{Method, Options, Placed, Placement, place};

/// Coefficients of a table, for each of its terms.
const ROWS: usize = 27;

/// What is to be small.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Objective {
    /// Eq. 16: Σ over holes of 1/Σ k_ii in SI, which adds N/m to N·m/rad.
    Paper,
    /// The greatest displacement of the tip under the series' wrench.
    TipWorst,
    /// The mean one.
    TipMean,
    /// The time that the joints take from hole to hole, from rest to rest, in the order of the series. Needs `--limits`.
    CycleTime,
}

impl Objective {
    /// On the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::TipWorst => "tip-worst",
            Self::TipMean => "tip-mean",
            Self::CycleTime => "cycle-time",
        }
    }

    /// Of [`value_in_unit`](Self::value_in_unit).
    pub fn unit(self) -> &'static str {
        match self {
            Self::Paper => "1/(N/m + N·m/rad)",
            Self::TipWorst | Self::TipMean => "µm",
            Self::CycleTime => "s",
        }
    }

    /// From SI.
    pub fn value_in_unit(self, value: f64) -> f64 {
        if self.is_of_tips() { value * 1e6 } else { value }
    }

    /// Whether it is about deflections.
    pub fn is_of_tips(self) -> bool {
        matches!(self, Self::TipWorst | Self::TipMean)
    }

    /// What a posture adds by itself, SI.
    pub(crate) fn cost(self, posture: &Posture) -> f64 {
        match self {
            Self::Paper => 1.0 / posture.k.iter().sum::<f64>(),
            // a model for these has deflections
            Self::TipWorst | Self::TipMean => posture.worst_m.unwrap_or(f64::INFINITY),
            // only the ways between them take time
            Self::CycleTime => 0.0,
        }
    }

    /// Of all holes, or of all ways to a hole.
    pub(crate) fn value(self, costs: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = costs.len() as f64;
        match self {
            Self::Paper | Self::CycleTime => costs.sum(),
            Self::TipWorst => costs.fold(0.0, f64::max),
            Self::TipMean => costs.sum::<f64>() / count,
        }
    }
}

/// How the machine reaches a hole.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Its five axes.
    pub solution: ToolSolution<f64>,
    /// k11…k66 at A in A-uvw, SI.
    pub k: [f64; 6],
    /// Of the tip under the series' wrench, m; none with a diagonal table, which has no deflections.
    pub deflection_m: Option<f64>,
    /// The greatest of all loads and stiffnesses that are stated; without uncertainty the same.
    worst_m: Option<f64>,
    /// The table is extrapolated here.
    pub outside_box: bool,
}

/// Why a hole is out of reach somewhere.
#[derive(Clone, Copy, Debug)]
enum Miss {
    /// No posture within travel and limits in home's working mode.
    Reach,
    /// There is one, and it lies outside of the table's box.
    Table,
    /// There is one, and the model has no stiffness or no deflection there.
    Stiffness,
}

/// All that a position is judged by.
pub struct PlacementModel<'a> {
    pub(crate) reach: Reach<'a>,
    pub(crate) table: Option<CorrectionTable<'a, f64>>,
    /// Of the table.
    numbers: Option<&'a TableNumbers>,
    /// Principal stiffnesses by the paper's form.
    diagonal: bool,
    pub(crate) job: &'a Job,
    pub(crate) extrapolate: bool,
    /// Of the joints, for cycle times.
    limits: Option<JointLimits>,
}

impl<'a> PlacementModel<'a> {
    /// `table`: with whether its diagonal form gives the principal stiffnesses.
    ///
    /// # Errors
    /// A wrist that is singular at home; for objectives that need deflections a table without factor form, and a series without load;
    /// for cycle times no limits, and a series of one hole.
    pub fn new(
        machine: &'a MachineFile,
        table: Option<(&'a TableNumbers, bool)>,
        job: &'a Job,
        objectives: &[Objective],
        extrapolate: bool,
        limits: Option<JointLimits>,
    ) -> Result<Self> {
        let core = table.map(|(numbers, _)| numbers.table()).transpose()?;
        if let Some(table) = &core
            && !table.has_factor_form()
            && objectives.iter().any(|o| o.is_of_tips())
        {
            return Err(Failure::input(
                "the table has no factor form, which deflections need: fit it on all 21 columns, or give --objective paper",
            )
            .at_column("factor"));
        }
        let idle = |s: &&Series| s.wrench == Wrench::ZERO;
        if let Some(series) = job.series.iter().find(idle).filter(|_| objectives.iter().any(|o| o.is_of_tips())) {
            let message = "without a load no tip moves: give the cutting load, or --objective paper";
            return Err(Failure::input(message)
                .in_file(&job.source.name)
                .at_column(format!("series.{}.wrench", series.name)));
        }
        if objectives.contains(&Objective::CycleTime) {
            cycle::possible(job, limits.as_ref())?;
        }
        Ok(Self {
            reach: Reach::new(machine)?,
            table: core,
            numbers: table.map(|(numbers, _)| numbers),
            diagonal: table.is_some_and(|(_, diagonal)| diagonal),
            job,
            extrapolate,
            limits,
        })
    }

    /// Room for the table's coefficients over cells.
    fn store<const N: usize>(&self) -> Vec<Taylor<N>> {
        vec![Taylor::ZERO; self.numbers.map_or(0, |numbers| ROWS * numbers.terms.len())]
    }

    /// What keeps branch and bound from proving anything, and what to do: postures must be within a table's box, since near the end
    /// of travel and near singularities bounds hardly close; positions of the cross slide must follow from β1 and β2, so it must not
    /// run along |AB|, and deflections from the load without iteration, which preloaded limbs take.
    pub fn why_not_certified(&self) -> Option<&'static str> {
        let preloaded = self.reach.file.parameters.effects.preload_limbs();
        let reasons = [
            (self.table.is_none(), "it is proved inside a table's box: give --table, coefficients.json of fit"),
            (self.extrapolate, "it is proved inside the table's box: leave --allow-extrapolation out"),
            (
                self.job.base_in_world.rotation[(2, 2)].abs() <= 0.5,
                "the job's cross slide moves along z of the machine: give --method grid",
            ),
            (preloaded, "the machine file has the effect preload, which takes iterations: give --method grid"),
        ];
        reasons.into_iter().find_map(|(is, why)| is.then_some(why))
    }

    /// Why the worst case of what is not sure is not computed, and what to do: deflections must be linear in the load.
    pub fn why_not_robust(&self) -> Option<&'static str> {
        let sure = self.reach.file.parameters.effects == Effects::NONE;
        let factor = self.table.as_ref().is_some_and(|table| table.has_factor_form()) && !self.diagonal;
        let reasons = [
            (
                !sure,
                "the machine file has effects, under which deflections need not follow the load: leave `robust` out",
            ),
            (!factor, "it needs the table's factor form: fit it on all 21 columns"),
        ];
        reasons.into_iter().find_map(|(is, why)| is.then_some(why))
    }

    fn tool(&self, target: &Target<'_>, position: &Position) -> Tool<f64> {
        let table = self.job.table_in_base(&target.seen_from(position));
        let tip = table.origin_m + table.rotation * target.hole.tip_m;
        Tool { tip_m: tip, axis: table.rotation * target.hole.axis }
    }

    fn judged(&self, solution: ToolSolution<f64>, target: &Target<'_>) -> std::result::Result<Posture, Miss> {
        let pose = &solution.configuration.pose;
        let domain = self.table.as_ref().map(|table| table.domain(pose));
        let outside_box = domain == Some(Domain::Outside);
        if outside_box && !self.extrapolate {
            return Err(Miss::Table);
        }
        let stiffness = || -> std::result::Result<Stiffness<f64>, CorrectionError> {
            let machine = self.reach.five.machine;
            Ok(match &self.table {
                None => machine.stiffness(pose)?,
                Some(table) if self.diagonal => table.diagonal_form(machine, pose)?.factor.stiffness(),
                Some(table) => table.factor_form(machine, pose)?.factor.stiffness(),
            })
        };
        let k = stiffness().map_err(|_| Miss::Stiffness)?.principal().into();
        // a diagonal table alone has no deflections, and nobody asked for any
        let factor = self.table.as_ref().filter(|table| table.has_factor_form());
        let moved = |wrench: &Wrench<f64>| {
            let moved = self.reach.five.deflection(factor, &solution.configuration, wrench);
            moved.map(|moved| moved.translation_m).map_err(|_| Miss::Stiffness)
        };
        let size = |moved: Vector3<f64>| moved.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (mut deflection_m, mut worst_m) = (None, None);
        if self.table.is_none() || factor.is_some() {
            let nominal = size(moved(target.wrench)?);
            let mut most = nominal;
            if !target.forces_n.is_empty() {
                let mut yields = Matrix3::zeros();
                for i in 0..3 {
                    yields
                        .set_column(i, &moved(&Wrench { force_n: Vector3::ith(i, 1.0), moment_nm: Vector3::zeros() })?);
                }
                let by_moment = moved(&Wrench { force_n: Vector3::zeros(), ..*target.wrench })?;
                most = target.forces_n.iter().map(|force| size(yields * force + by_moment)).fold(0.0, f64::max);
            }
            (deflection_m, worst_m) = (Some(nominal), Some(target.softer * most));
        }
        Ok(Posture { solution, k, deflection_m, worst_m, outside_box })
    }

    /// Every posture that reaches a hole in home's working mode.
    fn postures(&self, target: &Target<'_>, position: &Position) -> std::result::Result<Vec<Posture>, Miss> {
        let mut miss = Miss::Reach;
        let mut found = Vec::new();
        for solution in self.reach.in_working_mode(&self.tool(target, position)) {
            match self.judged(solution, target) {
                Ok(posture) => found.push(posture),
                Err(e) => miss = e,
            }
        }
        if found.is_empty() { Err(miss) } else { Ok(found) }
    }

    /// The posture that Newton's steps find from where the machine stood last.
    fn near(&self, target: &Target<'_>, position: &Position, near: &mut Configuration<f64>) -> Option<Posture> {
        let solution = self.reach.five.inverse(&self.tool(target, position), near).ok()?;
        let posture = self.judged(solution, target).ok()?;
        *near = posture.solution.configuration;
        Some(posture)
    }
}

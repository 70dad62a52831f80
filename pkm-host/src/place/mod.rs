//! Where the workpiece should stand (paper, Section 6, Eqs. 15-16; spec: model.md 4).

pub mod job;
mod report;
mod search;

use pkm_core::{
    Configuration, CorrectionError, CorrectionTable, Domain, FiveAxis, Hold, Stiffness, Tool, ToolError, Wrench,
    WristParameters,
};

use crate::error::{Failure, Result};
use crate::holds::holds;
use crate::machine_file::MachineFile;
use crate::table_file::TableNumbers;
use job::{Hole, Job};

pub use report::{document, html, text};
pub use search::{Grid, Method, Options, Placed, Placement, place};

/// What is to be small.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Objective {
    /// Eq. 16: Σ over holes of 1/Σ k_ii in SI, which adds N/m to N·m/rad.
    Paper,
    /// The greatest displacement of the tip under the series' wrench.
    TipWorst,
    /// The mean one.
    TipMean,
}

impl Objective {
    /// On the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::TipWorst => "tip-worst",
            Self::TipMean => "tip-mean",
        }
    }

    /// Of [`value_in_unit`](Self::value_in_unit).
    pub fn unit(self) -> &'static str {
        match self {
            Self::Paper => "1/(N/m + N·m/rad)",
            Self::TipWorst | Self::TipMean => "µm",
        }
    }

    /// From SI.
    pub fn value_in_unit(self, value: f64) -> f64 {
        if self == Self::Paper { value } else { value * 1e6 }
    }

    /// What a posture adds, SI.
    fn cost(self, posture: &Posture) -> f64 {
        match self {
            Self::Paper => 1.0 / posture.k.iter().sum::<f64>(),
            Self::TipWorst | Self::TipMean => posture.deflection_m,
        }
    }

    /// Of all holes.
    fn value(self, costs: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = costs.len() as f64;
        match self {
            Self::Paper => costs.sum(),
            Self::TipWorst => costs.fold(0.0, f64::max),
            Self::TipMean => costs.sum::<f64>() / count,
        }
    }
}

/// How the machine reaches a hole.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Its five axes.
    pub hold: Hold<f64>,
    /// k11…k66 at A in A-uvw, SI.
    pub k: [f64; 6],
    /// Of the tip under the series' wrench, m.
    pub deflection_m: f64,
    /// The table is extrapolated here.
    pub outside_box: bool,
}

/// Why a hole is out of reach somewhere.
#[derive(Clone, Copy, Debug)]
enum Miss {
    /// No posture within travel and limits on the home side.
    Reach,
    /// There is one, and the table does not hold there.
    Table,
}

/// All that a position is judged by.
pub struct Bench<'a> {
    machine: &'a MachineFile,
    five: FiveAxis<'a, f64>,
    wrist: &'a WristParameters,
    table: Option<CorrectionTable<'a, f64>>,
    /// Principal stiffnesses by the paper's form.
    diagonal: bool,
    job: &'a Job,
    extrapolate: bool,
}

impl<'a> Bench<'a> {
    /// `table`: with whether its diagonal form gives the principal stiffnesses.
    ///
    /// # Errors
    /// A wrist that is singular at home; a table without factor form for objectives that need deflections.
    pub fn new(
        machine: &'a MachineFile,
        table: Option<(&'a TableNumbers, bool)>,
        job: &'a Job,
        objectives: &[Objective],
        extrapolate: bool,
    ) -> Result<Self> {
        let core = table.map(|(numbers, _)| numbers.table()).transpose()?;
        if let Some(table) = &core
            && !table.has_factor_form()
            && objectives.iter().any(|o| *o != Objective::Paper)
        {
            return Err(Failure::input(
                "the table has no factor form, which deflections need: fit it on all 21 columns, or give --objective paper",
            ));
        }
        Ok(Self {
            machine,
            five: machine.five_axis()?,
            wrist: &machine.wrist_parameters,
            table: core,
            diagonal: table.is_some_and(|(_, diagonal)| diagonal),
            job,
            extrapolate,
        })
    }

    fn tool(&self, hole: &Hole, position: [f64; 3]) -> Tool<f64> {
        let table = self.job.table_in_base(position);
        let tip = table.origin_m + table.rotation * hole.tip_m;
        Tool { tip_m: tip.into(), axis: (table.rotation * hole.axis).into() }
    }

    fn home(&self) -> Configuration<f64> {
        let pose = pkm_core::Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: self.wrist.home_z0_m };
        Configuration { pose, beta_rad: [0.0; 2] }
    }

    fn judged(&self, hold: Hold<f64>, wrench: &Wrench<f64>) -> std::result::Result<Posture, Miss> {
        let pose = &hold.configuration.pose;
        let domain = self.table.as_ref().map(|table| table.domain(pose));
        let outside_box = domain == Some(Domain::Outside);
        if outside_box && !self.extrapolate {
            return Err(Miss::Table);
        }
        let stiffness = || -> std::result::Result<Stiffness<f64>, CorrectionError> {
            let machine = self.five.machine;
            Ok(match &self.table {
                None => machine.stiffness(pose)?,
                Some(table) if self.diagonal => table.diagonal_form(machine, pose)?.factor.stiffness(),
                Some(table) => table.factor_form(machine, pose)?.factor.stiffness(),
            })
        };
        let k = stiffness().map_err(|_| Miss::Table)?.principal();
        // a diagonal table alone has no deflections, and nobody asked for any
        let factor = self.table.as_ref().filter(|table| table.has_factor_form());
        let deflection_m = if self.table.is_some() && factor.is_none() {
            f64::NAN
        } else {
            let d = self.five.deflection(factor, &hold.configuration, wrench).map_err(|_| Miss::Table)?;
            d.translation_m.iter().map(|v| v * v).sum::<f64>().sqrt()
        };
        Ok(Posture { hold, k, deflection_m, outside_box })
    }

    /// Every posture that reaches a tool on the home side.
    fn postures(&self, tool: &Tool<f64>, wrench: &Wrench<f64>) -> std::result::Result<Vec<Posture>, Miss> {
        let mut miss = Miss::Reach;
        let mut found = Vec::new();
        for hold in holds(&self.five, self.wrist, tool) {
            if hold.home_share >= self.wrist.singularity_margin {
                match self.judged(hold, wrench) {
                    Ok(posture) => found.push(posture),
                    Err(e) => miss = e,
                }
            }
        }
        if found.is_empty() { Err(miss) } else { Ok(found) }
    }

    /// The same where there is one at the most, from where the machine stood last.
    fn only(
        &self,
        tool: &Tool<f64>,
        wrench: &Wrench<f64>,
        near: &mut Configuration<f64>,
    ) -> std::result::Result<Vec<Posture>, Miss> {
        let found = match self.five.inverse(tool, near) {
            Err(ToolError::Singular | ToolError::Unreachable) => self.five.search(tool, &self.home()),
            done => done,
        };
        match found {
            Ok(hold) => {
                *near = hold.configuration;
                Ok(vec![self.judged(hold, wrench)?])
            }
            Err(_) => self.postures(tool, wrench),
        }
    }
}

/// Where a machine with endless screws and free wrist joints would have to go: what is missing to reach a tool.
struct Shortfall<'a> {
    bench: &'a Bench<'a>,
    machine: pkm_core::Machine<f64>,
    wrist: pkm_core::Wrist<f64>,
}

impl<'a> Shortfall<'a> {
    fn new(bench: &'a Bench<'a>) -> Option<Self> {
        let travel = pkm_core::machine::Travel { min_m: [1e-9; 3], max_m: [1e9; 3] };
        let parameters = pkm_core::MachineParameters { travel, ..bench.machine.parameters };
        let pi = std::f64::consts::PI;
        let wrist = WristParameters { min_rad: [-pi; 2], max_rad: [pi; 2], ..*bench.wrist };
        Some(Self {
            bench,
            machine: pkm_core::Machine::<f64>::new(&parameters).ok()?,
            wrist: pkm_core::Wrist::<f64>::new(&wrist).ok()?,
        })
    }

    /// How far a tool is from reach, as a share of the range that is passed, and in words.
    fn of(&self, tool: &Tool<f64>) -> Option<(f64, String)> {
        let five = FiveAxis { machine: &self.machine, wrist: &self.wrist };
        let hold = five.search(tool, &self.bench.home()).ok()?;
        let (travel, w) = (&self.bench.machine.parameters.travel, self.bench.wrist);
        let mut worst: (f64, String) = (0.0, String::new());
        let mut count = |what: String, value: f64, [low, high]: [f64; 2], scale: f64, unit: &str| {
            let beyond = (low - value).max(value - high);
            if beyond / (high - low) > worst.0 {
                worst = (beyond / (high - low), format!("{what} {:.1} {unit} beyond its limit", beyond * scale));
            }
        };
        for i in 0..3 {
            let limits = [travel.min_m[i], travel.max_m[i]];
            count(format!("the screw of limb {}", i + 1), hold.joints.lengths.q_m[i], limits, 1e3, "mm");
        }
        for i in 0..2 {
            let limits = [w.min_rad[i], w.max_rad[i]];
            count(format!("wrist joint {}", i + 1), hold.joints.beta_rad[i], limits, 180.0 / std::f64::consts::PI, "°");
        }
        Some(worst)
    }
}

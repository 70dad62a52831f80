//! Holding a tool: which of the ways is taken, and by how much there is none.

use nalgebra::Vector2;
use pkm_core::{
    Configuration, FiveAxis, JointValues, KinematicsError, Machine, Pose, Tool, ToolError, ToolSolution, Wrist,
    WristParameters,
};

use crate::error::{Failure, Result, tool_status};
use crate::files::machine::MachineFile;
use crate::files::path::{Place, Toward, unit};
use crate::plan::inverse_all::inverse_all;
use crate::pose::tidy;

/// A machine with its wrist, and the same without limits: it says how far beyond them a tool lies.
pub struct Reach<'a> {
    /// The machine's file.
    pub file: &'a MachineFile,
    /// The machine as it is.
    pub five: FiveAxis<'a, f64>,
    machine: Machine<f64>,
    wrist: Wrist<f64>,
    wrist_parameters: WristParameters,
}

impl<'a> Reach<'a> {
    /// Of a machine file.
    ///
    /// # Errors
    /// A wrist that is singular at home.
    pub fn new(file: &'a MachineFile) -> Result<Self> {
        let failed = |e: String| Failure::input(e).in_file(&file.source.name);
        let pi = std::f64::consts::PI;
        let wrist_parameters =
            WristParameters { min_rad: [-pi; 2], max_rad: [pi; 2], singularity_margin: 0.0, ..file.wrist_parameters };
        Ok(Self {
            five: file.five_axis()?,
            machine: file.without_travel().ok_or_else(|| failed("no machine without travel".to_owned()))?,
            wrist: Wrist::<f64>::new(&wrist_parameters).map_err(|e| failed(e.to_string()))?,
            wrist_parameters,
            file,
        })
    }

    /// The same without travel, limits and margin.
    pub fn unlimited(&self) -> FiveAxis<'_, f64> {
        FiveAxis { machine: &self.machine, wrist: &self.wrist }
    }

    /// The zero pose: θ = σ = β1 = β2 = 0, Z0 in the middle of the box.
    pub fn home(&self) -> Configuration<f64> {
        let z0_m = self.file.wrist_parameters.home_z0_m;
        Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m }, beta_rad: Vector2::zeros() }
    }

    /// Least normalised Jacobian determinant, as the machine file has it.
    pub(crate) fn margin(&self) -> f64 {
        self.file.wrist_parameters.singularity_margin
    }

    /// How far two configurations are apart: angles in rad, Z0 as a share of home's.
    fn apart(&self, a: &Configuration<f64>, b: &Configuration<f64>) -> f64 {
        let all = |c: &Configuration<f64>| {
            let z0 = c.pose.z0_m / self.file.wrist_parameters.home_z0_m;
            [c.pose.theta_rad, c.pose.sigma_rad, z0, c.beta_rad.x, c.beta_rad.y]
        };
        all(a).iter().zip(all(b)).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }

    /// Every inverse-kinematics solution.
    fn all(&self, tool: &Tool<f64>) -> Vec<ToolSolution<f64>> {
        inverse_all(&self.five, &self.file.wrist_parameters, tool)
    }

    /// Every inverse-kinematics solution in home's working mode.
    pub fn in_working_mode(&self, tool: &Tool<f64>) -> impl Iterator<Item = ToolSolution<f64>> {
        self.all(tool).into_iter().filter(|solution| solution.normalised_determinant >= self.margin())
    }

    /// Every inverse-kinematics solution, the nearest first.
    pub(crate) fn ways(&self, tool: &Tool<f64>, near: &Configuration<f64>) -> Vec<ToolSolution<f64>> {
        let mut ways = self.all(tool);
        ways.sort_by(|a, b| self.apart(&a.configuration, near).total_cmp(&self.apart(&b.configuration, near)));
        ways
    }

    /// The inverse-kinematics solution nearest to a configuration, in home's working mode.
    ///
    /// # Errors
    /// Refused, with the amount: see [`refusal`](Self::refusal).
    pub fn nearest(&self, tool: &Tool<f64>, near: &Configuration<f64>) -> Result<ToolSolution<f64>> {
        self.chosen(&self.ways(tool, near), tool)
    }

    pub(crate) fn chosen(&self, ways: &[ToolSolution<f64>], tool: &Tool<f64>) -> Result<ToolSolution<f64>> {
        if let Some(solution) = ways.iter().find(|solution| solution.normalised_determinant >= self.margin()) {
            return Ok(*solution);
        }
        let best = |ways: &[ToolSolution<f64>]| {
            ways.iter().map(|solution| solution.normalised_determinant).fold(f64::NEG_INFINITY, f64::max)
        };
        let singular = |share: f64| {
            let margin = self.margin();
            // rounded down, so that what is just below the margin does not read as if it were on it
            let share = (share * 1e4).floor() / 1e4;
            let message = format!(
                "only in the opposite working mode or too near a singularity: normalised determinant {share:.4}, at least \
                 {margin} is required (wrist.singularity_margin): turn the axis or move the tip"
            );
            Err(Failure::refused("singular", message))
        };
        if !ways.is_empty() {
            return singular(best(ways));
        }
        let beyond = inverse_all(&self.unlimited(), &self.wrist_parameters, tool);
        let in_working_mode = beyond.iter().filter(|solution| solution.normalised_determinant >= self.margin());
        let least = in_working_mode.map(|solution| self.excess(&solution.joints)).min_by(|a, b| a.0.total_cmp(&b.0));
        let hint = || {
            let tool = self.farthest(tool);
            tool.map_or(String::new(), |t| {
                format!("; on the straight way from home's tool it gets as far as {}", shown(&t))
            })
        };
        match least {
            Some((_, message)) => Err(Failure::refused("out_of_travel", message + &hint())),
            None if !beyond.is_empty() => singular(best(&beyond)),
            None => Err(Failure::refused(
                "unreachable",
                format!("no configuration of the five axes reaches this tool{}", hint()),
            )),
        }
    }

    /// How far a tool is beyond travel and limits: a measure, and in words. `None` where it is out of reach whatever they are.
    pub fn shortfall(&self, tool: &Tool<f64>) -> Option<(f64, String)> {
        let solution = self.unlimited().search(tool, &self.home()).ok()?;
        Some(self.excess(&solution.joints))
    }

    /// How far joint values are beyond the limits: a measure, and in words.
    pub(crate) fn excess(&self, joints: &JointValues<f64>) -> (f64, String) {
        let (mut sum, mut words) = (0.0, Vec::new());
        let travel = &self.file.parameters.travel;
        for (i, q) in joints.lengths.q_m.iter().enumerate() {
            let by = (travel.min_m[i] - q).max(q - travel.max_m[i]);
            if by > 0.0 {
                sum += by / self.file.wrist_parameters.home_z0_m;
                let length = self.file.travel_of(i as u8 + 1, &joints.lengths);
                words.push(format!(
                    "the screw of limb {} would be {:.3} mm beyond its travel: {length}",
                    i + 1,
                    by * 1e3
                ));
            }
        }
        let wrist = &self.file.wrist_parameters;
        for (i, &beta) in joints.beta_rad.iter().enumerate() {
            let by = (wrist.min_rad[i] - beta).max(beta - wrist.max_rad[i]);
            if by > 0.0 {
                sum += by;
                let [beta, by, low, high] =
                    [beta, by, wrist.min_rad[i], wrist.max_rad[i]].map(|rad: f64| tidy(rad.to_degrees()));
                let n = i + 1;
                words.push(format!("β{n} would be {by:.3}° beyond its limits: {beta:.3}°, limits {low} to {high}°"));
            }
        }
        (sum, words.join("; "))
    }

    /// As far as the machine gets on the straight way from home's tool to another.
    fn farthest(&self, tool: &Tool<f64>) -> Option<Tool<f64>> {
        let mut near = self.home();
        let home = self.five.tool(&near).ok()?;
        let place = |tool: &Tool<f64>| Place { tip_m: tool.tip_m.into(), toward: Toward::Axis(tool.axis.into()) };
        let (mut share, mut step) = (0.0, 1.0 / 64.0);
        while step > 1e-6 && share < 1.0 {
            match self.stand(&place(&home).between(&place(tool), share + step), &near) {
                Ok(solution) => (near, share) = (solution.configuration, share + step),
                Err(_) => step *= 0.5,
            }
        }
        self.five.tool(&near).ok()
    }

    /// Why the core refuses, with the amount: a status and a message. `there` is where the machine would stand
    /// [without limits](Self::unlimited), if anywhere.
    pub fn refusal(&self, error: ToolError, there: Option<&ToolSolution<f64>>) -> (&'static str, String) {
        let message = match (error, there) {
            (
                ToolError::WristLimit { .. } | ToolError::Kinematics(KinematicsError::OutOfTravel { .. }),
                Some(solution),
            ) => match self.excess(&solution.joints) {
                // without limits the iteration may end elsewhere
                (_, words) if words.is_empty() => error.to_string(),
                (_, words) => words,
            },
            (ToolError::Singular, there) => {
                let share = there.map_or("it would come to the opposite working mode".to_owned(), |solution| {
                    format!("the normalised determinant would be {:.4}", solution.normalised_determinant)
                });
                format!(
                    "it crosses the singularity locus of the five axes or comes too near: {share}, at least {} is required \
                     (wrist.singularity_margin): turn the axis or move the tip",
                    self.margin()
                )
            }
            (error, _) => error.to_string(),
        };
        (tool_status(error), message)
    }

    /// The configuration in a place, next to `near` where there are several.
    ///
    /// # Errors
    /// Those of [`FiveAxis::inverse`] and [`FiveAxis::inverse_at`].
    pub fn stand(&self, place: &Place, near: &Configuration<f64>) -> std::result::Result<ToolSolution<f64>, ToolError> {
        stood(&self.five, place, near)
    }

    /// Where the machine stands for a point of a path: where a path begins with a tool axis, the nearest of all configurations.
    ///
    /// # Errors
    /// Refused, with the amount: see [`refusal`](Self::refusal).
    pub fn along_path(&self, place: &Place, near: &Configuration<f64>, is_first: bool) -> Result<ToolSolution<f64>> {
        if let Some(axis) = place.toward.axis().filter(|_| is_first) {
            return self.nearest(&Tool { tip_m: place.tip_m.into(), axis: axis.into() }, near);
        }
        self.stand(place, near).map_err(|e| {
            let (status, why) = self.refusal(e, self.stand_anywhere(place, near).as_ref());
            Failure::refused(status, why)
        })
    }

    /// The same [without limits](Self::unlimited).
    pub fn stand_anywhere(&self, place: &Place, near: &Configuration<f64>) -> Option<ToolSolution<f64>> {
        stood(&self.unlimited(), place, near).ok()
    }
}

fn stood(
    five: &FiveAxis<'_, f64>,
    place: &Place,
    near: &Configuration<f64>,
) -> std::result::Result<ToolSolution<f64>, ToolError> {
    let tip_m = place.tip_m.into();
    match place.toward {
        Toward::Axis(axis) => five.inverse(&Tool { tip_m, axis: axis.into() }, near),
        Toward::Wrist(beta_rad) => five.inverse_at(tip_m, beta_rad.into()),
        Toward::Head(head, angles) => five.inverse(&Tool { tip_m, axis: head.axis(angles).into() }, near),
    }
}

/// A tool in the units of files.
pub(crate) fn shown(tool: &Tool<f64>) -> String {
    let [x, y, z] = tool.tip_m.map(|m| (m * 1e6).round() / 1e3 + 0.0).into();
    let [i, j, k] = unit(tool.axis.into()).map(|v| (v * 1e6).round() / 1e6 + 0.0);
    format!("tip {x}, {y}, {z} mm, axis {i}, {j}, {k}")
}

//! What the cyclic task works on.

use pkm_core::nalgebra::Vector3;
use pkm_core::{CorrectionTable, Cycle, CycleError, Machine, Pose, Scalar, Wrench};
use serde::{Deserialize, Serialize};

/// What the cyclic task works on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Number type to compute in. The inputs are rounded to it first.
    pub arithmetic: Arithmetic,
    /// Where the platform should stand, finite.
    pub pose: Pose<f64>,
    /// Load on the tip, its moment about the tip, in the axes of A-uvw, finite.
    pub wrench_at_tip: Wrench<f64>,
    /// The tip in A-uvw, finite.
    pub tip_m: Vector3<f64>,
}

/// A straight line of demands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// The first.
    pub from: Demand,
    /// The pose after the last, finite.
    pub to: Pose<f64>,
    /// From 1 to [`MAX_STEPS`](crate::MAX_STEPS).
    pub steps: u32,
}

impl Sweep {
    /// All of them.
    pub fn demands(self) -> impl Iterator<Item = Demand> {
        let Self { from, to, steps } = self;
        (0..steps).map(move |step| {
            let share = f64::from(step) / f64::from(steps);
            let along = |a: f64, b: f64| a + share * (b - a);
            let pose = Pose {
                theta_rad: along(from.pose.theta_rad, to.theta_rad),
                sigma_rad: along(from.pose.sigma_rad, to.sigma_rad),
                z0_m: along(from.pose.z0_m, to.z0_m),
            };
            Demand { pose, ..from }
        })
    }
}

/// Number type of a computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl Demand {
    /// Computes it. The inputs are rounded to `T` first.
    ///
    /// # Errors
    /// Those of [`CorrectionTable::cycle`].
    pub fn cycle<T: Scalar>(
        &self,
        machine: &Machine<T>,
        table: &CorrectionTable<'_, T>,
    ) -> Result<Cycle<T>, CycleError> {
        let (pose, wrench, tip_m) = self.inputs();
        table.cycle(machine, &pose, &wrench, tip_m)
    }

    /// Pose, load on the tip and tip, rounded to `T`.
    pub fn inputs<T: Scalar>(&self) -> (Pose<T>, Wrench<T>, Vector3<T>) {
        let Self { arithmetic: _, pose, wrench_at_tip: w, tip_m } = self;
        let [theta_rad, sigma_rad, z0_m] = [pose.theta_rad, pose.sigma_rad, pose.z0_m].map(T::from_f64);
        let wrench = Wrench { force_n: w.force_n.map(T::from_f64), moment_nm: w.moment_nm.map(T::from_f64) };
        (Pose { theta_rad, sigma_rad, z0_m }, wrench, tip_m.map(T::from_f64))
    }

    pub(crate) fn is_finite(&self) -> bool {
        are_finite(&self.pose, &self.wrench_at_tip, &self.tip_m)
    }
}

pub(crate) fn are_finite(pose: &Pose<f64>, load: &Wrench<f64>, tip_m: &Vector3<f64>) -> bool {
    let pose = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
    pose.iter().chain(&load.force_n).chain(&load.moment_nm).chain(tip_m).all(|v| v.is_finite())
}

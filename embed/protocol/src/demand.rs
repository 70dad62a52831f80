//! What the cyclic task works on.

use pkm_core::compensator::{CarriedWeight, Weight, WeightError};
use pkm_core::nalgebra::Vector3;
use pkm_core::thermal::TemperatureRise;
use pkm_core::{CorrectionTable, Cycle, CycleError, Machine, Model, Pose, Scalar, Wrench};
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
    /// How much warmer limbs 1, 2, 3 and the platforms are than at the zero reading, finite; `None` where there is no reading.
    pub rises_k: [Option<f64>; 4],
}

/// What the machine carries, and where it was zeroed. For three screws: platform and tool in one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// The weight, finite.
    pub weight: Weight<f64>,
    /// Where the machine was zeroed, finite.
    pub zeroed_at: Pose<f64>,
    /// The tip then, in A-uvw, finite.
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
        let Wrench { force_n, moment_nm } = self.wrench_at_tip;
        let wrench = Wrench { force_n: force_n.map(T::from_f64), moment_nm: moment_nm.map(T::from_f64) };
        (rounded(&self.pose), wrench, self.tip_m.map(T::from_f64))
    }

    /// The temperatures as a compensator takes them, rounded to `T`: NaN where there is no reading.
    pub fn rise<T: Scalar>(&self) -> TemperatureRise<T> {
        let [first, second, third, platforms_k] = self.rises_k.map(|rise_k| T::from_f64(rise_k.unwrap_or(f64::NAN)));
        TemperatureRise { limbs_k: [first, second, third], platforms_k }
    }

    pub(crate) fn is_finite(&self) -> bool {
        are_finite(&self.pose, &self.wrench_at_tip, &self.tip_m)
            && self.rises_k.iter().flatten().all(|rise_k| rise_k.is_finite())
    }
}

impl Carried {
    /// As a compensator takes it. The inputs are rounded to `T` first.
    ///
    /// # Errors
    /// Those of [`CarriedWeight::new`].
    pub fn carried<T: Scalar>(
        &self,
        machine: &Machine<T>,
        table: &CorrectionTable<'_, T>,
    ) -> Result<CarriedWeight<T, 3>, WeightError> {
        let Weight { force_n, centre_m } = self.weight;
        let weight = Weight { force_n: force_n.map(T::from_f64), centre_m: centre_m.map(T::from_f64) };
        let (model, tip_m) = (Model::new(machine, table), self.tip_m.map(T::from_f64));
        CarriedWeight::<T, 3>::new(&model, &weight, &rounded(&self.zeroed_at), tip_m)
    }

    pub(crate) fn is_finite(&self) -> bool {
        let Weight { force_n, centre_m } = self.weight;
        are_finite(&self.zeroed_at, &Wrench { force_n, moment_nm: centre_m }, &self.tip_m)
    }
}

fn rounded<T: Scalar>(pose: &Pose<f64>) -> Pose<T> {
    let [theta_rad, sigma_rad, z0_m] = [pose.theta_rad, pose.sigma_rad, pose.z0_m].map(T::from_f64);
    Pose { theta_rad, sigma_rad, z0_m }
}

pub(crate) fn are_finite(pose: &Pose<f64>, load: &Wrench<f64>, tip_m: &Vector3<f64>) -> bool {
    let pose = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
    pose.iter().chain(&load.force_n).chain(&load.moment_nm).chain(tip_m).all(|v| v.is_finite())
}

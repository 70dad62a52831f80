//! The weight that a machine carries: a load that is known, and that changes from pose to pose.

use core::fmt;

use nalgebra::{Matrix3, SVector, Vector3};

use super::{Fault, offsets};
use crate::compensation::Load;
use crate::correction::CorrectionTable;
use crate::five_axis::{Configuration, FiveAxis};
use crate::linalg::{is_finite, length};
use crate::machine::Machine;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::stiffness::LoadHistory;
use crate::types::{Domain, Pose, Wrench};
use crate::wrist::Wrist;

/// Greatest weight that is accepted, N: ten tonnes. Machines of this kind carry some hundred kilograms; more is a mass in grams, or
/// a force that is none.
pub const MAX_WEIGHT_N: f64 = 1e5;
/// Farthest centre of mass that is accepted, m: no platform and no tool is as long; more is a length in mm.
pub const MAX_CENTRE_M: f64 = 10.0;

/// The weight of something rigid.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Weight<T> {
    /// Mass times g, as a force along x, y, z of B, N.
    pub force_n: Vector3<T>,
    /// Its centre of mass, m: of what is rigid with the platform in A-uvw; of what turns with the tool in the axes of the tool (T_h),
    /// from its tip.
    pub centre_m: Vector3<T>,
}

/// Why a weight is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum WeightError {
    /// A force or a centre of mass is NaN or infinite.
    NotFinite,
    /// More than [`MAX_WEIGHT_N`].
    TooHeavy,
    /// The centre of mass is farther than [`MAX_CENTRE_M`].
    TooFar,
    /// There is no reference: where the machine was zeroed the weight cannot be compensated, for this reason.
    NoReference(Fault),
}

impl fmt::Display for WeightError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("a weight or its centre of mass is not finite"),
            Self::TooHeavy => f.write_str("a weight is beyond 1e5 N"),
            Self::TooFar => f.write_str("a centre of mass is farther than 10 m"),
            Self::NoReference(fault) => write!(f, "the weight has no reference where the machine was zeroed: {fault}"),
        }
    }
}

impl core::error::Error for WeightError {}

/// What a machine carries, and what that did to it where it was zeroed: the zeros of the joints make up for that already. For
/// [`Compensator::set_weight`](super::Compensator::set_weight).
///
/// The reference is what machine and table say, so that another table needs another `CarriedWeight`. What it takes to make one
/// is the time of an update. One without a force is as none: it has no reference, and none is looked for.
///
/// ```
/// use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Reading, Weight};
/// use pkm_core::nalgebra::Vector3;
/// use pkm_core::{Model, Pose, Wrench, tables::reference::{MACHINE_F64, TABLE_F64}};
///
/// let (home, tip_m) = (Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 }, Vector3::new(0.0, 0.0, 0.3));
/// // 80 kg, with x of B downwards
/// let weight = Weight { force_n: Vector3::new(80.0 * 9.81, 0.0, 0.0), centre_m: Vector3::new(0.0, 0.0, 0.1) };
/// let model = Model::new(&MACHINE_F64, &TABLE_F64);
/// let carried = CarriedWeight::<f64, 3>::new(&model, &weight, &home, tip_m)?;
/// let mut compensator = Compensator::<f64, 3>::new(&CompensatorSettings::DEFAULT)?;
/// compensator.set_weight(Some(carried));
///
/// let reading = Reading { enabled: true, wrench: Wrench::ZERO, rise: 0.0.into() };
/// let offset = compensator.update(&model, &home, tip_m, &reading);
/// assert_eq!(offset.joints, Vector3::zeros());
/// let elsewhere = Pose { theta_rad: 0.2, ..home };
/// let offset = compensator.update(&model, &elsewhere, tip_m, &reading);
/// assert!(offset.joints.amax() > 1e-6);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarriedWeight<T, const JOINTS: usize> {
    platform: Weight<T>,
    /// Of three screws none: there all is rigid with the platform.
    tool: Weight<T>,
    /// What would make up for the weight where the machine was zeroed.
    at_zero: SVector<T, JOINTS>,
}

impl<T: Scalar> Weight<T> {
    /// Nothing.
    pub const ZERO: Self = Self { force_n: Wrench::ZERO.force_n, centre_m: Wrench::ZERO.force_n };

    fn check(&self) -> Result<(), WeightError> {
        if !(is_finite(&self.force_n) && is_finite(&self.centre_m)) {
            return Err(WeightError::NotFinite);
        }
        // what overflows is not within either
        if !(length(&self.force_n) <= T::from_f64(MAX_WEIGHT_N)) {
            return Err(WeightError::TooHeavy);
        }
        if !(length(&self.centre_m) <= T::from_f64(MAX_CENTRE_M)) {
            return Err(WeightError::TooFar);
        }
        Ok(())
    }

    /// On a point, by its force in the axes of both.
    fn on(&self, force_n: Vector3<T>, at_m: Vector3<T>) -> Wrench<T> {
        Wrench { force_n, moment_nm: (self.centre_m - at_m).cross(&force_n) }
    }
}

impl<T: Scalar, const JOINTS: usize> CarriedWeight<T, JOINTS> {
    /// Takes the reference from the offsets that `whole` says make up for all of the weight.
    fn with_reference(
        platform: &Weight<T>,
        tool: &Weight<T>,
        domain: Domain,
        whole: impl FnOnce(&mut Load<'_, T, JOINTS>) -> Result<SVector<T, JOINTS>, Fault>,
    ) -> Result<Self, WeightError> {
        platform.check()?;
        tool.check()?;
        let mut carried = Self { platform: *platform, tool: *tool, at_zero: SVector::zeros() };
        if carried.is_nothing() {
            return Ok(carried);
        }
        if domain == Domain::Outside {
            return Err(WeightError::NoReference(Fault::OutsideBox));
        }
        let mut load = Load { wrench: Wrench::ZERO, gain: T::ONE, rise: T::ZERO.into(), carried: Some(&carried) };
        carried.at_zero = whole(&mut load).map_err(WeightError::NoReference)?;
        Ok(carried)
    }

    /// Whether it weighs nothing; what it did where the machine was zeroed is nothing then, too.
    pub(crate) fn is_nothing(&self) -> bool {
        self.platform.force_n == Vector3::zeros() && self.tool.force_n == Vector3::zeros()
    }

    /// How far the zeros hold the weight's deflection, as lengths of the screws, m.
    pub(crate) fn held_m(&self) -> Vector3<T> {
        let mut held_m = Vector3::zeros();
        held_m.iter_mut().zip(&self.at_zero).for_each(|(held, own)| *held = *own);
        held_m
    }

    /// What is left to compensate of offsets that make up for a share of all of the weight: the zeros hold the rest.
    pub(crate) fn beyond_zero(&self, offsets: SVector<T, JOINTS>, share: T) -> SVector<T, JOINTS> {
        offsets - self.at_zero * share
    }
}

impl<T: Scalar> CarriedWeight<T, 3> {
    /// For three screws: platform and tool in one.
    ///
    /// # Arguments
    /// * `model`: as of the updates, with the machine at the temperature at which it was zeroed. Machine and table count: the reference is of
    ///   all of the weight, however well it is known.
    /// * `weight`: only what no sensor shows.
    /// * `zeroed_at`: where the machine was zeroed.
    /// * `tip_m`: where the tip was in A-uvw, m.
    ///
    /// # Errors
    /// See [`WeightError`].
    #[inline(always)] // as the updates, for a machine that is a constant
    pub fn new<const N: usize>(
        model: &Model<'_, T, N>,
        weight: &Weight<T>,
        zeroed_at: &Pose<T>,
        tip_m: Vector3<T>,
    ) -> Result<Self, WeightError> {
        Self::referred((model.machine, model.table), weight, zeroed_at, tip_m)
    }

    fn referred(
        (machine, table): (&Machine<T>, &CorrectionTable<'_, T>),
        weight: &Weight<T>,
        zeroed_at: &Pose<T>,
        tip_m: Vector3<T>,
    ) -> Result<Self, WeightError> {
        let model = &Model::new(machine, table);
        Self::with_reference(weight, &Weight::ZERO, table.domain(zeroed_at), |load| {
            let at = (zeroed_at, &machine.posture(zeroed_at), tip_m);
            let (joints, _) = offsets(model, at, load, &mut LoadHistory::new())?;
            Ok(joints)
        })
    }

    /// On the tip, in A-uvw, where x, y, z of B are the columns of `base`.
    pub(crate) fn on_tip(&self, base: &Matrix3<T>, tip_m: Vector3<T>) -> Wrench<T> {
        self.platform.on(base * self.platform.force_n, tip_m)
    }
}

impl<T: Scalar> CarriedWeight<T, 5> {
    /// For five axes.
    ///
    /// # Arguments
    /// * `model`: as of the updates, with the machine at the temperature at which it was zeroed. Machine and table count: the reference is of
    ///   all of the weight, however well it is known.
    /// * `platform`: what is rigid with the platform, in A-uvw; `tool`: what turns with the tool, in its axes and from its tip. Only
    ///   what no sensor shows.
    /// * `zeroed_at`: where the machine was zeroed.
    ///
    /// # Errors
    /// See [`WeightError`].
    #[inline(always)] // as the updates, for a machine that is a constant
    pub fn new<const N: usize>(
        model: &Model<'_, T, N>,
        wrist: &Wrist<T>,
        platform: &Weight<T>,
        tool: &Weight<T>,
        zeroed_at: &Configuration<T>,
    ) -> Result<Self, WeightError> {
        Self::referred((&FiveAxis { machine: model.machine, wrist }, model.table), platform, tool, zeroed_at)
    }

    fn referred(
        (five, table): (&FiveAxis<'_, T>, &CorrectionTable<'_, T>),
        platform: &Weight<T>,
        tool: &Weight<T>,
        zeroed_at: &Configuration<T>,
    ) -> Result<Self, WeightError> {
        let model = &Model::new(five.machine, table);
        Self::with_reference(platform, tool, table.domain(&zeroed_at.pose), |load| {
            let (joints, _) = five.offsets(model, zeroed_at, load, &mut LoadHistory::new())?;
            Ok(joints)
        })
    }

    /// On the tip, in the axes of T_h.
    #[inline(never)] // takes no stack while the deflection is worked out
    pub(crate) fn on_tool(&self, five: &FiveAxis<'_, T>, configuration: &Configuration<T>) -> Wrench<T> {
        let base = configuration.base_axes();
        let held = five.wrist.held(configuration.beta_rad);
        let turn = held.axes().transpose();
        let platform = self.platform.on(base * self.platform.force_n, held.tip);
        let tool = self.tool.on(turn * (base * self.tool.force_n), Vector3::zeros());
        Wrench {
            force_n: turn * platform.force_n + tool.force_n,
            moment_nm: turn * platform.moment_nm + tool.moment_nm,
        }
    }
}

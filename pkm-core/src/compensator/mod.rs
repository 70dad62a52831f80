//! Compensation of the load as a controller switches it on: with state, limits, and a defined output for every fault.
//!
//! [`CorrectionTable::cycle`](crate::CorrectionTable::cycle) computes what would make up for a load. A [`Compensator`] decides how
//! much of it is commanded, and how fast. One [`update`](Compensator::update) a period:
//!
//! 1. The reading of the wrench is checked, filtered (first order) and freed of its dead band.
//! 2. K_m at the pose gives the deflection. `gain` times it, and the whole thermal growth, are turned into joint offsets by
//!    one Newton step.
//! 3. The vector of offsets is scaled into its size limit, and the step from the last one into its rate limit. Whole vectors are
//!    scaled: the tip keeps its direction, whichever joint has reached its limit. Joints that kept their proportion would bend its way
//!    by the square of the offset, so that the second derivative of the straight way is added.
//!
//! Start, stop, faults and a change of table are all the same to step 3: the offset moves from where it is to its new target at no
//! more than the rate limit. What each fault does:
//!
//! | what | [`Fault`] | offset |
//! |---|---|---|
//! | not enabled | none | goes to zero; the load is forgotten |
//! | wrench not finite, beyond its greatest, or stuck | `Wrench…` | the last good reading for `hold_s`, then the load counts as zero until its readings were good for 0.1 s |
//! | a temperature lost, or jumped | `TemperatureLost` | the last good temperature of that sensor; the others as they read |
//! | pose outside the table's box, until it is back by a hundredth of its half widths | `OutsideBox` | as [`OutsideBox`] says |
//! | no stiffness, no posture, or no way to compensate, until there was one for 0.1 s | that of the model | goes to zero |
//!
//! A fault ends with its cause, but for what the table says. A controller that wants it to last takes `enabled` away.
//!
//! A force sensor closes a loop through the machine: compensation pushes the tip against the workpiece, and the force grows. Its gain
//! is below the compensator's, see [`LoopGain`] and `docs/stability.md`.

mod limit;
mod load;
mod settings;
mod stability;
mod straight;
mod temperature;
mod weight;

use core::fmt;

use nalgebra::{SVector, Vector3};

use crate::compensation::{self, CompensationError, Doubt, Load};
use crate::correction::{CorrectionError, CorrectionTable, TableUncertainty};
use crate::estimation::Estimator;
use crate::five_axis::{Configuration, FiveAxis, ToolDeflectionError, ToolError};
use crate::kinematics::{KinematicsError, Posture};
use crate::machine::Machine;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::stiffness::{LoadHistory, StiffnessError};
use crate::thermal::TemperatureRise;
use crate::types::{Domain, Pose, Wrench};
use crate::wrist::Wrist;

pub use crate::model::Known;
use load::LoadFilter;
pub use settings::{CompensatorSettings, OutsideBox, SettingsError};
pub use stability::LoopGain;
pub use weight::{CarriedWeight, MAX_CENTRE_M, MAX_WEIGHT_N, Weight, WeightError};

/// A pose that has left the table's box is back when it is within this share of its half widths: one that stands on a face would be compensated in
/// one period and not in the next, as the encoders' noise has it.
const BACK_IN_BOX: f64 = 0.99;

/// How long what was given up has to be good before it comes back: readings of a load, with a plug that makes contact now and then, or the model's
/// answers, on a limit of the machine under the encoders' noise. The offset would come and go as often.
const RETURN_S: f64 = 0.1;

/// Why the load of a period is not compensated as usual. The [module's documentation](self) says what happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Fault {
    /// The reading of the wrench is NaN or infinite.
    WrenchNotFinite,
    /// The reading of the wrench is beyond the greatest force or moment.
    WrenchTooLarge,
    /// The readings of the wrench were equal for too long.
    WrenchStuck,
    /// A temperature rise is not finite, beyond ±100 K, has jumped, or runs away: it is further than 1 K, a sensor's noise, and 0.1 K
    /// a second from a good reading of some ten seconds ago.
    TemperatureLost,
    /// The pose is outside the table's box, or not yet back in it by a hundredth of its half widths, and nothing is wrong with the reading.
    OutsideBox,
    /// The pose has no posture, no stiffness or no deflection.
    Correction(CorrectionError),
    /// The deflection cannot be compensated.
    Compensation(CompensationError),
    /// The five axes cannot stand where they should, with or without the compensation.
    Tool(ToolError),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrenchNotFinite => f.write_str("the reading of the wrench is not finite"),
            Self::WrenchTooLarge => f.write_str("the reading of the wrench is beyond its greatest"),
            Self::WrenchStuck => f.write_str("the reading of the wrench is stuck"),
            Self::TemperatureLost => f.write_str("a temperature is lost"),
            Self::OutsideBox => f.write_str("the pose is outside the table's box"),
            Self::Correction(e) => e.fmt(f),
            Self::Compensation(e) => e.fmt(f),
            Self::Tool(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for Fault {}

impl From<CorrectionError> for Fault {
    fn from(e: CorrectionError) -> Self {
        Self::Correction(e)
    }
}

impl From<StiffnessError> for Fault {
    fn from(e: StiffnessError) -> Self {
        Self::Correction(e.into())
    }
}

impl From<CompensationError> for Fault {
    fn from(e: CompensationError) -> Self {
        Self::Compensation(e)
    }
}

impl From<ToolDeflectionError> for Fault {
    fn from(e: ToolDeflectionError) -> Self {
        match e {
            ToolDeflectionError::Tool(e) => Self::Tool(e),
            ToolDeflectionError::Stiffness(e) => Self::Correction(e),
        }
    }
}

/// What sensors say in a period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading<T> {
    /// Whether to compensate: the machine is homed, on, and the reading means the load on the tool.
    pub enabled: bool,
    /// Load on the tool, its moment about the tip. For three axes in the axes of A-uvw, for five in those of the tool, T_h: at both
    /// wrist joints' 0 these are u, v, w, and a positive second one turns it about its own −y. NaN when there is no reading.
    pub wrench: Wrench<T>,
    /// How much warmer limbs and platforms are than at the zero reading, each by a sensor of its own or all by one:
    /// `rise_k.into()`. NaN where there is no reading, 0 without a sensor.
    pub rise: TemperatureRise<T>,
}

/// Which limit holds an offset back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Limit {
    /// The offset is what was asked for.
    None,
    /// What was asked for is larger than the largest offset.
    Size,
    /// The offset is on its way, at its rate limit.
    Rate,
}

/// What a compensator asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Offset<T, const JOINTS: usize> {
    /// To be added to the joint values without compensation: m for the screws, rad for the wrist. Always finite; within the
    /// largest offset; no further from the last one than the rate limit lets it in a period.
    pub joints: SVector<T, JOINTS>,
    /// Which limit holds it back.
    pub limit: Limit,
    /// Where the pose stands to the table's box.
    pub domain: Domain,
    /// The gravest fault of this period.
    pub fault: Option<Fault>,
    /// How well the deflection under the load is known; `None` where that is not asked, and where no deflection is worked out.
    pub known: Option<Known<T>>,
}

/// Compensation with state, for the three screws (`JOINTS` = 3) or all five axes (5). See the [module's documentation](self).
///
/// Copy it to swap or to save it; it holds no reference to table or machine, so that either may change between two updates without a
/// step of the offset.
///
/// ```
/// use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
/// use pkm_core::nalgebra::Vector3;
/// use pkm_core::{Model, Pose, Wrench, tables::reference::{MACHINE_F64, TABLE_F64}};
///
/// let mut compensator = Compensator::<f64, 3>::new(&CompensatorSettings::DEFAULT)?;
/// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
/// let wrench = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
/// // every period
/// let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
/// let model = Model::new(&MACHINE_F64, &TABLE_F64);
/// let offset = compensator.update(&model, &pose, Vector3::new(0.0, 0.0, 0.3), &reading);
/// let command = MACHINE_F64.inverse(&pose)?.q_m + offset.joints;
/// assert!(offset.fault.is_none() && command.x > 0.5);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensator<T, const JOINTS: usize> {
    gain: T,
    outside_box: OutsideBox,
    load: LoadFilter<T>,
    /// Of the load that is compensated, for friction.
    history: LoadHistory<T>,
    /// Of each joint.
    largest: SVector<T, JOINTS>,
    /// Of each joint in a period.
    longest_step: SVector<T, JOINTS>,
    carried: Option<CarriedWeight<T, JOINTS>>,
    /// The pose was outside the table's box, and is not back by [`BACK_IN_BOX`].
    has_left_box: bool,
    /// Why the model had no answer, and for how many periods more it has to have one.
    lost: Option<(Fault, u32)>,
    joints: SVector<T, JOINTS>,
}

impl<T: Scalar, const JOINTS: usize> Compensator<T, JOINTS> {
    /// Begins without an offset.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn new(settings: &CompensatorSettings) -> Result<Self, SettingsError> {
        settings.check()?;
        // screws first, as everywhere
        let each = |screw: f64, wrist: f64| {
            let mut values = [T::from_f64(wrist); JOINTS];
            values.iter_mut().take(3).for_each(|value| *value = T::from_f64(screw));
            SVector::from(values)
        };
        let (screw_step, wrist_step) =
            (settings.screw_rate_m_per_s * settings.period_s, settings.wrist_rate_rad_per_s * settings.period_s);
        Ok(Self {
            gain: T::from_f64(settings.gain),
            outside_box: settings.outside_box,
            load: LoadFilter::new(settings),
            history: LoadHistory::new(),
            largest: each(settings.max_screw_m, settings.max_wrist_rad),
            longest_step: each(screw_step, wrist_step),
            carried: None,
            has_left_box: false,
            lost: None,
            joints: SVector::zeros(),
        })
    }

    /// What the machine carries from now on; `None`, as at the beginning, is nothing, or all of it in the readings. The offset goes
    /// there at its rate limit, and a weight may change, or a table with its own reference come, at any time.
    pub fn set_weight(&mut self, carried: Option<CarriedWeight<T, JOINTS>>) {
        self.carried = carried.filter(|carried| !carried.is_nothing());
    }

    /// The offset of the last update.
    pub fn joints(&self) -> SVector<T, JOINTS> {
        self.joints
    }

    /// Back to no offset and no load at once, as after [`new`](Self::new); what is carried stays. The offset steps: for drives that
    /// are off.
    pub fn reset(&mut self) {
        self.load.reset();
        self.history = LoadHistory::new();
        (self.has_left_box, self.lost) = (false, None);
        self.joints = SVector::zeros();
    }

    /// Where a pose stands to a table's box; none of one that is not finite.
    fn place(&mut self, table: &CorrectionTable<'_, T>, pose: &Pose<T>) -> Option<Domain> {
        if !pose.is_finite() {
            return None;
        }
        let domain = table.domain(pose);
        let is_back = || table.basis.is_within(pose, T::from_f64(BACK_IN_BOX));
        self.has_left_box = domain == Domain::Outside || (self.has_left_box && !is_back());
        Some(domain)
    }

    /// A period; `second` is as for [`approach`](Self::approach), `offsets` is what would
    /// make up for a load.
    fn step(
        &mut self,
        (table, pose): (&CorrectionTable<'_, T>, &Pose<T>),
        reading: &Reading<T>,
        second: impl Fn(&SVector<T, JOINTS>) -> Option<SVector<T, JOINTS>>,
        offsets: impl FnOnce(
            &mut Load<'_, T, JOINTS>,
            &mut LoadHistory<T>,
        ) -> Result<(SVector<T, JOINTS>, Option<Known<T>>), Fault>,
    ) -> Offset<T, JOINTS> {
        let domain = self.place(table, pose);
        let (target, known, fault) = self.target(domain, reading, offsets);
        let (joints, limit) = self.approach(target, second);
        Offset { joints, limit, domain: domain.unwrap_or(Domain::Outside), fault, known }
    }

    /// Where the offset should go.
    #[inline(always)] // `offsets` is the whole model, and has to stay at this depth of the stack
    fn target(
        &mut self,
        domain: Option<Domain>,
        reading: &Reading<T>,
        offsets: impl FnOnce(
            &mut Load<'_, T, JOINTS>,
            &mut LoadHistory<T>,
        ) -> Result<(SVector<T, JOINTS>, Option<Known<T>>), Fault>,
    ) -> (SVector<T, JOINTS>, Option<Known<T>>, Option<Fault>) {
        let none = SVector::zeros();
        if !reading.enabled {
            self.load.forget_load();
            self.history = LoadHistory::new();
            (self.has_left_box, self.lost) = (false, None);
            return (none, None, None);
        }
        let (wrench, rise, fault) = self.load.update(reading);
        if domain.is_none() {
            return (none, None, Some(self.lose(CorrectionError::from(KinematicsError::NotFinite).into())));
        }
        // outside the box as well: what the load does there is part of its history
        let mut load = Load { wrench, gain: self.gain, rise, carried: self.carried.as_ref() };
        let found = offsets(&mut load, &mut self.history);
        // what is wrong with the reading is the worse of the two
        let outside = fault.or(Some(Fault::OutsideBox));
        match (self.outside_box, found) {
            (OutsideBox::Hold, _) if self.has_left_box => (self.joints, None, outside),
            (OutsideBox::Fade, _) if self.has_left_box => (none, None, outside),
            (_, Ok((joints, known))) => match self.still_lost() {
                None => (joints, known, fault),
                lost => (none, None, lost),
            },
            (_, Err(fault)) => (none, None, Some(self.lose(fault))),
        }
    }

    /// Remembers that the model has no answer.
    fn lose(&mut self, why: Fault) -> Fault {
        self.lost = Some((why, self.load.return_periods));
        why
    }

    /// Why an answer of the model is not used yet.
    fn still_lost(&mut self) -> Option<Fault> {
        let (fault, left) = self.lost?;
        let left = left.saturating_sub(1);
        self.lost = (left > 0).then_some((fault, left));
        self.lost.map(|(fault, _)| fault)
    }

    /// Moves the offset towards a target, within both limits; `second` is the second derivative of the joints along a way that begins
    /// as it is told, and on which the tip goes straight.
    #[inline(never)] // takes no stack while the stiffness is worked out
    fn approach(
        &mut self,
        target: SVector<T, JOINTS>,
        second: impl Fn(&SVector<T, JOINTS>) -> Option<SVector<T, JOINTS>>,
    ) -> (SVector<T, JOINTS>, Limit) {
        let of_size = limit::share_within(&target, &self.largest);
        let end = limit::bent_part(&target, of_size, &self.largest, &second).unwrap_or(target * of_size.0);
        let way = end - self.joints;
        let of_step = limit::share_within(&way, &self.longest_step);
        // a point between two offsets of allowed size has allowed size, one beside their line may not
        let step = limit::bent_part(&way, of_step, &self.longest_step, &second)
            .filter(|step| limit::share_within(&(self.joints + step), &self.largest).0 >= T::ONE);
        self.joints += step.unwrap_or(way * of_step.0);
        let limit = if of_step.0 < T::ONE {
            Limit::Rate
        } else if of_size.0 < T::ONE {
            Limit::Size
        } else {
            Limit::None
        };
        (self.joints, limit)
    }
}

/// What to add to the screw lengths of a pose: the gain times the deflection under a load on the tip and what the weight does beyond
/// the zeros, as far as both are known, and all of the thermal growth.
fn offsets<T: Scalar, const N: usize>(
    model: &Model<'_, T, N>,
    (pose, posture, tip_m): (&Pose<T>, &Result<Posture<T>, KinematicsError>, Vector3<T>),
    load: &mut Load<'_, T, 3>,
    history: &mut LoadHistory<T>,
) -> Result<(Vector3<T>, Option<Known<T>>), Fault> {
    let posture = match posture {
        Ok(posture) => posture,
        Err(e) => return Err(CorrectionError::from(*e).into()),
    };
    let machine = model.machine;
    load.add_weight(|carried| carried.on_tip(&posture.base(), tip_m));
    let wrench = &load.wrench.moved_to_a(tip_m);
    let mut doubt = Doubt { table: model.uncertainty, tip_m, variance_m2: Vector3::zeros() };
    let (at, doubted) = ((pose, posture), Some(&mut doubt));
    let mut loaded = compensation::deflection_at(machine, Some(model.table), at, wrench, Some(history), doubted)?;
    if let Some(learned) = model.learned {
        learned.add_to(machine, posture, wrench, tip_m, (&mut loaded, &mut doubt.variance_m2))?;
        load.rise = load.rise.plus(learned.warmer_k());
    }
    let known = model.known(&doubt.variance_m2, &loaded.seen_at(tip_m).translation_m, &load.held_m());
    let share = known.as_ref().map_or(T::ONE, |known| known.share);
    let moved = loaded.times(load.gain * share).plus(&machine.thermal_deflection_at(posture, &load.rise)?);
    let offsets = machine.compensated_from(pose, posture, &moved, tip_m)?.lengths.q_m - posture.q;
    Ok((load.carried.map_or(offsets, |carried| carried.beyond_zero(offsets, share)), known))
}

impl<T: Scalar> Compensator<T, 3> {
    /// A period for the three screws, with a tip that is rigid with the moving platform. In `f32` the offset is within 0.3 µm
    /// of `f64`.
    ///
    /// With the table's uncertainty in the model, or what was learned, no more is compensated than is known: where the tip moves by less
    /// than the expanded uncertainty of both together, only so great a share is compensated as it is of that, and [`Offset::known`] has
    /// both. Of what was learned, what is worth compensating of its changes since acceptance ([`Estimator::targets`]) is added to the
    /// deflection of machine and table. What is learned and not compensated counts in the uncertainty.
    ///
    /// # Arguments
    /// * `pose`: where the machine should stand, without the compensation.
    /// * `tip_m`: where the tip is in A-uvw, m.
    ///
    /// ```
    /// use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64, UNCERTAINTY_F64};
    /// use pkm_core::{Model, Pose, Wrench};
    ///
    /// let mut compensator = Compensator::<f64, 3>::new(&CompensatorSettings::DEFAULT)?;
    /// let (pose, tip_m) = (Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 }, Vector3::new(0.0, 0.0, 0.3));
    /// let wrench = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
    /// let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
    /// let model = Model::new(&MACHINE_F64, &TABLE_F64).with_uncertainty(&UNCERTAINTY_F64);
    /// let offset = compensator.update(&model, &pose, tip_m, &reading);
    /// assert!(offset.known.is_some_and(|known| known.share == 1.0 && known.uncertainty.u95_m().z < 1e-6));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[inline(always)] // see `period`
    pub fn update<const N: usize>(
        &mut self,
        model: &Model<'_, T, N>,
        pose: &Pose<T>,
        tip_m: Vector3<T>,
        reading: &Reading<T>,
    ) -> Offset<T, 3> {
        let Model { machine, table, uncertainty, learned } = *model;
        self.period((machine, table), (uncertainty, learned), pose, tip_m, reading)
    }

    /// Takes references of their own: where the machine is a constant the compiler sees through them, but not through one to a model, and leaves
    /// out the effects that the machine does not have (50 kB).
    #[inline(never)]
    fn period<const N: usize>(
        &mut self,
        (machine, table): (&Machine<T>, &CorrectionTable<'_, T>),
        (uncertainty, learned): (Option<&TableUncertainty<T>>, Option<&Estimator<T, N>>),
        pose: &Pose<T>,
        tip_m: Vector3<T>,
        reading: &Reading<T>,
    ) -> Offset<T, 3> {
        let model = &Model { machine, table, uncertainty, learned };
        let posture = &machine.posture(pose);
        let second = |way: &Vector3<T>| straight::straight(machine, posture.as_ref().ok()?, tip_m, way);
        self.step((table, pose), reading, second, |load, history| offsets(model, (pose, posture, tip_m), load, history))
    }
}

impl<T: Scalar> Compensator<T, 5> {
    /// A period for all five axes: tip and axis of the tool are compensated. What is known of the model counts as with three screws.
    ///
    /// # Arguments
    /// * `configuration`: where the axes should stand, without the compensation.
    #[inline(always)] // see `period`
    pub fn update<const N: usize>(
        &mut self,
        model: &Model<'_, T, N>,
        wrist: &Wrist<T>,
        configuration: &Configuration<T>,
        reading: &Reading<T>,
    ) -> Offset<T, 5> {
        let Model { machine, table, uncertainty, learned } = *model;
        self.period((machine, table), (uncertainty, learned), wrist, configuration, reading)
    }

    /// As of three screws.
    #[inline(never)]
    fn period<const N: usize>(
        &mut self,
        (machine, table): (&Machine<T>, &CorrectionTable<'_, T>),
        (uncertainty, learned): (Option<&TableUncertainty<T>>, Option<&Estimator<T, N>>),
        wrist: &Wrist<T>,
        configuration: &Configuration<T>,
        reading: &Reading<T>,
    ) -> Offset<T, 5> {
        let model = &Model { machine, table, uncertainty, learned };
        let five = FiveAxis { machine, wrist };
        let second = |way: &SVector<T, 5>| five.straight(configuration, way);
        self.step((table, &configuration.pose), reading, second, |load, history| {
            Ok(five.offsets(model, configuration, load, history)?)
        })
    }
}

//! What a controller does in every cycle: screw lengths that put the loaded tip where the unloaded one should be.
//!
//! Three screws cannot undo six components of a deflection. They undo the displacement of one point, the tip; what the
//! load turns stays turned. In the axes u, y of B and n = BA/|BA|, which are square to each other, a tip at
//! t = (t_u, t_y, t_n) from A moves with (θ, σ, L), L = |AB|, by
//!
//! | | along u | along y | along n |
//! |---|---|---|---|
//! | dθ | L + t_n | 0 | −t_u |
//! | dσ | 0 | −t_n | t_y |
//! | dL | 0 | 0 | 1 |
//!
//! so that one Newton step against a displacement takes two divisions and no elimination.

use core::fmt;

use nalgebra::{Vector3, Vector6};

use crate::compensator::CarriedWeight;
use crate::correction::{Corrected, CorrectionError, CorrectionTable, TableUncertainty};
use crate::kinematics::{KinematicsError, Posture, SINGULARITY_MARGIN};
use crate::linalg::{self, is_finite};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::stiffness::{self, LoadHistory, StiffnessFactor};
use crate::thermal::TemperatureRise;
use crate::types::{Deflection, Pose, ScrewLengths, TipUncertainty, Wrench};

/// Greatest displacement of the tip that is compensated, as a share of |AB|: millimetres, where a machine at work deflects by tenths of
/// one.
pub const MAX_DISPLACEMENT: f64 = 0.01;

/// Why a deflection cannot be compensated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CompensationError {
    /// The deflection or the tip is NaN or infinite.
    NotFinite,
    /// The screws cannot move the tip in every direction: it is too near to the plane through A square to BA (or to that
    /// through B). The determinant of the table above is below [`SINGULARITY_MARGIN`] of L².
    Singular,
    /// The tip is displaced by more than [`MAX_DISPLACEMENT`] of |AB|: no machine is at work there, and one Newton step would leave a
    /// hundredth of it.
    TooFar,
    /// The pose, or the one to command, has no posture.
    Kinematics(KinematicsError),
}

impl fmt::Display for CompensationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("the deflection or the tip is not finite"),
            Self::Singular => f.write_str("the screws cannot move the tip in every direction"),
            Self::TooFar => f.write_str("the tip is displaced by more than a hundredth of |AB|"),
            Self::Kinematics(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for CompensationError {}

impl From<KinematicsError> for CompensationError {
    fn from(e: KinematicsError) -> Self {
        Self::Kinematics(e)
    }
}

/// Why a cycle ended without screw lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CycleError {
    /// There is no corrected stiffness or no deflection at the pose.
    Correction(CorrectionError),
    /// There is a deflection, and it cannot be compensated.
    Compensation(CompensationError),
}

impl fmt::Display for CycleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Correction(e) => e.fmt(f),
            Self::Compensation(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for CycleError {}

impl<E: Into<CorrectionError>> From<E> for CycleError {
    fn from(e: E) -> Self {
        Self::Correction(e.into())
    }
}

/// What to command so that a loaded tip is where it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Compensated<T> {
    /// The pose to command.
    pub pose: Pose<T>,
    /// Its screw lengths.
    pub lengths: ScrewLengths<T>,
}

/// Everything that one cycle of a controller computes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cycle<T> {
    /// Screw lengths of the pose without load.
    pub lengths: ScrewLengths<T>,
    /// K_m in the factor form, and whether the table may be trusted here.
    pub corrected: Corrected<T>,
    /// Displacement of A under the load, in A-uvw, with what load-dependent effects add.
    pub deflection: Deflection<T>,
    /// What to command under the load.
    pub compensated: Compensated<T>,
}

/// A cycle that compensates no more than is known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KnownCycle<T> {
    /// The cycle. Its deflection is the whole; [`Cycle::compensated`] makes up for `share` of it.
    pub cycle: Cycle<T>,
    /// How well the table knows the tip's translation.
    pub uncertainty: TipUncertainty<T>,
    /// 1 where the tip moves by more than its expanded uncertainty; see [`TipUncertainty::known_share`].
    pub share: T,
}

/// What is to be compensated in a period.
pub(crate) struct Load<'a, T, const JOINTS: usize> {
    /// On the tip.
    pub wrench: Wrench<T>,
    /// Share of its deflection.
    pub gain: T,
    pub rise: TemperatureRise<T>,
    /// What is carried, of which all is compensated.
    pub carried: Option<&'a CarriedWeight<T, JOINTS>>,
}

impl<T: Scalar, const JOINTS: usize> Load<'_, T, JOINTS> {
    /// Takes the weight in, so that the deflection of all of it is to be compensated by [`gain`](Self::gain). `weight` is that of what is
    /// carried. In place: a copy would take stack while the stiffness is worked out.
    #[inline(always)] // without a weight next to nothing
    pub fn add_weight(&mut self, weight: impl FnOnce(&CarriedWeight<T, JOINTS>) -> Wrench<T>) {
        let Some(carried) = self.carried else { return };
        let weight = weight(carried);
        self.wrench.force_n = self.wrench.force_n * self.gain + weight.force_n;
        self.wrench.moment_nm = self.wrench.moment_nm * self.gain + weight.moment_nm;
        self.gain = T::ONE;
    }

    /// See [`CarriedWeight::held_m`]; nothing without a weight.
    pub fn held_m(&self) -> Vector3<T> {
        self.carried.map_or(Vector3::zeros(), CarriedWeight::held_m)
    }
}

/// What is asked beside a deflection: by how much its table may be off at a point of the platform.
pub(crate) struct Doubt<'a, T> {
    /// Of the table; without it the variances stay.
    pub table: Option<&'a TableUncertainty<T>>,
    /// In A-uvw.
    pub tip_m: Vector3<T>,
    /// The answer, from zeros.
    pub variance_m2: Vector3<T>,
}

/// Displacement of A under a wrench at A, by K_m in the factor form or, without a table, by K_p; with what load-dependent
/// effects add, after a history or under a load that has only grown.
#[inline(always)] // a frame less below the stiffness
pub(crate) fn deflection<T: Scalar>(
    machine: &Machine<T>,
    table: Option<&CorrectionTable<'_, T>>,
    pose: &Pose<T>,
    wrench: &Wrench<T>,
    history: Option<&mut LoadHistory<T>>,
    doubt: Option<&mut Doubt<'_, T>>,
) -> Result<Deflection<T>, CorrectionError> {
    // by reference: `?` would copy all of it
    match &machine.posture(pose) {
        Ok(posture) => deflection_at(machine, table, (pose, posture), wrench, history, doubt),
        Err(e) => Err((*e).into()),
    }
}

/// The same, with the pose's own posture.
#[inline(always)] // a frame less below the stiffness
pub(crate) fn deflection_at<T: Scalar>(
    machine: &Machine<T>,
    table: Option<&CorrectionTable<'_, T>>,
    (pose, posture): (&Pose<T>, &Posture<T>),
    wrench: &Wrench<T>,
    history: Option<&mut LoadHistory<T>>,
    doubt: Option<&mut Doubt<'_, T>>,
) -> Result<Deflection<T>, CorrectionError> {
    let beyond = machine.load_dependent_deflection_after(posture, wrench, history)?;
    let deflection = linear_deflection(machine, table, (pose, posture), wrench, doubt)?.plus(&beyond);
    Ok(stiffness::finite(deflection)?)
}

#[inline(never)] // its matrix would take stack while load-dependent effects are worked out
fn linear_deflection<T: Scalar>(
    machine: &Machine<T>,
    table: Option<&CorrectionTable<'_, T>>,
    (pose, posture): (&Pose<T>, &Posture<T>),
    wrench: &Wrench<T>,
    doubt: Option<&mut Doubt<'_, T>>,
) -> Result<Deflection<T>, CorrectionError> {
    let mut factor = StiffnessFactor { lower: linalg::zero() };
    match table {
        Some(table) => table.add_factor_form(machine, pose, posture, &mut factor.lower)?,
        None => {
            machine.add_stiffness_below_tool(posture, &mut factor.lower)?;
            machine.add_tool_compliance(&mut factor.lower)?;
            stiffness::factor(&mut factor.lower)?;
        }
    }
    let x = linalg::solve_lower::<T, 0>(&factor.lower, &wrench.to_vector());
    if let (Some(table), Some(Doubt { table: Some(uncertainty), tip_m, variance_m2 })) = (table, doubt) {
        *variance_m2 = uncertainty.of_loaded(&factor, table.scaled(pose), &x, *tip_m)?.variance_m2;
    }
    Ok(stiffness::finite(Deflection::from_vector(linalg::solve_upper(&factor.lower, &x)))?)
}

impl<T: Scalar> Machine<T> {
    /// Displacement of A, in A-uvw, under a wrench at A: by K_m in the factor form or, without a table, by K_p, with what load-dependent
    /// effects add. What temperature adds is [`thermal_deflection`](Self::thermal_deflection).
    ///
    /// `turned_at` is the load at which the loading turned back: zero when it has only grown. Outside its table's box it is computed
    /// all the same: ask [`CorrectionTable::domain`].
    ///
    /// # Errors
    /// Those of [`CorrectionTable::factor_form`] and [`load_dependent_deflection`](Self::load_dependent_deflection).
    pub fn deflection(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        pose: &Pose<T>,
        wrench: &Wrench<T>,
        turned_at: &Wrench<T>,
    ) -> Result<Deflection<T>, CorrectionError> {
        // by reference: `?` would copy all of it
        match &self.posture(pose) {
            Ok(posture) => {
                let beyond = self.load_dependent_deflection_at(posture, wrench, turned_at)?;
                let deflection = linear_deflection(self, table, (pose, posture), wrench, None)?.plus(&beyond);
                Ok(stiffness::finite(deflection)?)
            }
            Err(e) => Err((*e).into()),
        }
    }

    /// Pose and screw lengths to command so that the loaded tip stands where the unloaded one would at `pose`. The
    /// tip's position is made up for, the platform's orientation is not.
    ///
    /// One Newton step with the deflection of `pose`. The remainder is of second order, half as large a part of the
    /// displacement under half the load: within 1e-3 of it for the reference machine in its box, tip 0.2 m to 0.4 m ahead of A,
    /// up to 50 N and 5 N·m on each axis; and for random machines with the tip L/2 to 2 L ahead, displaced by 2.5e-6 of L. What displaces the
    /// tip by more than [`MAX_DISPLACEMENT`] of L is refused.
    ///
    /// # Arguments
    /// * `deflection`: displacement of A under the load at `pose`, in A-uvw.
    /// * `tip_m`: where the tip is in A-uvw, rigid with the moving platform.
    ///
    /// # Errors
    /// Not finite; singular; too far; those of [`inverse`](Self::inverse), for `pose` or for the pose to command.
    ///
    /// ```
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::{CompensationError, Deflection, Pose, tables::reference};
    /// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    /// let sagged = Deflection { translation_m: Vector3::new(0.0, 0.0, -20e-6), ..Deflection::ZERO };
    /// let command = reference::MACHINE_F64.compensated(&pose, &sagged, Vector3::new(0.0, 0.0, 0.3))?;
    /// assert!(command.pose.z0_m > pose.z0_m);
    /// # Ok::<(), CompensationError>(())
    /// ```
    pub fn compensated(
        &self,
        pose: &Pose<T>,
        deflection: &Deflection<T>,
        tip_m: Vector3<T>,
    ) -> Result<Compensated<T>, CompensationError> {
        self.compensated_from(pose, &self.posture(pose)?, deflection, tip_m)
    }

    pub(crate) fn compensated_from(
        &self,
        pose: &Pose<T>,
        posture: &Posture<T>,
        deflection: &Deflection<T>,
        tip_m: Vector3<T>,
    ) -> Result<Compensated<T>, CompensationError> {
        let moved = deflection.seen_at(tip_m).translation_m;
        let most = T::from_f64(MAX_DISPLACEMENT) * posture.l;
        // NaN is within nothing
        if !(moved.dot(&moved) <= most * most) {
            return Err(if is_finite(&moved) { CompensationError::TooFar } else { CompensationError::NotFinite });
        }
        if !is_finite(&tip_m) {
            return Err(CompensationError::NotFinite);
        }
        // from A-uvw into u, y, n
        let (sin, cos) = (posture.sin_sigma, posture.cos_sigma);
        let turned = |at: Vector3<T>| [at.x, at.y * cos - at.z * sin, at.y * sin + at.z * cos];
        let ([u, y, n], [tip_u, tip_y, tip_n]) = (turned(moved), turned(tip_m));
        let l = posture.l;
        let reach = l + tip_n;
        if !((reach * tip_n).abs() >= T::from_f64(SINGULARITY_MARGIN) * l * l) {
            return Err(CompensationError::Singular);
        }
        let dtheta = -u / reach;
        let dsigma = y / tip_n;
        let dl = tip_u * dtheta - tip_y * dsigma - n;
        let pose = Pose {
            theta_rad: pose.theta_rad + dtheta,
            sigma_rad: pose.sigma_rad + dsigma,
            z0_m: pose.z0_m + dl * posture.cos_theta - l * posture.sin_theta * dtheta,
        };
        Ok(Compensated { pose, lengths: self.inverse(&pose)? })
    }
}

impl<T: Scalar> CorrectionTable<'_, T> {
    /// One cycle of a controller: screw lengths, K_m in the factor form, deflection under a load on the tip, and the screw
    /// lengths that make up for it (see [`Machine::compensated`]).
    ///
    /// In `f32`, for the reference machine in its box, the deflection is within 1e-4 and the lengths within 0.3 µm of `f64`.
    ///
    /// Load-dependent effects take the load as one that has only grown from zero; for another history of friction use
    /// the parts ([`factor_form`](Self::factor_form), [`Machine::load_dependent_deflection`]).
    ///
    /// # Arguments
    /// * `wrench_at_tip`: the load on the tip, its moment about the tip, in the axes of A-uvw.
    /// * `tip_m`: where the tip is in A-uvw. With a wrist whose joints turn use [`FiveAxis`](crate::FiveAxis), which takes
    ///   tip and load in the tool's own terms; [`WristParameters::tip_at_zero_m`](crate::WristParameters::tip_at_zero_m)
    ///   is the tip with both joints at 0.
    ///
    /// No filter, no rate limit, the whole deflection: for a load that is computed, never for one that is measured, which closes a loop and
    /// takes a [`Compensator`](crate::compensator::Compensator).
    ///
    /// Outside the table's box ([`Domain::Outside`](crate::Domain::Outside) in [`Cycle::corrected`]) the numbers are
    /// computed all the same: a controller that may not extrapolate commands [`Cycle::lengths`], without compensation, or
    /// stops.
    ///
    /// # Errors
    /// Those of [`factor_form`](Self::factor_form), [`Machine::load_dependent_deflection`] and
    /// [`Machine::compensated`]. There are no lengths then: hold the last command, or ask [`Machine::inverse`] for those
    /// without load.
    ///
    /// ```
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::{CycleError, Pose, Wrench, tables::reference};
    /// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    /// let push = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
    /// let cycle = reference::TABLE_F64.cycle(&reference::MACHINE_F64, &pose, &push, Vector3::new(0.0, 0.0, 0.3))?;
    /// // pushed towards its base, the tip has to be commanded further out
    /// assert!(cycle.compensated.pose.z0_m > pose.z0_m);
    /// # Ok::<(), CycleError>(())
    /// ```
    pub fn cycle(
        &self,
        machine: &Machine<T>,
        pose: &Pose<T>,
        wrench_at_tip: &Wrench<T>,
        tip_m: Vector3<T>,
    ) -> Result<Cycle<T>, CycleError> {
        let posture = machine.posture(pose)?;
        let wrench = wrench_at_tip.moved_to_a(tip_m);
        // first, with nothing of the rest on the stack
        let beyond = machine.load_dependent_deflection_at(&posture, &wrench, &Wrench::ZERO)?;
        let whole = |_: &_, _: &_, _: &_| Ok((T::ONE, ()));
        self.cycle_with((machine, pose, &posture, tip_m), &wrench, &beyond, whole, |cycle, _, ()| cycle)
    }

    /// [`cycle`](Self::cycle) with the uncertainty of the tip's deflection, which is compensated as far as it is known. A controller that
    /// compensates the whole or nothing takes [`KnownCycle::share`] below 1 for nothing, and commands [`Cycle::lengths`].
    ///
    /// # Arguments
    /// * `uncertainty`: of this table, as `fit` has written it beside the table.
    ///
    /// # Errors
    /// Those of [`cycle`](Self::cycle); [`StiffnessError::NotFinite`](crate::StiffnessError::NotFinite) of an uncertainty that
    /// overflows.
    ///
    /// ```
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64, UNCERTAINTY_F64};
    /// use pkm_core::{CycleError, Pose, Wrench};
    /// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    /// let push = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
    /// let tip_m = Vector3::new(0.0, 0.0, 0.3);
    /// let known = TABLE_F64.cycle_known(&MACHINE_F64, &UNCERTAINTY_F64, &pose, &push, tip_m)?;
    /// assert_eq!(known.share, 1.0);
    /// assert!(known.uncertainty.u95_m().z < 0.1 * -known.cycle.deflection.seen_at(tip_m).translation_m.z);
    /// # Ok::<(), CycleError>(())
    /// ```
    pub fn cycle_known(
        &self,
        machine: &Machine<T>,
        uncertainty: &TableUncertainty<T>,
        pose: &Pose<T>,
        wrench_at_tip: &Wrench<T>,
        tip_m: Vector3<T>,
    ) -> Result<KnownCycle<T>, CycleError> {
        let posture = machine.posture(pose)?;
        let wrench = wrench_at_tip.moved_to_a(tip_m);
        let beyond = machine.load_dependent_deflection_at(&posture, &wrench, &Wrench::ZERO)?;
        let known = |factor: &StiffnessFactor<T>, x: &Vector6<T>, deflection: &Deflection<T>| {
            let uncertainty = uncertainty.of_loaded(factor, self.scaled(pose), x, tip_m)?;
            Ok((uncertainty.known_share(&deflection.seen_at(tip_m).translation_m), uncertainty))
        };
        self.cycle_with((machine, pose, &posture, tip_m), &wrench, &beyond, known, |cycle, share, uncertainty| {
            KnownCycle { cycle, uncertainty, share }
        })
    }

    /// `beyond` is what load-dependent effects add to the deflection. `known` says how much of the deflection is compensated, from
    /// F, F⁻¹ times the load, and the deflection; `result` is put together where it is wanted, since a copy takes stack.
    #[inline(never)] // what comes before takes no stack while K_p is put together
    fn cycle_with<K, R>(
        &self,
        (machine, pose, posture, tip_m): (&Machine<T>, &Pose<T>, &Posture<T>, Vector3<T>),
        wrench: &Wrench<T>,
        beyond: &Deflection<T>,
        known: impl FnOnce(&StiffnessFactor<T>, &Vector6<T>, &Deflection<T>) -> Result<(T, K), CycleError>,
        result: impl FnOnce(Cycle<T>, T, K) -> R,
    ) -> Result<R, CycleError> {
        let mut factor = StiffnessFactor { lower: linalg::zero() };
        self.add_factor_form(machine, pose, posture, &mut factor.lower)?;
        let x = linalg::solve_lower::<T, 0>(&factor.lower, &wrench.to_vector());
        let linear = Deflection::from_vector(linalg::solve_upper(&factor.lower, &x));
        let deflection = stiffness::finite(linear)?.plus(beyond);
        let (share, known) = known(&factor, &x, &deflection)?;
        let compensated = machine
            .compensated_from(pose, posture, &deflection.times(share), tip_m)
            .map_err(CycleError::Compensation)?;
        let corrected = Corrected { factor, domain: self.domain(pose) };
        let cycle = Cycle { lengths: ScrewLengths { q_m: posture.q }, corrected, deflection, compensated };
        Ok(result(cycle, share, known))
    }
}

//! How far the table may be off, and what is known of a deflection for that reason.

use pkm_core::checksum::Damaged;
use pkm_core::compensator::Known;
use pkm_core::{KnownCycle, Model, Scalar, TableUncertainty, TipUncertainty};

#[cfg(table_uncertainty)]
use crate::coefficients;
use crate::pointers::{answer, given, taken};
use crate::{
    PkmCompensator, PkmConfiguration, PkmCycle, PkmError, PkmMachine, PkmOffset, PkmPoint, PkmPose, PkmReading,
    PkmTable, PkmToolCompensator, PkmWrench, PkmWrist,
};

/// How far a table may be off, as the fit has found it.
pub struct PkmTableUncertainty<T>(pub(crate) TableUncertainty<T>);

/// How well a deflection of the tip is known, and how much of it is compensated for that reason.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmKnown<T> {
    /// Expanded uncertainty of the tip's translation along u, v, w, coverage 95 % (k = 1.96).
    pub u95_m: [T; 3],
    /// 1 where the tip moves by more than its expanded uncertainty, else the share that its way is of that. A controller that
    /// compensates the whole or nothing takes anything below 1 for nothing.
    pub share: T,
}

/// A cycle that compensates no more than is known.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmKnownCycle<T> {
    /// Its deflection is the whole; `compensated` makes up for the share that is known.
    pub cycle: PkmCycle<T>,
    /// How well.
    pub known: PkmKnown<T>,
}

/// What a compensator asks for that compensates no more than is known.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmKnownOffset<T> {
    /// What it asks for.
    pub offset: PkmOffset<T>,
    /// How well the deflection under the load that is compensated is known; zeros where `is_known` is 0.
    pub known: PkmKnown<T>,
    /// Not 0: there is a deflection in this period. 0 when not enabled, outside the box unless its setting is to extrapolate, and with a fault of the model.
    pub is_known: i32,
}

impl<T: Scalar> PkmKnown<T> {
    fn of(uncertainty: TipUncertainty<T>, share: T) -> Self {
        Self { u95_m: uncertainty.u95_m().into(), share }
    }
}

impl<T: Scalar> PkmKnownOffset<T> {
    pub(crate) fn of(offset: PkmOffset<T>, known: Option<Known<T>>) -> Self {
        let nothing = PkmKnown { u95_m: [T::ZERO; 3], share: T::ZERO };
        let is_known = i32::from(known.is_some());
        Self { offset, known: known.map_or(nothing, |known| PkmKnown::of(known.uncertainty, known.share)), is_known }
    }
}

macro_rules! functions {
    (
        $t:ident, $the_uncertainty:ident, $verify:ident, table_uncertainty $table_uncertainty:ident, cycle_known $cycle_known:ident,
        update_known $update_known:ident, tool_update_known $tool_update_known:ident
    ) => {
        #[cfg(table_uncertainty)]
        static $the_uncertainty: Option<PkmTableUncertainty<$t>> =
            Some(PkmTableUncertainty(coefficients::$the_uncertainty));
        #[cfg(not(table_uncertainty))]
        static $the_uncertainty: Option<PkmTableUncertainty<$t>> = None;

        /// Whether it is in memory as it was built.
        pub(crate) fn $verify() -> Result<(), Damaged> {
            #[cfg(table_uncertainty)]
            coefficients::$the_uncertainty.verify(const { coefficients::$the_uncertainty.checksum() })?;
            Ok(())
        }

        /// How far the compiled-in table may be off; null when its `coefficients.rs` does not say.
        #[unsafe(no_mangle)]
        pub extern "C" fn $table_uncertainty() -> *const PkmTableUncertainty<$t> {
            $the_uncertainty.as_ref().map_or(core::ptr::null(), core::ptr::from_ref)
        }

        /// `pkm_cycle` with the uncertainty of the tip's deflection, of which as much is compensated as is known. `uncertainty` is
        /// that of the table.
        ///
        /// Errors: those of `pkm_cycle`; NOT_FINITE also of an uncertainty that overflows.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $cycle_known(
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            uncertainty: *const PkmTableUncertainty<$t>,
            pose: *const PkmPose<$t>,
            wrench_at_tip: *const PkmWrench<$t>,
            tip: *const PkmPoint<$t>,
            known: *mut PkmKnownCycle<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(known, || {
                    let (machine, table, pose) = (given(machine)?.core(), &given(table)?.core, given(pose)?.core());
                    let uncertainty = &given(uncertainty)?.0;
                    let (wrench, tip) = (given(wrench_at_tip)?.core(), given(tip)?);
                    let KnownCycle { cycle, uncertainty, share } =
                        table.cycle_known(machine, uncertainty, &pose, &wrench, tip.uvw_m.into())?;
                    Ok(PkmKnownCycle { cycle: cycle.into(), known: PkmKnown::of(uncertainty, share) })
                })
            }
        }

        /// `pkm_compensator_update` that compensates no more than is known. `uncertainty` is that of the table.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $update_known(
            compensator: *mut PkmCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            uncertainty: *const PkmTableUncertainty<$t>,
            pose: *const PkmPose<$t>,
            tip: *const PkmPoint<$t>,
            reading: *const PkmReading<$t>,
            offset: *mut PkmKnownOffset<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmKnownOffset<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(offset, || {
                    let (machine, pose) = (given(machine)?.core(), given(pose)?.core());
                    let model = Model::new(machine, &given(table)?.core).with_uncertainty(&given(uncertainty)?.0);
                    let (tip, reading) = (given(tip)?.uvw_m.into(), given(reading)?.core());
                    let compensator = taken(compensator)?.0.running()?;
                    let offset = compensator.update(&model, &pose, tip, &reading);
                    Ok(PkmKnownOffset::of(PkmOffset::of(offset), offset.known))
                })
            }
        }

        /// `pkm_tool_compensator_update` that compensates no more than is known. `uncertainty` is that of the table.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_update_known(
            compensator: *mut PkmToolCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            uncertainty: *const PkmTableUncertainty<$t>,
            wrist: *const PkmWrist<$t>,
            configuration: *const PkmConfiguration<$t>,
            reading: *const PkmReading<$t>,
            offset: *mut PkmKnownOffset<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmKnownOffset<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(offset, || {
                    let (machine, wrist) = (given(machine)?.core(), &given(wrist)?.0);
                    let model = Model::new(machine, &given(table)?.core).with_uncertainty(&given(uncertainty)?.0);
                    let (configuration, reading) = (given(configuration)?.core(), given(reading)?.core());
                    let compensator = taken(compensator)?.0.running()?;
                    let offset = compensator.update(&model, wrist, &configuration, &reading);
                    Ok(PkmKnownOffset::of(PkmOffset::of(offset), offset.known))
                })
            }
        }
    };
}

functions! {
    f64, UNCERTAINTY_F64, verify_f64, table_uncertainty pkm_table_uncertainty_f64, cycle_known pkm_cycle_known_f64,
    update_known pkm_compensator_update_known_f64, tool_update_known pkm_tool_compensator_update_known_f64
}
functions! {
    f32, UNCERTAINTY_F32, verify_f32, table_uncertainty pkm_table_uncertainty_f32, cycle_known pkm_cycle_known_f32,
    update_known pkm_compensator_update_known_f32, tool_update_known pkm_tool_compensator_update_known_f32
}

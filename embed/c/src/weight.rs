//! The weight that a machine carries, as a compensator takes it.

use pkm_core::compensator::{CarriedWeight, Weight};
use pkm_core::{Model, Scalar};

use crate::pointers::{given, taken};
use crate::{
    PkmCompensator, PkmConfiguration, PkmError, PkmMachine, PkmPoint, PkmPose, PkmTable, PkmToolCompensator, PkmWrist,
};

/// The weight of something rigid: only what no force sensor shows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmWeight<T> {
    /// Mass times g, as a force along x, y, z of B; at most 1e5 N.
    pub force_n: [T; 3],
    /// Its centre of mass, at most 10 m away: of what is rigid with the platform in A-uvw; of what turns with the tool in the axes of the
    /// tool, from its tip.
    pub centre_m: [T; 3],
}

impl<T: Scalar> PkmWeight<T> {
    fn core(&self) -> Weight<T> {
        Weight { force_n: self.force_n.into(), centre_m: self.centre_m.into() }
    }
}

/// What a function did that has nothing to write.
fn done(result: Result<(), PkmError>) -> PkmError {
    result.map_or_else(|error| error, |()| PkmError::Ok)
}

macro_rules! weight {
    (
        $t:ident, set $set:ident, clear $clear:ident, tool_set $tool_set:ident, tool_clear $tool_clear:ident
    ) => {
        /// What platform and tool weigh, for a compensator of the three screws. From now on it compensates what that does beyond what
        /// it did where the machine was zeroed, whole; the offset goes there at its rate limit. The reference is worked out with the
        /// machine, as warm as it was, and the table: set the weight again when another table comes. `zeroed_at` and `tip` are pose and tip of the
        /// zero. It takes the time of an update. With an error the weight stays what it was.
        ///
        /// Errors: NOT_INITIALISED, WEIGHT_NOT_FINITE, WEIGHT_TOO_HEAVY, WEIGHT_TOO_FAR, WEIGHT_NO_REFERENCE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            compensator: *mut PkmCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            weight: *const PkmWeight<$t>,
            zeroed_at: *const PkmPose<$t>,
            tip: *const PkmPoint<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            done((|| unsafe {
                let (machine, table, weight) = (given(machine)?.core(), &given(table)?.core, given(weight)?.core());
                let (model, zeroed_at) = (Model::new(machine, table), given(zeroed_at)?.core());
                let tip = given(tip)?.uvw_m.into();
                let compensator = taken(compensator)?.0.running()?;
                compensator.set_weight(Some(CarriedWeight::<$t, 3>::new(&model, &weight, &zeroed_at, tip)?));
                Ok(())
            })())
        }

        /// No weight from now on, as after the init.
        ///
        /// Errors: NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $clear(compensator: *mut PkmCompensator<$t>) -> PkmError {
            // SAFETY: the caller's promise
            let compensator = unsafe { taken(compensator) }.and_then(|kept| kept.0.running());
            done(compensator.map(|compensator| compensator.set_weight(None)))
        }

        /// The same for the five axes: `platform` is what is rigid with the platform, `tool` what turns with the tool.
        ///
        /// Errors: those for three screws.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_set(
            compensator: *mut PkmToolCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            wrist: *const PkmWrist<$t>,
            platform: *const PkmWeight<$t>,
            tool: *const PkmWeight<$t>,
            zeroed_at: *const PkmConfiguration<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            done((|| unsafe {
                let (machine, table, wrist) = (given(machine)?.core(), &given(table)?.core, &given(wrist)?.0);
                let (platform, tool) = (given(platform)?.core(), given(tool)?.core());
                let model = Model::new(machine, table);
                let zeroed_at = given(zeroed_at)?.core();
                let compensator = taken(compensator)?.0.running()?;
                let carried = CarriedWeight::<$t, 5>::new(&model, wrist, &platform, &tool, &zeroed_at)?;
                compensator.set_weight(Some(carried));
                Ok(())
            })())
        }

        /// No weight from now on, as after the init.
        ///
        /// Errors: NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_clear(compensator: *mut PkmToolCompensator<$t>) -> PkmError {
            // SAFETY: the caller's promise
            let compensator = unsafe { taken(compensator) }.and_then(|kept| kept.0.running());
            done(compensator.map(|compensator| compensator.set_weight(None)))
        }
    };
}

weight! {
    f64, set pkm_compensator_set_weight_f64, clear pkm_compensator_clear_weight_f64,
    tool_set pkm_tool_compensator_set_weight_f64, tool_clear pkm_tool_compensator_clear_weight_f64
}
weight! {
    f32, set pkm_compensator_set_weight_f32, clear pkm_compensator_clear_weight_f32,
    tool_set pkm_tool_compensator_set_weight_f32, tool_clear pkm_tool_compensator_clear_weight_f32
}

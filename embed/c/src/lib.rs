//! The core for C. `include/pkm.h` is generated from this file; what it says there is said here.
//!
//! Every function copies its inputs to the core and its result back; nothing is computed here. A result is written
//! only when the function returns [`PkmError::Ok`]. No panic crosses the border, since there is none: the panic
//! handler calls a function that does not exist, and `cargo xtask c` looks that no object asks for it.
//!
//! # Safety
//! The same for every `unsafe` function: a pointer is null, or misaligned, or leads to what its type says, which nobody
//! writes to meanwhile.

#![cfg_attr(not(test), no_std)]
#![allow(clippy::missing_safety_doc)] // see above

mod compensator;
mod error;
mod estimator;
mod estimator_types;
mod identity;
mod known;
mod pointers;
mod table;
mod tool;
mod types;
mod weight;

pub use compensator::*;
pub use error::{PkmError, pkm_error_text};
pub use estimator::*;
pub use estimator_types::*;
pub use identity::*;
pub use known::*;
pub use table::*;
pub use tool::*;
pub use types::*;
pub use weight::*;

use pkm_core::checksum::MemoryChecksums;
use pkm_core::{FiveAxis, Machine, Scalar, Wrench, self_test};

use pointers::{answer, given};

#[allow(dead_code, missing_docs)]
mod coefficients {
    include!(env!("PKM_COEFFICIENTS"));
}

fn finite<T: Scalar, const N: usize>(values: [T; N]) -> Result<[T; N], PkmError> {
    if values.iter().all(|v| v.is_finite()) { Ok(values) } else { Err(PkmError::NotFinite) }
}

// most of the functions below could only fail
const _: () =
    assert!(coefficients::TABLE_F64.has_factor_form(), "the table has no factor form: fit one to all 21 entries");

macro_rules! functions {
    (
        $t:ident, $the_machine:ident, $the_table:ident, machine $machine:ident, table $table:ident,
        verify $verify:ident $verify_uncertainty:ident, self_test $self_test:ident $self_test_core:ident, machine_size $machine_size:ident, at_temperature $at_temperature:ident, inverse $inverse:ident, forward $forward:ident, jacobian $jacobian:ident,
        singularity_distance $singularity_distance:ident, travel_margin $travel_margin:ident,
        stiffness $stiffness:ident, domain $domain:ident, corrected_stiffness $corrected_stiffness:ident,
        deflection $deflection:ident, thermal_deflection $thermal_deflection:ident, compensated $compensated:ident,
        cycle $cycle:ident, $the_wrist:ident, wrist $wrist:ident $(,)?
    ) => {
        const _: () = assert!(
            size_of::<Machine<$t>>() == size_of::<PkmMachine<$t>>()
                && align_of::<Machine<$t>>() == align_of::<PkmMachine<$t>>(),
            "a machine has another size in numbers in the other arithmetic"
        );

        impl PkmMachine<$t> {
            fn core(&self) -> &Machine<$t> {
                // SAFETY: same size and alignment, see above; by contract a PkmMachine is only ever made from a Machine
                unsafe { &*core::ptr::from_ref(self).cast() }
            }
        }

        static $the_table: PkmTable<$t> =
            PkmTable { core: coefficients::$the_table, checksum: coefficients::TABLE_F64.checksum() };
        static $the_wrist: PkmWrist<$t> = PkmWrist(coefficients::$the_wrist);

        /// The compiled-in machine.
        #[unsafe(no_mangle)]
        pub extern "C" fn $machine() -> *const PkmMachine<$t> {
            (&raw const coefficients::$the_machine).cast()
        }

        /// The compiled-in correction table.
        #[unsafe(no_mangle)]
        pub extern "C" fn $table() -> *const PkmTable<$t> {
            &$the_table
        }

        /// The compiled-in wrist.
        #[unsafe(no_mangle)]
        pub extern "C" fn $wrist() -> *const PkmWrist<$t> {
            &$the_wrist
        }

        /// Whether machine, wrist, table and its uncertainty are in memory as they were built: computes their checksums again from memory.
        /// Ask when the program starts.
        ///
        /// Errors: DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE, DAMAGED_UNCERTAINTY.
        #[must_use]
        #[unsafe(no_mangle)]
        pub extern "C" fn $verify() -> PkmError {
            const FIVE: FiveAxis<'static, $t> =
                FiveAxis { machine: &coefficients::$the_machine, wrist: &coefficients::$the_wrist };
            const BUILT: MemoryChecksums = FIVE.checksums(&coefficients::$the_table);
            FIVE.verify(&coefficients::$the_table, &BUILT)
                .and_then(|()| known::$verify_uncertainty())
                .map_or_else(PkmError::from, |()| PkmError::Ok)
        }

        /// Computes known poses of the reference machine, whatever machine the library has, and compares their bits. Finds a processor in
        /// another rounding mode, a broken floating-point unit, a compiler that reorders arithmetic. Ask when the program starts; it takes
        /// some 2 KB of stack more than the others, for the compensators that it runs.
        ///
        /// Errors: SELF_TEST_KINEMATICS, SELF_TEST_STIFFNESS, SELF_TEST_FIVE_AXES, SELF_TEST_COMPENSATOR.
        #[must_use]
        #[unsafe(no_mangle)]
        pub extern "C" fn $self_test() -> PkmError {
            self_test::$self_test_core(&mut self_test::SelfTestMemory::new())
                .map_or_else(PkmError::from, |()| PkmError::Ok)
        }

        /// Bytes that the library takes for a machine. A program that was compiled with the header of another version may
        /// give less room.
        #[unsafe(no_mangle)]
        pub extern "C" fn $machine_size() -> usize {
            size_of::<PkmMachine<$t>>()
        }

        /// The machine at a temperature in degrees Celsius, by its effect `thermal-modulus`; the same machine without
        /// it. Compute it when the temperature has changed, not in every cycle. `size` is the room for it: `sizeof *warm`.
        ///
        /// Errors: WRONG_SIZE, NOT_FINITE, NO_STIFFNESS.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $at_temperature(
            machine: *const PkmMachine<$t>,
            temperature_c: $t,
            warm: *mut PkmMachine<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmMachine<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe { answer(warm.cast(), || Ok(given(machine)?.core().at_temperature(temperature_c)?)) }
        }

        /// Inverse kinematics: screw lengths of a pose.
        ///
        /// Errors: NOT_FINITE, UNREACHABLE, SINGULAR, OUT_OF_TRAVEL_LIMB1 to 3, in this order; called "those of a
        /// pose" below.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $inverse(
            machine: *const PkmMachine<$t>,
            pose: *const PkmPose<$t>,
            lengths: *mut PkmLengths<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe { answer(lengths, || Ok(given(machine)?.core().inverse(&given(pose)?.core())?.into())) }
        }

        /// Forward kinematics: the pose of screw lengths, in the working mode, in closed form.
        ///
        /// Errors: those of a pose in another order, since travel is looked at first: NOT_FINITE, OUT_OF_TRAVEL_LIMB1 to 3,
        /// UNREACHABLE, SINGULAR.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $forward(
            machine: *const PkmMachine<$t>,
            lengths: *const PkmLengths<$t>,
            pose: *mut PkmPose<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe { answer(pose, || Ok(given(machine)?.core().forward(&given(lengths)?.core())?.into())) }
        }

        /// Derivatives of the screw lengths by the pose.
        ///
        /// Errors: those of a pose.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $jacobian(
            machine: *const PkmMachine<$t>,
            pose: *const PkmPose<$t>,
            jacobian: *mut PkmJacobian<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe { answer(jacobian, || Ok(given(machine)?.core().jacobian(&given(pose)?.core())?.into())) }
        }

        /// How far a pose is from the direct singularities.
        ///
        /// Errors: those of a pose.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $singularity_distance(
            machine: *const PkmMachine<$t>,
            pose: *const PkmPose<$t>,
            distance: *mut PkmSingularityDistance<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(distance, || Ok(given(machine)?.core().singularity_distance(&given(pose)?.core())?.into()))
            }
        }

        /// How far screw lengths are from the nearest end of travel.
        ///
        /// Errors: NOT_FINITE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $travel_margin(
            machine: *const PkmMachine<$t>,
            lengths: *const PkmLengths<$t>,
            margin: *mut PkmTravelMargin<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(margin, || {
                    let (margin_m, limb) = given(machine)?.core().travel_margin_m(&given(lengths)?.core())?;
                    Ok(PkmTravelMargin { margin_m, limb: limb.into() })
                })
            }
        }

        /// Basic stiffness K_p, without a table.
        ///
        /// Errors: those of a pose, NOT_POSITIVE_DEFINITE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $stiffness(
            machine: *const PkmMachine<$t>,
            pose: *const PkmPose<$t>,
            stiffness: *mut PkmStiffness<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe { answer(stiffness, || Ok(given(machine)?.core().stiffness(&given(pose)?.core())?.into())) }
        }

        /// Whether a pose lies in the box that the table was fitted on.
        ///
        /// Errors: NOT_FINITE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $domain(
            table: *const PkmTable<$t>,
            pose: *const PkmPose<$t>,
            domain: *mut PkmDomain,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(domain, || {
                    let (table, pose) = (&given(table)?.core, given(pose)?.core());
                    finite([pose.theta_rad, pose.sigma_rad, pose.z0_m])?;
                    Ok(table.domain(&pose).into())
                })
            }
        }

        /// Corrected stiffness K_m, the table's factor form on the basic stiffness.
        ///
        /// Errors: those of a pose, NOT_POSITIVE_DEFINITE, NO_FACTOR_FORM, NOT_POSITIVE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $corrected_stiffness(
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            pose: *const PkmPose<$t>,
            corrected: *mut PkmCorrected<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(corrected, || {
                    let (machine, table, pose) = (given(machine)?.core(), &given(table)?.core, given(pose)?.core());
                    Ok(table.factor_form(machine, &pose)?.into())
                })
            }
        }

        /// Displacement of A under a load at A: that of K_m, and what the machine's load-dependent effects add.
        /// `turned_at` is the load at which the loading last turned back, for friction; null when it has only grown
        /// from zero. Outside the table's box it is computed all the same: ask `pkm_domain`.
        ///
        /// Errors: those of the corrected stiffness, NOT_FINITE, NOT_CONVERGED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $deflection(
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            pose: *const PkmPose<$t>,
            wrench: *const PkmWrench<$t>,
            turned_at: *const PkmWrench<$t>,
            deflection: *mut PkmDeflection<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(deflection, || {
                    let (machine, table, pose) = (given(machine)?.core(), &given(table)?.core, given(pose)?.core());
                    let wrench = given(wrench)?.core();
                    let turned_at = if turned_at.is_null() { Wrench::ZERO } else { given(turned_at)?.core() };
                    Ok(machine.deflection(Some(table), &pose, &wrench, &turned_at)?.into())
                })
            }
        }

        /// Displacement of A without load when the machine is warmer than at the zero reading, each limb and the platforms
        /// by their own `rise`, by its effect `thermal-expansion`; zero without it.
        ///
        /// Errors: those of a pose.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $thermal_deflection(
            machine: *const PkmMachine<$t>,
            pose: *const PkmPose<$t>,
            rise: *const PkmTemperatureRise<$t>,
            deflection: *mut PkmDeflection<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(deflection, || {
                    Ok(given(machine)?.core().thermal_deflection(&given(pose)?.core(), given(rise)?.core())?.into())
                })
            }
        }

        /// Pose and screw lengths to command so that the tip, displaced by `deflection` of A, stands where it would
        /// without. The tip's position is made up for, the orientation is not.
        ///
        /// Errors: those of a pose, for `pose` or for the one to command; NOT_COMPENSABLE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $compensated(
            machine: *const PkmMachine<$t>,
            pose: *const PkmPose<$t>,
            deflection: *const PkmDeflection<$t>,
            tip: *const PkmPoint<$t>,
            compensated: *mut PkmCompensated<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(compensated, || {
                    let (machine, pose) = (given(machine)?.core(), given(pose)?.core());
                    let (deflection, tip) = (given(deflection)?.core(), given(tip)?);
                    Ok(machine.compensated(&pose, &deflection, tip.uvw_m.into())?.into())
                })
            }
        }

        /// One cycle of a controller: screw lengths, deflection under a load on the tip (its moment about the tip, in
        /// the axes of A-uvw) that has only grown from zero, and the screw lengths that make up for it. The tip is given
        /// for the wrist as it stands; with one that turns use `pkm_tool_compensated`. No filter, no rate limit, the whole deflection: for a
        /// load that is computed, never for one that is measured, which takes a compensator.
        ///
        /// Outside the table's box (`domain`) all is computed all the same: a controller that may not extrapolate commands
        /// `lengths`, without compensation, or stops. On an error nothing is written: hold the last command, or ask
        /// `pkm_inverse` for the lengths without load.
        ///
        /// Errors: those of `pkm_deflection` and of `pkm_compensated`.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $cycle(
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            pose: *const PkmPose<$t>,
            wrench_at_tip: *const PkmWrench<$t>,
            tip: *const PkmPoint<$t>,
            cycle: *mut PkmCycle<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(cycle, || {
                    let (machine, table, pose) = (given(machine)?.core(), &given(table)?.core, given(pose)?.core());
                    let (wrench, tip) = (given(wrench_at_tip)?.core(), given(tip)?);
                    Ok(table.cycle(machine, &pose, &wrench, tip.uvw_m.into())?.into())
                })
            }
        }
    };
}

functions! {
    f64, MACHINE_F64, TABLE_F64, machine pkm_machine_f64, table pkm_table_f64,
    verify pkm_verify_f64 verify_f64, self_test pkm_self_test_f64 self_test_f64, machine_size pkm_machine_size_f64, at_temperature pkm_at_temperature_f64, inverse pkm_inverse_f64, forward pkm_forward_f64,
    jacobian pkm_jacobian_f64, singularity_distance pkm_singularity_distance_f64,
    travel_margin pkm_travel_margin_f64, stiffness pkm_stiffness_f64, domain pkm_domain_f64,
    corrected_stiffness pkm_corrected_stiffness_f64, deflection pkm_deflection_f64,
    thermal_deflection pkm_thermal_deflection_f64, compensated pkm_compensated_f64, cycle pkm_cycle_f64,
    WRIST_F64, wrist pkm_wrist_f64,
}

functions! {
    f32, MACHINE_F32, TABLE_F32, machine pkm_machine_f32, table pkm_table_f32,
    verify pkm_verify_f32 verify_f32, self_test pkm_self_test_f32 self_test_f32, machine_size pkm_machine_size_f32, at_temperature pkm_at_temperature_f32, inverse pkm_inverse_f32, forward pkm_forward_f32,
    jacobian pkm_jacobian_f32, singularity_distance pkm_singularity_distance_f32,
    travel_margin pkm_travel_margin_f32, stiffness pkm_stiffness_f32, domain pkm_domain_f32,
    corrected_stiffness pkm_corrected_stiffness_f32, deflection pkm_deflection_f32,
    thermal_deflection pkm_thermal_deflection_f32, compensated pkm_compensated_f32, cycle pkm_cycle_f32,
    WRIST_F32, wrist pkm_wrist_f32,
}

/// For the test of the test: a panic that must be found.
#[cfg(feature = "planted-panic")]
#[unsafe(no_mangle)]
pub extern "C" fn pkm_planted(index: usize) -> u8 {
    [0; 4][index]
}

#[cfg(not(test))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn pkm_a_panic_is_reachable() -> !;
    }
    // SAFETY: never runs, since a program with this call does not link
    unsafe { pkm_a_panic_is_reachable() }
}

#[cfg(test)]
mod tests;

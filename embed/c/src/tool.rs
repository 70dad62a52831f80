//! The five axes: parallel mechanism and wrist.

use pkm_core::FiveAxis;

use crate::pointers::{answer, given};
use crate::{
    PkmCompensatedTool, PkmConfiguration, PkmError, PkmJointMotion, PkmJoints, PkmMachine, PkmTable, PkmTip, PkmTool,
    PkmToolMotion, PkmToolPlace, PkmToolSolution, PkmWrench, PkmWrist,
};

macro_rules! functions {
    (
        $t:ident, tool_forward $tool_forward:ident, tool_inverse $tool_inverse:ident, tip_inverse $tip_inverse:ident,
        tip_inverse_any_margin $tip_inverse_any_margin:ident, tool_compensated $tool_compensated:ident,
        joint_motion $joint_motion:ident, feed_share $feed_share:ident $(,)?
    ) => {
        /// Forward kinematics of the five axes: configuration, tip and axis of joint values.
        ///
        /// Errors: those of `pkm_forward`, then NOT_FINITE of the wrist's angles, WRIST_LIMIT1, WRIST_LIMIT2.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_forward(
            machine: *const PkmMachine<$t>,
            wrist: *const PkmWrist<$t>,
            joints: *const PkmJoints<$t>,
            place: *mut PkmToolPlace<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(place, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    let (configuration, tool) = five.forward(&given(joints)?.core())?;
                    Ok(PkmToolPlace { configuration: configuration.into(), tool: tool.into() })
                })
            }
        }

        /// Inverse kinematics of the five axes: the configuration for a tool, on the same side of the singularity locus
        /// as `near`, the last configuration of the path. At its start `near` is the `configuration` that
        /// `pkm_tool_forward` gives for the measured joints; one of zeros is none (Z0 is above 0), and TOOL_UNREACHABLE.
        ///
        /// Errors: NOT_FINITE, TOOL_SINGULAR, TOOL_UNREACHABLE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_inverse(
            machine: *const PkmMachine<$t>,
            wrist: *const PkmWrist<$t>,
            tool: *const PkmTool<$t>,
            near: *const PkmConfiguration<$t>,
            solution: *mut PkmToolSolution<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(solution, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    Ok(five.inverse(&given(tool)?.core(), &given(near)?.core())?.into())
                })
            }
        }

        /// Inverse kinematics of the five axes with the wrist's joints at given angles: what a controller needs whose axes
        /// are the tip's position and these angles. In closed form, and without a configuration to begin from.
        ///
        /// Errors: NOT_FINITE, TOOL_UNREACHABLE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2, TOOL_SINGULAR.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tip_inverse(
            machine: *const PkmMachine<$t>,
            wrist: *const PkmWrist<$t>,
            tip: *const PkmTip<$t>,
            solution: *mut PkmToolSolution<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(solution, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    let PkmTip { tip_m, beta_rad } = *given(tip)?;
                    Ok(five.inverse_at(tip_m.into(), beta_rad.into())?.into())
                })
            }
        }

        /// The same, also where the machine is nearer to the singularity locus than the wrist's margin, on the side of home: for a
        /// controller that drives a machine out of there. `normalised_determinant` of the result says how near it is.
        ///
        /// Errors: those of `pkm_tip_inverse`; TOOL_SINGULAR only on the locus and beyond it.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tip_inverse_any_margin(
            machine: *const PkmMachine<$t>,
            wrist: *const PkmWrist<$t>,
            tip: *const PkmTip<$t>,
            solution: *mut PkmToolSolution<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(solution, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    let PkmTip { tip_m, beta_rad } = *given(tip)?;
                    Ok(five.inverse_at_any_margin(tip_m.into(), beta_rad.into())?.into())
                })
            }
        }

        /// What to command so that a loaded tool stands where `tool` asks, tip and axis. The load acts on the tool at
        /// its tip, in the axes of T_h. No filter, no rate limit, the whole deflection: for a load that is computed, never for one that is
        /// measured, which takes a compensator. `near` is as for
        /// `pkm_tool_inverse`, and no further from the tool than a period's step: this takes a bounded number of instructions. Where
        /// they do not do, it gives the best that it found, with what remains and `converged` 0. `domain` is that of the
        /// pose to command.
        ///
        /// Errors: those of the inverse kinematics and of `pkm_deflection`, on the way as at its end.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_compensated(
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            wrist: *const PkmWrist<$t>,
            tool: *const PkmTool<$t>,
            wrench: *const PkmWrench<$t>,
            near: *const PkmConfiguration<$t>,
            compensated: *mut PkmCompensatedTool<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(compensated, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    let (table, tool) = (&given(table)?.core, given(tool)?.core());
                    let (wrench, near) = (given(wrench)?.core(), given(near)?.core());
                    Ok(five.compensated(Some(table), &tool, &wrench, &near)?.into())
                })
            }
        }

        /// Velocities and accelerations of the joints that move the tool as asked, in closed form.
        ///
        /// Errors: NOT_FINITE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2, TOOL_SINGULAR.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $joint_motion(
            machine: *const PkmMachine<$t>,
            wrist: *const PkmWrist<$t>,
            configuration: *const PkmConfiguration<$t>,
            motion: *const PkmToolMotion<$t>,
            joints: *mut PkmJointMotion<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(joints, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    Ok(five.joint_motion(&given(configuration)?.core(), &given(motion)?.core())?.into())
                })
            }
        }

        /// The greatest share, at most 1, of the feed at which no joint exceeds `limits`, greatest sizes for each, on the same curve at a
        /// steady feed. 0 where a number is NaN, or a joint moves whose limit is 0.
        ///
        /// Errors: none but those of the pointers.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $feed_share(
            joints: *const PkmJointMotion<$t>,
            limits: *const PkmJointMotion<$t>,
            share: *mut $t,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(share, || {
                    let limits = given(limits)?.core();
                    Ok(given(joints)?.core().feed_share(&limits.velocity, &limits.acceleration))
                })
            }
        }
    };
}

functions! {
    f64, tool_forward pkm_tool_forward_f64, tool_inverse pkm_tool_inverse_f64, tip_inverse pkm_tip_inverse_f64,
    tip_inverse_any_margin pkm_tip_inverse_any_margin_f64, tool_compensated pkm_tool_compensated_f64,
    joint_motion pkm_joint_motion_f64, feed_share pkm_feed_share_f64,
}

functions! {
    f32, tool_forward pkm_tool_forward_f32, tool_inverse pkm_tool_inverse_f32, tip_inverse pkm_tip_inverse_f32,
    tip_inverse_any_margin pkm_tip_inverse_any_margin_f32, tool_compensated pkm_tool_compensated_f32,
    joint_motion pkm_joint_motion_f32, feed_share pkm_feed_share_f32,
}

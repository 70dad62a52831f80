//! Kinematics and stiffness of an Exechon-like parallel kinematic machine, for motion controllers.
//!
//! The mechanism has limbs 1 and 2 (U-P-R) and limb 3 (R-P-S) between a fixed platform B-xyz and a moving
//! platform A-uvw, three degrees of freedom (θ, σ, Z0), and five over-constraints. The crate goes from the
//! bottom up:
//!
//! 1. [`scalar`]: `f32` or `f64`; [`types`]: pose, wrench, deflection, their frames and units; [`checksum`]: of what is in memory.
//! 2. [`machine`]: what is known of one machine; [`Machine::new`] checks it, also at compile time. [`effects`] hold the physics
//!    beyond the paper's model.
//! 3. [`kinematics`]: [`Machine::inverse`], [`Machine::forward`], [`Machine::jacobian`], distances to
//!    singularities and to the ends of travel.
//! 4. [`stiffness`]: the 6×6 terminal stiffness K_p, its Cholesky factor, deflection under a [`Wrench`]; [`thermal`]: what
//!    temperature changes.
//! 5. [`correction`]: K_m from a [`CorrectionTable`] fitted by `pkm-host`, with the status of the table's box.
//! 6. [`compensation`]: [`CorrectionTable::cycle`], from a pose and a load on the tip to screw lengths that make up
//!    for it; [`Machine::compensated`] alone.
//! 7. [`estimation`]: what the machine learns from readings while it works, and how sure that is.
//! 8. [`model`]: machine and table with what is known of both, for a compensator.
//! 9. [`wrist`], [`five_axis`]: all five axes; [`FiveAxis`] borrows a machine and a wrist.
//! 10. [`compensator`]: compensation with state, for a controller to switch on: filter, limits, faults, stability.
//! 11. [`tables`]: generated tables. `coefficients.rs`, which `pkm-host fit` writes, has the same names as
//!     [`tables::reference`]: `PARAMETERS` and `WRIST` are the numbers, `MACHINE_F64`, `TABLE_F64`, `WRIST_F64` and
//!     those in `F32` what to compute with.
//! 12. [`self_test`]: known results, for a controller's start.
//!
//! Vectors and matrices are those of [`nalgebra`], which is exported from here so that a program can name the same version.
//!
//! `no_std`, no allocation, no `unsafe`, no panic path in release, no iteration without a constant bound,
//! `f32` and `f64`, and the same bits on a host as on a Cortex-M. What gives a `Result` refuses NaN and infinity; what gives a plain
//! number, such as [`Pose::a_in_b_m`], [`Wrench::moved_to_a`], [`CorrectionTable::coefficients`] or [`TipUncertainty::known_share`], passes NaN
//! on to what does. Every error has a text (`Display`); with the feature
//! `defmt` results and errors derive `defmt::Format`, machines, tables and wrists don't.
//!
//! ```
//! use pkm_core::nalgebra::Vector3;
//! use pkm_core::{CorrectionError, Domain, Pose, Wrench, tables::reference};
//!
//! let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
//! let corrected = reference::TABLE_F64.factor_form(&reference::MACHINE_F64, &pose)?;
//! assert_eq!(corrected.domain, Domain::Inside);
//! let push = Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), ..Wrench::ZERO };
//! let deflection = corrected.factor.deflection(&push)?;
//! assert!(deflection.translation_m.z < 0.0);
//! # Ok::<(), CorrectionError>(())
//! ```
//!
//! All five axes, loaded, from where the machine stands:
//!
//! ```
//! use pkm_core::nalgebra::{Vector2, Vector3};
//! use pkm_core::{Configuration, FiveAxis, Pose, Tool, ToolDeflectionError, Wrench, tables::reference};
//!
//! let five = FiveAxis { machine: &reference::MACHINE_F64, wrist: &reference::WRIST_F64 };
//! // home; after power-up it is what `FiveAxis::forward` makes of the measured joints, later the last command's
//! let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: reference::WRIST.home_z0_m };
//! let near = Configuration { pose, beta_rad: Vector2::zeros() };
//! let tool = Tool { tip_m: Vector3::new(-0.15, 0.02, 1.12), axis: Vector3::new(0.05, 0.0, 1.0) };
//! let cutting = Wrench { force_n: Vector3::new(120.0, 0.0, -400.0), moment_nm: Vector3::new(0.0, 0.0, 5.0) };
//! let command = five.compensated(Some(&reference::TABLE_F64), &tool, &cutting, &near)?;
//! let (_, unloaded) = five.forward(&command.solution.joints)?;
//! // the load takes the tool from here to where it was asked for
//! assert!((unloaded.tip_m + command.deflection.translation_m - tool.tip_m).amax() < 1e-7);
//! # Ok::<(), ToolDeflectionError>(())
//! ```

#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::unwrap_used, clippy::expect_used, clippy::std_instead_of_core)]

// Generated tables name this crate, so that the same file compiles here and in a firmware.
#[allow(unused_extern_crates)]
extern crate self as pkm_core;

pub mod checksum;
pub mod compensation;
pub mod compensator;
mod conversion;
pub mod correction;
pub mod effects;
mod elastic;
pub mod estimation;
pub mod five_axis;
pub mod kinematics;
mod linalg;
pub mod machine;
pub mod model;
pub mod scalar;
pub mod self_test;
pub mod stiffness;
pub mod tables;
pub mod thermal;
pub mod types;
pub mod wrist;

/// Vectors and matrices of this crate's interface.
pub use nalgebra;

pub use compensation::{Compensated, CompensationError, Cycle, CycleError, KnownCycle, MAX_DISPLACEMENT};
pub use compensator::{Compensator, CompensatorSettings, Fault};
pub use correction::{Basis, Corrected, CorrectionError, CorrectionTable, TableError, TableUncertainty};
pub use elastic::LimbFrame;
pub use five_axis::{
    CompensatedTool, Configuration, FiveAxis, JointMotion, JointValues, Tool, ToolDeflection, ToolDeflectionError,
    ToolError, ToolFrame, ToolMotion, ToolSolution,
};
pub use kinematics::{KinematicsError, SINGULARITY_MARGIN, SingularityDistance};
pub use machine::{Machine, MachineError, MachineParameters};
pub use model::Model;
pub use scalar::Scalar;
pub use stiffness::{LoadResponse, Stiffness, StiffnessError, StiffnessFactor, Transmission};
pub use thermal::{TemperatureError, TemperatureRise};
pub use types::{Deflection, Domain, K95, Pose, ScrewLengths, TipUncertainty, Wrench};
pub use wrist::{Wrist, WristError, WristParameters};

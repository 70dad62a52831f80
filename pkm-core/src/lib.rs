//! Kinematics and stiffness of an Exechon-like parallel kinematic machine, for motion controllers.
//!
//! The mechanism has limbs 1 and 2 (U-P-R) and limb 3 (R-P-S) between a fixed platform B-xyz and a moving
//! platform A-uvw, three degrees of freedom (θ, σ, Z0), and five over-constraints. The crate goes from the
//! bottom up:
//!
//! 1. [`machine`]: what is known of one machine; [`Machine::new`] checks it, also at compile time.
//! 2. [`kinematics`]: [`Machine::inverse`], [`Machine::forward`], [`Machine::jacobian`], distances to
//!    singularities and to the ends of travel.
//! 3. [`stiffness`]: the 6×6 terminal stiffness K_p, its Cholesky factor, deflection under a [`Wrench`].
//!    [`effects`] hold the physics beyond the paper's model.
//! 4. [`correction`]: K_m from a [`CorrectionTable`] fitted by `pkm-host`, with the status of the table's box.
//! 5. [`compensation`]: [`CorrectionTable::cycle`], from a pose and a load on the tip to screw lengths that make up
//!    for it; [`Machine::compensated`] alone.
//! 6. [`tables`]: generated tables.
//!
//! `no_std`, no allocation, no `unsafe`, no panic path in release, no iteration without a constant bound,
//! `f32` and `f64`, and the same bits on a host as on a Cortex-M.
//!
//! ```
//! use pkm_core::{CorrectionError, Domain, Pose, Wrench, tables::reference};
//!
//! let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
//! let corrected = reference::TABLE_F64.factor_form(&reference::MACHINE_F64, &pose)?;
//! assert_eq!(corrected.domain, Domain::Inside);
//! let push = Wrench { force_n: [0.0, 0.0, -400.0], moment_nm: [0.0; 3] };
//! let deflection = corrected.factor.deflection(&push)?;
//! assert!(deflection.translation_m[2] < 0.0);
//! # Ok::<(), CorrectionError>(())
//! ```

#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::unwrap_used, clippy::expect_used, clippy::std_instead_of_core)]

// Generated tables name this crate, so that the same file compiles here and in a firmware.
#[allow(unused_extern_crates)]
extern crate self as pkm_core;

pub mod checksum;
pub mod compensation;
pub mod correction;
pub mod effects;
pub mod five_axis;
pub mod kinematics;
mod linalg;
pub mod machine;
pub mod scalar;
pub mod stiffness;
pub mod tables;
pub mod types;
mod vector;
pub mod wrist;

pub use compensation::{Compensated, CompensationError, Cycle, CycleError};
pub use correction::{Basis, Corrected, CorrectionError, CorrectionTable, TableError};
pub use five_axis::{
    CompensatedTool, Configuration, FiveAxis, Hold, JointValues, Tool, ToolDeflection, ToolDeflectionError, ToolError,
    ToolFrame,
};
pub use kinematics::{KinematicsError, SINGULARITY_MARGIN, SingularityDistance};
pub use machine::{Machine, MachineError, MachineParameters, TemperatureError};
pub use scalar::Scalar;
pub use stiffness::{LoadResponse, Stiffness, StiffnessError, StiffnessFactor};
pub use types::{Deflection, Domain, Pose, ScrewLengths, Wrench};
pub use wrist::{Wrist, WristError, WristParameters};

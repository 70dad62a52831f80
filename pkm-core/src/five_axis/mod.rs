//! The whole machine: parallel mechanism and wrist (paper, Section 3.1, Eq. 2, Table 1; `docs/theory.md`).
//!
//! In the axes u, y of B and n = BA/|BA|, which are square to each other, with the tip at t from A, the tool's frame
//! x, y, z (z its axis), r and c = (cos β1, sin β1, 0) of the wrist and its second axis at a from the tip (a square to y_h, in the
//! wrist's plane), tip and axis move with (θ, σ, L, β1, β2), L = |AB|, by
//!
//! | | tip along u, y, n | axis along x_h | along y_h |
//! |---|---|---|---|
//! | dθ | L + t_n, 0, −t_u | y_h·y | −x_h·y |
//! | dσ | 0, −t_n, t_y | y_h·u | −x_h·u |
//! | dL | 0, 0, 1 | 0 | 0 |
//! | dβ1 | r y_h | 0 | −sin β2 |
//! | dβ2 | (r − b1) w − (h − d1) c | −1 | 0 |
//!
//! so that dL and dβ2 drop out and a Newton step is a system of three. Its determinant, divided by cos θ to count dZ0 in
//! place of dL, is that of all five; where it is zero two configurations that hold the same tool meet.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::machine::Machine;
use crate::types::{Domain, Pose, ScrewLengths};
use crate::wrist::Wrist;

mod deflection;
mod error;
mod forward;
mod frame;
mod inverse;
mod rates;
mod state;
mod touch;

pub use deflection::{COMPENSATED_TO, MAX_COMPENSATION_ITERATIONS, MAX_DEFLECTIONS};
pub use error::{ToolDeflectionError, ToolError};
pub use inverse::MAX_INVERSE_ITERATIONS;
pub use rates::{JointMotion, ToolMotion, rest_to_rest_s};

/// Where the five axes of a machine stand.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration<T> {
    /// Of the moving platform.
    pub pose: Pose<T>,
    /// β1 and β2 of the wrist, rad.
    pub beta_rad: Vector2<T>,
}

/// What the five drives are told.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JointValues<T> {
    /// Of the three screws.
    pub lengths: ScrewLengths<T>,
    /// β1 and β2 of the wrist, rad.
    pub beta_rad: Vector2<T>,
}

/// A tool's tip and the direction of its axis from flange to tip, in B-xyz: what a part program asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tool<T> {
    /// m.
    pub tip_m: Vector3<T>,
    /// Of length 1 where a function gives it; any length above 0 where one takes it.
    pub axis: Vector3<T>,
}

/// T_h of the paper's Eq. 2: the tool's frame in B-xyz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ToolFrame<T> {
    /// The tip, m.
    pub tip_m: Vector3<T>,
    /// x, y and z of the frame in B-xyz, as columns; z is the tool's axis.
    pub axes: Matrix3<T>,
}

/// A solution of the five-axis inverse kinematics.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ToolSolution<T> {
    /// Where the five axes stand.
    pub configuration: Configuration<T>,
    /// What the drives are told.
    pub joints: JointValues<T>,
    /// Distance from the singularity locus, see [`FiveAxis::normalised_determinant`]: of the iterative inverse where its last step began.
    pub normalised_determinant: T,
    /// Evaluations of the Newton step; 0 in closed form.
    pub iterations: u8,
}

/// How a load moves a tool, in B-xyz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ToolDeflection<T> {
    /// Of the tip, m.
    pub translation_m: Vector3<T>,
    /// Of the tool, rad.
    pub rotation_rad: Vector3<T>,
    /// Whether the table may be trusted here; `None` without a table.
    pub domain: Option<Domain>,
}

/// What to command so that a loaded tool is where it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CompensatedTool<T> {
    /// What to command, and the configuration that the machine then would have without the load.
    pub solution: ToolSolution<T>,
    /// What the load does to the tool there.
    pub deflection: ToolDeflection<T>,
    /// How far the loaded tool then is from where it should be, by the model: the tip's distance, and home's Z0 times the axis's, m.
    pub remaining_m: T,
    /// Whether that is within [`COMPENSATED_TO`] of the deflection, and not the best of too few tries.
    pub converged: bool,
}

/// A parallel mechanism and its wrist.
///
/// ```
/// use pkm_core::nalgebra::{Vector2, Vector3};
/// use pkm_core::{FiveAxis, JointValues, ScrewLengths, Tool, ToolError, tables::reference};
/// let five = FiveAxis { machine: &reference::MACHINE_F32, wrist: &reference::WRIST_F32 };
/// // where the machine stands when it is switched on
/// let lengths = ScrewLengths { q_m: Vector3::new(0.5678, 0.5506, 0.5194) };
/// let (mut stands, Tool { tip_m, axis }) = five.forward(&JointValues { lengths, beta_rad: Vector2::new(0.2, -0.1) })?;
/// // 10 mm along x in steps of 1 mm
/// for step in 1..=10 {
///     let solution = five.inverse(&Tool { tip_m: tip_m + Vector3::x() * (1e-3 * step as f32), axis }, &stands)?;
///     stands = solution.configuration;
/// }
/// assert!((five.tool(&stands)?.tip_m.x - tip_m.x - 0.01).abs() < 1e-6);
/// # Ok::<(), ToolError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FiveAxis<'a, T> {
    /// The parallel mechanism.
    pub machine: &'a Machine<T>,
    /// The wrist.
    pub wrist: &'a Wrist<T>,
}

//! From configurations and joint values to the tool.

use nalgebra::Vector3;

use super::state::State;
use super::{Configuration, FiveAxis, JointValues, Tool, ToolError, ToolFrame};
use crate::kinematics::platform_axes;
use crate::linalg::{axes, is_finite};
use crate::scalar::Scalar;

impl<T: Scalar> FiveAxis<'_, T> {
    /// T_h of a configuration (Eq. 2).
    ///
    /// # Errors
    /// A number that is not finite, a pose that the parallel mechanism cannot take, a wrist joint beyond its limits.
    pub fn frame(&self, configuration: &Configuration<T>) -> Result<ToolFrame<T>, ToolError> {
        self.joints(configuration)?;
        Ok(self.frame_of(configuration))
    }

    pub(super) fn frame_of(&self, configuration: &Configuration<T>) -> ToolFrame<T> {
        let State { theta, sigma, l, beta } = State::of(configuration);
        let held = self.wrist.held(beta);
        let (sin, cos) = theta.sin_cos();
        let platform = platform_axes((sin, cos), sigma.sin_cos());
        let tip = platform * held.tip;
        ToolFrame { tip_m: Vector3::new(tip.x + l * sin, tip.y, tip.z + l * cos), axes: platform * held.axes() }
    }

    /// Tip and axis of a configuration.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn tool(&self, configuration: &Configuration<T>) -> Result<Tool<T>, ToolError> {
        let frame = self.frame(configuration)?;
        let [_, _, axis] = axes(&frame.axes);
        Ok(Tool { tip_m: frame.tip_m, axis })
    }

    /// Configuration, tip and axis of joint values.
    ///
    /// # Errors
    /// Those of [`Machine::forward`](crate::Machine::forward); a wrist joint beyond its limits.
    pub fn forward(&self, joints: &JointValues<T>) -> Result<(Configuration<T>, Tool<T>), ToolError> {
        let configuration = Configuration { pose: self.machine.forward(&joints.lengths)?, beta_rad: joints.beta_rad };
        Ok((configuration, self.tool(&configuration)?))
    }

    /// Joint values of a configuration.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn joints(&self, configuration: &Configuration<T>) -> Result<JointValues<T>, ToolError> {
        let Configuration { pose, beta_rad } = *configuration;
        if !is_finite(&beta_rad) {
            return Err(ToolError::NotFinite);
        }
        let lengths = self.machine.inverse(&pose)?;
        match self.wrist.beyond_limits(beta_rad) {
            Some(joint) => Err(ToolError::WristLimit { joint }),
            None => Ok(JointValues { lengths, beta_rad }),
        }
    }

    /// How far a configuration is from the singularity locus of the five axes: the determinant of ∂(tip, axis)/∂(θ, σ, Z0, β1, β2)
    /// as a share of that of the home configuration. 0 on the locus, negative beyond.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn normalised_determinant(&self, configuration: &Configuration<T>) -> Result<T, ToolError> {
        self.joints(configuration)?;
        Ok(self.wrist.determinant(&State::of(configuration)))
    }
}

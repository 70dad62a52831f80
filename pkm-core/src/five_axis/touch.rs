//! A reading at the tool of the five axes, as the estimator takes it.

use nalgebra::Matrix3;

use super::{Configuration, FiveAxis, ToolError};
use crate::estimation::Touch;
use crate::kinematics::platform_axes;
use crate::linalg::is_finite;
use crate::scalar::Scalar;
use crate::types::Wrench;

impl<T: Scalar> FiveAxis<'_, T> {
    /// Where and under which load the tool is read, for [`Estimator::learn`](crate::estimation::Estimator::learn), which takes tip and
    /// load in A-uvw.
    ///
    /// # Arguments
    /// * `wrench`: on the tool at its tip, in the axes of T_h.
    /// * `time_s`, `rise_k`: see [`Touch`].
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame); a load or a rise that is not finite.
    pub fn touch(
        &self,
        configuration: &Configuration<T>,
        wrench: &Wrench<T>,
        time_s: u32,
        rise_k: T,
    ) -> Result<Touch<T>, ToolError> {
        self.joints(configuration)?;
        if !(is_finite(&wrench.force_n) && is_finite(&wrench.moment_nm) && rise_k.is_finite()) {
            return Err(ToolError::NotFinite);
        }
        let held = self.wrist.held(configuration.beta_rad);
        let axes = held.axes();
        let wrench = Wrench { force_n: axes * wrench.force_n, moment_nm: axes * wrench.moment_nm };
        Ok(Touch { time_s, pose: configuration.pose, tip_m: held.tip, wrench, rise_k })
    }
}

impl<T: Scalar> Configuration<T> {
    /// Axes x, y, z of B in A-uvw, as columns: the directions of readings along them.
    pub fn base_axes(&self) -> Matrix3<T> {
        platform_axes(self.pose.theta_rad.sin_cos(), self.pose.sigma_rad.sin_cos()).transpose()
    }
}

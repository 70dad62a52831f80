//! From tip and axis to configurations.

use nalgebra::{Vector2, Vector3};

use super::state::State;
use super::{Configuration, FiveAxis, Tool, ToolError, ToolSolution};
use crate::linalg::{is_finite, unit};
use crate::scalar::Scalar;
use crate::types::Pose;

/// Most evaluations of the Newton step in [`FiveAxis::inverse`].
pub const MAX_INVERSE_ITERATIONS: u8 = 64;

impl<T: Scalar> FiveAxis<'_, T> {
    /// The configuration that holds a tool, on the same side of the singularity locus as `near`: damped Newton steps from there,
    /// at most [`MAX_INVERSE_ITERATIONS`]. From the last configuration of a path two or three do. At its start `near` is where the machine
    /// stands: [`forward`](Self::forward) of the measured joints.
    ///
    /// # Errors
    /// Not finite; singular: `near`, or the way to the tool, has a [normalised determinant](Self::normalised_determinant) below the wrist's margin;
    /// unreachable; then those of [`joints`](Self::joints).
    pub fn inverse(&self, tool: &Tool<T>, near: &Configuration<T>) -> Result<ToolSolution<T>, ToolError> {
        self.inverse_within(tool, near, &mut { MAX_INVERSE_ITERATIONS })
    }

    /// Takes its evaluations off `iterations_left`; none are left where these were too few.
    #[inline(never)] // one copy saves flash
    pub(super) fn inverse_within(
        &self,
        tool: &Tool<T>,
        near: &Configuration<T>,
        iterations_left: &mut u8,
    ) -> Result<ToolSolution<T>, ToolError> {
        let axis = unit(&tool.axis).filter(|_| is_finite(&tool.tip_m) && near.pose.is_finite());
        let Some(axis) = axis.filter(|_| is_finite(&near.beta_rad)) else {
            return Err(ToolError::NotFinite);
        };
        if *iterations_left == 0 {
            return Err(ToolError::Unreachable);
        }
        let target = Tool { tip_m: tool.tip_m, axis };
        let mut state = State::of(near);
        if !state.is_possible() {
            return Err(ToolError::Unreachable);
        }
        let mut newton = self.wrist.newton_step(&state, &target);
        if !(newton.determinant >= self.wrist.margin) {
            return Err(ToolError::Singular);
        }
        let (half, longest) = (T::from_f64(0.5), T::from_f64(0.5));
        let mut iterations = 1;
        *iterations_left -= 1;
        // a Newton step squares the error
        while !(newton.error <= T::EPSILON) {
            let [dtheta, dsigma, dl, dbeta1, dbeta2] = newton.step.into();
            let size = [dtheta, dsigma, dl / state.l, dbeta1, dbeta2]
                .into_iter()
                .fold(T::ZERO, |size, d| if d.abs() > size { d.abs() } else { size });
            let mut share = if size > longest { longest / size } else { T::ONE };
            let mut refused = ToolError::Unreachable;
            loop {
                if *iterations_left == 0 {
                    return Err(refused);
                }
                *iterations_left -= 1;
                iterations += 1;
                let next = state.moved(newton.step, share);
                if next.is_possible() {
                    let ahead = self.wrist.newton_step(&next, &target);
                    if !(ahead.determinant >= half * self.wrist.margin) {
                        refused = ToolError::Singular;
                    } else if ahead.error < newton.error {
                        (state, newton) = (next, ahead);
                        break;
                    }
                }
                share *= half;
            }
        }
        if newton.error > T::LAST_STEP && *iterations_left > 0 {
            // whether it helps or meets rounding: no more than this
            (*iterations_left, iterations) = (*iterations_left - 1, iterations + 1);
            let next = state.moved(newton.step, T::ONE);
            let ahead = self.wrist.newton_step(&next, &target);
            if ahead.error < newton.error {
                (state, newton) = (next, ahead);
            }
        }
        if !(newton.determinant >= self.wrist.margin) {
            return Err(ToolError::Singular);
        }
        let configuration = state.moved(newton.step, T::ONE).configuration();
        let joints = self.joints(&configuration)?;
        Ok(ToolSolution { configuration, joints, normalised_determinant: newton.determinant, iterations })
    }

    /// The solution for a tip with the wrist's joints at given angles, θ and σ within a right angle, in closed form: with
    /// the tip at t in A-uvw, t_v cos σ − t_w sin σ is y, and θ turns (t_u, L + t_v sin σ + t_w cos σ) to (x, z).
    ///
    /// # Errors
    /// Not finite; unreachable; those of [`joints`](Self::joints); singular: the [normalised determinant](Self::normalised_determinant) is below the
    /// wrist's margin.
    pub fn inverse_at(&self, tip_m: Vector3<T>, beta_rad: Vector2<T>) -> Result<ToolSolution<T>, ToolError> {
        let found = self.inverse_at_any_margin(tip_m, beta_rad);
        match &found {
            Ok(solution) if !(solution.normalised_determinant >= self.wrist.margin) => Err(ToolError::Singular),
            _ => found,
        }
    }

    /// The same, also where the machine is nearer to the singularity locus than the wrist's margin, on the side of home: for a
    /// controller that drives a machine out of there. [`ToolSolution::normalised_determinant`] says how near it is.
    ///
    /// # Errors
    /// Those of [`inverse_at`](Self::inverse_at); singular only on the locus and beyond it.
    pub fn inverse_at_any_margin(&self, tip_m: Vector3<T>, beta_rad: Vector2<T>) -> Result<ToolSolution<T>, ToolError> {
        if !(is_finite(&tip_m) && is_finite(&beta_rad)) {
            return Err(ToolError::NotFinite);
        }
        let ([x, y, z], [tu, tv, tw]) = (tip_m.into(), self.wrist.held(beta_rad).tip.into());
        let sigma = tv.atan2(tw) - y.atan2((tv * tv + tw * tw - y * y).sqrt());
        let (sin, cos) = sigma.sin_cos();
        let along_n = (x * x + z * z - tu * tu).sqrt();
        let l = along_n - tv * sin - tw * cos;
        let theta = (x * along_n - z * tu).atan2(x * tu + z * along_n);
        let state = State { theta, sigma, l, beta: beta_rad };
        // the root of a negative number is NaN and fails here
        if !state.is_possible() {
            return Err(ToolError::Unreachable);
        }
        let configuration = state.configuration();
        let joints = self.joints(&configuration)?;
        let normalised_determinant = self.wrist.determinant(&state);
        if !(normalised_determinant > T::ZERO) {
            return Err(ToolError::Singular);
        }
        Ok(ToolSolution { configuration, joints, normalised_determinant, iterations: 0 })
    }

    /// [`inverse`](Self::inverse) for a machine that does not stand near: from `near`, and if that finds nothing from
    /// seven configurations about home, tilted to either side. Not for a path: what it finds may be far from `near`.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse) from `near`.
    pub fn search(&self, tool: &Tool<T>, near: &Configuration<T>) -> Result<ToolSolution<T>, ToolError> {
        let refused = match self.inverse(tool, near) {
            Err(refused) if refused != ToolError::NotFinite => refused,
            done => return done,
        };
        let pose = Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: self.wrist.home_z0 };
        let seeds = [[0.0, 0.0], [0.0, -1.0], [0.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        for beta in seeds {
            let found = self.inverse(tool, &Configuration { pose, beta_rad: beta.map(T::from_f64).into() });
            if found.is_ok() {
                return found;
            }
        }
        Err(refused)
    }
}

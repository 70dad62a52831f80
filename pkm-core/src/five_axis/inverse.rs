//! From tip and axis to configurations.

use nalgebra::{Vector2, Vector3};

use super::state::State;
use super::{Configuration, FiveAxis, Hold, Tool, ToolError};
use crate::linalg::{is_finite, unit};
use crate::scalar::Scalar;
use crate::types::Pose;

/// Most configurations that [`FiveAxis::inverse`] looks at.
pub const MAX_LOOKS: u8 = 64;

impl<T: Scalar> FiveAxis<'_, T> {
    /// The configuration that holds a tool, on the same side of the singular surface as `near`: damped Newton steps from there,
    /// at most [`MAX_LOOKS`]. From the last configuration of a path two or three do. At its start `near` is where the machine
    /// stands: [`forward`](Self::forward) of the measured joints.
    ///
    /// # Errors
    /// Not finite; singular: `near`, or the way to the tool, has a [home share](Self::home_share) below the wrist's margin;
    /// unreachable; then those of [`joints`](Self::joints).
    pub fn inverse(&self, tool: &Tool<T>, near: &Configuration<T>) -> Result<Hold<T>, ToolError> {
        self.inverse_within(tool, near, &mut { MAX_LOOKS })
    }

    /// Takes what it looks at off `looks_left`; none are left where these were too few.
    #[inline(never)] // one copy saves flash
    pub(super) fn inverse_within(
        &self,
        tool: &Tool<T>,
        near: &Configuration<T>,
        looks_left: &mut u8,
    ) -> Result<Hold<T>, ToolError> {
        let axis = unit(&tool.axis).filter(|_| is_finite(&tool.tip_m) && near.pose.is_finite());
        let Some(axis) = axis.filter(|_| is_finite(&near.beta_rad)) else {
            return Err(ToolError::NotFinite);
        };
        let target = Tool { tip_m: tool.tip_m, axis };
        let mut state = State::of(near);
        if !state.is_possible() {
            return Err(ToolError::Unreachable);
        }
        let mut look = self.wrist.look(&state, &target);
        if !(look.share >= self.wrist.margin) {
            return Err(ToolError::Singular);
        }
        let (half, longest) = (T::from_f64(0.5), T::from_f64(0.5));
        let mut looks = 1;
        *looks_left = looks_left.saturating_sub(1);
        // a Newton step squares the error
        while !(look.error <= T::EPSILON) {
            let [dtheta, dsigma, dl, dbeta1, dbeta2] = look.step.into();
            let size = [dtheta, dsigma, dl / state.l, dbeta1, dbeta2]
                .into_iter()
                .fold(T::ZERO, |size, d| if d.abs() > size { d.abs() } else { size });
            let mut share = if size > longest { longest / size } else { T::ONE };
            let mut refused = ToolError::Unreachable;
            loop {
                if *looks_left == 0 {
                    return Err(refused);
                }
                *looks_left -= 1;
                looks += 1;
                let next = state.moved(look.step, share);
                if next.is_possible() {
                    let ahead = self.wrist.look(&next, &target);
                    if !(ahead.share >= half * self.wrist.margin) {
                        refused = ToolError::Singular;
                    } else if ahead.error < look.error {
                        (state, look) = (next, ahead);
                        break;
                    }
                }
                share *= half;
            }
        }
        if look.error > T::LAST_STEP && *looks_left > 0 {
            // whether it helps or meets rounding: no more than this
            (*looks_left, looks) = (*looks_left - 1, looks + 1);
            let next = state.moved(look.step, T::ONE);
            let ahead = self.wrist.look(&next, &target);
            if ahead.error < look.error {
                (state, look) = (next, ahead);
            }
        }
        if !(look.share >= self.wrist.margin) {
            return Err(ToolError::Singular);
        }
        let configuration = state.moved(look.step, T::ONE).configuration();
        let joints = self.joints(&configuration)?;
        Ok(Hold { configuration, joints, home_share: look.share, looks })
    }

    /// How the machine holds a tip with the wrist's joints at given angles, θ and σ within a right angle, in closed form: with
    /// the tip at t in A-uvw, t_v cos σ − t_w sin σ is y, and θ turns (t_u, L + t_v sin σ + t_w cos σ) to (x, z).
    ///
    /// # Errors
    /// Not finite; unreachable; those of [`joints`](Self::joints); singular: the [home share](Self::home_share) is below the
    /// wrist's margin.
    pub fn inverse_at(&self, tip_m: Vector3<T>, beta_rad: Vector2<T>) -> Result<Hold<T>, ToolError> {
        let found = self.inverse_at_any_margin(tip_m, beta_rad);
        match &found {
            Ok(hold) if !(hold.home_share >= self.wrist.margin) => Err(ToolError::Singular),
            _ => found,
        }
    }

    /// The same, also where the machine is nearer to the singularity locus than the wrist's margin, on the side of home: for a
    /// controller that drives a machine out of there. [`Hold::home_share`] says how near it is.
    ///
    /// # Errors
    /// Those of [`inverse_at`](Self::inverse_at); singular only on the locus and beyond it.
    pub fn inverse_at_any_margin(&self, tip_m: Vector3<T>, beta_rad: Vector2<T>) -> Result<Hold<T>, ToolError> {
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
        let home_share = self.wrist.share(&state);
        if !(home_share > T::ZERO) {
            return Err(ToolError::Singular);
        }
        Ok(Hold { configuration, joints, home_share, looks: 0 })
    }

    /// [`inverse`](Self::inverse) for a machine that does not stand near: from `near`, and if that finds nothing from
    /// seven configurations about home, tilted to either side. Not for a path: what it finds may be far from `near`.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse) from `near`.
    pub fn search(&self, tool: &Tool<T>, near: &Configuration<T>) -> Result<Hold<T>, ToolError> {
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

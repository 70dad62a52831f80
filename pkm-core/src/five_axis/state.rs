//! One Newton iteration of the five axes (table in the [module's documentation](super)).

use super::{Configuration, Tool};
use crate::scalar::Scalar;
use crate::types::Pose;
use crate::vector::{cross, dot, less};
use crate::wrist::{Held, Wrist};

/// A configuration as the solver turns it about.
#[derive(Clone, Copy)]
pub(super) struct State<T> {
    pub theta: T,
    pub sigma: T,
    pub l: T,
    pub beta: [T; 2],
}

/// What a state shows.
pub(super) struct Look<T> {
    /// Square of what tip (as a share of L) and axis are off.
    pub error: T,
    /// See [`FiveAxis::home_share`](super::FiveAxis::home_share).
    pub share: T,
    /// Newton step to the target: θ, σ, L, β1, β2.
    pub step: [T; 5],
}

impl<T: Scalar> State<T> {
    pub fn of(c: &Configuration<T>) -> Self {
        let theta = c.pose.theta_rad;
        Self { theta, sigma: c.pose.sigma_rad, l: c.pose.z0_m / theta.sin_cos().1, beta: c.beta_rad }
    }

    pub fn configuration(&self) -> Configuration<T> {
        // not `cos`: in `f32` that goes by way of `f64`
        let z0_m = self.l * self.theta.sin_cos().1;
        Configuration { pose: Pose { theta_rad: self.theta, sigma_rad: self.sigma, z0_m }, beta_rad: self.beta }
    }

    pub fn moved(&self, [theta, sigma, l, beta1, beta2]: [T; 5], share: T) -> Self {
        Self {
            theta: self.theta + share * theta,
            sigma: self.sigma + share * sigma,
            l: self.l + share * l,
            beta: [self.beta[0] + share * beta1, self.beta[1] + share * beta2],
        }
    }

    pub fn is_possible(&self) -> bool {
        let right_angle = T::from_f64(core::f64::consts::FRAC_PI_2);
        self.theta.abs() < right_angle && self.sigma.abs() < right_angle && self.l > T::ZERO
    }
}

/// A state in the axes u, y of B and n, and how tip and axis move there.
struct Motion<T> {
    tip: [T; 3],
    /// Of T_h.
    axes: [[T; 3]; 3],
    /// Radius of the tip about the first axis.
    r: T,
    /// The tip by −β2.
    swing: [T; 3],
    /// With β2 by the axis along x and L by the tip along n, what is left: the tip along u and y, the axis along y, by θ, σ,
    /// β1.
    m: [[T; 3]; 3],
    /// Of the last two rows, and with the first: their cross product, and the determinant.
    m12: [T; 3],
    determinant: T,
}

impl<T: Scalar> Wrist<T> {
    #[inline(always)] // in `look` its parts stay in registers
    fn motion(&self, state: &State<T>) -> Motion<T> {
        let (sin, cos) = state.sigma.sin_cos();
        let held = self.held(state.beta);
        let Held { sin1, cos1, sin2, r, h, .. } = held;
        let turned = |[u, v, w]: [T; 3]| [u, v * cos - w * sin, v * sin + w * cos];
        let tip = turned(held.tip);
        let axes = held.axes().map(turned);
        let ([x, y, _], tip_n) = (axes, tip[2]);
        let arm = (r - self.first_b, h - self.first_d);
        let swing = [-arm.1 * cos1, -arm.1 * sin1 * cos - arm.0 * sin, -arm.1 * sin1 * sin + arm.0 * cos];
        let m = [
            [state.l + tip_n + swing[0] * y[1], swing[0] * y[0], r * y[0]],
            [swing[1] * y[1], swing[1] * y[0] - tip_n, r * y[1]],
            [x[1], x[0], sin2],
        ];
        let m12 = cross(m[1], m[2]);
        Motion { tip, axes, r, swing, m, m12, determinant: dot(m[0], m12) }
    }

    /// See [`FiveAxis::home_share`](super::FiveAxis::home_share).
    fn share_of(&self, determinant: T, cos_theta: T) -> T {
        -determinant / (cos_theta * self.home_determinant)
    }

    /// See [`FiveAxis::home_share`](super::FiveAxis::home_share).
    #[inline(never)]
    pub(super) fn share(&self, state: &State<T>) -> T {
        self.share_of(self.motion(state).determinant, state.theta.sin_cos().1)
    }

    #[inline(never)]
    pub(super) fn look(&self, state: &State<T>, target: &Tool<T>) -> Look<T> {
        let (sin_theta, cos_theta) = state.theta.sin_cos();
        let Motion { tip: [tip_u, tip_y, tip_n], axes: [x, y, z], r, swing, m, m12, determinant } = self.motion(state);
        let l = state.l;
        // into the axes u, y, n from B-xyz
        let seen = |[x, y, z]: [T; 3]| [x * cos_theta - z * sin_theta, y, x * sin_theta + z * cos_theta];
        let goal = seen(target.tip_m);
        let off = less(goal, [tip_u, tip_y, tip_n + l]);
        let axis = seen(target.axis);
        let turn = less(axis, z);
        let error = dot(off, off) / (l * l) + dot(turn, turn);
        let [mut turn_x, mut turn_y] = [dot(turn, x), dot(turn, y)];
        if dot(axis, z) < T::ZERO {
            // beyond a right angle the difference shrinks again
            let size = (turn_x * turn_x + turn_y * turn_y).sqrt() + T::SLACK;
            (turn_x, turn_y) = (turn_x / size, turn_y / size);
        }
        let b = [off[0] + swing[0] * turn_x, off[1] + swing[1] * turn_x, -turn_y];
        let (m20, m01) = (cross(m[2], m[0]), cross(m[0], m[1]));
        let solved = |i: usize| (b[0] * m12[i] + b[1] * m20[i] + b[2] * m01[i]) / determinant;
        let (dtheta, dsigma, dbeta1) = (solved(0), solved(1), solved(2));
        let dbeta2 = y[1] * dtheta + y[0] * dsigma - turn_x;
        let dl = off[2] + tip_u * dtheta - tip_y * dsigma - r * y[2] * dbeta1 - swing[2] * dbeta2;
        Look { error, share: self.share_of(determinant, cos_theta), step: [dtheta, dsigma, dl, dbeta1, dbeta2] }
    }
}

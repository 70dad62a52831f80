//! One Newton iteration of the five axes (table in the [module's documentation](super)).

use nalgebra::{SVector, Vector2, Vector3};

use super::{Configuration, Tool};
use crate::linalg::axes;
use crate::scalar::Scalar;
use crate::types::Pose;
use crate::wrist::{Wrist, WristPosture};

/// A configuration as the solver turns it about.
#[derive(Clone, Copy)]
pub(super) struct State<T> {
    pub theta: T,
    pub sigma: T,
    pub l: T,
    pub beta: Vector2<T>,
}

/// What a state shows.
pub(super) struct NewtonStep<T> {
    /// Square of what tip (as a share of L) and axis are off.
    pub error: T,
    /// See [`FiveAxis::normalised_determinant`](super::FiveAxis::normalised_determinant).
    pub determinant: T,
    /// Newton step to the target: θ, σ, L, β1, β2.
    pub step: SVector<T, 5>,
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

    pub fn moved(&self, step: SVector<T, 5>, share: T) -> Self {
        let [theta, sigma, l, beta1, beta2] = step.into();
        Self {
            theta: self.theta + share * theta,
            sigma: self.sigma + share * sigma,
            l: self.l + share * l,
            beta: Vector2::new(self.beta.x + share * beta1, self.beta.y + share * beta2),
        }
    }

    pub fn is_possible(&self) -> bool {
        let right_angle = T::from_f64(core::f64::consts::FRAC_PI_2);
        self.theta.abs() < right_angle && self.sigma.abs() < right_angle && self.l > T::ZERO
    }
}

/// A state in the axes u, y of B and n, and how tip and axis move there.
struct Motion<T> {
    tip: Vector3<T>,
    /// Of T_h.
    axes: [Vector3<T>; 3],
    /// Radius of the tip about the first axis.
    r: T,
    /// The tip by −β2.
    swing: Vector3<T>,
    /// The 3×3 system that remains after β2 and L are eliminated: the tip along u and y and the axis along y, by θ, σ and
    /// β1.
    m: [Vector3<T>; 3],
    /// Of the last two rows, and with the first: their cross product, and the determinant.
    m12: Vector3<T>,
    determinant: T,
}

impl<T: Scalar> Motion<T> {
    /// θ, σ, L, β1, β2 by which the tip moves so along u, y and n, and the axis so along x and y of T_h.
    #[inline(always)] // in `newton_step` its parts stay in registers
    fn step(&self, off: Vector3<T>, [turn_x, turn_y]: [T; 2]) -> SVector<T, 5> {
        let Self { tip, axes: [_, y, _], r, swing, m, m12, determinant } = self;
        let b = Vector3::new(off.x + swing.x * turn_x, off.y + swing.y * turn_x, -turn_y);
        let (m20, m01) = (m[2].cross(&m[0]), m[0].cross(&m[1]));
        let [dtheta, dsigma, dbeta1] = ((*m12 * b.x + m20 * b.y + m01 * b.z) / *determinant).into();
        let dbeta2 = y.y * dtheta + y.x * dsigma - turn_x;
        let dl = off.z + tip.x * dtheta - tip.y * dsigma - *r * y.z * dbeta1 - swing.z * dbeta2;
        [dtheta, dsigma, dl, dbeta1, dbeta2].into()
    }

    /// The same, of an axis that moves so.
    #[inline(always)] // its parts stay in registers
    fn step_by(&self, [tip, axis]: [Vector3<T>; 2]) -> SVector<T, 5> {
        let [x, y, _] = self.axes;
        self.step(tip, [axis.dot(&x), axis.dot(&y)])
    }
}

impl<T: Scalar> Wrist<T> {
    #[inline(always)] // in `newton_step` its parts stay in registers
    fn motion(&self, state: &State<T>) -> Motion<T> {
        let (sin, cos) = state.sigma.sin_cos();
        let held = self.held(state.beta);
        let WristPosture { sin1, cos1, sin2, r, h, .. } = held;
        let turned = |at: Vector3<T>| Vector3::new(at.x, at.y * cos - at.z * sin, at.y * sin + at.z * cos);
        let tip = turned(held.tip);
        let axes = axes(&held.axes()).map(turned);
        let ([x, y, _], tip_n) = (axes, tip.z);
        let arm = (r - self.first_b, h - self.first_d);
        let swing = Vector3::new(-arm.1 * cos1, -arm.1 * sin1 * cos - arm.0 * sin, -arm.1 * sin1 * sin + arm.0 * cos);
        let m = [
            Vector3::new(state.l + tip_n + swing.x * y.y, swing.x * y.x, r * y.x),
            Vector3::new(swing.y * y.y, swing.y * y.x - tip_n, r * y.y),
            Vector3::new(x.y, x.x, sin2),
        ];
        let m12 = m[1].cross(&m[2]);
        Motion { tip, axes, r, swing, m, m12, determinant: m[0].dot(&m12) }
    }

    /// See [`FiveAxis::normalised_determinant`](super::FiveAxis::normalised_determinant).
    fn normalised(&self, determinant: T, cos_theta: T) -> T {
        -determinant / (cos_theta * self.home_determinant)
    }

    /// See [`FiveAxis::normalised_determinant`](super::FiveAxis::normalised_determinant).
    #[inline(never)]
    pub(super) fn determinant(&self, state: &State<T>) -> T {
        self.normalised(self.motion(state).determinant, state.theta.sin_cos().1)
    }

    #[inline(never)]
    pub(super) fn newton_step(&self, state: &State<T>, target: &Tool<T>) -> NewtonStep<T> {
        let (sin_theta, cos_theta) = state.theta.sin_cos();
        let motion = self.motion(state);
        let (tip, [x, y, z]) = (motion.tip, motion.axes);
        let l = state.l;
        // into the axes u, y, n from B-xyz
        let seen = |at: Vector3<T>| {
            Vector3::new(at.x * cos_theta - at.z * sin_theta, at.y, at.x * sin_theta + at.z * cos_theta)
        };
        let goal = seen(target.tip_m);
        let off = goal - Vector3::new(tip.x, tip.y, tip.z + l);
        let axis = seen(target.axis);
        let turn = axis - z;
        let error = off.dot(&off) / (l * l) + turn.dot(&turn);
        let [mut turn_x, mut turn_y] = [turn.dot(&x), turn.dot(&y)];
        if axis.dot(&z) < T::ZERO {
            // beyond a right angle the difference shrinks again
            let size = (turn_x * turn_x + turn_y * turn_y).sqrt() + T::SLACK;
            (turn_x, turn_y) = (turn_x / size, turn_y / size);
        }
        let step = motion.step(off, [turn_x, turn_y]);
        NewtonStep { error, determinant: self.normalised(motion.determinant, cos_theta), step }
    }

    /// Normalised determinant, first and second time derivatives of θ, σ, L, β1, β2 from those of tip and axis in the axes u, y, n.
    #[inline(never)]
    pub(super) fn rates(
        &self,
        state: &State<T>,
        velocity: [Vector3<T>; 2],
        acceleration: [Vector3<T>; 2],
    ) -> (T, [SVector<T, 5>; 2]) {
        let motion = &self.motion(state);
        let first = motion.step_by(velocity);
        let second = motion.step_by(self.beyond_carried(state, motion, &first, acceleration));
        (self.normalised(motion.determinant, state.theta.sin_cos().1), [first, second])
    }

    /// Normalised determinant, and second derivatives of θ, σ, L, β1, β2 along a way on which tip and axis go straight, from the first ones.
    #[inline(never)]
    pub(super) fn straight(&self, state: &State<T>, first: &SVector<T, 5>) -> (T, SVector<T, 5>) {
        let motion = &self.motion(state);
        let second = motion.step_by(self.beyond_carried(state, motion, first, [Vector3::zeros(); 2]));
        (self.normalised(motion.determinant, state.theta.sin_cos().1), second)
    }

    /// Acceleration of tip and axis less the part that steady rates of θ, σ, L, β1, β2 cause.
    #[inline(always)] // its parts stay in registers
    fn beyond_carried(
        &self,
        state: &State<T>,
        motion: &Motion<T>,
        first: &SVector<T, 5>,
        [tip_rate, axis_rate]: [Vector3<T>; 2],
    ) -> [Vector3<T>; 2] {
        let [_, y, z] = motion.axes;
        let [dtheta, dsigma, dl, dbeta1, dbeta2] = (*first).into();
        let (o, two) = (T::ZERO, T::from_f64(2.0));
        let ((sin, cos), (sin1, cos1)) = (state.sigma.sin_cos(), state.beta.x.sin_cos());
        let w = Vector3::new(o, -sin, cos);
        // turns of platform, first link and tool, and their rates
        let platform = Vector3::new(dsigma, dtheta, o);
        let link = platform + w * dbeta1;
        let tool = link - y * dbeta2;
        let platform_rate = Vector3::new(o, o, -dsigma * dtheta);
        let link_rate = platform_rate + platform.cross(&w) * dbeta1;
        let tool_rate = link_rate - link.cross(&y) * dbeta2;
        let carried =
            |at: Vector3<T>, turn: Vector3<T>, rate: Vector3<T>| rate.cross(&at) + turn.cross(&turn.cross(&at));
        // from A to the first axis, from there to the second, from there to the tip
        let to_first = Vector3::new(self.offset, o, o);
        let to_second = Vector3::new(cos1, sin1 * cos, sin1 * sin) * self.first_b + w * self.first_d;
        let to_tip = motion.tip - to_first - to_second;
        let a = Vector3::new(two * dl * dtheta, o, -(state.l * dtheta * dtheta));
        let tip = a
            + carried(to_first, platform, platform_rate)
            + carried(to_second, link, link_rate)
            + carried(to_tip, tool, tool_rate);
        [tip_rate - tip, axis_rate - carried(z, tool, tool_rate)]
    }
}

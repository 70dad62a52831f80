//! How fast the joints move when the tool moves.
//!
//! With the rates of (θ, σ, L, β1, β2) the platform turns by σ' u + θ' y, the wrist's first link by β1' w beyond that, the tool by −β2' y_h
//! beyond that. What is carried along by a steady turn accelerates by the rate of the turn's axis and toward it, A besides by
//! 2 L' θ' u − L θ'² n: that is the time derivative of the Jacobian times the rates. The rest of the tool's acceleration is a Newton step's
//! right side, as the tool's velocity is.

use nalgebra::{SVector, Vector2, Vector3};

use super::state::State;
use super::{Configuration, FiveAxis, ToolError};
use crate::kinematics::Posture;
use crate::linalg::is_finite;
use crate::machine::Sizes;
use crate::scalar::Scalar;

/// How tip and axis of a tool move, in B-xyz. What of the axis's rates is along the axis does not count: its length is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ToolMotion<T> {
    /// m/s.
    pub tip_m_per_s: Vector3<T>,
    /// First time derivative of the axis, of length 1, 1/s: ω × axis.
    pub axis_per_s: Vector3<T>,
    /// m/s².
    pub tip_m_per_s2: Vector3<T>,
    /// Second time derivative of the axis, 1/s².
    pub axis_per_s2: Vector3<T>,
}

/// How the joints move: screws in m/s and m/s², wrist in rad/s and rad/s².
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JointMotion<T> {
    /// q1, q2, q3, β1, β2 per second.
    pub velocity: SVector<T, 5>,
    /// The same per second squared.
    pub acceleration: SVector<T, 5>,
}

impl<T: Scalar> JointMotion<T> {
    /// The greatest share, at most 1, of the feed at which no joint is faster and none accelerates more than its limit, on the same curve at a
    /// steady feed: velocities go with the share, accelerations with its square. 0 where a number is NaN, or a joint moves whose limit is 0.
    ///
    /// # Arguments
    /// * `velocity`, `acceleration`: greatest sizes for each joint, in the units of the fields.
    pub fn feed_share(&self, velocity: &SVector<T, 5>, acceleration: &SVector<T, 5>) -> T {
        let least = |share: T, of: T| if of < share { of } else { share };
        let mut share = T::ONE;
        for joint in 0..5 {
            let (v, a) = (self.velocity.as_slice()[joint].abs(), self.acceleration.as_slice()[joint].abs());
            let (most_v, most_a) = (velocity.as_slice()[joint], acceleration.as_slice()[joint]);
            if !(v <= most_v) {
                // NaN is above no limit either
                share = least(share, if most_v > T::ZERO && v > most_v { most_v / v } else { T::ZERO });
            }
            if !(a <= most_a) {
                share = least(share, if most_a > T::ZERO && a > most_a { (most_a / a).sqrt() } else { T::ZERO });
            }
        }
        share
    }
}

/// Least time in s in which a joint goes a distance from rest to rest, if it speeds up and slows down evenly: with its greatest velocity in
/// between, where the distance is long enough for that.
///
/// # Arguments
/// * `distance` (of any sign), `velocity`, `acceleration`: m, m/s, m/s²; or rad, rad/s, rad/s²; both limits above 0.
pub fn rest_to_rest_s<T: Scalar>(distance: T, velocity: T, acceleration: T) -> T {
    let distance = distance.abs();
    if distance * acceleration < velocity * velocity {
        let half = (distance / acceleration).sqrt();
        half + half
    } else {
        distance / velocity + velocity / acceleration
    }
}

impl<T: Scalar> FiveAxis<'_, T> {
    /// Velocities and accelerations of the joints that move the tool as asked, in closed form.
    ///
    /// Velocities are within 1e-8 and accelerations within 1e-5 of differences of [`inverse`](Self::inverse) in `f64`, relative to the greatest
    /// joint's, which is what the differences are worth; `f32` is within 2e-5 of `f64`, all where the
    /// [normalised determinant](Self::normalised_determinant) is 0.1 and more.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame); singular: the [normalised determinant](Self::normalised_determinant) is below the wrist's margin; a motion, or what comes of
    /// it, that is not finite.
    ///
    /// ```
    /// use pkm_core::five_axis::ToolMotion;
    /// use pkm_core::nalgebra::{Vector2, Vector3, Vector5};
    /// use pkm_core::{Configuration, FiveAxis, Pose, ToolError, tables::reference};
    /// let five = FiveAxis { machine: &reference::MACHINE_F64, wrist: &reference::WRIST_F64 };
    /// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    /// let stands = Configuration { pose, beta_rad: Vector2::new(0.3, -0.2) };
    /// let o = Vector3::zeros();
    /// // 6 m/min along x, the axis held
    /// let along = ToolMotion { tip_m_per_s: Vector3::new(0.1, 0.0, 0.0), axis_per_s: o, tip_m_per_s2: o, axis_per_s2: o };
    /// let joints = five.joint_motion(&stands, &along)?;
    /// let (fastest, strongest) = (Vector5::new(0.1, 0.1, 0.1, 1.0, 1.0), Vector5::new(2.0, 2.0, 2.0, 10.0, 10.0));
    /// let share = joints.feed_share(&fastest, &strongest);
    /// assert!(share > 0.1 && share <= 1.0);
    /// # Ok::<(), ToolError>(())
    /// ```
    pub fn joint_motion(
        &self,
        configuration: &Configuration<T>,
        motion: &ToolMotion<T>,
    ) -> Result<JointMotion<T>, ToolError> {
        self.joints(configuration)?;
        let posture = &self.machine.posture(&configuration.pose)?;
        let (sin, cos) = (posture.sin_theta, posture.cos_theta);
        // into the axes u, y, n from B-xyz
        let seen = |v: &Vector3<T>| Vector3::new(v.x * cos - v.z * sin, v.y, v.x * sin + v.z * cos);
        let velocity = [seen(&motion.tip_m_per_s), seen(&motion.axis_per_s)];
        let acceleration = [seen(&motion.tip_m_per_s2), seen(&motion.axis_per_s2)];
        let (determinant, rates) = self.wrist.rates(&State::of(configuration), velocity, acceleration);
        if !(determinant >= self.wrist.margin) {
            return Err(ToolError::Singular);
        }
        let joints = self.machine.declared.joint_motion(posture, &rates);
        let finite = is_finite(&joints.velocity) && is_finite(&joints.acceleration);
        if finite { Ok(joints) } else { Err(ToolError::NotFinite) }
    }

    /// Second derivative of the joints along a way on which tip and axis go straight, and which the joints begin by `way`. `None` nearer
    /// to the singularity locus than the wrist's margin, or where the machine cannot stand.
    #[inline(never)]
    pub(crate) fn straight(&self, configuration: &Configuration<T>, way: &SVector<T, 5>) -> Option<SVector<T, 5>> {
        let posture = &self.machine.posture(&configuration.pose).ok()?;
        let declared = &self.machine.declared;
        let [dq1, dq2, dq3, dbeta1, dbeta2] = (*way).into();
        let [q1, q2, q3] = posture.q.into();
        let [dtheta, dsigma, dl] = declared.rates(posture, [q1 * dq1, q2 * dq2, q3 * dq3]);
        let first = [dtheta, dsigma, dl, dbeta1, dbeta2].into();
        let (determinant, second) = self.wrist.straight(&State::of(configuration), &first);
        let second = declared.joint_motion(posture, &[first, second]).acceleration;
        (determinant >= self.wrist.margin && is_finite(&second)).then_some(second)
    }
}

impl<T: Scalar> Sizes<T> {
    /// From first and second time derivatives of (θ, σ, L, β1, β2). Of a limb with components x and y, q² = x² + y².
    pub(crate) fn joint_motion(&self, p: &Posture<T>, [first, second]: &[SVector<T, 5>; 2]) -> JointMotion<T> {
        let [dtheta, dsigma, dl, dbeta1, dbeta2] = (*first).into();
        let [ddtheta, ddsigma, ddl, ddbeta1, ddbeta2] = (*second).into();
        let of_limb = |q: T, at: [T; 2], d: [T; 2], dd: [T; 2]| {
            let velocity = (at[0] * d[0] + at[1] * d[1]) / q;
            let squares = d[0] * d[0] + d[1] * d[1] - velocity * velocity;
            [velocity, (squares + at[0] * dd[0] + at[1] * dd[1]) / q]
        };
        let (a1_sin, a1_cos) = (self.a1 * p.sin_sigma, self.a1 * p.cos_sigma);
        // of what a1 and the turn by σ give along n, and across it
        let (d_n, dd_n) = (a1_cos * dsigma, a1_cos * ddsigma - a1_sin * dsigma * dsigma);
        let (d_y, dd_y) = (a1_sin * dsigma, a1_sin * ddsigma + a1_cos * dsigma * dsigma);
        let (b2_sin, b2_cos) = (self.b2 * p.sin_theta, self.b2 * p.cos_theta);
        let d_3 = [b2_sin * dtheta, dl - b2_cos * dtheta];
        let dd_3 = [b2_sin * ddtheta + b2_cos * dtheta * dtheta, ddl - b2_cos * ddtheta + b2_sin * dtheta * dtheta];
        let [q1, q2, q3] = p.q.into();
        let one = of_limb(q1, [p.along_y[0], p.along_n[0]], [d_y, dl - d_n], [dd_y, ddl - dd_n]);
        let two = of_limb(q2, [p.along_y[1], p.along_n[1]], [-d_y, dl + d_n], [-dd_y, ddl + dd_n]);
        let three = of_limb(q3, p.limb_3, d_3, dd_3);
        let all = |i: usize, wrist: Vector2<T>| [one[i], two[i], three[i], wrist.x, wrist.y].into();
        JointMotion {
            velocity: all(0, Vector2::new(dbeta1, dbeta2)),
            acceleration: all(1, Vector2::new(ddbeta1, ddbeta2)),
        }
    }
}

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
//! place of dL, is that of all five; where it vanishes two configurations meet that hold the tool alike.

use core::fmt;

use crate::compensation;
use crate::correction::{CorrectionError, CorrectionTable};
use crate::kinematics::KinematicsError;
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::stiffness::{self, Stiffness, StiffnessError};
use crate::types::{Deflection, Domain, Pose, ScrewLengths, Wrench};
use crate::vector::{combined, cross, dot, finite, less, unit};
use crate::wrist::{Held, Wrist};

/// Most configurations that [`FiveAxis::inverse`] looks at.
pub const MAX_LOOKS: u8 = 64;
/// Most times that [`FiveAxis::compensated`] works out a deflection.
pub const MAX_DEFLECTIONS: usize = 8;
/// What [`FiveAxis::compensated`] leaves of a deflection, at the most: of the tip's plus home's Z0 times the axis's.
pub const COMPENSATED_TO: f64 = 1e-4;

/// Where the five axes of a machine stand.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration<T> {
    /// Of the moving platform.
    pub pose: Pose<T>,
    /// β1 and β2 of the wrist, rad.
    pub beta_rad: [T; 2],
}

/// What the five drives are told.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JointValues<T> {
    /// Of the three screws.
    pub lengths: ScrewLengths<T>,
    /// β1 and β2 of the wrist, rad.
    pub beta_rad: [T; 2],
}

/// A tool's tip and the direction of its axis from flange to tip, in B-xyz: what a part program asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tool<T> {
    /// m.
    pub tip_m: [T; 3],
    /// Of length 1 where a function gives it; any length above 0 where one takes it.
    pub axis: [T; 3],
}

/// T_h of the paper's Eq. 2: the tool's frame in B-xyz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ToolFrame<T> {
    /// The tip, m.
    pub tip_m: [T; 3],
    /// x, y and z of the frame in B-xyz; z is the tool's axis.
    pub axes: [[T; 3]; 3],
}

/// How a machine holds a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hold<T> {
    /// Where the five axes stand.
    pub configuration: Configuration<T>,
    /// What the drives are told.
    pub joints: JointValues<T>,
    /// Distance from the singular surface, see [`FiveAxis::home_share`].
    pub home_share: T,
    /// Configurations that were looked at on the way; 0 in closed form.
    pub looks: u8,
}

/// Why there is no configuration for a tool, or no tool for a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ToolError {
    /// An input is NaN or infinite, or an axis has no direction.
    NotFinite,
    /// Out of the machine's reach from where it stands, or where it is said to stand is nowhere (Z0 not above 0, an angle
    /// beyond ±90°).
    Unreachable,
    /// Where it stands, or on the way, two configurations meet that hold the tool alike: the home share of the determinant is
    /// below the wrist's margin.
    Singular,
    /// A frame is no rotation, or one that these five axes cannot take.
    Inconsistent,
    /// A wrist joint would leave its limits. Joints count from 1.
    WristLimit {
        /// The first that does.
        joint: u8,
    },
    /// The parallel mechanism cannot take the pose.
    Kinematics(KinematicsError),
}

impl fmt::Display for ToolError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("an input is not a finite number, or an axis has no direction"),
            Self::Unreachable => f.write_str("out of reach from where the machine stands"),
            Self::Singular => f.write_str("too near to a singularity of the five axes"),
            Self::Inconsistent => f.write_str("the frame is none that these five axes can take"),
            Self::WristLimit { joint } => write!(f, "wrist joint {joint} would leave its limits"),
            Self::Kinematics(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for ToolError {}

impl From<KinematicsError> for ToolError {
    fn from(e: KinematicsError) -> Self {
        Self::Kinematics(e)
    }
}

/// Why a deflection of the tool cannot be worked out or compensated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ToolDeflectionError {
    /// There is no configuration.
    Tool(ToolError),
    /// There is no stiffness or no deflection in it.
    Stiffness(CorrectionError),
    /// The deflection changes too much on the way to be made up for.
    NotConverged,
}

impl fmt::Display for ToolDeflectionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tool(e) => e.fmt(f),
            Self::Stiffness(e) => e.fmt(f),
            Self::NotConverged => f.write_str("the deflection changes too much on the way to be made up for"),
        }
    }
}

impl core::error::Error for ToolDeflectionError {}

impl<E: Into<ToolError>> From<E> for ToolDeflectionError {
    fn from(e: E) -> Self {
        Self::Tool(e.into())
    }
}

impl From<CorrectionError> for ToolDeflectionError {
    fn from(e: CorrectionError) -> Self {
        Self::Stiffness(e)
    }
}

impl From<StiffnessError> for ToolDeflectionError {
    fn from(e: StiffnessError) -> Self {
        Self::Stiffness(e.into())
    }
}

/// How a load moves a tool, in B-xyz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ToolDeflection<T> {
    /// Of the tip, m.
    pub translation_m: [T; 3],
    /// Of the tool, rad.
    pub rotation_rad: [T; 3],
    /// Whether the table may be trusted here; `None` without a table.
    pub domain: Option<Domain>,
}

/// What to command so that a loaded tool is where it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CompensatedTool<T> {
    /// What to command, and the configuration that the machine then would have without the load.
    pub hold: Hold<T>,
    /// What the load does to the tool there.
    pub deflection: ToolDeflection<T>,
}

/// A parallel mechanism and its wrist.
///
/// ```
/// use pkm_core::{FiveAxis, JointValues, ScrewLengths, Tool, ToolError, tables::reference};
/// let five = FiveAxis { machine: &reference::MACHINE_F32, wrist: &reference::WRIST_F32 };
/// // where the machine stands when it is switched on
/// let measured = JointValues { lengths: ScrewLengths { q_m: [0.5678, 0.5506, 0.5194] }, beta_rad: [0.2, -0.1] };
/// let (mut stands, Tool { tip_m: [x, y, z], axis }) = five.forward(&measured)?;
/// // 10 mm along x in steps of 1 mm
/// for step in 1..=10 {
///     let hold = five.inverse(&Tool { tip_m: [x + 1e-3 * step as f32, y, z], axis }, &stands)?;
///     stands = hold.configuration;
/// }
/// assert!((five.tool(&stands)?.tip_m[0] - x - 0.01).abs() < 1e-6);
/// # Ok::<(), ToolError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FiveAxis<'a, T> {
    /// The parallel mechanism.
    pub machine: &'a Machine<T>,
    /// The wrist.
    pub wrist: &'a Wrist<T>,
}

/// A configuration as the solver turns it about.
#[derive(Clone, Copy)]
struct State<T> {
    theta: T,
    sigma: T,
    l: T,
    beta: [T; 2],
}

/// What a state shows.
struct Look<T> {
    /// Square of what tip (as a share of L) and axis are off.
    error: T,
    /// See [`FiveAxis::home_share`].
    share: T,
    /// Newton step to the target: θ, σ, L, β1, β2.
    step: [T; 5],
}

impl<T: Scalar> State<T> {
    fn of(c: &Configuration<T>) -> Self {
        let theta = c.pose.theta_rad;
        Self { theta, sigma: c.pose.sigma_rad, l: c.pose.z0_m / theta.sin_cos().1, beta: c.beta_rad }
    }

    fn configuration(&self) -> Configuration<T> {
        // not `cos`: in `f32` that goes by way of `f64`
        let z0_m = self.l * self.theta.sin_cos().1;
        Configuration { pose: Pose { theta_rad: self.theta, sigma_rad: self.sigma, z0_m }, beta_rad: self.beta }
    }

    fn moved(&self, [theta, sigma, l, beta1, beta2]: [T; 5], share: T) -> Self {
        Self {
            theta: self.theta + share * theta,
            sigma: self.sigma + share * sigma,
            l: self.l + share * l,
            beta: [self.beta[0] + share * beta1, self.beta[1] + share * beta2],
        }
    }

    fn is_possible(&self) -> bool {
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

    /// See [`FiveAxis::home_share`].
    fn share_of(&self, determinant: T, cos_theta: T) -> T {
        -determinant / (cos_theta * self.home_determinant)
    }

    /// See [`FiveAxis::home_share`].
    #[inline(never)]
    fn share(&self, state: &State<T>) -> T {
        self.share_of(self.motion(state).determinant, state.theta.sin_cos().1)
    }

    #[inline(never)]
    fn look(&self, state: &State<T>, target: &Tool<T>) -> Look<T> {
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

    /// A load on the tool at its tip, in the axes of T_h, as one on the platform at A.
    #[inline(never)]
    fn wrench_at_a(&self, beta_rad: [T; 2], wrench: &Wrench<T>) -> Wrench<T> {
        let held = self.held(beta_rad);
        let axes = held.axes();
        let turned = Wrench { force_n: combined(&axes, wrench.force_n), moment_nm: combined(&axes, wrench.moment_nm) };
        turned.moved_to_a(held.tip)
    }
}

impl<T: Scalar> FiveAxis<'_, T> {
    /// T_h of a configuration (Eq. 2).
    ///
    /// # Errors
    /// A number that is not finite, a pose that the parallel mechanism cannot take, a wrist joint beyond its limits.
    pub fn frame(&self, configuration: &Configuration<T>) -> Result<ToolFrame<T>, ToolError> {
        self.joints(configuration)?;
        Ok(self.frame_of(configuration))
    }

    fn frame_of(&self, configuration: &Configuration<T>) -> ToolFrame<T> {
        let State { theta, sigma, l, beta } = State::of(configuration);
        let held = self.wrist.held(beta);
        let (sin, cos) = theta.sin_cos();
        let platform = platform_axes((sin, cos), sigma.sin_cos());
        let [x, y, z] = combined(&platform, held.tip);
        ToolFrame { tip_m: [x + l * sin, y, z + l * cos], axes: held.axes().map(|axis| combined(&platform, axis)) }
    }

    /// Tip and axis of a configuration.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn tool(&self, configuration: &Configuration<T>) -> Result<Tool<T>, ToolError> {
        let ToolFrame { tip_m, axes: [_, _, axis] } = self.frame(configuration)?;
        Ok(Tool { tip_m, axis })
    }

    /// Configuration, tip and axis of joint values.
    ///
    /// # Errors
    /// Those of [`Machine::forward`]; a wrist joint beyond its limits.
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
        if !beta_rad.iter().all(|beta| beta.is_finite()) {
            return Err(ToolError::NotFinite);
        }
        let lengths = self.machine.inverse(&pose)?;
        match self.wrist.beyond_limits(beta_rad) {
            Some(joint) => Err(ToolError::WristLimit { joint }),
            None => Ok(JointValues { lengths, beta_rad }),
        }
    }

    /// How far a configuration is from the singular surface of the five axes: the determinant of ∂(tip, axis)/∂(θ, σ, Z0, β1, β2)
    /// as a share of that of the home configuration. 0 on the surface, negative beyond.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn home_share(&self, configuration: &Configuration<T>) -> Result<T, ToolError> {
        self.joints(configuration)?;
        Ok(self.wrist.share(&State::of(configuration)))
    }

    /// The configuration that holds a tool, on the same side of the singular surface as `near`: damped Newton steps from there,
    /// at most [`MAX_LOOKS`]. From the last configuration of a path two or three do. At its start `near` is where the machine
    /// stands: [`forward`](Self::forward) of the measured joints.
    ///
    /// # Errors
    /// Not finite; singular: `near`, or the way to the tool, has a [home share](Self::home_share) below the wrist's margin;
    /// unreachable; then those of [`joints`](Self::joints).
    pub fn inverse(&self, tool: &Tool<T>, near: &Configuration<T>) -> Result<Hold<T>, ToolError> {
        let Pose { theta_rad, sigma_rad, z0_m } = near.pose;
        let [beta1, beta2] = near.beta_rad;
        let axis = unit(tool.axis).filter(|_| finite(tool.tip_m) && finite([theta_rad, sigma_rad, z0_m]));
        let Some(axis) = axis.filter(|_| beta1.is_finite() && beta2.is_finite()) else {
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
        // a Newton step squares the error
        while !(look.error <= T::EPSILON) {
            let [dtheta, dsigma, dl, dbeta1, dbeta2] = look.step;
            let size = [dtheta, dsigma, dl / state.l, dbeta1, dbeta2]
                .into_iter()
                .fold(T::ZERO, |size, d| if d.abs() > size { d.abs() } else { size });
            let mut share = if size > longest { longest / size } else { T::ONE };
            let mut refused = ToolError::Unreachable;
            loop {
                if looks >= MAX_LOOKS {
                    return Err(refused);
                }
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
    pub fn inverse_at(&self, tip_m: [T; 3], beta_rad: [T; 2]) -> Result<Hold<T>, ToolError> {
        if !(finite(tip_m) && beta_rad.iter().all(|beta| beta.is_finite())) {
            return Err(ToolError::NotFinite);
        }
        let ([x, y, z], [tu, tv, tw]) = (tip_m, self.wrist.held(beta_rad).tip);
        let sigma = tv.atan2(tw) - y.atan2((tv * tv + tw * tw - y * y).sqrt());
        let (sin, cos) = sigma.sin_cos();
        let along_n = (x * x + z * z - tu * tu).sqrt();
        let l = along_n - tv * sin - tw * cos;
        let theta = (x * along_n - z * tu).atan2(x * tu + z * along_n);
        let state = State { theta, sigma, l, beta: beta_rad };
        // a root of what is negative is no number, and nothing of it is possible
        if !state.is_possible() {
            return Err(ToolError::Unreachable);
        }
        let configuration = state.configuration();
        let joints = self.joints(&configuration)?;
        let home_share = self.wrist.share(&state);
        if !(home_share >= self.wrist.margin) {
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
            let found = self.inverse(tool, &Configuration { pose, beta_rad: beta.map(T::from_f64) });
            if found.is_ok() {
                return found;
            }
        }
        Err(refused)
    }

    /// The configuration whose [`frame`](Self::frame) is a given one, by the paper's closed form: the axes of the wrist
    /// meet the plane y = 0 of B, A cos β2 + B sin β2 = C. Where the second axis is square to that plane, this says nothing,
    /// and A's distance from the first axis says it. Of the at most four candidates the one is taken that has the frame.
    ///
    /// # Errors
    /// Not finite; inconsistent: no rotation, or not within 1e-7 (`f32`: 1e-3) of one of this machine; then those of
    /// [`inverse`](Self::inverse), which polishes what was found.
    pub fn inverse_frame(&self, frame: &ToolFrame<T>) -> Result<Hold<T>, ToolError> {
        let ToolFrame { tip_m: tip, axes: [x, y, z] } = *frame;
        if ![tip, x, y, z].into_iter().all(finite) {
            return Err(ToolError::NotFinite);
        }
        let tolerance = T::from_f64(100.0) * T::SLACK;
        let apart = |a: [T; 3], b: [T; 3]| {
            let d = less(a, b);
            dot(d, d).sqrt()
        };
        if !(apart(cross(x, y), z) <= tolerance && apart(cross(y, z), x) <= tolerance) {
            return Err(ToolError::Inconsistent);
        }
        let Wrist { offset, first_d: d1, first_b: b1, second_b: b2, flange: f, .. } = *self.wrist;
        // the second: A = tip − …, its component along u, with β1 = σ = 0
        let equations = [
            (x[1] * b1 + z[1] * d1, x[1] * d1 - z[1] * b1, tip[1] - x[1] * b2 - z[1] * f),
            (dot(tip, x) - b2, f - dot(tip, z), offset + b1),
        ];
        let mut best: Result<Hold<T>, ToolError> = Err(ToolError::Inconsistent);
        let mut least = tolerance;
        for (a, b, c) in equations {
            let size = (a * a + b * b).sqrt();
            let ratio = c / size;
            if !(ratio.abs() <= T::ONE + tolerance) {
                continue;
            }
            let limited = if ratio > T::ONE {
                T::ONE
            } else if ratio < -T::ONE {
                -T::ONE
            } else {
                ratio
            };
            let (middle, half) = (b.atan2(a), limited.acos());
            for beta2 in [middle - half, middle + half] {
                let pi = T::from_f64(core::f64::consts::PI);
                let turns = if beta2 > pi {
                    -pi - pi
                } else if beta2 < -pi {
                    pi + pi
                } else {
                    T::ZERO
                };
                let near = self.with_second(frame, beta2 + turns);
                // it has the frame's axes by its making; whether it has the tip shows if it is one
                if !(apart(self.frame_of(&near).tip_m, tip) <= tolerance.sqrt() * self.wrist.home_z0) {
                    continue;
                }
                match self.inverse(&Tool { tip_m: tip, axis: z }, &near) {
                    Ok(found) => {
                        let off = apart(self.frame_of(&found.configuration).axes[0], x);
                        if off <= least {
                            (best, least) = (Ok(found), off);
                        }
                    }
                    Err(e) => best = best.or(Err(e)),
                }
            }
        }
        best
    }

    /// The configuration with a frame's rotation and about its tip, for a given β2.
    fn with_second(&self, frame: &ToolFrame<T>, beta2: T) -> Configuration<T> {
        let [x, y, z] = frame.axes;
        let (sin, cos) = beta2.sin_cos();
        // R_h R_y(β2) = R_y(θ) R_x(σ) R_z(β1): its row y and column z
        let w = [x[0] * sin + z[0] * cos, x[1] * sin + z[1] * cos, x[2] * sin + z[2] * cos];
        let sigma = (-w[1]).atan2((w[0] * w[0] + w[2] * w[2]).sqrt());
        let theta = w[0].atan2(w[2]);
        let beta = [(x[1] * cos - z[1] * sin).atan2(y[1]), beta2];
        let (sin, cos) = theta.sin_cos();
        let arm = combined(&platform_axes((sin, cos), sigma.sin_cos()), self.wrist.held(beta).tip);
        let l = (frame.tip_m[0] - arm[0]) * sin + (frame.tip_m[2] - arm[2]) * cos;
        State { theta, sigma, l, beta }.configuration()
    }

    /// A stiffness at A in A-uvw as the tool sees it: at the tip, in the axes of T_h. What is elastic in the wrist has to be in it
    /// (effect `wrist-compliance`).
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn tip_stiffness(
        &self,
        at_a: &Stiffness<T>,
        configuration: &Configuration<T>,
    ) -> Result<Stiffness<T>, ToolError> {
        self.joints(configuration)?;
        let held = self.wrist.held(configuration.beta_rad);
        let (axes, k) = (held.axes(), at_a.matrix());
        let mut seen = [[T::ZERO; 6]; 6];
        for (column, seen) in seen.iter_mut().enumerate() {
            let turning = column >= 3;
            let axis = axes[column % 3];
            // what A does when the tip moves along an axis, or the tool turns about one at the tip
            let (v, w) = if turning { (cross(held.tip, axis), axis) } else { (axis, [T::ZERO; 3]) };
            let wrench = k.map(|row| dot([row[0], row[1], row[2]], v) + dot([row[3], row[4], row[5]], w));
            let force = [wrench[0], wrench[1], wrench[2]];
            let lever = cross(held.tip, force);
            let moment = [wrench[3] - lever[0], wrench[4] - lever[1], wrench[5] - lever[2]];
            for i in 0..3 {
                (seen[i], seen[3 + i]) = (dot(axes[i], force), dot(axes[i], moment));
            }
        }
        // symmetric, so that columns are rows
        Ok(Stiffness::from_lower(&seen))
    }

    /// How a load moves the tool, by K_m in the factor form or, without a table, by K_p; with what load-dependent effects add.
    ///
    /// # Arguments
    /// * `wrench`: on the tool at its tip, in the axes of T_h.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame), [`CorrectionTable::factor_form`] and [`Machine::load_dependent_deflection`].
    pub fn deflection(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        configuration: &Configuration<T>,
        wrench: &Wrench<T>,
    ) -> Result<ToolDeflection<T>, ToolDeflectionError> {
        self.joints(configuration)?;
        self.deflection_of(table, configuration, wrench)
    }

    // what is turned before and after it takes no stack while the mechanism's own is worked out
    #[inline(never)]
    fn deflection_of(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        configuration: &Configuration<T>,
        wrench: &Wrench<T>,
    ) -> Result<ToolDeflection<T>, ToolDeflectionError> {
        let Configuration { pose, beta_rad } = configuration;
        let at_a = compensation::deflection(self.machine, table, pose, &self.wrist.wrench_at_a(*beta_rad, wrench))?;
        let Deflection { translation_m, rotation_rad } = stiffness::finite(self.seen_at_tip(configuration, &at_a))?;
        Ok(ToolDeflection { translation_m, rotation_rad, domain: table.map(|table| table.domain(pose)) })
    }

    /// A displacement of A, in A-uvw, as that of the tip, in B-xyz.
    #[inline(never)]
    fn seen_at_tip(&self, configuration: &Configuration<T>, at_a: &Deflection<T>) -> Deflection<T> {
        let Configuration { pose, beta_rad } = configuration;
        let Deflection { translation_m, rotation_rad } = at_a.seen_at(self.wrist.held(*beta_rad).tip);
        let platform = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
        Deflection {
            translation_m: combined(&platform, translation_m),
            rotation_rad: combined(&platform, rotation_rad),
        }
    }

    /// The configuration to command so that the loaded tool stands where `tool` asks, tip and axis: the tool is held where
    /// the deflection of the last try takes it from there, until the deflection changes by no more than [`COMPENSATED_TO`].
    ///
    /// # Arguments
    /// * `wrench`: on the tool at its tip, in the axes of T_h, which the load turns with.
    /// * `near`: as for [`inverse`](Self::inverse).
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse) and of [`deflection`](Self::deflection), on the way as at its end;
    /// [`ToolDeflectionError::NotConverged`] after [`MAX_DEFLECTIONS`] tries.
    pub fn compensated(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        tool: &Tool<T>,
        wrench: &Wrench<T>,
        near: &Configuration<T>,
    ) -> Result<CompensatedTool<T>, ToolDeflectionError> {
        // by reference: `?` would copy all of it
        let mut found = self.inverse(tool, near);
        let hold = match &mut found {
            Ok(hold) => hold,
            Err(e) => return Err((*e).into()),
        };
        let mut met = [[T::ZERO; 3]; 2];
        for _ in 0..MAX_DEFLECTIONS {
            match &self.deflection_of(table, &hold.configuration, wrench) {
                Ok(deflection) => {
                    if self.is_met(tool, deflection, &mut met, hold)? {
                        return Ok(CompensatedTool { hold: *hold, deflection: *deflection });
                    }
                }
                Err(e) => return Err(*e),
            }
        }
        Err(ToolDeflectionError::NotConverged)
    }

    /// Whether a deflection is the one that is met, of tip and axis. If not, it is from now on, and the tool is held where it
    /// takes the tool to its place.
    #[inline(never)] // what it works with takes no stack while the next deflection is worked out
    fn is_met(
        &self,
        tool: &Tool<T>,
        deflection: &ToolDeflection<T>,
        met: &mut [[T; 3]; 2],
        hold: &mut Hold<T>,
    ) -> Result<bool, ToolError> {
        let axis = unit(tool.axis).ok_or(ToolError::NotFinite)?;
        let now = [deflection.translation_m, cross(deflection.rotation_rad, less(axis, met[1]))];
        let size = |[tip, axis]: [[T; 3]; 2]| dot(tip, tip).sqrt() + self.wrist.home_z0 * dot(axis, axis).sqrt();
        if size([less(now[0], met[0]), less(now[1], met[1])]) <= T::from_f64(COMPENSATED_TO) * size(now) {
            return Ok(true);
        }
        *met = now;
        let held = Tool { tip_m: less(tool.tip_m, now[0]), axis: less(axis, now[1]) };
        *hold = self.inverse(&held, &hold.configuration)?;
        Ok(false)
    }
}

/// u, v, w in B-xyz, from sine and cosine of θ and of σ.
pub fn platform_axes<T: Scalar>((sin_t, cos_t): (T, T), (sin_s, cos_s): (T, T)) -> [[T; 3]; 3] {
    [[cos_t, T::ZERO, -sin_t], [sin_s * sin_t, cos_s, sin_s * cos_t], [cos_s * sin_t, -sin_s, cos_s * cos_t]]
}

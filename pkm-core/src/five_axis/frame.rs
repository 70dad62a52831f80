//! From the tool's whole frame to the configuration, by the paper's closed form.

use super::state::State;
use super::{Configuration, FiveAxis, Hold, Tool, ToolError, ToolFrame};
use crate::kinematics::platform_axes;
use crate::scalar::Scalar;
use crate::vector::{combined, cross, dot, finite, less};
use crate::wrist::Wrist;

impl<T: Scalar> FiveAxis<'_, T> {
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
}

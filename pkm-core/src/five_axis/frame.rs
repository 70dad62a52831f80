//! From the tool's whole frame to the configuration, by the paper's closed form.

use nalgebra::{Vector2, Vector3};

use super::state::State;
use super::{Configuration, FiveAxis, Tool, ToolError, ToolFrame, ToolSolution};
use crate::kinematics::platform_axes;
use crate::linalg::{axes, is_finite, length};
use crate::scalar::Scalar;
use crate::wrist::Wrist;

impl<T: Scalar> FiveAxis<'_, T> {
    /// The configuration whose [`frame`](Self::frame) is a given one, by the paper's closed form: the axes of the wrist
    /// meet the plane y = 0 of B, A cos β2 + B sin β2 = C. Where the second axis is square to that plane, this says nothing,
    /// and A's distance from the first axis says it. Of the at most four candidates the one is taken that has the frame.
    ///
    /// # Errors
    /// Not finite; inconsistent: no rotation, or not within 1e-7 (`f32`: 1e-3) of one of this machine; then those of
    /// [`inverse`](Self::inverse), which polishes what was found.
    pub fn inverse_frame(&self, frame: &ToolFrame<T>) -> Result<ToolSolution<T>, ToolError> {
        let (tip, [x, y, z]) = (frame.tip_m, axes(&frame.axes));
        if ![tip, x, y, z].iter().all(is_finite) {
            return Err(ToolError::NotFinite);
        }
        let tolerance = T::from_f64(100.0) * T::SLACK;
        let apart = |a: Vector3<T>, b: Vector3<T>| length(&(a - b));
        if !(apart(x.cross(&y), z) <= tolerance && apart(y.cross(&z), x) <= tolerance) {
            return Err(ToolError::Inconsistent);
        }
        let Wrist { offset, first_d: d1, first_b: b1, second_b: b2, flange: f, .. } = *self.wrist;
        // the second: A = tip − …, its component along u, with β1 = σ = 0
        let equations = [
            (x.y * b1 + z.y * d1, x.y * d1 - z.y * b1, tip.y - x.y * b2 - z.y * f),
            (tip.dot(&x) - b2, f - tip.dot(&z), offset + b1),
        ];
        let mut best: Result<ToolSolution<T>, ToolError> = Err(ToolError::Inconsistent);
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
                        let [found_x, ..] = axes(&self.frame_of(&found.configuration).axes);
                        let off = apart(found_x, x);
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
        let [x, y, z] = axes(&frame.axes);
        let (sin, cos) = beta2.sin_cos();
        // R_h R_y(β2) = R_y(θ) R_x(σ) R_z(β1): its row y and column z
        let w = x * sin + z * cos;
        let sigma = (-w.y).atan2((w.x * w.x + w.z * w.z).sqrt());
        let theta = w.x.atan2(w.z);
        let beta = Vector2::new((x.y * cos - z.y * sin).atan2(y.y), beta2);
        let (sin, cos) = theta.sin_cos();
        let arm = platform_axes((sin, cos), sigma.sin_cos()) * self.wrist.held(beta).tip;
        let l = (frame.tip_m.x - arm.x) * sin + (frame.tip_m.z - arm.z) * cos;
        State { theta, sigma, l, beta }.configuration()
    }
}

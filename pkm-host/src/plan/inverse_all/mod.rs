//! Every way in which the five axes can hold a tool.
//!
//! Seen from A, tip t and axis e lie in one plane with the first axis w of the wrist, S2 t + r e = S2 offset u + (S2 h + r C2) w,
//! with S2, C2 of β2 and r, h of the wrist. For a given β2 that leaves σ from its component along y of B and
//! θ from the others, in two ways at the most; left is one equation in β2, e·w = C2. It holds twice at β2 = 0 whatever the tool,
//! which is divided away. Its roots are those of a polynomial (`roots`); where they crowd, they are bracketed (`scan`).

mod roots;
mod scan;

use nalgebra::{Vector2, Vector3};
use pkm_core::kinematics::platform_axes;
use pkm_core::{Configuration, FiveAxis, Pose, Tool, ToolSolution, Wrist, WristParameters};

/// How far tip (m) and axis may be off where no step can be taken.
const EXACT: f64 = 1e-8;

/// A wrist at a β2, and the tool that it is to hold.
struct ToolEquation<'a> {
    wrist: &'a WristParameters,
    core: &'a Wrist<f64>,
    tip: Vector3<f64>,
    axis: Vector3<f64>,
    /// Length of the axis square to y of B, and the tip in that plane along it and across.
    plane: f64,
    along: f64,
    across: f64,
}

/// Sine and cosine of an angle.
type Turn = (f64, f64);

impl<'a> ToolEquation<'a> {
    fn new(wrist: &'a WristParameters, core: &'a Wrist<f64>, tool: &Tool<f64>) -> Self {
        let (tip, axis) = (tool.tip_m, tool.axis / tool.axis.norm());
        let plane = axis.x.hypot(axis.z);
        // of an axis along y any direction does
        let [x, z] = if plane > 0.0 { [axis.x / plane, axis.z / plane] } else { [0.0, 1.0] };
        Self { wrist, core, tip, axis, plane, along: tip.x * x + tip.z * z, across: tip.x * z - tip.z * x }
    }

    /// The equation's left side, and on the right what stands at u and at w.
    fn sides(&self, sin: f64, cos: f64) -> ([f64; 3], [f64; 2]) {
        let [r, h] = self.core.arm_m(sin, cos).into();
        let left = self.tip * sin + self.axis * r;
        (left.into(), [sin * self.wrist.offset_m, sin * h + r * cos])
    }

    /// How a β2 asks the platform to be turned: θ and σ.
    fn platform(&self, beta2: f64, side: f64) -> Option<(Turn, Turn)> {
        let (sin, cos) = beta2.sin_cos();
        let ([x, y, z], [along_u, along_w]) = self.sides(sin, cos);
        let sin_sigma = -y / along_w;
        let size2 = x * x + z * z;
        let (cos2_sigma, along2_n) = (1.0 - sin_sigma * sin_sigma, size2 - along_u * along_u);
        if !(cos2_sigma > 0.0 && along2_n >= 0.0 && size2 > 0.0) {
            return None;
        }
        let along_n = side * along2_n.sqrt();
        let theta = ((along_n * x - along_u * z) / size2, (along_u * x + along_n * z) / size2);
        Some((theta, (sin_sigma, cos2_sigma.sqrt())))
    }

    fn configuration(&self, beta2: f64, side: f64) -> Option<Configuration<f64>> {
        let (theta, sigma) = self.platform(beta2, side)?;
        let ((sin_theta, cos_theta), (sin_sigma, cos_sigma)) = (theta, sigma);
        let platform = platform_axes(theta, sigma);
        let (sin, cos) = beta2.sin_cos();
        let [r, h] = self.core.arm_m(sin, cos).into();
        let l = (self.tip.dot(&platform.column(2)) - h) / cos_sigma;
        let from_a = self.tip - Vector3::new(sin_theta, 0.0, cos_theta) * l;
        // both tip and axis show where the arm points, each well where the other may not
        let c = [0, 1].map(|i| platform.column(i)).map(|axis| r * from_a.dot(&axis) - sin * self.axis.dot(&axis));
        let beta1 = c[1].atan2(c[0] - r * self.wrist.offset_m);
        let pose = Pose { theta_rad: sin_theta.atan2(cos_theta), sigma_rad: sin_sigma.asin(), z0_m: l * cos_theta };
        Some(Configuration { pose, beta_rad: Vector2::new(beta1, beta2) })
    }
}

/// Every configuration within travel and limits that holds a tool, in either working mode (see `normalised_determinant`), by β2.
pub fn inverse_all(five: &FiveAxis<'_, f64>, wrist: &WristParameters, tool: &Tool<f64>) -> Vec<ToolSolution<f64>> {
    let equation = ToolEquation::new(wrist, five.wrist, tool);
    let (roots, crowded) = equation.roots();
    let mut ways = if crowded { equation.scanned() } else { Vec::new() };
    ways.extend(roots);
    held(five, tool, &equation, &ways)
}

/// The same by the scan alone, for tests to judge the roots by.
pub fn inverse_all_scanned(
    five: &FiveAxis<'_, f64>,
    wrist: &WristParameters,
    tool: &Tool<f64>,
) -> Vec<ToolSolution<f64>> {
    let equation = ToolEquation::new(wrist, five.wrist, tool);
    held(five, tool, &equation, &equation.scanned())
}

/// Those of some β2 and sides that do hold the tool.
fn held(
    five: &FiveAxis<'_, f64>,
    tool: &Tool<f64>,
    equation: &ToolEquation<'_>,
    ways: &[(f64, f64)],
) -> Vec<ToolSolution<f64>> {
    let mut found: Vec<ToolSolution<f64>> = Vec::new();
    for (beta2, side) in ways {
        let Some(configuration) = equation.configuration(*beta2, *side) else { continue };
        let Ok(held) = five.tool(&configuration) else { continue };
        let off = (held.tip_m - equation.tip).amax().max((held.axis - equation.axis).amax());
        // a crossing may be a jump, and a root one of what was squared
        if off > 1e-6 {
            continue;
        }
        let (Ok(joints), Ok(normalised_determinant)) =
            (five.joints(&configuration), five.normalised_determinant(&configuration))
        else {
            continue;
        };
        let rough = ToolSolution { configuration, joints, normalised_determinant, iterations: 0 };
        // steps go on home's side alone: what is on the other has to be good as it is
        let refined = five.inverse(tool, &configuration).ok().or((off < EXACT).then_some(rough));
        let Some(solution) = refined else { continue };
        let known = |other: &ToolSolution<f64>| {
            let [a, b] = [other, &solution].map(|h| (h.configuration.beta_rad, h.configuration.pose));
            (0..2).all(|i| (a.0[i] - b.0[i]).abs() < 1e-7) && (a.1.z0_m - b.1.z0_m).abs() < 1e-7
        };
        if !found.iter().any(known) {
            found.push(solution);
        }
    }
    found.sort_by(|a, b| a.configuration.beta_rad.y.total_cmp(&b.configuration.beta_rad.y));
    found
}

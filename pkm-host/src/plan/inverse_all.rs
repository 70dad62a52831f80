//! Every way in which the five axes can hold a tool.
//!
//! Seen from A, tip t and axis e lie in one plane with the first axis w of the wrist, S2 t + r e = S2 offset u + (S2 h + r C2) w,
//! with S2, C2 of β2 and r, h of the wrist. For a given β2 that leaves σ from its component along y of B and
//! θ from the others, in two ways at the most; left is one equation in β2, e·w = C2. It holds twice at β2 = 0 whatever the tool,
//! which is divided away, and its roots are bracketed.

use nalgebra::{Vector2, Vector3};
use pkm_core::kinematics::platform_axes;
use pkm_core::{Configuration, FiveAxis, Pose, Tool, ToolSolution, Wrist, WristParameters};

/// Steps over all of β2.
const GRID: usize = 128;
/// Steps over a stretch of β2 without edges.
const STRETCH: usize = 48;
/// Least |β2|: at 0 the equation is 0/0.
const NEAR_ZERO: f64 = 1e-7;

/// A wrist at a β2, and the tool that it is to hold.
struct ToolEquation<'a> {
    wrist: &'a WristParameters,
    core: &'a Wrist<f64>,
    tip: Vector3<f64>,
    axis: Vector3<f64>,
}

/// Sine and cosine of an angle.
type Turn = (f64, f64);

impl ToolEquation<'_> {
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

    /// (C2 − e·w) / S2²; NaN where the platform cannot be turned so.
    fn off(&self, beta2: f64, side: f64) -> f64 {
        let Some((theta, sigma)) = self.platform(beta2, side) else { return f64::NAN };
        let platform = platform_axes(theta, sigma);
        let apart2 = (platform.column(2) - self.axis).norm_squared();
        // 1 − e·w and 1 − C2 by what vanishes with β2, or nothing would be left of their difference
        let (sin, half) = (beta2.sin(), (beta2 / 2.0).sin());
        (apart2 / 2.0 - 2.0 * half * half) / (sin * sin)
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

    /// What has to be positive for a σ and a θ: smooth in β2, unlike their roots, which turn sharply where they are small.
    fn room(&self, beta2: f64) -> [f64; 2] {
        let (sin, cos) = beta2.sin_cos();
        let ([x, y, z], [along_u, along_w]) = self.sides(sin, cos);
        [along_w * along_w - y * y, x * x + z * z - along_u * along_u]
    }

    /// The limits of β2, and between them where a room begins, ends or is least.
    fn stretches(&self) -> Vec<f64> {
        let [low, high] = [self.wrist.min_rad[1] - 1e-9, self.wrist.max_rad[1] + 1e-9];
        let grid = (0..=GRID).map(|n| low + (high - low) * n as f64 / GRID as f64);
        let mut breaks: Vec<f64> =
            [low, high, -NEAR_ZERO, NEAR_ZERO].into_iter().filter(|b| *b >= low && *b <= high).collect();
        for i in 0..2 {
            let room = |beta2: f64| self.room(beta2)[i];
            let samples: Vec<_> = grid.clone().map(|beta2| (beta2, room(beta2))).collect();
            breaks.extend(dips(room, &samples));
            breaks.extend(roots(room, &samples));
        }
        breaks.sort_by(f64::total_cmp);
        breaks
    }

    /// All β2 that fit, on one side.
    fn fitting(&self, side: f64, breaks: &[f64]) -> Vec<f64> {
        let off = |beta2: f64| self.off(beta2, side);
        let mut found = Vec::new();
        for (low, high) in breaks.iter().zip(breaks.iter().skip(1)) {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            if middle.abs() <= NEAR_ZERO {
                let (a, b) = (off(*low), off(*high));
                if (a > 0.0) != (b > 0.0) {
                    found.push(low + (high - low) * a / (a - b));
                }
                continue;
            }
            if !off(middle).is_finite() {
                continue;
            }
            // closer together towards the ends, where the curve may end upright
            let samples: Vec<_> = (0..=STRETCH)
                .map(|n| middle - half * (std::f64::consts::PI * n as f64 / STRETCH as f64).cos())
                .map(|beta2| (beta2, off(beta2)))
                .filter(|(_, off)| off.is_finite())
                .collect();
            found.extend(roots(off, &samples));
        }
        found
    }
}

/// Roots of a function that was sampled, two between neighbours included when the samples bend back before them.
fn roots(f: impl Fn(f64) -> f64, samples: &[(f64, f64)]) -> Vec<f64> {
    let between = |(mut low, at_low): (f64, f64), (mut high, _): (f64, f64)| {
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if middle == low || middle == high {
                break;
            }
            if (f(middle) > 0.0) == (at_low > 0.0) { low = middle } else { high = middle }
        }
        low
    };
    let crosses = |a: (f64, f64), b: (f64, f64)| (a.1 > 0.0) != (b.1 > 0.0);
    let mut found = Vec::new();
    for pair in samples.windows(2) {
        if crosses(pair[0], pair[1]) {
            found.push(between(pair[0], pair[1]));
        }
    }
    for three in samples.windows(3) {
        let [a, b, c] = [three[0], three[1], three[2]];
        let sign = if b.1 > 0.0 { 1.0 } else { -1.0 };
        if crosses(a, b) || crosses(b, c) || sign * b.1 > sign * a.1 || sign * b.1 > sign * c.1 {
            continue;
        }
        let least = least(|x| sign * f(x), a.0, c.0);
        let least = (least, f(least));
        if crosses(least, b) {
            found.extend([between(a, least), between(c, least)]);
        }
    }
    found
}

/// Where a sampled function is least among its neighbours.
fn dips(f: impl Fn(f64) -> f64, samples: &[(f64, f64)]) -> Vec<f64> {
    let low = samples.windows(3).filter(|w| w[1].1 <= w[0].1 && w[1].1 <= w[2].1);
    low.map(|w| least(&f, w[0].0, w[2].0)).collect()
}

/// By halving between two places, with one dip between them.
fn least(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..80 {
        let (left, right) = (low + (high - low) * 0.382, low + (high - low) * 0.618);
        if f(left) < f(right) { high = right } else { low = left }
    }
    0.5 * (low + high)
}

/// Every configuration within travel and limits that holds a tool, in either working mode (see `normalised_determinant`), by β2.
pub fn inverse_all(five: &FiveAxis<'_, f64>, wrist: &WristParameters, tool: &Tool<f64>) -> Vec<ToolSolution<f64>> {
    let equation = ToolEquation { wrist, core: five.wrist, tip: tool.tip_m, axis: tool.axis / tool.axis.norm() };
    let mut found: Vec<ToolSolution<f64>> = Vec::new();
    let breaks = equation.stretches();
    for side in [1.0, -1.0] {
        for beta2 in equation.fitting(side, &breaks) {
            let Some(configuration) = equation.configuration(beta2, side) else { continue };
            let Ok(held) = five.tool(&configuration) else { continue };
            // a crossing may be a jump
            if (held.tip_m - equation.tip).amax() > 1e-6 || (held.axis - equation.axis).amax() > 1e-6 {
                continue;
            }
            let (Ok(joints), Ok(normalised_determinant)) =
                (five.joints(&configuration), five.normalised_determinant(&configuration))
            else {
                continue;
            };
            let rough = ToolSolution { configuration, joints, normalised_determinant, iterations: 0 };
            let solution = five.inverse(tool, &configuration).unwrap_or(rough);
            let known = |other: &ToolSolution<f64>| {
                let [a, b] = [other, &solution].map(|h| (h.configuration.beta_rad, h.configuration.pose));
                (0..2).all(|i| (a.0[i] - b.0[i]).abs() < 1e-7) && (a.1.z0_m - b.1.z0_m).abs() < 1e-7
            };
            if !found.iter().any(known) {
                found.push(solution);
            }
        }
    }
    found.sort_by(|a, b| a.configuration.beta_rad.y.total_cmp(&b.configuration.beta_rad.y));
    found
}

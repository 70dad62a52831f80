//! Every β2 that holds a tool, by samples between the edges of where its equation exists: where roots are too near each other for
//! [`roots`](super::roots), as of a tool that lies in the plane of symmetry or at β2 = 0 exactly.

use pkm_core::kinematics::platform_axes;

use super::ToolEquation;

/// Steps over all of β2.
const GRID: usize = 128;
/// Steps over a stretch of β2 without edges.
const STRETCH: usize = 48;
/// Least |β2|: at 0 the equation is 0/0.
const MIN_BETA2_RAD: f64 = 1e-7;

impl ToolEquation<'_> {
    /// (C2 − e·w) / S2²; NaN where the platform cannot be turned so.
    fn off(&self, beta2: f64, side: f64) -> f64 {
        let Some((theta, sigma)) = self.platform(beta2, side) else { return f64::NAN };
        let platform = platform_axes(theta, sigma);
        let apart2 = (platform.column(2) - self.axis).norm_squared();
        // 1 − e·w and 1 − C2 by what vanishes with β2, or nothing would be left of their difference
        let (sin, half) = (beta2.sin(), (beta2 / 2.0).sin());
        (apart2 / 2.0 - 2.0 * half * half) / (sin * sin)
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
            [low, high, -MIN_BETA2_RAD, MIN_BETA2_RAD].into_iter().filter(|b| *b >= low && *b <= high).collect();
        for i in 0..2 {
            let room = |beta2: f64| self.room(beta2)[i];
            let samples: Vec<_> = grid.clone().map(|beta2| (beta2, room(beta2))).collect();
            breaks.extend(dips(room, &samples));
            breaks.extend(crossings(room, &samples));
        }
        breaks.sort_by(f64::total_cmp);
        breaks
    }

    /// Every β2 that may fit, each with its side.
    pub(super) fn scanned(&self) -> Vec<(f64, f64)> {
        let breaks = self.stretches();
        [1.0, -1.0]
            .into_iter()
            .flat_map(|side| self.fitting_on(side, &breaks).into_iter().map(move |b| (b, side)))
            .collect()
    }

    /// All β2 that fit, on one side.
    fn fitting_on(&self, side: f64, breaks: &[f64]) -> Vec<f64> {
        let off = |beta2: f64| self.off(beta2, side);
        let mut found = Vec::new();
        for (low, high) in breaks.iter().zip(breaks.iter().skip(1)) {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            if middle.abs() <= MIN_BETA2_RAD {
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
            found.extend(crossings(off, &samples));
        }
        found
    }
}

/// Roots of a function that was sampled, two between neighbours included when the samples bend back before them.
fn crossings(f: impl Fn(f64) -> f64, samples: &[(f64, f64)]) -> Vec<f64> {
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

//! A machine on four belts from code of its own: elastic belts and a sled in equilibrium, found by Newton steps on the
//! forces. The crate has none of this: it adds stretches that follow from statics to distances.

use std::fmt::Write;

/// Anchors bl, br, tr, tl with their distance from the plane of the sled, m.
pub const ANCHORS: [[f64; 3]; 4] = [[0.0, 0.0, 0.034], [3.05, 0.0, 0.078], [3.04, 2.13, 0.056], [0.004, 2.125, 0.100]];

/// What a simulated machine is like.
#[derive(Clone, Copy)]
pub struct Truth {
    /// Pull of the lower belts, N; no belt is slack.
    pub pull: f64,
    /// Weight of the sled, N.
    pub weight: f64,
    /// Force that would stretch a belt to twice its length, N.
    pub stiffness: f64,
    /// Factor on the lengths as read, by belt.
    pub scale: [f64; 4],
    /// Scale of the Student error of a visit, with four degrees of freedom, and standard deviation of a repeat; of the lower
    /// belts, m. The upper ones have a quarter.
    pub noise: [f64; 2],
}

impl Truth {
    /// Belts that hardly stretch, and the noise of the published readings.
    pub const STIFF: Self =
        Self { pull: 200.0, weight: 10.0, stiffness: 1e9, scale: [1.0; 4], noise: [0.5e-3, 0.15e-3] };
}

fn normal(rng: &mut fastrand::Rng) -> f64 {
    (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
}

/// Distance from an anchor, and the direction toward it in the plane times the in-plane share of a force.
fn toward(anchor: [f64; 3], [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
    let (dx, dy) = (anchor[0] - x, anchor[1] - y);
    let d = (dx * dx + dy * dy + anchor[2] * anchor[2]).sqrt();
    (d, [dx / d, dy / d])
}

/// Force on the sled at a place, with upper belts of given unstretched lengths.
fn force(truth: &Truth, upper: [f64; 2], at: [f64; 2]) -> [f64; 2] {
    let mut sum = [0.0, -truth.weight];
    for k in 0..4 {
        let (d, u) = toward(ANCHORS[k], at);
        let tension = if k < 2 { truth.pull } else { truth.stiffness * (d / upper[k - 2] - 1.0) };
        sum[0] += tension * u[0];
        sum[1] += tension * u[1];
    }
    sum
}

/// Unstretched lengths of all belts when the upper ones have given lengths.
pub fn lengths(truth: &Truth, upper: [f64; 2], start: [f64; 2]) -> [f64; 4] {
    let mut at = start;
    for _ in 0..60 {
        let f = force(truth, upper, at);
        let h = 1e-7;
        let fx = force(truth, upper, [at[0] + h, at[1]]);
        let fy = force(truth, upper, [at[0], at[1] + h]);
        let (a, b, c, d) = ((fx[0] - f[0]) / h, (fy[0] - f[0]) / h, (fx[1] - f[1]) / h, (fy[1] - f[1]) / h);
        let det = a * d - b * c;
        at[0] -= (d * f[0] - b * f[1]) / det;
        at[1] -= (a * f[1] - c * f[0]) / det;
    }
    let lower = [0, 1].map(|k| toward(ANCHORS[k], at).0 / (1.0 + truth.pull / truth.stiffness));
    [lower[0], lower[1], upper[0], upper[1]]
}

/// Upper belts that would put a sled without weight at a place.
pub fn upper_at(place: [f64; 2]) -> [f64; 2] {
    [2, 3].map(|k| toward(ANCHORS[k], place).0)
}

fn reading(lengths_m: [f64; 4]) -> String {
    let [bl, br, tr, tl] = lengths_m.map(|l| format!("{:.2}", 1e3 * l));
    format!("{{bl:{bl},   br:{br},   tr:{tr},   tl:{tl}}}")
}

/// A file of runs in the published format. The tool is taken to be some centimetres off.
pub fn runs(truth: &Truth, count: usize, seed: u64) -> String {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut text = String::from("Calibration Test\r\n\r\nRuns of one simulated frame.\r\n\r\n");
    for run in 1..=count {
        writeln!(text, "Run {run}: \r\n\r").unwrap();
        for n in 0..25 {
            let place = [0.74 + 0.395 * f64::from(n / 5), 0.56 + 0.23 * f64::from(n % 5)];
            let share = [1.0, 1.0, 0.25, 0.25];
            let spread = ((0..4).map(|_| normal(&mut rng).powi(2)).sum::<f64>() / 4.0).sqrt();
            let visit = share.map(|s| s * truth.noise[0] * normal(&mut rng) / spread);
            let read = lengths(truth, upper_at(place), place);
            for _ in 0..4 {
                let noisy = std::array::from_fn(|k| {
                    truth.scale[k] * read[k] + visit[k] + share[k] * truth.noise[1] * normal(&mut rng)
                });
                writeln!(text, "  {},\r", reading(noisy)).unwrap();
            }
        }
        writeln!(text, "\r\n(1.5, 2131.25), (3027.5, 2136.0)\r\n (0, 0), (3034.0, 0)\r\n\r").unwrap();
    }
    text + "Average of all runs:\r\n(1.5, 2131.25)(3027.5, 2136.0)\r\n"
}

/// A tension test in the published format: one pair with the pull on and off, and one control.
pub fn tension(truth: &Truth) -> String {
    let slack = Truth { pull: 1e-6 * truth.pull, ..*truth };
    let upper = upper_at([1.52, 1.06]);
    let [high, low] = [*truth, slack].map(|t| reading(lengths(&t, upper, [1.52, 1.06])));
    format!(
        "//Start\n{low} //Low tension measurment\n{high} //High tension measurement\n(4, 4)\n\n{low} //Low tension\n{low}//Low tension\n\nRemark of 1 = 0\n"
    )
}

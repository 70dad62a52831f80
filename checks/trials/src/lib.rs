//! Random measured data sets whose truth comes from solvers that share no code with the core, and what a program
//! that diagnoses them makes of it. The program is a black box: files in, `diagnosis.json` or other files out.

pub mod effects;
pub mod forms;
pub mod life;
pub mod machine;
pub mod mounts;
pub mod score;
pub mod set;
pub mod stiffness;
pub mod truth;
pub mod uncertainty;
pub mod unloaded;
pub mod unloaded_score;

/// Random numbers of one set: all follow from its seed.
#[derive(Clone, Debug)]
pub struct Random(fastrand::Rng);

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        // neighbouring seeds must not give neighbouring numbers (splitmix64)
        let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Self(fastrand::Rng::with_seed(z ^ (z >> 31)))
    }

    /// 0 to below `n`.
    pub fn index(&mut self, n: usize) -> usize {
        self.0.usize(0..n)
    }

    /// One of a few.
    pub fn pick<T: Clone>(&mut self, from: &[T]) -> T {
        from[self.index(from.len())].clone()
    }

    /// True with a probability.
    pub fn chance(&mut self, p: f64) -> bool {
        self.0.f64() < p
    }

    /// Uniform.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    /// Uniform in the logarithm.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.f64()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.f64()).cos()
    }

    /// A direction in space.
    pub fn direction(&mut self) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::from_fn(|_, _| self.normal()).normalize()
    }
}

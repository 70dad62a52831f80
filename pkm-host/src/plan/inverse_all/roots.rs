//! Every β2 that may hold a tool, as the roots of a polynomial.
//!
//! The square of e·w = C2 has the factor S2², which is divided away; what is left has α, the part along n, whose square is a
//! polynomial (letters as in `docs/theory.md`). The product over both signs of α is a polynomial of degree 16 in the tangent of half
//! of β2. Its Bernstein coefficients over a stretch have as many changes of sign as it has roots
//! there, or an even number more: none and one are certain, more are divided.

use std::f64::consts::PI;

use pkm_core::WristParameters;

use super::ToolEquation;

/// Of the polynomial.
const DEGREE: usize = 16;
/// C(16, k).
const BINOMIAL: [f64; DEGREE + 1] =
    [1., 16., 120., 560., 1820., 4368., 8008., 11440., 12870., 11440., 8008., 4368., 1820., 560., 120., 16., 1.];
/// What rounding leaves of a coefficient, as a share of its greatest term.
const NOISE: f64 = 1e-13;
/// Share of a stretch that is not divided any more.
const MIN_STRETCH: f64 = 1e-4;
/// How far from an isolated root that of one of the two ways is looked for, rad.
const ROOT_DISTANCE_RAD: f64 = 1e-3;
/// A polynomial over a stretch: its Bernstein coefficients times the binomials, so that products are convolutions.
#[derive(Clone, Copy)]
struct Polynomial {
    degree: usize,
    scaled: [f64; DEGREE + 1],
}

impl Polynomial {
    fn times(&self, other: &Self) -> Self {
        let mut product = Self { degree: self.degree + other.degree, scaled: [0.0; DEGREE + 1] };
        for i in 0..=self.degree {
            for j in 0..=other.degree {
                product.scaled[i + j] += self.scaled[i] * other.scaled[j];
            }
        }
        product
    }

    fn squared(&self) -> Self {
        self.times(self)
    }

    /// `a self + b other`, of the same degree.
    fn mixed(&self, a: f64, b: f64, other: &Self) -> Self {
        Self { scaled: std::array::from_fn(|k| a * self.scaled[k] + b * other.scaled[k]), ..*self }
    }

    /// Greatest Bernstein coefficient, of one of the full degree.
    fn greatest(&self) -> f64 {
        self.scaled.iter().zip(BINOMIAL).map(|(c, binomial)| (c / binomial).abs()).fold(0.0, f64::max)
    }
}

/// β2 = `middle` + 2 atan t, with t from −`reach` to `reach`.
struct Stretch {
    middle: f64,
    reach: f64,
}

impl Stretch {
    /// All of a range, in parts of at most half a turn.
    fn all(low: f64, high: f64) -> impl Iterator<Item = Self> {
        let count = if high - low > PI { 2 } else { 1 };
        let half = 0.5 * (high - low) / f64::from(count);
        (0..count).map(move |n| Self { middle: low + half * f64::from(2 * n + 1), reach: (0.5 * half).tan() })
    }

    fn beta2(&self, share: f64) -> f64 {
        self.middle + 2.0 * (self.reach * (2.0 * share - 1.0)).atan()
    }

    /// What is constant, by the cosine and by the sine of β2, times 1 + t².
    fn wave(&self, [constant, by_cos, by_sin]: [f64; 3]) -> Polynomial {
        let ((sin, cos), w) = (self.middle.sin_cos(), self.reach);
        let (by_cos, by_sin) = (by_cos * cos + by_sin * sin, by_sin * cos - by_cos * sin);
        let (even, odd) = ((constant - by_cos) * w * w, 2.0 * by_sin * w);
        let first = constant + by_cos;
        let mut wave = Polynomial { degree: 2, scaled: [0.0; DEGREE + 1] };
        wave.scaled[..3].copy_from_slice(&[first - odd + even, 2.0 * (first - even), first + odd + even]);
        wave
    }
}

/// Bernstein coefficients over a part of a stretch.
struct Part {
    low: f64,
    high: f64,
    coefficients: [f64; DEGREE + 1],
}

impl Part {
    /// In the middle, by de Casteljau.
    fn halves(&self) -> [Self; 2] {
        let middle = 0.5 * (self.low + self.high);
        let (mut left, mut right) = (self.coefficients, self.coefficients);
        for n in 1..=DEGREE {
            for k in 0..=DEGREE - n {
                right[k] = 0.5 * (right[k] + right[k + 1]);
            }
            left[n] = right[0];
        }
        [
            Self { low: self.low, high: middle, coefficients: left },
            Self { low: middle, high: self.high, coefficients: right },
        ]
    }

    fn value(&self, share: f64) -> f64 {
        // the powers of the smaller of both shares over the greater, whose own power has no sign
        let terms = self.coefficients.iter().zip(BINOMIAL).map(|(c, binomial)| c * binomial);
        let by = |ratio: f64, sum: f64, term: f64| sum * ratio + term;
        if share < 0.5 {
            terms.rev().fold(0.0, |sum, term| by(share / (1.0 - share), sum, term)) * (1.0 - share).powi(DEGREE as i32)
        } else {
            terms.fold(0.0, |sum, term| by((1.0 - share) / share, sum, term)) * share.powi(DEGREE as i32)
        }
    }

    /// The one root, by the secant and, where that gets stuck, by halving.
    fn root(&self) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        let (mut at_low, mut at_high) = (self.coefficients[0], self.coefficients[DEGREE]);
        for n in 0..60 {
            let secant = (low * at_high - high * at_low) / (at_high - at_low);
            let share = if n % 3 == 2 || !(secant > low && secant < high) { 0.5 * (low + high) } else { secant };
            let value = self.value(share);
            if value == 0.0 || share == low || share == high {
                return self.low + share * (self.high - self.low);
            }
            if (value > 0.0) == (at_low > 0.0) {
                (low, at_low) = (share, value)
            } else {
                (high, at_high) = (share, value)
            }
            if high - low < 1e-12 {
                break;
            }
        }
        self.low + 0.5 * (low + high) * (self.high - self.low)
    }
}

impl ToolEquation<'_> {
    /// The waves of which the equation consists: P, the first axis' part W, its y, (h² + r² − t_y²), and k.
    fn waves(&self) -> [[f64; 3]; 5] {
        let WristParameters { first_d_m: d, first_b_m: b, second_b_m: c, flange_m: f, .. } = *self.wrist;
        let (ty, ey) = (self.tip.y, self.axis.y);
        [
            [self.plane * b, self.plane * c, self.along - self.plane * f],
            [c, b, d],
            [ey * b, ey * c, ty - ey * f],
            [b * b + c * c + d * d + f * f - ty * ty, 2.0 * (b * c + d * f), 2.0 * (d * c - b * f)],
            [f - ey * ty, d, -b],
        ]
    }

    /// (q² − offset²)² S² − 2 g S (P² (offset² + q²) + S2² q² (q² − offset²)) + g² ρ², and the greatest that its terms are together.
    fn polynomial(&self, stretch: &Stretch) -> (Part, f64) {
        let [p, w, y, size, k] = self.waves().map(|wave| stretch.wave(wave));
        let (one, sine) = (stretch.wave([1.0, 0.0, 0.0]), stretch.wave([0.0, 0.0, 1.0]));
        let (q2, d2, e2) = (self.across * self.across, self.wrist.offset_m.powi(2), self.plane * self.plane);
        let (p2, sine2, one2) = (p.squared(), sine.squared(), one.squared());
        let s = w.squared().mixed(e2, -e2, &y.squared());
        let g = size.times(&one).mixed(e2, -1.0, &k.squared());
        let rho = p2.mixed(1.0, q2, &sine2);
        let both = p2.mixed(d2 + q2, q2 * (q2 - d2), &sine2);
        let (turned, straight, m) = (s.times(&one2), g.times(&rho), q2 - d2);
        let (sum, greatest) = if d2 == 0.0 {
            // both ways are one, and the polynomial a square: its root will do
            let [first, second] = [straight, turned].map(|half| half.times(&one2.squared()));
            (first.mixed(1.0, -q2, &second), first.greatest() + q2 * second.greatest())
        } else {
            let (first, second, third) = (turned.squared(), g.times(&turned).times(&both), straight.squared());
            let greatest = m * m * first.greatest() + 2.0 * second.greatest() + third.greatest();
            (first.mixed(m * m, -2.0, &second).mixed(1.0, 1.0, &third), greatest)
        };
        let coefficients = std::array::from_fn(|k| sum.scaled[k] / BINOMIAL[k]);
        (Part { low: 0.0, high: 1.0, coefficients }, greatest)
    }

    /// Where roots may be, and whether some are so near each other that they cannot be told apart.
    fn isolated(&self) -> (Vec<f64>, bool) {
        let [low, high] = [self.wrist.min_rad[1] - 1e-9, self.wrist.max_rad[1] + 1e-9];
        let (mut found, mut crowded) = (Vec::new(), false);
        for stretch in Stretch::all(low, high) {
            let (whole, greatest) = self.polynomial(&stretch);
            let (mut open, noise) = (vec![whole], NOISE * greatest);
            while let Some(part) = open.pop() {
                let c = &part.coefficients;
                if c.iter().all(|c| *c > noise) || c.iter().all(|c| *c < -noise) {
                    continue;
                }
                let changes = c.windows(2).filter(|two| (two[0] > 0.0) != (two[1] > 0.0)).count();
                if changes == 1 && c[0].abs() > noise && c[DEGREE].abs() > noise {
                    found.push(stretch.beta2(part.root()));
                } else if part.high - part.low > MIN_STRETCH {
                    open.extend(part.halves());
                } else {
                    crowded = true;
                    found.push(stretch.beta2(0.5 * (part.low + part.high)));
                }
            }
        }
        (found, crowded)
    }

    /// S (P offset − q α)² − g ρ², which vanishes where the tool is held on a side.
    fn squared_off(&self, beta2: f64, side: f64) -> f64 {
        let (sin, cos) = beta2.sin_cos();
        let [p, w, y, size, k] = self.waves().map(|[constant, by_cos, by_sin]| constant + by_cos * cos + by_sin * sin);
        let (q, d, e2) = (self.across, self.wrist.offset_m, self.plane * self.plane);
        let (s, g) = (w * w - y * y, e2 * size - k * k);
        let alpha = side * (p * p + sin * sin * (q * q - d * d)).max(0.0).sqrt();
        let (turned, rho) = (p * d - q * alpha, p * p + sin * sin * q * q);
        e2 * s * turned * turned - g * rho * rho
    }

    /// The root of one way near a candidate, by the secant.
    fn fitting(&self, candidate: f64, side: f64) -> Option<f64> {
        let (mut last, mut beta2) = (candidate + 1e-7, candidate);
        let (mut at_last, mut at) = (self.squared_off(last, side), self.squared_off(beta2, side));
        for _ in 0..12 {
            let step = at * (beta2 - last) / (at - at_last);
            if !step.is_finite() || step.abs() < 1e-16 {
                break;
            }
            (last, at_last) = (beta2, at);
            beta2 -= step;
            at = self.squared_off(beta2, side);
            if !((beta2 - candidate).abs() < ROOT_DISTANCE_RAD) {
                return None;
            }
            if step.abs() < 1e-13 {
                break;
            }
        }
        Some(beta2)
    }

    /// Every β2 that may fit, each with its side, and whether some may be lacking.
    pub(super) fn roots(&self) -> (Vec<(f64, f64)>, bool) {
        let (isolated, crowded) = self.isolated();
        let both = isolated.iter().flat_map(|candidate| [1.0, -1.0].map(|side| (*candidate, side)));
        let ways = both.filter_map(|(candidate, side)| Some((self.fitting(candidate, side)?, side))).collect();
        (ways, crowded)
    }
}

//! Numbers that stand for a function over a cell: a polynomial of the second degree in `N` symbols of −1…1, and by how much the
//! function differs from it at the most. The core's formulas run on them as they are (its [`Scalar`]), and give what holds for
//! every point of the cell.
//!
//! The bounds hold in real arithmetic. Rounding is not followed: [`ROUNDING`] is kept from every bound in its place, a
//! thousand times what 1e4 operations on matrices of a condition of 1e4 leave in `f64`.

use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use num_traits::{One, Zero};
use pkm_core::Scalar;

/// Share of a bound that is kept back for rounding.
pub(super) const ROUNDING: f64 = 1e-9;

thread_local! {
    /// A comparison came out differently within the cell, or not at all.
    static UNDECIDED: Cell<bool> = const { Cell::new(false) };
}

/// What a computation gives, unless a comparison in it was undecided over the cell.
pub(super) fn decided<R>(compute: impl FnOnce() -> R) -> Option<R> {
    UNDECIDED.set(false);
    let result = compute();
    (!UNDECIDED.get()).then_some(result)
}

/// A function over a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taylor<const N: usize> {
    /// In the middle.
    pub middle: f64,
    /// Of the symbols.
    pub linear: [f64; N],
    /// Of their products; symmetric.
    pub square: [[f64; N]; N],
    /// Greatest difference from the polynomial.
    pub rest: f64,
}

impl<const N: usize> Taylor<N> {
    /// The same everywhere.
    pub const fn constant(middle: f64) -> Self {
        Self { middle, linear: [0.0; N], square: [[0.0; N]; N], rest: 0.0 }
    }

    /// From `middle − half` to `middle + half` with a symbol.
    pub fn range(middle: f64, half: f64, symbol: usize) -> Self {
        let mut range = Self::constant(middle);
        range.linear[symbol] = half;
        range
    }

    fn linear_size(&self) -> f64 {
        self.linear.iter().map(|g| g.abs()).sum()
    }

    pub fn square_size(&self) -> f64 {
        self.square.iter().flatten().map(|h| h.abs()).sum()
    }

    /// Greatest distance from the middle.
    pub fn spread(&self) -> f64 {
        self.linear_size() + self.square_size() + self.rest
    }

    /// A lower bound over the cell: along each symbol by itself as low as it gets.
    pub fn low(&self) -> f64 {
        let mut low = self.middle - self.rest;
        for i in 0..N {
            let (g, h) = (self.linear[i].abs(), self.square[i][i]);
            low += if 2.0 * h > g { -g * g / (4.0 * h) } else { h - g };
            low -= (0..N).filter(|j| *j != i).map(|j| self.square[i][j].abs()).sum::<f64>();
        }
        // a rest that is no number bounds nothing
        if low.is_nan() { f64::NEG_INFINITY } else { low }
    }

    /// An upper bound over the cell.
    pub fn high(&self) -> f64 {
        -(-*self).low()
    }

    /// f of it, from f, f′ and f″/2 in the middle, and what the cubic rest is at the most.
    fn mapped(&self, [value, first, second]: [f64; 3], cubic: f64) -> Self {
        let (g, beyond) = (self.linear_size(), self.square_size() + self.rest);
        let mut mapped = Self::constant(value);
        for i in 0..N {
            mapped.linear[i] = first * self.linear[i];
            for j in 0..N {
                mapped.square[i][j] = first * self.square[i][j] + second * self.linear[i] * self.linear[j];
            }
        }
        mapped.rest = first.abs() * self.rest + second.abs() * beyond * (2.0 * g + beyond) + cubic;
        mapped
    }

    fn reciprocal(&self) -> Self {
        let (value, share) = (1.0 / self.middle, self.spread() / self.middle.abs());
        // 1/(1+t) = 1 − t + t² − t³/(1+t)
        let cubic = if share < 1.0 { share.powi(3) / (1.0 - share) * value.abs() } else { f64::INFINITY };
        self.mapped([value, -value * value, value * value * value], cubic)
    }

    /// The root of what is not negative: where the cell reaches below 0, there is nothing.
    pub fn root_of_positive(&self) -> Self {
        if self.middle > self.spread() {
            return self.sqrt();
        }
        let half = 0.5 * self.high().max(0.0).sqrt();
        Self { rest: half, ..Self::constant(half) }
    }

    /// The polynomial and rest of `self` plus a factor times another.
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut sum = *self;
        sum.middle += factor * other.middle;
        for i in 0..N {
            sum.linear[i] += factor * other.linear[i];
            for j in 0..N {
                sum.square[i][j] += factor * other.square[i][j];
            }
        }
        sum.rest += factor.abs() * other.rest;
        sum
    }
}

impl<const N: usize> Default for Taylor<N> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<const N: usize> PartialEq for Taylor<N> {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl<const N: usize> PartialOrd for Taylor<N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        let difference = *self - *other;
        let spread = difference.spread();
        if difference.middle > spread {
            Some(Ordering::Greater)
        } else if difference.middle < -spread {
            Some(Ordering::Less)
        } else if difference.middle == 0.0 && spread == 0.0 {
            Some(Ordering::Equal)
        } else {
            UNDECIDED.set(true);
            None
        }
    }
}

impl<const N: usize> Neg for Taylor<N> {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            middle: -self.middle,
            linear: self.linear.map(|g| -g),
            square: self.square.map(|row| row.map(|h| -h)),
            rest: self.rest,
        }
    }
}

impl<const N: usize> AddAssign for Taylor<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.middle += other.middle;
        for i in 0..N {
            self.linear[i] += other.linear[i];
            for j in 0..N {
                self.square[i][j] += other.square[i][j];
            }
        }
        self.rest += other.rest;
    }
}

impl<const N: usize> SubAssign for Taylor<N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        self.middle -= other.middle;
        for i in 0..N {
            self.linear[i] -= other.linear[i];
            for j in 0..N {
                self.square[i][j] -= other.square[i][j];
            }
        }
        self.rest += other.rest;
    }
}

impl<const N: usize> Mul for Taylor<N> {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (&self, &other);
        let ([ga, gb], [ha, hb]) = ([a.linear_size(), b.linear_size()], [a.square_size(), b.square_size()]);
        let mut product = Self::constant(a.middle * b.middle);
        for i in 0..N {
            product.linear[i] = a.middle * b.linear[i] + b.middle * a.linear[i];
            for j in 0..N {
                product.square[i][j] = a.middle * b.square[i][j]
                    + b.middle * a.square[i][j]
                    + 0.5 * (a.linear[i] * b.linear[j] + a.linear[j] * b.linear[i]);
            }
        }
        product.rest = ga * hb
            + ha * gb
            + ha * hb
            + a.rest * (b.middle.abs() + gb + hb + b.rest)
            + b.rest * (a.middle.abs() + ga + ha);
        product
    }
}

impl<const N: usize> Div for Taylor<N> {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        Mul::mul(self, other.reciprocal())
    }
}

impl<const N: usize> Add for Taylor<N> {
    type Output = Self;

    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl<const N: usize> Sub for Taylor<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}

impl<const N: usize> MulAssign for Taylor<N> {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl<const N: usize> DivAssign for Taylor<N> {
    fn div_assign(&mut self, other: Self) {
        *self = *self / other;
    }
}

impl<const N: usize> Zero for Taylor<N> {
    fn zero() -> Self {
        Self::ZERO
    }

    fn is_zero(&self) -> bool {
        *self == Self::ZERO
    }
}

impl<const N: usize> One for Taylor<N> {
    fn one() -> Self {
        Self::ONE
    }
}

impl<const N: usize> Scalar for Taylor<N> {
    const ZERO: Self = Self::constant(0.0);
    const ONE: Self = Self::constant(1.0);
    const EPSILON: Self = Self::constant(f64::EPSILON);
    /// Limits are looked at by their own bounds ([`Cover`](super::cover::Cover)). The core's are put where no cell that counts meets
    /// them, or a cell across a table's edge would be undecided.
    const SLACK: Self = Self::constant(1.0);
    const LAST_STEP: Self = Self::constant(<f64 as Scalar>::LAST_STEP);

    fn from_f64(value: f64) -> Self {
        Self::constant(value)
    }

    fn to_f64(self) -> f64 {
        self.middle
    }

    fn is_finite(self) -> bool {
        let finite = (self.middle.abs() + self.spread()).is_finite();
        // no bound is no answer
        if !finite {
            UNDECIDED.set(true);
        }
        finite
    }

    fn abs(self) -> Self {
        let (size, spread) = (self.middle.abs(), self.spread());
        if size >= spread {
            return if self.middle < 0.0 { -self } else { self };
        }
        let half = 0.5 * (size + spread);
        Self { rest: half, ..Self::constant(half) }
    }

    fn sqrt(self) -> Self {
        let (c, least) = (self.middle, self.middle - self.spread());
        if self.spread() == 0.0 {
            return Self::constant(c.sqrt());
        }
        let root = c.sqrt();
        let cubic =
            if least > 0.0 { self.spread().powi(3) / (16.0 * least * least * least.sqrt()) } else { f64::INFINITY };
        self.mapped([root, 0.5 / root, -0.125 / (root * c)], cubic)
    }

    fn cbrt(self) -> Self {
        let (c, least) = (self.middle, self.middle.abs() - self.spread());
        if self.spread() == 0.0 {
            return Self::constant(c.cbrt());
        }
        let root = c.cbrt();
        let cubic =
            if least > 0.0 { 10.0 / 162.0 * self.spread().powi(3) * least.powf(-8.0 / 3.0) } else { f64::INFINITY };
        self.mapped([root, root / (3.0 * c), -root / (9.0 * c * c)], cubic)
    }

    fn floor(self) -> Self {
        let floor = (self.middle - self.spread()).floor();
        if floor != (self.middle + self.spread()).floor() {
            UNDECIDED.set(true);
        }
        Self::constant(floor)
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.middle.sin_cos();
        let cubic = self.spread().powi(3) / 6.0;
        (self.mapped([sin, cos, -0.5 * sin], cubic), self.mapped([cos, -sin, -0.5 * cos], cubic))
    }

    fn cos(self) -> Self {
        self.sin_cos().1
    }

    fn acos(self) -> Self {
        (Self::ONE - self * self).sqrt().atan2(self)
    }

    fn atan2(self, x: Self) -> Self {
        let (y0, x0) = (Self::constant(self.middle), Self::constant(x.middle));
        let along = x * x0 + self * y0;
        if along.middle <= along.spread() {
            return Self { rest: f64::INFINITY, ..Self::ZERO };
        }
        // the rest of the turn is less than a right angle; |d³ atan| ≤ 2
        let turn = (self * x0 - x * y0) / along;
        turn.mapped([self.middle.atan2(x.middle), 1.0, 0.0], turn.spread().powi(3) / 3.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// Whether a function is within bounds and rest of what stands for it, at random points of the cell.
    fn holds(taylor: &Taylor<2>, rng: &mut Rng, f: impl Fn([f64; 2]) -> f64) -> bool {
        (0..200).all(|_| {
            let s = [0; 2].map(|_| 2.0 * rng.f64() - 1.0);
            let squares = |i: usize| (0..2).map(|j| taylor.square[i][j] * s[i] * s[j]).sum::<f64>();
            let said = taylor.middle + (0..2).map(|i| taylor.linear[i] * s[i] + squares(i)).sum::<f64>();
            let value = f(s);
            (value - said).abs() <= taylor.rest + 1e-12
                && value >= taylor.low() - 1e-12
                && value <= taylor.high() + 1e-12
        })
    }

    /// All operations together, over small cells and great ones.
    fn formula<T: Scalar>(x: T, y: T) -> T {
        let (sin, cos) = (x * y).sin_cos();
        let root = (x * x + y * y + T::ONE).sqrt();
        (sin / root + cos * y).atan2(root - sin * sin) + (root * x).cbrt() + (sin * T::from_f64(0.5)).acos()
    }

    #[test]
    fn a_function_is_within_its_bounds_and_a_planted_one_is_not() {
        let seed = std::env::var("PKM_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or_else(|| fastrand::u64(..));
        println!("PKM_SEED={seed}");
        let mut rng = Rng::with_seed(seed);
        let mut narrow = 0;
        for _ in 0..300 {
            let (middle, half) = ([1.0 + rng.f64(), rng.f64() - 0.5], 0.3 * rng.f64() * rng.f64());
            let [x, y] = [0, 1].map(|i: usize| Taylor::<2>::range(middle[i], half, i));
            let f = |s: [f64; 2]| formula(middle[0] + half * s[0], middle[1] + half * s[1]);
            let taylor = formula(x, y);
            assert!(holds(&taylor, &mut rng, f), "{middle:?} ± {half}");
            if taylor.rest.is_finite() && half > 0.01 {
                narrow += 1;
                assert!(!holds(&Taylor { rest: 0.0, ..taylor }, &mut rng, f), "no rest was found out");
                let above = Taylor::constant(taylor.low() + 2.0 * taylor.spread());
                assert!(!holds(&above, &mut rng, f), "a bound above all values was not found out");
            }
        }
        assert!(narrow > 50, "{narrow}");
    }

    #[test]
    fn comparisons_that_a_cell_does_not_decide_are_told() {
        let x = Taylor::<2>::range(1.0, 0.5, 0);
        assert_eq!(decided(|| x > Taylor::ZERO), Some(true));
        assert_eq!(decided(|| x > Taylor::constant(1.2)), None);
        assert_eq!(decided(|| x < Taylor::constant(1.6)), Some(true));
    }
}

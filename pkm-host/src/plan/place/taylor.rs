//! Long, as it is one type with its arithmetic. Numbers that stand for a function over a cell: a polynomial of the third degree
//! in two or three symbols of −1…1, and by how much the function differs from it at the most. The core's formulas run on them as they are (its [`Scalar`]), and give what holds for
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

/// No result: a comparison outside of this type is open.
pub(super) fn undecided<R>() -> Option<R> {
    UNDECIDED.set(true);
    None
}

/// Terms of a polynomial of the third degree in two symbols.
pub(super) const TWO: usize = 10;
/// In three.
pub(super) const THREE: usize = 20;
/// Of the squares the one that is the product of two symbols.
const SQUARE: [[usize; 3]; 3] = [[0, 1, 3], [1, 2, 4], [3, 4, 5]];
/// Of the cubes the one that is the product of a symbol and a square.
const CUBE: [[usize; 6]; 3] = [[0, 1, 2, 4, 5, 7], [1, 2, 3, 5, 6, 8], [4, 5, 6, 7, 8, 9]];

/// A function over a cell, as a polynomial of [`TWO`] or [`THREE`] terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taylor<const N: usize> {
    /// Value in the middle, then factors of the symbols, of their squares and products of two, of their cubes and products of three.
    pub terms: [f64; N],
    /// Greatest difference from the polynomial.
    pub rest: f64,
}

impl<const N: usize> Taylor<N> {
    pub const SYMBOLS: usize = if N == THREE { 3 } else { 2 };
    const SQUARES: usize = 1 + Self::SYMBOLS;
    const CUBES: usize = Self::SQUARES + Self::SYMBOLS * (Self::SYMBOLS + 1) / 2;

    /// Anything.
    pub const UNKNOWN: Self = Self { terms: [0.0; N], rest: f64::INFINITY };

    /// The same everywhere.
    pub const fn constant(middle: f64) -> Self {
        let mut terms = [0.0; N];
        terms[0] = middle;
        Self { terms, rest: 0.0 }
    }

    /// From `middle − half` to `middle + half` with a symbol.
    pub fn range(middle: f64, half: f64, symbol: usize) -> Self {
        let mut range = Self::constant(middle);
        range.terms[1 + symbol] = half;
        range
    }

    /// In the middle of the cell.
    pub fn middle(&self) -> f64 {
        self.terms[0]
    }

    /// The factor of a symbol.
    pub fn linear(&self, symbol: usize) -> f64 {
        self.terms[1 + symbol]
    }

    /// The greatest sums of the terms of the first, second and third degree.
    #[inline(always)]
    fn sizes(&self) -> [f64; 3] {
        let mut sizes = [0.0; 3];
        // of constant length, each degree beside the others
        for k in 1..Self::SQUARES {
            sizes[0] += self.terms[k].abs();
        }
        for k in Self::SQUARES..Self::CUBES {
            sizes[1] += self.terms[k].abs();
        }
        for k in Self::CUBES..N {
            sizes[2] += self.terms[k].abs();
        }
        sizes
    }

    /// Greatest distance from the middle.
    pub fn spread(&self) -> f64 {
        let [linear, square, cube] = self.sizes();
        linear + square + cube + self.rest
    }

    /// Greatest distance from the terms of the first degree.
    pub fn bent(&self) -> f64 {
        let [_, square, cube] = self.sizes();
        square + cube + self.rest
    }

    /// How much of the spread a symbol has part in.
    pub fn spread_by(&self, symbol: usize) -> f64 {
        let square = |j: usize| self.terms[Self::SQUARES + SQUARE[symbol][j]].abs();
        let cube = |m: usize| self.terms[Self::CUBES + CUBE[symbol][m]].abs();
        let squares = (0..Self::SYMBOLS).map(square).sum::<f64>();
        self.linear(symbol).abs() + squares + (0..Self::CUBES - Self::SQUARES).map(cube).sum::<f64>()
    }

    /// A lower bound over the cell: along each symbol by itself as low as it gets.
    pub fn low(&self) -> f64 {
        let [_, square, cube] = self.sizes();
        let mut low = self.middle() - self.rest - cube - square;
        for i in 0..Self::SYMBOLS {
            let (g, h) = (self.linear(i).abs(), self.terms[Self::SQUARES + SQUARE[i][i]]);
            low += h.abs() + if 2.0 * h > g { -g * g / (4.0 * h) } else { h - g };
        }
        // a rest that is no number bounds nothing
        if low.is_nan() { f64::NEG_INFINITY } else { low }
    }

    /// An upper bound over the cell.
    pub fn high(&self) -> f64 {
        -(-*self).low()
    }

    /// f of it, from f, f′, f″/2 and f‴/6 in the middle, and what the rest of the fourth degree is at the most.
    fn mapped(&self, [value, first, second, third]: [f64; 4], fourth: f64) -> Self {
        let mut from_middle = *self;
        from_middle.terms[0] = 0.0;
        let square = from_middle * from_middle;
        let mut mapped = Self::constant(value).plus(first, &from_middle).plus(second, &square);
        if third != 0.0 {
            mapped = mapped.plus(third, &(square * from_middle));
        }
        mapped.rest += fourth;
        mapped
    }

    fn reciprocal(&self) -> Self {
        let (value, share) = (1.0 / self.middle(), self.spread() / self.middle().abs());
        if share == 0.0 {
            return Self::constant(value);
        }
        // 1/(1+t) = 1 − t + t² − t³ + t⁴/(1+t)
        let fourth = if share < 1.0 { share.powi(4) / (1.0 - share) * value.abs() } else { f64::INFINITY };
        self.mapped([value, -value.powi(2), value.powi(3), -value.powi(4)], fourth)
    }

    /// The root of what is not negative: where the cell reaches below 0, there is nothing.
    pub fn root_of_positive(&self) -> Self {
        if self.middle() > self.spread() {
            return self.sqrt();
        }
        let half = 0.5 * self.high().max(0.0).sqrt();
        Self { rest: half, ..Self::constant(half) }
    }

    fn is_constant(&self) -> bool {
        self.rest == 0.0 && self.terms[1..].iter().all(|term| *term == 0.0)
    }

    fn times(&self, factor: f64) -> Self {
        Self { terms: self.terms.map(|term| factor * term), rest: factor.abs() * self.rest }
    }

    /// The polynomial and rest of `self` plus a factor times another.
    #[inline]
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut sum = *self;
        for k in 0..N {
            sum.terms[k] += factor * other.terms[k];
        }
        sum.rest += factor.abs() * other.rest;
        sum
    }

    /// Its terms beyond the first degree, and its rest, of other functions in place of the symbols.
    pub fn bent_of(&self, symbols: &[Self]) -> Self {
        let mut bent = Self { rest: self.rest, ..Self::ZERO };
        for (j, b) in symbols.iter().enumerate() {
            for (i, a) in symbols.iter().enumerate().take(j + 1) {
                // every square once, times what is not before it: every cube once
                let square = *a * *b;
                bent = bent.plus(self.terms[Self::SQUARES + SQUARE[i][j]], &square);
                for (k, c) in symbols.iter().enumerate().skip(j) {
                    bent = bent.plus(self.terms[Self::CUBES + CUBE[k][SQUARE[i][j]]], &(square * *c));
                }
            }
        }
        bent
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
        if difference.middle() > spread {
            Some(Ordering::Greater)
        } else if difference.middle() < -spread {
            Some(Ordering::Less)
        } else if difference.middle() == 0.0 && spread == 0.0 {
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
        Self { terms: self.terms.map(|t| -t), rest: self.rest }
    }
}

impl<const N: usize> AddAssign for Taylor<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        for k in 0..N {
            self.terms[k] += other.terms[k];
        }
        self.rest += other.rest;
    }
}

impl<const N: usize> SubAssign for Taylor<N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        for k in 0..N {
            self.terms[k] -= other.terms[k];
        }
        self.rest += other.rest;
    }
}

impl<const N: usize> Mul for Taylor<N> {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (&self.terms, &other.terms);
        // most factors are constants
        if self.is_constant() {
            return other.times(a[0]);
        }
        if other.is_constant() {
            return self.times(b[0]);
        }
        let ([a1, a2, a3], [b1, b2, b3]) = (self.sizes(), other.sizes());
        let mut terms = [0.0; N];
        terms[0] = a[0] * b[0];
        for k in 1..N {
            terms[k] = a[0] * b[k] + b[0] * a[k];
        }
        let (squares, cubes) = (Self::SQUARES, Self::CUBES);
        for i in 0..Self::SYMBOLS {
            for j in 0..Self::SYMBOLS {
                terms[squares + SQUARE[i][j]] += a[1 + i] * b[1 + j];
            }
            for m in 0..cubes - squares {
                terms[cubes + CUBE[i][m]] += a[1 + i] * b[squares + m] + b[1 + i] * a[squares + m];
            }
        }
        let rest = a1 * b3
            + a2 * (b2 + b3)
            + a3 * (b1 + b2 + b3)
            + self.rest * (b[0].abs() + b1 + b2 + b3 + other.rest)
            + other.rest * (a[0].abs() + a1 + a2 + a3);
        Self { terms, rest }
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
        self.middle()
    }

    fn is_finite(self) -> bool {
        let finite = (self.middle().abs() + self.spread()).is_finite();
        // no bound is no answer
        if !finite {
            UNDECIDED.set(true);
        }
        finite
    }

    fn abs(self) -> Self {
        let (size, spread) = (self.middle().abs(), self.spread());
        if size >= spread {
            return if self.middle() < 0.0 { -self } else { self };
        }
        let half = 0.5 * (size + spread);
        Self { rest: half, ..Self::constant(half) }
    }

    fn sqrt(self) -> Self {
        let (c, spread) = (self.middle(), self.spread());
        let (root, least) = (c.sqrt(), c - spread);
        if spread == 0.0 {
            return Self::constant(root);
        }
        let fourth = if least > 0.0 { 5.0 / 128.0 * spread.powi(4) * least.powf(-3.5) } else { f64::INFINITY };
        self.mapped([root, 0.5 / root, -0.125 / (root * c), 0.0625 / (root * c * c)], fourth)
    }

    fn cbrt(self) -> Self {
        let (c, spread) = (self.middle(), self.spread());
        let (root, least) = (c.cbrt(), c.abs() - spread);
        if spread == 0.0 {
            return Self::constant(root);
        }
        let fourth = if least > 0.0 { 10.0 / 243.0 * spread.powi(4) * least.powf(-11.0 / 3.0) } else { f64::INFINITY };
        let [first, second, third] = [1.0 / 3.0, -1.0 / 9.0, 5.0 / 81.0];
        self.mapped([root, first * root / c, second * root / c.powi(2), third * root / c.powi(3)], fourth)
    }

    fn floor(self) -> Self {
        let floor = (self.middle() - self.spread()).floor();
        if floor != (self.middle() + self.spread()).floor() {
            UNDECIDED.set(true);
        }
        Self::constant(floor)
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.middle().sin_cos();
        let fourth = self.spread().powi(4) / 24.0;
        let of = |s: f64, c: f64| self.mapped([s, c, -s / 2.0, -c / 6.0], fourth);
        (of(sin, cos), of(cos, -sin))
    }

    fn cos(self) -> Self {
        self.sin_cos().1
    }

    fn acos(self) -> Self {
        (Self::ONE - self * self).sqrt().atan2(self)
    }

    fn atan2(self, x: Self) -> Self {
        let (y0, x0) = (Self::constant(self.middle()), Self::constant(x.middle()));
        let along = x * x0 + self * y0;
        if along.middle() <= along.spread() {
            return Self::UNKNOWN;
        }
        // the rest of the turn is less than a right angle; |d⁴ atan|/24 = |t − t³|/(1 + t²)⁴ < 0.2
        let turn = (self * x0 - x * y0) / along;
        turn.mapped([self.middle().atan2(x.middle()), 1.0, 0.0, -1.0 / 3.0], 0.2 * turn.spread().powi(4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// Whether a function is within bounds and rest of what stands for it, at random points of the cell.
    fn holds(taylor: &Taylor<TWO>, rng: &mut Rng, f: impl Fn([f64; 2]) -> f64) -> bool {
        (0..200).all(|_| {
            let [x, y] = [0; 2].map(|_| 2.0 * rng.f64() - 1.0);
            let symbols = [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y];
            let said = taylor.terms.iter().zip(symbols).map(|(term, symbol)| term * symbol).sum::<f64>();
            let value = f([x, y]);
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
            let [x, y] = [0, 1].map(|i: usize| Taylor::<TWO>::range(middle[i], half, i));
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
        let x = Taylor::<TWO>::range(1.0, 0.5, 0);
        assert_eq!(decided(|| x > Taylor::ZERO), Some(true));
        assert_eq!(decided(|| x > Taylor::constant(1.2)), None);
        assert_eq!(decided(|| x < Taylor::constant(1.6)), Some(true));
    }
}

//! A Kalman filter of amplitudes whose covariance is kept as U D Uᵀ (Bierman 1977): it stays positive, also in `f32`.

use crate::scalar::Scalar;

/// What is known of `N` numbers: a normal distribution.
///
/// Their units are those in which each had a deviation of 1 at the start, so that `f32` will do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Filter<T, const N: usize> {
    pub mean: [T; N],
    /// U, of which what is above the diagonal counts; entry (i, j) is `upper[j][i]`. On its diagonal is 1. On and below the diagonal are
    /// U and D of the last [`remember`](Self::remember): a copy beside them would take more of a reading's instructions.
    pub upper: [[T; N]; N],
    pub diagonal: [T; N],
    remembered: [T; N],
}

impl<T: Scalar, const N: usize> Filter<T, N> {
    /// Each number with a deviation of 1, and nothing that goes together.
    pub fn new(mean: [T; N]) -> Self {
        Self { mean, upper: [[T::ZERO; N]; N], diagonal: [T::ONE; N], remembered: mean }
    }

    /// Keeps what is known for [`recall`](Self::recall).
    pub fn remember(&mut self) {
        self.remembered = self.mean;
        for j in 0..N {
            for i in 0..j {
                self.upper[i][j] = self.upper[j][i];
            }
            self.upper[j][j] = self.diagonal[j];
        }
    }

    /// Goes back to what was known.
    pub fn recall(&mut self) {
        self.mean = self.remembered;
        for j in 0..N {
            for i in 0..j {
                self.upper[j][i] = self.upper[i][j];
            }
            self.diagonal[j] = self.upper[j][j];
        }
    }

    /// Uᵀ times a row.
    fn seen(&self, row: &[T; N]) -> [T; N] {
        let mut seen = *row;
        for j in 1..N {
            for i in 0..j {
                seen[j] += self.upper[j][i] * row[i];
            }
        }
        seen
    }

    /// Variance of the sum of the numbers with a row's weights.
    pub fn variance_of(&self, row: &[T; N]) -> T {
        let seen = self.seen(row);
        (0..N).fold(T::ZERO, |sum, j| sum + seen[j] * seen[j] * self.diagonal[j])
    }

    /// Variance of each of the numbers.
    pub fn variances(&self) -> [T; N] {
        let mut variances = self.diagonal;
        for j in 1..N {
            for i in 0..j {
                let weight = self.upper[j][i];
                variances[i] += weight * weight * self.diagonal[j];
            }
        }
        variances
    }

    /// Variance of one of the numbers.
    pub fn variance(&self, number: usize) -> T {
        let mut columns = self.upper.iter().zip(&self.diagonal).skip(number);
        let own = columns.next().map_or(T::ZERO, |(_, diagonal)| *diagonal);
        columns.fold(own, |sum, (column, diagonal)| {
            let weight = column.get(number).copied().unwrap_or(T::ZERO);
            sum + weight * weight * *diagonal
        })
    }

    /// Sum of the numbers with a row's weights.
    pub fn predicted(&self, row: &[T; N]) -> T {
        (0..N).fold(T::ZERO, |sum, j| sum + row[j] * self.mean[j])
    }

    /// Takes in a reading of a row, with the variance of its noise; gives what was read beyond what was predicted, and its
    /// variance.
    pub fn absorb(&mut self, row: &[T; N], read: T, noise: T) -> (T, T) {
        let beyond = read - self.predicted(row);
        let seen = self.seen(row);
        let mut gain = [T::ZERO; N];
        let mut variance = noise;
        let columns = self.upper.iter_mut().zip(&mut self.diagonal).zip(&seen);
        for (j, ((column, diagonal), seen)) in columns.enumerate() {
            let weighted = *diagonal * *seen;
            let before = variance;
            variance += weighted * *seen;
            *diagonal *= before / variance;
            let ratio = *seen / before;
            for (entry, gain) in column.iter_mut().zip(&mut gain).take(j) {
                let old = *entry;
                *entry = old - ratio * *gain;
                *gain += old * weighted;
            }
            if let Some(own) = gain.get_mut(j) {
                *own = weighted;
            }
        }
        let step = beyond / variance;
        for j in 0..N {
            self.mean[j] += gain[j] * step;
        }
        (beyond, variance)
    }

    /// Adds to the variance of one of the numbers (Agee and Turner).
    pub fn widen(&mut self, number: usize, variance: T) {
        let mut ahead = [T::ZERO; N];
        if let Some(own) = ahead.get_mut(number) {
            *own = T::ONE;
        }
        let mut left = variance;
        for (j, (column, diagonal)) in self.upper.iter_mut().zip(&mut self.diagonal).enumerate().take(number + 1).rev()
        {
            let own = ahead.get(j).copied().unwrap_or(T::ZERO);
            let old = *diagonal;
            let new = old + left * own * own;
            // nothing of it in this column, or nothing to share it with
            if own == T::ZERO || !(new > T::ZERO) {
                continue;
            }
            let share = left * own / new;
            *diagonal = new;
            left *= old / new;
            for (entry, ahead) in column.iter_mut().zip(&mut ahead).take(j) {
                *ahead -= own * *entry;
                *entry += share * *ahead;
            }
        }
    }
}

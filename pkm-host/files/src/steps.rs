//! Steps in which numbers were read: those of a dial are coarser than the digits that they are written with.

use super::readings::{CHANNELS, KINDS, Reading};

/// Fewest numbers other than 0, each of another load, and sizes of them, that tell a step.
const MIN_LOADS: usize = 12;
const MIN_SIZES: usize = 3;

/// Least share of a channel's numbers other than 0 that are multiples of its step: one that was mistyped is none.
const MIN_SHARE: f64 = 0.99;

/// How far arithmetic may put a number off a multiple, as a share of the last digit that is written.
const MAX_OFF: f64 = 0.01;

/// Which differences between neighbours are looked at, as shares of all from the least on, and how many steps these may be: next to
/// numbers that were mistyped they are less, and where numbers lie far apart more than one.
const LOOKED_AT: [f64; 4] = [0.05, 0.15, 0.3, 0.5];
const MAX_STEPS: u32 = 6;

/// The step of each channel, m and rad, of readings whose last digits are worth `written`. A channel that does not tell has that of another
/// one of its kind, if its numbers are multiples of it.
pub(super) fn steps(readings: &[Reading], written: [f64; CHANNELS]) -> [f64; CHANNELS] {
    let numbers: [Numbers; CHANNELS] = std::array::from_fn(|c| {
        let number = |r: &Reading| Some((r.repeat_of, r.observed[c]? / written[c]));
        Numbers::new(readings.iter().filter_map(number))
    });
    let own: [Option<f64>; CHANNELS] = std::array::from_fn(|c| Some(numbers[c].coarser()? * written[c]));
    std::array::from_fn(|c| {
        let of_kind = (0..CHANNELS).filter(|other| KINDS[*other] == KINDS[c]).filter_map(|other| own[other]);
        let alike = || of_kind.filter(|step| numbers[c].are_multiples(step / written[c])).reduce(f64::max);
        own[c].or_else(alike).unwrap_or(written[c])
    })
}

/// Numbers of a channel in units of their last digit.
struct Numbers {
    /// Other than 0, in their order.
    sizes: Vec<f64>,
    loads: usize,
}

impl Numbers {
    /// Of numbers with their loads.
    fn new(numbers: impl Iterator<Item = (usize, f64)>) -> Self {
        let (mut loads, mut sizes): (Vec<usize>, Vec<f64>) =
            numbers.map(|(load, v)| (load, v.abs())).filter(|(_, size)| *size > 0.5).unzip();
        loads.sort_unstable();
        loads.dedup();
        sizes.sort_unstable_by(f64::total_cmp);
        Self { sizes, loads: loads.len() }
    }

    fn are_multiples(&self, step: f64) -> bool {
        let is_multiple = |size: &&f64| (*size - (*size / step).round() * step).abs() <= MAX_OFF;
        let multiples = self.sizes.iter().filter(is_multiple).count();
        !self.sizes.is_empty() && multiples as f64 >= MIN_SHARE * self.sizes.len() as f64
    }

    /// The greatest step of more than a last digit that the numbers are multiples of.
    fn coarser(&self) -> Option<f64> {
        let gaps = self.sizes.windows(2).map(|pair| pair[1] - pair[0]);
        let mut gaps: Vec<f64> = gaps.filter(|gap| *gap > 0.5).collect();
        if self.loads < MIN_LOADS || gaps.len() + 1 < MIN_SIZES {
            return None;
        }
        gaps.sort_unstable_by(f64::total_cmp);
        let looked_at = LOOKED_AT.map(|share| (gaps[(share * gaps.len() as f64) as usize] / MAX_OFF).round() * MAX_OFF);
        let parts = looked_at.into_iter().flat_map(|gap| (1..=MAX_STEPS).map(move |parts| gap / f64::from(parts)));
        parts.filter(|step| *step > 1.5 && self.are_multiples(*step)).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(numbers: &[f64]) -> Option<f64> {
        Numbers::new(numbers.iter().copied().enumerate()).coarser()
    }

    #[test]
    fn a_step_is_what_all_numbers_but_mistyped_ones_are_multiples_of() {
        let dial: Vec<f64> = (0..150).map(|n| 10.0 * f64::from((7 * n) % 23 - 11)).collect();
        assert_eq!(of(&dial), Some(10.0));
        // half a thousandth of an inch, in tenths of a micrometre
        assert_eq!(of(&dial.iter().map(|v| 12.7 * v).collect::<Vec<_>>()), Some(127.0));
        let mistyped = |others: usize| [&vec![9999.0; others][..], &dial].concat();
        assert_eq!((of(&mistyped(1)), of(&mistyped(40))), (Some(10.0), None));
        let odd = |(n, v): (usize, &f64)| v + f64::from(u8::from(n % 4 == 0));
        assert_eq!(of(&dial.iter().enumerate().map(odd).collect::<Vec<_>>()), None);
        // few numbers, far apart
        let far: Vec<f64> = (1..20).map(|n: i32| f64::from(n.pow(3) % 211) * 10.0).collect();
        assert_eq!(of(&far), Some(10.0));
    }

    #[test]
    fn few_numbers_tell_no_step() {
        // as many as tell it, and one less
        assert_eq!((of(&[10.0, 20.0, 40.0].repeat(4)), of(&[10.0, 20.0, 40.0].repeat(4)[1..])), (Some(10.0), None));
        assert_eq!(of(&[-5.0, 5.0, 10.0].repeat(20)), None);
        assert_eq!((of(&[17.0; 50]), of(&[0.0; 50])), (None, None));
        // one load read again and again; zeros that are multiples of anything
        assert_eq!(Numbers::new([(0, 10.0), (0, 20.0), (0, 40.0)].repeat(20).into_iter()).coarser(), None);
        let primes = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0];
        assert_eq!(of(&[&primes[..], &[0.0; 5000]].concat()), None);
    }

    #[test]
    fn a_channel_that_does_not_tell_has_the_step_of_its_kind() {
        let one = |n: usize| {
            let mut observed = [None; CHANNELS];
            observed[0] = Some(1e-6 * 10.0 * ((7 * n) % 23) as f64);
            observed[1] = Some(if n == 3 { 20e-6 } else { 0.0 });
            observed[2] = Some(if n == 3 { 21e-6 } else { 0.0 });
            observed[3] = Some(if n == 3 { 20e-6 } else { 0.0 });
            Reading {
                line: 0,
                condition: n,
                repeat_of: n,
                series: n,
                observed,
                sigma: [None; 2],
                covariance: None,
                load_random: None,
            }
        };
        let found = steps(&(0..40).map(one).collect::<Vec<_>>(), [1e-6; CHANNELS]);
        let in_digits = found.map(|step| (1e6 * step).round());
        assert_eq!(in_digits, [10.0, 10.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    }
}

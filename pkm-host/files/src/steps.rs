//! Steps in which numbers were read: those of a dial are coarser than the digits that they are written with.

use std::collections::{BTreeMap, BTreeSet};

use super::readings::{CHANNELS, Reading};

/// Fewest numbers other than 0, each of another load, that tell a step: all of them are multiples of two steps by a chance of 2⁻¹².
const MIN_LOADS: usize = 12;

/// Least share of a channel's numbers that are multiples of its step: one that was mistyped is none.
const MIN_SHARE: f64 = 0.99;

/// How far arithmetic may put a number off a multiple, as a share of the last digit that is written.
const MAX_OFF: f64 = 0.01;

/// The step of each channel, m and rad, of readings whose last digits are worth `written`.
pub(super) fn steps(readings: &[Reading], written: [f64; CHANNELS]) -> [f64; CHANNELS] {
    std::array::from_fn(|channel| {
        let last_digit = written[channel];
        let number = |r: &Reading| Some((r.repeat_of, r.observed[channel]? / last_digit));
        last_digit * coarser(&readings.iter().filter_map(number).collect::<Vec<_>>()).unwrap_or(1.0)
    })
}

/// The step of numbers that are multiples of more than their last digit, in units of that. With each comes its load.
fn coarser(numbers: &[(usize, f64)]) -> Option<f64> {
    let loads: BTreeSet<usize> = numbers.iter().filter(|(_, v)| v.abs() > 0.5).map(|(load, _)| *load).collect();
    let mut sizes: Vec<f64> = numbers.iter().map(|(_, v)| v.abs()).chain([0.0]).collect();
    sizes.sort_by(f64::total_cmp);
    let mut gaps: BTreeMap<u64, usize> = BTreeMap::new();
    for gap in sizes.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.5) {
        *gaps.entry((gap / MAX_OFF).round() as u64).or_default() += 1;
    }
    // the commonest, of as common ones the least
    let (usual, _) = gaps.into_iter().rev().max_by_key(|(_, count)| *count)?;
    let step = usual as f64 * MAX_OFF;
    let is_multiple = |size: &&f64| (*size - (*size / step).round() * step).abs() <= MAX_OFF;
    let multiples = sizes.iter().filter(is_multiple).count();
    // one number alone is no step
    let differ = numbers.iter().any(|(_, v)| (v - numbers[0].1).abs() > 0.5);
    let is_step =
        differ && loads.len() >= MIN_LOADS && step > 1.5 && multiples as f64 >= MIN_SHARE * sizes.len() as f64;
    is_step.then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_what_all_numbers_but_mistyped_ones_are_multiples_of() {
        let of = |numbers: &[f64]| coarser(&numbers.iter().copied().enumerate().collect::<Vec<_>>());
        let dial: Vec<f64> = (0..150).map(|n| 10.0 * f64::from((7 * n) % 23 - 11)).collect();
        assert_eq!(of(&dial), Some(10.0));
        // half a thousandth of an inch, in tenths of a micrometre
        assert_eq!(of(&dial.iter().map(|v| 12.7 * v).collect::<Vec<_>>()), Some(127.0));
        let mistyped = |others: usize| [&vec![9999.0; others][..], &dial].concat();
        assert_eq!((of(&mistyped(1)), of(&mistyped(40))), (Some(10.0), None));
        // a quarter of the readings are odd
        assert_eq!(
            of(&dial.iter().enumerate().map(|(n, v)| v + f64::from(u8::from(n % 4 == 0))).collect::<Vec<_>>()),
            None
        );
        // as many as tell it, and one less
        assert_eq!((of(&[10.0, 20.0, 40.0].repeat(4)), of(&[10.0, 20.0, 40.0].repeat(4)[1..])), (Some(10.0), None));
        // a channel that is stuck; one load read again and again tells nothing of steps, and neither do numbers that are all 0
        assert_eq!(coarser(&[(0, 10.0), (0, 20.0)].repeat(20)), None);
        assert_eq!((of(&[17.0; 50]), of(&[0.0; 50])), (None, None));
    }
}

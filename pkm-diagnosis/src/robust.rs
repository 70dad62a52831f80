//! Statistics that a few wrong values don't move.

/// Median of the absolute value of a normal error of standard deviation 1.
pub const MEDIAN_OF_NORMAL: f64 = 0.6745;

/// The middle one of some values, or the mean of the two in the middle. Sorts them.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let n = values.len();
    values.sort_by(f64::total_cmp);
    let last = *values.get(n / 2)?;
    Some(if n.is_multiple_of(2) { 0.5 * (last + values[n / 2 - 1]) } else { last })
}

/// The middle one of some values, or the greater of the two in the middle: one of the values themselves. Sorts them.
pub fn upper_median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Standard deviation of normal errors about 0 by the median of their sizes.
pub fn deviation_by_median(median_size: f64) -> f64 {
    median_size / MEDIAN_OF_NORMAL
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_an_even_and_an_odd_number_of_values() {
        assert_eq!((median(&mut [5.0, 1.0, 2.0]), upper_median(&mut [5.0, 1.0, 2.0])), (Some(2.0), Some(2.0)));
        let even = [7.0, 1.0, 2.0, 4.0];
        assert_eq!((median(&mut even.clone()), upper_median(&mut even.clone())), (Some(3.0), Some(4.0)));
        assert_eq!((median(&mut []), upper_median(&mut [])), (None, None));
    }
}

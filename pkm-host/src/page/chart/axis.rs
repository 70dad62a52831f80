//! An axis: its range, its ticks, and where a value is on it.

use crate::error::{Failure, Result};

/// Share of the range that is left free at each end.
const MARGIN: f64 = 0.06;
/// Decades from which on powers of ten alone are marked.
const POWERS_ALONE_DECADES: f64 = 2.5;

/// A range of values; of their logarithms on a logarithmic axis.
#[derive(Clone)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) logarithmic: bool,
}

/// A number without digits that are rounding, or zeros.
pub(crate) fn plain(v: f64) -> String {
    let rounded: f64 = format!("{v:.5e}").parse().unwrap_or(v);
    if rounded != 0.0 && !(1e-4..1e6).contains(&rounded.abs()) { format!("{rounded:e}") } else { rounded.to_string() }
}

impl Axis {
    /// Of some values, with a margin, never empty.
    pub(super) fn new(values: impl Iterator<Item = f64>, logarithmic: bool) -> Result<Self> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values {
            if logarithmic && !(v > 0.0) {
                return Err(Failure::other(format!("cannot draw {v} on a logarithmic axis")));
            }
            let v = if logarithmic { v.log10() } else { v };
            (low, high) = (low.min(v), high.max(v));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let margin = if high > low { MARGIN * (high - low) } else { 0.05 * high.abs().max(1e-3) };
        Ok(Self { low: low - margin, high: high + margin, logarithmic })
    }

    /// Where a value is: 0 at the low end, 1 at the high one.
    pub(super) fn share(&self, v: f64) -> f64 {
        let v = if self.logarithmic { v.log10() } else { v };
        (v - self.low) / (self.high - self.low)
    }

    pub(super) fn length(&self) -> f64 {
        self.high - self.low
    }

    /// The same middle, and another length.
    pub(super) fn of_length(&self, length: f64) -> Self {
        let middle = (self.low + self.high) / 2.0;
        Self { low: middle - length / 2.0, high: middle + length / 2.0, ..*self }
    }

    /// Round values, at most about as many as asked for, with their labels.
    pub(super) fn ticks(&self, most: f64) -> Vec<(f64, String)> {
        let span = self.length();
        if self.logarithmic && span < POWERS_ALONE_DECADES {
            let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
            let marked: &[f64] = if span > 1.2 { &[1.0, 3.0] } else { &[1.0, 2.0, 5.0] };
            let values = (first..=last).flat_map(|n| marked.iter().map(move |m| m * 10_f64.powi(n)));
            let inside = values.filter(|v| (0.0..=1.0).contains(&self.share(*v)));
            return inside.map(|v| (v, plain(v))).collect();
        }
        let least = span / most;
        let power = 10_f64.powf(least.log10().floor());
        let round = [10.0, 5.0, 2.0, 1.0, 0.5, 0.2].map(|n| n * power);
        let wide = round.into_iter().rfind(|step| *step >= 0.999 * least).unwrap_or(10.0 * power);
        // one number alone is no scale: rather closer than asked for
        let two_fit = |step: &f64| (self.high / step).floor() - (self.low / step).ceil() >= 1.0;
        let closer = round.into_iter().filter(|step| *step <= wide).find(two_fit);
        let step = if self.logarithmic { wide.ceil() } else { closer.unwrap_or(wide) };
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        let tick = |n: i64| {
            let v = n as f64 * step;
            let value = if self.logarithmic { 10_f64.powf(v) } else { v };
            (value, plain(value))
        };
        (first..=last).map(tick).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Axis;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks(6.0).into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::new([-0.3, 0.3].into_iter(), false).unwrap();
        assert_eq!(labels(&axis), ["-0.2", "0", "0.2"]);
        let low = Axis::new([-13.0, 14.0].into_iter(), false).unwrap();
        assert_eq!(low.ticks(2.0).into_iter().map(|(_, label)| label).collect::<Vec<_>>(), ["-10", "0", "10"]);
        let decades = Axis::new([1e-7, 1e-2].into_iter(), true).unwrap();
        assert_eq!(labels(&decades), ["1e-7", "1e-6", "1e-5", "0.0001", "0.001", "0.01"]);
        let few = Axis::new([0.6, 90.0].into_iter(), true).unwrap();
        assert_eq!(labels(&few), ["1", "3", "10", "30", "100"]);
    }

    #[test]
    fn one_value_has_a_range_and_zero_no_logarithm() {
        let axis = Axis::new([5.0].into_iter(), false).unwrap();
        assert!((axis.share(5.0) - 0.5).abs() < 1e-12 && axis.length() > 0.0);
        assert!(Axis::new([0.0].into_iter(), true).is_err());
    }
}

//! Gross errors: single numbers that no noise explains, such as a slip of a digit. Each costs its number, not the noise of its
//! channel.

use std::collections::BTreeMap;

use crate::observations::Observations;
use crate::residuals::Outlier;
use crate::robust::{deviation_by_median, median};
use crate::rules::Rules;

/// A number of one channel, less what the declared model gives.
struct Number {
    reading: usize,
    series: usize,
    beyond: f64,
    /// Declared deviation of what each reading draws, beside the noise.
    drawn: f64,
}

/// Numbers that stand out of their repeats, or far out of everything, before anything is fitted; `expected` is by condition and
/// channel. Where so many stand out that they are no single errors, none is given: of slips of a digit, which are far beyond all noise,
/// more than of those that stand out a little.
pub fn gross(observations: &Observations, expected: &[f64], rules: &Rules) -> Vec<Outlier> {
    let channels = observations.channels.len();
    let mut found = Vec::new();
    for channel in 0..channels {
        let mut of_repeat: BTreeMap<usize, Vec<Number>> = BTreeMap::new();
        for (reading, r) in observations.readings.iter().enumerate() {
            if let Some(read) = r.observed[channel] {
                let beyond = read - expected[r.condition * channels + channel];
                let drawn = r.drawn.get(channel).copied().unwrap_or(0.0);
                of_repeat.entry(r.repeat_of).or_default().push(Number { reading, series: r.series, beyond, drawn });
            }
        }
        let count: usize = of_repeat.values().map(Vec::len).sum();
        let least = observations.channels[channel].resolution / 12.0_f64.sqrt();
        let (single, repeated): (Vec<_>, Vec<_>) = of_repeat.into_values().partition(|numbers| numbers.len() == 1);
        let mut own = among_repeats(repeated, least, rules);
        own.extend(far_out(single, least, rules));
        let (slips, others): (Vec<_>, Vec<_>) = own.into_iter().partition(|(_, size)| *size > rules.slip_sd);
        for (own, share) in [(slips, rules.max_slip_share), (others, rules.max_outlier_share)] {
            if own.len() as f64 <= (share * count as f64).max(1.0) {
                let of = |(reading, studentised)| Outlier { reading, channel, studentised };
                found.extend(own.into_iter().map(of));
            }
        }
    }
    found.sort_by_key(|o| (o.reading, o.channel));
    found
}

/// Takes out what a series has in common: its zero reading.
fn without_zeros(repeated: &mut [Vec<Number>]) {
    let mut of_series: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for numbers in repeated.iter() {
        let middle = median(&mut numbers.iter().map(|n| n.beyond).collect::<Vec<f64>>()).unwrap_or(0.0);
        for n in numbers {
            of_series.entry(n.series).or_default().push(n.beyond - middle);
        }
    }
    let zeros: BTreeMap<usize, f64> = (of_series.into_iter())
        .filter_map(|(series, mut d)| if d.len() > 2 { median(&mut d).map(|zero| (series, zero)) } else { None })
        .collect();
    for n in repeated.iter_mut().flatten() {
        n.beyond -= zeros.get(&n.series).copied().unwrap_or(0.0);
    }
}

/// Standard deviation of one number, from its repeats, by medians. Two series differ by their zeros as well, and zeros that were taken out
/// by the middle number of a few leave that one none: what their numbers differ by is held against what the next ones do.
fn scatter(repeated: &[Vec<Number>]) -> f64 {
    let mut of_series: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
    for [a, b] in repeated.iter().flat_map(|numbers| numbers.array_windows()) {
        of_series.entry((a.series, b.series)).or_default().push(b.beyond - a.beyond);
    }
    let sizes = |differences: Vec<f64>| match differences.as_slice() {
        [single] => vec![single.abs() / 2.0_f64.sqrt()],
        all => all.windows(2).map(|d| 0.5 * (d[1] - d[0]).abs()).collect(),
    };
    let mut all: Vec<f64> = of_series.into_values().flat_map(sizes).collect();
    median(&mut all).map_or(0.0, deviation_by_median)
}

/// Of repeats, those that differ from the others by more than noise: reading and deviation.
fn among_repeats(mut repeated: Vec<Vec<Number>>, least: f64, rules: &Rules) -> Vec<(usize, f64)> {
    let freedom: usize = repeated.iter().map(|numbers| numbers.len() - 1).sum();
    if (freedom as f64) < rules.min_dof_of_gross {
        return Vec::new();
    }
    without_zeros(&mut repeated);
    let scale = scatter(&repeated).max(least);
    let mut found = Vec::new();
    for mut numbers in repeated {
        numbers.sort_by(|a, b| a.beyond.total_cmp(&b.beyond));
        while numbers.len() > 1 {
            let last = numbers.len() - 1;
            // from the middle of the others, in deviations of one number
            let deviation = |at: usize| {
                let others = if at == 0 { &numbers[1..] } else { &numbers[..last] };
                let middle = 0.5 * (others[(last - 1) / 2].beyond + others[last / 2].beyond);
                (numbers[at].beyond - middle).abs() / (1.0 + 1.0 / last as f64).sqrt()
            };
            // the least or the greatest is farthest from the others; of two that differ the one is wrong that is farther from the model
            let rank = |at: &usize| if last == 1 { numbers[*at].beyond.abs() } else { deviation(*at) };
            let Some(at) = [0, last].into_iter().max_by(|a, b| rank(a).total_cmp(&rank(b))) else { break };
            let size = deviation(at) / scale.hypot(numbers[at].drawn);
            // of numbers that are equal to the last digit there is no size
            if !(size > rules.outlier_sd) {
                break;
            }
            found.push((numbers.remove(at).reading, size));
        }
    }
    found
}

/// Numbers without repeats that are far out of what the declared model leaves of all of these.
fn far_out(single: Vec<Vec<Number>>, least: f64, rules: &Rules) -> Vec<(usize, f64)> {
    let mut sizes: Vec<f64> = single.iter().flatten().map(|n| n.beyond.abs()).collect();
    let scale = median(&mut sizes).map_or(0.0, deviation_by_median).max(least);
    let numbers = single.into_iter().flatten().map(|n| (n.reading, n.beyond.abs() / scale.hypot(n.drawn)));
    numbers.filter(|(_, size)| *size > rules.far_out_sd).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observations::{Channel, Reading};

    /// Repeats of normal noise 1 in series of so many readings with zeros of their own, some numbers changed, each said to draw another
    /// error.
    fn read_of(seed: u64, length: usize, repeats: usize, changed: &[(usize, f64)], drawn: f64) -> Observations {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut normal = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        let zeros: Vec<f64> = (0..repeats * 60 / length).map(|_| 20.0 * normal()).collect();
        let mut readings = Vec::new();
        for condition in 0..60 {
            for repeat in 0..repeats {
                let (n, series) = (readings.len(), condition / length * repeats + repeat);
                let more: f64 = changed.iter().filter(|c| c.0 == n).map(|c| c.1).sum();
                let observed = vec![Some(100.0 + condition as f64 + zeros[series] + normal() + more)];
                readings.push(Reading {
                    condition,
                    repeat_of: condition,
                    series,
                    observed,
                    sigma: vec![None],
                    covariance: None,
                    drawn: vec![drawn],
                });
            }
        }
        Observations { channels: vec![Channel { kind: 0, resolution: 0.01 }], pose_of: vec![0; 60], readings }
    }

    fn read_drawn(repeats: usize, changed: &[(usize, f64)], drawn: f64) -> Observations {
        read_of(7, 60, repeats, changed, drawn)
    }

    fn read(repeats: usize, changed: &[(usize, f64)]) -> Observations {
        read_drawn(repeats, changed, 0.0)
    }

    fn found(observations: &Observations) -> Vec<usize> {
        let expected: Vec<f64> = (0..60).map(|c| 95.0 + f64::from(c)).collect();
        gross(observations, &expected, &Rules::DEFAULT).iter().map(|o| o.reading).collect()
    }

    #[test]
    fn a_gross_error_among_repeats_is_found_and_nothing_else() {
        assert_eq!(found(&read(2, &[])), [0; 0]);
        assert_eq!(found(&read(3, &[(17, 30.0)])), [17]);
        assert_eq!(found(&read(3, &[(17, -9999.0)])), [17]);
        assert_eq!(found(&read(2, &[(40, 9999.0)])), [40]);
        // far more than single ones: noise of another kind
        let many: Vec<(usize, f64)> = (0..12).map(|i| (5 * i, 40.0)).collect();
        assert_eq!(found(&read(2, &many)), [0; 0]);
    }

    /// Of 120 numbers five are ten times as large as they are, and one stands out a little; a day's work is not that bad.
    #[test]
    fn slips_of_a_digit_are_found_among_a_few_repeats() {
        let slips: Vec<(usize, f64)> = (0..5).map(|i| (21 * i, 1000.0)).collect();
        let expected: Vec<usize> = slips.iter().map(|s| s.0).collect();
        assert_eq!(found(&read(2, &slips)), expected);
        let more: Vec<(usize, f64)> = slips.iter().copied().chain([(58, 30.0)]).collect();
        assert_eq!(found(&read(2, &more)), [0, 21, 42, 58, 63, 84]);
        let many: Vec<(usize, f64)> = (0..12).map(|i| (9 * i, 1000.0)).collect();
        assert_eq!(found(&read(2, &many)), [0; 0]);
    }

    #[test]
    fn zeros_of_short_series_do_not_pass_for_small_noise() {
        for (seed, repeats) in (0..20).flat_map(|seed| [(seed, 2), (seed, 3)]) {
            assert_eq!(found(&read_of(seed, 3, repeats, &[], 0.0)), [0; 0], "seed {seed}, {repeats} repeats");
            assert_eq!(found(&read_of(seed, 3, repeats, &[(17, 300.0)], 0.0)), [17], "seed {seed}, {repeats} repeats");
        }
    }

    /// Ten pairs that were typed twice, beside a thousand numbers without repeats.
    #[test]
    fn numbers_that_are_equal_to_the_last_digit_are_no_gross_ones() {
        let mut equal = read(1, &[]);
        let number =
            |n: usize| Reading { condition: n % 1000, repeat_of: n % 1000, ..equal.readings[n % 1000 % 60].clone() };
        equal.readings = (0..1010).map(number).collect();
        equal.pose_of = vec![0; 1000];
        equal.channels[0].resolution = 0.0;
        let expected: Vec<f64> = (0..1000).map(|c| 95.0 + f64::from(c % 60)).collect();
        assert!(gross(&equal, &expected, &Rules::DEFAULT).is_empty());
    }

    #[test]
    fn an_error_that_each_reading_draws_is_no_gross_one() {
        let changed = [(17, 30.0)];
        assert_eq!(found(&read_drawn(3, &changed, 15.0)), [0; 0]);
        assert_eq!(found(&read_drawn(3, &changed, 2.0)), [17]);
        assert_eq!(found(&read_drawn(1, &[(17, 9999.0)], 15.0)), [17]);
    }

    #[test]
    fn a_number_without_repeats_must_be_far_out() {
        assert_eq!(found(&read(1, &[(17, 60.0)])), [0; 0]);
        assert_eq!(found(&read(1, &[(17, 9999.0)])), [17]);
    }
}

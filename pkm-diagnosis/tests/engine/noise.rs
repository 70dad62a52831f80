//! Noise and whitening against textbook analysis of variance and dense covariance matrices.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::{Covariance, Entry, Noise, NoiseSource, Observations, Reading, Rules, UnknownNoise, Whitener};

use crate::support::*;

/// Projector that removes the columns of `of`.
fn without(of: &DMatrix<f64>) -> DMatrix<f64> {
    let inverse = of.clone().pseudo_inverse(1e-9).unwrap();
    DMatrix::identity(of.nrows(), of.nrows()) - of * inverse
}

/// Within, its degrees of freedom, total, its degrees of freedom, weight of t² of one channel by linear algebra on the repeated readings.
fn variance_analysis(readings: &Observations, channel: usize) -> [f64; 5] {
    let rows: Vec<&Reading> = readings.readings.iter().filter(|r| r.observed[channel].is_some()).collect();
    let repeats = |g: usize| rows.iter().filter(|r| r.repeat_of == g).count();
    let rows: Vec<&&Reading> = rows.iter().filter(|r| repeats(r.repeat_of) > 1).collect();
    if rows.is_empty() {
        return [0.0; 5];
    }
    let y = DVector::from_fn(rows.len(), |i, _| rows[i].observed[channel].unwrap());
    let of =
        |key: fn(&Reading) -> usize| DMatrix::from_fn(rows.len(), 20, |i, k| f64::from(u8::from(key(rows[i]) == k)));
    let (groups, series) = (of(|r| r.repeat_of), of(|r| r.series));
    let mut both = DMatrix::zeros(rows.len(), 40);
    both.columns_mut(0, 20).copy_from(&groups);
    both.columns_mut(20, 20).copy_from(&series);
    let (by_group, by_both) = (without(&groups), without(&both));
    let weight = (series.transpose() * &by_group * series).trace();
    [(&by_both * &y).norm_squared(), by_both.trace(), (&by_group * &y).norm_squared(), by_group.trace(), weight]
}

/// 5 % quantiles of χ² with 1 to 9 degrees of freedom, as printed in tables.
const CHI2_5_PERCENT: [f64; 9] =
    [0.003_932_14, 0.102_587, 0.351_846, 0.710_723, 1.145_476, 1.635_383, 2.167_35, 2.732_637, 3.325_113];

/// Deviations of a reading, so that 1/variance is right on average, and of a zero, which is no less than the 95 % bound of few.
fn deviations(reading: [f64; 5], zero: [f64; 5]) -> (f64, f64) {
    let variance = |sum: f64, n: f64| if n > 4.5 { sum / (n - 2.0) } else { sum / n };
    let of_reading = |[within, within_dof, total, total_dof, _]: [f64; 5]| {
        if within_dof < 0.5 { variance(total, total_dof) } else { variance(within, within_dof) }
    };
    let [within, within_dof, total, total_dof, weight] = zero;
    let more = total_dof - within_dof;
    let t2 = if within_dof < 0.5 || more < 0.5 {
        0.0
    } else {
        let sum = total - within;
        let bound = CHI2_5_PERCENT.get(more.round() as usize - 1);
        (bound.map_or_else(|| variance(sum, more), |quantile| sum / quantile) - of_reading(zero)) * more / weight
    };
    (of_reading(reading).sqrt(), t2.max(0.0).sqrt())
}

/// Series and condition of each reading, each in all channels but where `blank` says so.
fn scattered(layout: &[(usize, usize)], rng: &mut fastrand::Rng, blank: impl Fn(usize, usize) -> bool) -> Observations {
    let zeros: Vec<[f64; CHANNELS]> = (0..20).map(|_| std::array::from_fn(|_| 2.0 * micro(rng))).collect();
    let read = |(n, (series, at)): (usize, &(usize, usize))| {
        let observed = std::array::from_fn(|c| {
            let value = 20e-6 * *at as f64 + zeros[*series][c] + micro(rng);
            (!blank(n, c)).then_some(value)
        });
        reading(*at, *series, observed)
    };
    let rows = layout.iter().enumerate().map(read).collect();
    observations((0..20).map(|n| n % 3).collect(), rows)
}

#[test]
fn noise_is_that_of_an_analysis_of_variance() {
    let mut rng = fastrand::Rng::with_seed(1);
    let pair = |a: usize, b: usize, at: usize| [(a, at), (b, at)];
    let mut layouts: Vec<Vec<(usize, usize)>> = vec![
        // one freedom within, two components
        [pair(0, 1, 0), pair(0, 1, 1), pair(2, 3, 2)].concat(),
        // one between
        vec![(0, 0), (0, 0), (0, 0), (1, 0), (1, 0)],
        // one series; every reading its own
        vec![(0, 0), (0, 0), (0, 0), (0, 1), (0, 1), (0, 1)],
        vec![(0, 0), (1, 0), (2, 0), (3, 1), (4, 1), (5, 2), (6, 3), (7, 3)],
    ];
    for n in 0..14 {
        layouts.push((0..6 + 2 * n).map(|_| (rng.usize(..3 + n / 4), rng.usize(..2 + n / 4))).collect());
    }
    let mut seen = [false; 3];
    for (n, layout) in layouts.iter().enumerate() {
        // one channel alone, or some with blanks
        let blank = |row: usize, c: usize| if n % 3 == 0 || n == 1 { c != 1 } else { c > 3 || (row + c) % 7 == 3 };
        let file = scattered(layout, &mut rng, blank);
        let parts: Vec<[f64; 5]> = (0..CHANNELS).map(|c| variance_analysis(&file, c)).collect();
        let pooled = |kind: usize| std::array::from_fn(|k| parts[3 * kind..3 * kind + 3].iter().map(|p| p[k]).sum());
        let pools: [[f64; 5]; 2] = [pooled(0), pooled(1)];
        let channels = file.used_channels();
        if (0..CHANNELS).any(|c| channels[c] && pools[c / 3][3] < 2.5) {
            assert!(Noise::estimate(&file, &Rules::DEFAULT).is_err());
            continue;
        }
        let noise = Noise::estimate(&file, &Rules::DEFAULT).unwrap();
        assert_eq!(noise.source, NoiseSource::Repeats);
        near(noise.dof, parts.iter().map(|p| p[3]).sum(), 1e-9);
        for c in (0..CHANNELS).filter(|c| channels[*c]) {
            let [own, zeros] = [parts[c][3], parts[c][3] - parts[c][1]].map(|dof| dof > 19.5);
            let of = |own: bool| if own { parts[c] } else { pools[c / 3] };
            let (s, t) = deviations(of(own), of(zeros));
            near(noise.within[c], s, 1e-5);
            near(noise.between[c], t, 1e-4);
            seen = [seen[0] | own, seen[1] | !own, seen[2] | (t > 0.0)];
        }
    }
    assert_eq!(seen, [true; 3]);
}

#[test]
fn simulated_noise_is_found() {
    let mut rng = fastrand::Rng::with_seed(2);
    let layout: Vec<(usize, usize)> = (0..10).flat_map(|series| (0..4).map(move |at| (series, at))).collect();
    let (mut information, mut between) = (0.0, 0.0);
    for _ in 0..60 {
        let noise = Noise::estimate(&scattered(&layout, &mut rng, |_, c| c == 3), &Rules::DEFAULT).unwrap();
        information += noise.within.iter().filter(|s| **s > 0.0).map(|s| 1e-12 / (s * s)).sum::<f64>() / 300.0;
        between += noise.between.iter().map(|t| t * t * 1e12).sum::<f64>() / 300.0;
    }
    // 27 degrees of freedom of a channel, and 27 and 18 of the zeros of a kind: what a variance gains by two less is known
    near(information, 1.0, 0.04);
    let gained = (3.0 * 27.0 / 25.0 + 2.0 * 18.0 / 16.0) / 5.0;
    near(between, ((1.0 + 4.0 * 4.0) * gained - 1.0) / 4.0, 0.12);
}

#[test]
fn zeros_of_series_that_repeat_nothing_follow_from_opposite_loads() {
    // ten series at a pose each, six loads read twice, all that is read proportional to the load but noise and a zero of 2 µm
    let loads = |sizes: &[f64; 6]| -> Vec<[f64; 6]> {
        (0..6).map(|n| std::array::from_fn(|i| if i == n / 2 { sizes[n] } else { 0.0 })).collect()
    };
    let simulated = |rng: &mut fastrand::Rng, sizes: &[f64; 6]| {
        let (mut rows, mut numbers) = (Vec::new(), Vec::new());
        for series in 0..10 {
            let zeros: [f64; CHANNELS] = std::array::from_fn(|_| 2.0 * micro(rng));
            let gains: [[f64; 6]; CHANNELS] = std::array::from_fn(|_| std::array::from_fn(|_| 1e-7 * normal(rng)));
            for (n, load) in [loads(sizes), loads(sizes)].concat().into_iter().enumerate() {
                let linear = |c: usize| gains[c].iter().zip(load).map(|(g, l)| g * l).sum::<f64>();
                let observed = std::array::from_fn(|c| Some(linear(c) + zeros[c] + micro(rng)));
                rows.push(reading(6 * series + n % 6, series, observed));
                numbers.push((series, load.to_vec()));
            }
        }
        (observations((0..60).map(|condition| condition / 6).collect(), rows), numbers)
    };
    let mut rng = fastrand::Rng::with_seed(12);
    let (mut mean_square, turning) = (0.0, [100.0, -100.0, 200.0, -200.0, 100.0, -300.0]);
    for _ in 0..40 {
        let (file, numbers) = simulated(&mut rng, &turning);
        let by_repeats = Noise::estimate(&file, &Rules::DEFAULT).unwrap();
        assert!(by_repeats.is_zero_open == [true; CHANNELS] && by_repeats.between == [0.0; CHANNELS]);
        let noise = by_repeats.clone().with_zeros(&file, &numbers, &Rules::DEFAULT);
        assert!(noise.is_zero_open == [false; CHANNELS] && noise.within == by_repeats.within);
        mean_square += noise.between.iter().map(|t| t * t * 1e12).sum::<f64>() / 240.0;
    }
    // thirty zeros of a kind, of whose squares two more than their number are taken
    near(mean_square, 4.0 * 30.0 / 28.0, 0.25);
    // where no load turns and none comes in two sizes the zero and what yields are one
    let (file, numbers) = simulated(&mut rng, &[100.0, 100.0, 200.0, 200.0, 100.0, 100.0]);
    let noise = Noise::estimate(&file, &Rules::DEFAULT).unwrap().with_zeros(&file, &numbers, &Rules::DEFAULT);
    assert!(noise.is_zero_open == [true; CHANNELS] && noise.between == [0.0; CHANNELS]);
    // what repeats tell stays
    let mut file = file;
    file.readings.iter_mut().enumerate().for_each(|(n, r)| r.series = 2 * r.series + n / 6 % 2);
    let by_repeats = Noise::estimate(&file, &Rules::DEFAULT).unwrap();
    let noise = by_repeats.clone().with_zeros(&file, &numbers, &Rules::DEFAULT);
    assert_eq!(noise.between, by_repeats.between);
}

#[test]
fn noise_may_be_declared_and_must_be_known() {
    let layout = [(0, 0), (1, 1), (2, 2)];
    let sigma = |file: &mut Observations, linear: [Option<f64>; 3]| {
        for (r, linear) in file.readings.iter_mut().zip(linear) {
            r.sigma = vec![linear, Some(2e-6)];
        }
    };
    let mut file = scattered(&layout, &mut fastrand::Rng::with_seed(3), |row, c| c == 5 || (row == 1 && c == 0));
    [2, 4].iter().for_each(|c| file.channels[*c].resolution = 12e-6);
    // the one that is not declared is blank in one channel alone
    sigma(&mut file, [Some(3e-6), None, Some(4e-6)]);
    assert_eq!(Noise::estimate(&file, &Rules::DEFAULT).unwrap_err(), UnknownNoise { channel: 1 });
    sigma(&mut file, [Some(1e-6), Some(2e-6), Some(2e-6)]);
    let noise = Noise::estimate(&file, &Rules::DEFAULT).unwrap();
    assert_eq!((noise.source, noise.dof, noise.between), (NoiseSource::Declared, 0.0, vec![0.0; CHANNELS]));
    // root mean squares, or the rounding of the file
    let rounding = 12e-6 / 12.0_f64.sqrt();
    let truth = [2.5_f64.sqrt() * 1e-6, 3.0_f64.sqrt() * 1e-6, rounding, 2e-6, rounding, 0.0];
    noise.within.iter().zip(truth).for_each(|(found, truth)| near(*found, truth, 1e-12));

    // repeats: 39 degrees of freedom a kind are too few beside declared deviations, 42 are enough, and rounding counts
    let repeats = |n: usize| {
        let layout: Vec<(usize, usize)> = (0..n).map(|_| (0, 0)).collect();
        let mut file = scattered(&layout, &mut fastrand::Rng::with_seed(4), |_, _| false);
        file.readings.iter_mut().for_each(|r| r.sigma = vec![Some(1e-6); 2]);
        file.channels[1].resolution = 12e-6;
        Noise::estimate(&file, &Rules::DEFAULT).unwrap()
    };
    assert_eq!(repeats(14).source, NoiseSource::Declared);
    let noise = repeats(15);
    assert_eq!(noise.source, NoiseSource::Repeats);
    assert!(noise.within[0] < 2e-6);
    near(noise.within[1], rounding, 1e-12);
}

/// Readings with all that whitening takes into account: series that are alike, repeats within a series, blanks, roughness of the
/// file.
pub fn varied(rng: &mut fastrand::Rng) -> Observations {
    let layout =
        [(0, 0), (1, 0), (0, 1), (1, 0), (0, 0), (1, 1), (2, 1), (2, 2), (3, 0), (5, 0), (2, 1), (4, 3), (4, 3)];
    let mut file = scattered(&layout, rng, |row, c| (row + 2 * c) % 9 == 5);
    file.channels[2].resolution = 3e-6;
    for r in &mut file.readings {
        let some = [0.5e-6, 0.5e-6, 1e-6, 2e-6];
        r.sigma = vec![Some(some[rng.usize(..4)]), Some(some[rng.usize(..4)])];
    }
    file
}

/// Scalar observations, as reading and channel, and their covariance.
pub fn covariance(file: &Observations, noise: &Noise) -> (Vec<(usize, usize)>, DMatrix<f64>) {
    let rows: Vec<(usize, usize)> = (0..file.readings.len())
        .flat_map(|r| (0..CHANNELS).map(move |c| (r, c)))
        .filter(|(r, c)| file.readings[*r].observed[*c].is_some())
        .collect();
    let variance = |r: usize, c: usize| match noise.source {
        NoiseSource::Repeats => noise.within[c].powi(2),
        NoiseSource::Declared => {
            file.readings[r].sigma[c / 3].unwrap().powi(2).max(file.channels[c].resolution.powi(2) / 12.0)
        }
    };
    let c = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        let ((a, channel), (b, other)) = (rows[i], rows[j]);
        let shared = channel == other && file.readings[a].series == file.readings[b].series;
        f64::from(u8::from(i == j)) * variance(a, channel)
            + f64::from(u8::from(shared)) * noise.between[channel].powi(2)
    });
    (rows, c)
}

/// Noise of both kinds, in one channel without zero errors.
pub fn noises() -> [Noise; 2] {
    let within = [1e-6, 1.5e-6, 1e-6, 2e-6, 1e-6, 3e-6];
    let noise = |source, between: [f64; CHANNELS]| Noise {
        source,
        within: within.to_vec(),
        unrounded: within.to_vec(),
        between: between.to_vec(),
        dof: 0.0,
        declared_share: if source == NoiseSource::Declared { [1.0; 2] } else { [0.8, 0.5] },
        is_zero_open: vec![false; CHANNELS],
    };
    [noise(NoiseSource::Repeats, [2e-6, 0.5e-6, 0.0, 1e-6, 5e-6, 2e-6]), noise(NoiseSource::Declared, [0.0; CHANNELS])]
}

#[test]
fn whitening_is_the_inverse_of_the_covariance() {
    let mut rng = fastrand::Rng::with_seed(5);
    for noise in noises() {
        let file = varied(&mut rng);
        let (rows, c) = covariance(&file, &noise);
        let averaged = Whitener::new(&file, &noise);
        let single = Whitener::by_reading(&file, &noise);
        assert_eq!((single.averaged, single.entries.len()), (0.0, rows.len()));
        assert!(averaged.entries.len() < rows.len());
        for _ in 0..3 {
            let said: Vec<[f64; CHANNELS]> = (0..20).map(|_| std::array::from_fn(|_| 5.0 * micro(&mut rng))).collect();
            let error =
                |r: usize, c: usize| file.readings[r].observed[c].unwrap() - said[file.readings[r].condition][c];
            let r = DVector::from_fn(rows.len(), |i, _| error(rows[i].0, rows[i].1));
            for whitener in [&averaged, &single] {
                let mean =
                    |e: &Entry| e.readings.iter().map(|r| error(*r, e.channel)).sum::<f64>() / e.readings.len() as f64;
                let mut z: Vec<f64> = whitener.entries.iter().map(mean).collect();
                whitener.whiten(&mut z);
                near(z.iter().map(|z| z * z).sum::<f64>() + whitener.averaged, quadratic(&c, &r), 1e-8);
            }
        }
        // errors of loads, in groups that share nothing; four directions in one or two entries, and a column of nothing
        let n = averaged.entries.len();
        let parts =
            [(0..n).filter(|i| i % 2 == 0).collect(), vec![1], (0..n).filter(|i| i % 2 == 1 && *i > 1).collect()];
        let groups: Vec<(Vec<usize>, DMatrix<f64>)> = (parts.into_iter())
            .map(|entries: Vec<usize>| {
                let u = DMatrix::from_fn(entries.len(), 4, |_, k| if k == 2 { 0.0 } else { normal(&mut rng) });
                (entries, u)
            })
            .collect();
        let scale = [0.5, 2.0, 1.0, 0.3];
        let loaded = averaged.with_common_errors(&groups, &scale);
        let mut u = DMatrix::zeros(n, 12);
        for (g, (entries, own)) in groups.iter().enumerate() {
            for (row, entry) in entries.iter().enumerate() {
                (0..4).for_each(|k| u[(*entry, 4 * g + k)] = scale[k] * own[(row, k)]);
            }
        }
        let full = DMatrix::identity(n, n) + &u * u.transpose();
        near(loaded.log_determinant, full.determinant().ln(), 1e-9);
        near(loaded.averaged, averaged.averaged, 0.0);
        let mut z: Vec<f64> = (0..n).map(|_| micro(&mut rng)).collect();
        let mut all = z.clone();
        averaged.whiten(&mut z);
        loaded.whiten(&mut all);
        near(all.iter().map(|z| z * z).sum(), quadratic(&full, &DVector::from_vec(z.clone())), 1e-9);
        loaded.shrink(&mut z);
        assert_eq!(z, all);
    }
}

/// Standard deviations by channel and correlations of a motion that follows from a few points, some of them far away.
fn motion(rng: &mut fastrand::Rng) -> (Vec<f64>, DMatrix<f64>) {
    let points: Vec<[f64; 3]> = (0..4).map(|_| std::array::from_fn(|i| 0.2 * i as f64 + 0.1 * normal(rng))).collect();
    let mut information = DMatrix::zeros(CHANNELS, CHANNELS);
    for [x, y, z] in points {
        let rows = [[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]];
        let rows = DMatrix::from_fn(3, CHANNELS, |i, j| rows[i][j]);
        information += rows.transpose() * rows;
    }
    let c = information.try_inverse().unwrap() * 25e-12;
    let sd: Vec<f64> = (0..CHANNELS).map(|i| c[(i, i)].sqrt()).collect();
    let correlation = |i: usize, j: usize| if i == j { 1.0 } else { 0.5 * (c[(i, j)] + c[(j, i)]) / (sd[i] * sd[j]) };
    (sd.clone(), DMatrix::from_fn(CHANNELS, CHANNELS, correlation))
}

/// Noise within series, zeros, and an error that every reading draws, in a dense matrix.
#[test]
fn whitening_of_errors_that_go_through_channels_is_the_inverse_of_their_covariance() {
    const ZERO_SHARE: f64 = 0.3;
    let mut rng = fastrand::Rng::with_seed(11);
    for (noise, with_covariance, with_drawn) in
        noises().into_iter().flat_map(|n| [(n.clone(), true, false), (n.clone(), false, true), (n, true, true)])
    {
        let (sd, correlation) = motion(&mut rng);
        assert!(correlation[(0, 4)].abs() > 0.5, "{correlation}");
        let mut file = varied(&mut rng);
        file.channels.iter_mut().for_each(|c| c.resolution = 1e-9);
        for r in &mut file.readings {
            if with_covariance {
                r.covariance = Covariance::new(&sd, correlation.clone(), ZERO_SHARE).map(Arc::new);
            }
            // one series without
            if with_drawn && r.series != 2 {
                r.drawn = (0..CHANNELS).map(|_| 3.0 * micro(&mut rng)).collect();
            }
        }
        let is_declared = noise.source == NoiseSource::Declared;
        let rows: Vec<(usize, usize)> = covariance(&file, &noise).0;
        let c = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let ((a, channel), (b, other)) = (rows[i], rows[j]);
            let (reading, o) = (&file.readings[a], &file.readings[b]);
            let deviations = |c: usize| match (is_declared, with_covariance) {
                (true, true) => (sd[c] * (1.0 - ZERO_SHARE).sqrt(), sd[c] * ZERO_SHARE.sqrt()),
                (true, false) => (reading.sigma[c / 3].unwrap(), 0.0),
                // no less than what is declared
                (false, true) => (
                    noise.within[c].max(0.8 * sd[c] * (1.0 - ZERO_SHARE).sqrt()),
                    noise.between[c].max(0.5 * sd[c] * ZERO_SHARE.sqrt()),
                ),
                (false, false) => (noise.within[c], noise.between[c]),
            };
            let together =
                if with_covariance { correlation[(channel, other)] } else { f64::from(u8::from(channel == other)) };
            let ((s, t), (other_s, other_t)) = (deviations(channel), deviations(other));
            // what scatters beyond the declared errors goes by itself
            let joint = |share: f64, shown: f64, s: f64, other_s: f64| {
                let known = share * shown * shown * sd[channel] * sd[other];
                if channel == other { s * other_s } else { together * known }
            };
            let shown = if is_declared { [1.0; 2] } else { [0.8, 0.5] };
            let own = if a == b { joint(1.0 - ZERO_SHARE, shown[0], s, other_s) } else { 0.0 };
            let zero = if reading.series == o.series { joint(ZERO_SHARE, shown[1], t, other_t) } else { 0.0 };
            let is_drawn = a == b && !reading.drawn.is_empty();
            own + zero + if is_drawn { reading.drawn[channel] * reading.drawn[other] } else { 0.0 }
        });
        let whitener = Whitener::new(&file, &noise);
        assert_eq!(whitener.entries.len() < rows.len(), !with_covariance, "the series without is averaged");
        let variance = |n: usize| noise.variance_of(&file, rows[n].0, rows[n].1);
        (0..rows.len()).for_each(|n| near(variance(n), c[(n, n)], 1e-12));
        for whitener in [whitener, Whitener::by_reading(&file, &noise)] {
            let error = |r: usize, c: usize| file.readings[r].observed[c].unwrap();
            let mean =
                |e: &Entry| e.readings.iter().map(|r| error(*r, e.channel)).sum::<f64>() / e.readings.len() as f64;
            let mut z: Vec<f64> = whitener.entries.iter().map(mean).collect();
            whitener.whiten(&mut z);
            let r = DVector::from_fn(rows.len(), |i, _| error(rows[i].0, rows[i].1));
            near(z.iter().map(|z| z * z).sum::<f64>() + whitener.averaged, quadratic(&c, &r), 1e-8);
        }
    }
}

#[test]
fn a_covariance_is_positive_definite() {
    let (sd, correlation) = motion(&mut fastrand::Rng::with_seed(12));
    assert!(Covariance::new(&sd, correlation.clone(), 0.5).is_some());
    let changed = |change: &dyn Fn(&mut Vec<f64>, &mut DMatrix<f64>)| {
        let (mut sd, mut correlation) = (sd.clone(), correlation.clone());
        change(&mut sd, &mut correlation);
        Covariance::new(&sd, correlation, 0.5)
    };
    assert_eq!(changed(&|sd, _| sd[2] = 0.0), None);
    assert_eq!(changed(&|_, c| c[(1, 2)] += 1e-3), None, "no symmetry");
    assert_eq!(changed(&|_, c| (0..6).for_each(|i| c[(i, i)] = 2.0)), None);
    // 1 goes with 0 and with 2, which goes against 0
    let impossible = [(0, 1, 0.99), (1, 2, 0.99), (0, 2, -0.99)];
    let set = |c: &mut DMatrix<f64>| impossible.iter().for_each(|(i, j, r)| (c[(*i, *j)], c[(*j, *i)]) = (*r, *r));
    assert_eq!(changed(&|_, c| set(c)), None);
    assert_eq!(Covariance::new(&sd, correlation.clone(), 1.0), None);
    assert_eq!(Covariance::new(&sd, correlation, -0.1), None);
}

/// Loads drawn anew with each reading, of sizes from 0 to ten times the noise: the noise is told from them.
#[test]
fn noise_is_told_from_what_each_reading_draws() {
    let mut rng = fastrand::Rng::with_seed(13);
    let layout: Vec<(usize, usize)> = (0..20).flat_map(|series| (0..6).map(move |at| (series, at))).collect();
    let (mut within, mut between, mut blind) = (0.0, 0.0, 0.0);
    for _ in 0..40 {
        let mut file = scattered(&layout, &mut rng, |_, c| c > 0);
        for r in &mut file.readings {
            let drawn = 2e-6 * r.condition as f64;
            r.observed[0] = r.observed[0].map(|v| v + drawn * normal(&mut rng));
            r.drawn = vec![drawn, 0.0, 0.0, 0.0, 0.0, 0.0];
        }
        let noise = Noise::estimate(&file, &Rules::DEFAULT).unwrap();
        within += noise.within[0].powi(2) * 1e12 / 40.0;
        between += noise.between[0].powi(2) * 1e12 / 40.0;
        file.readings.iter_mut().for_each(|r| r.drawn.clear());
        blind += Noise::estimate(&file, &Rules::DEFAULT).unwrap().within[0].powi(2) * 1e12 / 40.0;
    }
    // truth: 1 and 4; without knowing of what was drawn: the mean of its squares more, 36.7
    assert!(
        (0.6..1.6).contains(&within) && (2.5..6.5).contains(&between) && blind > 20.0,
        "{within} {between} {blind}"
    );
}

/// Nothing says what the zeros of the series are but the covariances.
#[test]
fn a_zero_that_no_repeats_show_is_as_large_as_declared() {
    let mut rng = fastrand::Rng::with_seed(14);
    let layout: Vec<(usize, usize)> = (0..20).flat_map(|series| (0..4).map(move |_| (series, series))).collect();
    let mut file = scattered(&layout, &mut rng, |_, _| false);
    let (sd, correlation) = motion(&mut rng);
    let covariance = Arc::new(Covariance::new(&sd, correlation, 0.2).unwrap());
    file.readings.iter_mut().for_each(|r| r.covariance = Some(covariance.clone()));
    let noise = Noise::estimate(&file, &Rules::DEFAULT).unwrap();
    assert_eq!(noise.source, NoiseSource::Repeats);
    (0..CHANNELS).for_each(|c| near(noise.between[c], 0.5 * noise.within[c], 1e-12));
}

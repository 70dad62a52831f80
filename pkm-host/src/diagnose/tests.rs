//! The statistics against what they are by definition: dense covariance matrices, textbook analysis of variance, models that are
//! really fitted without a reading, simulation.

use nalgebra::{DMatrix, DVector};
use pkm_core::Wrench;

use super::compare::{self, Errors, Fitted, Rival, Zone};
use super::model::{COUNT, Declared, Model, Part, Unknown, info};
use super::noise::{Noise, NoiseSource, Whitener};
use super::screen::{self, Columns};
use super::search::Search;
use super::solve::{self, Fit, Levels, Problem};
use crate::files::machine::{MachineFile, Uncertainty};
use crate::files::readings::{CHANNELS, Condition, REFERENCE_C, Reading, Readings};
use crate::files::source::Source;
use crate::pose::{NamedPose, pose_of};

/// Poses in ° and mm, the corners of a box first.
const POSES: [[f64; 3]; 7] = [
    [-10.0, -8.0, 510.0],
    [12.0, 9.0, 550.0],
    [3.0, -7.0, 520.0],
    [-6.0, 5.0, 530.0],
    [8.0, 2.0, 515.0],
    [-2.0, -4.0, 545.0],
    [5.0, 6.0, 525.0],
];

fn condition(pose: usize, wrench: [f64; 6]) -> Condition {
    Condition {
        pose,
        wrench: Wrench::from_array(wrench),
        point_m: [0.0; 3],
        turned_at: Wrench::ZERO,
        temperature_c: REFERENCE_C,
        rise_k: 0.0,
    }
}

fn reading(condition: usize, series: usize, observed: [Option<f64>; CHANNELS]) -> Reading {
    Reading { line: 1, condition, repeat_of: condition, series, observed, sigma: [None; 2] }
}

fn readings(conditions: Vec<Condition>, readings: Vec<Reading>) -> Readings {
    let used = conditions.iter().map(|c| c.pose + 1).max().unwrap_or(0);
    let named =
        |[theta, sigma, z0]: &[f64; 3]| NamedPose { id: String::new(), line: 1, pose: pose_of(*theta, *sigma, *z0) };
    Readings {
        source: Source::from_text("readings.csv", String::new()),
        poses: (0..used).map(|n| named(&POSES[n % POSES.len()])).collect(),
        conditions,
        readings,
        series_names: Vec::new(),
        resolution: [1e-9; CHANNELS],
        has_temperature: false,
        has_unloading: false,
        warnings: Vec::new(),
    }
}

fn normal(rng: &mut fastrand::Rng) -> f64 {
    // twelve uniform numbers: near enough, and not what the screen does
    (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
}

fn micro(rng: &mut fastrand::Rng) -> f64 {
    1e-6 * normal(rng)
}

fn near(found: f64, truth: f64, tolerance: f64) {
    assert!((found - truth).abs() <= tolerance * truth.abs().max(1e-9), "{found} instead of {truth}");
}

/// rᵀ C⁻¹ r
fn quadratic(c: &DMatrix<f64>, r: &DVector<f64>) -> f64 {
    r.dot(&c.clone().lu().solve(r).unwrap())
}

/// What is left of columns when those of `of` are projected out, as the projector.
fn without(of: &DMatrix<f64>) -> DMatrix<f64> {
    let inverse = of.clone().pseudo_inverse(1e-9).unwrap();
    DMatrix::identity(of.nrows(), of.nrows()) - of * inverse
}

/// Within, its freedoms, total, its freedoms, weight of t² of one channel by linear algebra on the repeated readings.
fn variance_analysis(readings: &Readings, channel: usize) -> [f64; 5] {
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

/// Variances of a reading and of a zero, so that 1/variance is right on average.
fn deviations([within, within_freedom, total, total_freedom, weight]: [f64; 5]) -> (f64, f64) {
    let variance = |sum: f64, n: f64| if n > 4.5 { sum / (n - 2.0) } else { sum / n };
    if within_freedom < 0.5 {
        return (variance(total, total_freedom).sqrt(), 0.0);
    }
    let s2 = variance(within, within_freedom);
    let more = total_freedom - within_freedom;
    let t2 = if more < 0.5 { 0.0 } else { (variance(total - within, more) - s2) * more / weight };
    (s2.sqrt(), t2.max(0.0).sqrt())
}

/// Series and condition of each reading, each in all channels but where `blank` says so.
fn scattered(layout: &[(usize, usize)], rng: &mut fastrand::Rng, blank: impl Fn(usize, usize) -> bool) -> Readings {
    let zeros: Vec<[f64; CHANNELS]> = (0..20).map(|_| std::array::from_fn(|_| 2.0 * micro(rng))).collect();
    let read = |(n, (series, at)): (usize, &(usize, usize))| {
        let observed = std::array::from_fn(|c| {
            let value = 20e-6 * *at as f64 + zeros[*series][c] + micro(rng);
            (!blank(n, c)).then_some(value)
        });
        reading(*at, *series, observed)
    };
    let rows = layout.iter().enumerate().map(read).collect();
    let conditions = (0..20).map(|n| condition(n % 3, [10.0 * (n + 1) as f64, 0.0, 0.0, 0.0, 0.0, 0.0])).collect();
    readings(conditions, rows)
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
        let channels = file.channels();
        if (0..CHANNELS).any(|c| channels[c] && pools[c / 3][3] < 2.5) {
            assert!(Noise::new(&file).is_err());
            continue;
        }
        let noise = Noise::new(&file).unwrap();
        assert_eq!(noise.source, NoiseSource::Repeats);
        near(noise.freedom, parts.iter().map(|p| p[3]).sum(), 1e-9);
        for c in (0..CHANNELS).filter(|c| channels[*c]) {
            let own = parts[c][3] > 19.5;
            let (s, t) = deviations(if own { parts[c] } else { pools[c / 3] });
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
        let noise = Noise::new(&scattered(&layout, &mut rng, |_, c| c == 3)).unwrap();
        information += noise.within.iter().filter(|s| **s > 0.0).map(|s| 1e-12 / (s * s)).sum::<f64>() / 300.0;
        between += noise.between.iter().map(|t| t * t * 1e12).sum::<f64>() / 300.0;
    }
    // 27 and 9 freedoms: what a zero's variance gains by two freedoms less is known
    near(information, 1.0, 0.04);
    near(between, ((1.0 + 4.0 * 4.0) * 9.0 / 7.0 - 1.0) / 4.0, 0.12);
}

#[test]
fn noise_may_be_declared_and_must_be_known() {
    let layout = [(0, 0), (1, 1), (2, 2)];
    let sigma = |file: &mut Readings, linear: [Option<f64>; 3]| {
        for (r, linear) in file.readings.iter_mut().zip(linear) {
            r.sigma = [linear, Some(2e-6)];
        }
    };
    let mut file = scattered(&layout, &mut fastrand::Rng::with_seed(3), |row, c| c == 5 || (row == 1 && c == 0));
    file.resolution = [1e-9, 1e-9, 12e-6, 1e-9, 12e-6, 1e-9];
    // the one that is not declared is blank in one channel alone
    sigma(&mut file, [Some(3e-6), None, Some(4e-6)]);
    let refused = Noise::new(&file).unwrap_err().to_string();
    assert!(refused.contains("noise of dy_um") && refused.contains("sigma_linear_um"), "{refused}");
    sigma(&mut file, [Some(1e-6), Some(2e-6), Some(2e-6)]);
    let noise = Noise::new(&file).unwrap();
    assert_eq!((noise.source, noise.freedom, noise.between), (NoiseSource::Declared, 0.0, [0.0; CHANNELS]));
    // root mean squares, or the rounding of the file
    let rounding = 12e-6 / 12.0_f64.sqrt();
    let truth = [2.5_f64.sqrt() * 1e-6, 3.0_f64.sqrt() * 1e-6, rounding, 2e-6, rounding, 0.0];
    noise.within.iter().zip(truth).for_each(|(found, truth)| near(*found, truth, 1e-12));

    // repeats: 39 freedoms a kind are too few beside declared deviations, 42 are enough, and rounding counts
    let repeats = |n: usize| {
        let layout: Vec<(usize, usize)> = (0..n).map(|_| (0, 0)).collect();
        let mut file = scattered(&layout, &mut fastrand::Rng::with_seed(4), |_, _| false);
        file.readings.iter_mut().for_each(|r| r.sigma = [Some(1e-6); 2]);
        file.resolution[1] = 12e-6;
        Noise::new(&file).unwrap()
    };
    assert_eq!(repeats(14).source, NoiseSource::Declared);
    let noise = repeats(15);
    assert_eq!(noise.source, NoiseSource::Repeats);
    assert!(noise.within[0] < 2e-6);
    near(noise.within[1], rounding, 1e-12);
}

/// Readings with all that whitening takes into account: series that are alike, repeats within a series, blanks, roughness of the
/// file.
fn varied(rng: &mut fastrand::Rng) -> Readings {
    let layout =
        [(0, 0), (1, 0), (0, 1), (1, 0), (0, 0), (1, 1), (2, 1), (2, 2), (3, 0), (5, 0), (2, 1), (4, 3), (4, 3)];
    let mut file = scattered(&layout, rng, |row, c| (row + 2 * c) % 9 == 5);
    file.resolution[2] = 3e-6;
    for r in &mut file.readings {
        let some = [0.5e-6, 0.5e-6, 1e-6, 2e-6];
        r.sigma = [Some(some[rng.usize(..4)]), Some(some[rng.usize(..4)])];
    }
    file
}

/// Numbers read, as reading and channel, and their covariance.
fn covariance(file: &Readings, noise: &Noise) -> (Vec<(usize, usize)>, DMatrix<f64>) {
    let rows: Vec<(usize, usize)> = (0..file.readings.len())
        .flat_map(|r| (0..CHANNELS).map(move |c| (r, c)))
        .filter(|(r, c)| file.readings[*r].observed[*c].is_some())
        .collect();
    let variance = |r: usize, c: usize| match noise.source {
        NoiseSource::Repeats => noise.within[c].powi(2),
        NoiseSource::Declared => file.readings[r].sigma[c / 3].unwrap().powi(2).max(file.resolution[c].powi(2) / 12.0),
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
fn noises() -> [Noise; 2] {
    let within = [1e-6, 1.5e-6, 1e-6, 2e-6, 1e-6, 3e-6];
    let noise = |source, between| Noise { source, within, between, freedom: 0.0 };
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
                let mean = |e: &super::noise::Entry| {
                    e.readings.iter().map(|r| error(*r, e.channel)).sum::<f64>() / e.readings.len() as f64
                };
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
        let loaded = averaged.with_load_errors(&groups, scale);
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

fn machine() -> MachineFile {
    MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE)).unwrap()
}

fn effect(id: &str, parameter: usize) -> Unknown {
    Unknown::Effect { effect: (0..COUNT).find(|e| info(*e).id == id).unwrap(), parameter }
}

/// Two unknowns by which predictions are linear.
fn gains() -> [Unknown; 2] {
    [effect("load-gain", 0), effect("load-gain", 1)]
}

fn stiffness(limb: usize, part: Part) -> Unknown {
    Unknown::Stiffness(Declared { limb, part })
}

/// Forces and moments at some poses.
fn loads(poses: usize) -> Vec<Condition> {
    let loads = [
        [200.0, 0.0, 0.0, 0.0, 0.0, 15.0],
        [0.0, 150.0, 40.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -300.0, 25.0, 0.0, 0.0],
        [0.0, 30.0, 0.0, 0.0, 20.0, 10.0],
    ];
    (0..poses).flat_map(|pose| loads.map(|load| condition(pose, load))).collect()
}

/// Deflection of the bare machine, by its compliance.
fn deflection(file: &MachineFile, pose: usize, wrench: [f64; 6]) -> [f64; 6] {
    let [theta, sigma, z0] = POSES[pose];
    let factor = file.machine.stiffness(&pose_of(theta, sigma, z0)).unwrap().factor().unwrap();
    factor.deflection(&Wrench::from_array(wrench)).unwrap().to_array()
}

/// One reading of every condition, each its own series, as the model has it at `x`.
fn simulated(model: &Model, conditions: Vec<Condition>, truth: (&[Unknown], &[f64]), s: f64, seed: u64) -> Readings {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut file = readings(conditions, Vec::new());
    let poses: Vec<_> = file.poses.iter().map(|p| p.pose).collect();
    let said = model.predict(&poses, &file.conditions, truth.0, truth.1).unwrap();
    let read = |(n, said): (usize, &[f64; CHANNELS])| reading(n, n, said.map(|d| Some(d + s * normal(&mut rng))));
    file.readings = said.iter().enumerate().map(read).collect();
    file
}

/// The same noise in all channels.
fn even(s: f64) -> Noise {
    Noise { source: NoiseSource::Repeats, within: [s; CHANNELS], between: [0.0; CHANNELS], freedom: 0.0 }
}

fn close(found: &[f64], truth: &[f64], tolerance: f64) {
    assert_eq!(found.len(), truth.len());
    let largest = truth.iter().fold(1e-9_f64, |most, v| most.max(v.abs()));
    let off = found.iter().zip(truth).any(|(f, t)| !((f - t).abs() <= tolerance * largest));
    assert!(!off, "{found:?} instead of {truth:?}");
}

/// ln N(r; 0, C), less the constant.
fn ln_likelihood(c: &DMatrix<f64>, r: &DVector<f64>) -> f64 {
    -0.5 * (quadratic(c, r) + c.determinant().ln())
}

/// (I + A Aᵀ)⁻¹, what is left of a residual when unknowns with priors are fitted.
fn unexplained(a: &DMatrix<f64>) -> DMatrix<f64> {
    (DMatrix::identity(a.nrows(), a.nrows()) + a * a.transpose()).try_inverse().unwrap()
}

#[test]
fn a_linear_fit_is_the_closed_form() {
    let file = machine();
    let model = Model::new(&file).unwrap();
    let s = 15e-6;
    let mut data = simulated(&model, loads(4), (&gains(), &[1.4, -0.8]), s, 11);
    // a reading is repeated in its series, and one has a blank
    let again =
        Reading { observed: data.readings[2].observed.map(|o| o.map(|o| o + 3e-6)), ..data.readings[2].clone() };
    data.readings.push(again);
    data.readings[5].observed[1] = None;
    let whitener = Whitener::new(&data, &even(s));
    let problem = Problem::new(&data, &whitener, &model);
    let n = whitener.entries.len();
    assert_eq!((n, problem.numbers()), (16 * 6 - 1, 17 * 6 - 1));

    // columns, residuals and solution by hand
    let row = |i: usize, forces: f64, moments: f64| {
        let (e, c) = (&whitener.entries[i], &data.conditions[whitener.entries[i].condition]);
        let [f, m] = [c.wrench.force_n, c.wrench.moment_nm];
        let load = [f[0] * forces, f[1] * forces, f[2] * forces, m[0] * moments, m[1] * moments, m[2] * moments];
        deflection(&file, c.pose, load)[e.channel] * (e.readings.len() as f64).sqrt() / s
    };
    let a = DMatrix::from_fn(n, 2, |i, k| 0.05 * row(i, f64::from(k == 0), f64::from(k == 1)));
    let read = |i: usize| {
        let e = &whitener.entries[i];
        let values: Vec<f64> = e.readings.iter().map(|r| data.readings[*r].observed[e.channel].unwrap()).collect();
        values.iter().sum::<f64>() / (values.len() as f64).sqrt() / s
    };
    let r0 = DVector::from_fn(n, |i, _| read(i) - row(i, 1.0, 1.0));
    let inverse = (a.transpose() * &a + DMatrix::identity(2, 2)).try_inverse().unwrap();
    let x = &inverse * a.transpose() * &r0;

    let fit = problem.fit(&gains(), &[0.3, -0.2]).unwrap();
    close(fit.x.as_slice(), x.as_slice(), 1e-5);
    close(fit.jacobian.as_slice(), a.as_slice(), 1e-6);
    let r = &r0 - &a * &x;
    close(fit.residuals.as_slice(), r.as_slice(), 1e-5);
    near(fit.chi2, r.norm_squared(), 1e-5);
    near(fit.objective, r.norm_squared() + x.norm_squared(), 1e-5);
    // six pairs of readings 3 µm apart
    near(problem.chi2(&fit), r.norm_squared() + 6.0 * 2.0 * (1.5e-6 / s).powi(2), 1e-5);
    near(problem.pure_error(), 6.0 * 2.0 * (1.5e-6 / s).powi(2), 1e-6);
    assert!(problem.fit(&[], &[]).is_none());
    assert_eq!(problem.jacobian(&gains(), &[0.0; 2], 0..0).unwrap().shape(), (n, 0));

    // what follows from the linear form, at the bottom and beside it
    let eigenvalues = (a.transpose() * &a).symmetric_eigenvalues();
    let evidence = ln_likelihood(&(DMatrix::identity(n, n) + &a * a.transpose()), &r0);
    for fit in [&fit, &problem.linear(&gains(), DVector::from_vec(vec![0.4, 0.9])).unwrap()] {
        near(fit.ln_evidence(), evidence, 1e-5);
        near(fit.used_freedoms(), eigenvalues.iter().map(|l| l / (1.0 + l)).sum(), 1e-5);
        (0..2).for_each(|k| near(fit.standard_errors()[k], inverse[(k, k)].sqrt(), 1e-5));
        let columns = DMatrix::from_fn(n, 3, |i, k| ((i + 1) * (k + 2)) as f64 % 7.0 - 3.0 + a[(i, k % 2)]);
        let truth = columns.transpose() * unexplained(&a) * &columns;
        close(fit.remaining(&columns).as_slice(), truth.as_slice(), 1e-5);
    }
    let groups: Vec<Vec<usize>> = (0..4)
        .map(|p| (0..n).filter(|i| data.conditions[whitener.entries[*i].condition].pose == p).collect())
        .collect();
    let left_out = fit.left_out(&groups);
    assert_eq!(left_out.len(), 4);
    for (group, found) in groups.iter().zip(left_out) {
        let others: Vec<usize> = (0..n).filter(|i| !group.contains(i)).collect();
        let (kept, read) = (a.select_rows(&others), r0.select_rows(&others));
        let from_others = (kept.transpose() * &kept + DMatrix::identity(2, 2)).lu().solve(&(kept.transpose() * read));
        let missed = r0.select_rows(group) - a.select_rows(group) * from_others.unwrap();
        near(found, missed.norm_squared(), 1e-5);
    }
}

#[test]
fn a_curved_fit_ends_at_the_bottom() {
    let model = Model::new(&machine()).unwrap();
    let unknowns = [stiffness(0, Part::Young), stiffness(1, Part::BaseAngular(2)), effect("limb-3-axial", 0)];
    let data = simulated(&model, loads(3), (&unknowns, &[-2.0, 1.5, 0.7]), 0.3e-6, 12);
    let whitener = Whitener::new(&data, &even(0.3e-6));
    let problem = Problem::new(&data, &whitener, &model);
    let fit = problem.fit(&unknowns, &[0.0; 3]).unwrap();
    // a Newton step would win next to nothing, and the truth is within the errors
    let slope = fit.jacobian.transpose() * &fit.residuals - &fit.x;
    assert!(slope.dot(&fit.information.solve(&slope)) < 1e-6);
    let errors = fit.standard_errors();
    for (k, truth) in [-2.0, 1.5, 0.7].into_iter().enumerate() {
        assert!((fit.x[k] - truth).abs() < 4.0 * errors[k] && errors[k] < 0.9, "{}{errors}", fit.x);
        let beside = |by: f64| {
            let mut x = fit.x.clone();
            x[k] += by * errors[k];
            problem.residuals(&unknowns, x.as_slice()).unwrap().norm_squared() + x.norm_squared() - fit.objective
        };
        assert!(beside(0.3) > 0.05 && beside(-0.3) > 0.05);
    }
}

#[test]
fn pure_error_is_that_of_repeats_about_their_means() {
    let model = Model::new(&machine()).unwrap();
    let mut rng = fastrand::Rng::with_seed(13);
    for noise in noises() {
        let mut file = varied(&mut rng);
        // two conditions that differ by their temperature alone
        file.readings.iter_mut().filter(|r| r.repeat_of == 2).for_each(|r| r.repeat_of = 1);
        let (rows, c) = covariance(&file, &noise);
        let value = |(r, c): (usize, usize)| file.readings[r].observed[c].unwrap();
        let group = |(r, c): (usize, usize)| (file.readings[r].repeat_of, c);
        let mean = |at: (usize, usize)| {
            let all: Vec<f64> = rows.iter().filter(|o| group(**o) == group(at)).map(|o| value(*o)).collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let r = DVector::from_fn(rows.len(), |i, _| value(rows[i]) - mean(rows[i]));
        for whitener in [Whitener::new(&file, &noise), Whitener::by_reading(&file, &noise)] {
            near(Problem::new(&file, &whitener, &model).pure_error(), quadratic(&c, &r), 1e-7);
        }
    }
}

#[test]
fn unknowns_are_alike_whose_columns_are_parallel() {
    let model = Model::new(&machine()).unwrap();
    let mut unknowns = gains().to_vec();
    unknowns.extend((0..2).map(|p| effect("sensor-scale", p)));
    unknowns.extend((0..3).map(|p| effect("sensor-rotation", p)));
    unknowns.extend((0..3).flat_map(|l| [stiffness(l, Part::Young), stiffness(l, Part::BaseLinear(2))]));
    // forces and translations alone: a gain of one is a scale of the other
    let forces = loads(2).into_iter().map(|c| Condition { wrench: Wrench { moment_nm: [0.0; 3], ..c.wrench }, ..c });
    let mut data = simulated(&model, forces.collect(), (&[], &[]), 1e-6, 14);
    data.readings.iter_mut().for_each(|r| r.observed[3..].fill(None));
    for s in [1e-6, 1e-3] {
        let whitener = Whitener::new(&data, &even(s));
        let fit = Problem::new(&data, &whitener, &model).linear(&unknowns, DVector::zeros(unknowns.len())).unwrap();
        assert!(fit.alike(unknowns[0]).contains(&unknowns[2]));
        assert_eq!(fit.alike(effect("load-point", 0)), []);
        let unit = |j: usize| fit.jacobian.column(j).normalize();
        for own in (0..unknowns.len()).filter(|j| fit.jacobian.column(*j).norm() > 0.0) {
            let is_alike =
                |j: &usize| *j != own && fit.jacobian.column(*j).norm() > 0.0 && unit(own).dot(&unit(*j)).abs() > 0.95;
            let truth: Vec<Unknown> = (0..unknowns.len()).filter(is_alike).map(|j| unknowns[j]).collect();
            assert_eq!(fit.alike(unknowns[own]), truth);
        }
    }
}

/// Loads of one line, of others near it and of other poses, and the line of each.
fn lines() -> (Vec<Condition>, [usize; 9]) {
    let loads = [
        (0, [33.0, 41.0, 7.0, 0.0, 0.0, 0.0]),
        (0, [-33.0, -41.0, -7.0, 0.0, 0.0, 0.0]),
        (0, [66.0, 82.0, 14.0, 0.0, 0.0, 0.0]),
        (0, [41.0, 33.0, 7.0, 0.0, 0.0, 0.0]),
        (0, [0.0, 0.0, -90.0, 4.0, 5.0, 6.0]),
        (0, [0.0, 0.0, 90.0, -4.0, -5.0, -6.0]),
        (1, [33.0, 41.0, 7.0, 0.0, 0.0, 0.0]),
        (1, [0.0, 0.0, 0.0, 0.0, 12.0, 0.0]),
        (1, [0.0, 0.0, 0.0, 0.0, -6.0, 0.0]),
    ];
    (loads.map(|(pose, load)| Condition { rise_k: 3.0, ..condition(pose, load) }).to_vec(), [0, 0, 0, 1, 2, 2, 3, 4, 4])
}

/// Whitened displacements of 1 rad about u, v, w and of twice the load, four columns for each line.
fn load_columns(file: &MachineFile, data: &Readings, whitener: &Whitener, line: &[usize], s: f64) -> DMatrix<f64> {
    DMatrix::from_fn(whitener.entries.len(), 4 * line.len(), |i, k| {
        let e = &whitener.entries[i];
        let c = &data.conditions[e.condition];
        if line[e.condition] != k / 4 {
            return 0.0;
        }
        let turned = |v: [f64; 3]| match k % 4 {
            0 => [0.0, -v[2], v[1]],
            1 => [v[2], 0.0, -v[0]],
            2 => [-v[1], v[0], 0.0],
            _ => v,
        };
        let ([a, b, c0], [d, f, g]) = (turned(c.wrench.force_n), turned(c.wrench.moment_nm));
        deflection(file, c.pose, [a, b, c0, d, f, g])[e.channel] / s
    })
}

#[test]
fn errors_of_a_load_move_all_readings_under_it() {
    let file = machine();
    let mut model = Model::new(&file).unwrap();
    // what grows with warmth does not turn with the load
    model.declared.effects = model.declared.effects.with("thermal-expansion", [11e-6, 11e-6, 0.0]).unwrap();
    let (conditions, line) = lines();
    let s = 2e-6;
    let data = simulated(&model, conditions, (&gains(), &[0.5, 0.1]), s, 15);
    let whitener = Whitener::new(&data, &even(s));
    let plain = Problem::new(&data, &whitener, &model);
    let groups = plain.load_errors().unwrap();
    assert_eq!(groups.len(), 5);
    let truth = load_columns(&file, &data, &whitener, &line, s);
    for (entries, u) in &groups {
        let own = line[whitener.entries[entries[0]].condition];
        assert_eq!(entries.len(), 6 * line.iter().filter(|l| **l == own).count());
        close(u.as_slice(), truth.columns(4 * own, 4).select_rows(entries).as_slice(), 1e-6);
    }

    // declared errors, and more of them level by level
    let declared = Uncertainty { stiffness: 0.1, load_direction_rad: 3e-3, load_gain: 5e-3 };
    let whiteners = solve::whiteners(&plain, &declared).unwrap();
    let levels = Levels::new(&plain, &whiteners);
    assert_eq!((levels.problems.len(), Levels::load_error(0)), (6, 0.0));
    let x = DVector::from_vec(vec![0.3, -0.4]);
    let unlevelled = plain.linear(&gains(), x.clone()).unwrap();
    let n = whitener.entries.len();
    let r0 = &unlevelled.residuals + &unlevelled.jacobian * &x;
    for (level, problem) in levels.problems.iter().enumerate() {
        let more = Levels::load_error(level);
        assert!(level == 0 || (more > Levels::load_error(level - 1) && more < 0.01));
        let (turn, gain) = ((9e-6 + more * more).sqrt(), (25e-6 + more * more).sqrt());
        let u = DMatrix::from_fn(n, truth.ncols(), |i, k| truth[(i, k)] * if k % 4 == 3 { gain } else { turn });
        let a = &unlevelled.jacobian;
        let c = DMatrix::identity(n, n) + &u * u.transpose() + a * a.transpose();
        for fit in [problem.linear(&gains(), x.clone()), problem.relevel(&unlevelled)] {
            near(fit.unwrap().ln_evidence(), ln_likelihood(&c, &r0), 1e-5);
        }
    }
}

#[test]
fn the_level_of_load_errors_is_the_most_likely() {
    let file = machine();
    let model = Model::new(&file).unwrap();
    let (conditions, line) = lines();
    let s = 0.1e-6;
    let mut data = simulated(&model, conditions, (&gains(), &[0.2, 0.1]), s, 16);
    let whitener = Whitener::new(&data, &even(s));
    let u = load_columns(&file, &data, &whitener, &line, 1.0);
    let mut rng = fastrand::Rng::with_seed(17);
    let errors = DVector::from_fn(u.ncols(), |_, _| 4e-3 * normal(&mut rng));
    for (e, by) in whitener.entries.iter().zip((u * errors).iter()) {
        *data.readings[e.readings[0]].observed[e.channel].as_mut().unwrap() += by;
    }
    let plain = Problem::new(&data, &whitener, &model);
    let whiteners = solve::whiteners(&plain, &Uncertainty { stiffness: 0.1, load_direction_rad: 0.0, load_gain: 0.0 });
    let whiteners = whiteners.unwrap();
    let levels = Levels::new(&plain, &whiteners);
    let fits: Vec<Fit> = levels.problems.iter().map(|p| p.fit(&gains(), &[0.0; 2]).unwrap()).collect();
    let evidence = |l: &usize| fits[*l].ln_evidence();
    let best = (0..6).max_by(|a, b| evidence(a).total_cmp(&evidence(b))).unwrap();
    assert!(best > 1 && best < 6);
    for start in [best - 1, best] {
        let (level, fit) = levels.fit(&gains(), &[0.0; 2], start).unwrap();
        assert_eq!(level, best);
        close(fit.x.as_slice(), fits[best].x.as_slice(), 1e-4);
    }
}

/// The linear form of a fit of unknowns with columns `a` to whitened readings, at the bottom.
fn linear_form(a: &DMatrix<f64>, r0: &DVector<f64>) -> Fit {
    let model = Model::new(&machine()).unwrap();
    let data = simulated(&model, loads(1), (&[], &[]), 1e-6, 21);
    let whitener = Whitener::new(&data, &even(1e-6));
    let mut fit = Problem::new(&data, &whitener, &model).linear(&gains(), DVector::zeros(2)).unwrap();
    fit.information = (a.transpose() * a + DMatrix::identity(a.ncols(), a.ncols())).cholesky().unwrap();
    fit.x = fit.information.solve(&(a.transpose() * r0));
    fit.residuals = r0 - a * &fit.x;
    fit.jacobian = a.clone();
    fit
}

/// Probability that χ² of a few freedoms is larger.
fn larger(chi2: f64, freedoms: usize) -> f64 {
    let (e, odd) = ((-chi2 / 2.0).exp(), statrs::function::erf::erfc((chi2 / 2.0).sqrt()));
    match freedoms {
        0 => 1.0,
        1 => odd,
        2 => e,
        3 => odd + (2.0 * chi2 / std::f64::consts::PI).sqrt() * e,
        _ => e * (1.0 + chi2 / 2.0),
    }
}

/// What counts of columns K beside others, as whitened rows: |W r|² is what χ² drops by when they come in freely.
fn seen_of(a: &DMatrix<f64>, k: &DMatrix<f64>) -> DMatrix<f64> {
    let p = unexplained(a);
    if k.is_empty() {
        return DMatrix::zeros(0, k.nrows());
    }
    let eigen = (k.transpose() * &p * k).symmetric_eigen();
    let used: Vec<usize> = (0..k.ncols()).filter(|i| eigen.eigenvalues[*i] > 0.1).collect();
    let mut w = eigen.eigenvectors.select_columns(&used).transpose() * k.transpose() * p;
    used.iter().enumerate().for_each(|(row, i)| w.row_mut(row).scale_mut(1.0 / eigen.eigenvalues[*i].sqrt()));
    w
}

/// Gain of 2 ln E and amplitudes of the best choice of columns, by exact likelihoods.
fn best_of(a: &DMatrix<f64>, r0: &DVector<f64>, columns: &Columns) -> (f64, DVector<f64>) {
    let n = columns.matrix.ncols();
    let c0 = DMatrix::identity(a.nrows(), a.nrows()) + a * a.transpose();
    let mut best: Option<(f64, DVector<f64>)> = None;
    for choice in 1..2_usize.pow(n as u32) {
        let mut k = columns.matrix.clone();
        (0..n).filter(|i| (choice / 2_usize.pow(*i as u32)).is_multiple_of(2)).for_each(|i| k.column_mut(i).fill(0.0));
        let c = &c0 + &k * k.transpose();
        // their posterior mean
        let step = k.transpose() * c.clone().lu().solve(r0).unwrap();
        let gain = 2.0 * (ln_likelihood(&c, r0) - ln_likelihood(&c0, r0));
        let allowed = (0..n).all(|i| !columns.one_sided[i] || step[i] >= 0.0);
        if allowed && best.as_ref().is_none_or(|b| gain > b.0) {
            best = Some((gain, step));
        }
    }
    best.unwrap_or((0.0, DVector::zeros(n)))
}

#[test]
fn the_screen_says_what_each_candidate_could_bring() {
    let mut rng = fastrand::Rng::with_seed(22);
    let n = 24;
    let mut random = |columns: usize, size: f64| DMatrix::from_fn(n, columns, |_, _| size * normal(&mut rng));
    let a = random(3, 1.0);
    let mut nearly = random(2, 1.0);
    let first = nearly.column(0).clone_owned();
    nearly.set_column(1, &(first + random(1, 1e-3).column(0)));
    let matrices = [
        random(1, 0.7),
        random(2, 0.5),
        random(3, 0.6),
        random(4, 0.3),
        random(1, 1e-3),
        nearly,
        DMatrix::zeros(n, 0),
        random(3, 1.5),
    ];
    let candidates: Vec<Columns> = (matrices.into_iter().enumerate())
        .map(|(i, matrix)| {
            let one_sided = (0..matrix.ncols()).map(|k| (i + k) % 3 > 0).collect();
            Columns { matrix, one_sided, shape: 0.0 }
        })
        .collect();
    let noise = [random(1, 1.0), random(1, 1.0), random(1, 1.0)];
    let truth = candidates[2].matrix.column(0) * 0.4 + candidates[3].matrix.column(2);
    let columns = |m: &DMatrix<f64>| m.column(0).clone_owned();
    let cases = [
        columns(&noise[0]),
        columns(&noise[1]) + &truth,
        columns(&noise[2]) + &truth * 2.0,
        columns(&noise[2]) - &truth * 6.0,
        DVector::zeros(n),
    ];
    let rows: Vec<DMatrix<f64>> = candidates.iter().map(|c| seen_of(&a, &c.matrix)).collect();
    // the null: readings of unit variance, unknowns as their priors have them
    let null: Vec<f64> = (0..4000)
        .map(|_| {
            let r = DVector::from_fn(n, |_, _| normal(&mut rng)) + &a * DVector::from_fn(3, |_, _| normal(&mut rng));
            rows.iter().map(|w| larger((w * &r).norm_squared(), w.nrows())).fold(1.0, f64::min)
        })
        .collect();
    let mut families = Vec::new();
    for r0 in &cases {
        let fit = linear_form(&a, r0);
        let found = screen::screen(&fit, &candidates, 5);
        let mut least = 1.0_f64;
        for ((score, c), w) in found.scores.iter().zip(&candidates).zip(&rows) {
            assert_eq!(score.freedoms, w.nrows());
            let drop = (w * r0).norm_squared();
            assert!((score.statistic - drop).abs() < 1e-8 * drop.max(1.0), "{} {drop}", score.statistic);
            let p = larger(drop, w.nrows());
            assert!((score.p - p).abs() < 1e-6 * p + 1e-30, "{} {p}", score.p);
            least = least.min(p);
            let (gain, step) = best_of(&a, r0, c);
            assert!((score.gain - gain).abs() < 1e-7 * gain.abs().max(1.0), "{} {gain}", score.gain);
            assert!((&score.step - &step).norm() < 1e-7 * step.norm().max(1.0), "{} {step}", score.step);
            assert!((screen::gain(&fit, c) - gain).abs() < 1e-7 * gain.abs().max(1.0));
        }
        let drawn = null.iter().filter(|p| **p <= least).count() as f64 / null.len() as f64;
        families.push((found.p_family, drawn, least));
    }
    for (found, drawn, _) in &families[..3] {
        assert!((found - drawn).abs() < 4.0 * (2.0 * drawn / 4000.0).sqrt(), "{families:?}");
    }
    assert!(families[0].0 > 0.2 && families[2].0 < 0.05 && families[2].0 > 0.002, "{families:?}");
    // far out it is the number of candidates that bounds it
    near(families[3].0 / families[3].2, 8.0, 1e-5);
    assert_eq!(families[4].0, 1.0);
}

#[test]
fn normal_numbers_are_normal() {
    let mut rng = fastrand::Rng::with_seed(23);
    let drawn: Vec<f64> = (0..20_000).map(|_| screen::normal(&mut rng)).collect();
    let mean = |f: &dyn Fn(f64) -> f64| drawn.iter().map(|x| f(*x)).sum::<f64>() / drawn.len() as f64;
    assert!(mean(&|x| x).abs() < 0.02);
    near(mean(&|x| x * x), 1.0, 0.03);
    near(mean(&|x| x.powi(4)), 3.0, 0.08);
    near(mean(&|x| f64::from(u8::from(x > 1.0))), 0.158_655, 0.05);
}

/// Errors of readings, given with predictions and poses in µm, translation along u alone.
fn errors_of(squares: &[(usize, f64)]) -> Errors {
    let conditions = squares.iter().map(|(pose, _)| condition(*pose, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])).collect();
    let read = |n: usize| reading(n, n, [Some(1e-3), None, None, None, None, None]);
    let file = readings(conditions, (0..squares.len()).map(read).collect());
    let said: Vec<[f64; CHANNELS]> =
        squares.iter().map(|(_, square)| [1e-3 + 1e-6 * square.sqrt(), 9.0, 9.0, 9.0, 9.0, 9.0]).collect();
    compare::errors(&file, &even(1e-6), &said, |_| true).unwrap()
}

#[test]
fn errors_are_root_mean_squares() {
    let some = |v: [f64; 6], blank: &[usize]| -> [Option<f64>; 6] {
        std::array::from_fn(|c| (!blank.contains(&c)).then_some(v[c] * 1e-6))
    };
    let load = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let file = readings(
        vec![condition(0, load), condition(1, load), condition(2, load)],
        vec![
            reading(0, 0, some([10.0, 20.0, -20.0, 5.0, 0.0, 0.0], &[4, 5])),
            reading(1, 1, some([0.0, 6.0, 8.0, 3.0, 4.0, 0.0], &[0])),
            reading(2, 2, some([1.0; 6], &[])),
        ],
    );
    let noise =
        Noise { within: [3e-6, 3e-6, 3e-6, 2e-6, 2e-6, 2e-6], between: [4e-6, 4e-6, 4e-6, 0.0, 0.0, 0.0], ..even(1.0) };
    let said =
        [[13.0, 20.0, -24.0, 5.0, 7.0, 7.0], [99.0, 6.0, 20.0, 6.0, 8.0, 0.0], [0.0; 6]].map(|d| d.map(|v| v * 1e-6));
    let found = compare::errors(&file, &noise, &said, |n| n < 2).unwrap();
    assert_eq!(found.readings, 2);
    near(found.linear_um_rms, (169.0_f64 / 2.0).sqrt(), 1e-9);
    near(found.linear_um_max, 12.0, 1e-9);
    near(found.linear_percent, 100.0 * (169.0_f64 / 1000.0).sqrt(), 1e-9);
    near(found.angular_urad_rms, 12.5_f64.sqrt(), 1e-9);
    near(found.angular_percent, 100.0 * 0.5_f64.sqrt(), 1e-9);
    near(found.chi2_per_dof, (169.0 / 25.0 + 25.0 / 4.0) / 9.0, 1e-9);
    assert!(found.linear_um_rms_interval.is_none() && !found.linear_um_rms_interval_open);
    assert!(compare::errors(&file, &noise, &said, |_| false).is_none());
    assert_eq!(errors_of(&[(0, 4.0)]).angular_percent, 0.0);
}

#[test]
fn intervals_hold_the_mean_of_all_poses() {
    // by definition: t of resampled poses, on the logarithm of the ratio of two sums; of some poses nothing was read
    let mut rng = fastrand::Rng::with_seed(31);
    let squares: Vec<(usize, f64)> = (0..60).map(|n| (n % 24 * 2, (1.0 + rng.f64()) * (n % 5 + 1) as f64)).collect();
    let mut poses: Vec<Vec<f64>> = vec![Vec::new(); 24];
    squares.iter().for_each(|(pose, square)| poses[*pose / 2].push(*square));
    let studied = |chosen: &[&Vec<f64>]| {
        let all: Vec<f64> = chosen.iter().copied().flatten().copied().collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let n = chosen.len() as f64;
        let scatter: f64 = chosen.iter().map(|p| p.iter().map(|square| square / mean - 1.0).sum::<f64>().powi(2)).sum();
        (mean.ln(), (scatter * n / (n - 1.0)).sqrt() / all.len() as f64)
    };
    let (middle, error) = studied(&poses.iter().collect::<Vec<_>>());
    let mut t: Vec<f64> = (0..4000)
        .map(|_| {
            let drawn: Vec<&Vec<f64>> = (0..poses.len()).map(|_| &poses[rng.usize(..poses.len())]).collect();
            let (there, own) = studied(&drawn);
            (there - middle) / own
        })
        .collect();
    t.sort_by(f64::total_cmp);
    let found = errors_of(&squares);
    let [low, high] = found.linear_um_rms_interval.unwrap();
    assert!(!found.linear_um_rms_interval_open);
    for (end, t) in [(low, t[3899]), (high, t[99])] {
        let (found, truth) = (2.0 * end.ln() - middle, -t * error);
        assert!((found - truth).abs() < 0.1 * truth.abs(), "{found} instead of {truth}");
    }

    // four poses are too few; one that errs most leaves no upper end
    let few = |n: usize| {
        errors_of(&(0..n).map(|pose| (2 * pose, if pose == 0 { 1e4 } else { 1.0 + pose as f64 })).collect::<Vec<_>>())
    };
    assert!(few(4).linear_um_rms_interval.is_none());
    let open = few(5);
    assert!(open.linear_um_rms_interval_open);
    near(open.linear_um_rms_interval.unwrap()[1], 100.0, 1e-9);

    // coverage: poses differ, and readings at each
    let held = (0..60).filter(|_| {
        let squares: Vec<(usize, f64)> = (0..14)
            .flat_map(|pose| {
                let size = (0.5 * normal(&mut rng)).exp();
                [0; 2].map(|_| (pose, size * (0..3).map(|_| normal(&mut rng).powi(2)).sum::<f64>()))
            })
            .collect();
        let [low, high] = errors_of(&squares).linear_um_rms_interval.unwrap();
        let truth = (3.0 * (0.125_f64).exp()).sqrt();
        low < truth && truth < high
    });
    let held = held.count();
    assert!((52..60).contains(&held), "{held} of 60");
}

#[test]
fn zones_are_told_by_box_and_load() {
    let f = |size: f64, degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [size * cos, size * sin, 0.0, 0.0, 0.0, 0.0]
    };
    let mixed = [0.0, 0.0, -30.0, 6.0, 0.0, 0.0];
    // a box of ±10°, ±5°, 500…560 mm
    let at = |pose: [f64; 3], load: [f64; 6]| {
        let mut file = readings(vec![condition(0, load)], vec![reading(0, 0, [Some(1e-6); 6])]);
        file.poses[0].pose = pose_of(pose[0], pose[1], pose[2]);
        file
    };
    let measured = |sigma: f64| {
        let mut file = readings(vec![condition(0, f(100.0, 0.0)), condition(1, mixed)], Vec::new());
        file.readings = vec![reading(0, 0, [Some(1e-6); 6]), reading(1, 1, [Some(1e-6); 6])];
        file.poses[0].pose = pose_of(-10.0, -sigma, 560.0);
        file.poses[1].pose = pose_of(10.0, sigma, 500.0);
        file
    };
    let (inside, edge, beyond, other) = (Zone::Inside, Zone::Edge, Zone::Beyond, Zone::OtherLoads);
    let middle = [1.0, -1.0, 525.0];
    for (pose, load, zone) in [
        (middle, f(100.0, 0.0), inside),
        (middle, f(30.0, 0.0), inside),
        (middle, mixed, inside),
        (middle, mixed.map(|v| 0.5 * v), inside),
        (middle, [0.0; 6], inside),
        (middle, f(100.0, 2.0), inside),
        (middle, f(100.0, 4.0), other),
        (middle, f(0.5, 4.0), other),
        (middle, f(100.5, 0.0), other),
        (middle, f(-100.0, 0.0), other),
        (middle, f(20.0, 80.0), other),
        ([8.9, 0.0, 530.0], f(100.0, 0.0), inside),
        ([9.1, 0.0, 530.0], f(100.0, 0.0), edge),
        ([0.0, -4.6, 530.0], f(100.0, 0.0), edge),
        ([0.0, 0.0, 501.0], f(100.0, 0.0), edge),
        ([0.0, 0.0, 501.0], f(101.0, 0.0), other),
        ([-10.0, 5.0, 560.0], f(100.0, 0.0), edge),
        ([-10.1, 0.0, 530.0], f(100.0, 0.0), beyond),
        ([0.0, 0.0, 561.0], f(101.0, 0.0), beyond),
    ] {
        assert_eq!(compare::zones(&measured(5.0), &at(pose, load)), [zone], "{pose:?} {load:?}");
    }
    // what was not varied is no edge
    assert_eq!(compare::zones(&measured(0.0), &at([0.0, 3.0, 530.0], mixed)), [inside]);
    assert_eq!([inside, edge, beyond, other].map(Zone::name), ["inside", "edge", "beyond", "other_loads"]);
}

#[test]
fn rivals_are_fitted_without_the_pose_that_they_predict() {
    let model = Model::new(&machine()).unwrap();
    let unknowns = [stiffness(0, Part::Young), effect("limb-3-axial", 0), effect("load-gain", 0)];
    let truth = [-1.0, 0.8, 0.6];
    let s = 0.1e-6;
    let mut data = simulated(&model, loads(2), (&unknowns, &truth), s, 41);
    let poses: Vec<_> = data.poses.iter().map(|p| p.pose).collect();
    // and something that no rival has
    data.readings.iter_mut().for_each(|r| r.observed[2] = r.observed[2].map(|d| 1.3 * d));
    let noise = even(s);
    let fits = |data: &Readings| -> [Fit; 2] {
        let whitener = Whitener::new(data, &noise);
        let problem = Problem::new(data, &whitener, &model);
        [problem.fit(&unknowns[..1], &[0.0]).unwrap(), problem.fit(&unknowns, &[0.0; 3]).unwrap()]
    };
    let [base, fit] = fits(&data);
    let search = Search {
        base,
        fit,
        levels: [0; 2],
        found: Vec::new(),
        steps: Vec::new(),
        rounds: Vec::new(),
        candidates: Vec::new(),
        columns: Vec::new(),
    };

    // errors of the measurement are left out where the truth has none
    let of = |fit: &Fit, x: &[f64]| model.predict(&poses, &data.conditions, &fit.unknowns, x).unwrap();
    let x = &search.fit.x;
    let said =
        |as_measured: bool| compare::predict(&model, &search.fit, &poses, &data.conditions, as_measured).unwrap();
    assert_eq!(said(true), of(&search.fit, x.as_slice()));
    assert_eq!(said(false), of(&search.fit, &[x[0], x[1], 0.0]));

    let whitener = Whitener::new(&data, &noise);
    let problem = Problem::new(&data, &whitener, &model);
    let fitted = Fitted::new(&problem, &search, false).unwrap();
    let own = fitted.predict(&model, &poses, &data.conditions, true).unwrap();
    assert_eq!(own.of(Rival::Declared), of(&search.fit, &[0.0; 3]));
    assert_eq!(own.of(Rival::Retuned), of(&search.base, search.base.x.as_slice()));
    assert_eq!(own.of(Rival::After), said(true));
    let table = fitted.remainder().predict(&poses, &data.conditions).unwrap();
    assert!(table[0][2] != 0.0);
    let sum = |n: usize| -> [f64; CHANNELS] { std::array::from_fn(|c| said(true)[n][c] + table[n][c]) };
    assert_eq!(own.of(Rival::AfterAndTable), (0..table.len()).map(sum).collect::<Vec<_>>());
    let rms = |rival: Rival| compare::errors(&data, &noise, own.of(rival), |_| true).unwrap().linear_um_rms;
    assert!(rms(Rival::Table) < 0.8 * rms(Rival::Declared));
    assert!(rms(Rival::AfterAndTable) < rms(Rival::After));

    let held_out = compare::cross_validate(&data, &noise, &model, &search).unwrap();
    for pose in 0..2 {
        let [base, fit] = fits(&data.without(|r| data.conditions[r.condition].pose == pose));
        for (n, _) in data.conditions.iter().enumerate().filter(|(_, c)| c.pose == pose) {
            for (rival, fit) in [(Rival::Retuned, &base), (Rival::After, &fit)] {
                let truth = of(fit, fit.x.as_slice())[n];
                (0..CHANNELS).for_each(|c| assert!((held_out.of(rival)[n][c] - truth[c]).abs() < 1e-9));
            }
        }
    }
}

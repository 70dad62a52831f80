//! The screen against exact likelihoods and simulation.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::screening::{self, Columns};
use pkm_diagnosis::{Fit, Rules};

use crate::support::*;

/// The linear form of a fit of unknowns with columns `a` to whitened readings, at the bottom.
fn linear_form(a: &DMatrix<f64>, r0: &DVector<f64>) -> Fit {
    let information = (a.transpose() * a + DMatrix::identity(a.ncols(), a.ncols())).cholesky().unwrap();
    let x = information.solve(&(a.transpose() * r0));
    Fit::new(unknowns(a.ncols()), x.clone(), r0 - a * x, a.clone(), 0.0).unwrap()
}

/// Probability that χ² of a few dof is larger.
fn larger(chi2: f64, dof: usize) -> f64 {
    let (e, odd) = ((-chi2 / 2.0).exp(), statrs::function::erf::erfc((chi2 / 2.0).sqrt()));
    match dof {
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
        let found = screening::screen(&fit, &candidates, None, 5, &Rules::DEFAULT);
        let mut least = 1.0_f64;
        for ((score, c), w) in found.scores.iter().zip(&candidates).zip(&rows) {
            assert_eq!(score.dof, w.nrows());
            let drop = (w * r0).norm_squared();
            assert!((score.statistic - drop).abs() < 1e-8 * drop.max(1.0), "{} {drop}", score.statistic);
            let p = larger(drop, w.nrows());
            assert!((score.p - p).abs() < 1e-6 * p + 1e-30, "{} {p}", score.p);
            least = least.min(p);
            let (gain, step) = best_of(&a, r0, c);
            assert!((score.gain - gain).abs() < 1e-7 * gain.abs().max(1.0), "{} {gain}", score.gain);
            assert!((&score.step - &step).norm() < 1e-7 * step.norm().max(1.0), "{} {step}", score.step);
            assert!((screening::gain(&fit, c) - gain).abs() < 1e-7 * gain.abs().max(1.0));
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

/// Noise that was estimated from three or ten degrees of freedom: the family-wise p keeps what it says, which it does not where
/// the estimate counts as known.
#[test]
fn few_degrees_of_freedom_make_no_false_names() {
    let mut rng = fastrand::Rng::with_seed(24);
    let a = DMatrix::from_fn(30, 3, |_, _| normal(&mut rng));
    let column = |rng: &mut fastrand::Rng, columns| Columns {
        matrix: DMatrix::from_fn(30, columns, |_, _| normal(rng)),
        one_sided: vec![false; columns],
        shape: 0.0,
    };
    let candidates = [1, 2, 1, 3].map(|columns| column(&mut rng, columns));
    let rules = Rules { null_draws: 400, ..Rules::DEFAULT };
    let runs = 500_u32;
    for noise_dof in [3_usize, 10] {
        let mut named = [0_u32; 2];
        for run in 0..runs {
            let freedom = (0..noise_dof).map(|_| normal(&mut rng).powi(2)).sum::<f64>() / noise_dof as f64;
            let r = DVector::from_fn(30, |_, _| normal(&mut rng)) / freedom.sqrt();
            let fit = linear_form(&a, &r);
            for (named, dof) in named.iter_mut().zip([Some(noise_dof as f64), None]) {
                let found = screening::screen(&fit, &candidates, dof, u64::from(run), &rules);
                *named += u32::from(found.p_family <= 0.05);
            }
        }
        let [student, normal] = named.map(|n| f64::from(n) / f64::from(runs));
        // 5 % within three standard deviations of so many runs
        assert!((student - 0.05).abs() < 0.03, "{noise_dof}: {student}");
        assert!(normal > 1.8 * student, "{noise_dof}: {normal} {student}");
    }
}

#[test]
fn normal_numbers_are_normal() {
    let mut rng = fastrand::Rng::with_seed(23);
    let drawn: Vec<f64> = (0..20_000).map(|_| screening::normal(&mut rng)).collect();
    let mean = |f: &dyn Fn(f64) -> f64| drawn.iter().map(|x| f(*x)).sum::<f64>() / drawn.len() as f64;
    assert!(mean(&|x| x).abs() < 0.02);
    near(mean(&|x| x * x), 1.0, 0.03);
    near(mean(&|x| x.powi(4)), 3.0, 0.08);
    near(mean(&|x| f64::from(u8::from(x > 1.0))), 0.158_655, 0.05);
}

/// Of more columns than of which all choices are tried: columns that share no reading, so that each counts alone.
#[test]
fn of_many_columns_those_are_chosen_that_pay_for_themselves() {
    let mut rng = fastrand::Rng::with_seed(31);
    let n = 14;
    let sizes: Vec<f64> = (0..n).map(|_| 0.2 + 3.0 * rng.f64()).collect();
    let read = DVector::from_fn(n + 1, |_, _| 1.5 * normal(&mut rng));
    let matrix = DMatrix::from_fn(n + 1, n, |row, column| if row == column { sizes[column] } else { 0.0 });
    let one_sided: Vec<bool> = (0..n).map(|k| k % 3 > 0).collect();
    // an unknown of the model alone on the last reading
    let fit = linear_form(&DMatrix::from_fn(n + 1, 1, |row, _| f64::from(u8::from(row == n))), &read);
    // 2 ln of N(0, 1 + size²) over N(0, 1)
    let gains = sizes.iter().zip(&one_sided).zip(read.iter()).map(|((size, one_sided), r)| {
        let variance = 1.0 + size * size;
        let gain = r * r * (1.0 - 1.0 / variance) - variance.ln();
        if *one_sided && *r < 0.0 { 0.0 } else { gain.max(0.0) }
    });
    let gains: Vec<f64> = gains.collect();
    let (used, expected) = (gains.iter().filter(|g| **g > 0.0).count(), gains.iter().sum::<f64>());
    assert!((3..n - 3).contains(&used), "{used}");
    let found = screening::gain(&fit, &Columns { matrix, one_sided, shape: 0.0 });
    assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
}

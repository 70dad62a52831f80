//! Fits, evidence and common errors against closed forms.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::{CommonErrors, Fit, ForwardModel, Levels, Problem, Rules, Unknown, Whitener, levels};

use crate::noise::{covariance, noises, varied};
use crate::support::*;

const RULES: &Rules = &Rules::DEFAULT;

#[test]
fn a_linear_fit_is_the_closed_form() {
    let mut rng = fastrand::Rng::with_seed(10);
    let mut model = Table::random(&mut rng, 16, 2, 20e-6);
    // one column nearly follows the other
    let (first, second) = model.columns.split_at_mut(1);
    second[0].iter_mut().zip(&first[0]).for_each(|(b, a)| *b += 3.0 * a);
    let s = 15e-6;
    let mut data = simulated(&model, (0..16).map(|n| n / 4).collect(), &[1.4, -0.8], s, 11);
    // a reading is repeated in its series, and one has a blank
    let mut again = data.readings[2].clone();
    again.observed.iter_mut().flatten().for_each(|o| *o += 3e-6);
    data.readings.push(again);
    data.readings[5].observed[1] = None;
    let whitener = Whitener::new(&data, &even(s));
    let problem = Problem::new(&data, &whitener, &model, RULES);
    let n = whitener.entries.len();
    assert_eq!((n, problem.numbers()), (16 * 6 - 1, 17 * 6 - 1));

    // columns, residuals and solution by hand
    let row = |i: usize, table: &[f64]| {
        let e = &whitener.entries[i];
        table[e.condition * CHANNELS + e.channel] * (e.readings.len() as f64).sqrt() / s
    };
    let a = DMatrix::from_fn(n, 2, |i, k| row(i, &model.columns[k]));
    let read = |i: usize| {
        let e = &whitener.entries[i];
        let values: Vec<f64> = e.readings.iter().map(|r| data.readings[*r].observed[e.channel].unwrap()).collect();
        values.iter().sum::<f64>() / (values.len() as f64).sqrt() / s
    };
    let r0 = DVector::from_fn(n, |i, _| read(i) - row(i, &model.constant));
    let inverse = (a.transpose() * &a + DMatrix::identity(2, 2)).try_inverse().unwrap();
    let x = &inverse * a.transpose() * &r0;

    let fit = problem.fit(&unknowns(2), &[0.3, -0.2]).unwrap();
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
    assert_eq!(problem.jacobian(&unknowns(2), &[0.0; 2], 0..0).unwrap().shape(), (n, 0));

    // what follows from the linear form, at the bottom and beside it
    let eigenvalues = (a.transpose() * &a).symmetric_eigenvalues();
    let evidence = ln_likelihood(&(DMatrix::identity(n, n) + &a * a.transpose()), &r0);
    for fit in [&fit, &problem.linear(&unknowns(2), DVector::from_vec(vec![0.4, 0.9])).unwrap()] {
        near(fit.ln_evidence(), evidence, 1e-5);
        near(fit.effective_parameters(), eigenvalues.iter().map(|l| l / (1.0 + l)).sum(), 1e-5);
        (0..2).for_each(|k| near(fit.standard_errors(1.0)[k], inverse[(k, k)].sqrt(), 1e-5));
        // readings that scatter by three times their noise say a ninth, and the prior as much
        let vague = (a.transpose() * &a / 9.0 + DMatrix::identity(2, 2)).try_inverse().unwrap();
        (0..2).for_each(|k| near(fit.standard_errors(9.0)[k], vague[(k, k)].sqrt(), 1e-5));
        let columns = DMatrix::from_fn(n, 3, |i, k| ((i + 1) * (k + 2)) as f64 % 7.0 - 3.0 + a[(i, k % 2)]);
        let truth = columns.transpose() * unexplained(&a) * &columns;
        close(fit.remaining(&columns).as_slice(), truth.as_slice(), 1e-5);
    }
    let groups = problem.by_pose();
    assert_eq!(groups.len(), 4);
    let at = |i: &usize| data.pose_of[whitener.entries[*i].condition];
    groups.iter().enumerate().for_each(|(p, group)| assert!(group.iter().all(|i| at(i) == p)));
    assert_eq!(groups.iter().map(Vec::len).sum::<usize>(), n);
    for (group, found) in groups.iter().zip(fit.left_out(&groups)) {
        let others: Vec<usize> = (0..n).filter(|i| !group.contains(i)).collect();
        let (kept, read) = (a.select_rows(&others), r0.select_rows(&others));
        let from_others = (kept.transpose() * &kept + DMatrix::identity(2, 2)).lu().solve(&(kept.transpose() * read));
        let missed = r0.select_rows(group) - a.select_rows(group) * from_others.unwrap();
        near(found, missed.norm_squared(), 1e-5);
    }
}

#[test]
fn a_curved_fit_ends_at_the_bottom() {
    let mut model = Table::random(&mut fastrand::Rng::with_seed(8), 12, 3, 1e-6);
    model.curve = 0.1;
    let truth = [-2.0, 1.5, 0.7];
    let data = simulated(&model, vec![0; 12], &truth, 0.3e-6, 12);
    let whitener = Whitener::new(&data, &even(0.3e-6));
    let problem = Problem::new(&data, &whitener, &model, RULES);
    let unknowns = unknowns(3);
    let fit = problem.fit(&unknowns, &[0.0; 3]).unwrap();
    // a Newton step would win next to nothing, and the truth is within the errors
    let slope = fit.jacobian.transpose() * &fit.residuals - &fit.x;
    assert!(slope.dot(&fit.information.solve(&slope)) < 1e-6);
    let errors = fit.standard_errors(1.0);
    for (k, truth) in truth.into_iter().enumerate() {
        assert!((fit.x[k] - truth).abs() < 4.0 * errors[k] && errors[k] < 0.9, "{}{errors}", fit.x);
        let beside = |by: f64| {
            let mut x = fit.x.clone();
            x[k] += by * errors[k];
            problem.residuals(&unknowns, x.as_slice()).unwrap().norm_squared() + x.norm_squared() - fit.objective
        };
        assert!(beside(0.3) > 0.05 && beside(-0.3) > 0.05);
    }
}

/// Under common errors, too: the same as central differences at the end.
#[test]
fn the_linear_form_of_a_fit_is_that_where_it_ends() {
    let mut model = with_common_errors(&mut fastrand::Rng::with_seed(17));
    model.curve = 0.1;
    let s = 0.1e-6;
    let data = simulated(&model, vec![0; 9], &[-1.5, 0.8], s, 17);
    let whitener = Whitener::new(&data, &even(s));
    let plain = Problem::new(&data, &whitener, &model, RULES);
    for whitener in levels::whiteners(&plain) {
        let problem = plain.with(&whitener);
        let fit = problem.fit(&unknowns(2), &[0.0; 2]).unwrap();
        let there = problem.linear(&unknowns(2), fit.x.clone()).unwrap();
        close(fit.residuals.as_slice(), there.residuals.as_slice(), 1e-9);
        assert!((&fit.jacobian - &there.jacobian).amax() < 1e-5 * there.jacobian.amax());
        assert!((fit.ln_evidence() - there.ln_evidence()).abs() < 1e-3);
    }
}

/// Strongly curved predictions under little noise take many steps: a fit that is given ends at the bottom all the same.
#[test]
fn a_fit_that_takes_long_is_no_worse_than_another() {
    let mut worst = 0.0_f64;
    let mut given = 0;
    for seed in 0..40 {
        let mut model = Table::random(&mut fastrand::Rng::with_seed(seed), 4, 6, 1e-6);
        model.curve = 2.0;
        let truth = [-1.0, 0.8, 0.7, 1.2, -0.9, 0.4];
        let data = simulated(&model, vec![0; 4], &truth, 1e-9, seed);
        let whitener = Whitener::new(&data, &even(1e-9));
        let problem = Problem::new(&data, &whitener, &model, RULES);
        let Some(fit) = problem.fit(&unknowns(6), &[0.0; 6]) else { continue };
        given += 1;
        let slope = fit.jacobian.transpose() * &fit.residuals - &fit.x;
        worst = worst.max(slope.dot(&fit.information.solve(&slope)));
    }
    println!("{given} fits, a step to the bottom of at most {worst:.1e}");
    assert!(given >= 30 && worst < 0.1, "{given} {worst:e}");
}

#[test]
fn pure_error_is_that_of_repeats_about_their_means() {
    let mut rng = fastrand::Rng::with_seed(13);
    let model = Table::random(&mut rng, 20, 0, 0.0);
    for noise in noises() {
        let mut file = varied(&mut rng);
        // two conditions of one nominal load: what the model says they differ by is no scatter
        file.readings.iter_mut().filter(|r| r.repeat_of == 2).for_each(|r| r.repeat_of = 1);
        let (rows, c) = covariance(&file, &noise);
        let said = model.predict(&[], &[]).unwrap();
        let value = |(r, c): (usize, usize)| {
            let reading = &file.readings[r];
            reading.observed[c].unwrap() - said[reading.condition * file.channels.len() + c]
        };
        let group = |(r, c): (usize, usize)| (file.readings[r].repeat_of, c);
        let mean = |at: (usize, usize)| {
            let all: Vec<f64> = rows.iter().filter(|o| group(**o) == group(at)).map(|o| value(*o)).collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let r = DVector::from_fn(rows.len(), |i, _| value(rows[i]) - mean(rows[i]));
        for whitener in [Whitener::new(&file, &noise), Whitener::by_reading(&file, &noise)] {
            near(Problem::new(&file, &whitener, &model, RULES).pure_error(), quadratic(&c, &r), 1e-7);
        }
    }
}

#[test]
fn unknowns_are_alike_whose_columns_are_parallel() {
    let mut rng = fastrand::Rng::with_seed(9);
    let mut model = Table::random(&mut rng, 8, 8, 1e-4);
    // 1 and 4 are nearly one, 2 and 5 opposite, 3 and 6 rather alike; 7 does nothing
    for (of, like, own, other) in [(4, 1, 0.1, 1.0), (5, 2, 0.2, -3.0), (6, 3, 0.4, 1.0)] {
        let like = model.columns[like].clone();
        model.columns[of].iter_mut().zip(&like).for_each(|(a, b)| *a = own * *a + other * b);
    }
    model.columns[7].fill(0.0);
    let data = simulated(&model, vec![0; 8], &[], 1e-6, 14);
    for s in [1e-6, 1e-3] {
        let whitener = Whitener::new(&data, &even(s));
        let fit = Problem::new(&data, &whitener, &model, RULES).linear(&unknowns(8), DVector::zeros(8)).unwrap();
        assert_eq!(fit.alike(Unknown(1), 0.95), [Unknown(4)]);
        assert_eq!(fit.alike(Unknown(5), 0.95), [Unknown(2)]);
        assert_eq!(fit.alike(Unknown(9), 0.95), []);
        assert_eq!(fit.alike(Unknown(7), 0.95), []);
        let unit = |j: usize| fit.jacobian.column(j).normalize();
        for (own, limit) in (0..7).flat_map(|own| [0.3, 0.9, 0.95].map(|limit| (own, limit))) {
            let is_alike = |j: &usize| *j != own && unit(own).dot(&unit(*j)).abs() > limit;
            let truth: Vec<Unknown> = (0..7).filter(is_alike).map(Unknown).collect();
            assert_eq!(fit.alike(Unknown(own), limit), truth);
        }
    }
}

/// Two columns of errors that groups of conditions have in common.
fn with_common_errors(rng: &mut fastrand::Rng) -> Table {
    let mut model = Table::random(rng, 9, 2, 20e-6);
    let column = |rng: &mut fastrand::Rng| (0..9 * CHANNELS).map(|_| 1e-3 * normal(rng)).collect::<Vec<f64>>();
    // the third group is empty
    let group_of = vec![0, 0, 0, 1, 3, 3, 4, 1, 1];
    model.common = CommonErrors {
        columns: vec![column(rng), column(rng)],
        sd: vec![3e-3, 5e-3],
        undeclared: vec![1.0, 0.5],
        group_of,
    };
    model
}

/// Whitened common errors, two columns for each group.
fn common_columns(model: &Table, whitener: &Whitener, s: f64) -> DMatrix<f64> {
    DMatrix::from_fn(whitener.entries.len(), 10, |i, k| {
        let e = &whitener.entries[i];
        let own = f64::from(u8::from(model.common.group_of[e.condition] == k / 2));
        own * model.common.columns[k % 2][e.condition * CHANNELS + e.channel] / s
    })
}

#[test]
fn common_errors_move_all_readings_of_a_group() {
    let mut rng = fastrand::Rng::with_seed(15);
    let model = with_common_errors(&mut rng);
    let s = 2e-6;
    let data = simulated(&model, vec![0; 9], &[0.5, 0.1], s, 15);
    let whitener = Whitener::new(&data, &even(s));
    let plain = Problem::new(&data, &whitener, &model, RULES);
    let groups = plain.common_groups(&model.common);
    assert_eq!(groups.len(), 4);
    let truth = common_columns(&model, &whitener, s);
    for (entries, u) in &groups {
        let own = model.common.group_of[whitener.entries[entries[0]].condition];
        assert_eq!(entries.len(), 6 * model.common.group_of.iter().filter(|g| **g == own).count());
        close(u.as_slice(), truth.columns(2 * own, 2).select_rows(entries).as_slice(), 1e-9);
    }

    // declared errors, and more of them level by level
    let whiteners = levels::whiteners(&plain);
    let levels = Levels::new(&plain, &whiteners);
    assert_eq!((levels.problems.len(), levels.load_error(0)), (6, 0.0));
    let x = DVector::from_vec(vec![0.3, -0.4]);
    let unlevelled = plain.linear(&unknowns(2), x.clone()).unwrap();
    let n = whitener.entries.len();
    let r0 = &unlevelled.residuals + &unlevelled.jacobian * &x;
    for (level, problem) in levels.problems.iter().enumerate() {
        let more = levels.load_error(level);
        assert!(level == 0 || (more > levels.load_error(level - 1) && more < 0.01));
        let scale = [(9e-6 + more * more).sqrt(), (25e-6 + 0.25 * more * more).sqrt()];
        let u = DMatrix::from_fn(n, truth.ncols(), |i, k| truth[(i, k)] * scale[k % 2]);
        let a = &unlevelled.jacobian;
        let c = DMatrix::identity(n, n) + &u * u.transpose() + a * a.transpose();
        for fit in [problem.linear(&unknowns(2), x.clone()), problem.relevel(&unlevelled)] {
            near(fit.unwrap().ln_evidence(), ln_likelihood(&c, &r0), 1e-5);
        }
        // readings are expected with the common errors that they most likely have
        let common = &u * u.transpose();
        let likely = &common * (DMatrix::identity(n, n) + &common).lu().solve(&unlevelled.residuals).unwrap();
        let alone = model.predict(&unknowns(2), x.as_slice()).unwrap();
        let expected = levels.expected(&unlevelled, level).unwrap();
        let beyond: Vec<f64> = whitener
            .entries
            .iter()
            .map(|e| e.condition * CHANNELS + e.channel)
            .map(|at| (expected[at] - alone[at]) / s)
            .collect();
        assert!(likely.amax() > 0.1);
        close(&beyond, likely.as_slice(), 1e-6);
    }

    // and disturbances of all readings beside them
    let v = DMatrix::from_fn(n, 3, |_, _| 2.0 * normal(&mut rng));
    let disturbed = levels::disturbed(&whiteners, &v);
    let disturbed = Levels::new(&plain, &disturbed);
    for (level, problem) in disturbed.problems.iter().enumerate() {
        let more = levels.load_error(level);
        let scale = [(9e-6 + more * more).sqrt(), (25e-6 + 0.25 * more * more).sqrt()];
        let u = DMatrix::from_fn(n, truth.ncols(), |i, k| truth[(i, k)] * scale[k % 2]);
        let a = &unlevelled.jacobian;
        let c = DMatrix::identity(n, n) + &u * u.transpose() + &v * v.transpose() + a * a.transpose();
        let fit = problem.linear(&unknowns(2), x.clone()).unwrap();
        near(fit.ln_evidence(), ln_likelihood(&c, &r0), 1e-5);
    }

    // inner products are left by what shrinking takes
    for (level, whitener) in whiteners.iter().enumerate() {
        for whitener in [whitener, &levels::disturbed(&whiteners, &v)[level]] {
            let lost = whitener.lost(&unlevelled.jacobian.transpose());
            let mut left = unlevelled.jacobian.clone();
            left.column_iter_mut().for_each(|mut column| whitener.shrink(column.as_mut_slice()));
            let whole = unlevelled.jacobian.tr_mul(&unlevelled.jacobian);
            close((left.tr_mul(&left) + &lost * lost.transpose()).as_slice(), whole.as_slice(), 1e-12);
        }
    }
}

#[test]
fn the_level_of_common_errors_is_the_most_likely() {
    let mut rng = fastrand::Rng::with_seed(16);
    let mut model = with_common_errors(&mut rng);
    model.common.sd = vec![0.0; 2];
    let s = 0.1e-6;
    let mut data = simulated(&model, vec![0; 9], &[0.2, 0.1], s, 16);
    let whitener = Whitener::new(&data, &even(s));
    let u = common_columns(&model, &whitener, 1.0);
    let errors = DVector::from_fn(u.ncols(), |_, _| 4e-3 * normal(&mut rng));
    for (e, by) in whitener.entries.iter().zip((u * errors).iter()) {
        *data.readings[e.readings[0]].observed[e.channel].as_mut().unwrap() += by;
    }
    let plain = Problem::new(&data, &whitener, &model, RULES);
    let whiteners = levels::whiteners(&plain);
    let levels = Levels::new(&plain, &whiteners);
    let fits: Vec<Fit> = levels.problems.iter().map(|p| p.fit(&unknowns(2), &[0.0; 2]).unwrap()).collect();
    let evidence = |l: &usize| fits[*l].ln_evidence();
    let best = (0..6).max_by(|a, b| evidence(a).total_cmp(&evidence(b))).unwrap();
    assert!(best > 1 && best < 6);
    for start in [best - 1, best] {
        let (level, fit) = levels.fit(&unknowns(2), &[0.0; 2], start).unwrap();
        assert_eq!(level, best);
        close(fit.x.as_slice(), fits[best].x.as_slice(), 1e-4);
    }
}

/// Of a model without common errors all levels are one: the declared.
#[test]
fn without_common_errors_the_level_is_the_declared() {
    let model = Table::random(&mut fastrand::Rng::with_seed(8), 12, 3, 1e-6);
    let data = simulated(&model, vec![0; 12], &[-1.0, 0.5, 0.7], 0.3e-6, 12);
    let whitener = Whitener::new(&data, &even(0.3e-6));
    let plain = Problem::new(&data, &whitener, &model, RULES);
    let own = plain.fit(&unknowns(3), &[0.0; 3]).unwrap();
    let whiteners = levels::whiteners(&plain);
    let levels = Levels::new(&plain, &whiteners);
    for start in [0, 3] {
        let (level, fit) = levels.fit(&unknowns(3), &[0.0; 3], start).unwrap();
        assert_eq!(level, 0);
        assert_eq!(fit.ln_evidence(), own.ln_evidence());
    }
}

//! Errors and their intervals by definition and by coverage, cross-validation against models that have not seen a pose.

use pkm_diagnosis::validation::{self, Errors, LeftOut};
use pkm_diagnosis::{Noise, Rules, Whitener};

use crate::support::*;

const RULES: &Rules = &Rules::DEFAULT;

/// Errors of readings, given with predictions and poses in µm, one translation alone.
fn errors_of(squares: &[(usize, f64)]) -> Errors {
    let read = |n: usize| reading(n, n, [Some(1e-3), None, None, None, None, None]);
    let file = observations(squares.iter().map(|s| s.0).collect(), (0..squares.len()).map(read).collect());
    let said: Vec<f64> =
        squares.iter().flat_map(|(_, square)| [1e-3 + 1e-6 * square.sqrt(), 9.0, 9.0, 9.0, 9.0, 9.0]).collect();
    validation::errors(&file, &even(1e-6), &said, |_| true, RULES).unwrap()
}

#[test]
fn errors_are_root_mean_squares() {
    let some = |v: [f64; 6], blank: &[usize]| -> [Option<f64>; 6] {
        std::array::from_fn(|c| (!blank.contains(&c)).then_some(v[c] * 1e-6))
    };
    let file = observations(
        vec![0, 1, 2],
        vec![
            reading(0, 0, some([10.0, 20.0, -20.0, 5.0, 0.0, 0.0], &[4, 5])),
            reading(1, 1, some([0.0, 6.0, 8.0, 3.0, 4.0, 0.0], &[0])),
            reading(2, 2, some([1.0; 6], &[])),
        ],
    );
    let noise = Noise {
        within: vec![3e-6, 3e-6, 3e-6, 2e-6, 2e-6, 2e-6],
        between: vec![4e-6, 4e-6, 4e-6, 0.0, 0.0, 0.0],
        ..even(1.0)
    };
    let said = [[13.0, 20.0, -24.0, 5.0, 7.0, 7.0], [99.0, 6.0, 20.0, 6.0, 8.0, 0.0], [0.0; 6]]
        .map(|d: [f64; 6]| d.map(|v| v * 1e-6));
    let said = said.as_flattened();
    let found = validation::errors(&file, &noise, said, |n| n < 2, RULES).unwrap();
    assert_eq!(found.readings, 2);
    let [linear, angular] = [found.kinds[0], found.kinds[1]];
    near(1e6 * linear.rms, (169.0_f64 / 2.0).sqrt(), 1e-9);
    near(1e6 * linear.max, 12.0, 1e-9);
    near(linear.percent, 100.0 * (169.0_f64 / 1000.0).sqrt(), 1e-9);
    near(1e6 * angular.rms, 12.5_f64.sqrt(), 1e-9);
    near(angular.percent, 100.0 * 0.5_f64.sqrt(), 1e-9);
    near(found.chi2_per_dof, (169.0 / 25.0 + 25.0 / 4.0) / 9.0, 1e-9);
    assert!(linear.rms_interval.is_none());
    assert!(validation::errors(&file, &noise, said, |_| false, RULES).is_none());
    assert_eq!(errors_of(&[(0, 4.0)]).kinds[1].percent, 0.0);
}

/// Rotations that were read at every second reading err by as much as those of all of them.
#[test]
fn what_was_not_read_has_no_part_in_an_error() {
    let some =
        |n: usize| if n.is_multiple_of(2) { [Some(1e-3); 6] } else { [Some(1e-3), None, None, None, None, None] };
    let file = observations((0..20).collect(), (0..20).map(|n| reading(n, n, some(n))).collect());
    let said = [1.002e-3, 1e-3, 1e-3, 1.01e-3, 1e-3, 1e-3].repeat(20);
    let found = validation::errors(&file, &even(1.0), &said, |_| true, RULES).unwrap();
    assert_eq!(found.readings, 20);
    near(1e6 * found.kinds[0].rms, 2.0, 1e-9);
    near(1e6 * found.kinds[1].rms, 10.0, 1e-9);
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
    let [low, high] = found.kinds[0].rms_interval.unwrap().map(|v| 1e6 * v);
    assert!(high < 1e6 * found.kinds[0].max);
    for (end, t) in [(low, t[3899]), (high, t[99])] {
        let (found, truth) = (2.0 * end.ln() - middle, -t * error);
        assert!((found - truth).abs() < 0.1 * truth.abs(), "{found} instead of {truth}");
    }

    // four poses are too few; one that errs most leaves no upper end
    let few = |n: usize| {
        errors_of(&(0..n).map(|pose| (2 * pose, if pose == 0 { 1e4 } else { 1.0 + pose as f64 })).collect::<Vec<_>>())
    };
    assert!(few(4).kinds[0].rms_interval.is_none());
    let open = few(5);
    near(open.kinds[0].max, 100e-6, 1e-9);
    assert!(open.kinds[0].rms_interval.unwrap()[1] > open.kinds[0].max);

    // coverage: poses differ, and readings at each
    let held = (0..60).filter(|_| {
        let squares: Vec<(usize, f64)> = (0..14)
            .flat_map(|pose| {
                let size = (0.5 * normal(&mut rng)).exp();
                [0; 2].map(|_| (pose, size * (0..3).map(|_| normal(&mut rng).powi(2)).sum::<f64>()))
            })
            .collect();
        let [low, high] = errors_of(&squares).kinds[0].rms_interval.unwrap().map(|v| 1e6 * v);
        let truth = (3.0 * (0.125_f64).exp()).sqrt();
        low < truth && truth < high
    });
    let held = held.count();
    assert!((52..60).contains(&held), "{held} of 60");
}

#[test]
fn poses_are_predicted_by_models_that_have_not_seen_them() {
    let mut rng = fastrand::Rng::with_seed(41);
    let model = Table::random(&mut rng, 48, 2, 20e-6);
    let pose_of: Vec<usize> = (0..48).map(|n| n / 4).collect();
    let data = simulated(&model, pose_of.clone(), &[0.7, -0.4], 5e-6, 42);
    // two tables of predictions: of a fit, and of the number of readings that it had
    let refit = |is_left_out: &LeftOut<'_>| {
        let kept = data.without(|r| is_left_out(data.pose(r)));
        let whitener = Whitener::new(&kept, &even(5e-6));
        let fit = pkm_diagnosis::Problem::new(&kept, &whitener, &model, RULES).fit(&unknowns(2), &[0.0; 2])?;
        use pkm_diagnosis::ForwardModel;
        let said = model.predict(&fit.unknowns, fit.x.as_slice())?;
        let count = vec![kept.readings.len() as f64; said.len()];
        let left_out: Vec<usize> = (0..12).filter(|pose| is_left_out(*pose)).collect();
        Some((vec![said, count], left_out))
    };
    let (found, left_out) = validation::cross_validate(&data, RULES, refit).unwrap();
    // twelve poses in five folds: two of them hold three poses
    let fold_of = |pose: usize| left_out.iter().position(|poses| poses.contains(&pose)).unwrap();
    assert_eq!(left_out.iter().map(Vec::len).collect::<Vec<_>>(), [3, 3, 2, 2, 2]);
    for (condition, pose) in pose_of.iter().enumerate() {
        let (truth, _) = refit(&|other| fold_of(other) == fold_of(*pose)).unwrap();
        let own = condition * CHANNELS..(condition + 1) * CHANNELS;
        assert_eq!(found[0][own.clone()], truth[0][own.clone()]);
        assert_eq!(found[1][own.start], 48.0 - 4.0 * left_out[fold_of(*pose)].len() as f64);
    }
    assert!(validation::cross_validate::<()>(&data, RULES, |_| None).is_none());
}

/// A fold that holds a whole plane of a grid is predicted by extrapolation, and its error is none of what the model is used for.
#[test]
fn no_fold_is_a_plane_of_a_grid() {
    let mut rng = fastrand::Rng::with_seed(43);
    let grid: Vec<usize> = (0..125).collect();
    let data = simulated(&Table::random(&mut rng, 125, 1, 20e-6), grid.clone(), &[0.7], 5e-6, 44);
    let fold_of = validation::fold_of(&data, RULES);
    let folds = validation::folds(&data, RULES);
    for (axis, plane, fold) in (0..3).flat_map(|a| (0..5).flat_map(move |p| (0..folds).map(move |f| (a, p, f)))) {
        let in_plane = |pose: &&usize| **pose / 5_usize.pow(axis) % 5 == plane;
        let held = grid.iter().filter(in_plane).filter(|pose| fold_of[**pose] == fold).count();
        assert!(held <= 15, "fold {fold} holds {held} of 25 poses of plane {plane} across axis {axis}");
    }
}

/// Every search costs as much as there are readings: of many poses fewer folds say as much.
#[test]
fn many_poses_have_fewer_folds() {
    let mut rng = fastrand::Rng::with_seed(45);
    let mut of = |poses: usize| {
        let model = Table::random(&mut rng, poses, 1, 20e-6);
        let data = simulated(&model, (0..poses).collect(), &[0.7], 5e-6, 46);
        let fold_of = validation::fold_of(&data, RULES);
        let folds = validation::folds(&data, RULES);
        let left = |fold| fold_of.iter().filter(|of| **of != fold).count();
        (folds, (0..folds).map(left).min().unwrap())
    };
    assert_eq!([3, 5, 74, 75, 299, 300].map(&mut of), [(3, 2), (5, 4), (5, 59), (3, 50), (3, 199), (2, 150)]);
}

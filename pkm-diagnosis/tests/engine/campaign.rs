//! A campaign against the definition of detectability: dense matrices of the readings at the poses that were chosen.

use nalgebra::DMatrix;
use pkm_diagnosis::campaign::{Target, campaign};
use pkm_diagnosis::{Candidate, Kind, Problem, Role, Rules, Unknown, Whitener};

use crate::support::*;

const POSES: usize = 12;
const S: f64 = 2e-6;

/// Two declared values and two effects: the first shows everywhere, the second at poses 3 and 7 alone.
fn model() -> Table {
    let mut model = Table::random(&mut fastrand::Rng::with_seed(31), POSES * 2, 4, 4e-6);
    for role in &mut model.parameters[2..] {
        *role = parameter(Role::Amplitude { one_sided: false });
    }
    let is_shown = |n: usize| [3, 7].contains(&(n / CHANNELS / 2));
    model.columns[3].iter_mut().enumerate().for_each(|(n, v)| *v *= if is_shown(n) { 3.0 } else { 0.0 });
    model.candidates = [2, 3]
        .map(|n| Candidate {
            names: vec![format!("effect {n}")],
            kind: Kind::Effect,
            place: String::new(),
            unknowns: vec![Unknown(n)],
            start: Vec::new(),
            is_free: false,
        })
        .into();
    model
}

/// λ of a unit of an effect at some poses, from the covariance of their readings.
fn lambda(model: &Table, poses: &[usize], unknown: usize) -> f64 {
    let rows: Vec<usize> = (0..POSES * 2 * CHANNELS).filter(|n| poses.contains(&(n / CHANNELS / 2))).collect();
    let column = |u: usize| rows.iter().map(|n| model.columns[u][*n] / S).collect::<Vec<f64>>();
    let a = DMatrix::from_columns(&[0, 1].map(|u| column(u).into()));
    let c = DMatrix::from_column_slice(rows.len(), 1, &column(unknown));
    (c.transpose() * unexplained(&a) * &c)[0]
}

#[test]
fn poses_are_chosen_until_what_is_stated_is_found() {
    let model = model();
    let data = simulated(&model, (0..POSES * 2).map(|n| n / 2).collect(), &[0.0, 0.0], S, 32);
    let noise = even(S);
    let whitener = Whitener::new(&data, &noise);
    let problem = Problem::new(&data, &whitener, &model, &Rules::DEFAULT);
    let plan = |x: [f64; 2], most: usize| {
        let target = |candidate: usize| Target { candidate, unknown: Unknown(candidate + 2), x: x[candidate] };
        campaign(&problem, &[target(0), target(1)], 2, most).unwrap()
    };
    let detectable = Rules::DEFAULT.detectable;
    // as small as both poses together just show
    let both = (1.05 * detectable / lambda(&model, &[3, 7], 3)).sqrt();
    let found = plan([1.0, both], POSES);
    assert!(found.poses.contains(&3) && found.poses.contains(&7) && found.poses.len() < POSES, "{found:?}");
    let all: Vec<usize> = (0..POSES).collect();
    for (t, [first, end, grid]) in found.smallest.iter().enumerate() {
        let size = |poses: &[usize]| (detectable / lambda(&model, poses, t + 2)).sqrt();
        near(*first, size(&found.poses[..2]), 1e-6);
        near(*end, size(&found.poses), 1e-6);
        near(*grid, size(&all), 1e-6);
        assert!(end <= first && grid <= end);
    }
    assert!(found.smallest[1][1] <= both && found.smallest[0][1] <= 1.0);
    // what no pose shows does not keep it from ending, and no more poses are taken than may be
    assert!(plan([1.0, 1e-6], POSES).poses.len() < POSES);
    assert!(plan([1.0, both], 2).poses.len() == 2);
}

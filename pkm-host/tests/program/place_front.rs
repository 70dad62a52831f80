//! Pareto fronts on drawn jobs, against all positions of a grid of 0.25 mm with joints and times of its own.

use pkm_core::{CorrectionTable, JointValues};
use pkm_tests::seeded;
use serde_json::Value;

use crate::common::{Folder, fixture, json};
use crate::place_proof::{COUNT, Drawn, STEP, drawn, number, with_table};

/// Screws in m/s and m/s², wrist in rad/s and rad/s²: those of fixtures/jobs/limits.toml.
fn time_s(from: &JointValues<f64>, to: &JointValues<f64>) -> f64 {
    let turn = std::f64::consts::PI / 180.0;
    let screws = (to.lengths.q_m - from.lengths.q_m).map(|way| (way, 0.2, 2.0));
    let wrist = (to.beta_rad - from.beta_rad).map(|way| (way, 60.0 * turn, 400.0 * turn));
    let time = |(way, velocity, acceleration): &(f64, f64, f64)| {
        // as long as it takes to be as fast as may be, or to the middle; the rest at that speed
        let ramp = f64::min(velocity / acceleration, (way.abs() / acceleration).sqrt());
        let peak = ramp * acceleration;
        if peak == 0.0 { 0.0 } else { 2.0 * ramp + (way.abs() - peak * ramp) / peak }
    };
    screws.iter().chain(wrist.iter()).map(time).fold(0.0, f64::max)
}

/// The other objective and tip-worst of a position.
fn judged(drawn: &Drawn, other: &str, table: &CorrectionTable<'_, f64>, there: [f64; 2]) -> Option<[f64; 2]> {
    let [paper, tip] = drawn.costs(table, there)?;
    if other == "paper" {
        return Some([paper, tip]);
    }
    // least times to the postures of one hole after the other
    let mut before: Vec<(JointValues<f64>, f64)> = Vec::new();
    for hole in 0..3 {
        let here = drawn.postures(table, hole, there).into_iter().map(|(joints, _)| {
            let all = before.iter().map(|(from, so_far)| so_far + time_s(from, &joints));
            (joints, if hole == 0 { 0.0 } else { all.fold(f64::INFINITY, f64::min) })
        });
        before = here.collect();
    }
    Some([before.iter().map(|(_, time)| *time).fold(f64::INFINITY, f64::min), tip])
}

fn with_front(job: &str, other: &str) -> (Value, [String; 2]) {
    let folder = Folder::new();
    let (file, table, out) = (folder.write("job.toml", job), fixture("jobs/wide-table.json"), folder.path("out"));
    let limits = fixture("jobs/limits.toml");
    let mut args = vec!["place", "--job", &file, "--table", &table, "--step-mm", "2", "--pareto", other];
    args.extend(["--points", "6", "--out", &out]);
    if other == "cycle-time" {
        args.extend(["--limits", &limits]);
    }
    let document = json(&args);
    (document, ["placement.json", "report.html"].map(|name| folder.read(&format!("out/{name}"))))
}

fn array(v: &Value) -> &[Value] {
    v.as_array().unwrap_or_else(|| panic!("{v}"))
}

/// Holds a front against what its positions and all of the grid are worth; how many of its bounds would be found out if they were 2 %
/// too high.
fn holds(drawn: &Drawn, other: &str, document: &Value) -> [usize; 2] {
    let front = &document["pareto"]["series"][0];
    let (points, steps) = (array(&front["points"]), array(&front["proved"]));
    let pair = |point: &Value| [number(&point["value"]), number(&point["tip_um"])];
    let (first, last) = (&points[0], &points[points.len() - 1]);
    let entry = |objective: &str| {
        let all = array(&document["series"]).iter().find(|entry| entry["objective"] == objective);
        number(&all.expect("an end")["value"])
    };
    // one point alone is the best by both as far as values pass for the same
    let alike = if front["conflict"] == true { 1e-9 } else { 1e-6 };
    assert!((pair(first)[0] / entry(other) - 1.0).abs() <= alike, "{front}");
    assert!((pair(last)[1] / entry("tip-worst") - 1.0).abs() <= alike, "{front}");
    let mut found_out = 0;
    with_table(|table| {
        for point in points {
            let there = ["dx_mm", "dy_mm"].map(|key| number(&point[key]));
            let worth = judged(drawn, other, table, there).expect("in reach");
            assert!((0..2).all(|i| (worth[i] / pair(point)[i] - 1.0).abs() < 1e-6), "{worth:?} {point}");
            assert!(number(&point["certificate"]["gap"]) <= 1e-2, "{point}");
        }
        let at = |i: usize, n: usize| drawn.from_mm[i] + STEP * n as f64;
        let grid = (0..=COUNT[0]).flat_map(|i| (0..=COUNT[1]).map(move |j| [at(0, i), at(1, j)]));
        let grid: Vec<[f64; 2]> = grid.filter_map(|there| judged(drawn, other, table, there)).collect();
        assert!(grid.len() > 100, "{}", grid.len());
        let least = number(&front["value_at_least"]);
        let rounded = 1.0 + 1e-9;
        for [value, tip] in &grid {
            assert!(value * rounded >= least, "{value} {least}");
            for point in points {
                let [v, t] = pair(point);
                assert!(*value > v || *tip * rounded >= t * (1.0 - number(&point["certificate"]["gap"])), "{point}");
            }
        }
        for step in steps {
            let most = step["value_at_most"].as_f64().unwrap_or(f64::INFINITY);
            let below = grid.iter().filter(|[value, _]| *value <= most).map(|[_, tip]| *tip);
            let (tip, bound) = (below.fold(f64::INFINITY, f64::min), number(&step["tip_um_at_least"]));
            assert!(tip * rounded >= bound, "{step}: {tip}");
            found_out += usize::from(tip < 1.02 * bound);
        }
    });
    let ordered = points.windows(2).all(|w| pair(&w[0])[0] < pair(&w[1])[0] && pair(&w[0])[1] > pair(&w[1])[1]);
    assert!(ordered && !steps.is_empty(), "{front}");
    println!("{other}: {} points, {found_out} of {} bounds near the grid", points.len(), steps.len());
    [found_out, steps.len()]
}

fn fronts(other: &str, jobs: usize) {
    let (mut rng, mut tried, mut conflicts) = (seeded(), 0, 0);
    let mut all = [0; 2];
    // the paper's objective and tip-worst agree on most of them
    while tried < jobs || (conflicts == 0 && tried < 20 * jobs) {
        let drawn = drawn(&mut rng, &[3]);
        let (low, high) = (drawn.from_mm, drawn.to_mm);
        let corners = [low, high, [low[0], high[1]], [high[0], low[1]]];
        if with_table(|table| corners.iter().any(|there| drawn.costs(table, *there).is_none())) {
            continue;
        }
        tried += 1;
        let (document, files) = with_front(&drawn.job(), other);
        let found = holds(&drawn, other, &document);
        all = [0, 1].map(|i| all[i] + found[i]);
        conflicts += usize::from(document["pareto"]["series"][0]["conflict"] == true);
        if tried == 1 {
            assert_eq!(files, with_front(&drawn.job(), other).1, "not reproducible");
            assert!(files[1].contains("What less tip deflection takes") && !files[0].contains("NaN"));
        }
    }
    assert!(conflicts > 0, "none of {tried}");
    assert!(2 * all[0] > all[1], "a bound that is too high would hardly be found out: {all:?}");
}

#[test]
fn no_position_is_below_a_front_against_the_papers_objective() {
    fronts("paper", 3);
}

#[test]
fn no_position_is_below_a_front_against_the_cycle_time() {
    fronts("cycle-time", 3);
}

#[test]
fn where_nothing_is_to_be_chosen_a_front_is_one_point() {
    let drawn = drawn(&mut seeded(), &[3]);
    let [x, y] = [0, 1].map(|i| 0.5 * (drawn.from_mm[i] + drawn.to_mm[i]));
    let axis = |from: f64, to: f64| format!("{:?}", [from, to]);
    let job = drawn.job().replace(&axis(drawn.from_mm[0], drawn.to_mm[0]), &axis(x, x + 1e-3));
    let job = job.replace(&axis(drawn.from_mm[1], drawn.to_mm[1]), &axis(y, y + 1e-3));
    let front = &with_front(&job, "paper").0["pareto"]["series"][0];
    assert!(front["conflict"] == false && array(&front["points"]).len() == 1, "{front}");
}

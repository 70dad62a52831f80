//! Certified placement on drawn jobs, against every other method and a brute force of its own at 0.25 mm.

use std::f64::consts::PI;

use fastrand::Rng;
use nalgebra::{Vector2, Vector3};
use pkm_core::tables::reference::MACHINE_F64;
use pkm_core::{Configuration, CorrectionTable, Domain, JointValues, Pose, Tool, Wrench};
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_tests::seeded;
use serde_json::Value;

use crate::common::{FIVE, Folder, fixture, json};

/// Of the brute force, mm.
pub const STEP: f64 = 0.25;
/// Steps along dx and dy.
pub const COUNT: [usize; 2] = [40, 28];

pub struct Drawn {
    angle: f64,
    table_mm: [f64; 3],
    pub from_mm: [f64; 2],
    pub to_mm: [f64; 2],
    holes: Vec<Drilled>,
    /// Of each series, in the holes' order; several are placed together.
    counts: Vec<usize>,
}

pub struct Drilled {
    tip: [f64; 3],
    axis: [f64; 3],
    /// The same for each hole of a series, and its weight.
    wrench: Wrench<f64>,
    weight: f64,
}

pub fn drawn(rng: &mut Rng, counts: &[usize]) -> Drawn {
    let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
    let mut holes = Vec::new();
    for (n, count) in counts.iter().enumerate() {
        let force_n = Vector3::new(within(-50.0, 50.0), within(-50.0, 50.0), within(-500.0, -200.0));
        let wrench = Wrench { force_n, moment_nm: Vector3::new(0.0, 0.0, within(1.0, 8.0)) };
        let weight = if n == 0 { 1.0 } else { within(0.5, 2.0) };
        holes.extend((0..*count).map(|_| {
            let tip = [within(-70.0, 70.0), within(-70.0, 70.0), within(-20.0, 0.0)];
            Drilled { tip, axis: [within(-0.1, 0.1), within(-0.1, 0.1), -1.0], wrench, weight }
        }));
    }
    let angle = within(-PI, PI);
    let table_mm = [within(-230.0, -170.0), within(-80.0, 80.0), within(-10.0, 20.0)];
    let from_mm = [within(-40.0, 30.0), within(-40.0, 30.0)];
    let to_mm = [0, 1].map(|i| from_mm[i] + STEP * COUNT[i] as f64);
    Drawn { angle, table_mm, from_mm, to_mm, holes, counts: counts.to_vec() }
}

impl Drawn {
    pub fn job(&self) -> String {
        let ((sin, cos), [x, y, z]) = (self.angle.sin_cos(), self.table_mm);
        let axes = [0, 1].map(|i| [self.from_mm[i], self.to_mm[i]]);
        let mut job = format!(
            "format = 1\nbase_in_world = [[1,0,0,0],[0,-1,0,0],[0,0,-1,1140],[0,0,0,1]]\n\
             table_in_world = [[{cos},{},0,{x}],[{sin},{cos},0,{y}],[0,0,1,{z}],[0,0,0,1]]\n\
             cross_slide_in_world = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n\
             dx_mm = {:?}\ndy_mm = {:?}\n",
            -sin, axes[0], axes[1],
        );
        let several = self.counts.len() > 1;
        if several {
            job += "together = true\n";
        }
        let mut rest = self.holes.as_slice();
        for (n, count) in self.counts.iter().enumerate() {
            let (series, after) = rest.split_at(*count);
            rest = after;
            let holes =
                series.iter().map(|Drilled { tip, axis, .. }| format!("{{ tip_mm = {tip:?}, axis = {axis:?} }}"));
            let [fx, fy, fz, mx, my, mz]: [f64; 6] = series[0].wrench.to_vector().into();
            let weight = if several { format!("weight = {}\n", series[0].weight) } else { String::new() };
            job += &format!(
                "[[series]]\nname = \"S{n}\"\n{weight}holes = [{}]\n\
                 wrench = {{ fx_n = {fx}, fy_n = {fy}, fz_n = {fz}, mx_nm = {mx}, my_nm = {my}, mz_nm = {mz} }}\n",
                holes.collect::<Vec<_>>().join(", ")
            );
        }
        job
    }

    /// Turned by the table's angle, moved, and seen from the machine above.
    fn tool(&self, hole: usize, [dx, dy]: [f64; 2]) -> Tool<f64> {
        let ((sin, cos), Drilled { tip, axis, .. }) = (self.angle.sin_cos(), &self.holes[hole]);
        let turned = |v: &[f64; 3]| [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]];
        let ([x, y, z], [i, j, k]) = (turned(tip), turned(axis));
        let [tx, ty, tz] = self.table_mm;
        let tip_m = Vector3::new(x + tx + dx, -(y + ty + dy), 1140.0 - z - tz) / 1e3;
        Tool { tip_m, axis: Vector3::new(i, -j, -k) / (i * i + j * j + k * k).sqrt() }
    }

    /// The postures in the table's box that many starts find, with 1/Σk and µm of the tip, weighted.
    pub fn postures(
        &self,
        table: &CorrectionTable<'_, f64>,
        hole: usize,
        there: [f64; 2],
    ) -> Vec<(JointValues<f64>, [f64; 2])> {
        let (tool, Drilled { wrench, weight, .. }) = (&self.tool(hole, there), &self.holes[hole]);
        let mut found = Vec::new();
        for beta in [[0.0, -0.3], [1.2, -1.0], [-1.2, 0.1]] {
            let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
            let near = Configuration { pose, beta_rad: Vector2::from(beta) };
            let Ok(hold) = FIVE.inverse(tool, &near) else { continue };
            let pose = &hold.configuration.pose;
            if table.domain(pose) == Domain::Outside {
                continue;
            }
            let factor = table.factor_form(&MACHINE_F64, pose).expect("in the box").factor;
            let sum: f64 = factor.stiffness().principal().iter().sum();
            let moved = FIVE.deflection(Some(table), &hold.configuration, wrench).expect("a deflection");
            found.push((hold.joints, [weight / sum, weight * moved.translation_m.norm() * 1e6]));
        }
        found
    }

    /// Both where each is least.
    fn least(&self, table: &CorrectionTable<'_, f64>, hole: usize, there: [f64; 2]) -> Option<[f64; 2]> {
        let postures = self.postures(table, hole, there).into_iter().map(|(_, costs)| costs);
        postures.reduce(|least, costs| [0, 1].map(|i| f64::min(least[i], costs[i])))
    }

    /// The paper's objective and tip-worst.
    pub fn costs(&self, table: &CorrectionTable<'_, f64>, there: [f64; 2]) -> Option<[f64; 2]> {
        let costs = (0..self.holes.len()).map(|hole| self.least(table, hole, there)).collect::<Option<Vec<_>>>()?;
        let worst = costs.iter().map(|cost| cost[1]).fold(0.0, f64::max);
        Some([costs.iter().map(|cost| cost[0]).sum(), worst])
    }

    /// Both, each the least over the whole grid.
    fn brute_force(&self, table: &CorrectionTable<'_, f64>) -> Option<[f64; 2]> {
        let mut least = [f64::INFINITY; 2];
        for i in 0..=COUNT[0] {
            for j in 0..=COUNT[1] {
                let there = [self.from_mm[0] + STEP * i as f64, self.from_mm[1] + STEP * j as f64];
                let Some(costs) = self.costs(table, there) else { continue };
                least = [0, 1].map(|n| f64::min(least[n], costs[n]));
            }
        }
        least[1].is_finite().then_some(least)
    }
}

/// The reference machine's table over a wide box.
pub fn with_table<R>(then: impl FnOnce(&CorrectionTable<'_, f64>) -> R) -> R {
    let source = Source::read(fixture("jobs/wide-table.json").as_ref()).expect("a file");
    let numbers = TableFile::parse(&source).expect("a table").numbers();
    then(&numbers.table().expect("numbers"))
}

pub fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v}"))
}

/// `placement.json` of a job.
pub fn placed(job: &str, method: &str) -> Value {
    let folder = Folder::new();
    let (file, table, out) = (folder.write("job.toml", job), fixture("jobs/wide-table.json"), folder.path("out"));
    let args = ["place", "--job", &file, "--table", &table, "--method", method, "--seed", "1", "--step-mm", "2"];
    json(&[&args[..], &["--out", &out]].concat())
}

/// Where a certified entry claims no more than a brute force allows, and not much less.
fn holds(entry: &Value, brute: f64) {
    let (value, bound) = (number(&entry["value"]), number(&entry["certificate"]["lower_bound"]));
    assert!(number(&entry["certificate"]["gap"]) <= 1e-3, "{entry}");
    assert!(value <= brute * (1.0 + 1e-6) && bound <= brute, "{entry}: {brute}");
    // one that is too high by the gap and as much as the brute force leaves
    assert!(bound * 1.01 > brute, "{bound} {brute}");
}

#[test]
fn nothing_betters_a_certified_place_and_a_bound_that_is_too_high_is_found_out() {
    let (mut rng, mut jobs) = (seeded(), 0);
    while jobs < 5 {
        let drawn = drawn(&mut rng, &[3]);
        let Some(brute) = with_table(|table| drawn.brute_force(table)) else { continue };
        jobs += 1;
        let [certified, others @ ..] = ["certified", "grid", "ga", "de"].map(|method| placed(&drawn.job(), method));
        assert!(certified["together"].is_null());
        for (n, entry) in certified["series"].as_array().expect("entries").iter().enumerate() {
            holds(entry, brute[n]);
            let found = others.iter().map(|other| number(&other["series"][n]["value"]));
            let best = found.fold(f64::INFINITY, f64::min);
            let (value, bound) = (number(&entry["value"]), number(&entry["certificate"]["lower_bound"]));
            println!("{}: {value:.6e}, others {best:.6e}, bound {bound:.6e}", entry["objective"]);
            assert!(value <= best * (1.0 + 1e-6) && bound <= best, "{entry}: {best}\n{}", drawn.job());
        }
    }
}

#[test]
fn two_series_have_one_certified_position_and_each_pays_for_it() {
    let (mut rng, mut jobs) = (seeded(), 0);
    while jobs < 2 {
        let drawn = drawn(&mut rng, &[2, 1]);
        let Some(brute) = with_table(|table| drawn.brute_force(table)) else { continue };
        jobs += 1;
        let document = placed(&drawn.job(), "certified");
        for (n, entry) in document["together"].as_array().expect("entries").iter().enumerate() {
            holds(entry, brute[n]);
            let shares = entry["shares"].as_array().expect("one for each series");
            let weighted = shares.iter().map(|share| number(&share["weight"]) * number(&share["value"]));
            let value = if n == 0 { weighted.sum::<f64>() } else { weighted.fold(0.0, f64::max) };
            assert!((value / number(&entry["value"]) - 1.0).abs() < 1e-9, "{entry}");
            for (i, share) in shares.iter().enumerate() {
                let alone = &document["series"][2 * i + n]["value"];
                assert_eq!(&share["alone"], alone);
                assert!(number(&share["value"]) >= number(alone) * (1.0 - 1e-6), "{share}");
            }
        }
    }
}

/// A plate of 50 holes, drilled from about above, that may stand anywhere in the machine's reach.
fn plate(rng: &mut Rng) -> Drawn {
    let one = drawn(rng, &[1]);
    let wrench = one.holes[0].wrench;
    let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
    let holes = (0..50).map(|n| Drilled {
        tip: [20.0 * f64::from(n / 5) - 90.0, 20.0 * f64::from(n % 5) - 40.0, within(-20.0, 0.0)],
        axis: [within(-0.1, 0.1), within(-0.1, 0.1), -1.0],
        wrench,
        weight: 1.0,
    });
    Drawn { from_mm: [-300.0; 2], to_mm: [300.0; 2], holes: holes.collect(), counts: vec![50], ..one }
}

#[test]
fn nothing_about_the_certified_place_of_fifty_holes_or_far_from_it_is_better() {
    let mut rng = seeded();
    let drawn = plate(&mut rng);
    let document = placed(&drawn.job(), "certified");
    for (n, entry) in document["series"].as_array().expect("entries").iter().enumerate() {
        let [x, y] = ["dx_mm", "dy_mm"].map(|key| number(&entry[key]));
        let near = (-4..=4).flat_map(|i| (-4..=4).map(move |j| [x + STEP * f64::from(i), y + STEP * f64::from(j)]));
        let inside = |there: &[f64; 2]| (0..2).all(|i| (drawn.from_mm[i]..=drawn.to_mm[i]).contains(&there[i]));
        let far = (0..2000).map(|_| [0, 1].map(|_| 600.0 * rng.f64() - 300.0));
        let all: Vec<[f64; 2]> = near.filter(inside).chain(far).collect();
        let costs = with_table(|table| -> Vec<f64> {
            all.into_iter().filter_map(|there| drawn.costs(table, there)).map(|costs| costs[n]).collect()
        });
        assert!(costs.len() > 40, "{}", costs.len());
        println!("{}: {} of {} positions, {}", entry["objective"], entry["value"], costs.len(), entry["certificate"]);
        holds(entry, costs.into_iter().fold(f64::INFINITY, f64::min));
    }
}

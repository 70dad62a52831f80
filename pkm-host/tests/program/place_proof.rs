//! Certified placement on drawn jobs, against every other method and a brute force of its own at 0.25 mm.

use std::f64::consts::PI;

use fastrand::Rng;
use nalgebra::{Vector2, Vector3};
use pkm_core::tables::reference::MACHINE_F64;
use pkm_core::{Configuration, CorrectionTable, Domain, Pose, Tool, Wrench};
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_tests::seeded;
use serde_json::Value;

use crate::common::{FIVE, Folder, fixture, json};

/// Of the brute force, mm.
const STEP: f64 = 0.25;
/// Steps along dx and dy.
const COUNT: [usize; 2] = [40, 28];

struct Drawn {
    angle: f64,
    table_mm: [f64; 3],
    from_mm: [f64; 2],
    wrench: Wrench<f64>,
    /// Tip in mm, axis.
    holes: Vec<([f64; 3], [f64; 3])>,
}

fn drawn(rng: &mut Rng) -> Drawn {
    let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
    let holes = (0..3).map(|_| {
        let tip = [within(-70.0, 70.0), within(-70.0, 70.0), within(-20.0, 0.0)];
        (tip, [within(-0.1, 0.1), within(-0.1, 0.1), -1.0])
    });
    let holes = holes.collect();
    let force_n = Vector3::new(within(-50.0, 50.0), within(-50.0, 50.0), within(-500.0, -200.0));
    Drawn {
        angle: within(-PI, PI),
        table_mm: [within(-230.0, -170.0), within(-80.0, 80.0), within(-10.0, 20.0)],
        from_mm: [within(-40.0, 30.0), within(-40.0, 30.0)],
        wrench: Wrench { force_n, moment_nm: Vector3::new(0.0, 0.0, within(1.0, 8.0)) },
        holes,
    }
}

impl Drawn {
    fn job(&self) -> String {
        let ((sin, cos), [x, y, z]) = (self.angle.sin_cos(), self.table_mm);
        let axes = [0, 1].map(|i| [self.from_mm[i], self.from_mm[i] + STEP * COUNT[i] as f64]);
        let holes: Vec<_> =
            self.holes.iter().map(|(tip, axis)| format!("{{ tip_mm = {tip:?}, axis = {axis:?} }}")).collect();
        let [fx, fy, fz, mx, my, mz]: [f64; 6] = self.wrench.to_vector().into();
        format!(
            "format = 1\nbase_in_world = [[1,0,0,0],[0,-1,0,0],[0,0,-1,1140],[0,0,0,1]]\n\
             table_in_world = [[{cos},{},0,{x}],[{sin},{cos},0,{y}],[0,0,1,{z}],[0,0,0,1]]\n\
             cross_slide_in_world = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n\
             dx_mm = {:?}\ndy_mm = {:?}\n[[series]]\nname = \"A\"\nholes = [{}]\n\
             wrench = {{ fx_n = {fx}, fy_n = {fy}, fz_n = {fz}, mx_nm = {mx}, my_nm = {my}, mz_nm = {mz} }}\n",
            -sin,
            axes[0],
            axes[1],
            holes.join(", ")
        )
    }

    /// Turned by the table's angle, moved, and seen from the machine above.
    fn tool(&self, hole: usize, [dx, dy]: [f64; 2]) -> Tool<f64> {
        let ((sin, cos), (tip, axis)) = (self.angle.sin_cos(), self.holes[hole]);
        let turned = |v: [f64; 3]| [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]];
        let ([x, y, z], [i, j, k]) = (turned(tip), turned(axis));
        let [tx, ty, tz] = self.table_mm;
        let tip_m = Vector3::new(x + tx + dx, -(y + ty + dy), 1140.0 - z - tz) / 1e3;
        Tool { tip_m, axis: Vector3::new(i, -j, -k) / (i * i + j * j + k * k).sqrt() }
    }

    /// 1/Σk and µm of the tip where each is least, of the postures that many starts find.
    fn least(&self, table: &CorrectionTable<'_, f64>, tool: &Tool<f64>) -> Option<[f64; 2]> {
        let mut least: Option<[f64; 2]> = None;
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
            let moved = FIVE.deflection(Some(table), &hold.configuration, &self.wrench).expect("a deflection");
            let costs = [1.0 / sum, moved.translation_m.norm() * 1e6];
            least = Some(least.map_or(costs, |least| [0, 1].map(|i| f64::min(least[i], costs[i]))));
        }
        least
    }

    /// The paper's objective and tip-worst, each the least over the whole grid.
    fn brute_force(&self, table: &CorrectionTable<'_, f64>) -> Option<[f64; 2]> {
        let mut least = [f64::INFINITY; 2];
        for i in 0..=COUNT[0] {
            for j in 0..=COUNT[1] {
                let there = [self.from_mm[0] + STEP * i as f64, self.from_mm[1] + STEP * j as f64];
                let costs = (0..self.holes.len()).map(|hole| self.least(table, &self.tool(hole, there)));
                let Some(costs) = costs.collect::<Option<Vec<_>>>() else { continue };
                let sum = costs.iter().map(|cost| cost[0]).sum();
                let worst = costs.iter().map(|cost| cost[1]).fold(0.0, f64::max);
                least = [least[0].min(sum), least[1].min(worst)];
            }
        }
        least[1].is_finite().then_some(least)
    }
}

#[test]
fn nothing_betters_a_certified_place_and_a_bound_that_is_too_high_is_found_out() {
    let source = Source::read(fixture("jobs/wide-table.json").as_ref()).expect("a file");
    let numbers = TableFile::parse(&source).expect("a table").numbers();
    let table = numbers.table().expect("numbers");
    let number = |v: &Value| v.as_f64().unwrap_or_else(|| panic!("{v}"));
    let (mut rng, mut jobs) = (seeded(), 0);
    while jobs < 5 {
        let drawn = drawn(&mut rng);
        let Some(brute) = drawn.brute_force(&table) else { continue };
        jobs += 1;
        let folder = Folder::new();
        let file = folder.write("job.toml", &drawn.job());
        let search = |method: &str| {
            let table = fixture("jobs/wide-table.json");
            let out = folder.path(method);
            json(&[
                "place",
                "--job",
                &file,
                "--table",
                &table,
                "--method",
                method,
                "--seed",
                "1",
                "--step-mm",
                "2",
                "--out",
                &out,
            ])
        };
        let certified = search("certified");
        let others = ["grid", "ga", "de"].map(search);
        for (n, entry) in certified["series"].as_array().expect("entries").iter().enumerate() {
            let (value, certificate) = (number(&entry["value"]), &entry["certificate"]);
            let bound = number(&certificate["lower_bound"]);
            assert!(number(&certificate["gap"]) <= 1e-3, "{certificate}");
            let found = others.iter().map(|other| number(&other["series"][n]["value"])).chain([brute[n]]);
            let best = found.fold(f64::INFINITY, f64::min);
            println!("{}: {value:.6e}, others {best:.6e}, bound {bound:.6e}", entry["objective"]);
            assert!(value <= best * (1.0 + 1e-6) && bound <= best, "{entry}: {best}\n{}", drawn.job());
            // one that is too high by the gap and as much as the brute force leaves
            assert!(bound * 1.01 > brute[n], "{bound} {brute:?}");
        }
    }
}

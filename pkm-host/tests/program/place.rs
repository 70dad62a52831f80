//! `place` against a search of its own: matrices written out, postures from many starts, sums by hand.

use std::f64::consts::PI;

use fastrand::Rng;
use nalgebra::{Matrix4, Vector2, Vector3, Vector4};
use pkm_core::tables::reference::MACHINE_F64;
use pkm_core::{Configuration, Pose, Tool, ToolSolution, Wrench};
use serde_json::Value;

use crate::common::{FIVE, Folder, fixture, json, refused, run};

const WRENCH: Wrench<f64> = Wrench { force_n: Vector3::new(20.0, 0.0, -400.0), moment_nm: Vector3::new(0.0, 1.0, 5.0) };

fn place(job: &str, more: &[&str]) -> (Value, Folder) {
    let folder = Folder::new();
    let (file, out) = (folder.write("job.toml", job), folder.path("out"));
    let mut document = json(&[&["place", "--job", &file, "--out", &out], more].concat());
    // said on the way, and no part of the result
    document.as_object_mut().expect("an object").remove("warnings");
    assert_eq!(document, serde_json::from_str::<Value>(&folder.read("out/placement.json")).expect("JSON"));
    (document, folder)
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v}"))
}

/// Two holes and three on a slanted table under the machine.
const HOLES: [&[([f64; 3], [f64; 3])]; 2] = [
    &[([0.0, 0.0, 0.0], [0.0, 0.0, -1.0]), ([90.0, 30.0, -10.0], [0.1, 0.0, -2.0])],
    &[
        ([10.0, -60.0, 0.0], [0.0, 0.0, -1.0]),
        ([60.0, 20.0, 5.0], [0.0, 0.1, -1.0]),
        ([-20.0, 30.0, 0.0], [0.1, 0.1, -1.0]),
    ],
];

fn job(dx: [f64; 2], dy: [f64; 2], rotary: &str) -> String {
    let holes = |n: usize| {
        let all = HOLES[n].iter().map(|(tip, axis)| format!("{{ tip_mm = {tip:?}, axis = {axis:?} }}"));
        all.collect::<Vec<_>>().join(", ")
    };
    let wrench = "{ fx_n = 20, fy_n = 0, fz_n = -400, mx_nm = 0, my_nm = 1, mz_nm = 5 }";
    format!(
        "format = 1\nbase_in_world = [[1,0,0,0],[0,-1,0,0],[0,0,-1,1140],[0,0,0,1]]\n\
         table_in_world = [[0.8,-0.6,0,-80],[0.6,0.8,0,-60],[0,0,1,5],[0,0,0,1]]\n\
         cross_slide_in_world = [[0,1,0,500],[-1,0,0,300],[0,0,1,0],[0,0,0,1]]\n\
         dx_mm = {dx:?}\ndy_mm = {dy:?}\n{rotary}\n\
         [[series]]\nname = \"A\"\nwrench = {wrench}\nholes = [{}]\n\
         [[series]]\nname = \"B\"\nwrench = {wrench}\nholes = [{}]\n",
        holes(0),
        holes(1)
    )
}

/// Eq. 15 with the matrices of `job` written out; the rotary axis along z through (−80, −60).
fn tools(series: usize, dx: f64, dy: f64, angle: f64) -> Vec<Tool<f64>> {
    let base = Matrix4::new(1., 0., 0., 0., 0., -1., 0., 0., 0., 0., -1., 1140., 0., 0., 0., 1.);
    let table = Matrix4::new(0.8, -0.6, 0., -80., 0.6, 0.8, 0., -60., 0., 0., 1., 5., 0., 0., 0., 1.);
    let (sin, cos) = angle.sin_cos();
    let there = Matrix4::new(1., 0., 0., -80. + dx, 0., 1., 0., -60. + dy, 0., 0., 1., 0., 0., 0., 0., 1.);
    let turn = Matrix4::new(cos, -sin, 0., 0., sin, cos, 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.);
    let back = Matrix4::new(1., 0., 0., 80., 0., 1., 0., 60., 0., 0., 1., 0., 0., 0., 0., 1.);
    let all = base.try_inverse().expect("rigid") * there * turn * back * table;
    let seen = |v: [f64; 3], w: f64| all * Vector4::new(v[0], v[1], v[2], w);
    HOLES[series]
        .iter()
        .map(|(tip, axis)| {
            let (tip, axis) = (seen(*tip, 1.0) / 1e3, seen(*axis, 0.0));
            let size = axis.norm();
            Tool { tip_m: tip.xyz(), axis: axis.xyz() / size }
        })
        .collect()
}

fn at(theta_rad: f64, sigma_rad: f64, beta_rad: Vector2<f64>) -> Configuration<f64> {
    Configuration { pose: Pose { theta_rad, sigma_rad, z0_m: 0.53 }, beta_rad }
}

/// Principal stiffnesses and deflection of the tip in the posture that serves an objective best, of those that many starts find.
fn best(tool: &Tool<f64>, paper: bool) -> Option<([f64; 6], f64)> {
    let mut holds: Vec<ToolSolution<f64>> = Vec::new();
    for beta1 in [-1.2, 0.0, 1.2] {
        for beta2 in [-1.0, -0.3, 0.1] {
            holds.extend(FIVE.inverse(tool, &at(0.0, 0.0, Vector2::new(beta1, beta2))));
        }
    }
    let judged = holds.iter().map(|solution| {
        let k = MACHINE_F64.stiffness(&solution.configuration.pose).expect("a stiffness").principal().into();
        let d = FIVE.deflection(None, &solution.configuration, &WRENCH).expect("a deflection").translation_m;
        (k, d.iter().map(|v| v * v).sum::<f64>().sqrt())
    });
    let cost = |p: &([f64; 6], f64)| if paper { -p.0.iter().sum::<f64>() } else { p.1 };
    judged.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

/// Value in the file's unit, and mean stiffnesses.
fn value(series: usize, objective: &str, [dx, dy, angle]: [f64; 3]) -> Option<(f64, [f64; 6])> {
    let tools = tools(series, dx, dy, angle);
    let all: Vec<_> = tools.iter().map(|tool| best(tool, objective == "paper")).collect::<Option<_>>()?;
    let deflections = all.iter().map(|p| p.1 * 1e6);
    let value = match objective {
        "paper" => all.iter().map(|p| 1.0 / p.0.iter().sum::<f64>()).sum(),
        "tip-worst" => deflections.fold(0.0, f64::max),
        _ => deflections.sum::<f64>() / all.len() as f64,
    };
    Some((value, std::array::from_fn(|i| all.iter().map(|p| p.0[i]).sum::<f64>() / all.len() as f64)))
}

fn position(entry: &Value) -> [f64; 3] {
    [number(&entry["dx_mm"]), number(&entry["dy_mm"]), number(&entry["rotary_deg"]).to_radians()]
}

#[test]
fn the_grid_certifies_and_the_polish_is_the_best_known() {
    let (dx, dy) = ([-150.0, 150.0], [-100.0, 130.0]);
    let (document, _folder) =
        place(&job(dx, dy, ""), &["--step-mm", "10", "--objective", "paper", "tip-worst", "tip-mean"]);
    let mut rng = Rng::with_seed(7);
    let entries = document["series"].as_array().expect("entries");
    assert_eq!(entries.len(), 6);
    for entry in entries {
        let (series, objective) = (usize::from(entry["name"] == "B"), entry["objective"].as_str().expect("a name"));
        let (mut least, mut reached, mut all) = (f64::INFINITY, 0, 0);
        let mut extremes = [[f64::INFINITY, f64::NEG_INFINITY]; 6];
        for i in 0..=30 {
            for j in 0..=23 {
                all += 1;
                let here = [dx[0] + 10.0 * f64::from(i), dy[0] + 10.0 * f64::from(j), 0.0];
                let Some((value, k)) = value(series, objective, here) else { continue };
                reached += 1;
                least = least.min(value);
                for (k, extremes) in k.iter().zip(&mut extremes) {
                    *extremes = [extremes[0].min(*k), extremes[1].max(*k)];
                }
            }
        }
        let share = f64::from(reached) / f64::from(all);
        assert!((number(&entry["feasible_share"]) - share).abs() < 1e-12 && (0.1..0.99).contains(&share), "{share}");
        let certified = &entry["grid_certified"];
        assert!((number(&certified["value"]) / least - 1.0).abs() < 1e-9, "{objective}: {certified} {least}");
        assert!(number(&certified["step_mm"]) <= 10.0 + 1e-9);

        let found = position(entry);
        // on the edge of reach another start may just miss it
        let inwards = (0..200).find_map(|n| {
            let r = 1e-5 * f64::from(n) / 200.0;
            let angle = f64::from(n);
            value(series, objective, [found[0] + r * angle.cos(), found[1] + r * angle.sin(), 0.0])
        });
        let (there, k) = inwards.expect("in reach");
        assert!((number(&entry["value"]) / there - 1.0).abs() < 1e-6, "{objective}: {entry} {there}");
        let q = (0..6).map(|i| (extremes[i][1] - k[i]) / (extremes[i][1] - extremes[i][0])).sum::<f64>() / 6.0;
        assert!((number(&entry["q_ratio"]) - q).abs() < 1e-3, "{} {q}", entry["q_ratio"]);
        let mut beaten: f64 = 0.0;
        for _ in 0..3000 {
            let reach = 30.0 * 10f64.powf(-5.0 * rng.f64());
            let near: [f64; 2] = std::array::from_fn(|d| {
                let [low, high] = [dx, dy][d];
                (found[d] + reach * (2.0 * rng.f64() - 1.0)).clamp(low, high)
            });
            if let Some((v, _)) = value(series, objective, [near[0], near[1], 0.0]) {
                beaten = beaten.max(1.0 - v / number(&entry["value"]));
            }
        }
        assert!(beaten < 1e-6, "{objective} of {series} by {beaten}");
    }
}

#[test]
fn a_certificate_holds_against_the_grid_and_its_optimum_is_not_worse() {
    let plate = std::fs::read_to_string(fixture("jobs/plate.toml")).expect("a job");
    let job = plate.replace("dx_mm = [-400.0, 400.0]", "dx_mm = [-60.0, 60.0]");
    let job = job.replace("dy_mm = [-400.0, 400.0]", "dy_mm = [-50.0, 70.0]");
    assert!(job.contains("[-60.0, 60.0]") && job.contains("[-50.0, 70.0]"));
    let table = fixture("jobs/wide-table.json");
    let search = |method: &str| {
        let more = ["--table", &table, "--method", method, "--objective", "paper", "tip-worst", "--step-mm", "5"];
        place(&job, &more).0
    };
    let (certified, grid) = (search("certified"), search("grid"));
    let entries = certified["series"].as_array().expect("series");
    for (entry, other) in entries.iter().zip(grid["series"].as_array().expect("series")) {
        let (found, bound) = (number(&entry["value"]), number(&entry["certificate"]["lower_bound"]));
        assert!(other["certificate"].is_null());
        assert!(number(&entry["certificate"]["gap"]) <= 1e-3, "{}", entry["certificate"]);
        // the least of 625 positions, each computed by the core, and the best that is known
        assert!(bound <= number(&other["grid_certified"]["value"]) && bound <= number(&other["value"]), "{entry}");
        assert!(bound <= found && found <= number(&other["value"]) * (1.0 + 1e-6), "{found} {}", other["value"]);
    }
    let folder = Folder::new();
    let file = folder.write("job.toml", &job);
    let certify = ["place", "--job", &file, "--method", "certified", "--out", "/nowhere"];
    says(&certify, "give --table");
    says(&[&certify[..], &["--table", &table, "--allow-extrapolation"]].concat(), "leave --allow-extrapolation out");
    let preloaded = crate::common::reference_machine() + "[[effect]]\nid = \"preload\"\nlimbs_1_2_n = 500\n";
    let machine = folder.write("preloaded.toml", &preloaded);
    says(&[&certify[..], &["--machine", &machine, "--table", &table]].concat(), "preload|--method grid");
}

/// What the bars of a report's maps say, from low to high.
fn bars(report: &str) -> Vec<Vec<String>> {
    let maps = report.split("<g class=\"heat\"").skip(1).map(|map| map.split("</g></svg>").next().expect("a map"));
    maps.map(|map| {
        let labels =
            map.split("<rect").skip(1).filter_map(|shade| shade.split("<text").nth(1)?.split(['>', '<']).nth(1));
        labels.map(str::to_owned).collect()
    })
    .collect()
}

#[test]
fn colours_range_over_what_is_inside_the_box_and_what_is_extrapolated_is_striped() {
    let folder = Folder::new();
    json(&["fit", "--out", &folder.path("fit")]);
    let report = |name: &str, more: &[&str]| {
        let (table, out) = (folder.path("fit/coefficients.json"), folder.path(name));
        let args = ["place", "--objective", "tip-worst", "--step-mm", "20", "--table", &table, "--out", &out];
        json(&[&args[..], more].concat());
        folder.read(&format!("{name}/report.html"))
    };
    let (inside, beyond) = (report("inside", &[]), report("beyond", &["--allow-extrapolation"]));
    let found = bars(&inside);
    assert!(found.len() == 2 && found.iter().all(|labels| labels.len() == 5), "{found:?}");
    assert_eq!(bars(&beyond), found);
    let stripes = |report: &str| report.matches(" stroke=\"#FFFFFF\" stroke-width=\"1\"").count();
    let are_named = |report: &str| report.matches("striped: extrapolated").count();
    assert_eq!([stripes(&inside), stripes(&beyond)], [0, 2]);
    assert!(are_named(&inside) == 0 && are_named(&beyond) >= 2);
}

#[test]
fn slide_and_rotary_axis_are_certified_together() {
    let plate = std::fs::read_to_string(fixture("jobs/plate.toml")).expect("a job");
    let job = plate.replace("dx_mm = [-400.0, 400.0]", "dx_mm = [-60.0, -30.0]").replace(
        "dy_mm = [-400.0, 400.0]",
        "dy_mm = [-60.0, -20.0]\nrotary = { axis = [0, 0, 1], through_mm = [-220, -300, 0], range_deg = [-8, -2] }",
    );
    assert!(job.contains("[-60.0, -30.0]") && job.contains("[-60.0, -20.0]"));
    // series B alone
    let start = job.find("[[series]]").expect("a series");
    let job = job[..start].to_owned() + &job[job.rfind("[[series]]").expect("a series")..];
    let table = fixture("jobs/wide-table.json");
    let search = |method: &str| {
        let more = ["--table", &table, "--method", method, "--objective", "tip-worst", "--seed", "1"];
        place(&job, &[&more[..], &["--step-mm", "1", "--step-deg", "0.4"]].concat()).0["series"][0].clone()
    };
    let (certified, other) = (search("certified"), search("de"));
    let (found, bound) = (number(&certified["value"]), number(&certified["certificate"]["lower_bound"]));
    assert!(number(&certified["certificate"]["gap"]) <= 5e-3, "{}", certified["certificate"]);
    // the least of a grid, each position computed by the core, and the best that is known
    let known = number(&other["grid_certified"]["value"]).min(number(&other["value"]));
    assert!(bound <= known && found <= known * 1.005, "{found}, {bound}, {known}");
    // the bound says something: it is not far below what a search finds
    assert!(bound >= 0.99 * known, "{bound}, {known}");
}

#[test]
fn the_genetic_algorithm_comes_near_with_every_seed() {
    let job = job([-150.0, 150.0], [-100.0, 130.0], "");
    let (grid, _folder) = place(&job, &["--step-mm", "10"]);
    for seed in 0..20 {
        let seed = seed.to_string();
        let (found, _folder) = place(&job, &["--step-mm", "50", "--method", "ga", "--seed", &seed]);
        assert_eq!((&found["method"], found["seed"].to_string()), (&"ga".into(), seed));
        for (entry, best) in
            found["series"].as_array().expect("entries").iter().zip(grid["series"].as_array().expect("entries"))
        {
            let convergence = entry["convergence"].as_array().expect("a curve");
            let last = convergence.last().expect("a point");
            assert!(number(&last[0]) <= 5000.0);
            let off = number(&entry["value"]) / number(&best["value"]) - 1.0;
            assert!(
                (-1e-6..1e-3).contains(&off),
                "seed {}, {} of {}: {off}",
                found["seed"],
                entry["objective"],
                entry["name"]
            );
        }
    }
}

#[test]
fn a_rotary_axis_turns_the_table_alone_and_with_the_cross_slide() {
    let rotary = "rotary = { axis = [0, 0, 2], through_mm = [-80, -60, 0], range_deg = [-180, 180] }";
    let (alone, _folder) = place(&job([0.0; 2], [0.0; 2], rotary), &["--objective", "tip-worst"]);
    for (n, entry) in alone["series"].as_array().expect("entries").iter().enumerate() {
        let all = (0..3600).filter_map(|i| Some(value(n, "tip-worst", [0.0, 0.0, f64::from(i) * PI / 1800.0])?.0));
        let least = all.fold(f64::INFINITY, f64::min);
        assert!(number(&entry["value"]) <= least * (1.0 + 1e-9), "{entry} {least}");
        let there = value(n, "tip-worst", position(entry));
        assert!(there.is_none_or(|v| (v.0 / number(&entry["value"]) - 1.0).abs() < 1e-6));
        assert_eq!((number(&entry["dx_mm"]), number(&entry["dy_mm"])), (0.0, 0.0));
    }
    // one slide and the rotary axis, with a slide that reaches nothing at its one end
    let mixed = job(
        [-2000.0, 60.0],
        [0.0; 2],
        "rotary = { axis = [0, 0, 1], through_mm = [-80, -60, 0], range_deg = [-30, 30] }",
    );
    let (mixed, folder) = place(&mixed, &["--objective", "paper", "paper", "--step-deg", "2"]);
    assert_eq!(mixed["series"].as_array().expect("entries").len(), 2);
    assert!(folder.read("out/report.html").contains("rotary axis in °"));
    let both = job([-60.0, 60.0], [-60.0, 60.0], rotary);
    let (both, _folder) = place(&both, &["--objective", "tip-worst", "--seed", "3", "--step-deg", "3"]);
    assert_eq!(both["method"], "de");
    for (entry, alone) in
        both["series"].as_array().expect("entries").iter().zip(alone["series"].as_array().expect("entries"))
    {
        assert!(number(&entry["value"]) <= number(&alone["value"]), "{entry}");
        assert!(number(&entry["value"]) <= number(&entry["grid_certified"]["value"]) * (1.0 + 1e-9), "{entry}");
    }
}

#[test]
fn the_case_study_shows_what_the_papers_objective_misses() {
    let folder = Folder::new();
    let table = fixture("jobs/wide-table.json");
    let document = json(&["place", "--table", &table, "--step-mm", "5", "--out", &folder.path("out")]);
    let worst = |name: &str, objective: &str| {
        let entries = document["series"].as_array().expect("entries");
        let entry = entries.iter().find(|e| e["name"] == name && e["objective"] == objective).expect("there");
        assert!(entry["holes"].as_array().expect("holes").iter().all(|h| h["status"] == "ok"));
        let all = entry["holes"].as_array().expect("holes").iter().map(|h| number(&h["deflection_um"]));
        (all.fold(0.0, f64::max), entry["before"]["deflection_um"].clone())
    };
    for (name, least) in [("A", 10.0), ("B", 1.3)] {
        let ((paper, _), (tip, before)) = (worst(name, "paper"), worst(name, "tip-worst"));
        let before = before.as_array().expect("in reach from the middle").iter().map(number).fold(0.0, f64::max);
        println!("{name}: paper {paper:.1} µm, tip-worst {tip:.1} µm, before {before:.1} µm");
        assert!(paper > least * tip && before > tip, "{paper} {tip} {before}");
    }
    let report = folder.read("out/report.html");
    assert!(report.contains("Series A by tip-worst") && !report.contains("NaN"));
    // the holes of each placement have their numbers in the plan
    let numbers = report.split("class=\"numbers\"").skip(1).map(|rest| rest.split("</g>").next().unwrap());
    let counts: Vec<usize> = numbers.map(|group| group.matches("<text").count()).collect();
    let holes = document["series"].as_array().expect("entries").iter().map(|e| e["holes"].as_array().unwrap().len());
    assert_eq!(counts, holes.collect::<Vec<_>>());
}

#[test]
fn holes_that_are_held_worse_are_counted_once_for_each_alternative() {
    let folder = Folder::new();
    let plate = std::fs::read_to_string(fixture("jobs/plate.toml")).unwrap();
    let job = folder.write("job.toml", &plate.replacen("format = 1", "format = 1\ntogether = true", 1));
    let table = fixture("jobs/wide-table.json");
    let args = ["place", "--job", &job, "--table", &table, "--objective", "tip-worst", "--step-mm", "20", "--out"];
    let output = run(&[&args[..], &[&folder.path("out")]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let document: Value = serde_json::from_str(&folder.read("out/placement.json")).unwrap();
    let worse = |entries: &Value| {
        let of_entry = |entry: &Value| {
            let now = entry["holes"].as_array().unwrap().iter().map(|h| number(&h["deflection_um"]));
            let before = entry["before"]["deflection_um"].as_array().unwrap().iter().map(number);
            now.zip(before).filter(|(now, before)| *now > before * (1.0 + 1e-6)).count()
        };
        entries.as_array().unwrap().iter().map(of_entry).sum::<usize>()
    };
    let (apart, together) = (worse(&document["series"]), worse(&document["together"]));
    assert!(apart > 0 && together > 0, "{apart}, {together}");
    let said = format!(
        "{apart} of 7 holes are held worse than with the table in the middle where each series has its own position, \
         {together} of 7 holes in the one for series A + B."
    );
    assert!(text.contains(&said) && !text.contains("of 14"), "{text}");
}

#[test]
fn a_table_that_cannot_move_is_not_called_better() {
    let folder = Folder::new();
    let plate = std::fs::read_to_string(fixture("jobs/plate.toml")).unwrap();
    let job = folder.write("job.toml", &plate.replace("[-400.0, 400.0]", "[0.0, 0.0]"));
    let output = run(&["place", "--job", &job, "--out", &folder.path("out")]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("none was found that is better than the table in the middle"), "{text}");
}

#[test]
fn a_hole_behind_the_machine_is_not_blamed_on_its_axis_alone() {
    let folder = Folder::new();
    let plate = std::fs::read_to_string(fixture("jobs/plate.toml")).unwrap();
    let job = folder.write("job.toml", &plate.replace("[180.0, 260.0, 0.0]", "[180.0, 260.0, 700.0]"));
    says(
        &["place", "--job", &job, "--out", &folder.path("out")],
        "hole 1 of series `B`|its tip beside or behind the base",
    );
}

/// Refused with a message that has all of the words.
fn says(args: &[&str], words: &str) {
    let error = refused(args);
    let message = error["message"].as_str().expect("a message");
    assert!(words.split('|').all(|word| message.contains(word)), "{words}: {message}");
}

#[test]
fn bad_jobs_are_refused_with_their_place() {
    let good = job([-150.0, 150.0], [-100.0, 130.0], "");
    for (from, to, words) in [
        ("dx_mm = [-150.0, 150.0]", "dx_mm = [150.0, -150.0]", "job.toml:5|dx_mm|reversed"),
        ("[0.8,-0.6,0,-80]", "[0.8,-0.7,0,-80]", "job.toml:3|table_in_world|not rigid"),
        ("[1,0,0,0],[0,-1,0,0],[0,0,-1,1140]", "[1,0,0,0],[0,1,0,0],[0,0,-1,1140]", "base_in_world|reflection"),
        ("[0,0,0,1]]\ntable", "[0,0,0,2]]\ntable", "base_in_world|last row"),
        ("axis = [0.1, 0.0, -2.0]", "axis = [0.0, 0.0, 0.0]", "series.A.holes[2].axis|direction"),
        ("name = \"B\"", "name = \"A\"", "duplicate"),
        ("fx_n = 20", "fx_n = nan", "series.A.wrench|finite"),
        ("fx_n = 20", "fx_kn = 20", "fx_kn"),
        ("format = 1", "format = 2", "format|expected 1"),
        // what is not there has no line
        ("dx_mm = [-150.0, 150.0]\n", "", "job.toml: dx_mm: missing|least, greatest"),
        ("format = 1\n", "", "job.toml: format: missing"),
        ("dx_mm = [-150.0, 150.0]", "dx_mm = \"x\"", "job.toml:5: dx_mm: "),
        ("dx_mm = [-150.0, 150.0]", "dx_mm = [-1e300, 150.0]", "dx_mm|within"),
        ("cross_slide_in_world", "cross_in_world", "cross_in_world"),
        (
            "wrench = { fx_n = 20, fy_n = 0, fz_n = -400, mx_nm = 0, my_nm = 1, mz_nm = 5 }",
            "wrench = { fx_n = 0, fy_n = 0, fz_n = 0, mx_nm = 0, my_nm = 0, mz_nm = 0 }",
            "series.A.wrench|without a load",
        ),
        ("name = \"B\"", "name = \"B\"\nweight = 2", "series.B.weight|together = true"),
        ("format = 1", "format = 1\ntogether = 1", "job.toml:2|together"),
        ("name = \"B\"", "name = \"B\"\nweight = -2", "series.B.weight|expected 1e-3 to 1e3"),
        ("axis = [0.1, 0.0, -2.0]", "axis = [1e-320, inf, 0.0]", "series.A.holes[2].axis|direction"),
        ("tip_mm = [90.0, 30.0, -10.0]", "tip_mm = [90.0, 30.0]", "job.toml:11|expected 3 numbers, found 2"),
        ("tip_mm = [90.0, 30.0, -10.0]", "tip_mm = [90.0, 30.0, -900.0]", "hole 2 of series `A`|mm beyond its travel"),
        ("axis = [0.1, 0.0, -2.0]", "axis = [0.1, 0.0, 2.0]", "hole 2 of series `A`|out of reach"),
        (
            "tip_mm = [0.0, 0.0, 0.0], axis = [0.0, 0.0, -1.0] }, { tip_mm = [90.0",
            "tip_mm = [-300.0, 0.0, 0.0], axis = [0.0, 0.0, -1.0] }, { tip_mm = [350.0",
            "the best position reaches 1 of 2 holes|hole 2 is out of reach",
        ),
    ] {
        assert!(good.contains(from), "{from}");
        let folder = Folder::new();
        let file = folder.write("job.toml", &good.replacen(from, to, 1));
        says(&["place", "--job", &file, "--out", &folder.path("out"), "--step-mm", "50"], words);
        assert!(!folder.has("out"), "{to}");
    }
    let empty = good.split("[[series]]").next().expect("a head").to_owned() + "series = []\n";
    let no_holes = format!(
        "{}[[series]]\nname = \"A\"\nwrench = {{ fx_n = 0, fy_n = 0, fz_n = 0, mx_nm = 0, my_nm = 0, mz_nm = 0 }}\nholes = []\n",
        good.split("[[series]]").next().expect("a head")
    );
    for (job, words) in [(empty, "at least one [[series]]"), (no_holes, "has no holes")] {
        let folder = Folder::new();
        says(&["place", "--job", &folder.write("job.toml", &job), "--out", "/nowhere"], words);
    }
    for (args, words) in [
        (["--step-mm", "0"], "above 0"),
        (["--step-mm", "-5"], "above 0"),
        (["--step-mm", "1e-320"], "too fine"),
        (["--step-mm", "800"], "too coarse"),
    ] {
        says(&[&["place", "--out", "/nowhere"], &args[..]].concat(), words);
    }
}

#[test]
fn options_without_a_use_are_said() {
    let folder = Folder::new();
    let (file, out) = (folder.write("job.toml", &job([0.0, 40.0], [0.0, 40.0], "")), folder.path("out"));
    let said = |more: &[&str]| {
        let call = ["place", "--job", &file, "--step-mm", "20", "--out", &out];
        let document = json(&[&call[..], more].concat());
        let warnings = document["warnings"].as_array().map_or(&[][..], Vec::as_slice);
        ["--gap", "--seed"].map(|option| warnings.iter().any(|w| w.as_str().is_some_and(|w| w.contains(option))))
    };
    assert_eq!(said(&["--method", "grid", "--gap", "1", "--seed", "1"]), [true, true]);
    assert_eq!(said(&["--method", "grid"]), [false, false]);
    assert_eq!(said(&["--method", "de", "--seed", "1"]), [false, false]);
}

//! The command `map`, read as an engineer would read its files.

use std::collections::BTreeMap;
use std::path::Path;

use pkm_core::nalgebra::Vector3;
use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64, UNCERTAINTY_F64, WRIST};
use pkm_core::{CorrectionError, Domain, Wrench};
use pkm_host::error::status;
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use pkm_host::pose::pose_of;
use serde_json::Value;

use crate::common::{Folder, fixture, json, reference_machine, refused};

/// A row of the CSV.
struct Row {
    x0_mm: f64,
    z0_mm: f64,
    theta_deg: f64,
    sigma_deg: f64,
    status: String,
    inside: String,
    k: Option<[f64; 6]>,
    u95_um_per_kn: Option<f64>,
}

fn rows(folder: &Folder) -> Vec<Row> {
    let text = folder.read("out/map.csv");
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "x0_mm,z0_mm,theta_deg,sigma_deg,status,inside_domain,k11_n_per_m,k22_n_per_m,k33_n_per_m,\
         k44_nm_per_rad,k55_nm_per_rad,k66_nm_per_rad,u95_um_per_kn"
    );
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        assert_eq!(cells.len(), 13, "{line}");
        assert!(cells[6..12].iter().all(|c| c.is_empty()) || cells[6..12].iter().all(|c| !c.is_empty()), "{line}");
        Row {
            x0_mm: number(0),
            z0_mm: number(1),
            theta_deg: number(2),
            sigma_deg: number(3),
            status: cells[4].to_owned(),
            inside: cells[5].to_owned(),
            k: (!cells[6].is_empty()).then(|| std::array::from_fn(|i| number(6 + i))),
            u95_um_per_kn: (!cells[12].is_empty()).then(|| number(12)),
        }
    };
    lines.map(row).collect()
}

#[test]
fn every_row_is_what_the_core_says() {
    let folder = Folder::new();
    let out = folder.path("out");
    let document = json(&["map", "--out", &out, "--step-mm", "25", "--sigma-deg", "-8,0"]);
    let rows = rows(&folder);
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    for row in &rows {
        let pose = pose_of(row.theta_deg, row.sigma_deg, row.z0_mm);
        assert!((row.z0_mm * row.theta_deg.to_radians().tan() - row.x0_mm).abs() < 1e-9, "{}", row.x0_mm);
        assert_eq!((row.inside.as_str(), row.u95_um_per_kn), ("", None));
        match MACHINE_F64.stiffness(&pose).and_then(|k| k.factor()).map(|f| f.stiffness()) {
            Ok(k) => assert_eq!((row.status.as_str(), row.k), ("ok", Some(k.principal().into()))),
            Err(_) => {
                assert_eq!((row.status.as_str(), row.k), (status(MACHINE_F64.inverse(&pose).unwrap_err()), None))
            }
        }
        *counts.entry(row.status.clone()).or_default() += 1;
    }
    let said = |status: &str| -> u64 {
        document["maps"].as_array().unwrap().iter().map(|m| m["points"][status].as_u64().unwrap_or(0)).sum()
    };
    assert!(counts["ok"] > 500 && counts["out_of_travel"] > 500 && counts["unreachable"] > 50, "{counts:?}");
    assert!(counts.iter().all(|(status, n)| said(status) == *n), "{counts:?} is not in {document}");
    for map in document["maps"].as_array().unwrap() {
        let at_sigma = rows.iter().filter(|r| Some(r.sigma_deg) == map["sigma_deg"].as_f64()).filter_map(|r| r.k);
        let greatest = at_sigma.map(|k| k[5]).fold(0.0, f64::max);
        assert_eq!(map["stiffness"]["k66_nm_per_rad"]["greatest"]["value"].as_f64(), Some(greatest));
    }
    let names: Vec<_> = document["files"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let mut expected = vec!["map-sigma--8.svg", "map-sigma-0.svg", "map.csv", "report.html"];
    if cfg!(feature = "png") {
        expected.insert(1, "map-sigma--8.png");
        expected.insert(3, "map-sigma-0.png");
    }
    assert_eq!(names, expected);
    assert_eq!(folder.contents().len(), expected.len());
}

#[test]
fn the_window_is_the_whole_workspace() {
    // (machine file, σ): the extent of all poses on a fine grid of the half plane that screws and arms can span
    let narrow = reference_machine().replace("[420.0, 420.0, 420.0]", "[500.0, 500.0, 640.0]");
    let narrow = narrow.replace("[770.0, 770.0, 770.0]", "[506.0, 506.0, 646.0]");
    let folder = Folder::new();
    let out = folder.path("out");
    let narrow_path = folder.write("narrow.toml", &narrow);
    let reference = fixture("machines/reference.toml");
    let x150 = fixture("machines/x150.toml");
    for (path, sigma, reach_mm, every_mm) in [
        (&reference, 0.0, 900.0, 1.0),
        (&reference, 14.0, 900.0, 1.0),
        (&x150, 0.0, 300.0, 0.2),
        (&x150, -6.0, 300.0, 0.2),
        (&narrow_path, 0.0, 900.0, 0.5),
    ] {
        let machine = MachineFile::parse(Source::read(Path::new(path)).unwrap()).unwrap().machine;
        let mut extent = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let count = (reach_mm / every_mm) as i32;
        for x in -count..=count {
            for z in 1..=count {
                let at = [x, z].map(|n| f64::from(n) * every_mm);
                if machine.inverse(&pose_of(at[0].atan2(at[1]).to_degrees(), sigma, at[1])).is_ok() {
                    for (range, at) in extent.iter_mut().zip(at) {
                        *range = [range[0].min(at), range[1].max(at)];
                    }
                }
            }
        }
        let document = json(&["map", "--out", &out, "--machine", path, "--sigma-deg", &sigma.to_string()]);
        let map = &document["maps"][0];
        let step = map["step_mm"].as_f64().unwrap();
        for (name, [low, high]) in ["x0_mm", "z0_mm"].iter().zip(extent) {
            let [found_low, found_high] = [0, 1].map(|i| map[name][i].as_f64().unwrap());
            assert!(found_low <= low && low - found_low < step + 1.0, "{path} {sigma} {name}: {found_low} for {low}");
            assert!(
                found_high >= high && found_high - high < step + 1.0,
                "{path} {sigma} {name}: {found_high} for {high}"
            );
        }
    }
}

#[test]
fn a_table_corrects_and_says_where_it_was_fitted() {
    let folder = Folder::new();
    let out = folder.path("out");
    let table = folder.table();
    for form in ["auto", "diagonal"] {
        let document = json(&["map", "--out", &out, "--table", &table, "--form", form, "--step-mm", "15"]);
        assert_eq!(document["model"], if form == "auto" { "factor" } else { form });
        let mut seen = [0; 2];
        let mut greatest = 0.0_f64;
        for row in rows(&folder) {
            let pose = pose_of(row.theta_deg, row.sigma_deg, row.z0_mm);
            let corrected = match form {
                "diagonal" => TABLE_F64.diagonal_form(&MACHINE_F64, &pose),
                _ => TABLE_F64.factor_form(&MACHINE_F64, &pose),
            };
            match corrected {
                Ok(c) => {
                    let inside = c.domain == Domain::Inside;
                    assert_eq!(row.k, Some(c.factor.stiffness().principal().into()));
                    assert_eq!(row.inside, inside.to_string());
                    assert_eq!(row.status, if inside { "ok" } else { "outside_box" });
                    seen[usize::from(inside)] += 1;
                    // of the diagonal form nobody says how far it may be off
                    assert_eq!(row.u95_um_per_kn.is_some(), form == "auto");
                    let tip_m = WRIST.tip_at_zero_m();
                    let u95 = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
                        let force = Wrench { force_n: axis * 1e3, ..Wrench::ZERO };
                        let known = TABLE_F64.tip_uncertainty(&UNCERTAINTY_F64, &c.factor, &pose, &force, tip_m);
                        known.unwrap().variance_m2.sum().sqrt() * 1.96e6
                    });
                    let expected = u95.into_iter().fold(0.0, f64::max);
                    if let Some(found) = row.u95_um_per_kn {
                        assert!((found - expected).abs() < 1e-9 * expected, "{found} is not {expected}");
                        greatest = greatest.max(if inside { found } else { 0.0 });
                    }
                }
                Err(CorrectionError::NotPositive { .. }) => {
                    assert_eq!((row.status.as_str(), row.k), ("no_stiffness", None))
                }
                Err(_) => assert!(row.k.is_none() && row.inside.is_empty()),
            }
        }
        assert!(seen[0] > 500 && seen[1] > 50, "{seen:?}");
        let said = &document["maps"][0]["u95_um_per_kn"];
        assert_eq!(said["greatest"]["value"].as_f64(), (form == "auto").then_some(greatest), "{said}");
        let svg = folder.read("out/map.svg");
        assert_eq!(svg.contains("U95 of the tip in µm/kN"), form == "auto");
        assert!(svg.contains("box of the table") && svg.contains("extrapolated"));
        let over = |scope: &str| document["claims"].as_array().unwrap().iter().filter(|c| c["over"] == scope).count();
        assert_eq!([over("workspace"), over("box of the table")], [7, 7]);
    }
}

#[test]
fn claims_can_be_repeated_from_the_csv() {
    let folder = Folder::new();
    let out = folder.path("out");
    let document = json(&["map", "--out", &out, "--step-mm", "10"]);
    let rows: Vec<Row> = rows(&folder).into_iter().filter(|r| r.k.is_some()).collect();
    let claim = |words: &str| {
        let claims = document["claims"].as_array().unwrap();
        claims.iter().find(|c| c["claim"].as_str().unwrap().contains(words)).unwrap()
    };
    let close = |found: &Value, expected: f64| {
        let found = found.as_f64().unwrap();
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} is not {expected}");
    };
    let (low, high) = rows.iter().fold((f64::MAX, f64::MIN), |(l, h), r| (l.min(r.x0_mm), h.max(r.x0_mm)));
    let third = (high - low) / 3.0;
    let mean = |k: usize, take: &dyn Fn(f64) -> bool| {
        let taken: Vec<f64> = rows.iter().filter(|r| take(r.x0_mm)).map(|r| r.k.unwrap()[k]).collect();
        taken.iter().sum::<f64>() / taken.len() as f64
    };
    for (words, k, name) in [("k11, k22, k33 are large", 1, "k22"), ("k66 is large", 5, "k66")] {
        let figures = &claim(words)["figures"][name];
        close(&figures["mean_left"], mean(k, &|x| x < low + third));
        close(&figures["mean_right"], mean(k, &|x| x >= low + 2.0 * third));
    }
    let holds = mean(5, &|x| x < low + third) > mean(5, &|x| x >= low + third && x < low + 2.0 * third)
        && mean(5, &|x| x < low + third) > mean(5, &|x| x >= low + 2.0 * third);
    assert_eq!(claim("k66 is large")["holds"], holds);

    let by_place: BTreeMap<(i64, i64), [f64; 6]> =
        rows.iter().map(|r| ((r.x0_mm as i64, r.z0_mm as i64), r.k.unwrap())).collect();
    for (k, name) in ["k11", "k22", "k33"].into_iter().enumerate() {
        let pairs: Vec<bool> =
            by_place.iter().filter_map(|((x, z), here)| Some(by_place.get(&(*x, z + 10))?[k] < here[k])).collect();
        let share = pairs.iter().filter(|falls| **falls).count() as f64 / pairs.len() as f64;
        close(&claim("fall with growing Z0")["figures"][name]["falls_with_z0_share"], share);
    }
    let mean_log = rows.iter().map(|r| (r.k.unwrap()[2] / r.k.unwrap()[0]).ln()).sum::<f64>() / rows.len() as f64;
    close(&claim("order of magnitude")["figures"]["k33/k11"]["geometric_mean"], mean_log.exp());
    let arm = |r: &Row| {
        let k = r.k.unwrap();
        (k[3].max(k[4]).max(k[5]) / k[0].min(k[1]).min(k[2])).sqrt()
    };
    let least = rows.iter().map(arm).fold(f64::MAX, f64::min);
    close(&claim("better than rotational")["figures"]["equal_at_arm_m"]["least"], least);
}

/// A number of an SVG element on its own line.
fn attribute(line: &str, name: &str) -> i32 {
    let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap();
    rest.split('"').next().unwrap().parse().unwrap()
}

/// A filled shape of a picture: its corners and its colour.
struct Shape<'a> {
    corners: Vec<[f64; 2]>,
    fill: &'a str,
}

/// The filled shapes of a picture, in the order in which they are painted.
fn shapes(svg: &str) -> Vec<Shape<'_>> {
    let text = |line: &'_ str, name: &str| -> Option<String> {
        Some(line.split_once(&format!(" {name}=\""))?.1.split('"').next()?.to_owned())
    };
    let shape = |line| {
        let fill: &str = str::split(line, " fill=\"").nth(1)?.split('"').next()?;
        let corners = if line.starts_with("<rect") {
            let [x, y, width, height] = ["x", "y", "width", "height"].map(|name| f64::from(attribute(line, name)));
            vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
        } else if line.starts_with("<polygon") {
            let points = text(line, "points")?;
            let corner = |point: &str| point.split_once(',').map(|(x, y)| [x, y].map(|v| v.parse().unwrap()));
            points.split_whitespace().map(|point| corner(point).unwrap()).collect()
        } else {
            return None;
        };
        (fill != "none").then_some(Shape { corners, fill })
    };
    svg.lines().filter_map(shape).collect()
}

/// The winding number of a polygon about a point is not 0, which is where SVG fills it.
fn covers(shape: &Shape<'_>, [x, y]: [f64; 2]) -> bool {
    let ends = shape.corners.iter().zip(shape.corners.iter().cycle().skip(1));
    let winding = ends.map(|(from, to)| {
        let left = (to[0] - from[0]) * (y - from[1]) - (x - from[0]) * (to[1] - from[1]) > 0.0;
        i32::from(from[1] <= y && y < to[1] && left) - i32::from(to[1] <= y && y < from[1] && !left)
    });
    winding.sum::<i32>() != 0
}

#[test]
fn colours_of_the_picture_are_the_values_of_the_csv() {
    let folder = Folder::new();
    let out = folder.path("out");
    json(&["map", "--out", &out, "--step-mm", "12"]);
    let svg = folder.read("out/map.svg");
    assert!(
        svg.contains("direct singularity of limb 3") && svg.contains("box of the machine") && svg.contains("σ = 0°")
    );
    assert!(!svg.contains("extrapolated"));
    let shapes = shapes(&svg);
    // in the middle of a pixel
    let colour = |x: i32, y: i32| {
        let at = [f64::from(x) + 0.5, f64::from(y) + 0.5];
        shapes.iter().rev().find(|shape| covers(shape, at)).map(|shape| shape.fill).unwrap()
    };
    let rows = rows(&folder);
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);

    // frames come in pairs: the plane and its colour bar
    let frames: Vec<&str> = svg.lines().filter(|l| l.starts_with("<rect") && l.contains("fill=\"none\"")).collect();
    assert_eq!(frames.len(), 12);
    for (k, pair) in frames.chunks(2).enumerate() {
        let [x, y, width, height] = ["x", "y", "width", "height"].map(|a| attribute(pair[0], a));
        let [bar, top, bar_height] = ["x", "y", "height"].map(|a| attribute(pair[1], a));
        // the tick labels right of the bar, by height
        let labels: BTreeMap<i32, f64> = svg
            .split("<text ")
            .skip(1)
            .filter_map(|t| {
                let t = format!(" {t}");
                let (at_x, at_y) = (attribute(&t, "x"), attribute(&t, "y"));
                let near = (bar..bar + 80).contains(&at_x) && (top - 9..=top + bar_height + 9).contains(&at_y);
                let number = t.split_once('>')?.1.split('<').next()?.trim().parse().ok()?;
                near.then_some((at_y, number))
            })
            .collect();
        let (high, low) = (labels.first_key_value().unwrap().1, labels.last_key_value().unwrap().1);
        let mut bands: Vec<&str> = (1..=bar_height).map(|dy| colour(bar + 18, top + bar_height - dy)).collect();
        bands.dedup();
        let unit = if k < 3 { 1e6 } else { 1e3 };
        let mut checked = 0;
        for row in rows.iter().filter(|r| r.k.is_some()) {
            let px = x + (f64::from(width) * (row.x0_mm - first.x0_mm) / (last.x0_mm - first.x0_mm)) as i32;
            let py = y + height - (f64::from(height) * (row.z0_mm - first.z0_mm) / (last.z0_mm - first.z0_mm)) as i32;
            let here = colour(px.min(x + width - 2), py.max(y + 2));
            // the picture has borders of bands to a pixel and draws lines of several along them
            let inside = || [(-4, 0), (4, 0), (0, -4), (0, 4)].iter().all(|(dx, dy)| colour(px + dx, py + dy) == here);
            let Some(band) = bands.iter().position(|c| *c == here).filter(|_| inside()) else { continue };
            let part = (row.k.unwrap()[k] / unit - low) / (high - low) * bands.len() as f64;
            assert_eq!(part.floor() as usize, band, "k{0}{0} at {1}, {2}: {part}", k + 1, row.x0_mm, row.z0_mm);
            checked += 1;
        }
        assert!(checked > 500, "k{0}{0}: {checked} points of {1}", k + 1, rows.len());
    }
}

#[test]
#[cfg(feature = "png")]
fn the_png_is_as_large_as_the_drawing() {
    let folder = Folder::new();
    json(&["map", "--out", &folder.path("out"), "--step-mm", "15"]);
    let png = std::fs::read(folder.path("out/map.png")).unwrap();
    // the first chunk of a PNG begins with width and height
    assert_eq!(&png[..16], b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR");
    let [width, height] = [16, 20].map(|i| u32::from_be_bytes(png[i..i + 4].try_into().unwrap()));
    assert!(folder.read("out/map.svg").contains(&format!("viewBox=\"0 0 {width} {height}\"")));
}

#[test]
fn a_second_run_writes_the_same_bytes() {
    let folder = Folder::new();
    let out = folder.path("out");
    let machine = fixture("machines/x150.toml");
    json(&["map", "--out", &out, "--machine", &machine]);
    let first = folder.contents();
    assert_eq!(first.len(), if cfg!(feature = "png") { 4 } else { 3 });
    json(&["map", "--out", &out, "--machine", &machine]);
    assert!(first == folder.contents());
}

#[test]
fn bad_ranges_are_refused_and_nothing_is_written() {
    let folder = Folder::new();
    let out = folder.path("out");
    for (args, words) in [
        (&["--x0-mm", "5,5"][..], "--x0-mm: expected least,greatest"),
        (&["--z0-mm", "600,500"], "--z0-mm: expected least,greatest"),
        (&["--x0-mm", "1,2,3"], "expected 2 numbers"),
        (&["--x0-mm", "0,NaN"], "finite"),
        (&["--step-mm", "0"], "--step-mm"),
        (&["--step-mm", "-1"], "--step-mm"),
        (&["--step-mm", "5000"], "longer than the window"),
        (&["--step-mm", "0.01"], "more than"),
        (&["--x0-mm", "-1e300,1e300", "--step-mm", "1"], "within ±1e6"),
        (&["--x0-mm", "-1e6,1e6", "--step-mm", "1"], "more than"),
        (&["--x0-mm", "2000,3000"], "no stiffness at any"),
        (&["--z0-mm", "-900,-800"], "no stiffness at any"),
        (&["--sigma-deg", "90"], "--sigma-deg"),
        (&["--sigma-deg", "3,3"], "--sigma-deg"),
        (&["--sigma-deg", "80"], "takes no pose"),
        (&["--form", "factor"], "--table"),
    ] {
        let error = refused(&[&["map", "--out", &out], args].concat());
        let message = error["message"].as_str().unwrap();
        assert!(message.contains(words), "{args:?}: `{words}` is not in: {message}");
        assert!(!folder.has("out"), "{args:?}");
    }
}

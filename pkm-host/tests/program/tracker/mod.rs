//! A tracker's points: against campaigns that are simulated here with rotations of their own. `bad`: what is wrong with them. `gross`: single points.

mod bad;
mod gross;

use std::fmt::Write;

use nalgebra::{Matrix6, Vector6};
use pkm_host::files::import::Renames;
use pkm_host::files::points::PointList;
use pkm_host::files::reflectors::Reflectors;
use pkm_host::files::source::Source;
use pkm_host::pose::{NamedPose, pose_of};
use pkm_host::tracker::{self, Deflection, Task};
use pkm_tests::seeded;
use rayon::prelude::*;

use crate::common::{Folder, fixture, json, refused, run};
use crate::import::cells;
use crate::import::table::{Table, utf16, windows};

type V = [f64; 3];
type M = [V; 3];

fn times(m: &M, v: V) -> V {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn plus(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Rotation by a vector, from its quaternion.
fn turn(v: V) -> M {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let share = if angle > 0.0 { (angle / 2.0).sin() / angle } else { 0.5 };
    let (w, [x, y, z]) = ((angle / 2.0).cos(), v.map(|c| c * share));
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// A point of the platform in B, mm: R_y(θ) R_x(σ), A = (Z0 tan θ, 0, Z0).
fn in_b([theta_deg, sigma_deg, z0_mm]: V, uvw: V) -> V {
    let (theta, sigma) = (theta_deg.to_radians(), sigma_deg.to_radians());
    let turned = times(&turn([0.0, theta, 0.0]), times(&turn([sigma, 0.0, 0.0]), uvw));
    plus(turned, [z0_mm * theta.tan(), 0.0, z0_mm])
}

fn normal(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}

/// Where the tracker stands, and what its points err by.
struct Tracker {
    rotation: M,
    origin_mm: V,
    rng: fastrand::Rng,
}

impl Tracker {
    fn new(rng: fastrand::Rng) -> Self {
        Self { rotation: turn([0.4, -1.3, 2.1]), origin_mm: [1900.0, -700.0, 350.0], rng }
    }

    /// A point of B, moved with the base by a rotation vector and a translation in the tracker's frame.
    fn sees(&mut self, at_mm: V, [turned, moved]: [V; 2], sd_um: f64) -> V {
        let seen = plus(times(&self.rotation, at_mm), self.origin_mm);
        plus(times(&turn(turned), seen), moved).map(|v| v + sd_um / 1e3 * normal(&mut self.rng))
    }
}

/// A reflector: name, place in mm, on the platform, standard deviations of a coordinate in µm.
type Reflector = (&'static str, V, bool, f64);

/// Squares of 150 mm on the platform, some way from A.
const SQUARE: [Reflector; 4] = [
    ("R1", [75.0, 75.0, 0.0], true, 5.0),
    ("R2", [-75.0, 75.0, 0.0], true, 5.0),
    ("R3", [-75.0, -75.0, 0.0], true, 5.0),
    ("R4", [75.0, -75.0, 0.0], true, 5.0),
];
const UNEVEN: [Reflector; 8] = [
    ("R1", [90.0, 60.0, 140.0], true, 5.0),
    ("R2", [-75.0, 75.0, 120.0], true, 3.0),
    ("R3", [-60.0, -85.0, 110.0], true, 5.0),
    ("R4", [75.0, -75.0, 150.0], true, 9.0),
    ("G1", [320.0, 310.0, 0.0], false, 4.0),
    ("G2", [-300.0, 260.0, 15.0], false, 4.0),
    ("G3", [30.0, -390.0, -20.0], false, 6.0),
    ("G4", [380.0, -120.0, 25.0], false, 4.0),
];

fn reflectors_toml(reflectors: &[Reflector]) -> String {
    let mut text = "format = 1\n".to_owned();
    for (name, [a, b, c], on_platform, _) in reflectors {
        let (on, key) = if *on_platform { ("platform", "uvw_mm") } else { ("base", "xyz_mm") };
        let _ = write!(text, "[[reflector]]\nname = \"{name}\"\non = \"{on}\"\n{key} = [{a:?}, {b:?}, {c:?}]\n");
    }
    text
}

const POINTS_HEADER: &str = "reading,state,point,x_mm,y_mm,z_mm,u95_um\n";

/// Rows of a list of points: all reflectors in one state, the platform deflected by six components in µm and µrad, the base moved.
fn rows(
    tracker: &mut Tracker,
    reflectors: &[Reflector],
    pose: V,
    (reading, state): (&str, &str),
    deflection: [f64; 6],
    base: [V; 2],
) -> String {
    let [x, y, z, rx, ry, rz] = deflection;
    let mut text = String::new();
    for (name, place, on_platform, sd_um) in reflectors {
        let rotated = times(&turn([rx, ry, rz].map(|r| r * 1e-6)), *place);
        let at = if *on_platform { in_b(pose, plus(rotated, [x, y, z].map(|d| d / 1e3))) } else { *place };
        let [a, b, c] = tracker.sees(at, base, *sd_um);
        let _ = writeln!(text, "{reading},{state},{name},{a:.7},{b:.7},{c:.7},{}", 2.0 * sd_um);
    }
    text
}

/// One pose, unloaded points that two readings share.
struct Campaign {
    reflectors: Vec<Reflector>,
    /// Errors of unloaded points over those of loaded ones: they may be measured more often.
    unloaded: f64,
    /// What the base does between the states.
    base: [V; 2],
}

/// Errors of a campaign's two readings in µm and µrad, the covariance that is stated of them, and its share of the zero.
type Outcome = ([Vector6<f64>; 2], Matrix6<f64>, f64);

impl Campaign {
    fn run(&self, reflectors: &Reflectors, seed: u64) -> Outcome {
        const POSE: V = [7.0, -5.0, 540.0];
        const TRUTH: [[f64; 6]; 2] =
            [[120.0, -800.0, 60.0, 900.0, -300.0, 200.0], [-50.0, 30.0, 400.0, -100.0, 250.0, 700.0]];
        let mut t = Tracker::new(fastrand::Rng::with_seed(seed));
        let mut own = self.reflectors.clone();
        own.iter_mut().for_each(|r| r.3 *= self.unloaded);
        let mut points =
            POINTS_HEADER.to_owned() + &rows(&mut t, &own, POSE, ("s", "unloaded"), [0.0; 6], [[0.0; 3]; 2]);
        for (reading, truth) in ["a", "b"].iter().zip(TRUTH) {
            points += &rows(&mut t, &self.reflectors, POSE, (reading, "loaded"), truth, self.base);
        }
        let points = PointList::parse(Source::from_text("p.csv", points), reflectors, &Renames::default()).unwrap();
        let pose = NamedPose { id: "P".into(), line: 1, pose: pose_of(POSE[0], POSE[1], POSE[2]) };
        let tasks =
            ["a", "b"].map(|reading| Task { line: 2, reading: reading.into(), series: "s".into(), pose: &pose });
        let found = tracker::deflections(&tasks, reflectors, &points, "readings.csv").unwrap();
        let error = |n: usize| match &found.deflections[n] {
            Deflection::Whole(components, covariance, share) => {
                (components * 1e6 - Vector6::from(TRUTH[n]), **covariance * 1e12, *share)
            }
            Deflection::Points(_) => unreachable!("four reflectors"),
        };
        let ((a, covariance, share), (b, ..)) = (error(0), error(1));
        ([a, b], covariance, share)
    }
}

/// 10,000 campaigns, each registered by itself; U95 of a coordinate is 10 µm with the square, 6 to 18 µm with the other. Errors of two
/// readings that share their unloaded points go together as the share of the zero says.
#[test]
fn covariances_are_those_of_simulated_campaigns() {
    const CAMPAIGNS: u64 = 10_000;
    let mut rng = seeded();
    let square = Campaign { reflectors: SQUARE.to_vec(), unloaded: 0.5, base: [[0.0; 3]; 2] };
    let base = [[2e-6, -3e-6, 4e-6], [0.02, -0.01, 0.015]];
    let uneven = Campaign { reflectors: UNEVEN.to_vec(), unloaded: 1.0, base };
    for (campaign, truth) in [(square, 0.2), (uneven, 0.5)] {
        let seeds: Vec<u64> = (0..CAMPAIGNS).map(|_| rng.u64(..)).collect();
        let reflectors = Reflectors::parse(Source::from_text("r.toml", reflectors_toml(&campaign.reflectors))).unwrap();
        let all: Vec<Outcome> = seeds.into_par_iter().map(|seed| campaign.run(&reflectors, seed)).collect();
        let n = CAMPAIGNS as f64;
        let mean = all.iter().map(|c| c.0[0]).sum::<Vector6<f64>>() / n;
        let of = |k: usize| all.iter().map(|c| c.0[0] * c.0[k].transpose()).sum::<Matrix6<f64>>() / n;
        let (own, shared) = (of(0), of(1));
        let stated = all.iter().map(|c| c.1).sum::<Matrix6<f64>>() / n;
        let share = all.iter().map(|c| c.2).sum::<f64>() / n;
        assert!((share - truth).abs() < 1e-6, "{share}");
        let mut worst = 0.0_f64;
        for i in 0..6 {
            assert!(mean[i].abs() < 5.0 * (stated[(i, i)] / n).sqrt(), "biased: {mean}");
            for j in 0..6 {
                let unit = (stated[(i, i)] * stated[(j, j)]).sqrt();
                let off = [own[(i, j)] - stated[(i, j)], shared[(i, j)] - share * stated[(i, j)]];
                worst = off.iter().fold(worst, |worst, o| worst.max((o / unit).abs()));
            }
        }
        println!("covariances of {CAMPAIGNS} campaigns: within {:.1} %", 100.0 * worst);
        assert!(worst < 0.05, "{worst} of {stated}");
    }
}

/// Readings of a set, as a table of numbers by column name; texts are NaN.
fn table(text: &str) -> Vec<std::collections::HashMap<String, String>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let row = |r: csv::StringRecord| header.iter().map(str::to_owned).zip(r.iter().map(str::to_owned)).collect();
    reader.records().map(|r| row(r.unwrap())).collect()
}

const COMPONENTS: [&str; 6] = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];

fn number(row: &std::collections::HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap()
}

/// A set of the fixtures as a tracker sees it: readings without deflections, points, reflectors, in a folder.
fn as_points(set: &str, reflectors: &[Reflector], folder: &Folder, seed: u64) -> [String; 3] {
    let text = std::fs::read_to_string(fixture(&format!("measured/{set}/measured.csv"))).unwrap();
    let mut t = Tracker::new(fastrand::Rng::with_seed(seed));
    let still = [[0.0; 3]; 2];
    let (mut points, mut last) = (POINTS_HEADER.to_owned(), String::new());
    const KEPT: [&str; 12] = [
        "pose",
        "theta_deg",
        "sigma_deg",
        "z0_mm",
        "fx_n",
        "fy_n",
        "fz_n",
        "mx_nm",
        "my_nm",
        "mz_nm",
        "repeat",
        "direction",
    ];
    let mut readings = format!("reading,series,{}\n", KEPT.join(","));
    for (n, row) in table(&text).iter().enumerate() {
        let pose = ["theta_deg", "sigma_deg", "z0_mm"].map(|c| number(row, c));
        // names that are no names of readings
        let (reading, series) = (format!("r{n}"), format!("s{}", row["series"]));
        if series != last {
            points += &rows(&mut t, reflectors, pose, (&series, "unloaded"), [0.0; 6], still);
            last.clone_from(&series);
        }
        points += &rows(&mut t, reflectors, pose, (&reading, "loaded"), COMPONENTS.map(|c| number(row, c)), still);
        let _ = writeln!(readings, "{reading},{series},{}", KEPT.map(|c| row[c].clone()).join(","));
    }
    [
        folder.write("points.csv", &points),
        folder.write("reflectors.toml", &reflectors_toml(reflectors)),
        folder.write("readings.csv", &readings),
    ]
}

fn import(machine: &str, [points, reflectors, readings]: &[String; 3], out: &str) -> serde_json::Value {
    json(&[
        "import",
        "--machine",
        machine,
        "--points",
        points,
        "--reflectors",
        reflectors,
        "--readings",
        readings,
        "--out",
        out,
    ])
}

/// Points of no error but their rounding to 0.1 nm give the numbers of the file that they were made of.
#[test]
fn points_give_the_readings_that_they_were_made_of() {
    let folder = Folder::new();
    let exact: Vec<Reflector> = UNEVEN.iter().filter(|r| r.2).map(|r| (r.0, r.1, true, 1e-9)).collect();
    let files = as_points("p08", &exact, &folder, 1);
    let toml = folder.read("reflectors.toml").replace("format = 1", "format = 1\nu95_um = 10");
    folder.write("reflectors.toml", &toml);
    // its uncertainty is what the tracker's maker says
    let points: String =
        folder.read("points.csv").lines().map(|l| l.rsplit_once(',').unwrap().0.to_owned() + "\n").collect();
    folder.write("points.csv", &points);
    let machine = fixture("measured/p08/machine.toml");
    let said = import(&machine, &files, &folder.path("d.csv"));
    assert!(said["tracker"]["registration"]["rms_um"].as_f64().unwrap() < 1e-3, "{said}");
    let original = std::fs::read_to_string(fixture("measured/p08/measured.csv")).unwrap();
    let (found, original) = (table(&folder.read("d.csv")), table(&original));
    assert_eq!(found.len(), original.len());
    for (found, original) in found.iter().zip(&original) {
        for column in COMPONENTS {
            let off = (number(found, column) - number(original, column)).abs();
            assert!(off < 0.01, "{column}: {off}");
        }
    }
    let again = folder.read("d.csv");
    import(&machine, &files, &folder.path("d.csv"));
    assert_eq!(folder.read("d.csv"), again);
}

/// A tracker of 10 µm (U95) on the readings of p08: what yields is found as in the readings themselves, with reflectors 300 mm apart or with
/// 150 mm and a fifth of the uncertainty. At 150 mm and 10 µm the noise hides which part yields beside limb 1 (docs/limits.md).
#[test]
fn a_diagnosis_of_points_finds_what_the_readings_hold() {
    let machine = fixture("measured/p08/machine.toml");
    let wide = SQUARE.map(|(name, [u, v, _], ..)| (name, [2.0 * u, 2.0 * v, 120.0], true, 5.0));
    let precise = SQUARE.map(|(name, place, ..)| (name, place, true, 1.0));
    for (reflectors, has_platform, most) in [(wide, true, 0.5), (precise, true, 0.75), (SQUARE, false, 0.55)] {
        let folder = Folder::new();
        let files = as_points("p08", &reflectors, &folder, 2);
        import(&machine, &files, &folder.path("d.csv"));
        let (data, holdout, out) = (folder.path("d.csv"), fixture("measured/p08/heldout.csv"), folder.path("out"));
        let found = json(&["diagnose", "--machine", &machine, "--data", &data, "--holdout", &holdout, "--out", &out]);
        let effects = found["effects"].as_array().unwrap();
        let places: Vec<&str> = effects.iter().map(|e| e["where"].as_str().unwrap()).collect();
        let on_limb_1 = places.iter().filter(|p| p.starts_with("limb.1.")).count();
        let on_platform = places.iter().filter(|p| **p == "moving_platform").count();
        assert_eq!(
            (on_limb_1, on_platform, places.len()),
            (1, usize::from(has_platform), 1 + on_platform),
            "{places:?}"
        );
        let rms = |rival: &str| found["holdout"][rival]["linear_um_rms"].as_f64().unwrap();
        assert!(rms("after") < most * rms("retuned_only"), "{} {}", rms("after"), rms("retuned_only"));
    }
}

/// A reflector or two: translations of their own points, no rotation that nobody saw.
#[test]
fn one_or_two_reflectors_give_their_own_translations() {
    let original = std::fs::read_to_string(fixture("measured/p08/measured.csv")).unwrap();
    let original = table(&original);
    for count in [1, 2] {
        let folder = Folder::new();
        let few: Vec<Reflector> = UNEVEN[..count].iter().map(|r| (r.0, r.1, true, 1e-4)).collect();
        let files = as_points("p08", &few, &folder, 3);
        let text = folder.read("readings.csv");
        // where the load acts
        let acts = |(n, line): (usize, &str)| {
            format!("{line},{}\n", if n == 0 { "load_u_mm,load_v_mm,load_w_mm" } else { "0,0,30" })
        };
        folder.write("readings.csv", &text.lines().enumerate().map(acts).collect::<String>());
        let said = import(&fixture("measured/p08/machine.toml"), &files, &folder.path("d.csv"));
        assert_eq!(said["readings"], count * original.len());
        let found = table(&folder.read("d.csv"));
        for (n, row) in found.iter().enumerate() {
            let (name, place, ..) = few[n % count];
            let truth = &original[n / count];
            let [x, y, z, rx, ry, rz] = COMPONENTS.map(|c| number(truth, c));
            let rotated = times(&turn([rx, ry, rz].map(|r| r * 1e-6)), place);
            let moved: V = std::array::from_fn(|i| 1e3 * (rotated[i] - place[i]) + [x, y, z][i]);
            for i in 0..3 {
                assert!((number(row, COMPONENTS[i]) - moved[i]).abs() < 0.02, "{row:?}");
                assert_eq!(number(row, ["point_u_mm", "point_v_mm", "point_w_mm"][i]), place[i]);
                assert!(row[COMPONENTS[3 + i]].is_empty());
            }
            assert_eq!((row["load_w_mm"].as_str(), row["series"].ends_with(&format!(" {name}"))), ("30", true));
            assert_eq!(row["correlation_dx_dy"], "0.000000000");
        }
        // and it is read as any other file
        let checked = json(&["check", &folder.path("d.csv"), "--machine", &fixture("measured/p08/machine.toml")]);
        assert_eq!(checked["problems"], serde_json::json!([]));
    }
}

/// Reflectors that were put on the machine where there was room: the tracker tells where they are.
#[test]
fn reflectors_may_be_found_by_the_tracker() {
    let folder = Folder::new();
    let on_platform: Vec<Reflector> = UNEVEN.iter().filter(|r| r.2).copied().collect();
    let files = as_points("p08", &on_platform, &folder, 4);
    let machine = fixture("measured/p08/machine.toml");
    import(&machine, &files, &folder.path("known.csv"));
    let toml: String =
        folder.read("reflectors.toml").lines().filter(|l| !l.starts_with("uvw_mm")).map(|l| format!("{l}\n")).collect();
    folder.write("reflectors.toml", &toml);
    let said = import(&machine, &files, &folder.path("found.csv"));
    let located = said["tracker"]["located_reflectors"].as_array().unwrap();
    assert_eq!(located.len(), 4);
    for (found, (name, place, ..)) in located.iter().zip(&on_platform) {
        assert_eq!(found["name"], *name);
        (0..3).for_each(|i| assert!((found["uvw_mm"][i].as_f64().unwrap() - place[i]).abs() < 0.05, "{found}"));
    }
    let [known, found] = ["known.csv", "found.csv"].map(|file| table(&folder.read(file)));
    for (known, found) in known.iter().zip(&found) {
        COMPONENTS.iter().for_each(|c| assert!((number(known, c) - number(found, c)).abs() < 0.5, "{c}: {found:?}"));
    }
}

/// The base moved under each load, by more than the deflection: it is taken out, and reported.
#[test]
fn motion_of_the_base_is_taken_out() {
    let folder = Folder::new();
    let [points, reflectors, readings] =
        ["points.csv", "reflectors.toml", "readings.csv"].map(|f| fixture(&format!("tracker/{f}")));
    let said = json(&[
        "import",
        "--points",
        &points,
        "--reflectors",
        &reflectors,
        "--readings",
        &readings,
        "--out",
        &folder.path("d.csv"),
    ]);
    json(&["predict", "--data", &readings, "--out", &folder.path("p.csv")]);
    let base = said["tracker"]["base_motion"].as_array().unwrap();
    assert!(base.len() == 6 && base.iter().any(|b| b["translation_um"].as_f64().unwrap() > 20.0), "{base:?}");
    assert!(said["tracker"]["registration"]["points"] == 9, "the base's alone");
    // simulated with the deflection of the machine file
    let [found, truth] = ["d.csv", "p.csv"].map(|file| table(&folder.read(file)));
    for (found, truth) in found.iter().zip(&truth) {
        for column in COMPONENTS {
            let off = (number(found, column) - number(truth, column)) / number(found, &format!("sigma_{column}"));
            assert!(off.abs() < 4.0, "{column}: {off} standard deviations");
        }
    }
}

/// A coordinate of a reflector that is mistyped goes into every deflection, and is doubted.
#[test]
fn a_registration_that_does_not_fit_is_doubted() {
    let folder = Folder::new();
    let [points, readings] = ["points.csv", "readings.csv"].map(|f| fixture(&format!("tracker/{f}")));
    let good = std::fs::read_to_string(fixture("tracker/reflectors.toml")).unwrap();
    let said = |from: &str, to: &str| {
        let reflectors = folder.write("r.toml", &good.replace(from, to));
        let files = ["--points", &points, "--reflectors", &reflectors, "--readings", &readings];
        let output = run(&[&["import"], &files[..], &["--out", &folder.path("d.csv")]].concat());
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(!said("", "").contains("mistyped"), "{}", said("", ""));
    let of_base = said("[50.0, -400.0", "[52.0, -400.0");
    assert!(of_base.contains("reflectors of the base are") && of_base.contains("times their uncertainty"), "{of_base}");
    let of_platform = said("75.0, 75.0, 40.0", "75.0, 75.0, 48.0");
    assert!(of_platform.contains("mm (rms) off where poses and reflectors say"), "{of_platform}");
}

/// Cells of the fixture's list of points.
fn fixture_points() -> Table {
    cells(std::fs::read_to_string(fixture("tracker/points.csv")).unwrap().split_once('\n').unwrap().1)
}

/// What an instrument's own list is like, the file, and arguments beside it.
type Export = (&'static str, fn() -> Vec<u8>, &'static [&'static str]);

#[rustfmt::skip] // a case a line
const EXPORTS: &[Export] = &[
    ("German Excel, CSV", || windows(&fixture_points().called(&[("x_mm", "X [mm]", 0), ("y_mm", "Y [mm]", 0), ("z_mm", "Z [mm]", 0), ("u95_um", "U95 [µm]", 0), ("point", "Punkt", 0), ("state", "Zustand", 0)]).map(&["Zustand"], |c| if c == "loaded" { "belastet" } else { "unbelastet" }.into()).german()), &[]),
    ("English Excel, Unicode text", || utf16(&fixture_points().text('\t').replace('\n', "\r\n"), u16::to_le_bytes), &[]),
    ("metres in a row of units", || fixture_points().called(&[("x_mm", "X", -3), ("y_mm", "Y", -3), ("z_mm", "Z", -3), ("u95_um", "U95", 0)]).units(&[("X", "m"), ("Y", "m"), ("Z", "m"), ("U95", "µm")]).text(',').into(), &[]),
    ("U95 in mm, a title, another column", || format!("Job 12, station 1\n{}", fixture_points().called(&[("u95_um", "U95 [mm]", -3)]).with(3, "Time", "10:12:01").text(';')).into(), &[]),
    ("capitals", || fixture_points().map(&["state"], str::to_uppercase).text(',').replace("x_mm,y_mm,z_mm", "X_MM,Y_MM,Z_MM").into(), &[]),
    ("a dash where the maker's uncertainty holds", || fixture_points().map(&["u95_um"], |c| if c.is_empty() { "-" } else { c }.into()).text(',').into(), &[]),
    ("names nobody could guess", || fixture_points().called(&[("reading", "Group", 0), ("x_mm", "Coordinate 1 [mm]", 0)]).text(',').into(), &["--columns", "reading=Group,x_mm=Coordinate 1"]),
];

/// A tracker's list as it was saved gives the bytes that the canonical one gives.
#[test]
fn lists_of_points_are_read_as_they_were_exported() {
    let [reflectors, readings] = ["reflectors.toml", "readings.csv"].map(|f| fixture(&format!("tracker/{f}")));
    let written = |bytes: &[u8], args: &[&str]| {
        let folder = Folder::new();
        let (points, out) = (folder.path("p.txt"), folder.path("d.csv"));
        std::fs::write(&points, bytes).unwrap();
        let call = ["import", "--points", &points, "--reflectors", &reflectors, "--readings", &readings, "--out", &out];
        let output = run(&[&call[..], args].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() { Ok(folder.read("d.csv")) } else { Err(said) }
    };
    let canonical = written(fixture_points().text(',').as_bytes(), &[]).unwrap();
    let wrong: Vec<String> = EXPORTS
        .iter()
        .filter_map(|(what, make, args)| match written(&make(), args) {
            Ok(found) if found == canonical => None,
            other => Some(format!("{what}: {}", other.err().unwrap_or("other numbers".into()))),
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // a column of points in a file that has none
    let data = fixture("measured/p08/measured.csv");
    let said = refused(&["import", "--data", &data, "--columns", "x_mm=dx_um", "--out", "never.csv"]);
    assert!(said["message"].as_str().unwrap().contains("only a tracker's points"), "{said}");
}

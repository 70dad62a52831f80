//! Readings that are no six components: dial gauges, errors that go together, loads with the noise of their cell.

use std::fmt::Write;

use pkm_host::files::machine::MachineFile;
use pkm_host::files::readings::Readings;
use pkm_host::files::source::Source;

use crate::bad_input::{Kind, Make, Put, Reader};
use crate::common::{Folder, fixture, json, reference_machine};

const POSE_AND_LOAD: &str = "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm";

/// Cells of a file by the names of its columns.
fn cells(text: &str) -> Vec<impl Fn(&str) -> String + use<>> {
    let mut lines =
        text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let row = |cells: Vec<String>| {
        let header = header.clone();
        move |column: &str| cells[header.iter().position(|h| h == column).unwrap()].clone()
    };
    lines.map(row).collect()
}

#[test]
fn gauges_are_predicted_along_their_direction() {
    let folder = Folder::new();
    let load = "p,6,-4,540,300,-200,500,10,0,5";
    let point = "40,-60,150";
    let text = format!(
        "{POSE_AND_LOAD},point_u_mm,point_v_mm,point_w_mm,load_u_mm,load_v_mm,load_w_mm,dx_um,gauge_u,gauge_v,gauge_w,gauge_um\n\
         {load},{point},0,0,0,1,,,,\n{load},{point},0,0,0,,4,-6,12,1\n{load},{point},0,0,0,,0,0,-1,1\n"
    );
    json(&["predict", "--data", &folder.write("d.csv", &text), "--out", &folder.path("p.csv")]);
    let predicted = folder.read("p.csv");
    let rows = cells(&predicted);
    let number = |row: usize, column: &str| rows[row](column).parse::<f64>().unwrap();
    let [x, y, z] = ["dx_um", "dy_um", "dz_um"].map(|c| number(0, c));
    assert!(rows[0]("gauge_um").is_empty());
    // (4, -6, 12) is 14 long
    for (row, truth) in [(1, (4.0 * x - 6.0 * y + 12.0 * z) / 14.0), (2, -z)] {
        assert!((number(row, "gauge_um") - truth).abs() < 1e-9 * truth.abs(), "{predicted}");
        assert!(["dx_um", "dy_um", "dz_um", "rx_urad"].iter().all(|c| rows[row](c).is_empty()));
    }
    // what was predicted is read again
    assert_eq!(json(&["check", &folder.path("p.csv")])["readings"], 3);
}

/// Of a set with limb 1 softer.
fn of_set(name: &str) -> String {
    fixture(&format!("measured/own-limb-1-axial-easy/{name}"))
}

/// Three gauges, none along an axis, in place of the translations of a set; a sign for each pose and gauge.
fn with_gauges(sign: impl Fn(&str, usize) -> f64) -> String {
    const DIRECTIONS: [[f64; 3]; 3] = [[2.0, -3.0, 6.0], [3.0, 6.0, 2.0], [6.0, -2.0, -3.0]];
    let text = std::fs::read_to_string(of_set("measured.csv")).unwrap();
    let mut gauges = format!("{POSE_AND_LOAD},series,direction,gauge_u,gauge_v,gauge_w,gauge_um\n");
    for row in cells(&text) {
        for (gauge, [u, v, w]) in DIRECTIONS.into_iter().enumerate() {
            let [x, y, z] = ["dx_um", "dy_um", "dz_um"].map(|c| row(c).parse::<f64>().unwrap());
            let kept: Vec<String> = POSE_AND_LOAD.split(',').map(&row).collect();
            let read = sign(&kept[0], gauge) * (u * x + v * y + w * z) / 7.0;
            // each gauge has a zero of its own
            let _ =
                writeln!(gauges, "{},{}{u},{},{u},{v},{w},{read:.3}", kept.join(","), row("series"), row("direction"));
        }
    }
    gauges
}

/// One gauge is reversed, everywhere or at one pose: it is named, and not the axes of all readings.
#[test]
fn a_gauge_that_is_reversed_is_named() {
    let folder = Folder::new();
    let problems = |gauges: &str| {
        let data = folder.write("d.csv", gauges);
        json(&["check", &data, "--machine", &of_set("machine.toml")])["problems"].clone()
    };
    let reversed = |is_own: bool| if is_own { -1.0 } else { 1.0 };
    for (gauges, kind) in [
        (with_gauges(|_, gauge| reversed(gauge == 1)), "readings_taken_otherwise"),
        (with_gauges(|pose, gauge| reversed(gauge == 1 && pose == "p03")), "pose_taken_otherwise"),
    ] {
        let problems = problems(&gauges);
        let named = problems.as_array().unwrap().iter().find(|p| p["kind"] == kind);
        let message = named.unwrap_or_else(|| panic!("{problems}"))["message"].as_str().unwrap();
        assert!(message.contains("with the gauge along (0.43, 0.86, 0.29) reversed"), "{message}");
    }
}

#[test]
fn a_diagnosis_takes_gauges() {
    let (folder, gauges) = (Folder::new(), with_gauges(|_, _| 1.0));
    let (data, out) = (folder.write("d.csv", &gauges), folder.path("out"));
    let found = json(&[
        "diagnose",
        "--machine",
        &of_set("machine.toml"),
        "--data",
        &data,
        "--holdout",
        &of_set("heldout.csv"),
        "--out",
        &out,
    ]);
    let places: Vec<&str> = found["effects"].as_array().unwrap().iter().map(|e| e["where"].as_str().unwrap()).collect();
    assert!(places.len() == 1 && places[0].starts_with("limb.1."), "{places:?}");
    assert!(found["noise"]["gauge_reading_um"].as_f64().unwrap() > 0.0);
    let residuals = folder.read("out/residuals.csv");
    assert_eq!(residuals.lines().skip(1).filter(|l| l.contains(",gauge_um,")).count(), gauges.lines().count() - 1);
}

/// A load cell of 3 % records each repeat otherwise: with its noise declared they are repeats all the same.
#[test]
fn recorded_loads_that_differ_by_the_cells_noise_are_repeats() {
    let folder = Folder::new();
    let mut text = format!("{POSE_AND_LOAD},dx_um,dy_um,dz_um\n");
    for (n, load) in [400.0, 412.0, 389.0, 405.0, 421.0, 396.0].iter().enumerate() {
        for pose in 0..3 {
            let _ =
                writeln!(text, "p{pose},{pose},0,530,{load},0,0,0,0,0,{:.1},0.{n},1.{n}", 0.27 * load + 0.1 * n as f64);
        }
    }
    let data = folder.write("d.csv", &text);
    let machine = |name: &str, random: &str| {
        folder.write(name, &reference_machine().replacen("load_gain = 0.0", &format!("load_gain = 0.0\n{random}"), 1))
    };
    let kinds = |machine: &str| -> Vec<String> {
        let document = json(&["check", &data, "--machine", machine]);
        document["problems"].as_array().unwrap().iter().map(|p| p["kind"].as_str().unwrap().to_owned()).collect()
    };
    let few = "few_repeats".to_owned();
    assert!(kinds(&machine("exact.toml", "")).contains(&few));
    assert!(!kinds(&machine("noisy.toml", "load_random = 0.03")).contains(&few));
}

#[test]
fn bad_gauges_and_covariances() {
    let call = ["predict", "--data", "BAD", "--out", "OUT"];
    Reader { good: GAUGES, name: "d.csv", call: &call, old: "out" }
        .refuses_text(&OF_GAUGES.iter().collect::<Vec<_>>(), 14);
    let good = covariances();
    Reader { good: &good, name: "d.csv", call: &call, old: "out" }
        .refuses_text(&OF_COVARIANCES.iter().collect::<Vec<_>>(), 15);
}

const GAUGES: &str = "\
pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,gauge_u,gauge_v,gauge_w,gauge_um
a,0,0,530,100,0,-400,0,5.5,0,,0,0,1,12.5
a,0,0,530,100,0,-400,0,5.5,0,3.5,,,,
";

#[rustfmt::skip] // a kind a line
const OF_GAUGES: &[Kind] = &[
    ("no direction", Put(",0,0,1,12.5", ",0,0,0,12.5"), ":2: gauge_u: ", "expected the direction|0, 0, 0"),
    ("half a direction", Put(",0,0,1,12.5", ",0,,1,12.5"), ":2: gauge_v: ", "empty cell|the direction in which the gauge reads"),
    ("a reading without its direction", Put(",0,0,1,12.5", ",,,,12.5"), ":2: gauge_u: ", "the direction in which the gauge reads"),
    ("a component beside a gauge", Put("0,,0,0,1", "0,7,0,0,1"), ":2: dx_um: ", "expected an empty cell|gauge_um alone"),
    ("text for a reading", Put("12.5", "slow"), ":2: gauge_um: ", "finite number"),
    ("no third column of the direction", Put("gauge_w", "note"), ":1: gauge_w: ", "missing column"),
    ("millimetres", Put("gauge_um", "gauge_mm"), ":1: gauge_mm: ", "did you mean `gauge_um`?"),
];

/// A row with everything, and one with nothing of a covariance.
fn covariances() -> String {
    let names = ["dx", "dy", "dz", "rx", "ry", "rz"];
    let unit = |n: usize| if n < 3 { "um" } else { "urad" };
    let mut header = POSE_AND_LOAD.to_owned();
    names.iter().enumerate().for_each(|(n, name)| header += &format!(",{name}_{}", unit(n)));
    names.iter().enumerate().for_each(|(n, name)| header += &format!(",sigma_{name}_{}", unit(n)));
    for (i, a) in names.iter().enumerate() {
        names[i + 1..].iter().for_each(|b| header += &format!(",correlation_{a}_{b}"));
    }
    let load = "a,0,0,530,100,0,-400,0,5.5,0";
    let with = format!("{load},1,2,3,4,5,6,1.5,1.5,1.5,20,20,20,{}0.125,0.5", "0.0,".repeat(14));
    format!("{header},zero_share\n{with}\n{load},1,2,3,4,5,6{}\n", ",".repeat(22))
}

#[rustfmt::skip] // a kind a line
const OF_COVARIANCES: &[Kind] = &[
    ("no share of the zero", Put(",zero_share", ",note"), ":1: zero_share: ", "missing column"),
    ("a correlation that is missing", Put("correlation_dy_rx", "note"), ":1: correlation_dy_rx: ", "missing column"),
    ("a deviation of 0", Put("6,1.5,1.5", "6,0,1.5"), ":2: sigma_dx_um: ", "standard deviation above 0, found 0"),
    ("no deviation", Put("6,1.5,1.5", "6,1.5,"), ":2: sigma_dy_um: ", "empty cell"),
    ("a correlation above 1", Put("0.125", "1.125"), ":2: correlation_ry_rz: ", "from -1 to 1, found 1.125"),
    ("correlations that are none together", Make(|good| good.replace("0.0,0.0,0.0,0.0,0.0,0.0", "0.9,0.9,0.0,0.0,0.0,-0.9").into()), ":2: correlation_dx_dy: ", "positive definite"),
    ("a zero that is all", Put("0.125,0.5", "0.125,1"), ":2: zero_share: ", "from 0 to below 1, found 1"),
    ("a share without number", Put("0.125,0.5", "0.125,"), ":2: zero_share: ", "empty cell"),
];

/// Readings under a load of one name are repeats whatever was recorded, on the way back from a peak that differs, too.
#[test]
fn loads_of_one_name_are_repeats_on_both_branches() {
    let file = MachineFile::parse(Source::from_text("m.toml", reference_machine())).unwrap();
    let repeat_of = |names: [&str; 3]| {
        let [low, high, back] = names;
        let row = |force: f64, name: &str, n: u8| format!("p,3,-2,530,{force},0,0,0,0,0,{},{n},{name}", 0.1 * force);
        let rows = [(200.0, low), (1000.0, high), (206.0, back)]
            .map(|(force, name)| [row(force, name, 1), row(1.05 * force, name, 2)]);
        let of_series = |n: usize| rows.iter().map(|row| row[n].clone()).collect::<Vec<_>>();
        let text = format!("{POSE_AND_LOAD},dx_um,series,load\n{}\n", [of_series(0), of_series(1)].concat().join("\n"));
        let readings = Readings::read(Source::from_text("d.csv", text), &file).unwrap();
        readings.readings.iter().map(|r| r.repeat_of).collect::<Vec<_>>()
    };
    // loads that differ by 5 % are no repeats by themselves
    assert_eq!(repeat_of(["", "", ""]), [0, 1, 2, 3, 4, 5]);
    // one name on both branches is two loads, since friction tells them apart
    assert_eq!(repeat_of(["low", "high", "low"]), [0, 1, 2, 0, 1, 2]);
}

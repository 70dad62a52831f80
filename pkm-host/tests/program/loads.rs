//! A load cell's log joined to the readings by their times: logs as devices write them, each with the loads that were there, and what is
//! wrong or doubtful said with its line.

use std::fmt::Write as _;

use crate::common::{Folder, fixture, json, refused, run};
use crate::import::{cells, table::windows};

/// When the log begins: 14 March 2026, 09:20, in seconds since 1970.
const BEGAN_S: f64 = 1_773_480_000.0;
/// Samples a second.
const RATE_HZ: f64 = 20.0;
/// How long a load stands, and how long it takes to the next one.
const HELD_S: f64 = 10.0;
const RAMP_S: f64 = 4.0;
/// What the cell says without load, and how fast that drifts.
const ZERO_N: f64 = -3.2;
const DRIFT_N_PER_S: f64 = 0.002;
/// Standard deviation of a sample, and its correlation with the one before.
const NOISE_N: f64 = 0.8;
const CORRELATION: f64 = 0.9;
/// Lines of `PATTERN` loads of a series, along x, y and z.
const PATTERN_N: [f64; 6] = [0.0, 200.0, 500.0, 1000.0, 500.0, 200.0];
const POSES: [[f64; 3]; 2] = [[0.0, 0.0, 530.0], [5.0, -4.0, 540.0]];

fn normal(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}

/// A load of the campaign.
#[derive(Clone, Copy)]
struct Loading {
    pose: usize,
    /// Along u, v or w.
    axis: usize,
    nominal_n: f64,
    true_n: f64,
    /// Middle of the time that it stands, from the start of the log.
    at_s: f64,
}

/// The campaign's loads, up to 3 % beside the nominal ones.
fn campaign() -> Vec<Loading> {
    let mut rng = fastrand::Rng::with_seed(18);
    let mut all = Vec::new();
    for pose in 0..POSES.len() {
        for axis in 0..3 {
            for nominal_n in PATTERN_N {
                let n = all.len() as f64;
                let true_n = nominal_n * (1.0 + 0.06 * (rng.f64() - 0.5));
                all.push(Loading { pose, axis, nominal_n, true_n, at_s: 5.0 + n * (HELD_S + RAMP_S) + HELD_S / 2.0 });
            }
        }
    }
    all
}

/// The log of one cell: time from its start, and force.
fn log(loadings: &[Loading]) -> Vec<(f64, f64)> {
    let mut rng = fastrand::Rng::with_seed(19);
    let (mut noise, end_s) = (0.0, loadings[loadings.len() - 1].at_s + HELD_S);
    let force = |t: f64| {
        let next = loadings.iter().position(|l| t < l.at_s + HELD_S / 2.0);
        let Some(n) = next else { return loadings[loadings.len() - 1].true_n };
        let before = if n == 0 { 0.0 } else { loadings[n - 1].true_n };
        let begins = loadings[n].at_s - HELD_S / 2.0 - RAMP_S;
        before + (loadings[n].true_n - before) * ((t - begins) / RAMP_S).clamp(0.0, 1.0)
    };
    let sample = |n: usize| {
        let t = n as f64 / RATE_HZ;
        noise = CORRELATION * noise + NOISE_N * (1.0 - CORRELATION * CORRELATION).sqrt() * normal(&mut rng);
        (t, force(t) + ZERO_N + DRIFT_N_PER_S * t + noise)
    };
    (0..(end_s * RATE_HZ) as usize).map(sample).collect()
}

/// `09:26:53.589`.
fn time_of_day(at_s: f64) -> String {
    let ms = (at_s * 1e3).round() as u64 % 86_400_000;
    format!("{:02}:{:02}:{:02}.{:03}", ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000)
}

/// Readings with their times as a text, and the nominal load or the direction of the force.
fn readings(loadings: &[Loading], time: impl Fn(f64) -> String, column: &str, has_nominal: bool) -> String {
    let load = if has_nominal { "fx_n,fy_n,fz_n" } else { "force_u,force_v,force_w" };
    let mut text = format!("pose,theta_deg,sigma_deg,z0_mm,{column},series,{load},dx_um,dy_um,dz_um\n");
    for (n, l) in loadings.iter().enumerate() {
        let [theta, sigma, z0] = POSES[l.pose];
        let size = if has_nominal { l.nominal_n } else { f64::from(u8::from(l.nominal_n > 0.0)) };
        let [u, v, w] = std::array::from_fn(|i| if i == l.axis { size } else { 0.0 });
        let [dx, dy, dz]: [f64; 3] =
            std::array::from_fn(|i| if i == l.axis { 0.1 * l.true_n + 0.1 * (n % 7) as f64 } else { 0.0 });
        let (at, series) = (time(l.at_s), n / PATTERN_N.len() + 1);
        let _ =
            writeln!(text, "P{},{theta},{sigma},{z0},{at},{series},{u},{v},{w},{dx:.2},{dy:.2},{dz:.2}", l.pose + 1);
    }
    text
}

fn on_the_day(at_s: f64) -> String {
    format!("2026-03-14T{}", time_of_day(BEGAN_S + at_s))
}

/// Columns of a written file.
fn columns(text: &str, names: &[&str]) -> Vec<Vec<f64>> {
    let table = cells(text);
    let places: Vec<usize> = names.iter().map(|n| table.column(n)).collect();
    table.rows.iter().map(|row| places.iter().map(|n| row[*n].parse().unwrap_or(f64::NAN)).collect()).collect()
}

/// Joins, and holds what was written against the true loads: errors over the stated scatter.
fn joined(readings: &[u8], log: &[u8], args: &[&str]) -> (String, String) {
    let folder = Folder::new();
    let (data, loads, out) = (folder.path("r.csv"), folder.path("log.txt"), folder.path("d.csv"));
    std::fs::write(&data, readings).unwrap();
    std::fs::write(&loads, log).unwrap();
    let output = run(&[&["import", "--data", &data, "--loads", &loads, "--out", &out][..], args].concat());
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{said}");
    let written = folder.read("d.csv");
    // what was written is read as it is
    let checked = json(&["check", &out]);
    let wrong = checked["problems"].as_array().unwrap().iter().filter(|p| p["severity"] == "wrong").count();
    assert_eq!((wrong, checked["conversions"].as_array().unwrap().len()), (0, 0), "{checked}");
    (written, said)
}

fn assert_true(what: &str, written: &str, loadings: &[Loading]) {
    let rows = columns(written, &["fx_n", "fy_n", "fz_n", "load_random"]);
    assert_eq!(rows.len(), loadings.len());
    let (mut squares, mut loaded) = (0.0, 0);
    for (row, l) in rows.iter().zip(loadings) {
        for (axis, found) in row[..3].iter().enumerate() {
            let expected = if axis == l.axis { l.true_n } else { 0.0 };
            if axis != l.axis || l.nominal_n == 0.0 {
                assert_eq!(*found, expected, "{what}");
                continue;
            }
            let sd = row[3] * found;
            let error = (found - expected) / sd;
            assert!(error.abs() < 4.0, "{what}: {found} instead of {expected}: {error:.1} sd");
            // the scatter of a sample, not of the mean
            assert!((0.25 * NOISE_N..2.0 * NOISE_N).contains(&sd), "{what}: {sd}");
            squares += error * error;
            loaded += 1;
        }
    }
    let rms = (squares / f64::from(loaded)).sqrt();
    assert!(rms < 1.6, "{what}: {rms}");
}

/// The log as a device writes it.
type Style = (&'static str, fn(&[(f64, f64)]) -> Vec<u8>, &'static [&'static str], &'static str);

fn german_amplifier(log: &[(f64, f64)]) -> Vec<u8> {
    let mut text = "Datei;Zugversuch_07.csv\nMessverstärker;MX 440\nMessrate;20 Hz\nFilter;Bessel 5 Hz\n\nUhrzeit;Kraft [kN];Temperatur [°C]\n".to_owned();
    for (t, f) in log {
        let line = format!("{};{:.5};21.5\n", time_of_day(BEGAN_S + t), f / 1e3);
        text += &line.replace('.', ",");
    }
    windows(&text)
}

fn american_logger(log: &[(f64, f64)]) -> Vec<u8> {
    let mut text = "Test Report\tPull 7\nOperator\tJ. Doe\nStart Date/Time\t2026-03-14 09:20:00\nRate\t20 Hz\nTime\tForce\ns\tlbf\n".to_owned();
    log.iter().for_each(|(t, f)| _ = writeln!(text, "{t:.3}\t{:.4}", f / 4.448_221_615_260_5));
    text.into()
}

fn iso_times(log: &[(f64, f64)]) -> Vec<u8> {
    let mut text = "Date and time,load [N]\n".to_owned();
    // Greenwich, an hour behind the wall clock of the readings
    log.iter().for_each(|(t, f)| _ = writeln!(text, "2026-03-14T{}Z,{f:.3}", time_of_day(BEGAN_S - 3600.0 + t)));
    text.into()
}

fn seconds(log: &[(f64, f64)]) -> Vec<u8> {
    let mut text = "Time (ms);Load cell (kgf)\n".to_owned();
    log.iter().for_each(|(t, f)| _ = writeln!(text, "{:.0};{:.4}", 1e3 * t, f / 9.806_65));
    text.into()
}

fn counted(log: &[(f64, f64)]) -> Vec<u8> {
    let mut text =
        "# DAQ 6009\n# Filter frequency: 5 Hz\n# Sample rate: 20 Hz\n# Start: 14.03.2026 09:20:00\nSample,Force (N)\n"
            .to_owned();
    log.iter().enumerate().for_each(|(n, (_, f))| _ = writeln!(text, "{},{f:.3}", n + 1));
    text.into()
}

fn spreadsheet(log: &[(f64, f64)]) -> Vec<u8> {
    let mut text = "Datum/Uhrzeit;Kraft [N]\n".to_owned();
    for (t, f) in log {
        let line = format!("{:.9};{f:.3}\n", 25_569.0 + (BEGAN_S + t) / 86_400.0);
        text += &line.replace('.', ",");
    }
    text.into()
}

fn three_components(log: &[(f64, f64)]) -> Vec<u8> {
    let loadings = campaign();
    let mut text = "time,date,Fx [N],Fy [N],Fz [N]\n".to_owned();
    for (t, f) in log {
        let n = loadings.iter().position(|l| *t < l.at_s + HELD_S / 2.0 + RAMP_S / 2.0).unwrap_or(loadings.len() - 1);
        let [x, y, z] =
            std::array::from_fn(|axis| if axis == loadings[n].axis { *f } else { ZERO_N + DRIFT_N_PER_S * t });
        let _ = writeln!(text, "{},2026-03-14,{x:.3},{y:.3},{z:.3}", time_of_day(BEGAN_S + t));
    }
    text.into()
}

#[rustfmt::skip] // a style a line
const STYLES: &[Style] = &[
    ("a German amplifier: semicolons, kN, the time of day", german_amplifier, &[], "`Kraft [kN]` is force_n, kN converted to N|decimal commas"),
    ("a logger with a preamble and a row of units", american_logger, &[], "units in line 6|lbf converted to N|began at `2026-03-14 09:20:00`, by line 3"),
    ("times of ISO 8601 with their zone", iso_times, &["--load-clock-s", "3600"], "one file has the zone"),
    ("milliseconds from the start", seconds, &["--load-start", "2026-03-14T09:20:00"], "kgf converted to N|ms converted to s"),
    ("a counter of samples, with their rate above", counted, &[], "samples are 50 ms apart, by line 3|began at `14.03.2026 09:20:00`"),
    ("a spreadsheet's serial numbers", spreadsheet, &[], "serial numbers of a spreadsheet"),
];

#[test]
fn logs_are_read_as_devices_write_them() {
    let loadings = campaign();
    let log = log(&loadings);
    for has_nominal in [true, false] {
        let own = readings(&loadings, on_the_day, "time", has_nominal);
        for (what, make, args, words) in STYLES {
            let (written, said) = joined(own.as_bytes(), &make(&log), args);
            for word in words.split('|') {
                assert!(said.contains(word), "{what}: no `{word}` in {said}");
            }
            // nothing is doubtful but a zone that one file lacks; temperatures are not used, moments are 0
            let expected = [words.contains("zone"), what.contains("German"), has_nominal];
            let expected = expected.into_iter().filter(|is_one| *is_one).count();
            assert_eq!(said.matches("warning").count(), expected, "{what}: {said}");
            assert_true(what, &written, &loadings);
        }
    }
}

/// Measured data have no times: what is written after they served is without them, and says so.
#[test]
fn times_that_are_not_written_are_named() {
    let loadings = campaign();
    let log = three_components(&log(&loadings));
    let own = readings(&loadings, on_the_day, "Zeitstempel", true);
    let (written, said) = joined(own.as_bytes(), &log, &[]);
    assert!(said.contains("- not written: time, as measured data have no times\n"), "{said}");
    assert!(!written.contains("time"), "{written}");

    let folder = Folder::new();
    let log = std::fs::read_to_string(fixture("logs/worn-drive.csv")).unwrap();
    let said = json(&["import", "--data", &folder.write("l.csv", &log), "--out", &folder.path("d.csv")]);
    let words = "l.csv:1: time_s: not written, as measured data have no times: `replay`, which needs them, takes this file as it is";
    assert!(said["warnings"].to_string().contains(words), "{said}");
}

#[test]
fn a_log_of_components_needs_no_direction() {
    let loadings = campaign();
    let own = readings(&loadings, on_the_day, "time", true);
    let (written, said) = joined(own.as_bytes(), &three_components(&log(&loadings)), &[]);
    assert_eq!(said.matches("warning").count(), 1, "no columns of moments: {said}");
    let rows = columns(&written, &["fx_n", "fy_n", "fz_n", "load_random"]);
    for (row, l) in rows.iter().zip(&loadings).filter(|(_, l)| l.nominal_n > 0.0) {
        let error = (row[l.axis] - l.true_n) / (row[3] * l.true_n);
        assert!(error.abs() < 4.0 && (0..3).all(|c| c == l.axis || row[c].abs() < 1.5), "{row:?} of {}", l.true_n);
    }
}

/// What is changed of the good files: readings, log, arguments; and words of the answer.
type Doubt = (&'static str, fn(String, String) -> (String, String), &'static [&'static str], &'static str);

fn same(readings: String, log: String) -> (String, String) {
    (readings, log)
}

/// Changes the cells of a line, from 1.
fn at_line(text: &str, line: usize, change: impl Fn(&str) -> String) -> String {
    let lines = text.lines().enumerate().map(|(n, l)| if n + 1 == line { change(l) } else { l.to_owned() });
    lines.map(|l| l + "\n").collect()
}

/// Keeps the samples of some seconds.
fn cut(log: &str, keep: impl Fn(f64) -> bool) -> String {
    let time = |line: &str| line.split(',').next().and_then(|t| t.parse::<f64>().ok());
    log.lines().filter(|l| time(l).is_none_or(&keep)).map(|l| format!("{l}\n")).collect()
}

#[rustfmt::skip] // a doubt a line
const DOUBTS: &[Doubt] = &[
    ("a window over a change of load", same, &["--load-window-s", "-1,7"], "r.csv:2: force_n: the load is not at rest in the window|the same in lines 3, 4, 5, 6, 7"),
    ("windows that share samples", |r, l| (at_line(&r, 4, |row| row.replacen("T09:20:38.000", "T09:20:25.500", 1)), l), &[], "r.csv:4: time: the window shares samples with that of another reading"),
    ("no zero", |r, l| (r.lines().filter(|l| !l.contains(",0,0,0,0.")).map(|l| format!("{l}\n")).collect(), l), &[], "log.txt:2: force_n: no zero of the cell"),
    ("a zero that is stated", |r, l| (r.lines().filter(|l| !l.contains(",0,0,0,0.")).map(|l| format!("{l}\n")).collect(), l), &["--load-zero-s", "0,8"], "of one stretch without load"),
    ("few samples", |r, l| (r, cut(&l, |t| !(9.02..10.98).contains(&t))), &[], "r.csv:2: time: fewer than 3 samples in the window"),
    ("a log that ends within a window", |r, l| (r, cut(&l, |t| t < 499.5)), &[], "r.csv:37: time: the window reaches beyond the log"),
    ("times to the minute", |r, l| (r.lines().map(to_the_minute).collect(), l), &["--load-window-s", "-60,60"], "r.csv:2: time: times without seconds"),
    ("a load in another unit than it says", |r, l| (r, l.replace("force_n", "force [daN]")), &[], "r.csv:3: force_n: the log says|was meant"),
    ("a clock that is 7 s off: loads are changing", same, &["--load-clock-s", "7"], "r.csv:3: force_n: the load is not at rest|the clocks may differ|r.csv:5: force_n: the log says"),
    ("a sign that turns", |r, l| (r, flipped(&l, 20.0, 40.0)), &[], "the sign differs from that of most readings under the same nominal load"),
    ("a sample without a load", |r, l| (r, at_line(&l, 5, |row| row.split_once(',').unwrap().0.to_owned() + ",-")), &[], "log.txt:5: a sample without a load is left out"),
    ("both in seconds", |r, l| (r.replace("time,", "time_s,").lines().map(elapsed).collect(), l), &[], "both files count seconds"),
];

/// The log with the opposite sign in some seconds.
fn flipped(log: &str, from_s: f64, to_s: f64) -> String {
    let line = |line: &str| match line.split_once(',').map(|(t, f)| (t.parse::<f64>(), f.parse::<f64>())) {
        Some((Ok(t), Ok(f))) if (from_s..to_s).contains(&t) => format!("{t:.3},{:.4}\n", -f),
        _ => format!("{line}\n"),
    };
    log.lines().map(line).collect()
}

/// A row with its time to the minute.
fn to_the_minute(line: &str) -> String {
    match line.find("T09:") {
        Some(at) => format!("{}{}\n", &line[..at + 6], &line[at + 13..]),
        None => format!("{line}\n"),
    }
}

/// A row whose clock's time becomes seconds since 09:20.
fn elapsed(line: &str) -> String {
    let Some(at) = line.find("2026-03-14T09:") else { return format!("{line}\n") };
    let clock = &line[at + 14..at + 23];
    let (minutes, seconds) = clock.split_once(':').unwrap();
    let s = 60.0 * (minutes.parse::<f64>().unwrap() - 20.0) + seconds.parse::<f64>().unwrap();
    format!("{}{s:.3}{}\n", &line[..at], &line[at + 23..])
}

fn good() -> (String, String) {
    let loadings = campaign();
    let mut text = "time_s,force_n\n".to_owned();
    log(&loadings).iter().for_each(|(t, f)| _ = writeln!(text, "{t:.3},{f:.4}"));
    (readings(&loadings, on_the_day, "time", true), text)
}

#[test]
fn what_is_doubtful_is_said_with_its_line() {
    let (own, log) = good();
    for (what, change, args, words) in DOUBTS {
        let (own, log) = change(own.clone(), log.clone());
        let start: &[&str] = if own.contains("time_s") { &[] } else { &["--load-start", "2026-03-14T09:20:00"] };
        let (_, said) = joined(own.as_bytes(), log.as_bytes(), &[start, args].concat());
        for word in words.split('|') {
            assert!(said.contains(word), "{what}: no `{word}` in {said}");
        }
    }
}

#[rustfmt::skip] // a refusal a line
const REFUSED: &[Doubt] = &[
    ("no start", same, &[], "log.txt|the log counts seconds from its start|--load-start 2026-03-14T09:26:53"),
    ("a log of another hour", same, &["--load-start", "2026-03-14T08:20:00"], "r.csv:2|time|the log ends 3100 s (52 min) before the first reading|--load-clock-s"),
    ("a log of the day after", same, &["--load-start", "2026-03-15T09:20:00"], "the log begins 85900 s (23.9 h) after the last reading"),
    ("a log that stops", |r, l| (r, cut(&l, |t| t < 300.0)), &["--load-start", "09:20"], "r.csv:23|no load: the reading was taken|after the log ends (14 more have none either)"),
    ("a gap", |r, l| (r, cut(&l, |t| !(20.0..40.0).contains(&t))), &["--load-start", "09:20"], "r.csv:3|in a gap of the log|behind line 401 of it"),
    ("the signal of a bridge", |r, l| (r, l.replace("force_n", "Force [mV/V]")), &["--load-start", "09:20"], "log.txt:1|`mV/V` is the signal of a bridge and no load|calibration"),
    ("a window with a sample", same, &["--load-start", "09:20", "--load-window-s", "0,0"], "r.csv:2|no window holds 3 samples|one every 0.050 s"),
    ("times that go back", |r, l| (r, at_line(&l, 50, |row| row.replacen("2.400", "1.400", 1))), &["--load-start", "09:20"], "log.txt:50|time_s|goes back by 0.950 s"),
    ("samples without a rate", |r, l| (r, l.replace("time_s", "sample")), &["--load-start", "09:20"], "log.txt:1|Sample rate: 50 Hz"),
    ("a rate of 20, or of 20 000", |r, l| (r, format!("Sample rate: 20,000 Hz\n{}", l.replace("time_s", "sample"))), &["--load-start", "09:20"], "log.txt:1|`20,000`: point or thousands?"),
    ("no loads", |r, l| (r, l.replace("force_n", "sample")), &["--load-start", "09:20"], "log.txt:1|force [N]"),
    ("no times in the readings", |r, l| (r.replace("time,", "remark,"), l), &["--load-start", "09:20"], "r.csv:1|time|each reading needs its time"),
    ("no direction", |r, l| (r.replace("fx_n,fy_n,fz_n", "a,b,c"), l), &["--load-start", "09:20"], "r.csv:1|nothing says which way the cell pulls"),
    ("a moment where a force is read", |r, l| (r.replace("fx_n,fy_n,fz_n", "mx_nm,my_nm,mz_nm"), l), &["--load-start", "09:20"], "r.csv:3|fx_n|the nominal load has moments alone"),
    ("seconds beside a clock", |r, l| (r.replace("time,", "time_s,").lines().map(elapsed).collect(), clock(&l)), &[], "r.csv:1|the readings count seconds from a start that the log"),
    ("text for a load", |r, l| (r, at_line(&l, 9, |row| row.split_once(',').unwrap().0.to_owned() + ",OVERLOAD")), &["--load-start", "09:20"], "log.txt:9|force_n|expected a finite number, found `OVERLOAD`"),
    ("a day or a month first", |r, l| (r.replace("2026-03-14T", "3/14/2026 "), l), &["--load-start", "09:20"], "r.csv:2|time|day or month first? Write the year first"),
    ("an empty time", |r, l| (at_line(&r, 6, |row| row.replacen("2026-03-14T09:21:06.000", "", 1)), l), &["--load-start", "09:20"], "r.csv:6|time|found an empty cell"),
    ("a zero beyond the log", same, &["--load-start", "09:20", "--load-zero-s", "900,910"], "no samples there; the log lasts 509.950 s"),
    ("a start of a clock", |r, l| (r, clock(&l)), &["--load-start", "09:20"], "this one has times of a clock"),
    ("a pose out of travel", |r, l| (at_line(&r, 4, |row| row.replacen("530", "5300", 1)), l), &["--load-start", "09:20"], "r.csv:4|would leave its travel"),
];

/// The log with times of a clock.
fn clock(log: &str) -> String {
    let line = |line: &str| match line.split_once(',').map(|(t, f)| (t.parse::<f64>(), f)) {
        Some((Ok(t), f)) => format!("{},{f}\n", on_the_day(t)),
        _ => "time,force_n\n".to_owned(),
    };
    log.lines().map(line).collect()
}

#[test]
fn what_is_wrong_is_refused_with_what_to_do() {
    let (own, log) = good();
    for (what, change, args, words) in REFUSED {
        let (own, log) = change(own.clone(), log.clone());
        let folder = Folder::new();
        let (data, loads, out) = (folder.write("r.csv", &own), folder.write("log.txt", &log), folder.path("d.csv"));
        let output = run(&[&["import", "--data", &data, "--loads", &loads, "--out", &out][..], args].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{what}: {said}");
        assert!(!folder.has("d.csv"), "{what}");
        for word in words.split('|') {
            assert!(said.contains(word), "{what}: no `{word}` in {said}");
        }
    }
    // a log alone says which way to go
    let folder = Folder::new();
    let failure = refused(&["import", "--data", &folder.write("log.txt", &log), "--out", &folder.path("d.csv")]);
    assert!(failure["message"].as_str().unwrap().contains("--loads"), "{failure}");
}

/// p08 with loads that are up to 3 % beside the nominal ones, as a cell of six components recorded them: the loads are found, and the same
/// is found to yield as in the readings with exact loads.
#[test]
fn a_diagnosis_of_joined_readings_finds_what_the_readings_hold() {
    const CHANNELS: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];
    const STEP_S: f64 = 4.0;
    let text = std::fs::read_to_string(fixture("measured/p08/measured.csv")).unwrap();
    let text: String = text.lines().filter(|l| !l.starts_with('#')).map(|l| format!("{l}\n")).collect();
    let table = cells(&text);
    let read = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];
    let (channels, read) = (CHANNELS.map(|c| table.column(c)), read.map(|c| table.column(c)));
    let mut rng = fastrand::Rng::with_seed(8);
    let (mut own, mut log) = (
        format!("time,{}\n", table.header.join(",")),
        "time_s,Fx [N],Fy [N],Fz [N],Mx [Nm],My [Nm],Mz [Nm]\n".to_owned(),
    );
    let mut truth = Vec::new();
    for (n, row) in table.rows.iter().enumerate() {
        let gain = 1.0 + 0.06 * (rng.f64() - 0.5);
        let mut cells = row.clone();
        read.iter().for_each(|c| cells[*c] = format!("{:.3}", gain * row[*c].parse::<f64>().unwrap()));
        let at_s = 10.0 + STEP_S * n as f64;
        let _ = writeln!(own, "{},{}", on_the_day(at_s), cells.join(","));
        let load = channels.map(|c| gain * row[c].parse::<f64>().unwrap());
        for k in -10..10 {
            let noisy: Vec<String> = (0..6)
                .map(|c| {
                    let [zero, sd] = if c < 3 { [4.0, 0.8] } else { [-0.3, 0.05] };
                    format!("{:.4}", load[c] + zero + sd * normal(&mut rng))
                })
                .collect();
            let _ = writeln!(log, "{:.2},{}", at_s + STEP_S * f64::from(k) / 20.0, noisy.join(","));
        }
        truth.push(load);
    }
    // a stretch without load before the first reading
    let zero: String = (0..40).map(|k| format!("{:.2},4,4,4,-0.3,-0.3,-0.3\n", 0.1 * f64::from(k))).collect();
    let log = log.replacen('\n', &format!("\n{zero}"), 1);
    let folder = Folder::new();
    let (data, loads) = (folder.write("r.csv", &own), folder.write("log.csv", &log));
    let (machine, holdout) = (fixture("measured/p08/machine.toml"), fixture("measured/p08/heldout.csv"));
    let said = json(&[
        "import",
        "--machine",
        &machine,
        "--data",
        &data,
        "--loads",
        &loads,
        "--out",
        &folder.path("d.csv"),
        "--load-start",
        "2026-03-14T09:20:00",
        "--load-zero-s",
        "0,3.9",
    ]);
    assert_eq!(said["load_log"]["zeros"], 1, "{said}");
    let names = [&CHANNELS[..], &["load_random"]].concat();
    for (row, truth) in columns(&folder.read("d.csv"), &names).iter().zip(&truth) {
        let by_lever =
            |load: &[f64]| (0..6).map(|c| (if c < 3 { load[c] } else { load[c] / 0.2 }).powi(2)).sum::<f64>().sqrt();
        let off: Vec<f64> = (0..6).map(|c| row[c] - truth[c]).collect();
        assert!(by_lever(&off) < 4.0 * row[6] * by_lever(truth), "{row:?} instead of {truth:?}");
    }
    let found = json(&[
        "diagnose",
        "--machine",
        &machine,
        "--data",
        &folder.path("d.csv"),
        "--holdout",
        &holdout,
        "--out",
        &folder.path("out"),
    ]);
    let places: Vec<&str> = found["effects"].as_array().unwrap().iter().map(|e| e["where"].as_str().unwrap()).collect();
    let on = |place: &str| places.iter().filter(|p| p.starts_with(place)).count();
    assert_eq!((on("limb.1."), on("moving_platform"), places.len()), (1, 1, 2), "{places:?}");
    let rms = |rival: &str| found["holdout"][rival]["linear_um_rms"].as_f64().unwrap();
    assert!(rms("after") < 0.75 * rms("retuned_only"), "{} {}", rms("after"), rms("retuned_only"));
}

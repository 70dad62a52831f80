//! The compensation under HAL alone: it reads a machine whose drive has worn, keeps what it has learned over restarts, and compensates
//! with it; all beside the host's estimator.

use std::fmt::Write as _;
use std::path::Path;
use std::time::SystemTime;

use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, TipReading, state_bytes};
use pkm_core::nalgebra::{Vector2, Vector3, Vector6};
use pkm_core::{Configuration, FiveAxis, Machine, Model, Pose, Wrench};

use super::replay::Host;
use super::{among_modules, in_file_units};
use crate::{Outcome, output};

const READINGS: i32 = 30;
const COUNT: usize = 6;
/// What is left of the stiffness of limb 2's drive.
const WORN: f64 = 0.7;
const DEVIATION_UM: f64 = 0.5;

/// As `learned.h` has them.
fn settings() -> Result<EstimatorSettings<COUNT>, String> {
    let limbs = [1, 2, 3].map(|limb| (Place::Body { limb }, Motion::Axial));
    let base = [Motion::X, Motion::Y, Motion::Z].map(|motion| (Place::Base, motion));
    let amplitudes = limbs.into_iter().chain(base).map(|(place, motion)| {
        let amplitude = Amplitude::compliance(place, motion)?;
        let (deviation, drift_per_day) = (1e-9, 1e-11);
        let (least, most, rate_per_s, alarm) = (-4e-9, 4e-8, 1e-9, 2e-10);
        Some(AmplitudeSettings { amplitude, accepted: 0.0, deviation, drift_per_day, least, most, rate_per_s, alarm })
    });
    let amplitudes: Option<Vec<_>> = amplitudes.collect();
    let amplitudes = amplitudes.and_then(|all| all.try_into().ok()).ok_or("no such amplitude")?;
    Ok(EstimatorSettings { amplitudes, model_share: 0.02 })
}

/// A place, a load there, and what is read, along x, y, z of B.
pub struct Probing {
    at: Configuration<f64>,
    wrench: Wrench<f64>,
    read_m: Vector3<f64>,
}

/// What a gauge would read on a machine with a worn drive, known to none of both estimators.
pub fn probing(host: &Host, five: &FiveAxis<'_, f64>, n: i32) -> Result<Probing, String> {
    let said = |e: pkm_core::ToolDeflectionError| e.to_string();
    let table = host.table()?;
    let mut parameters = host.machine.parameters;
    parameters.limbs[1].platform_joint.linear_n_per_m[2] *= WORN;
    let worn = Machine::<f64>::new(&parameters).map_err(|e| e.to_string())?;
    let wave = |k: i32, by: i32| f64::from((n * by + k) % 13 - 6) / 6.0;
    // well within the table's box, and so within travel
    let part = |axis: usize, wave: f64| host.table.centre[axis] + 0.35 * host.table.half_width[axis] * wave;
    let pose = Pose { theta_rad: part(0, wave(0, 5)), sigma_rad: part(1, wave(1, 7)), z0_m: part(2, wave(2, 3)) };
    let at = Configuration { pose, beta_rad: Vector2::new(0.2 * wave(3, 11), 0.2 * wave(4, 2)) };
    let force_n = Vector3::new(600.0 * wave(5, 4), 600.0 * wave(6, 9), 600.0 * wave(7, 6) - 300.0);
    let wrench = Wrench { force_n, moment_nm: Vector3::zeros() };
    let moved = |machine: &Machine<f64>, table| FiveAxis { machine, ..*five }.deflection(table, &at, &wrench);
    let wear = moved(&worn, None).map_err(said)?.translation_m - moved(five.machine, None).map_err(said)?.translation_m;
    let seen = moved(five.machine, Some(&table)).map_err(said)?.translation_m + wear;
    // noise, and as many digits as HAL takes
    let read_m = seen.map(|m| ((m * 1e9).round() + f64::from(n * 7919 % 401 - 200)) / 1e9);
    Ok(Probing { at, wrench, read_m })
}

/// HAL's lines for place and load of a probing.
pub fn place(five: &FiveAxis<'_, f64>, probing: &Probing) -> Result<String, String> {
    let mut text = String::new();
    let joints = in_file_units(&five.joints(&probing.at).map_err(|e| e.to_string())?);
    for (n, joint) in joints.into_iter().enumerate() {
        writeln!(text, "setp pkmcompensator.joint-{n} {joint}").ok();
    }
    for (name, force) in ["fx", "fy", "fz"].into_iter().zip(&probing.wrench.force_n) {
        writeln!(text, "setp pkmcompensator.{name} {force}").ok();
    }
    Ok(text)
}

/// The same, and the reading there.
fn lines(five: &FiveAxis<'_, f64>, probing: &Probing) -> Result<String, String> {
    let mut text = place(five, probing)?;
    for (axis, read_m) in ["x", "y", "z"].into_iter().zip(&probing.read_m) {
        writeln!(text, "setp pkmcompensator.probe-{axis}-um {}", read_m * 1e6).ok();
    }
    let wait = format!("loadusr -w sh {WAIT} saw.out");
    Ok(text + &format!("sets probing 1\n{wait} TRUE\nsets probing 0\n{wait} FALSE\n"))
}

/// Waits until a pin has a value: on a busy machine the thread may stand still for longer than any sleep.
const WAIT: &str = "wait.sh";
const WAITING: &str = "until [ \"$(halcmd getp \"$1\")\" = \"$2\" ]; do sleep 0.002; done\n";
/// `seen` has what `probing` was at the beginning of a period, `saw` at that of the period before. The component reads `seen`: given
/// in the middle of a period, `probing` would have a reading taken in with the place of the reading before. `begun` says that the component
/// has run: a probe that is there in its first period is no reading.
const PROBING: &str = "\
loadrt or2 names=saw,seen,begun
setp begun.in0 1
newsig probing bit
net probing => seen.in0
net seen seen.out => saw.in0 pkmcompensator.probe
addf saw servo
addf seen servo
";

/// What `halcmd getp` prints of pins.
pub struct Session<'a> {
    pub out: &'a Path,
    pub host: &'a Host,
}

impl Session<'_> {
    /// The component with its state in a file, through some lines; then the pins that are asked for.
    pub fn run(&self, lines: &str, pins: &[String]) -> Result<Vec<f64>, String> {
        let sums = [
            self.host.machine.parameters.checksum(),
            self.host.machine.wrist_parameters.checksum(),
            self.host.table()?.checksum(),
        ];
        let [machine, wrist, table] = sums.map(|sum| format!("{sum:016x}"));
        let mut text = format!(
            "loadrt threads name1=servo period1=1000000\n\
             loadrt pkmcompensator machine={machine} wrist={wrist} table={table} state=learned.bin\n{PROBING}\
             addf pkmcompensator.to-drives servo\naddf begun servo\nsetp pkmcompensator.probe-deviation-um {DEVIATION_UM}\n\
             setp pkmcompensator.gain 1\nsetp pkmcompensator.stuck-s 0\nstart\nloadusr -w sh {WAIT} begun.out TRUE\n{lines}"
        );
        for pin in pins {
            writeln!(text, "getp pkmcompensator.{pin}").ok();
        }
        for (name, text) in [("learn.hal", text.as_str()), (WAIT, WAITING)] {
            std::fs::write(self.out.join(name), text).map_err(|e| e.to_string())?;
        }
        let mut halrun = among_modules(&self.out.join("modules"), self.out)?;
        let said = output(halrun.args(["timeout", "120", "halrun", "-f", "learn.hal"]))?;
        let number = |line: &str| match line.trim() {
            "TRUE" => Some(1.0),
            "FALSE" => Some(0.0),
            other => match other.strip_prefix("0x") {
                Some(digits) => u32::from_str_radix(digits, 16).ok().map(f64::from),
                None => other.parse().ok(),
            },
        };
        let found: Vec<f64> = said.lines().filter_map(number).collect();
        if found.len() == pins.len() { Ok(found) } else { Err(format!("expected {} pins: {said}", pins.len())) }
    }
}

/// Time for the thread to run: on a busy machine it may not have within the start's.
const RESTED: &str = "loadusr -w sleep 1\n";

/// How old what is known is.
const TIMES: [&str; 2] = ["first-reading-s", "last-reading-s"];

/// Seconds of the clock that the component takes.
fn clock_s() -> Result<f64, String> {
    let since = SystemTime::UNIX_EPOCH.elapsed().map_err(|e| e.to_string())?;
    Ok(since.as_secs() as f64)
}

fn in_order(times_s: &[f64]) -> Outcome {
    if times_s.is_sorted() { Ok(()) } else { Err(format!("times of readings, and of the clock: {times_s:?}")) }
}

/// Pins of every amplitude.
fn each(name: &str) -> impl Iterator<Item = String> {
    (0..COUNT).map(move |n| format!("{name}-{n}"))
}

pub fn expect(what: &str, found: &[f64], expected: &[f64], within: f64) -> Outcome {
    let near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= within);
    if near { Ok(()) } else { Err(format!("{what}: {found:?} where the host has {expected:?}")) }
}

/// What the host's estimator knows, as the component's pins have it.
fn expected(of: &Estimator<f64, COUNT>, codes: [f64; 2]) -> Vec<f64> {
    let (values, alarms) = (of.values(), of.alarms());
    let head = [f64::from(of.readings()), codes[0], codes[1]];
    let known = values.iter().map(|(value, _)| value * 1e9).chain(values.iter().map(|(_, sd)| sd * 1e9));
    let told = alarms.iter().map(|alarm| f64::from(u8::from(alarm.is_some())));
    let since = alarms.iter().map(|alarm| alarm.map_or(0.0, |alarm| f64::from(alarm.readings)));
    head.into_iter().chain(known).chain(told).chain(since).collect()
}

/// Lines for the component; then what it knows, and when the first and the last reading were.
fn known(session: &Session<'_>, lines: &str) -> Result<(Vec<f64>, [f64; 2]), String> {
    let names = ["learned", "learned-deviation", "alarm", "alarm-readings"].into_iter().flat_map(each);
    let head = ["readings-taken", "probe-code", "state-code"].map(str::to_owned);
    let pins: Vec<String> = head.into_iter().chain(names).chain(TIMES.map(str::to_owned)).collect();
    let mut found = session.run(lines, &pins)?;
    let times = found.split_off(pins.len() - TIMES.len());
    Ok((found, times.try_into().map_err(|_| "two times")?))
}

/// The host's estimator takes a reading.
fn take(host: &Host, five: &FiveAxis<'_, f64>, estimator: &mut Estimator<f64, COUNT>, probing: &Probing) -> Outcome {
    let touch = five.touch(&probing.at, &probing.wrench, 0, 0.0).map_err(|e| e.to_string())?;
    let axes = probing.at.base_axes();
    let readings = [0, 1, 2].map(|axis| {
        let [x, y, z] = axes.column(axis).into_owned().into();
        let direction = Vector6::new(x, y, z, 0.0, 0.0, 0.0);
        TipReading { direction, read: probing.read_m[axis], deviation: DEVIATION_UM * 1e-6 }
    });
    estimator.learn(five.machine, Some(&host.table()?), &touch, &readings).map_err(|e| e.to_string())?;
    Ok(())
}

/// Learns, is asked, is restarted, has a slot damaged, compensates.
pub fn learn(out: &Path, host: &Host) -> Outcome {
    let five = host.five()?;
    let session = Session { out, host };
    let mut estimator = Estimator::<f64, COUNT>::new(&settings()?).map_err(|e| e.to_string())?;
    let mut text = String::new();
    for n in 0..READINGS {
        let probing = probing(host, &five, n)?;
        text.push_str(&lines(&five, &probing)?);
        take(host, &five, &mut estimator, &probing)?;
    }
    let knows = estimator;
    // one of the wrong sign teaches nothing
    let mut wrong = probing(host, &five, READINGS)?;
    wrong.read_m = -wrong.read_m;
    text.push_str(&lines(&five, &wrong)?);
    // 94 the wrong sign, 96 no state yet
    let begun_s = clock_s()?;
    let (found, [first_s, last_s]) = known(&session, &text)?;
    expect("learned", &found, &expected(&knows, [94.0, 96.0]), 1e-4)?;
    let ended_s = clock_s()?;
    in_order(&[begun_s, first_s, last_s, ended_s])?;
    let alarms = knows.alarms();
    if !(0..COUNT).all(|n| alarms[n].is_some() == (n == 1)) {
        return Err(format!("expected an alarm of the worn drive alone: {alarms:?}"));
    }
    // a restart goes on from there, and one reading more goes to the other slot; then that is damaged
    let more = probing(host, &five, READINGS + 1)?;
    take(host, &five, &mut estimator, &more)?;
    let (found, times) = known(&session, &lines(&five, &more)?)?;
    expect("after a restart", &found, &expected(&estimator, [0.0, 0.0]), 1e-4)?;
    expect("the first reading's time after a restart", &times, &[first_s], 0.0)?;
    in_order(&[ended_s, times[1]])?;
    let file = out.join("learned.bin");
    let mut bytes = std::fs::read(&file).map_err(|e| e.to_string())?;
    let length = state_bytes(COUNT);
    if bytes.len() != 2 * length {
        return Err(format!("two states are {} bytes, found {}", 2 * length, bytes.len()));
    }
    bytes[length + 100] ^= 1;
    std::fs::write(&file, bytes).map_err(|e| e.to_string())?;
    let (found, times) = known(&session, RESTED)?;
    expect("a damaged state", &found, &expected(&knows, [0.0, 0.0]), 1e-4)?;
    expect("times of a damaged state", &times, &[first_s, last_s], 0.0)?;
    compensates(&session, &five, &more, knows)?;
    keeps_a_foreign_state(&session, &five, &more, &knows)?;
    forgets(&session, &five, &more)?;
    println!(
        "  {READINGS} readings learned, alarm and deviations as the host's, over restarts and a damaged state; compensated with it"
    );
    Ok(())
}

/// What was learned beyond another table is kept aside.
fn keeps_a_foreign_state(
    session: &Session<'_>,
    five: &FiveAxis<'_, f64>,
    more: &Probing,
    knows: &Estimator<f64, COUNT>,
) -> Outcome {
    let mut foreign = vec![0; 2 * state_bytes(COUNT)];
    knows.save(0, 1, &mut foreign).map_err(|e| e.to_string())?;
    std::fs::write(session.out.join("learned.bin"), &foreign).map_err(|e| e.to_string())?;
    let (found, _) = known(session, &lines(five, more)?)?;
    expect("a state of another table", &found[..3], &[1.0, 0.0, 97.0], 0.0)?;
    let kept = std::fs::read(session.out.join("learned.bin.old")).map_err(|e| e.to_string())?;
    let (found, _) = known(session, RESTED)?;
    expect("the state after one of another table", &found[..3], &[1.0, 0.0, 0.0], 0.0)?;
    if kept == foreign { Ok(()) } else { Err("the state of another table was not kept".into()) }
}

/// No reading while an offset acts; then all is forgotten, and stays so over a restart.
fn forgets(session: &Session<'_>, five: &FiveAxis<'_, f64>, more: &Probing) -> Outcome {
    // 98 an offset acts
    let on = place(five, more)? + "setp pkmcompensator.enable 1\nloadusr -w sleep 0.5\n";
    let (found, _) = known(session, &(on + &lines(five, more)?))?;
    expect("a reading while it compensates", &found[..3], &[1.0, 98.0, 0.0], 0.0)?;
    let nothing = Estimator::<f64, COUNT>::new(&settings()?).map_err(|e| e.to_string())?;
    // a period before and one after make an edge
    let forget = format!("{RESTED}setp pkmcompensator.forget 1\n{RESTED}");
    for (what, lines) in [("forgotten", forget.as_str()), ("forgotten before", RESTED)] {
        let (found, times) = known(session, lines)?;
        expect(what, &found, &expected(&nothing, [0.0, 0.0]), 1e-4)?;
        expect("the time of what was forgotten", &times, &[0.0, 0.0], 0.0)?;
    }
    Ok(())
}

/// Where the offsets come to rest, without what was learned and with it.
fn compensates(
    session: &Session<'_>,
    five: &FiveAxis<'_, f64>,
    at: &Probing,
    mut learned: Estimator<f64, COUNT>,
) -> Outcome {
    let table = session.host.table()?;
    let settings = CompensatorSettings { gain: 1.0, stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let reading = Reading { enabled: true, wrench: at.wrench, rise: 0.0.into() };
    let mut plain = Compensator::<f64, 5>::new(&settings).map_err(|e| e.to_string())?;
    let mut knowing = Compensator::<f64, 5>::new(&settings).map_err(|e| e.to_string())?;
    let model = Model::new(five.machine, &table);
    for _ in 0..8000 {
        learned.follow(settings.period_s);
        plain.update(&model, five.wrist, &at.at, &reading);
        knowing.update(&model.with_learned(&learned), five.wrist, &at.at, &reading);
    }
    let in_pins = |joints: [f64; 5]| -> Vec<f64> {
        (0..5).map(|n| if n < 3 { joints[n] * 1e3 } else { joints[n].to_degrees() }).collect()
    };
    let (plain, knowing) = (in_pins(plain.joints().into()), in_pins(knowing.joints().into()));
    let offsets: Vec<String> = (0..5).map(|n| format!("offset-{n}")).collect();
    let lines = place(five, at)?;
    let on = "setp pkmcompensator.enable 1\nloadusr -w sleep 6\n";
    expect("offsets", &session.run(&format!("{lines}{on}"), &offsets)?, &plain, 1e-6)?;
    let with = format!("{lines}setp pkmcompensator.use-learned 1\n{on}");
    expect("offsets with what was learned", &session.run(&with, &offsets)?, &knowing, 1e-6)?;
    let apart = plain.iter().zip(&knowing).map(|(plain, knowing)| (plain - knowing).abs()).fold(0.0, f64::max);
    // ten times what they may differ by from the host
    if apart > 1e-5 { Ok(()) } else { Err(format!("what was learned moves the offsets by {apart:e} alone")) }
}

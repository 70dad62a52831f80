//! Machines under LinuxCNC in simulation: driven by a script, recorded in every period, and compared with the host.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use pkm_core::nalgebra::Vector2;
use pkm_core::{Configuration, FiveAxis, ToolError};
use serde_json::{Value, json};

use super::faults::{judge_faults, outside_the_box, parked_inside_the_margin};
use super::feed::{self, FEED_MM_PER_S, slow_screw_mm_per_s};
use super::learning::learn;
use super::lost::what_is_lost;
use super::memory::{flip_bits, refuse_damaged};
use super::replay::{Host, ROW, SMALL_SCREW_MM, STUCK_S, held, judge_rows, spread, worst};
use super::weight::weigh;
use super::{
    MODULES, OURS, among_modules, build, compensated, home, in_file_units, machine_file, ready, table, template,
};
use crate::image::symbols;
use crate::{Outcome, output};

const FOR_TESTS: [&str; 2] = ["tests/pkmrecord.comp", "tests/pkmcompare.comp"];

pub fn run() -> Outcome {
    drive("reference", 100_000)?;
    drive("x150", 100_000)
}

/// What the recorder keeps of a period: nets of `pkm.hal`, or pins that nothing else reads, with how many numbered ones.
const RECORDED: [(&str, usize); 34] = [
    ("pkmkins.inverse-axis-", 5),
    ("pkmkins.inverse-joint-", 5),
    ("pkmkins.forward-joint-", 5),
    ("pkmkins.forward-axis-", 5),
    ("stands", 5),
    ("fx", 1),
    ("fy", 1),
    ("fz-read", 1),
    ("mx", 1),
    ("my", 1),
    ("mz", 1),
    ("pkmcompensator.offset-", 5),
    ("pkmcompensator.tip-x-um", 1),
    ("pkmcompensator.tip-y-um", 1),
    ("pkmcompensator.tip-z-um", 1),
    ("pkmcompensator.turn-x-urad", 1),
    ("pkmcompensator.turn-y-urad", 1),
    ("pkmcompensator.turn-z-urad", 1),
    ("pkmcompensator.share", 1),
    ("pkmcompensator.distance-1-2", 1),
    ("pkmcompensator.distance-3", 1),
    ("pkmkins.share", 1),
    ("command", 5),
    ("drive", 5),
    ("joint.0.motor-offset", 1),
    ("joint.1.motor-offset", 1),
    ("joint.2.motor-offset", 1),
    ("rise", 1),
    ("rise-limb-2", 1),
    ("asked", 5),
    ("pkmfeed.velocity-", 5),
    ("pkmfeed.acceleration-", 5),
    ("feed-share", 1),
    ("requested-vel", 1),
];
const ENTRIES: [&str; 21] = [
    "11", "12", "13", "14", "15", "16", "22", "23", "24", "25", "26", "33", "34", "35", "36", "44", "45", "46", "55",
    "56", "66",
];
/// Lines that tie the recorder to the pins, and it to the thread.
fn recorder(file: &Path) -> String {
    let mut names: Vec<String> = Vec::new();
    for (name, count) in RECORDED {
        match count {
            1 => names.push(name.to_owned()),
            _ => names.extend((0..count).map(|i| format!("{name}{i}"))),
        }
    }
    names.extend(ENTRIES.iter().map(|ij| format!("pkmcompensator.k-{ij}")));
    let mut text = format!("loadrt pkmrecord file={}\n", file.display());
    let mut tie = |name: &str, pin: &str| {
        // what is no net of `pkm.hal` gets one of its own
        let net = if name.contains('.') { format!("{pin} {name}") } else { name.to_owned() };
        writeln!(text, "net {net} => pkmrecord.{pin}").ok();
    };
    for (n, name) in names.iter().enumerate() {
        tie(name, &format!("real-{n:03}"));
    }
    let flags = ["pkmcompensator.ok", "pkmcompensator.inside-box", "compensate", "homed", "pkmfeed.ok"];
    for (n, name) in flags.into_iter().enumerate() {
        tie(name, &format!("flag-{n}"));
    }
    // the last whole number is the script's: which settings it has chosen
    let whole = [
        "pkmkins.inverse-ns",
        "pkmkins.forward-ns",
        "pkmcompensator.last-ns",
        "pkmcompensator.fault-code",
        "pkmcompensator.limit",
    ];
    for (n, name) in whole.into_iter().enumerate() {
        tie(name, &format!("whole-{n}"));
    }
    text + "addf pkmrecord.begin servo-thread 1\naddf pkmrecord.before servo-thread -2\n\
            addf pkmrecord.after servo-thread\naddf pkmrecord.end servo-thread\n"
}

/// Lines that let the script lie about load and temperature, and let a drive sag.
const FAULTS: &str = "\
loadrt sum2 names=lie,sag,warm,warm-2
net rise warm.out => pkmcompensator.rise-limb-1-k pkmcompensator.rise-limb-3-k pkmcompensator.rise-platforms-k
net rise-limb-2 warm-2.out => pkmcompensator.rise-limb-2-k
addf warm servo-thread 1
addf warm-2 servo-thread 1
unlinkp pkmcompensator.fz
net fz => lie.in0
net fz-read lie.out => pkmcompensator.fz
unlinkp pkmcompensator.drive-fb-2
net drive2 => sag.in0
net sagged sag.out => pkmcompensator.drive-fb-2
addf lie servo-thread 1
addf sag servo-thread
";

/// Rows of numbers that a module has written.
fn numbers(file: &Path, width: usize) -> Result<Vec<Vec<f64>>, String> {
    let bytes = std::fs::read(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let all: Vec<f64> = bytes.chunks_exact(8).map(|b| f64::from_ne_bytes(b.try_into().unwrap_or_default())).collect();
    Ok(all.chunks_exact(width).map(<[f64]>::to_vec).collect())
}

/// A place within reach to which the straight way from home is not: the reach has hollows where a screw is at its shortest.
fn beyond_a_hollow(five: &FiveAxis<'_, f64>, home_axes: [f64; 5], wide_mm: f64) -> Option<[f64; 5]> {
    const STEPS: i32 = 20;
    let share = |i: i32| f64::from(i) / f64::from(STEPS);
    let shares = || (-STEPS..=STEPS).map(share);
    for (x, y, z) in shares().flat_map(|s| shares().flat_map(move |z| [(s, 0.0, z), (0.0, s, z)])) {
        let by = [x, y, z].map(|d| (d * wide_mm).round());
        let at = |share: f64| std::array::from_fn(|i| home_axes[i] + if i < 3 { share * by[i] } else { 0.0 });
        let hollow = (1..STEPS).filter(|i| held(five, &at(share(*i))).is_err()).count();
        if hollow >= 3 && held(five, &at(1.0)).is_ok() {
            return Some(at(1.0));
        }
    }
    None
}

/// X Y Z A B of home's platform with the wrist turned so far that the margin of the singularity locus forbids it.
fn near_a_singularity(five: &FiveAxis<'_, f64>, home: Configuration<f64>) -> Option<[f64; 5]> {
    let turns = || (-8..=8).map(|i| 10.0 * f64::from(i));
    let mut all = turns().flat_map(|a| turns().map(move |b| [a, b]));
    all.find_map(|[a, b]| {
        let tool = five.tool(&Configuration { beta_rad: Vector2::new(a, b).map(f64::to_radians), ..home }).ok()?;
        let [x, y, z] = (tool.tip_m * 1e3).into();
        let place = [x, y, z, a, b];
        (held(five, &place) == Err(ToolError::Singular.to_string())).then_some(place)
    })
}

/// Drives a machine through homing, moves, loads, refusals and its program, and compares every period with the host.
fn drive(name: &str, periods: usize) -> Outcome {
    let fails = |what: String| Err(format!("{name}: {what}"));
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let out = folder.path();
    let setup = ready(name).ok_or("no such machine")?;
    build(&setup, out, &[&OURS[..], &FOR_TESTS].concat())?;
    no_allocation(&out.join("modules"))?;
    let host = Host { machine: machine_file(&setup.machine)?, table: table(out)? };
    let five = host.five()?;
    let tool = five.tool(&home(&host.machine)).map_err(|e| e.to_string())?;
    let [x, y, z] = (tool.tip_m * 1e3).into();
    let home_axes = [x, y, z, 0.0, 0.0];

    refuse_others(out, &host)?;
    refuse_damaged(out, &host)?;
    what_is_lost(out, &host)?;
    flip_bits(out, &host)?;
    compare(name, out, &host)?;
    learn(out, &host)?;
    weigh(out, &host)?;

    // as an operator would, with what the machine has of room
    let joints = five.joints(&home(&host.machine)).map_err(|e| e.to_string())?;
    let size = 0.3e3 * five.machine.travel_margin_m(&joints.lengths).map_err(|e| e.to_string())?.0;
    let turn = size / 8.0;
    let by = |d: [f64; 5]| -> Vec<f64> { (0..5).map(|i| ((home_axes[i] + d[i]) * 1e6).round() / 1e6).collect() };
    let places = [
        by([0.5 * size, 0.25 * size, 0.5 * size, turn, -turn]),
        by([-0.5 * size, -0.5 * size, 0.0, -turn, turn]),
        by([0.0, 0.5 * size, -0.5 * size, 0.0, 0.0]),
    ];
    let unreachable = by([0.0, 0.0, 0.6e3 * host.machine.wrist_parameters.home_z0_m, 0.0, 0.0]);
    let wide_mm = 1e3 * host.machine.wrist_parameters.home_z0_m;
    let through = beyond_a_hollow(&five, home_axes, wide_mm).ok_or("no way that leaves the reach was found")?;
    let load = [60.0, -30.0, -400.0, 1.0, -2.0, 5.0];
    let singular = near_a_singularity(&five, home(&host.machine)).ok_or("no place near a singularity was found")?;
    let parked = parked_inside_the_margin(
        &five,
        home(&host.machine),
        home_axes,
        host.machine.wrist_parameters.singularity_margin,
    )
    .ok_or("no place inside the margin with a way out was found")?;
    let outside = outside_the_box(&host).ok_or("no place outside the table's box was found")?;
    let wish = json!({ "parked": parked.joints, "inward": parked.inward, "stuck_s": STUCK_S, "small_screw_mm": SMALL_SCREW_MM, "outside": outside,
        "places": places, "load": load, "unreachable": unreachable, "singular": singular, "home": home_axes, "through": through,
        "program": "holes.ngc", "compensated": compensated::PROGRAM, "periods": periods, "feed_mm_per_min": 60.0 * FEED_MM_PER_S,
        "slow_screw_mm_per_s": slow_screw_mm_per_s(&five, &home_axes, &places)? });
    let write = |name: &str, text: &str| std::fs::write(out.join(name), text).map_err(|e| format!("{name}: {e}"));
    write("drive.json", &wish.to_string())?;
    let cuts = compensated::write(&setup.machine, out)?;
    write("drive.py", &template("tests/drive.py")?)?;
    output(Command::new("chmod").arg("+x").arg(out.join("drive.py")))?;
    let record = out.join("record.bin");
    write("abort.ngc", &format!("G90 G94\nM68 E2 Q{}\nG1 F60 Z{:.6}\nM68 E2 Q0\nM2\n", load[2], home_axes[2] + size))?;
    write("record.hal", &(recorder(&record) + FAULTS))?;
    let verdict = driven(out, periods).map_err(|what| format!("{name}: {what}"))?;
    judge_steps(&verdict, &five, home_axes, &places, &through).or_else(fails)?;
    let rows = numbers(&record, ROW)?;
    let (noted, limit) = feed::during(&verdict)?;
    let slow = (noted[0]..noted[noted.len() - 1], limit);
    judge_rows(&host, &rows, &load, periods, &slow).or_else(fails)?;
    feed::judge(&host, &verdict, &rows).or_else(fails)?;
    compensated::judge(&host, &cuts, &rows).or_else(fails)?;
    judge_faults(&host, &verdict, &rows).or_else(fails)
}

/// Runs the configuration with the script as its operator, and says what the script saw.
fn driven(out: &Path, periods: usize) -> Result<Value, String> {
    let ini = std::fs::read_to_string(out.join("pkm.ini")).map_err(|e| e.to_string())?;
    std::fs::write(out.join("test.ini"), scripted(&ini)).map_err(|e| format!("test.ini: {e}"))?;
    let mut linuxcnc = among_modules(&out.join("modules"), out)?;
    // it maps a file with the tool table from there, which another LinuxCNC on this computer would cut off
    linuxcnc.env("HOME", out);
    let seconds_at_most = format!("{}", periods / 1000 + 300);
    // its status says nothing of the script's
    let said = linuxcnc.args(["timeout", &seconds_at_most, "linuxcnc", "-r", "test.ini"]).output();
    let said = said.map_err(|e| e.to_string())?;
    let read = |name: &str| std::fs::read_to_string(out.join(name));
    let Ok(verdict) = read("verdict.json") else {
        return Err(format!(
            "no verdict\n{}{}",
            String::from_utf8_lossy(&said.stdout),
            String::from_utf8_lossy(&said.stderr)
        ));
    };
    let verdict: Value = serde_json::from_str(&verdict).map_err(|e| e.to_string())?;
    if verdict["finished"] != true {
        return Err(format!("the script did not finish: {verdict:#}"));
    }
    Ok(verdict)
}

/// A configuration whose operator is the script, and whose pins are recorded.
fn scripted(ini: &str) -> String {
    let lines = ini.lines().filter(|l| !l.starts_with("PYVCP"));
    let lines: Vec<String> = lines
        .map(|l| l.replace("POSTGUI_HALFILE = panel.hal", "HALFILE = record.hal"))
        .map(|l| if l.starts_with("DISPLAY =") { "DISPLAY = ./drive.py".to_owned() } else { l })
        .collect();
    lines.join("\n")
}

/// Steps that the script takes once.
const ONCE: [&str; 26] = [
    "home",
    "load",
    "unload",
    "unreachable",
    "singular",
    "before",
    "through",
    "after",
    "nan",
    "spike",
    "reversed",
    "skipped",
    "temperature",
    "jump",
    "outside",
    "stuck",
    "small",
    "abort",
    "rehome",
    "park",
    "inward",
    "sag",
    "out",
    "feed",
    "compensated",
    "program",
];

/// What the script saw: every step as it should be, refusals with their reason.
fn judge_steps(
    verdict: &Value,
    five: &FiveAxis<'_, f64>,
    home_axes: [f64; 5],
    places: &[Vec<f64>],
    through: &[f64; 5],
) -> Outcome {
    let steps = verdict["steps"].as_array().ok_or("no steps")?;
    let five_of = |step: &Value, key: &str| -> Vec<f64> {
        step[key].as_array().map_or(Vec::new(), |a| a.iter().filter_map(Value::as_f64).collect())
    };
    let said = |step: &Value| step["messages"].to_string();
    let mut last_joints = Vec::new();
    let mut asked = places.iter();
    for step in steps {
        let name = step["step"].as_str().unwrap_or_default();
        let (axes, joints) = (five_of(step, "axes"), five_of(step, "joints"));
        let wrong = |what: &str| Err(format!("{name}: {what}: {step:#}"));
        let quiet = step["messages"].as_array().is_some_and(Vec::is_empty);
        let at: Option<&[f64]> = match name {
            "home" => Some(&home_axes),
            "place" => asked.next().map(Vec::as_slice),
            "before" | "after" | "out" | "rehome" | "feed" => Some(&home_axes),
            _ => None,
        };
        let refused = matches!(name, "unreachable" | "singular" | "through" | "inward");
        let well = quiet && step["on"] == true;
        if !refused && !well {
            return wrong("expected a machine that is on, and no message");
        }
        if let Some(at) = at {
            let off = worst(&axes, at).max(worst(&joints, &in_file_units(&held(five, at)?.joints)));
            // the script writes six decimals
            if !(axes.len() == 5 && off <= 1e-6) {
                return wrong(&format!("{off:e} from where it should be"));
            }
        }
        match name {
            "unreachable" | "singular" | "inward" => {
                let why = if name != "unreachable" {
                    "too near to a singularity of the five axes"
                } else {
                    "leave its travel"
                };
                let refusal = said(step).contains("pkmkins: target refused") && said(step).contains(why);
                if !(refusal && step["on"] == true && joints == last_joints) {
                    return wrong("expected a refusal before the move");
                }
            }
            "through" => {
                let way: f64 = worst(&axes, &home_axes);
                let whole = worst(through, &home_axes);
                if !(said(step).contains("pkmkins: target refused") && step["on"] == false && way > 0.0 && way < whole)
                {
                    return wrong("expected a fault on the way");
                }
                println!("  on a way that leaves the reach it stopped after {way:.1} of {whole:.1} mm: {}", said(step));
            }
            "skipped" if step["skips"] != true => return wrong("expected a thread that stands still"),
            "program" | "compensated" => {
                println!("  {name} took {:.1} s", step["seconds"].as_f64().unwrap_or(f64::NAN));
            }
            _ => {}
        }
        last_joints = joints;
    }
    let count = |name: &str| steps.iter().filter(|s| s["step"] == name).count();
    if ONCE.into_iter().any(|name| count(name) != 1) || count("place") != places.len() {
        return Err(format!("steps are missing: {verdict:#}"));
    }
    Ok(())
}

/// The modules ask for no memory but what HAL gives them when they are loaded.
fn no_allocation(modules: &Path) -> Outcome {
    for name in ["pkmkins.so", "pkmcompensator.so", "pkmfeed.so"] {
        let asked: Vec<String> = symbols(&modules.join(name))?
            .into_iter()
            .filter(|s| {
                s.kind == 'U' && s.name != "hal_malloc" && (s.name.contains("alloc") || s.name.contains("panic"))
            })
            .map(|s| s.name)
            .collect();
        if !asked.is_empty() {
            return Err(format!("{name} asks for {asked:?}"));
        }
    }
    Ok(())
}

/// A configuration for another machine, wrist or table gets neither kinematics nor compensation, one that names none gets no
/// compensation, and one in other units no kinematics.
fn refuse_others(out: &Path, host: &Host) -> Outcome {
    let (machine, wrist) = (host.machine.parameters.checksum(), host.machine.wrist_parameters.checksum());
    let ours = format!("machine={machine:016x} wrist={wrist:016x}");
    let another = "0123456789abcdef";
    for (line, says) in [
        ("pkmkins".to_owned(), "the machine compiled in is"),
        (format!("pkmkins machine={another}"), "the machine compiled in is"),
        (format!("pkmkins machine={machine:016x}"), "the wrist compiled in is"),
        (format!("pkmkins machine={machine:016x} wrist={another}"), "the wrist compiled in is"),
        (format!("pkmkins {ours}"), "[TRAJ]LINEAR_UNITS is not told"),
        (format!("pkmkins {ours} linear=inch angular=degree"), "[TRAJ]LINEAR_UNITS is inch"),
        (format!("pkmkins {ours} linear=mm angular=radian"), "[TRAJ]ANGULAR_UNITS is radian"),
        (format!("pkmcompensator machine={another}"), "the machine compiled in is"),
        (format!("pkmcompensator machine={machine:016x} wrist={another}"), "the wrist compiled in is"),
        (format!("pkmcompensator {ours} table={another}"), "the table compiled in is"),
        (format!("pkmcompensator {ours}"), "the table compiled in is"),
        (format!("pkmfeed machine={another}"), "the machine compiled in is"),
        (format!("pkmfeed machine={machine:016x}"), "the wrist compiled in is"),
    ] {
        std::fs::write(out.join("other.hal"), format!("loadrt {line}\n")).map_err(|e| e.to_string())?;
        let mut halrun = among_modules(&out.join("modules"), out)?;
        match output(halrun.args(["timeout", "60", "halrun", "-f", "other.hal"])) {
            Err(said) if said.contains(says) => {}
            other => return Err(format!("{line} was not refused: {other:?}")),
        }
    }
    Ok(())
}

/// Inverse and forward in a HAL thread, beside LinuxCNC's own parallel kinematics.
fn compare(name: &str, out: &Path, host: &Host) -> Outcome {
    const SECONDS: u32 = 11;
    let five = host.five()?;
    let home = home(&host.machine);
    let (tool, joints) = (five.tool(&home), five.joints(&home));
    let (Ok(tool), Ok(joints)) = (tool, joints) else { return Err("no home".into()) };
    let [x, y, z] = (tool.tip_m * 1e3).into();
    let size = 0.3e3 * five.machine.travel_margin_m(&joints.lengths).map_err(|e| e.to_string())?.0;
    let file = out.join("compare.bin");
    let text = format!(
        "loadrt threads name1=servo period1=100000\nloadrt genhexkins\n\
         loadrt pkmkins machine={:016x} wrist={:016x} linear=mm angular=degree\n\
         loadrt pkmcompare modules={MODULES} file={}\n\
         net iterations genhexkins.max-iterations => pkmcompare.max-iterations\n\
         setp pkmcompare.home-0 {x}\nsetp pkmcompare.home-1 {y}\nsetp pkmcompare.home-2 {z}\nsetp pkmcompare.size {size}\n\
         setp pkmcompare.turn {}\n\
         addf pkmcompare servo\nstart\nloadusr -w sleep {SECONDS}\n",
        host.machine.parameters.checksum(),
        host.machine.wrist_parameters.checksum(),
        file.display(),
        size / 4.0
    );
    std::fs::write(out.join("compare.hal"), text).map_err(|e| e.to_string())?;
    let mut halrun = among_modules(&out.join("modules"), out)?;
    let said = output(halrun.args(["timeout", "60", "halrun", "-f", "compare.hal"]))?;
    let rows = numbers(&file, 14).map_err(|e| format!("{e}\n{said}"))?;
    println!(
        "{name}: {} periods of inverse, forward, and forward from home, in one thread; ns at the median:",
        rows.len()
    );
    for (which, name, unit) in [(0, "pkmkins", "mm or degrees"), (7, "genhexkins", "inches or degrees")] {
        let column = |i: usize| spread(rows.iter().map(|r| r[which + i]));
        let refused: f64 = rows.iter().map(|r| r[which]).sum();
        // the first call of genhexkins fails
        let error = rows.iter().filter(|r| r[which] == 0.0).map(|r| r[which + 1]).fold(0.0, f64::max);
        println!(
            "  {name:10} inverse {:4.0}, forward {:4.0} (iterations {:.0}, {:.0} at the most), from home {:4.0} ({:.0}, {:.0}); \
             refused {refused}, inverse and forward apart {error:.1e} {unit}",
            column(2)[0],
            column(3)[0],
            column(5)[0],
            column(5)[2],
            column(4)[0],
            column(6)[0],
            column(6)[2]
        );
        let exact = refused == 0.0 && error <= 1e-9;
        if which == 0 && !exact {
            return Err(format!("inverse and forward are {error:e} apart, {refused} refused"));
        }
    }
    if rows.len() < 90_000 { Err(format!("only {} periods", rows.len())) } else { Ok(()) }
}

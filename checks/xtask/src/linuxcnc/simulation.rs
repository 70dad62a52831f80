//! Machines under LinuxCNC in simulation: driven by a script, recorded in every period, and compared with the host.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use pkm_core::{
    CompensatedTool, Configuration, Corrected, CorrectionTable, Domain, FiveAxis, Hold, JointValues, ScrewLengths,
    Tool, ToolError, Wrench,
};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_host::files::table_numbers::TableNumbers;
use serde_json::{Value, json};

use super::{MODULES, OURS, among_modules, build, home, in_file_units, machine_file, ready, template};
use crate::image::symbols;
use crate::{Outcome, output};

const FOR_TESTS: [&str; 2] = ["tests/pkmrecord.comp", "tests/pkmcompare.comp"];

pub fn run() -> Outcome {
    drive("reference", 100_000)?;
    drive("x150", 20_000)
}

/// What the recorder keeps of a period: nets of `pkm.hal`, or pins that nothing else reads, with how many numbered ones.
const RECORDED: [(&str, usize); 23] = [
    ("pkmkins.inverse-axis-", 5),
    ("pkmkins.inverse-joint-", 5),
    ("pkmkins.forward-joint-", 5),
    ("pkmkins.forward-axis-", 5),
    ("stands", 5),
    ("fx", 1),
    ("fy", 1),
    ("fz", 1),
    ("mx", 1),
    ("my", 1),
    ("mz", 1),
    ("offset", 5),
    ("pkmstiffness.tip-x-um", 1),
    ("pkmstiffness.tip-y-um", 1),
    ("pkmstiffness.tip-z-um", 1),
    ("pkmstiffness.turn-x-urad", 1),
    ("pkmstiffness.turn-y-urad", 1),
    ("pkmstiffness.turn-z-urad", 1),
    ("pkmstiffness.share", 1),
    ("pkmstiffness.distance-1-2", 1),
    ("pkmstiffness.distance-3", 1),
    ("pkmkins.share", 1),
    ("command", 5),
];
const ENTRIES: [&str; 21] = [
    "11", "12", "13", "14", "15", "16", "22", "23", "24", "25", "26", "33", "34", "35", "36", "44", "45", "46", "55",
    "56", "66",
];
/// A row of the recorder: times of the thread on the wall's and on the processor's clock and of the stiffness component, real
/// pins, flags, whole numbers.
const REALS: usize = 3;
const FLAGS: usize = REALS + 80;
const WHOLE: usize = FLAGS + 2;
const ROW: usize = WHOLE + 3;

/// Lines that tie the recorder to the pins, and it to the thread.
fn recorder(file: &Path) -> String {
    let mut names: Vec<String> = Vec::new();
    for (name, count) in RECORDED {
        match count {
            1 => names.push(name.to_owned()),
            _ => names.extend((0..count).map(|i| format!("{name}{i}"))),
        }
    }
    names.extend(ENTRIES.iter().map(|ij| format!("pkmstiffness.k-{ij}")));
    let mut text = format!("loadrt pkmrecord file={}\n", file.display());
    let mut tie = |name: &str, pin: &str| {
        // what is no net of `pkm.hal` gets one of its own
        let net = if name.contains('.') { format!("{pin} {name}") } else { name.to_owned() };
        writeln!(text, "net {net} => pkmrecord.{pin}").ok();
    };
    for (n, name) in names.iter().enumerate() {
        tie(name, &format!("real-{n:03}"));
    }
    tie("pkmstiffness.ok", "flag-0");
    tie("pkmstiffness.inside-box", "flag-1");
    for (n, name) in ["pkmkins.inverse-ns", "pkmkins.forward-ns", "pkmstiffness.last-ns"].into_iter().enumerate() {
        tie(name, &format!("whole-{n}"));
    }
    text + "addf pkmrecord.begin servo-thread 1\naddf pkmrecord.before servo-thread -2\n\
            addf pkmrecord.after servo-thread\naddf pkmrecord.end servo-thread\n"
}

/// Rows of numbers that a module has written.
fn numbers(file: &Path, width: usize) -> Result<Vec<Vec<f64>>, String> {
    let bytes = std::fs::read(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let all: Vec<f64> = bytes.chunks_exact(8).map(|b| f64::from_ne_bytes(b.try_into().unwrap_or_default())).collect();
    Ok(all.chunks_exact(width).map(<[f64]>::to_vec).collect())
}

/// Median, 99.9 % and greatest.
fn spread(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN);
    [at(0.5), at(0.999), at(1.0)]
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |worst, d| if d > worst || d.is_nan() { d } else { worst })
}

/// The host's side: from the machine file and `coefficients.json`, not from generated source.
struct Host {
    machine: MachineFile,
    table: TableNumbers,
}

impl Host {
    fn five(&self) -> Result<FiveAxis<'_, f64>, String> {
        self.machine.five_axis().map_err(|e| e.to_string())
    }

    fn table(&self) -> Result<CorrectionTable<'_, f64>, String> {
        self.table.table().map_err(|e| e.to_string())
    }
}

/// X Y Z A B in mm and degrees, held.
fn held(five: &FiveAxis<'_, f64>, axes: &[f64]) -> Result<Hold<f64>, String> {
    let [x, y, z, a, b] = axes.try_into().map_err(|_| "expected five axes")?;
    five.inverse_at([x, y, z].map(|mm: f64| mm / 1e3), [a, b].map(f64::to_radians)).map_err(|e| e.to_string())
}

fn joints_of(values: &[f64]) -> JointValues<f64> {
    let at = |i: usize| values.get(i).copied().unwrap_or(f64::NAN);
    JointValues {
        lengths: ScrewLengths { q_m: [at(0), at(1), at(2)].map(|mm| mm / 1e3) },
        beta_rad: [at(3), at(4)].map(f64::to_radians),
    }
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

/// X Y Z A B of home's platform with the wrist turned so far that the margin of the singular surface forbids it.
fn near_a_singularity(five: &FiveAxis<'_, f64>, home: Configuration<f64>) -> Option<[f64; 5]> {
    let turns = || (-8..=8).map(|i| 10.0 * f64::from(i));
    let mut all = turns().flat_map(|a| turns().map(move |b| [a, b]));
    all.find_map(|[a, b]| {
        let tool = five.tool(&Configuration { beta_rad: [a, b].map(f64::to_radians), ..home }).ok()?;
        let [x, y, z] = tool.tip_m.map(|m| m * 1e3);
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
    build(&setup, out, &[OURS, FOR_TESTS].concat())?;
    no_allocation(&out.join("modules"))?;
    let table = Source::read(&out.join("coefficients.json")).and_then(|s| TableFile::parse(&s)).map(|t| t.numbers());
    let host = Host { machine: machine_file(&setup.machine)?, table: table.map_err(|e| e.to_string())? };
    let five = host.five()?;
    let tool = five.tool(&home(&host.machine)).map_err(|e| e.to_string())?;
    let [x, y, z] = tool.tip_m.map(|m| m * 1e3);
    let home_axes = [x, y, z, 0.0, 0.0];

    refuse_others(out)?;
    compare(name, out, &host)?;

    // as an operator would, with what the machine has of room
    let size =
        0.3e3 * five.machine.travel_margin_m(&five.joints(&home(&host.machine)).map_err(|e| e.to_string())?.lengths).0;
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
    let wish = json!({ "places": places, "load": load, "unreachable": unreachable, "singular": singular, "home": home_axes, "through": through,
        "program": "holes.ngc", "periods": periods });
    let write = |name: &str, text: &str| std::fs::write(out.join(name), text).map_err(|e| format!("{name}: {e}"));
    write("drive.json", &wish.to_string())?;
    write("drive.py", &template("tests/drive.py")?)?;
    output(Command::new("chmod").arg("+x").arg(out.join("drive.py")))?;
    let record = out.join("record.bin");
    write("record.hal", &recorder(&record))?;
    let ini = std::fs::read_to_string(out.join("pkm.ini")).map_err(|e| e.to_string())?;
    let lines = ini.lines().filter(|l| !l.starts_with("PYVCP"));
    let ini: Vec<String> = lines
        .map(|l| l.replace("POSTGUI_HALFILE = panel.hal", "HALFILE = record.hal"))
        .map(|l| if l.starts_with("DISPLAY =") { "DISPLAY = ./drive.py".to_owned() } else { l })
        .collect();
    write("test.ini", &ini.join("\n"))?;
    let mut linuxcnc = among_modules(&out.join("modules"), out)?;
    let seconds_at_most = format!("{}", periods / 1000 + 240);
    // its status says nothing of the script's
    let said = linuxcnc.args(["timeout", &seconds_at_most, "linuxcnc", "-r", "test.ini"]).output();
    let said = said.map_err(|e| e.to_string())?;
    let read = |name: &str| std::fs::read_to_string(out.join(name));
    let Ok(verdict) = read("verdict.json") else {
        return fails(format!(
            "no verdict\n{}{}",
            String::from_utf8_lossy(&said.stdout),
            String::from_utf8_lossy(&said.stderr)
        ));
    };
    let verdict: Value = serde_json::from_str(&verdict).map_err(|e| e.to_string())?;
    if verdict["finished"] != true {
        return fails(format!("the script did not finish: {verdict:#}"));
    }
    judge_steps(&verdict, &five, home_axes, &places, &through).or_else(fails)?;
    judge_rows(&host, &numbers(&record, ROW)?, &load, periods).or_else(fails)
}

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
            "before" | "after" => Some(&home_axes),
            _ => None,
        };
        let refused = matches!(name, "unreachable" | "singular" | "through");
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
            "unreachable" | "singular" => {
                let why =
                    if name == "singular" { "too near to a singularity of the five axes" } else { "leave its travel" };
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
            "program" => println!("  holes.ngc took {:.1} s", step["seconds"].as_f64().unwrap_or(f64::NAN)),
            _ => {}
        }
        last_joints = joints;
    }
    let count = |name: &str| steps.iter().filter(|s| s["step"] == name).count();
    let all = ["home", "load", "unload", "unreachable", "singular", "before", "through", "after", "program"];
    if all.into_iter().any(|name| count(name) != 1) || count("place") != places.len() {
        return Err(format!("steps are missing: {verdict:#}"));
    }
    Ok(())
}

struct Computed {
    tool: Tool<f64>,
    stiffness: Corrected<f64>,
    wanted: CompensatedTool<f64>,
}

/// What the stiffness component does in a period.
fn component(
    five: &FiveAxis<'_, f64>,
    table: &CorrectionTable<'_, f64>,
    stands: &[f64],
    force: &Wrench<f64>,
) -> Result<Computed, String> {
    let (stood, tool) = five.forward(&joints_of(stands)).map_err(|e| e.to_string())?;
    let stiffness = table.factor_form(five.machine, &stood.pose).map_err(|e| e.to_string())?;
    let wanted = five.compensated(Some(table), &tool, force, &stood).map_err(|e| e.to_string())?;
    Ok(Computed { tool, stiffness, wanted })
}

/// Of the configuration.
const PERIOD_NS: f64 = 1e6;

fn keep(worst: &mut f64, d: f64) {
    *worst = if d > *worst || d.is_nan() { d } else { *worst };
}

/// What periods showed.
#[derive(Default)]
struct Seen {
    /// Greatest differences from the host: joints and axes, mm and degrees.
    inverse: f64,
    forward: f64,
    offsets: f64,
    /// um, urad, and shares of the distances from singularities.
    deflection: f64,
    /// Relative to the diagonal.
    stiffness: f64,
    /// Furthest that a joint's command moved in a period.
    jump: f64,
    valid: usize,
    loaded: usize,
    stepped: usize,
    inside: usize,
    late: usize,
    late_by_us: usize,
    /// Of the inverse for a tool vector, from period to period.
    looks: Vec<u8>,
    last: Option<(Vec<f64>, Configuration<f64>)>,
}

impl Seen {
    fn take(&mut self, host: &Host, row: &[f64], load: &[f64; 6]) -> Outcome {
        let (five, table) = (host.five()?, host.table()?);
        let mut next = REALS;
        let mut take = |n: usize| {
            next += n;
            &row[next - n..next]
        };
        let (asked, given, felt, placed) = (take(5), take(5), take(5), take(5));
        let (stands, wrench, offsets, moved) = (take(5), take(6), take(5), take(6));
        let (margins, target_share, command, k) = (take(3), take(1), take(5), take(21));
        // until a first target was asked for or a first forward gave an answer, there is nothing
        if asked != [0.0; 5] {
            let hold = held(&five, asked)?;
            keep(&mut self.inverse, worst(given, &in_file_units(&hold.joints)));
            keep(&mut self.inverse, (hold.home_share - target_share[0]).abs());
        }
        if felt != [0.0; 5] {
            let (_, tool) = five.forward(&joints_of(felt)).map_err(|e| e.to_string())?;
            let [x, y, z] = tool.tip_m.map(|m| m * 1e3);
            keep(&mut self.forward, worst(placed, &[x, y, z, felt[3], felt[4]]));
        }
        let stood = five.forward(&joints_of(stands));
        if stood.is_ok() != (row[FLAGS] == 1.0) {
            return Err(format!("results and no pose, or the other way round: {row:?}"));
        }
        // as long as the machine is not homed its joints mean nothing
        let Ok((stood, _)) = stood else { return Ok(()) };
        self.valid += 1;

        let force = Wrench::from_array(<[f64; 6]>::try_from(wrench).map_err(|_| "a wrench is six numbers")?);
        let Computed { tool, stiffness, wanted } = component(&five, &table, stands, &force)?;
        let to: Vec<f64> = in_file_units(&wanted.hold.joints).iter().zip(stands).map(|(to, at)| to - at).collect();
        keep(&mut self.offsets, worst(offsets, &to));
        let moves = [wanted.deflection.translation_m, wanted.deflection.rotation_rad].concat();
        keep(&mut self.deflection, worst(moved, &moves.iter().map(|v| v * 1e6).collect::<Vec<_>>()));
        let distance = five.machine.singularity_distance(&stood.pose).map_err(|e| e.to_string())?;
        keep(&mut self.deflection, worst(margins, &[wanted.hold.home_share, distance.limbs_1_2, distance.limb_3]));
        let matrix = stiffness.factor.stiffness().matrix();
        let upper = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
        for ((i, j), found) in upper.zip(k) {
            keep(&mut self.stiffness, (found - matrix[i][j]).abs() / (matrix[i][i] * matrix[j][j]).sqrt());
        }
        let inside = stiffness.domain == Domain::Inside && wanted.deflection.domain == Some(Domain::Inside);
        if inside != (row[FLAGS + 1] == 1.0) {
            return Err(format!("inside the box or not: {row:?}"));
        }
        self.inside += usize::from(inside);
        let moves_joints = offsets.iter().any(|d| d.abs() > 1e-4);
        self.loaded += usize::from(wrench != [0.0; 6] && moves_joints);
        self.stepped += usize::from(wrench == load && moves_joints);
        if row[0] > PERIOD_NS {
            // the same again: what was taken away from the thread does not come again
            let again = (0..20).map(|_| {
                let begun = Instant::now();
                let done = component(&five, &table, stands, &force).is_ok() && held(&five, asked).is_ok();
                if done { begun.elapsed().as_nanos() as f64 } else { f64::INFINITY }
            });
            let again = again.fold(f64::INFINITY, f64::min);
            println!("  a late period, {:.0} ns: its work done again takes {again:.0} ns", row[0]);
            self.late += 1;
            self.late_by_us += usize::from(again > 0.5 * PERIOD_NS);
        }
        if let Some((before, near)) = &self.last {
            keep(&mut self.jump, worst(command, before));
            self.looks.push(five.inverse(&tool, near).map_err(|e| e.to_string())?.looks);
        }
        self.last = Some((command.to_vec(), stood));
        Ok(())
    }

    fn print(&self, rows: &[Vec<f64>]) {
        println!(
            "  {} periods, {} with results, {} of them under load, {} inside the table's box, {} late, {} of them by us",
            rows.len(),
            self.valid,
            self.loaded,
            self.inside,
            self.late,
            self.late_by_us
        );
        println!(
            "  greatest differences from the host: inverse {:.1e}, forward {:.1e}, offsets {:.1e} mm or degrees; \
             deflection {:.1e} um or urad; K_m {:.1e} of its diagonal",
            self.inverse, self.forward, self.offsets, self.deflection, self.stiffness
        );
        let [half, _, most] = spread(self.looks.iter().map(|n| f64::from(*n)));
        println!(
            "  iterations: none; were tool vectors asked for, {half} looks from period to period, {most} at the most\n  \
             furthest that a joint's command moved in a period: {:.4} mm or degrees",
            self.jump
        );
        let column = |i: usize| spread(rows.iter().map(|r| r[i]));
        let times = [
            ("inverse", column(WHOLE)),
            ("forward", column(WHOLE + 1)),
            ("stiffness component", column(WHOLE + 2)),
            ("  by the processor's clock", column(2)),
            ("whole servo thread", column(0)),
            ("  by the processor's clock", column(1)),
        ];
        for (what, [half, most, all]) in times {
            println!("  {what:26} {half:6.0} ns at the median, {most:6.0} at 99.9 %, {all:8.0} at the most");
        }
        // motion-controller calls each of the kinematics about once a period
        let ours: f64 = times[..3].iter().map(|(_, [half, ..])| half).sum();
        let [thread, ..] = times[4].1;
        println!(
            "  ours at the median: {:.0} % of the thread's time, {:.1} % of the period",
            100.0 * ours / thread,
            100.0 * ours / PERIOD_NS
        );
    }
}

/// What the recorder saw, period by period.
fn judge_rows(host: &Host, rows: &[Vec<f64>], load: &[f64; 6], periods: usize) -> Outcome {
    let mut seen = Seen::default();
    rows.iter().try_for_each(|row| seen.take(host, row, load))?;
    seen.print(rows);
    let enough = rows.len() >= periods && seen.loaded >= 1000 && seen.stepped >= 100 && seen.inside > 0;
    let exact = [seen.inverse, seen.forward, seen.offsets].into_iter().all(|d| d <= 1e-11)
        && seen.deflection <= 1e-10
        && seen.stiffness == 0.0;
    // the fastest joint does 120 mm/s
    let steady = seen.jump <= 0.121;
    for (holds, what) in [
        (enough, "too little was seen"),
        (exact, "not what the host computes"),
        (steady, "a joint jumped"),
        (seen.late_by_us == 0, "our functions overran the period"),
    ] {
        if !holds {
            return Err(what.to_owned());
        }
    }
    Ok(())
}

/// The modules ask for no memory but what HAL gives them when they are loaded.
fn no_allocation(modules: &Path) -> Outcome {
    for name in ["pkmkins.so", "pkmstiffness.so"] {
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

/// A configuration for another machine or another wrist does not get these kinematics.
fn refuse_others(out: &Path) -> Outcome {
    for what in ["machine", "wrist"] {
        let text = format!("loadrt pkmkins {what}=0123456789abcdef\n");
        std::fs::write(out.join("other.hal"), text).map_err(|e| e.to_string())?;
        let mut halrun = among_modules(&out.join("modules"), out)?;
        match output(halrun.args(["timeout", "60", "halrun", "-f", "other.hal"])) {
            Err(said) if said.contains(&format!("the {what} compiled in is")) => {}
            other => return Err(format!("pkmkins for another {what} was not refused: {other:?}")),
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
    let [x, y, z] = tool.tip_m.map(|m| m * 1e3);
    let size = 0.3e3 * five.machine.travel_margin_m(&joints.lengths).0;
    let file = out.join("compare.bin");
    let text = format!(
        "loadrt threads name1=servo period1=100000\nloadrt genhexkins\nloadrt pkmkins\n\
         loadrt pkmcompare modules={MODULES} file={}\n\
         net iterations genhexkins.max-iterations => pkmcompare.max-iterations\n\
         setp pkmcompare.home-0 {x}\nsetp pkmcompare.home-1 {y}\nsetp pkmcompare.home-2 {z}\nsetp pkmcompare.size {size}\n\
         setp pkmcompare.turn {}\n\
         addf pkmcompare servo\nstart\nloadusr -w sleep {SECONDS}\n",
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

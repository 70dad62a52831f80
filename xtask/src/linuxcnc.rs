//! LinuxCNC with our kinematics and stiffness: its modules and a configuration for a machine, and machines in simulation.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use pkm_core::{
    CompensatedTool, Configuration, Corrected, CorrectionTable, Domain, FiveAxis, Hold, JointValues, Pose,
    ScrewLengths, Tool, ToolError, Wrench,
};
use pkm_host::commands;
use pkm_host::fit::TermChoice;
use pkm_host::machine_file::MachineFile;
use pkm_host::place::job::Job;
use pkm_host::source::Source;
use pkm_host::table_file::{TableFile, TableNumbers};
use serde_json::{Value, json};

use crate::image::symbols;
use crate::{Outcome, c, output, root};

const USAGE: &str = "\
cargo xtask linuxcnc
  (alone)            build both machines below and test them under LinuxCNC, headless
  build              modules and configurations of both to out/linuxcnc
  build --machine my.toml --data k.csv [--job job.toml] --out DIR
                     the same of a machine of one's own, with holes to drill where a job file has some
  run reference|x150 build, and start LinuxCNC on a screen with the modules shown to it alone: nothing is installed";

/// Where Debian's LinuxCNC looks for modules; `loadrt` takes them from nowhere else.
const MODULES: &str = "/usr/lib/linuxcnc/modules";
const PACKAGES: &str = "apt-get install --no-install-recommends linuxcnc-uspace linuxcnc-uspace-dev";
const OURS: [&str; 2] = ["modules/pkmkins.comp", "modules/pkmstiffness.comp"];
const FOR_TESTS: [&str; 2] = ["tests/pkmrecord.comp", "tests/pkmcompare.comp"];
/// Copied into a configuration as they are.
const FILES: [&str; 4] = ["pkm.hal", "panel.hal", "panel.xml", "tool.tbl"];

/// A machine to build for.
struct Setup {
    machine: PathBuf,
    data: PathBuf,
    job: Option<PathBuf>,
    /// dx and dy of the job's cross slide for each of its series, mm; 0 where there are none.
    slide_mm: &'static [[f64; 2]],
}

fn ready(name: &str) -> Option<Setup> {
    let fixture = |path: &str| root().join("fixtures").join(path);
    let machine = fixture(&format!("machines/{name}.toml"));
    match name {
        "reference" => Some(Setup {
            machine,
            data: fixture("jobs/wide-k.csv"),
            job: Some(fixture("jobs/plate.toml")),
            slide_mm: &[[40.0, 240.0], [-65.0, -15.0]],
        }),
        "x150" => Some(Setup {
            machine,
            data: fixture("stiffness/x150.csv"),
            job: Some(fixture("jobs/x150-plate.toml")),
            slide_mm: &[],
        }),
        _ => None,
    }
}

const READY: [&str; 2] = ["reference", "x150"];

pub fn run(options: &[String]) -> Outcome {
    if Command::new("halcompile").arg("--help").output().is_err() {
        return Err(format!("no LinuxCNC here: {PACKAGES}"));
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    match options.as_slice() {
        [] => test(),
        ["build"] => READY.iter().try_for_each(|name| build_ready(name).map(drop)),
        ["build", rest @ ..] => build_own(rest),
        ["run", name] => {
            let folder = build_ready(name)?;
            let mut linuxcnc = among_modules(&folder.join("modules"), &folder)?;
            let status = linuxcnc.arg("linuxcnc").arg("pkm.ini").status().map_err(|e| e.to_string())?;
            if status.success() { Ok(()) } else { Err(format!("linuxcnc: {status}")) }
        }
        _ => Err(USAGE.to_owned()),
    }
}

fn build_own(options: &[&str]) -> Outcome {
    let value = |name: &str| options.chunks(2).find(|pair| pair[0] == name).and_then(|pair| pair.get(1));
    let known = ["--machine", "--data", "--job", "--out"];
    let (Some(machine), Some(data), Some(out)) = (value("--machine"), value("--data"), value("--out")) else {
        return Err(USAGE.to_owned());
    };
    if options.chunks(2).any(|pair| pair.len() < 2 || !known.contains(&pair[0])) {
        return Err(USAGE.to_owned());
    }
    let setup =
        Setup { machine: machine.into(), data: data.into(), job: value("--job").map(PathBuf::from), slide_mm: &[] };
    build(&setup, Path::new(out), &OURS)
}

fn build_ready(name: &str) -> Result<PathBuf, String> {
    let setup = ready(name).ok_or_else(|| USAGE.to_owned())?;
    let out = root().join("out/linuxcnc").join(name);
    build(&setup, &out, &OURS)?;
    Ok(out)
}

/// Fits the table, compiles library and modules, writes the configuration.
fn build(setup: &Setup, out: &Path, components: &[&str]) -> Outcome {
    let modules = out.join("modules");
    std::fs::create_dir_all(&modules).map_err(|e| format!("{}: {e}", out.display()))?;
    let fitted = commands::fit(Some(&setup.machine), Some(&setup.data), None, TermChoice::Select, out);
    fitted.map_err(|e| e.to_string())?;
    let library = c::library_here(out)?;
    compile(components, &library, &modules)?;

    let machine = machine_file(&setup.machine)?;
    let write = |name: &str, text: String| {
        std::fs::write(out.join(name), text).map_err(|e| format!("{}: {e}", out.join(name).display()))
    };
    for name in FILES {
        write(name, template(name)?)?;
    }
    write("pkm.ini", ini(&machine)?)?;
    let program = match &setup.job {
        Some(job) => program(&machine, job, setup.slide_mm)?,
        None => "M2\n".to_owned(),
    };
    write("holes.ngc", program)?;
    println!("{}: LinuxCNC's modules and configuration for the machine {}", out.display(), machine.name);
    Ok(())
}

fn template(name: &str) -> Result<String, String> {
    let path = root().join("linuxcnc").join(name);
    std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
}

fn machine_file(path: &Path) -> Result<MachineFile, String> {
    Source::read(path).and_then(MachineFile::parse).map_err(|e| e.to_string())
}

fn compile(components: &[&str], library: &Path, to: &Path) -> Outcome {
    let work = tempfile::tempdir().map_err(|e| e.to_string())?;
    let copy = |from: PathBuf, to: PathBuf| {
        std::fs::copy(&from, &to).map(drop).map_err(|e| format!("{} to {}: {e}", from.display(), to.display()))
    };
    copy(root().join("pkm-ffi/include/pkm.h"), work.path().join("pkm.h"))?;
    for component in components {
        let component = Path::new(component);
        let name = component.file_name().ok_or("a component without a name")?;
        copy(root().join("linuxcnc").join(component), work.path().join(name))?;
        let mut halcompile = Command::new("halcompile");
        halcompile.current_dir(work.path()).arg("--compile").arg(name);
        // LinuxCNC puts these before the objects that need the library
        let flags = format!("-Wl,--undefined=pkm_version {}", library.display());
        halcompile.env("LDFLAGS", flags);
        let said = output(&mut halcompile)?;
        if said.contains("warning") {
            return Err(said);
        }
        let module = Path::new(name).with_extension("so");
        copy(work.path().join(&module), to.join(&module))?;
    }
    Ok(())
}

/// Home of a machine.
fn home(machine: &MachineFile) -> Configuration<f64> {
    let z0_m = machine.wrist_parameters.home_z0_m;
    Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m }, beta_rad: [0.0; 2] }
}

/// Joints as LinuxCNC has them: mm and degrees.
fn in_file_units(joints: &JointValues<f64>) -> [f64; 5] {
    let ([a, b, c], [d, e]) = (joints.lengths.q_m.map(|q| q * 1e3), joints.beta_rad.map(f64::to_degrees));
    [a, b, c, d, e]
}

fn ini(machine: &MachineFile) -> Result<String, String> {
    let five = machine.five_axis().map_err(|e| e.to_string())?;
    let said = |e: pkm_core::ToolError| e.to_string();
    let home = home(machine);
    let (at, tool) = (five.joints(&home).map_err(said)?, five.tool(&home).map_err(said)?);
    let (travel, wrist) = (&machine.parameters.travel, &machine.wrist_parameters);
    let range = |i: usize| match i {
        0..3 => [travel.min_m[i] * 1e3, travel.max_m[i] * 1e3],
        _ => [wrist.min_rad[i - 3].to_degrees(), wrist.max_rad[i - 3].to_degrees()],
    };
    let [mut axes, mut screws, mut turns] = [const { String::new() }; 3];
    for (i, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
        let (middle, wide) = (tool.tip_m[i] * 1e3, wrist.home_z0_m * 1e3);
        let limits = [(middle - wide).floor(), (middle + wide).ceil()];
        axes.push_str(&section(&format!("AXIS_{letter}"), limits, [100.0, 500.0], ""));
    }
    for (i, letter) in ["A", "B"].into_iter().enumerate() {
        axes.push_str(&section(&format!("AXIS_{letter}"), range(i + 3), [30.0, 200.0], ""));
    }
    for (i, stands) in in_file_units(&at).into_iter().enumerate() {
        let (kind, limits, to) =
            if i < 3 { ("LINEAR", [120.0, 1000.0], &mut screws) } else { ("ANGULAR", [40.0, 400.0], &mut turns) };
        // no switches in a simulation: home is where the machine stands when it is homed
        let rest = format!(
            "TYPE = {kind}\nHOME_OFFSET = {stands}\nHOME = {stands}\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\n\
             HOME_SEQUENCE = 0\nFERROR = 1\nMIN_FERROR = 1\n"
        );
        to.push_str(&section(&format!("JOINT_{i}"), range(i), limits, &rest));
    }
    let text = template("pkm.ini")?;
    let checksum = format!("{:016x}", machine.parameters.checksum());
    let fill = [
        ("{name}", machine.name.as_str()),
        ("{checksum}", &checksum),
        ("{axes}", &axes),
        ("{screws}", &screws),
        ("{wrist}", &turns),
    ];
    Ok(fill.iter().fold(text, |text, (mark, value)| text.replace(mark, value)))
}

fn section(name: &str, [min, max]: [f64; 2], [velocity, acceleration]: [f64; 2], rest: &str) -> String {
    format!(
        "[{name}]\nMIN_LIMIT = {min}\nMAX_LIMIT = {max}\nMAX_VELOCITY = {velocity}\nMAX_ACCELERATION = {acceleration}\n\
         {rest}\n"
    )
}

/// Before a hole, and how deep it is, mm.
const CLEAR_MM: f64 = 10.0;
const DEEP_MM: f64 = 5.0;

/// The holes of a job, drilled: X Y Z A B at every millimetre along the tool's axis, since A and B that hold it change on the
/// way. Its load goes to the stiffness component while it cuts.
fn program(machine: &MachineFile, job: &Path, slide_mm: &[[f64; 2]]) -> Result<String, String> {
    let job = Source::read(job).and_then(|s| Job::parse(&s)).map_err(|e| e.to_string())?;
    let five = machine.five_axis().map_err(|e| e.to_string())?;
    let mut text = format!(
        "%\n(Machine {}: X Y Z are the tip in the base's frame, z away from the base; A B turn the wrist.)\n\
         (M67 tells the load of the cut to the stiffness component: E0 to E5 are N and N m on the tool.)\n\
         G17 G21 G40 G49 G80 G90 G94 G64 P0.001\nT1 M6\nS1000 M3\n",
        machine.name
    );
    let mut near = home(machine);
    for (n, series) in job.series.iter().enumerate() {
        let [dx, dy] = slide_mm.get(n).copied().unwrap_or_default().map(|mm| mm / 1e3);
        let plate = job.table_in_base([dx, dy, 0.0]);
        for (m, hole) in series.holes.iter().enumerate() {
            let (tip, axis) = (plate.origin_m + plate.rotation * hole.tip_m, plate.rotation * hole.axis);
            let mut point = |depth_mm: f64| {
                let tool = Tool { tip_m: (tip + axis * (depth_mm / 1e3)).into(), axis: axis.into() };
                let hold = five.search(&tool, &near).map_err(|e| format!("hole {} of {}: {e}", m + 1, series.name))?;
                near = hold.configuration;
                let [x, y, z] = tool.tip_m.map(|v| v * 1e3);
                let [a, b] = near.beta_rad.map(f64::to_degrees);
                Ok::<_, String>(format!("X{x:.6} Y{y:.6} Z{z:.6} A{a:.8} B{b:.8}\n"))
            };
            write!(text, "(hole {} of series {})\nG0 {}", m + 1, series.name, point(-CLEAR_MM)?).ok();
            write!(text, "G0 {}", point(-1.0)?).ok();
            let load = series.wrench.force_n.into_iter().chain(series.wrench.moment_nm).enumerate();
            let load: Vec<(usize, f64)> = load.filter(|(_, v)| *v != 0.0).collect();
            text.extend(load.iter().map(|(i, v)| format!("M67 E{i} Q{v}\n")));
            for depth in 0..=DEEP_MM as i32 {
                write!(text, "G1 F300 {}", point(f64::from(depth))?).ok();
            }
            text.extend(load.iter().map(|(i, _)| format!("M67 E{i} Q0\n")));
            for depth in (-(CLEAR_MM as i32)..DEEP_MM as i32).rev() {
                write!(text, "G0 {}", point(f64::from(depth))?).ok();
            }
        }
    }
    text.push_str("M5\nM2\n%\n");
    Ok(text)
}

/// A command in a folder that sees our modules among LinuxCNC's, and leaves no trace: `loadrt` takes names only.
fn among_modules(ours: &Path, folder: &Path) -> Result<Command, String> {
    let modules = folder.join("all-modules");
    std::fs::create_dir_all(&modules).map_err(|e| e.to_string())?;
    for from in [Path::new(MODULES), ours] {
        for entry in std::fs::read_dir(from).map_err(|e| format!("{}: {e}", from.display()))? {
            let entry = entry.map_err(|e| e.to_string())?;
            if entry.path().is_file() {
                std::fs::copy(entry.path(), modules.join(entry.file_name())).map_err(|e| e.to_string())?;
            }
        }
    }
    let mut command = Command::new("unshare");
    let is_root = output(Command::new("id").arg("-u"))?.trim() == "0";
    if is_root {
        // what LinuxCNC becomes in place of root, and a place that it may write
        command.env("RTAPI_UID", "65534").env("RTAPI_FIFO_PATH", folder.join("rtapi_fifo"));
        output(Command::new("chown").arg("-R").arg("65534").arg(folder))?;
    } else {
        command.args(["--user", "--map-current-user", "--keep-caps"]);
    }
    let script = format!("mount --bind all-modules {MODULES} && exec \"$@\"");
    command.current_dir(folder).args(["--mount", "sh", "-c", &script, "sh"]);
    Ok(command)
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
/// Real pins of the recorder, then flags and whole numbers; times stand before them.
const REALS: usize = 80;
const ROW: usize = 3 + REALS + 2 + 4;

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
    let mut tie = |n: usize, name: &str, pin: String| {
        // a pin that no net has gets one of its own
        let net = if name.contains('.') { format!("kept-{pin} {name}") } else { name.to_owned() };
        writeln!(text, "net {} => pkmrecord.{pin}", net.replace("kept-", &format!("kept{n}-"))).ok();
    };
    for (n, name) in names.iter().enumerate() {
        tie(n, name, format!("real-{n:03}"));
    }
    for (n, name) in ["pkmstiffness.ok", "pkmstiffness.inside-box"].into_iter().enumerate() {
        tie(100 + n, name, format!("flag-{n}"));
    }
    let whole = ["pkmkins.inverse-ns", "pkmkins.forward-ns", "pkmstiffness.last-ns", "pkmkins.why"];
    for (n, name) in whole.into_iter().enumerate() {
        tie(200 + n, name, format!("whole-{n}"));
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

/// Drives a machine through homing, moves, loads, refusals and its program, and holds every period against the host.
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
    judge_rows(name, &host, &numbers(&record, ROW)?, &load, periods).or_else(fails)
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
        if !matches!(name, "unreachable" | "singular" | "through") && !(quiet && step["on"] == true) {
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

/// What the stiffness component does in a period.
fn component(
    five: &FiveAxis<'_, f64>,
    table: &CorrectionTable<'_, f64>,
    stands: &[f64],
    force: &Wrench<f64>,
) -> Result<(Tool<f64>, Corrected<f64>, CompensatedTool<f64>), String> {
    let stood = five.forward(&joints_of(stands)).map_err(|e| e.to_string())?;
    let tool = five.tool(&stood).map_err(|e| e.to_string())?;
    let stiffness = table.factor_form(five.machine, &stood.pose).map_err(|e| e.to_string())?;
    let wanted = five.compensated(Some(table), &tool, force, &stood).map_err(|e| e.to_string())?;
    Ok((tool, stiffness, wanted))
}

/// What the recorder saw, period by period.
fn judge_rows(name: &str, host: &Host, rows: &[Vec<f64>], load: &[f64; 6], periods: usize) -> Outcome {
    let (five, table) = (host.five()?, host.table()?);
    let mut off = [0.0_f64; 5];
    let (mut loaded, mut stepped, mut inside, mut valid, mut jump, mut looks) = (0, 0, 0, 0, 0.0_f64, Vec::new());
    let mut last: Option<(Vec<f64>, Configuration<f64>)> = None;
    let (mut late, mut by_us) = (0, 0);
    let keep = |to: &mut f64, d: f64| *to = if d > *to || d.is_nan() { d } else { *to };
    for row in rows {
        let real = &row[3..3 + REALS];
        let mut next = 0;
        let mut take = |n: usize| {
            next += n;
            &real[next - n..next]
        };
        let (asked, given, felt, placed) = (take(5), take(5), take(5), take(5));
        let (stands, wrench, offsets, moved) = (take(5), take(6), take(5), take(6));
        let (margins, target_share, command, k) = (take(3), take(1), take(5), take(21));
        if asked != [0.0; 5] {
            let hold = held(&five, asked)?;
            keep(&mut off[0], worst(given, &in_file_units(&hold.joints)));
            keep(&mut off[0], (hold.home_share - target_share[0]).abs());
        }
        if felt != [0.0; 5] {
            let stands = five.forward(&joints_of(felt)).map_err(|e| e.to_string())?;
            let [x, y, z] = five.tool(&stands).map_err(|e| e.to_string())?.tip_m.map(|m| m * 1e3);
            keep(&mut off[1], worst(placed, &[x, y, z, felt[3], felt[4]]));
        }
        let ok = row[3 + REALS] == 1.0;
        // as long as it is not homed the joints mean nothing
        let Ok(stood) = five.forward(&joints_of(stands)) else {
            if ok {
                return Err(format!("results without a pose: {row:?}"));
            }
            continue;
        };
        if !ok {
            return Err(format!("no results where the host has some: {row:?}"));
        }
        valid += 1;
        let [fx, fy, fz, mx, my, mz] = *wrench else { return Err("a wrench is six numbers".into()) };
        let force = Wrench { force_n: [fx, fy, fz], moment_nm: [mx, my, mz] };
        let (tool, stiffness, wanted) = component(&five, &table, stands, &force)?;
        if row[0] > PERIOD_NS {
            late += 1;
            // the same again: what was taken away from the thread does not come again
            let again = (0..20).map(|_| {
                let begun = std::time::Instant::now();
                let done = component(&five, &table, stands, &force).is_ok() && held(&five, asked).is_ok();
                if done { begun.elapsed().as_nanos() as f64 } else { f64::INFINITY }
            });
            let again = again.fold(f64::INFINITY, f64::min);
            println!(
                "  an overrun: {:.0} ns, {:.0} of them in the component; the same again takes {again:.0} ns",
                row[0], row[2]
            );
            by_us += usize::from(again > 0.5 * PERIOD_NS);
        }
        let to: Vec<f64> = in_file_units(&wanted.hold.joints).iter().zip(stands).map(|(to, at)| to - at).collect();
        keep(&mut off[2], worst(offsets, &to));
        let moves = [wanted.deflection.translation_m, wanted.deflection.rotation_rad].concat();
        keep(&mut off[3], worst(moved, &moves.iter().map(|v| v * 1e6).collect::<Vec<_>>()));
        let distance = five.machine.singularity_distance(&stood.pose).map_err(|e| e.to_string())?;
        keep(&mut off[3], worst(margins, &[wanted.hold.home_share, distance.limbs_1_2, distance.limb_3]));
        let matrix = stiffness.factor.stiffness().matrix();
        let upper = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
        for ((i, j), found) in upper.zip(k) {
            keep(&mut off[4], (found - matrix[i][j]).abs() / (matrix[i][i] * matrix[j][j]).sqrt());
        }
        let in_box = stiffness.domain == Domain::Inside && wanted.deflection.domain == Some(Domain::Inside);
        if in_box != (row[3 + REALS + 1] == 1.0) {
            return Err(format!("inside the box or not: {row:?}"));
        }
        inside += usize::from(in_box);
        let size = offsets.iter().fold(0.0_f64, |size, d| size.max(d.abs()));
        loaded += usize::from(wrench != [0.0; 6] && size > 1e-4);
        stepped += usize::from(wrench == load && size > 1e-4);
        if let Some((before, near)) = &last {
            keep(&mut jump, worst(command, before));
            looks.push(five.inverse(&tool, near).map_err(|e| e.to_string())?.looks);
        }
        last = Some((command.to_vec(), stood));
    }
    println!(
        "  {} periods, {valid} with results, {loaded} of them under load, {inside} inside the table's box\n  \
         greatest differences from the host: inverse {:.1e} and forward {:.1e} mm or degrees, offsets {:.1e} mm or degrees, \
         deflection {:.1e} um or urad, K_m {:.1e} of its diagonal",
        rows.len(),
        off[0],
        off[1],
        off[2],
        off[3],
        off[4]
    );
    let most = looks.iter().max().copied().unwrap_or(0);
    let middle = spread(looks.iter().map(|n| f64::from(*n)))[0];
    println!(
        "  iterations: none, both ways; a control that asks for tool vectors would take {middle} looks from period to period, \
         {most} at the most"
    );
    println!("  furthest a joint's command moved in a period: {jump:.4} mm or degrees");
    let column = |i: usize| spread(rows.iter().map(|r| r[i]));
    let whole = 3 + REALS + 2;
    let [wall, cpu, ours] = [column(0), column(1), column(2)];
    let [inverse, forward, stiffness] = [column(whole), column(whole + 1), column(whole + 2)];
    for (what, [half, most, all]) in [
        ("inverse", inverse),
        ("forward", forward),
        ("stiffness component", stiffness),
        ("the same, processor's time", ours),
        ("whole servo thread", wall),
        ("the same, processor's time", cpu),
    ] {
        println!("  {what:28} {half:8.0} ns at the median, {most:8.0} at 99.9 %, {all:9.0} at the most");
    }
    // both kinematics run within motion-controller: once a period each
    let share = (inverse[0] + forward[0] + stiffness[0]) / wall[0];
    println!(
        "  our share of the thread's time at the median {:.0} %, of the period {:.1} %; periods overrun {late}, by us {by_us}",
        100.0 * share,
        100.0 * (inverse[0] + forward[0] + stiffness[0]) / PERIOD_NS
    );
    let exact = off[..3].iter().all(|d| *d <= 1e-9) && off[3] <= 1e-6 && off[4] <= 1e-12;
    if !exact {
        return Err(format!("not the host's: {off:?}"));
    }
    if rows.len() < periods {
        return Err(format!("{} periods, {periods} were asked for", rows.len()));
    }
    if loaded < 1000 || stepped < 100 || inside == 0 {
        return Err(format!("{loaded} periods under load, {stepped} under the step, {inside} inside the box"));
    }
    // the fastest joint does 120 mm/s
    if !(jump <= 0.121) {
        return Err(format!("a joint jumped by {jump} in a period"));
    }
    if by_us > 0 {
        return Err(format!("{by_us} periods overrun by {name}'s functions"));
    }
    Ok(())
}

/// Of the configuration.
const PERIOD_NS: f64 = 1e6;

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
        if which == 0 && !(refused == 0.0 && error <= 1e-9) {
            return Err(format!("inverse and forward are {error:e} apart, {refused} refused"));
        }
    }
    if rows.len() < 90_000 { Err(format!("only {} periods", rows.len())) } else { Ok(()) }
}

fn test() -> Outcome {
    drive("reference", 100_000)?;
    drive("x150", 20_000)
}

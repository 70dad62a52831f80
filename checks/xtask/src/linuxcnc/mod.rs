//! LinuxCNC with our kinematics and stiffness: its modules and a configuration for a machine.

mod compensated;
mod faults;
mod feed;
mod learning;
mod lost;
mod memory;
mod replay;
mod simulation;
mod weight;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use pkm_core::compensator::CompensatorSettings;
use pkm_core::nalgebra::Vector2;
use pkm_core::{Configuration, JointValues, Pose, Tool};
use pkm_host::cli;
use pkm_host::files::job::{Job, Position};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_host::files::table_numbers::TableNumbers;

use crate::{Outcome, c, output, root};

const USAGE: &str = "\
cargo xtask linuxcnc
  (alone)            build both machines below and test them under LinuxCNC, headless
  build              modules and configurations of both to out/linuxcnc
  build --machine my.toml --data k.csv | --table DIR [--job job.toml] --out DIR
                     the same of a machine of one's own, with holes to drill where a job file has some; its table is fitted to stiffnesses,
                     or is that which `pkm-host fit` or `diagnose` wrote to a folder (of diagnose's machine.toml)
  run reference|x150 build, and start LinuxCNC on a screen with the modules shown to it alone: nothing is installed";

/// Where Debian's LinuxCNC looks for modules; `loadrt` takes them from nowhere else.
const MODULES: &str = "/usr/lib/linuxcnc/modules";
const PACKAGES: &str = "apt-get install --no-install-recommends linuxcnc-uspace linuxcnc-uspace-dev gcc make";
const OURS: [&str; 3] = ["modules/pkmkins.comp", "modules/pkmcompensator.comp", "modules/pkmfeed.comp"];
/// Copied into a configuration as they are.
const FILES: [&str; 5] = ["pkm.hal", "panel.hal", "panel.xml", "tool.tbl", "on_abort.ngc"];

/// Where a table comes from: stiffnesses that it is fitted to, or the folder that it was written to.
enum Table {
    Data(PathBuf),
    Folder(PathBuf),
}

/// A machine to build for.
struct Setup {
    machine: PathBuf,
    table: Table,
    job: Option<PathBuf>,
    /// dx and dy of the job's cross slide for each of its series, mm; 0 where there are none.
    slide_mm: &'static [[f64; 2]],
    /// With ideal drives, and a load that the program computes.
    is_simulated: bool,
}

/// Soft limits of real screws are the largest offset inside their travel, mm: where a drive's feedback is beyond it there is no forward
/// kinematics.
const INSIDE_MM: f64 = CompensatorSettings::DEFAULT.max_screw_m * 1e3;

fn ready(name: &str) -> Option<Setup> {
    let fixture = |path: &str| root().join("fixtures").join(path);
    let machine = fixture(&format!("machines/{name}.toml"));
    match name {
        "reference" => Some(Setup {
            machine,
            table: Table::Data(fixture("jobs/wide-k.csv")),
            job: Some(fixture("jobs/plate.toml")),
            slide_mm: &[[40.0, 240.0], [-65.0, -15.0]],
            is_simulated: true,
        }),
        "x150" => Some(Setup {
            machine,
            table: Table::Data(fixture("stiffness/x150.csv")),
            job: Some(fixture("jobs/x150-plate.toml")),
            slide_mm: &[],
            is_simulated: true,
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
        [] => simulation::run(),
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
    let known = ["--machine", "--data", "--table", "--job", "--out"];
    let table = match (value("--data"), value("--table")) {
        (Some(data), None) => Table::Data(data.into()),
        (None, Some(folder)) => Table::Folder(folder.into()),
        _ => return Err(USAGE.to_owned()),
    };
    let (Some(machine), Some(out)) = (value("--machine"), value("--out")) else { return Err(USAGE.to_owned()) };
    if options.chunks(2).any(|pair| pair.len() < 2 || !known.contains(&pair[0])) {
        return Err(USAGE.to_owned());
    }
    let job = value("--job").map(PathBuf::from);
    let setup = Setup { machine: machine.into(), table, job, slide_mm: &[], is_simulated: false };
    let out = Path::new(out);
    if out.join("pkm.ini").exists() {
        return Err(format!(
            "{}: there is a configuration already, and it may have been changed: build to another --out, and take modules and \
             checksums from there",
            out.display()
        ));
    }
    build(&setup, out, &OURS)
}

fn build_ready(name: &str) -> Result<PathBuf, String> {
    let setup = ready(name).ok_or_else(|| USAGE.to_owned())?;
    let out = root().join("out/linuxcnc").join(name);
    build(&setup, &out, &OURS)?;
    Ok(out)
}

/// Fits the table, or copies it.
fn put_table(setup: &Setup, machine: &MachineFile, out: &Path) -> Outcome {
    match &setup.table {
        Table::Data(data) => {
            let fitted = cli::run([
                "fit".as_ref(),
                "--machine".as_ref(),
                setup.machine.as_os_str(),
                "--data".as_ref(),
                data.as_os_str(),
                "--terms=select".as_ref(),
                "--out".as_ref(),
                out.as_os_str(),
            ]);
            print!("{}", fitted.map_err(|e| e.to_string())?.text);
        }
        Table::Folder(folder) => {
            if table_file(folder)?.machine_sha256 != machine.source.sha256() {
                return Err(format!(
                    "{}: the table is of another machine file than {}: that of `diagnose` is the machine.toml beside it",
                    folder.display(),
                    setup.machine.display()
                ));
            }
            for name in ["coefficients.json", "coefficients.rs"] {
                let from = folder.join(name);
                std::fs::copy(&from, out.join(name)).map_err(|e| format!("{}: {e}", from.display()))?;
            }
        }
    }
    Ok(())
}

/// Compiles library and modules, writes the configuration.
fn build(setup: &Setup, out: &Path, components: &[&str]) -> Outcome {
    let machine = machine_file(&setup.machine)?;
    let program = match &setup.job {
        Some(job) => program(&machine, job, setup.slide_mm)?,
        None => "M2\n".to_owned(),
    };
    let modules = out.join("modules");
    std::fs::create_dir_all(&modules).map_err(|e| format!("{}: {e}", out.display()))?;
    put_table(setup, &machine, out)?;
    compile(components, &c::library_here(out)?, &modules)?;
    let write = |name: &str, text: String| {
        std::fs::write(out.join(name), text).map_err(|e| format!("{}: {e}", out.join(name).display()))
    };
    for name in FILES {
        write(name, template(name)?)?;
    }
    if !setup.is_simulated {
        write("pkm.hal", for_a_sensor(&template("pkm.hal")?)?)?;
    }
    let inside_mm = if setup.is_simulated { 0.0 } else { INSIDE_MM };
    write("pkm.ini", ini(&machine, inside_mm, table(out)?.table().map_err(|e| e.to_string())?.checksum())?)?;
    write("holes.ngc", program)?;
    println!("{}: LinuxCNC's modules and configuration for the machine {}", out.display(), machine.name);
    Ok(())
}

/// The configuration with the compensator's own gain and its look at a stuck sensor: what a load that is computed has no need of stands there
/// as comments.
fn for_a_sensor(hal: &str) -> Result<String, String> {
    let mut hal = hal.to_owned();
    for line in ["\nsetp pkmcompensator.gain 1\n", "\nsetp pkmcompensator.stuck-s 0\n"] {
        if !hal.contains(line) {
            return Err(format!("pkm.hal has no line that a sensor does without: {}", line.trim()));
        }
        hal = hal.replace(line, &line.replace("setp", "#setp"));
    }
    Ok(hal)
}

fn template(name: &str) -> Result<String, String> {
    let path = root().join("embed/linuxcnc").join(name);
    std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
}

fn machine_file(path: &Path) -> Result<MachineFile, String> {
    Source::read(path).and_then(MachineFile::parse).map_err(|e| e.to_string())
}

/// The table that was written to a folder.
fn table_file(folder: &Path) -> Result<TableFile, String> {
    Source::read(&folder.join("coefficients.json")).and_then(|s| TableFile::parse(&s)).map_err(|e| e.to_string())
}

/// Its numbers.
fn table(folder: &Path) -> Result<TableNumbers, String> {
    Ok(table_file(folder)?.numbers())
}

fn compile(components: &[&str], library: &Path, to: &Path) -> Outcome {
    let work = tempfile::tempdir().map_err(|e| e.to_string())?;
    let copy = |from: PathBuf, to: PathBuf| {
        std::fs::copy(&from, &to).map(drop).map_err(|e| format!("{} to {}: {e}", from.display(), to.display()))
    };
    let headers = ["c/include/pkm.h", "linuxcnc/modules/checksums.h", "linuxcnc/modules/learned.h"];
    for (header, name) in headers.into_iter().zip(["pkm.h", "checksums.h", "learned.h"]) {
        copy(root().join("embed").join(header), work.path().join(name))?;
    }
    for component in components {
        let component = Path::new(component);
        let name = component.file_name().ok_or("a component without a name")?;
        copy(root().join("embed/linuxcnc").join(component), work.path().join(name))?;
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
    Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m }, beta_rad: Vector2::zeros() }
}

/// Joints as LinuxCNC has them: mm and degrees.
fn in_file_units(joints: &JointValues<f64>) -> [f64; 5] {
    let [a, b, c] = (joints.lengths.q_m * 1e3).into();
    let [d, e] = joints.beta_rad.map(f64::to_degrees).into();
    [a, b, c, d, e]
}

fn ini(machine: &MachineFile, inside_mm: f64, table_checksum: u64) -> Result<String, String> {
    let five = machine.five_axis().map_err(|e| e.to_string())?;
    let said = |e: pkm_core::ToolError| e.to_string();
    let home = home(machine);
    let (at, tool) = (five.joints(&home).map_err(said)?, five.tool(&home).map_err(said)?);
    let (travel, wrist) = (&machine.parameters.travel, &machine.wrist_parameters);
    let range = |i: usize| match i {
        0..3 => [travel.min_m[i] * 1e3 + inside_mm, travel.max_m[i] * 1e3 - inside_mm],
        _ => [wrist.min_rad[i - 3].to_degrees(), wrist.max_rad[i - 3].to_degrees()],
    };
    let [mut axes, mut screws, mut turns] = [const { String::new() }; 3];
    for (i, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
        let (middle, wide) = (tool.tip_m[i] * 1e3, wrist.home_z0_m * 1e3);
        let limits = [(middle - wide).floor(), (middle + wide).ceil()];
        axes.push_str(&section(&format!("AXIS_{letter}"), limits, [100.0, 500.0], ""));
    }
    for (i, letter) in ["A", "B"].into_iter().enumerate() {
        // slow: LinuxCNC holds the axes' velocities, not the joints', and a turn with the tip held moves the screws
        axes.push_str(&section(&format!("AXIS_{letter}"), range(i + 3), [10.0, 100.0], ""));
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
    let sums = [machine.parameters.checksum(), wrist.checksum(), table_checksum];
    let [machine_sum, wrist_sum, table_sum] = sums.map(|sum| format!("{sum:016x}"));
    let fill = [
        ("{name}", machine.name.as_str()),
        ("{machine_checksum}", &machine_sum),
        ("{wrist_checksum}", &wrist_sum),
        ("{table_checksum}", &table_sum),
        ("{axes}", &axes),
        ("{screws}", &screws),
        ("{turns}", &turns),
    ];
    Ok(fill.iter().fold(text, |text, (mark, value)| text.replace(mark, value)))
}

fn section(name: &str, [min, max]: [f64; 2], [velocity, acceleration]: [f64; 2], rest: &str) -> String {
    format!(
        "[{name}]\nMIN_LIMIT = {min}\nMAX_LIMIT = {max}\nMAX_VELOCITY = {velocity}\nMAX_ACCELERATION = {acceleration}\n\
         {rest}\n"
    )
}

/// A name as part of a comment.
fn plain(name: &str) -> String {
    name.replace(['(', ')'], " ")
}

/// Before a hole, and how deep it is, mm.
const CLEARANCE_MM: f64 = 10.0;
const DEEP_MM: f64 = 5.0;

/// The holes of a job, drilled: X Y Z A B at every millimetre along the tool's axis, since A and B that hold it change on the
/// way. Its load goes to the compensation while it cuts.
fn program(machine: &MachineFile, job: &Path, slide_mm: &[[f64; 2]]) -> Result<String, String> {
    let job = Source::read(job).and_then(|s| Job::parse(&s)).map_err(|e| e.to_string())?;
    let five = machine.five_axis().map_err(|e| e.to_string())?;
    let mut text = format!(
        "%\n(Machine {}: X Y Z are the tip in the base's frame, z away from the base; A B turn the wrist.)\n\
         (M67 tells the load of the cut to the compensation: E0 to E5 are N and N m on the tool.)\n\
         G17 G21 G40 G49 G80 G90 G94 G64 P0.001\nT1 M6\nS1000 M3\n",
        plain(&machine.name)
    );
    // one that has ended may have left its load
    text.extend((0..6).map(|i| format!("M68 E{i} Q0\n")));
    let mut near = home(machine);
    for (n, series) in job.series.iter().enumerate() {
        let [dx_m, dy_m] = slide_mm.get(n).copied().unwrap_or_default().map(|mm| mm / 1e3);
        let plate = job.table_in_base(&Position { dx_m, dy_m, rotary_rad: 0.0 });
        for (m, hole) in series.holes.iter().enumerate() {
            let (tip, axis) = (plate.origin_m + plate.rotation * hole.tip_m, plate.rotation * hole.axis);
            let mut point = |depth_mm: f64| {
                let tool = Tool { tip_m: tip + axis * (depth_mm / 1e3), axis };
                let solution =
                    five.search(&tool, &near).map_err(|e| format!("hole {} of {}: {e}", m + 1, series.name))?;
                near = solution.configuration;
                let [x, y, z] = (tool.tip_m * 1e3).into();
                let [a, b] = near.beta_rad.map(f64::to_degrees).into();
                Ok::<_, String>(format!("X{x:.6} Y{y:.6} Z{z:.6} A{a:.8} B{b:.8}\n"))
            };
            write!(text, "(hole {} of series {})\nG0 {}", m + 1, plain(&series.name), point(-CLEARANCE_MM)?).ok();
            write!(text, "G0 {}", point(-1.0)?).ok();
            let load = series.wrench.to_vector();
            let load: Vec<_> = load.iter().enumerate().filter(|(_, v)| **v != 0.0).collect();
            text.extend(load.iter().map(|(i, v)| format!("M67 E{i} Q{v}\n")));
            for depth in 0..=DEEP_MM as i32 {
                write!(text, "G1 F300 {}", point(f64::from(depth))?).ok();
            }
            text.extend(load.iter().map(|(i, _)| format!("M67 E{i} Q0\n")));
            for depth in (-(CLEARANCE_MM as i32)..DEEP_MM as i32).rev() {
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

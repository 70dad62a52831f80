//! The C library: its header, what its objects ask for, and C programs on this computer and on Cortex-M processors.

pub mod compensator;
mod estimator;

use std::path::{Path, PathBuf};
use std::process::Command;

use pkm_core::checksum::{START, over_text};
use pkm_core::compensator::{Compensator, CompensatorSettings, Known, Offset, OutsideBox, Reading};
use pkm_core::effects::EFFECTS;
use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::{
    Configuration, CorrectionTable, Cycle, Deflection, Domain, FiveAxis, JointValues, Model, Pose, Scalar,
    ScrewLengths, TableUncertainty, TemperatureRise, TipUncertainty, Tool, ToolMotion, ToolSolution, Wrench,
};

use crate::image::symbols;
use crate::qemu::{ELEMENTS, Host, boot, fit};
use crate::{Outcome, output, root};

/// Where a C program runs.
struct Platform {
    name: &'static str,
    compiler: &'static str,
    flags: &'static [&'static str],
    /// Target and `target-cpu` of the library.
    target: Option<(&'static str, &'static str)>,
    /// Machine of QEMU.
    board: Option<&'static str>,
    /// Whether a planted panic is looked for: once for each format of objects.
    planted: bool,
}

const ARM: &str = "thumbv7em-none-eabihf";

const PLATFORMS: [Platform; 3] = [
    Platform { name: "this computer", compiler: "cc", flags: &[], target: None, board: None, planted: true },
    Platform {
        name: "Cortex-M4F",
        compiler: "arm-none-eabi-gcc",
        flags: &["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"],
        target: Some((ARM, "cortex-m4")),
        board: Some("mps2-an386"),
        planted: true,
    },
    Platform {
        name: "Cortex-M7",
        compiler: "arm-none-eabi-gcc",
        flags: &["-mcpu=cortex-m7", "-mfpu=fpv5-d16"],
        target: Some((ARM, "cortex-m7")),
        board: Some("mps2-an500"),
        planted: false,
    },
];

const STRICT: [&str; 3] = ["-Wall", "-Wextra", "-Werror"];

fn folder() -> PathBuf {
    root().join("embed/c")
}

fn cargo(command: &str) -> Command {
    let mut cargo = Command::new("cargo");
    cargo.current_dir(folder()).args([command, "--locked", "--quiet"]);
    cargo
}

/// The header as cbindgen writes it now.
fn header_now() -> Result<String, String> {
    // cbindgen sees no macros, and the pinned compiler expands them only with its unstable options on
    let mut expand = cargo("rustc");
    expand.args(["--profile", "check", "--", "-Zunpretty=expanded"]).env("RUSTC_BOOTSTRAP", "1");
    let expanded = output(&mut expand)?;
    // nor does it work out a size
    let size = size_of::<pkm_core::Machine<f64>>() / size_of::<f64>();
    let (before, rest) = expanded.split_once("PKM_MACHINE_NUMBERS: usize =").ok_or("no size of a machine")?;
    let (_, after) = rest.split_once(';').ok_or("no size of a machine")?;
    let source = tempfile::NamedTempFile::new().map_err(|e| e.to_string())?;
    let text = format!("{before}PKM_MACHINE_NUMBERS: usize = {size};{after}");
    std::fs::write(source.path(), text).map_err(|e| e.to_string())?;
    let config = cbindgen::Config::from_file(folder().join("cbindgen.toml"))?;
    let bindings = cbindgen::Builder::new().with_config(config).with_src(source.path()).generate();
    let mut header = Vec::new();
    bindings.map_err(|e| e.to_string())?.write(&mut header);
    String::from_utf8(header).map_err(|e| e.to_string())
}

/// Version and checksum of the declarations of the last header, in the C library's folder.
const DECLARED: &str = "declared.txt";

/// A header's version with the checksum of its declarations: of everything but comments and the way lines are broken.
///
/// # Errors
/// `before` has the same version and other declarations: a program with the header of before would not be refused.
fn declared(header: &str, before: &str) -> Result<String, String> {
    let is_comment = |line: &&str| ["/*", "*", "//"].iter().any(|begin| line.trim_start().starts_with(begin));
    let code = header.lines().filter(|line| !is_comment(line)).flat_map(|line| line.split("//").take(1));
    let sum = code.flat_map(str::split_whitespace).fold(START, over_text);
    let (_, rest) = header.split_once("#define PKM_VERSION \"").ok_or("the header has no version")?;
    let version = rest.split('"').next().unwrap_or_default();
    let now = format!("{version} {sum:016x}\n");
    if now != before && before.split(' ').next() == Some(version) {
        return Err(format!(
            "pkm.h declares something else than before under the same PKM_VERSION, {version}: raise it in \
             embed/c/cbindgen.toml and embed/c/Cargo.toml, then cargo xtask header"
        ));
    }
    Ok(now)
}

/// Writes the header, unless it declares something else under the same version.
pub fn header() -> Outcome {
    let (path, record) = (folder().join("include/pkm.h"), folder().join(DECLARED));
    let header = header_now()?;
    let before = std::fs::read_to_string(&record).map_err(|e| format!("{}: {e}", record.display()))?;
    let now = declared(&header, &before)?;
    std::fs::write(&path, header).map_err(|e| format!("{}: {e}", path.display()))?;
    std::fs::write(&record, now).map_err(|e| format!("{}: {e}", record.display()))
}

/// Everything that holds of the C library.
pub fn run() -> Outcome {
    let path = folder().join("include/pkm.h");
    let read = |path: PathBuf| std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()));
    let (header, before) = (header_now()?, read(folder().join(DECLARED))?);
    if read(path.clone())? != header || declared(&header, &before)? != before {
        return Err("include/pkm.h is not what cbindgen writes: cargo xtask header".into());
    }
    let mut cpp = Command::new("c++");
    output(cpp.args(["-fsyntax-only", "-x", "c++", "-std=c++11"]).args(STRICT).arg(&path))?;
    println!("header: as cbindgen writes it; valid C++");
    output(&mut cargo("test"))?;
    println!("misuse from Rust: an error, and nothing is written");

    let fitted = tempfile::tempdir().map_err(|e| e.to_string())?;
    fit(&EFFECTS, ELEMENTS, fitted.path())?;
    let host = Host::read(fitted.path())?;
    let mut greeting = None;
    for platform in &PLATFORMS {
        let at = |message: String| format!("{}: {message}", platform.name);
        if platform.planted {
            let library = platform.library(fitted.path(), &["--features", "planted-panic"])?;
            if check_symbols(&library, platform).is_ok() {
                return Err(at("a planted panic was not found".into()));
            }
        }
        let library = platform.library(fitted.path(), &[])?;
        check_symbols(&library, platform).map_err(at)?;
        let run = |source: &str| platform.run(source, &library, fitted.path()).map_err(at);

        let cycle = run("examples/cycle.c")?;
        let first = greeting.get_or_insert_with(|| cycle.clone());
        if *first != cycle {
            return Err(at(format!("cycle.c prints other numbers than on this computer:\n{first}{cycle}")));
        }
        run("tests/misuse.c")?;
        let lines = compare(&run("tests/parity.c")?, &host).map_err(at)?;
        let periods = compensator::compare(&run("tests/compensator.c")?, &host).map_err(at)?;
        let readings = estimator::compare(&run("tests/estimator.c")?, &host).map_err(at)?;
        println!(
            "{}: no panic, no allocator; misuse is refused; {lines} results, {periods} periods of compensators and {readings} \
             readings of estimators, every bit as the host's",
            platform.name
        );
    }
    print!("examples/cycle.c prints, with every effect on:\n{}", greeting.unwrap_or_default());
    Ok(())
}

/// The library for this computer, with the `coefficients.rs` of a folder.
pub fn library_here(fitted: &Path) -> Result<PathBuf, String> {
    let fitted = fitted.canonicalize().map_err(|e| format!("{}: {e}", fitted.display()))?;
    PLATFORMS[0].library(&fitted, &[])
}

impl Platform {
    fn library(&self, fitted: &Path, features: &[&str]) -> Result<PathBuf, String> {
        let mut build = cargo("build");
        build.arg("--release").args(features).env("PKM_COEFFICIENTS", fitted.join("coefficients.rs"));
        let mut path = folder().join("target").join(self.name.replace(' ', "-"));
        build.arg("--target-dir").arg(&path);
        if let Some((target, cpu)) = self.target {
            build.args(["--target", target]).env("RUSTFLAGS", format!("-C target-cpu={cpu}"));
            path.push(target);
        }
        output(&mut build)?;
        Ok(path.join("release/libpkm.a"))
    }

    /// What a program prints.
    fn run(&self, source: &str, library: &Path, to: &Path) -> Result<String, String> {
        let ffi = folder();
        let program = to.join(Path::new(source).with_extension("elf").file_name().expect("a name"));
        let mut compile = Command::new(self.compiler);
        compile.current_dir(&ffi).args(["-std=c11", "-O2", "-Iinclude"]).args(STRICT).args(self.flags).arg(source);
        if self.board.is_some() {
            compile.args(["-mthumb", "-mfloat-abi=hard", "--specs=rdimon.specs", "-nostartfiles", "-Wl,--gc-sections"]);
            compile.args(["-T", "examples/mps2.ld", "examples/start.c"]);
        }
        output(compile.arg(library).args(["-lm", "-o"]).arg(&program))?;
        match self.board {
            Some(board) => boot(board, &program, &[]),
            None => output(&mut Command::new(&program)),
        }
    }
}

/// No panic, no allocator, and on a controller no memory of its own.
fn check_symbols(library: &Path, platform: &Platform) -> Outcome {
    for symbol in symbols(library)? {
        let refused = match symbol.kind {
            _ if symbol.name == "pkm_a_panic_is_reachable" => "a panic is reachable",
            _ if symbol.name.contains("alloc") => "an allocator is named",
            'b' | 'B' | 'd' | 'D' | 'C' if platform.board.is_some() => "memory is taken",
            _ => continue,
        };
        return Err(format!("{refused}: {}", symbol.name));
    }
    Ok(())
}

/// Holds what `parity.c` prints against the host; returns the number of results.
fn compare(text: &str, host: &Host) -> Result<usize, String> {
    let uncertainty = host.uncertainty()?;
    let mut lines = text.lines();
    let mut results = 0;
    while let Some(line) = lines.next() {
        let pose: Vec<u64> = line.split(' ').skip(2).map_while(|bits| u64::from_str_radix(bits, 16).ok()).collect();
        let [theta, sigma, z0] = pose[..] else { return Err(format!("not a pose: {line}")) };
        let bits = [theta, sigma, z0].map(f64::from_bits);
        let (in_double, in_single) = &uncertainty;
        let (double, single) =
            host.both(|m, t| expected(m, (t, in_double), bits), |m, t| expected(m, (t, in_single), bits))?;
        for (name, expected) in if line.starts_with("pose_f64") { double } else { single } {
            let line = lines.next().ok_or("the program stopped early")?;
            let mut words = line.split(' ');
            let found = words.next() == Some(name);
            let same = match &expected {
                Some(values) => words.eq(std::iter::once("0").chain(values.iter().map(String::as_str))),
                None => words.next().is_some_and(|error| error != "0") && words.next().is_none(),
            };
            if !(found && same) {
                return Err(format!("{line}\nwhere the host has {name} {expected:?}"));
            }
            results += 1;
        }
    }
    if results < 4000 { Err(format!("the program stopped early: {results} results")) } else { Ok(results) }
}

/// Holds lines that a program printed against the host's; returns their number.
fn same_lines(text: &str, expected: &[String]) -> Result<usize, String> {
    let found: Vec<&str> = text.lines().collect();
    match expected.iter().zip(&found).find(|(expected, found)| expected != *found) {
        Some((expected, found)) => Err(format!("{found}\nwhere the host has {expected}")),
        None if found.len() != expected.len() => Err(format!("{} lines of {}", found.len(), expected.len())),
        None => Ok(found.len()),
    }
}

/// What `parity.c` prints at a pose: name, and numbers unless there is an error. One list in the order of its lines: not cut into parts.
fn expected<T: Scalar>(
    five: &FiveAxis<'_, T>,
    (table, uncertainty): (&CorrectionTable<'_, T>, &TableUncertainty<T>),
    pose: [f64; 3],
) -> Vec<(&'static str, Option<Vec<String>>)> {
    fn line<T: Scalar, E>(name: &'static str, result: Result<Vec<T>, E>) -> (&'static str, Option<Vec<String>>) {
        let bits = |v: &T| format!("{:016x}", v.to_f64().to_bits());
        (name, result.ok().map(|values| values.iter().map(bits).collect()))
    }
    let machine = five.machine;
    let t = |values: [f64; 3]| values.map(T::from_f64);
    let [theta_rad, sigma_rad, z0_m] = t(pose);
    let pose = &Pose { theta_rad, sigma_rad, z0_m };
    let wrench = Wrench { force_n: t([100.0, -50.0, -400.0]).into(), moment_nm: t([2.0, -8.0, 5.0]).into() };
    let turned_at = Wrench { force_n: t([150.0, -20.0, -600.0]).into(), moment_nm: t([3.0, -8.0, 9.0]).into() };
    let tip = t([0.03, -0.02, 0.3]).into();
    let rise = TemperatureRise { limbs_k: t([4.5, 2.5, -1.0]), platforms_k: T::from_f64(3.0) };
    let flat = |p: Pose<T>, q: ScrewLengths<T>| [&[p.theta_rad, p.sigma_rad, p.z0_m], q.q_m.as_slice()].concat();
    let lengths = machine.inverse(pose);
    let set = lengths.unwrap_or(ScrewLengths { q_m: Vector3::zeros() });
    let margin = machine.travel_margin_m(&set);
    let deflection = table.factor_form(machine, pose).and_then(|k| {
        let linear = k.factor.deflection(&wrench)?;
        Ok(linear.plus(&machine.load_dependent_deflection(pose, &wrench, &turned_at)?))
    });
    let six = |d: Deflection<T>| d.to_vector().as_slice().to_vec();
    let compensated = machine.compensated(pose, &deflection.unwrap_or(Deflection::ZERO), tip);
    let whole_cycle = |c: Cycle<T>| {
        [c.lengths.q_m.as_slice().to_vec(), six(c.deflection), flat(c.compensated.pose, c.compensated.lengths)].concat()
    };
    let cycle = table.cycle(machine, pose, &wrench, tip).map(whole_cycle);
    let known_cycle = table.cycle_known(machine, uncertainty, pose, &wrench, tip);
    let reading = Reading { enabled: true, wrench, rise };
    let whole = |k: pkm_core::Stiffness<T>| k.matrix().as_slice().to_vec();
    let warm = machine.at_temperature(T::from_f64(31.5));
    let ok = |name, text: String| (name, Some(vec![text]));
    // as the structures of the header have them
    let beta_rad = Vector2::from([0.3, -0.2].map(T::from_f64));
    let stands =
        |c: &Configuration<T>| [&[c.pose.theta_rad, c.pose.sigma_rad, c.pose.z0_m], c.beta_rad.as_slice()].concat();
    let solution = |h: &ToolSolution<T>| {
        let JointValues { lengths, beta_rad } = &h.joints;
        [&stands(&h.configuration), lengths.q_m.as_slice(), beta_rad.as_slice(), &[h.normalised_determinant]].concat()
    };
    let home = Configuration {
        pose: Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::from_f64(0.53) },
        beta_rad: Vector2::zeros(),
    };
    let place = five.forward(&JointValues { lengths: set, beta_rad });
    let tool = place.map_or(Tool { tip_m: Vector3::zeros(), axis: Vector3::zeros() }, |(_, tool)| tool);
    let loaded = five.compensated(Some(table), &tool, &wrench, &home);
    let nowhere = Configuration {
        pose: Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: T::ZERO },
        beta_rad: Vector2::zeros(),
    };
    let tool_stands = place.map_or(nowhere, |(stands, _)| stands);
    let (screws, axes) = first_periods(five, (table, uncertainty), (pose, tip), &tool_stands, &reading);
    let motion = ToolMotion {
        tip_m_per_s: t([0.1, -0.05, 0.02]).into(),
        axis_per_s: t([0.2, 0.1, -0.3]).into(),
        tip_m_per_s2: t([1.0, 2.0, -3.0]).into(),
        axis_per_s2: t([0.5, -0.4, 0.1]).into(),
    };
    let joints = place.and_then(|(stands, _)| five.joint_motion(&stands, &motion));
    let five_of = |screw: f64, wrist: f64| [screw, screw, screw, wrist, wrist].map(T::from_f64).into();
    let share = joints.map_or(T::ONE, |joints| joints.feed_share(&five_of(0.05, 1.0), &five_of(2.0, 10.0)));
    vec![
        line("inverse", lengths.map(|q| q.q_m.as_slice().to_vec())),
        line("forward", machine.forward(&set).map(|p| flat(p, set)[..3].to_vec())),
        line("jacobian", machine.jacobian(pose).map(|j| j.as_slice().to_vec())),
        line("distance", machine.singularity_distance(pose).map(|d| vec![d.limbs_1_2, d.limb_3])),
        line("margin", margin.map(|(margin_m, _)| vec![margin_m])),
        ok("limb", margin.map_or(0, |(_, limb)| limb).to_string()),
        line("k_p", machine.stiffness(pose).map(whole)),
        line("domain", Ok::<Vec<T>, ()>(vec![])),
        ok("outside", i32::from(table.domain(pose) == Domain::Outside).to_string()),
        line("k_m", table.factor_form(machine, pose).map(|k| whole(k.factor.stiffness()))),
        line("deflection", deflection.map(six)),
        line("compensated", compensated.map(|c| flat(c.pose, c.lengths))),
        line("thermal", machine.thermal_deflection(pose, rise).map(six)),
        line("cycle", cycle),
        line("warm", warm.map(|_| Vec::<T>::new())),
        line("k_p_warm", warm.map_err(drop).and_then(|m| m.stiffness(pose).map(whole).map_err(drop))),
        line(
            "tool_forward",
            place.map(|(c, tool)| [&stands(&c), tool.tip_m.as_slice(), tool.axis.as_slice()].concat()),
        ),
        line("tool_inverse", five.inverse(&tool, &home).map(|h| solution(&h))),
        line("tip_inverse", five.inverse_at(tool.tip_m, beta_rad).map(|h| solution(&h))),
        line(
            "any_margin",
            five.inverse_at_any_margin(tool.tip_m, Vector2::new(beta_rad.x, T::from_f64(0.98))).map(|h| solution(&h)),
        ),
        line(
            "tool_compensated",
            loaded.map(|l| {
                let (moved, turned) = (l.deflection.translation_m, l.deflection.rotation_rad);
                [&solution(&l.solution), moved.as_slice(), turned.as_slice(), &[l.remaining_m]].concat()
            }),
        ),
        line("joint_motion", joints.map(|j| [j.velocity.as_slice(), j.acceleration.as_slice()].concat())),
        line("feed_share", Ok::<_, ()>(vec![share])),
        line("cycle_known", known_cycle.map(|known| whole_cycle(known.cycle))),
        line("known", known_cycle.map(|known| numbers_of(known.uncertainty, known.share))),
        line("offset", Ok::<_, ()>(screws.joints.as_slice().to_vec())),
        line("of_offset", Ok::<_, ()>(of_offset(screws.known))),
        line("tool_offset", Ok::<_, ()>(axes.joints.as_slice().to_vec())),
        line("of_tool_offset", Ok::<_, ()>(of_offset(axes.known))),
        ok("self_test", "0".to_owned()),
    ]
}

/// As `PkmKnown` has them.
fn numbers_of<T: Scalar>(uncertainty: TipUncertainty<T>, share: T) -> Vec<T> {
    [uncertainty.u95_m().as_slice(), &[share]].concat()
}

fn of_offset<T: Scalar>(known: Option<Known<T>>) -> Vec<T> {
    known.map_or(vec![T::ZERO; 4], |known| numbers_of(known.uncertainty, known.share))
}

/// A period of new compensators that compensate no more than is known, of three screws and of five axes.
fn first_periods<T: Scalar>(
    five: &FiveAxis<'_, T>,
    (table, uncertainty): (&CorrectionTable<'_, T>, &TableUncertainty<T>),
    (pose, tip): (&Pose<T>, Vector3<T>),
    stands: &Configuration<T>,
    reading: &Reading<T>,
) -> (Offset<T, 3>, Offset<T, 5>) {
    let settings = CompensatorSettings { outside_box: OutsideBox::Extrapolate, ..CompensatorSettings::DEFAULT };
    let mut screws = Compensator::<T, 3>::new(&settings).expect("in range");
    let mut axes = Compensator::<T, 5>::new(&settings).expect("in range");
    let model = &Model::new(five.machine, table).with_uncertainty(uncertainty);
    (screws.update(model, pose, tip, reading), axes.update(model, five.wrist, stands, reading))
}

#[cfg(test)]
mod tests {
    use super::declared;

    #[test]
    fn other_declarations_ask_for_another_version() {
        let header = |version: &str, comment: &str, field: &str| {
            format!(
                "/* {comment}\n * more\n */\n#define PKM_VERSION \"{version}\"\n// {comment}\nstruct A {{ {field} }};\n"
            )
        };
        let before = declared(&header("0.4.0", "one", "int a;"), "0.3.0 0\n").unwrap();
        assert_eq!(declared(&header("0.4.0", "two", "int  a;"), &before), Ok(before.clone()));
        assert!(declared(&header("0.4.0", "one", "int a; int b;"), &before).unwrap_err().contains("raise it"));
        assert!(declared(&header("0.5.0", "one", "int a; int b;"), &before).unwrap().starts_with("0.5.0 "));
    }
}

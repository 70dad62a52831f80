//! The Python package: a wheel in a clean environment, its tests, its notebook, and its time beside NumPy's.

use std::path::Path;
use std::process::Command;

use pkm_core::nalgebra::{Vector2, Vector6};
use pkm_core::tables::reference::{MACHINE_F64, WRIST_F64};
use pkm_core::{FiveAxis, JointValues, Pose, Wrench};
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use serde_json::{Value, json};

use crate::{Outcome, output, root};

const PACKAGES: &str = "apt-get install --no-install-recommends python3 python3-venv";
/// Of the wheel.
const MAX_WHEEL_BYTES: u64 = 3_000_000;
/// Poses whose bits are compared.
const POSES: usize = 2000;
const TABLE: &str = "fixtures/jobs/wide-table.json";

pub fn run() -> Outcome {
    let (package, out) = (root().join("embed/python"), root().join("out/python"));
    if out.exists() {
        std::fs::remove_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    }
    let environment = out.join("environment");
    let mut create = Command::new("python3");
    output(create.args(["-m", "venv"]).arg(&environment)).map_err(|e| format!("{e}\n{PACKAGES}"))?;
    let python = |arguments: &[&str]| {
        let mut python = Command::new(environment.join("bin/python"));
        // bytecode of what is imported alone, and none beside the sources
        python.current_dir(&package).args(arguments).env("PYTHONPYCACHEPREFIX", out.join("bytecode"));
        python
    };
    let pip = ["-m", "pip", "install", "--quiet", "--no-compile", "--disable-pip-version-check"];
    output(&mut python(&[&pip[..], &["--requirement", "requirements.txt"]].concat()))?;

    let wheels = out.join("wheels").display().to_string();
    // what the program's release build has made of other people's crates is not built again
    let target = root().join("target");
    let build = ["-m", "maturin", "build", "--release", "--compression-level", "9", "--out", &wheels];
    output(python(&build).env("CARGO_TARGET_DIR", target))?;
    let wheel = only_file(Path::new(&wheels))?;
    let bytes = std::fs::metadata(&wheel).map_err(|e| e.to_string())?.len();
    println!("{}: {:.2} MB", wheel.display(), bytes as f64 / 1e6);
    if bytes > MAX_WHEEL_BYTES {
        return Err(format!("more than {MAX_WHEEL_BYTES} bytes"));
    }
    output(&mut python(&[&pip[..], &["--no-index", &wheel.display().to_string()]].concat()))?;

    let bits = out.join("bits.json");
    std::fs::write(&bits, core_bits()?.to_string()).map_err(|e| e.to_string())?;
    print!("{}", output(python(&["-m", "pytest", "-q", "-p", "no:cacheprovider"]).env("PKM_BITS", &bits))?);
    print!("{}", output(&mut python(&["tests/speed.py"]))?);
    let notebook = out.join("paper.ipynb").display().to_string();
    print!("{}", output(&mut python(&["tests/execute.py", "paper.ipynb", &notebook]))?);
    Ok(())
}

fn only_file(folder: &Path) -> Result<std::path::PathBuf, String> {
    let files = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    match files.flatten().collect::<Vec<_>>().as_slice() {
        [wheel] => Ok(wheel.path()),
        files => Err(format!("{}: {} files where one wheel was expected", folder.display(), files.len())),
    }
}

/// What this build of the core computes at poses of the table's box, for the wheel's to be compared with.
fn core_bits() -> Result<Value, String> {
    let source = Source::read(&root().join(TABLE)).map_err(|e| e.to_string())?;
    let numbers = TableFile::parse(&source).map_err(|e| e.to_string())?.numbers();
    let table = numbers.table().map_err(|e| e.to_string())?;
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let mut rng = fastrand::Rng::with_seed(1);
    let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
    let mut columns: [Vec<Value>; 9] = Default::default();
    while columns[0].len() < POSES {
        let pose = Pose { theta_rad: between(-0.4, 0.6), sigma_rad: between(-0.4, 0.4), z0_m: between(0.45, 0.61) };
        let wrench: Vector6<f64> = Vector6::from_fn(|_, _| between(-500.0, 500.0));
        let beta_rad = Vector2::from_fn(|_, _| between(-1.0, 1.0));
        let Ok(lengths) = MACHINE_F64.inverse(&pose) else { continue };
        let text = |e: &dyn std::fmt::Display| e.to_string();
        let forward = MACHINE_F64.forward(&lengths).map_err(|e| text(&e))?;
        let k_p = MACHINE_F64.stiffness(&pose).and_then(|k| k.factor()).map_err(|e| text(&e))?.stiffness().matrix();
        let corrected = table.factor_form(&MACHINE_F64, &pose).map_err(|e| text(&e))?.factor;
        let deflection = corrected.deflection(&Wrench::from_vector(wrench)).map_err(|e| text(&e))?.to_vector();
        let joints = JointValues { lengths, beta_rad };
        let (_, tool) = five.forward(&joints).map_err(|e| text(&e))?;
        let q = lengths.q_m;
        let rows = [
            json!([pose.theta_rad, pose.sigma_rad, pose.z0_m]),
            json!(wrench.as_slice()),
            json!(q.as_slice()),
            json!([forward.theta_rad, forward.sigma_rad, forward.z0_m]),
            json!(k_p.as_slice()),
            json!(corrected.stiffness().matrix().as_slice()),
            json!(deflection.as_slice()),
            json!([q.x, q.y, q.z, beta_rad.x, beta_rad.y]),
            json!([tool.tip_m.as_slice(), tool.axis.as_slice()].concat()),
        ];
        columns.iter_mut().zip(rows).for_each(|(column, row)| column.push(row));
    }
    let names = ["poses", "wrenches", "q_m", "fk", "k_p", "k_m", "deflection", "joints", "tools"];
    Ok(names.into_iter().map(str::to_owned).zip(columns.map(Value::from)).collect())
}

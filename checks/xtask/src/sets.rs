//! The sets of `fixtures/measured` diagnosed, and held against their truth.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;

use serde_json::Value;

use crate::{Outcome, output, root};

/// Sets of which the diagnosis is known to be wrong: of ten poses with λ near 60, one offset of a joint that passes for
/// compliance of the base, and one find that predicts 7 % worse than re-identification. The other has physics on no list, which is found at
/// its place with a law that extrapolates worse than re-identification.
const KNOWN_MISSES: [&str; 2] = ["own-limb-coupling-hard", "own-outside-periodic-screw"];

pub fn run() -> Outcome {
    let mut build = Command::new(env!("CARGO"));
    output(build.args(["build", "--release", "--locked", "--quiet", "-p", "pkm-host"]).current_dir(root()))?;
    let folder = root().join("fixtures/measured");
    let files = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    // the easy ones are left to `cargo xtask trials`
    let mut sets: Vec<_> = files.flatten().map(|file| file.path()).filter(|path| path.is_dir()).collect();
    sets.retain(|set| !set.to_string_lossy().ends_with("-easy"));
    sets.sort();

    let wrong = Mutex::new(Vec::new());
    let next = Mutex::new(sets.iter());
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(set) = { next.lock().expect("no worker panics while it holds the sets").next() } {
                    let name = set.file_name().unwrap_or_default().to_string_lossy();
                    let said = judge(set).unwrap_or_else(|message| format!("{message}\n"));
                    if !said.is_empty() {
                        let mut wrong = wrong.lock().expect("no worker panics while it holds what is wrong");
                        wrong.push((name.into_owned(), said));
                    }
                }
            });
        }
    });
    let mut wrong = wrong.into_inner().map_err(|e| e.to_string())?;
    wrong.sort();
    println!("{} sets diagnosed; wrong: {}", sets.len(), wrong.len());
    if wrong.iter().map(|(set, _)| set.as_str()).eq(KNOWN_MISSES) {
        return Ok(());
    }
    let mut message = format!("known to be wrong: {KNOWN_MISSES:?}\n");
    for (set, said) in wrong {
        let _ = write!(message, "{set}: {said}");
    }
    Err(message)
}

/// Diagnoses a set: what is wrong with that, a line each.
fn judge(set: &Path) -> Result<String, String> {
    let truth = read_json(&set.join("truth.json"))?;
    let out = tempfile::tempdir().map_err(|e| e.to_string())?;
    let mut diagnose = Command::new(root().join("target/release/pkm-host"));
    diagnose.args(["diagnose", "--json", "--out"]).arg(out.path());
    for (option, file) in [("--machine", "machine.toml"), ("--data", "measured.csv"), ("--holdout", "heldout.csv")] {
        diagnose.arg(option).arg(set.join(file));
    }
    let found: Value = serde_json::from_str(&output(&mut diagnose)?).map_err(|e| e.to_string())?;
    for list in [&truth["where_ok"], &found["effects"], &found["declared_value_findings"]] {
        list.as_array().ok_or("where_ok, effects and declared_value_findings are lists")?;
    }
    let mut said = String::new();
    for what in misses(&truth, &found) {
        let _ = writeln!(said, "{} {what}; {} {:?}", truth["contains"], found["verdict"], places(&found));
    }
    Ok(said)
}

/// A JSON file.
pub fn read_json(path: &Path) -> Result<Value, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// What is wrong with a diagnosis of a set, in words.
pub fn misses(truth: &Value, found: &Value) -> Vec<&'static str> {
    let right: Vec<Vec<String>> = truth["where_ok"].as_array().into_iter().flatten().map(texts).collect();
    let (effects, parts) = places(found);
    let meets = |a: &[String], b: &[String]| a.iter().any(|place| b.contains(place));
    let outside = texts(&truth["contains"]).iter().any(|id| id.starts_with('('));
    // below λ = 30 nothing need be found, nor physics that is on no list
    let optional = outside || truth["lambda"].as_f64().is_some_and(|lambda| lambda < 30.0);
    let listed = found["effects"].as_array().into_iter().flatten().any(|e| e["id"] != "element");
    let rms = |rival: &str| found["holdout"][rival]["linear_um_rms"].as_f64().unwrap_or(f64::NAN);
    let nothing = |list: &Value| list.as_array().is_some_and(Vec::is_empty);
    let all = [
        // whatever the machine lacks, these are readings of it as the file says
        ("data_warnings", !nothing(&found["data_warnings"])),
        ("suspect readings", !nothing(&found["suspect_readings"])),
        (
            "not found",
            !optional && right.iter().any(|there| !effects.iter().chain([&parts]).any(|own| meets(own, there))),
        ),
        ("a wrong place", effects.iter().any(|own| !right.iter().any(|there| meets(own, there)))),
        ("claimed for the list", outside && listed && found["verdict"] == "explained"),
        // loads that are wrong leave more than noise, which is said, and name nothing
        ("not adequate", right.is_empty() && truth["kind"] != "load-errors" && found["verdict"] != "adequate"),
        ("no declared value blamed", !optional && truth.get("declared_value_finding").is_some() && parts.is_empty()),
        // physics must not make it worse than re-identification alone
        ("worse than re-identified stiffnesses", !(rms("after") <= 1.05 * rms("retuned_only"))),
    ];
    all.into_iter().filter(|(_, holds)| *holds).map(|(what, _)| what).collect()
}

/// For each effect that is located its place with those that the readings do not tell from it, and the parts of declared values.
fn places(found: &Value) -> (Vec<Vec<String>>, Vec<String>) {
    let of = |list: &Value| list.as_array().cloned().unwrap_or_default();
    let effects = of(&found["effects"]);
    let each = effects.iter().map(|e| [texts(&e["where_class"]), texts(&serde_json::json!([e["where"]]))].concat());
    let declared = of(&found["declared_value_findings"]);
    let parameters = declared.iter().filter_map(|finding| finding["parameter"].as_str());
    let parts = parameters.filter_map(|parameter| Some(parameter.rsplit_once('.')?.0.to_owned()));
    // a place with more than three beside it is none
    (each.filter(|places: &Vec<String>| places.len() <= 4).collect(), parts.collect())
}

/// The texts of a list.
fn texts(list: &Value) -> Vec<String> {
    list.as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

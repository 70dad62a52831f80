//! Runs the program on folders of sets and scores what it says, by class.

mod rates;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::Value;

pub use self::rates::{report, wilson};
use crate::effects::{class_of, declared_of};

/// What is in a set, from its files.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    /// `none`, `one`, `two`, `declared`, `outside`, `load-errors`, `scatter`, `forms` or `form-pairs`.
    pub kind: String,
    /// For each effect: its id, the ids that are right, and the declared values that may be blamed.
    pub effects: Vec<(String, Vec<String>, Vec<String>)>,
    /// Declared values that are wrong.
    pub declared: Vec<String>,
    /// For each thing that is there, the places where it may rightly be found.
    pub places: Vec<Vec<String>>,
    /// Detectability λ: the signal that re-identification cannot take.
    pub lambda: f64,
    /// Seed, form and amplitude.
    pub about: String,
}

fn texts(value: &Value) -> Vec<String> {
    let list = value.as_array().map(Vec::as_slice).unwrap_or_default();
    list.iter().filter_map(Value::as_str).map(str::to_owned).collect()
}

fn read_json(path: &Path) -> Result<Value, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

impl Truth {
    /// From `truth.json` and the channels of `measured.csv`.
    pub fn read(folder: &Path) -> Result<Self, String> {
        let json = read_json(&folder.join("truth.json"))?;
        let path = folder.join("measured.csv");
        let csv = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let mut lines = csv.lines().filter(|l| !l.starts_with('#'));
        let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let rotation = columns.iter().position(|c| *c == "rx_urad");
        let rotations = rotation
            .is_some_and(|i| lines.next().and_then(|l| l.split(',').nth(i)).is_some_and(|cell| !cell.is_empty()));
        Ok(Self::new(&json, csv.contains(",unload"), rotations))
    }

    fn new(json: &Value, unloading: bool, rotations: bool) -> Self {
        let contains = texts(&json["contains"]);
        let accept = texts(&json["accept"]);
        let blamed = !json["declared_value_finding"].is_null();
        let places: Vec<Vec<String>> = json["where_ok"].as_array().into_iter().flatten().map(texts).collect();
        let kind = match (contains.len(), blamed) {
            _ if contains.iter().any(|id| id.starts_with('(')) => "outside",
            (0, true) => "declared",
            (0, false) if !places.is_empty() => "outside",
            (0, false) => "none",
            (1, _) => "one",
            _ => "two",
        };
        let effects = (contains.iter().filter(|id| !id.starts_with('(')))
            .map(|id| {
                let mut right: Vec<String> =
                    class_of(id, unloading, rotations).into_iter().map(str::to_owned).collect();
                // further names are given for sets of one effect only
                if contains.len() == 1 {
                    right.extend(accept.iter().cloned());
                }
                (id.clone(), right, declared_of(id).iter().map(|s| (*s).to_owned()).collect())
            })
            .collect();
        let mut declared = texts(&json["declared_parameters"]);
        if blamed && declared.is_empty() {
            declared.push("limb.".to_owned());
        }
        let seed = json["seed"].as_u64().map_or(String::new(), |s| format!("seed {s}; "));
        let about = json["about"].as_str().unwrap_or_default().to_owned();
        let about = seed
            + &about
            + if about.is_empty() { json["declared_value_finding"].as_str().unwrap_or_default() } else { "" };
        Self {
            kind: json["kind"].as_str().unwrap_or(kind).to_owned(),
            effects,
            declared,
            places,
            lambda: json["lambda"].as_f64().unwrap_or(0.0),
            about,
        }
    }
}

/// What the program said.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    verdict: String,
    /// For each effect its id, then its class.
    effects: Vec<Vec<String>>,
    /// For each finding the parameter, then its class.
    findings: Vec<Vec<String>>,
    /// For each effect its place, then those that the readings do not tell from it.
    places: Vec<Vec<String>>,
    /// For each effect the probability that it is at one of these.
    probabilities: Vec<f64>,
    lack_of_fit: f64,
    before: f64,
    after: f64,
    retuned: f64,
    /// Where the program expects the held-out error with the effects, if it says so.
    interval: Option<(f64, f64)>,
    /// The error with the effects over very many held-out poses.
    over_many: Option<f64>,
}

impl Answer {
    fn new(json: &Value) -> Result<Self, String> {
        let named = |list: &Value, key: &str| -> Result<Vec<Vec<String>>, String> {
            let list = list.as_array().ok_or_else(|| format!("diagnosis.json: no list with {key}"))?;
            let each = list.iter().map(|e| {
                let id = e[key].as_str().ok_or_else(|| format!("diagnosis.json: no {key}"))?;
                Ok([vec![id.to_owned()], texts(&e["class"])].concat())
            });
            each.collect()
        };
        let number = |path: &str| {
            json.pointer(path).and_then(Value::as_f64).ok_or_else(|| format!("diagnosis.json: no number at {path}"))
        };
        let verdict = json["verdict"].as_str().ok_or("diagnosis.json: no verdict")?;
        Ok(Self {
            verdict: verdict.to_owned(),
            effects: named(&json["effects"], "id")?,
            findings: named(&json["declared_value_findings"], "parameter")?,
            places: (json["effects"].as_array().into_iter().flatten())
                .map(|e| {
                    [e["where"].as_str().map(str::to_owned).into_iter().collect(), texts(&e["where_class"])].concat()
                })
                .collect(),
            probabilities: (json["effects"].as_array().into_iter().flatten())
                .map(|e| e["probability"].as_f64().unwrap_or(f64::NAN))
                .collect(),
            lack_of_fit: number("/lack_of_fit/p")?,
            before: number("/holdout/before/linear_um_rms")?,
            after: number("/holdout/after/linear_um_rms")?,
            retuned: number("/holdout/retuned_only/linear_um_rms")?,
            interval: number("/holdout/after/linear_um_rms_interval/0")
                .and_then(|low| Ok((low, number("/holdout/after/linear_um_rms_interval/1")?)))
                .ok(),
            over_many: None,
        })
    }
}

/// What an effect is called that has a place and no name.
const ELEMENT: &str = "element";

/// One set, run and compared.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Folder.
    pub name: String,
    /// What is in it.
    pub truth: Truth,
    /// What was said, or why nothing was.
    pub answer: Result<Answer, String>,
    /// How long it took.
    pub seconds: f64,
}

fn holds(names: &[String], right: &[String], prefixes: &[String]) -> bool {
    names.iter().any(|n| right.contains(n) || prefixes.iter().any(|p| n.starts_with(p.as_str())))
}

/// Whether a place is said: one with more than three beside it is not.
fn is_finding(places: &[String]) -> bool {
    places.len() <= 4
}

/// For each thing whether a find of its own accounts for it, as many things as possible. `fits` has for each thing which finds
/// could.
fn accounted(fits: &[Vec<bool>]) -> Vec<bool> {
    fn takes(thing: usize, fits: &[Vec<bool>], tried: &mut [bool], taken: &mut [Option<usize>]) -> bool {
        (0..taken.len()).any(|find| {
            if !fits[thing][find] || std::mem::replace(&mut tried[find], true) {
                return false;
            }
            // who has this find may take another
            let free = taken[find].is_none_or(|other| takes(other, fits, tried, taken));
            if free {
                taken[find] = Some(thing);
            }
            free
        })
    }
    let finds = fits.first().map_or(0, Vec::len);
    let mut taken = vec![None; finds];
    (0..fits.len()).map(|thing| takes(thing, fits, &mut vec![false; finds], &mut taken)).collect()
}

impl Outcome {
    /// Runs the program on a folder.
    pub fn of(program: &Path, folder: &Path) -> Result<Self, String> {
        let truth = Truth::read(folder)?;
        let out = tempfile::tempdir().map_err(|e| format!("temporary folder: {e}"))?;
        let start = Instant::now();
        let run = Command::new(program)
            .arg("diagnose")
            .args(["--machine".as_ref(), folder.join("machine.toml").as_os_str()])
            .args(["--data".as_ref(), folder.join("measured.csv").as_os_str()])
            .args(["--holdout".as_ref(), folder.join("heldout.csv").as_os_str()])
            .args(["--out".as_ref(), out.path().as_os_str()])
            .arg("--json")
            .stdin(Stdio::null())
            .output()
            .map_err(|e| format!("{}: {e}", program.display()))?;
        let seconds = start.elapsed().as_secs_f64();
        let answer = if run.status.success() {
            let answer = read_json(&out.path().join("diagnosis.json")).and_then(|json| Answer::new(&json));
            answer.and_then(|a| Ok(Answer { over_many: error_over_many(program, folder, out.path())?, ..a }))
        } else {
            let said = if run.stdout.is_empty() { &run.stderr } else { &run.stdout };
            Err(format!("{}: {}", run.status, String::from_utf8_lossy(said).trim()))
        };
        let name = folder.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Self { name, truth, answer, seconds })
    }

    /// For each true effect, whether it was named.
    fn right(&self) -> Vec<bool> {
        let Ok(answer) = &self.answer else { return vec![false; self.truth.effects.len()] };
        let each = self.truth.effects.iter().map(|(_, right, prefixes)| {
            answer.effects.iter().any(|names| holds(names, right, prefixes))
                || answer.findings.iter().any(|names| holds(names, &[], prefixes))
        });
        each.collect()
    }

    /// Whether all true effects were named.
    fn is_right(&self) -> bool {
        let right = self.right();
        !right.is_empty() && right.iter().all(|r| *r)
    }

    /// Effects that were named and are no true one's class.
    fn wrong(&self) -> Vec<&str> {
        let Ok(answer) = &self.answer else { return Vec::new() };
        let true_one = |names: &[String]| {
            // a wrong declaration may rightly come out as an effect of the same part
            let soft = self.truth.declared.iter().any(|d| {
                names.iter().any(|n| n.starts_with(d.as_str()) || declared_of(n).iter().any(|p| d.starts_with(p)))
            });
            soft || self.truth.effects.iter().any(|(_, right, prefixes)| holds(names, right, prefixes))
        };
        let named = answer.effects.iter().filter(|names| names[0] != ELEMENT);
        named.filter(|names| !true_one(names)).map(|names| names[0].as_str()).collect()
    }

    /// For each thing that is there, whether its place was found, by an effect or by a declared value of the part. One find
    /// accounts for one thing: where two are there, two have to be found.
    fn located(&self) -> Vec<bool> {
        let Ok(answer) = &self.answer else { return vec![false; self.truth.places.len()] };
        let by = |right: &Vec<String>| -> Vec<bool> {
            let part = |name: &String| right.iter().any(|place| name.starts_with(&format!("{place}.")));
            let effects = answer.places.iter().map(|places| is_finding(places) && holds(places, right, &[]));
            effects.chain(answer.findings.iter().map(|names| names.iter().any(part))).collect()
        };
        accounted(&self.truth.places.iter().map(by).collect::<Vec<_>>())
    }

    /// For each effect that has a place, the probability that is said of it, and whether something is there.
    fn stated(&self) -> Vec<(f64, bool)> {
        let Ok(answer) = &self.answer else { return Vec::new() };
        let right = |places: &Vec<String>| self.truth.places.iter().any(|there| holds(places, there, &[]));
        let located = answer.places.iter().zip(&answer.probabilities).filter(|(places, _)| is_finding(places));
        located.map(|(places, probability)| (*probability, right(places))).collect()
    }

    /// Effects whose place is nowhere near anything that is there.
    fn misplaced(&self) -> usize {
        self.stated().iter().filter(|(_, right)| !right).count()
    }

    /// Whether a wrong declaration was found.
    fn declared_found(&self) -> bool {
        let Ok(answer) = &self.answer else { return false };
        let finding = answer.findings.iter().any(|names| holds(names, &[], &self.truth.declared));
        let as_effect = answer.effects.iter().any(|names| names[0] != ELEMENT) && self.wrong().is_empty();
        (finding || as_effect) && self.wrong().is_empty()
    }

    /// One line for whoever improves the program.
    pub fn line(&self) -> String {
        let truth = format!("{} {} λ={:.0} [{}]", self.name, self.truth.kind, self.truth.lambda, self.truth.about);
        match &self.answer {
            Err(e) => format!("{truth} -> FAILED {e} ({:.1} s)", self.seconds),
            Ok(a) => {
                let list = |all: &[Vec<String>]| {
                    let each: Vec<String> = all.iter().map(|n| format!("{}{{{}}}", n[0], n[1..].join(","))).collect();
                    each.join(" ")
                };
                let score = match self.truth.kind.as_str() {
                    "declared" => if self.declared_found() { "right" } else { "NOT FOUND" }.to_owned(),
                    "outside" => if self.claimed() { "CLAIMED" } else { "not claimed" }.to_owned(),
                    _ => format!("right {:?} wrong {:?}", self.right(), self.wrong()),
                };
                let (effects, findings, places) = (list(&a.effects), list(&a.findings), list(&a.places));
                format!(
                    "{truth} -> {} {effects} / {findings} | {score} | at {places}: {:?}, {} misplaced | lack of fit p {:.3} | held out {:.3} {:.3} {:.3} | {:.1} s",
                    a.verdict,
                    self.located(),
                    self.misplaced(),
                    a.lack_of_fit,
                    a.before,
                    a.retuned,
                    a.after,
                    self.seconds
                )
            }
        }
    }

    fn claimed(&self) -> bool {
        let listed = |a: &Answer| a.effects.iter().any(|names| names[0] != ELEMENT);
        self.answer.as_ref().is_ok_and(|a| a.verdict == "explained" && listed(a))
    }
}

/// Root mean square length of the translation error of the machine that came out, in µm, over `heldout_many.csv`.
fn error_over_many(program: &Path, folder: &Path, out: &Path) -> Result<Option<f64>, String> {
    let (truth, said) = (folder.join("heldout_many.csv"), out.join("many.csv"));
    if !truth.is_file() {
        return Ok(None);
    }
    let run = Command::new(program)
        .arg("predict")
        .args(["--machine".as_ref(), out.join("machine.toml").as_os_str()])
        .args(["--data".as_ref(), truth.as_os_str(), "--out".as_ref(), said.as_os_str()])
        .stdin(Stdio::null())
        .output()
        .map_err(|e| format!("{}: {e}", program.display()))?;
    if !run.status.success() {
        return Err(format!("predict: {}: {}", run.status, String::from_utf8_lossy(&run.stderr).trim()));
    }
    let (truth, said) = (translations(&truth)?, translations(&said)?);
    let squares = truth.iter().zip(&said).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)));
    Ok(Some((squares.sum::<f64>() / truth.len() as f64).sqrt()))
}

/// Columns dx_um, dy_um, dz_um of a file of this harness or of `predict`.
fn translations(path: &Path) -> Result<Vec<[f64; 3]>, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let cell = |line: &str, n: usize| line.split(',').nth(n).and_then(|c| c.parse().ok());
    let row = |line: &str| Some([cell(line, 10)?, cell(line, 11)?, cell(line, 12)?]);
    text.lines()
        .skip(1)
        .map(|l| row(l).ok_or_else(|| format!("{}: not three translations: {l}", path.display())))
        .collect()
}

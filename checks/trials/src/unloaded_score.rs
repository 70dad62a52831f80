//! How often the geometry that the program finds in unloaded readings is the true one.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::score::wilson;
use crate::unloaded::Set;

/// Stated standard deviations within which an estimate counts as right: 95.4 % of normal errors.
const WITHIN_SD: f64 = 2.0;

/// What came of one set.
pub struct Outcome {
    /// Of each identifiable parameter: its error in stated deviations.
    pub errors_sd: Vec<(String, f64)>,
    /// Parameters that were called not identifiable.
    pub not_identifiable: Vec<String>,
    /// Errors on held-out poses over the noise: declared, identified, identified with its findings.
    pub over_noise: [f64; 3],
    /// Rms of the same, µm.
    pub rms_um: [f64; 3],
    /// Findings beside the geometry.
    pub found: Vec<String>,
    /// p of more than noise under the identified geometry.
    pub p: f64,
}

impl Outcome {
    /// Runs the program on a set.
    ///
    /// # Errors
    /// The program failed, or its document is another.
    pub fn of(program: &Path, set: &Set, folder: &Path) -> Result<Self, String> {
        set.write(folder)?;
        let run = Command::new(program)
            .args(["diagnose", "--unloaded", "--json"])
            .args(["--machine".as_ref(), folder.join("machine.toml").as_os_str()])
            .args(["--data".as_ref(), folder.join("unloaded.csv").as_os_str()])
            .args(["--holdout".as_ref(), folder.join("heldout.csv").as_os_str()])
            .args(["--out".as_ref(), folder.join("out").as_os_str()])
            .stdin(Stdio::null())
            .output()
            .map_err(|e| format!("{}: {e}", program.display()))?;
        if !run.status.success() {
            return Err(format!("{}: {}", run.status, String::from_utf8_lossy(&run.stderr).trim()));
        }
        let json: Value = serde_json::from_slice(&run.stdout).map_err(|e| e.to_string())?;
        Self::new(&json, set).ok_or_else(|| "geometry.json lacks something".to_owned())
    }

    fn new(json: &Value, set: &Set) -> Option<Self> {
        let truth = set.truth();
        let (mut errors_sd, mut not_identifiable) = (Vec::new(), Vec::new());
        for p in json["parameters"].as_array()? {
            let key = p["key"].as_str()?.to_owned();
            let error = (p["value"].as_f64()? - truth.get(&key)?.as_f64()?) / p["sd"].as_f64()?;
            if p["identifiable"].as_bool()? { errors_sd.push((key, error)) } else { not_identifiable.push(key) }
        }
        let held_out = &json["holdout"]["errors"];
        let of = |what: &str| {
            let rivals = ["declared", "identified", "with_found"].map(|r| held_out[r][what].as_f64());
            rivals.into_iter().collect::<Option<Vec<f64>>>()?.try_into().ok()
        };
        Some(Self {
            errors_sd,
            not_identifiable,
            over_noise: of("ratio_to_noise")?,
            rms_um: of("rms_um")?,
            found: json["found"].as_array()?.iter().filter_map(|f| Some(f.as_str()?.to_owned())).collect(),
            p: json["lack_of_fit"]["identified"]["p"].as_f64()?,
        })
    }
}

fn share(hits: usize, of: usize) -> String {
    let (low, high) = wilson(hits, of);
    format!("{hits}/{of} ({:.1} %, {:.1} to {:.1})", 100.0 * hits as f64 / of.max(1) as f64, 100.0 * low, 100.0 * high)
}

fn spread(values: impl Iterator<Item = f64>) -> String {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    let at = |q: f64| all[((q * all.len() as f64) as usize).min(all.len() - 1)];
    format!("median {:.3}, 95 % below {:.3}, greatest {:.3}", at(0.5), at(0.95), at(1.0))
}

/// Rates over the sets of one case.
pub fn report(case: &str, outcomes: &[Outcome]) -> String {
    let mut text = format!("{case}: {} sets\n", outcomes.len());
    let mut by_key: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for (key, error) in outcomes.iter().flat_map(|o| &o.errors_sd) {
        let count = by_key.entry(key).or_default();
        count.0 += usize::from(error.abs() <= WITHIN_SD);
        count.1 += 1;
    }
    let all = by_key.values().fold((0, 0), |sum, c| (sum.0 + c.0, sum.1 + c.1));
    text += &format!("  within {WITHIN_SD} stated sd, all identifiable parameters: {}\n", share(all.0, all.1));
    for (key, (hits, of)) in &by_key {
        text += &format!("    {key:<20} {}\n", share(*hits, *of));
    }
    let mut open: BTreeMap<&str, usize> = BTreeMap::new();
    outcomes.iter().flat_map(|o| &o.not_identifiable).for_each(|k| *open.entry(k).or_default() += 1);
    for (key, count) in open {
        text += &format!("    {key:<20} called not identifiable in {count}\n");
    }
    for (n, name) in ["declared", "identified", "identified with its findings"].into_iter().enumerate() {
        text += &format!("  held out, {name}: over noise {}; ", spread(outcomes.iter().map(|o| o.over_noise[n])));
        text += &format!("rms in µm {}\n", spread(outcomes.iter().map(|o| o.rms_um[n])));
    }
    let within = outcomes.iter().filter(|o| o.over_noise[1] <= 1.3).count();
    text += &format!("  identified at most 1.3 times the noise: {}\n", share(within, outcomes.len()));
    let misfit = outcomes.iter().filter(|o| o.p < 0.01).count();
    text += &format!("  more than noise said (p < 0.01): {}\n", share(misfit, outcomes.len()));
    let mut found: BTreeMap<String, usize> = BTreeMap::new();
    outcomes.iter().for_each(|o| *found.entry(o.found.join(" + ")).or_default() += 1);
    for (names, count) in found {
        let names = if names.is_empty() { "nothing" } else { &names };
        text += &format!("  found {names}: {}\n", share(count, outcomes.len()));
    }
    text
}

//! What the rules of a diagnosis decide: every number of `Rules` halved and doubled, on sets with a known truth.

use std::fmt::{Debug, Write};
use std::path::{Path, PathBuf};

use pkm_diagnosis::Rules;
use pkm_host::diagnose::{self, Method};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::readings::Readings;
use pkm_host::files::source::Source;
use rayon::prelude::*;
use serde_json::Value;

use crate::sets::{misses, read_json};
use crate::{Outcome, root};

/// A number of the rules, or several that go together.
trait Number: Debug {
    fn scale(&mut self, factor: f64);
}

impl Number for f64 {
    fn scale(&mut self, factor: f64) {
        *self *= factor;
    }
}

impl Number for usize {
    /// Of whole numbers at least one.
    fn scale(&mut self, factor: f64) {
        *self = ((*self as f64 * factor).round() as usize).max(1);
    }
}

impl<const N: usize> Number for [f64; N] {
    fn scale(&mut self, factor: f64) {
        self.iter_mut().for_each(|x| *x *= factor);
    }
}

impl Number for &'static [f64] {
    fn scale(&mut self, factor: f64) {
        // a few dozen bytes for each of two factors
        *self = Vec::leak(self.iter().map(|x| x * factor).collect());
    }
}

/// A rule by its name.
struct Rule {
    name: &'static str,
    of: fn(&mut Rules) -> &mut dyn Number,
}

macro_rules! rules {
    ($($name:ident)*) => { [$(Rule { name: stringify!($name), of: |rules| &mut rules.$name }),*] };
}

/// All but those of what comes before and after the finds: single poses; folds, resamples, proposals, rivals of proposals and `detectable`. `block_levels`
/// are places in `load_error_levels`, and none of these sets has as many poses as `max_single_poses`.
const RULES: [Rule; 64] = rules![
    min_dof_of_channel min_dof_of_kind min_dof_beside_declared min_dof_of_verdict load_error_levels null_draws min_signal full_fits
    max_family_p min_gain min_gain_share min_poses_gaining max_left_out_loss min_prior_gain_share max_found max_rounds
    max_amplitude max_free_amplitude max_first_step max_shape_sd shape_starts same_signal_share max_misfit_p min_explained_share
    max_explaining_effects max_explaining_measurement_errors max_explaining_load_error min_load_error_gain large_pull_sd alike_cosine min_poses
    max_log10_scale min_rss_ratio implausible_pull_sd max_implausible_pulls max_order_p min_order_share outlier_sd
    outlier_repeat_share max_outlier_share slip_sd max_slip_share min_dof_of_gross far_out_sd max_outliers block_scales declared_scatters
    ln_prior_of_scatter ln_prior_of_level ln_prior_of_low_rank min_block_gain max_blocks blocks_tried block_steps
    exchange_margin exchanges_tried min_exchange_gain rival_margin rivals_tried temper_of_places min_place_probability min_located_probability
    min_probability_alone dof_of_declared_noise
];

/// A set as a diagnosis takes it, and what is in it.
struct Set {
    file: MachineFile,
    readings: Readings,
    held_out: Readings,
    truth: Value,
}

impl Set {
    fn read(folder: &Path) -> Result<Self, String> {
        let source = |name: &str| Source::read(&folder.join(name));
        let fail = |e: pkm_host::error::Failure| e.to_string();
        let file = source("machine.toml").and_then(MachineFile::parse).map_err(fail)?;
        let read = |name: &str| source(name).and_then(|s| Readings::read(s, &file)).map_err(fail);
        let (readings, held_out) = (read("measured.csv")?, read("heldout.csv")?);
        Ok(Self { truth: read_json(&folder.join("truth.json"))?, file, readings, held_out })
    }

    /// What is wrong with its diagnosis, in words.
    fn misses(&self, rules: &Rules) -> Vec<&'static str> {
        let silent = |_: &str, _: u64, _: u64| {};
        let found =
            diagnose::diagnose(&self.file, &self.readings, Some(&self.held_out), Method::Places, rules, &silent);
        found.map_or_else(|_| vec!["refused"], |found| misses(&self.truth, &found.to_json()))
    }
}

/// How often each thing is wrong.
fn counts(sets: &[Set], rules: &Rules) -> Vec<(&'static str, usize)> {
    let mut counts: Vec<(&'static str, usize)> = Vec::new();
    let all: Vec<Vec<&'static str>> = sets.par_iter().map(|set| set.misses(rules)).collect();
    for miss in all.into_iter().flatten() {
        match counts.iter_mut().find(|c| c.0 == miss) {
            Some(there) => there.1 += 1,
            None => counts.push((miss, 1)),
        }
    }
    counts.sort_unstable();
    counts
}

/// What is more or less often wrong than before.
fn change(before: &[(&'static str, usize)], after: &[(&'static str, usize)]) -> String {
    let of = |counts: &[(&str, usize)], what: &str| counts.iter().find(|c| c.0 == what).map_or(0, |c| c.1);
    let mut all: Vec<&str> = before.iter().chain(after).map(|c| c.0).collect();
    all.sort_unstable();
    all.dedup();
    let differs = |what: &&str| of(before, what) != of(after, what);
    let said = |what: &str| format!("{what} {} to {}", of(before, what), of(after, what));
    let said: Vec<String> = all.into_iter().filter(differs).map(said).collect();
    if said.is_empty() { "–".to_owned() } else { said.join(", ") }
}

/// Prints a table of what changes on the sets of a folder.
pub fn run(options: &[String]) -> Outcome {
    let folder = options.first().map_or_else(|| root().join("fixtures/measured"), PathBuf::from);
    let files = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut folders: Vec<PathBuf> = files.flatten().map(|file| file.path()).filter(|path| path.is_dir()).collect();
    folders.sort();
    let sets: Vec<Set> = folders.iter().map(|folder| Set::read(folder)).collect::<Result<_, _>>()?;
    let before = counts(&sets, &Rules::DEFAULT);
    let mut table = format!("{} sets; as it is: {}\n\n", sets.len(), change(&[], &before).replace(" 0 to ", " in "));
    table += "| rule | value | halved | doubled |\n|---|---|---|---|\n";
    let mut idle: Vec<&str> = Vec::new();
    let mut as_is = Rules::DEFAULT;
    for (done, Rule { name, of }) in RULES.iter().enumerate() {
        eprintln!("{name}, {done} of {}", RULES.len());
        let [halved, doubled] = [0.5, 2.0].map(|factor| {
            let mut rules = Rules::DEFAULT;
            of(&mut rules).scale(factor);
            change(&before, &counts(&sets, &rules))
        });
        if halved == doubled && halved == "–" {
            idle.push(name);
        } else {
            let _ = writeln!(table, "| `{name}` | {:?} | {halved} | {doubled} |", of(&mut as_is));
        }
    }
    println!("{table}\nNothing changes with {}.", idle.join(", "));
    Ok(())
}

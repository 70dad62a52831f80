//! `fem`: the stiffness of a machine that is built in solids, by CalculiX, pose by pose: what the paper takes from a
//! commercial program (its Section 5.1).
//!
//! Machine file → [`Solid`] → [`mesh`], [`deck`] → [`ccx`] → stiffness → [`readings`], [`report`].

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::ProgressBar;
use nalgebra::Matrix6;
use pkm_core::Stiffness;
use rayon::prelude::*;
use serde_json::{Value, json};

use self::deck::{Deck, Plates};
use crate::dataset::{self, POSE_COLUMNS, stiffness_columns};
use crate::error::{Failure, Result};
use crate::machine_file::MachineFile;
use crate::output::Output;
use crate::pose::{NamedPose, file_units};
use crate::progress;
use crate::solid::Solid;
use crate::source::{self, Source};

pub mod ccx;
pub mod deck;
pub mod drawing;
pub mod mesh;
pub mod readings;
pub mod report;
pub mod slurm;

/// What is done with the cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Each is computed here, unless it is there already.
    Run,
    /// Nothing is computed: drawing and checks only.
    DryRun,
    /// Decks and a job script for a cluster.
    EmitSlurm,
    /// Only what a cluster has computed.
    Collect,
}

/// A call of `fem`.
pub struct Request<'a> {
    /// CSV of poses; `None`: those of the loads.
    pub poses: Option<&'a Path>,
    /// Stiffness CSV to write.
    pub out: &'a Path,
    /// Changes of the machine file, `key.key=value`.
    pub set: &'a [String],
    /// Size of the elements, relative to the usual.
    pub size: f64,
    /// Poses at a time.
    pub jobs: usize,
    /// The program.
    pub ccx: &'a Path,
    /// Where the cases lie; default: beside `out`.
    pub work: Option<&'a Path>,
    /// Decks and all that CalculiX wrote stay.
    pub keep: bool,
    /// What is done.
    pub mode: Mode,
    /// Measured data to make, if any.
    pub readings: Option<readings::Wish<'a>>,
}

/// A pose as a folder of its own.
pub struct Case {
    /// Where the machine is.
    pub pose: NamedPose,
    /// In the work folder; carries the deck's hash, so that a result found there is of this very deck.
    pub folder: String,
    /// Of the deck.
    pub sha256: String,
    /// Nodes and elements.
    pub size: (usize, usize),
}

/// The stiffness of a case.
pub struct Solved {
    /// At A in A-uvw.
    pub k: Matrix6<f64>,
    /// How far from symmetric the compliance was.
    pub skew: f64,
    /// What computed it.
    pub version: String,
}

/// Name of the file that is in a case's folder once it is computed, and not before.
const RESULT: &str = "result.dat";

/// Begins the name of a folder in which a case is being computed.
const SCRATCH: &str = "running-";

impl Solved {
    fn read(path: &Path) -> Option<Self> {
        let text = std::fs::read_to_string(path).ok()?;
        let (k, skew) = ccx::stiffness(&ccx::compliance(&text)?).ok()?;
        Some(Self { k, skew, version: ccx::version_in(&text).unwrap_or_else(|| "CalculiX".to_owned()) })
    }

    /// As the core's type.
    pub fn stiffness(&self) -> Stiffness<f64> {
        Stiffness::from_lower(&std::array::from_fn(|i| std::array::from_fn(|j| self.k[(i, j)])))
    }
}

/// The machine in solids, its plates meshed.
struct Model<'a> {
    file: &'a MachineFile,
    solid: &'a Solid,
    plates: Plates,
}

impl Model<'_> {
    fn deck(&self, pose: &NamedPose) -> std::result::Result<(Deck, String), String> {
        let deck = Deck::new(self.solid, &self.file.parameters, &pose.pose, &self.plates)?;
        let [theta, sigma, z0] = file_units(&pose.pose);
        let text = deck.text(&format!("theta {theta} deg, sigma {sigma} deg, Z0 {z0} mm"));
        Ok((deck, text))
    }

    fn case(&self, pose: &NamedPose) -> std::result::Result<Case, String> {
        let (deck, text) = self.deck(pose)?;
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name: String = pose.id.chars().take(40).map(plain).collect();
        // ids that look alike once made plain are still told apart
        let of_both = source::sha256(format!("{}\n{text}", pose.id).as_bytes());
        let folder = format!("case-{name}-{}", &of_both[..16]);
        Ok(Case { pose: pose.clone(), folder, sha256: source::sha256(text.as_bytes()), size: deck.size() })
    }

    /// Makes a folder with the case's deck.
    fn write_deck(&self, case: &Case, folder: &Path) -> Result<()> {
        let (_, text) = self.deck(&case.pose).map_err(Failure::other)?;
        source::write(&folder.join(ccx::CASE).with_extension("inp"), text, &[])
    }
}

fn bar(of: usize) -> ProgressBar {
    let bar = progress::bar(of as u64, "{bar:30} {pos}/{len} poses, {elapsed} gone, {eta} left");
    bar.tick();
    bar
}

/// Computes a case in a folder of its own, and moves what is worth keeping to the case's.
fn compute_one(request: &Request<'_>, version: &str, work: &Path, model: &Model<'_>, case: &Case) -> Result<()> {
    let folder = work.join(&case.folder);
    std::fs::create_dir_all(&folder).map_err(|e| Failure::io("create the folder", &folder, &e))?;
    let scratch = tempfile::Builder::new().prefix(SCRATCH).tempdir_in(work);
    let scratch = scratch.map_err(|e| Failure::io("create a folder in", work, &e))?;
    model.write_deck(case, scratch.path())?;
    let keep = |name: &str| {
        let (from, to) = (scratch.path().join(name), folder.join(name));
        std::fs::rename(&from, &to).map_err(|e| Failure::io("write", &to, &e)).map(|()| to.display().to_string())
    };
    let printed = match ccx::run(request.ccx, scratch.path()) {
        Ok(printed) => printed,
        Err(ccx::Failed::NotStarted(failure)) => return Err(failure),
        Err(ccx::Failed::Said(message)) => return Err(Failure::other(message).in_file(keep(ccx::LOG)?)),
    };
    let whole = ccx::compliance(&printed).ok_or_else(|| "not all displacements are there".to_owned());
    if let Err(message) = whole.and_then(|c| ccx::stiffness(&c)) {
        let message =
            format!("ccx ended without an error, but {message}: is something in [solid] far too soft or too stiff?");
        return Err(Failure::other(message).in_file(keep(ccx::LOG)?));
    }
    if request.keep {
        for entry in std::fs::read_dir(scratch.path()).into_iter().flatten().flatten() {
            keep(&entry.file_name().to_string_lossy())?;
        }
    }
    source::write(&folder.join(RESULT), format!("{version}\n{printed}"), &[])
}

/// Computes every case that has no result yet. The count of those that were computed.
fn compute(request: &Request<'_>, version: &str, work: &Path, model: &Model<'_>, cases: &[Case]) -> Result<usize> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(request.jobs).build();
    let pool = pool.map_err(|e| Failure::other(format!("cannot start {} jobs: {e}", request.jobs)))?;
    let pending: Vec<&Case> = cases.iter().filter(|c| Solved::read(&result_of(work, c)).is_none()).collect();
    if pending.is_empty() {
        return Ok(0);
    }
    std::fs::create_dir_all(work).map_err(|e| Failure::io("create the folder", work, &e))?;
    let lock = work.join("lock");
    let file = std::fs::File::create(&lock).map_err(|e| Failure::io("write", &lock, &e))?;
    if let Err(std::fs::TryLockError::WouldBlock) = file.try_lock() {
        let message = "another run works in this folder: wait for it, or name another one with --work";
        return Err(Failure::other(message).in_file(work.display().to_string()));
    }
    // nobody works there: what a killed run left
    for entry in std::fs::read_dir(work).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(SCRATCH) {
            _ = std::fs::remove_dir_all(entry.path());
        }
    }
    let bar = bar(pending.len());
    let computed = AtomicUsize::new(0);
    let one = |case: &&Case| {
        compute_one(request, version, work, model, case)?;
        computed.fetch_add(1, Ordering::Relaxed);
        bar.inc(1);
        Ok(())
    };
    let done: Result<()> = pool.install(|| pending.par_iter().try_for_each(one));
    bar.finish_and_clear();
    let computed = computed.into_inner();
    _ = std::fs::remove_file(&lock);
    match done {
        Ok(()) => Ok(computed),
        Err(f) => {
            let message = format!(
                "{}. {computed} poses are computed and kept in {}: the same command goes on from there",
                f.message.trim_end_matches('.'),
                work.display()
            );
            Err(Failure { message, ..f })
        }
    }
}

/// Takes away what a run left that is of no more use, and nothing else.
fn clear(work: &Path, cases: &[Case]) {
    for case in cases {
        let folder = work.join(&case.folder);
        [RESULT, ccx::LOG].iter().for_each(|name| _ = std::fs::remove_file(folder.join(name)));
        // kept decks keep their folder
        _ = std::fs::remove_dir(folder);
    }
    _ = std::fs::remove_dir(work);
}

fn result_of(work: &Path, case: &Case) -> PathBuf {
    work.join(&case.folder).join(RESULT)
}

/// The stiffness file. Eight digits: `ccx` prints seven.
fn stiffness_csv(file: &MachineFile, version: &str, request: &Request<'_>, solved: &[(&Case, Solved)]) -> String {
    let mut header: Vec<String> = POSE_COLUMNS.map(str::to_owned).to_vec();
    header.extend(stiffness_columns().map(|(_, _, name)| name));
    let rows = solved.iter().map(|(case, s)| {
        let mut row = vec![case.pose.id.clone()];
        row.extend(dataset::pose_cells(&case.pose.pose));
        row.extend(stiffness_columns().map(|(i, j, _)| format!("{:.7e}", s.k[(i, j)])));
        row
    });
    let mut set = request.set.join(", ");
    if !set.is_empty() {
        set = format!(", with {}", crate::error::printable(&set));
    }
    format!(
        "# terminal stiffness of machine `{}`{set} by finite elements ({version}, pkm-host {}, mesh {}); simulated\n\
         # K at A in A-uvw, SI; inverse of the compliance from six unit wrenches at A\n{}",
        file.name,
        env!("CARGO_PKG_VERSION"),
        request.size,
        dataset::to_csv(b',', &header, rows)
    )
}

/// How the data came about, without what differs from run to run.
fn manifest(file: &MachineFile, solid: &Solid, request: &Request<'_>, version: &str, cases: &[Case]) -> Value {
    let poses: Vec<Value> = cases
        .iter()
        .map(|c| json!({ "pose": c.pose.id, "deck_sha256": c.sha256, "nodes": c.size.0, "elements": c.size.1 }))
        .collect();
    json!({
        "format": 1,
        "tool": format!("pkm-host {}", env!("CARGO_PKG_VERSION")),
        "solver": version,
        "machine": file.name,
        "machine_sha256": file.source.sha256(),
        "set": request.set,
        "mesh": request.size,
        "solid": solid.toml(),
        "poses": poses,
    })
}

/// Sets the value of a key; tables on the way come into being, `[[limb]]` is counted from 1.
fn put(
    table: &mut dyn toml_edit::TableLike,
    keys: &[&str],
    value: toml_edit::Value,
) -> std::result::Result<(), String> {
    match keys {
        [] => Err("expected the key of a value".into()),
        [key] => {
            table.insert(key, toml_edit::Item::Value(value));
            Ok(())
        }
        [key, number, rest @ ..] if table.get(key).is_some_and(toml_edit::Item::is_array_of_tables) => {
            let tables = table.get_mut(key).and_then(toml_edit::Item::as_array_of_tables_mut);
            let at = number.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
            match tables.zip(at).and_then(|(tables, at)| tables.get_mut(at)) {
                Some(table) => put(table, rest, value),
                None => Err(format!("there is no {key}.{number}: they count from 1")),
            }
        }
        [key, rest @ ..] => match table.entry(key).or_insert(toml_edit::table()).as_table_like_mut() {
            Some(table) => put(table, rest, value),
            None => Err(format!("{key} is a value, it has no keys")),
        },
    }
}

/// The machine file with what `--set` says.
fn changed(source: Source, set: &[String]) -> Result<Source> {
    if set.is_empty() {
        return Ok(source);
    }
    // what is wrong with the file itself is better told of the file itself
    MachineFile::parse(source.clone())?;
    let fail = |message: String| Failure::usage(format!("--set: {message}"));
    let document = source.text()?.parse::<toml_edit::DocumentMut>();
    let mut document = document.map_err(|e| fail(crate::toml_error::plain(e.message())))?;
    for change in set {
        let Some((path, value)) = change.split_once('=').map(|(p, v)| (p.trim(), v.trim())) else {
            return Err(fail(format!("expected key.key=value, found `{change}`")));
        };
        let word = !value.is_empty() && value.chars().all(|c| c.is_ascii_alphabetic());
        let value = match value.parse::<toml_edit::Value>() {
            Ok(value) => value,
            Err(_) if word => value.into(),
            Err(_) => return Err(fail(format!("{path}: expected a number, a word or an array, found `{value}`"))),
        };
        let keys: Vec<&str> = path.split('.').collect();
        put(document.as_table_mut(), &keys, value).map_err(|m| fail(format!("{path}: {m}")))?;
    }
    Ok(Source::from_text(&format!("{} with --set", source.name), document.to_string()))
}

/// `fem`.
///
/// # Errors
/// Bad files and options; a pose at which solids collide; CalculiX missing or failing; an unwritable folder.
pub fn fem(machine: Option<&Path>, request: &Request<'_>) -> Result<Output> {
    let source = changed(Source::read_or(machine, pkm_fixtures::MACHINE)?, request.set)?;
    let file = MachineFile::parse_with_warnings(source)?;
    let solid = file.solid.as_ref().map_err(Clone::clone)?;
    let of_loads = request.readings.as_ref().and_then(|wish| wish.loads);
    let Some(path) = request.poses.or(of_loads) else {
        return Err(Failure::usage("--poses: which poses? Give a CSV, such as `plan` writes"));
    };
    let name = path.display().to_string();
    let poses_source = Source::read(path)?;
    let poses_from = crate::report::of_file(&poses_source);
    let listed = match request.poses {
        Some(_) => dataset::read_poses(poses_source, &file)?,
        None => Vec::new(),
    };
    let loads = request.readings.as_ref().map(|wish| readings::Loads::new(wish, &listed, &file)).transpose()?;
    let poses = match &loads {
        Some(loads) if request.poses.is_none() => loads.poses().to_vec(),
        _ => listed,
    };
    dataset::refuse_doubled_ids(&name, &poses)?;

    if file.parameters.effects != pkm_core::effects::Effects::NONE {
        eprintln!("warning: {}: its effects are the core's; they are not built in solids", file.source.name);
    }
    let plates = Plates::new(solid, &file.parameters, request.size);
    let plates = plates.map_err(|message| Failure::input(message).in_file(&file.source.name).at_column("solid"))?;
    let model = Model { file: &file, solid, plates };
    let cases: Vec<_> = poses.par_iter().map(|p| model.case(p)).collect();
    let mut collisions = poses.iter().zip(&cases).filter_map(|(p, c)| Some((p, c.as_ref().err()?)));
    if let Some((pose, why)) = collisions.next() {
        let more = collisions.count();
        let more = if more > 0 { format!(" ({more} more poses collide)") } else { String::new() };
        let message = format!("pose `{}` collides: {why}{more}", pose.id);
        return Err(Failure::input(message).in_file(name).at_line(pose.line).at_column("pose"));
    }
    let cases: Vec<Case> = cases.into_iter().flatten().collect();
    let beside = |end: &str| request.out.with_extension(end);
    let work = request.work.map_or_else(|| beside("work"), Path::to_path_buf);
    let html = beside(if request.mode == Mode::DryRun { "drawing.html" } else { "html" });
    let manifest_path = beside("manifest.json");
    let readings_path = request.readings.as_ref().map(|wish| wish.out);
    let written: Vec<&Path> = [request.out, &html, &manifest_path].into_iter().chain(readings_path).collect();
    let read = [machine, request.poses, of_loads];
    source::keep_inputs(&written, &read)?;
    for (i, path) in written.iter().enumerate() {
        if written[..i].contains(path) {
            let message = "two files of this call have this name: name --out otherwise, such as k.csv";
            return Err(Failure::usage(message).in_file(path.display().to_string()));
        }
    }
    let largest = cases.iter().map(|c| c.size).max().unwrap_or_default();
    let about = |what: &str| format!("{} poses, up to {} nodes each: {what}\n", cases.len(), largest.0);

    let version = match request.mode {
        Mode::Run => ccx::version(request.ccx)?,
        Mode::Collect => String::new(),
        Mode::DryRun => {
            let version = "nothing yet";
            let (cases, poses_from) = (&cases, &poses_from);
            let facts = report::Facts { file: &file, solid, request, cases, solved: None, poses_from, version };
            source::write(&html, report::page(&facts)?, &read)?;
            let text = about(&format!("nothing computed; the machine is drawn in {}", html.display()));
            let json = json!({ "poses": cases.len(), "nodes": largest.0, "elements": largest.1, "report": html.display().to_string() });
            return Ok(Output { text, json });
        }
        Mode::EmitSlurm => {
            let bar = bar(cases.len());
            cases.par_iter().try_for_each(|case| {
                let written = model.write_deck(case, &work.join(&case.folder));
                bar.inc(1);
                written
            })?;
            bar.finish_and_clear();
            let folders: Vec<&str> = cases.iter().map(|c| c.folder.as_str()).collect();
            let tasks = slurm::write(&work, &folders)?;
            let text = about(&format!(
                "decks and {0} are in {1}. There, `sbatch {0}` starts {tasks} tasks; then run the same command with \
                 --collect in place of --emit slurm",
                slurm::SCRIPT,
                work.display()
            ));
            let json = json!({ "poses": cases.len(), "tasks": tasks, "work": work.display().to_string(), "script": slurm::SCRIPT });
            return Ok(Output { text, json });
        }
    };

    let computed = if request.mode == Mode::Run {
        // two seconds a pose: it is told before them what can't be written after them
        written.iter().try_for_each(|path| source::check_writable(path))?;
        compute(request, &version, &work, &model, &cases)?
    } else {
        0
    };
    let mut solved = Vec::new();
    let mut missing = Vec::new();
    for case in &cases {
        match Solved::read(&result_of(&work, case)) {
            Some(s) => solved.push((case, s)),
            None => missing.push(case),
        }
    }
    if let Some(first) = missing.first() {
        let message = format!(
            "{} of {} poses have no whole result there (first `{}`, folder {}): wait for the job, or submit it again, which \
             goes on from what is there; options and files must be those of --emit slurm",
            missing.len(),
            cases.len(),
            first.pose.id,
            first.folder
        );
        return Err(Failure::other(message).in_file(work.display().to_string()));
    }

    let versions: BTreeSet<&str> = solved.iter().map(|(_, s)| s.version.as_str()).collect();
    let version = versions.into_iter().collect::<Vec<_>>().join(", ");
    let manifest = source::json(&manifest(&file, solid, request, &version, &cases));
    let facts = report::Facts {
        file: &file,
        solid,
        request,
        cases: &cases,
        solved: Some(&solved),
        poses_from: &poses_from,
        version: &version,
    };
    let mut text = about(&format!(
        "{computed} computed, {} taken over\n{}wrote {}, {} and {}",
        cases.len() - computed,
        facts.summary(),
        request.out.display(),
        manifest_path.display(),
        html.display()
    ));
    let page = report::page(&facts)?;
    if let (Some(wish), Some(loads)) = (&request.readings, &loads) {
        text.push_str(&loads.write(wish, &file, request, &solved, &read)?);
    }
    source::write(&manifest_path, manifest, &read)?;
    source::write(&html, page, &read)?;
    source::write(request.out, stiffness_csv(&file, &version, request, &solved), &read)?;
    if request.mode == Mode::Run && request.work.is_none() && !request.keep {
        clear(&work, &cases);
    }
    let skew = solved.iter().map(|(_, s)| s.skew).fold(0.0, f64::max);
    let json = json!({
        "poses": cases.len(), "computed": computed, "nodes": largest.0, "elements": largest.1, "asymmetry": skew,
        "basic_model": facts.against_core(), "out": request.out.display().to_string(),
        "readings": readings_path.map(|p| p.display().to_string()), "seed": request.readings.as_ref().map(|w| w.seed),
    });
    Ok(Output { text, json })
}

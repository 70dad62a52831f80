//! `fem`: the stiffness of a machine that is built in solids, by CalculiX, pose by pose: what the paper takes from a
//! commercial program (its Section 5.1).
//!
//! Machine file → [`Solid`] → [`mesh`], [`deck`] → [`ccx`] → stiffness → [`readings`], [`report`].

use std::collections::BTreeSet;
use std::path::Path;

use rayon::prelude::*;
use serde_json::{Value, json};

pub use self::cases::{Case, Solved};
use self::cases::{Model, bar, clear, compute};
use self::deck::Plates;
use crate::cli::output::Output;
use crate::error::{Failure, Result};
use crate::files::dataset::{self, POSE_COLUMNS, stiffness_columns};
use crate::files::machine::MachineFile;
use crate::files::solid::Solid;
use crate::files::source::{self, Source};
use crate::pose::NamedPose;

mod cases;
pub mod ccx;
pub mod deck;
pub mod mesh;
pub mod readings;
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
    let mut document = document.map_err(|e| fail(crate::files::toml_error::plain(e.message())))?;
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

/// Decks and a job script for a cluster: what was done, in words and as a document.
fn emit_slurm(model: &Model<'_>, work: &Path, cases: &[Case]) -> Result<(String, Value)> {
    let bar = bar(cases.len());
    cases.par_iter().try_for_each(|case| {
        let written = model.write_deck(case, &work.join(&case.folder));
        bar.inc(1);
        written
    })?;
    bar.finish_and_clear();
    let folders: Vec<&str> = cases.iter().map(|c| c.folder.as_str()).collect();
    let tasks = slurm::write(work, &folders)?;
    let what = format!(
        "decks and {0} are in {1}. There, `sbatch {0}` starts {tasks} tasks; then run the same command with --collect in \
         place of --emit slurm",
        slurm::SCRIPT,
        work.display()
    );
    let json =
        json!({ "poses": cases.len(), "tasks": tasks, "work": work.display().to_string(), "script": slurm::SCRIPT });
    Ok((what, json))
}

/// Refuses files to write that are read, or are one.
fn check_names(written: &[&Path], read: &[Option<&Path>]) -> Result<()> {
    source::keep_inputs(written, read)?;
    for (i, path) in written.iter().enumerate() {
        if written[..i].contains(path) {
            let message = "two files of this call have this name: name --out otherwise, such as k.csv";
            return Err(Failure::usage(message).in_file(path.display().to_string()));
        }
    }
    Ok(())
}

/// The poses as cases.
fn cases_of(model: &Model<'_>, poses: &[NamedPose], name: &str) -> Result<Vec<Case>> {
    let cases: Vec<_> = poses.par_iter().map(|p| model.case(p)).collect();
    let mut collisions = poses.iter().zip(&cases).filter_map(|(p, c)| Some((p, c.as_ref().err()?)));
    if let Some((pose, why)) = collisions.next() {
        let more = collisions.count();
        let more = if more > 0 { format!(" ({more} more poses collide)") } else { String::new() };
        let message = format!("pose `{}` collides: {why}{more}", pose.id);
        return Err(Failure::input(message).in_file(name).at_line(pose.line).at_column("pose"));
    }
    Ok(cases.into_iter().flatten().collect())
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
    let poses_from = crate::report::page::of_file(&poses_source);
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
    let cases = cases_of(&model, &poses, &name)?;
    let beside = |end: &str| request.out.with_extension(end);
    let work = request.work.map_or_else(|| beside("work"), Path::to_path_buf);
    let html = beside(if request.mode == Mode::DryRun { "drawing.html" } else { "html" });
    let manifest_path = beside("manifest.json");
    let readings_path = request.readings.as_ref().map(|wish| wish.out);
    let written: Vec<&Path> = [request.out, &html, &manifest_path].into_iter().chain(readings_path).collect();
    let read = [machine, request.poses, of_loads];
    check_names(&written, &read)?;
    let largest = cases.iter().map(|c| c.size).max().unwrap_or_default();
    let about = |what: &str| format!("{} poses, up to {} nodes each: {what}\n", cases.len(), largest.0);

    let version = match request.mode {
        Mode::Run => ccx::version(request.ccx)?,
        Mode::Collect => String::new(),
        Mode::DryRun => {
            let version = "nothing yet";
            let (cases, poses_from) = (&cases, &poses_from);
            let facts =
                crate::report::fem::Facts { file: &file, solid, request, cases, solved: None, poses_from, version };
            source::write(&html, crate::report::fem::page(&facts)?, &read)?;
            let what = format!("nothing computed; the machine is drawn in {}", html.display());
            let json = json!({
                "poses": cases.len(), "nodes": largest.0, "elements": largest.1, "report": html.display().to_string(),
            });
            return Output::new(about(&what), &json);
        }
        Mode::EmitSlurm => {
            let (what, json) = emit_slurm(&model, &work, &cases)?;
            return Output::new(about(&what), &json);
        }
    };

    let computed = if request.mode == Mode::Run {
        // two seconds a pose: it is told before them what can't be written after them
        written.iter().try_for_each(|path| source::check_writable(path))?;
        compute(request, &version, &work, &model, &cases)?
    } else {
        0
    };
    let solved = cases::gather(&work, &cases)?;
    let versions: BTreeSet<&str> = solved.iter().map(|(_, s)| s.version.as_str()).collect();
    let version = versions.into_iter().collect::<Vec<_>>().join(", ");
    let manifest = source::json(&manifest(&file, solid, request, &version, &cases));
    let facts = crate::report::fem::Facts {
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
    let page = crate::report::fem::page(&facts)?;
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
    Output::new(text, &json)
}

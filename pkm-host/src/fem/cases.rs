//! Poses as folders: what CalculiX is given and what it left, so that a run that was interrupted goes on.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Matrix6;
use pkm_core::Stiffness;
use rayon::prelude::*;

use super::deck::{Deck, Plates};
use super::{Settings, ccx};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::solid::Solid;
use crate::files::source;
use crate::pose::{NamedPose, file_units};
use crate::progress::Progress;

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
pub(super) const RESULT: &str = "result.dat";

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
        Stiffness::from_lower(&self.k)
    }
}

/// The machine in solids, its plates meshed.
pub struct Model<'a> {
    /// As changed by `--set`.
    pub file: &'a MachineFile,
    /// Of the file.
    pub solid: &'a Solid,
    /// Of the platforms.
    pub plates: Plates,
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
    pub(super) fn write_deck(&self, case: &Case, folder: &Path) -> Result<()> {
        let (_, text) = self.deck(&case.pose).map_err(Failure::other)?;
        source::write(&folder.join(ccx::CASE).with_extension("inp"), text, &[])
    }
}

/// The poses as cases.
///
/// # Errors
/// A pose at which solids collide; `name` is its file.
pub fn cases_of(model: &Model<'_>, poses: &[NamedPose], name: &str) -> Result<Vec<Case>> {
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

/// Computes a case in a folder of its own, and moves what is worth keeping to the case's.
fn compute_one(settings: &Settings<'_>, version: &str, work: &Path, model: &Model<'_>, case: &Case) -> Result<()> {
    let folder = work.join(&case.folder);
    source::make_folder(&folder)?;
    let scratch = tempfile::Builder::new().prefix(SCRATCH).tempdir_in(work);
    let scratch = scratch.map_err(|e| Failure::io("create a folder in", work, &e))?;
    model.write_deck(case, scratch.path())?;
    let keep = |name: &str| {
        let (from, to) = (scratch.path().join(name), folder.join(name));
        std::fs::rename(&from, &to).map_err(|e| Failure::io("write", &to, &e)).map(|()| to.display().to_string())
    };
    let printed = match ccx::run(settings.ccx, scratch.path()) {
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
    if settings.keep {
        for entry in std::fs::read_dir(scratch.path()).into_iter().flatten().flatten() {
            keep(&entry.file_name().to_string_lossy())?;
        }
    }
    source::write(&folder.join(RESULT), format!("{version}\n{printed}"), &[])
}

/// Computes every case that has no result yet. The count of those that were computed.
///
/// # Errors
/// CalculiX fails, another run works in the folder, an unwritable folder.
pub fn compute(
    settings: &Settings<'_>,
    version: &str,
    work: &Path,
    model: &Model<'_>,
    cases: &[Case],
    progress: &Progress<'_>,
) -> Result<usize> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(settings.jobs).build();
    let pool = pool.map_err(|e| Failure::other(format!("cannot start {} jobs: {e}", settings.jobs)))?;
    let pending: Vec<&Case> = cases.iter().filter(|c| Solved::read(&result_of(work, c)).is_none()).collect();
    if pending.is_empty() {
        return Ok(0);
    }
    source::make_folder(work)?;
    let lock = work.join("lock");
    let file = std::fs::File::create(&lock).map_err(|e| Failure::io("write", &lock, &e))?;
    file.try_lock().map_err(|e| match e {
        std::fs::TryLockError::WouldBlock => {
            let message = "another run works in this folder: wait for it, or name another one with --work";
            Failure::other(message).in_file(work.display().to_string())
        }
        std::fs::TryLockError::Error(e) => Failure::io("lock", &lock, &e),
    })?;
    // nobody works there: what a killed run left
    for entry in std::fs::read_dir(work).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(SCRATCH) {
            _ = std::fs::remove_dir_all(entry.path());
        }
    }
    let computed = AtomicUsize::new(0);
    progress("poses", 0, pending.len() as u64);
    let one = |case: &&Case| {
        compute_one(settings, version, work, model, case)?;
        let done = computed.fetch_add(1, Ordering::Relaxed) + 1;
        progress("poses", done as u64, pending.len() as u64);
        Ok(())
    };
    let done: Result<()> = pool.install(|| pending.par_iter().try_for_each(one));
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
pub fn clear(work: &Path, cases: &[Case]) {
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

/// What was computed of every case.
///
/// # Errors
/// Cases without a result.
pub fn gather<'a>(work: &Path, cases: &'a [Case]) -> Result<Vec<(&'a Case, Solved)>> {
    let mut solved = Vec::new();
    let mut missing = Vec::new();
    for case in cases {
        match Solved::read(&result_of(work, case)) {
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
    Ok(solved)
}

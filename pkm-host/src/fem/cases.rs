//! Poses as folders: what CalculiX is given and what it left, so that a run that was interrupted goes on.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::ProgressBar;
use nalgebra::Matrix6;
use pkm_core::Stiffness;
use rayon::prelude::*;

use super::deck::{Deck, Plates};
use super::{Request, ccx};
use crate::cli::progress;
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::solid::Solid;
use crate::files::source;
use crate::pose::{NamedPose, file_units};

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
        Stiffness::from_lower(&std::array::from_fn(|i| std::array::from_fn(|j| self.k[(i, j)])))
    }
}

/// The machine in solids, its plates meshed.
pub(super) struct Model<'a> {
    pub file: &'a MachineFile,
    pub solid: &'a Solid,
    pub plates: Plates,
}

impl Model<'_> {
    fn deck(&self, pose: &NamedPose) -> std::result::Result<(Deck, String), String> {
        let deck = Deck::new(self.solid, &self.file.parameters, &pose.pose, &self.plates)?;
        let [theta, sigma, z0] = file_units(&pose.pose);
        let text = deck.text(&format!("theta {theta} deg, sigma {sigma} deg, Z0 {z0} mm"));
        Ok((deck, text))
    }

    pub fn case(&self, pose: &NamedPose) -> std::result::Result<Case, String> {
        let (deck, text) = self.deck(pose)?;
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name: String = pose.id.chars().take(40).map(plain).collect();
        // ids that look alike once made plain are still told apart
        let of_both = source::sha256(format!("{}\n{text}", pose.id).as_bytes());
        let folder = format!("case-{name}-{}", &of_both[..16]);
        Ok(Case { pose: pose.clone(), folder, sha256: source::sha256(text.as_bytes()), size: deck.size() })
    }

    /// Makes a folder with the case's deck.
    pub fn write_deck(&self, case: &Case, folder: &Path) -> Result<()> {
        let (_, text) = self.deck(&case.pose).map_err(Failure::other)?;
        source::write(&folder.join(ccx::CASE).with_extension("inp"), text, &[])
    }
}

/// A bar of poses.
pub(super) fn bar(of: usize) -> ProgressBar {
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
pub(super) fn compute(
    request: &Request<'_>,
    version: &str,
    work: &Path,
    model: &Model<'_>,
    cases: &[Case],
) -> Result<usize> {
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
pub(super) fn clear(work: &Path, cases: &[Case]) {
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
pub(super) fn gather<'a>(work: &Path, cases: &'a [Case]) -> Result<Vec<(&'a Case, Solved)>> {
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

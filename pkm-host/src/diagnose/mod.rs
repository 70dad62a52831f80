//! From measured deflections to what the model lacks (spec: diagnosis.md).

pub mod model;
pub mod noise;
pub mod readings;
pub mod screen;
pub mod search;
pub mod solve;

use crate::error::{Failure, Result};
use crate::machine_file::MachineFile;
use crate::source::Source;

/// Trial.
///
/// # Errors
/// Any.
pub fn trial(source: Source, machine: &MachineFile) -> Result<String> {
    use std::fmt::Write;
    let start = std::time::Instant::now();
    let readings = readings::Readings::read(source, machine)?;
    let noise = noise::Noise::new(&readings)?;
    let mut out = String::new();
    let _ = writeln!(out, "noise {:?}", noise);
    let whitener = noise::Whitener::new(&readings, &noise);
    let model = model::Model::new(machine).ok_or_else(|| Failure::other("no model"))?;
    let problem = solve::Problem::new(&readings, &whitener, &model);
    let found = search::search(&problem, 1).ok_or_else(|| Failure::other("no fit"))?;
    let _ = writeln!(out, "n {} base chi2 {:.1} edf {:.1}, {} candidates", problem.len(), found.base.chi2, found.base.used_freedoms(), found.candidates.len());
    for (u, x) in found.base.unknowns.iter().zip(found.base.x.iter()) {
        if x.abs() > 1.5 { let _ = writeln!(out, "  pull {u:?} {x:.2}"); }
    }
    for r in &found.rounds {
        let _ = writeln!(out, " round p_fw {:.2e}", r.p_family);
        for r in r.ranking.iter().enumerate().filter(|(i, r)| *i < 6 || matches!(r.candidate, search::Candidate::Effect(0|2))).map(|(_, r)| r) {
            let _ = writeln!(out, "   {:?} {:?} t {:.1} k {} p {:.1e} lin {:.1} gain {:?} loo {:.4} poses {:.2} {:?}", r.candidate, r.candidate.names(&problem), r.score.statistic, r.score.freedoms, r.score.p, r.score.gain, r.gain, r.left_out_gain, r.poses_that_gain, r.rejected);
        }
    }
    for f in &found.found {
        let _ = writeln!(out, " FOUND {:?} class {:?} conf {:.3}", f.candidate.names(&problem), f.class.iter().map(|c| c.names(&problem)).collect::<Vec<_>>(), f.confidence);
    }
    let _ = writeln!(out, "end chi2 {:.1} edf {:.1}", found.fit.chi2, found.fit.used_freedoms());
    for (u, x) in found.fit.unknowns.iter().zip(found.fit.x.iter()) {
        if x.abs() > 2.0 || !matches!(u, model::Unknown::Stiffness(_)) { let _ = writeln!(out, "  {u:?} {x:.3}"); }
    }
    let _ = writeln!(out, "{:.2} s", start.elapsed().as_secs_f64());
    Ok(out)
}

//! CalculiX as an outside program: a deck in a folder of its own, the compliance out of what it prints.

use std::path::Path;
use std::process::{Command, Stdio};

use nalgebra::Matrix6;

use crate::error::{Failure, Result};

/// Name of a case's files.
pub const CASE: &str = "case";

/// Where what it says is kept.
pub const LOG: &str = "ccx.log";

/// What `ccx` calls itself.
///
/// # Errors
/// It is not there, or is something else.
pub fn version(ccx: &Path) -> Result<String> {
    let run = Command::new(ccx).arg("-v").stdin(Stdio::null()).output();
    let text = run.map(|out| String::from_utf8_lossy(&out.stdout).into_owned()).map_err(|e| missing(ccx, &e))?;
    version_in(&text).ok_or_else(|| {
        Failure::other("expected CalculiX, which answers to -v with its version").in_file(ccx.display().to_string())
    })
}

/// The version in what `ccx -v` says, which also stands at the head of a result.
pub fn version_in(text: &str) -> Option<String> {
    let number = |l: &str| Some(format!("CalculiX {}", l.split_once("Version ")?.1.trim()));
    let head = |l: &str| l.starts_with("CalculiX ").then(|| l.trim().to_owned());
    text.lines().find_map(|l| head(l).or_else(|| number(l)))
}

fn missing(ccx: &Path, error: &std::io::Error) -> Failure {
    let message = format!(
        "cannot start CalculiX: {error}. Install it (Debian, Ubuntu: apt-get install calculix-ccx; else \
         www.calculix.de) or name it with --ccx"
    );
    Failure::other(message).in_file(ccx.display().to_string())
}

/// Why there is no result.
pub enum Failed {
    /// There is no such program, or no place for it.
    NotStarted(Failure),
    /// What it complained of; all it said is in the log.
    Said(String),
}

/// Runs the deck in a folder and leaves there what it wrote; what it printed of displacements.
///
/// # Errors
/// It can't be started, or fails.
pub fn run(ccx: &Path, folder: &Path) -> std::result::Result<String, Failed> {
    let done = Command::new(ccx)
        .args(["-i", CASE])
        .current_dir(folder)
        // one core each: poses run side by side, and the result can't depend on the number of threads
        .env("OMP_NUM_THREADS", "1")
        .env_remove("CCX_NPROC_STIFFNESS")
        .env_remove("CCX_NPROC_EQUATION_SOLVER")
        .env_remove("CCX_NPROC_RESULTS")
        .stdin(Stdio::null())
        .output()
        .map_err(|e| Failed::NotStarted(missing(ccx, &e)))?;
    let log = String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr);
    let path = folder.join(LOG);
    std::fs::write(&path, &log).map_err(|e| Failed::NotStarted(Failure::io("write", &path, &e)))?;
    let complaint = log.lines().skip_while(|l| !l.contains("*ERROR")).take(3).map(str::trim).collect::<Vec<_>>();
    if done.status.success() && complaint.is_empty() {
        let printed = std::fs::read_to_string(folder.join(CASE).with_extension("dat"));
        return printed.map_err(|e| Failed::Said(format!("ccx printed nothing that can be read: {e}")));
    }
    let said = if complaint.is_empty() {
        log.lines().rev().map(str::trim).find(|l| !l.is_empty()).unwrap_or("nothing").to_owned()
    } else {
        complaint.join(" ")
    };
    Err(Failed::Said(format!("ccx failed ({}): {said}", done.status)))
}

/// Displacements of A, a column a unit wrench; `None` when the output is not whole.
pub fn compliance(printed: &str) -> Option<Matrix6<f64>> {
    if !printed.ends_with('\n') {
        return None;
    }
    let rows = printed.lines().filter_map(|line| {
        let mut cells = line.split_whitespace();
        cells.next()?.parse::<usize>().ok()?;
        let three: Vec<f64> = cells.map(str::parse).collect::<std::result::Result<_, _>>().ok()?;
        <[f64; 3]>::try_from(three).ok()
    });
    let values: Vec<f64> = rows.flatten().collect();
    (values.len() == 36 && values.iter().all(|v| v.is_finite())).then(|| Matrix6::from_column_slice(&values))
}

/// Stiffness from what one case printed, and how far the compliance was from symmetric, relative to √(c_ii c_jj).
///
/// # Errors
/// A compliance that is not that of an elastic body.
pub fn stiffness(c: &Matrix6<f64>) -> std::result::Result<(Matrix6<f64>, f64), String> {
    let mut skew: f64 = 0.0;
    for i in 0..6 {
        for j in 0..i {
            skew = skew.max((c[(i, j)] - c[(j, i)]).abs() / (c[(i, i)] * c[(j, j)]).abs().sqrt());
        }
    }
    let symmetric = (c + c.transpose()) * 0.5;
    match symmetric.cholesky() {
        Some(factor) if skew < 1e-4 => Ok((factor.inverse(), skew)),
        _ => Err(format!("its compliance is not symmetric positive definite (off by {skew:.1e})")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_whole_is_no_result() {
        let row = "      1575  5.717982E-07  2.400000E-08  1.451604E-21\n";
        let whole = format!("\n  E I G E N V A L U E    N U M B E R     1\n\n{}", row.repeat(12));
        assert_eq!(compliance(&whole).unwrap()[(0, 5)], 5.717982e-7);
        assert!(compliance(&row.repeat(11)).is_none());
        assert!(compliance(&whole.replacen("1.451604E-21", "NaN", 1)).is_none());
        (1..30).for_each(|less| assert!(compliance(&whole[..whole.len() - less]).is_none()));
    }
}

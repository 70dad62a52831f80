//! A candidate on top of a model: its columns, and the full fit with it.

use nalgebra::DVector;

use crate::fit::Fit;
use crate::levels::Levels;
use crate::model::{Candidate, Role, Unknown};
use crate::screening::{self, Columns};
use crate::solve::Problem;

/// Columns of a candidate's amplitudes at a fit, with the shape that promises most.
pub fn columns(problem: &Problem<'_>, fit: &Fit, candidate: &Candidate) -> Option<Columns> {
    let (amplitudes, shapes): (Vec<Unknown>, Vec<Unknown>) =
        candidate.unknowns.iter().partition(|u| problem.parameter(**u).is_amplitude());
    let n = fit.unknowns.len();
    let unknowns: Vec<Unknown> = fit.unknowns.iter().chain(&amplitudes).chain(&shapes).copied().collect();
    let one_sided: Vec<bool> = amplitudes.iter().map(|u| problem.parameter(*u).is_one_sided()).collect();
    let at = |shape: f64| {
        let mut x = fit.x.as_slice().to_vec();
        x.resize(unknowns.len(), 0.0);
        if !shapes.is_empty() {
            x[n + amplitudes.len()] = shape;
        }
        let matrix = problem.jacobian(&unknowns, &x, n..n + amplitudes.len())?;
        Some(Columns { matrix, one_sided: one_sided.clone(), shape })
    };
    if shapes.is_empty() {
        return at(0.0);
    }
    let starts = problem.rules.shape_starts;
    let tried = starts.into_iter().filter_map(at).map(|c| (screening::gain(fit, &c), c));
    tried.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, c)| c)
}

/// The unknowns of a candidate that are worth fitting, each with its start: amplitudes that the screen left out are not.
fn start_of(problem: &Problem<'_>, candidate: &Candidate, step: &DVector<f64>, shape: f64) -> Vec<(Unknown, f64)> {
    let mut own: Vec<(Unknown, f64)> = Vec::new();
    let mut steps = step.iter().copied();
    for u in &candidate.unknowns {
        let is_amplitude = problem.parameter(*u).is_amplitude();
        // the first shape is where the screen took it, others in their middle
        let is_first_shape = !is_amplitude && own.iter().all(|(u, _)| problem.parameter(*u).is_amplitude());
        let first = match (is_amplitude, is_first_shape) {
            (true, _) => steps.next().unwrap_or(0.0),
            (false, true) => shape,
            (false, false) => 0.0,
        };
        if !is_amplitude || first != 0.0 {
            own.push((*u, if is_amplitude { first.clamp(-1.0, 1.0) } else { first }));
        }
    }
    own
}

/// Fits from a start and, where declared values have moved far, from the declared ones as well: the values may have
/// absorbed the effect.
fn fit(levels: &Levels<'_>, level: usize, unknowns: &[Unknown], start: &[f64], far: bool) -> Option<(usize, Fit)> {
    let fit = levels.fit(unknowns, start, level);
    if !far {
        return fit;
    }
    let is_declared = |u: &Unknown| levels.plain.parameter(*u).role == Role::Declared;
    let declared: Vec<f64> = unknowns.iter().zip(start).map(|(u, x)| if is_declared(u) { 0.0 } else { *x }).collect();
    match (fit, levels.fit(unknowns, &declared, level)) {
        (Some(a), Some(b)) => Some(if b.1.ln_evidence() > a.1.ln_evidence() { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// Fits a candidate on top of a model. Negative amplitudes that must not be are pinned to 0: the more negative half of them,
/// then those that are left.
///
/// # Errors
/// Why it is no explanation.
pub fn extended(
    levels: &Levels<'_>,
    level: usize,
    current: &Fit,
    candidate: &Candidate,
    step: &DVector<f64>,
    shape: f64,
) -> Result<(usize, Fit), &'static str> {
    let (problem, rules) = (&levels.problems[level], levels.plain.rules);
    let most = if candidate.is_free { rules.max_free_amplitude } else { rules.max_amplitude };
    let own = if candidate.start.is_empty() {
        if step.amax() > rules.max_first_step * most {
            return Err("larger than plausible");
        }
        start_of(problem, candidate, step, shape)
    } else {
        candidate.unknowns.iter().copied().zip(candidate.start.iter().copied()).collect()
    };
    if own.iter().all(|(_, x)| *x == 0.0) {
        return Err("negative compliance");
    }
    let is_amplitude = |u: &Unknown| problem.parameter(*u).is_amplitude();
    let is_own = |u: &Unknown| own.iter().any(|(o, _)| o == u);
    let (mut unknowns, mut start): (Vec<Unknown>, Vec<f64>) =
        current.unknowns.iter().copied().zip(current.x.iter().copied()).chain(own.iter().copied()).unzip();
    let far = (current.unknowns.iter().zip(current.x.iter()))
        .any(|(u, x)| problem.parameter(*u).role == Role::Declared && x.abs() > rules.large_pull_sd);
    loop {
        let (at, fit) = fit(levels, level, &unknowns, &start, far).ok_or("the fit did not converge")?;
        let is_negative = |i: &usize| problem.parameter(unknowns[*i]).is_one_sided() && fit.x[*i] < 0.0;
        let mut negative: Vec<usize> = (0..unknowns.len()).filter(is_negative).collect();
        if negative.is_empty() {
            for (u, x) in unknowns.iter().zip(fit.x.iter()).filter(|(u, _)| is_own(u)) {
                if is_amplitude(u) && x.abs() > most {
                    return Err("larger than plausible");
                }
                if !is_amplitude(u) && x.abs() > rules.max_shape_sd {
                    return Err("of an implausible shape");
                }
            }
            if !problem.model.is_possible(&fit.unknowns, fit.x.as_slice()) {
                return Err("impossible beyond the readings");
            }
            return Ok((at, fit));
        }
        negative.sort_by(|a, b| fit.x[*a].total_cmp(&fit.x[*b]));
        negative.truncate(negative.len().div_ceil(2));
        // from the same start again: what the pinned ones did to the others is no place to begin at
        let kept = (0..unknowns.len()).filter(|i| !negative.contains(i));
        (unknowns, start) = kept.map(|i| (unknowns[i], start[i])).unzip();
        if !unknowns.iter().any(|u| is_own(u) && is_amplitude(u)) {
            return Err("negative compliance");
        }
    }
}

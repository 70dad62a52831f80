//! Blocks of effects that have a formula, and of declared values that are wrong: the prior expectation of what is found.

use std::sync::Arc;

use nalgebra::DVectorView;
use pkm_core::Machine;
use pkm_core::effects::Expected;
use pkm_diagnosis::Unknown;

use super::elastic::{self, Frame, M6, M8};
use super::limbs::part;
use super::terms::Term;
use super::{Blocks, Whereabouts};
use crate::diagnose::declared::{Declared, Part};
use crate::diagnose::model::{Model, info};
use crate::pose::NamedPose;

/// Relative deviation up to which compliances add and wrenches are the same.
const LINEAR_TOLERANCE: f64 = 1e-6;

fn of_declared(d: &Declared) -> String {
    match d.part {
        Part::BaseLinear(_) | Part::BaseAngular(_) => part(d.limb, "base_joint"),
        Part::PlatformLinear(_) | Part::PlatformAngular(_) => part(d.limb, "platform_joint"),
        Part::Young | Part::Shear => part(d.limb, "body"),
    }
}

/// Where a candidate of the search by formulas is.
pub fn place_of(model: &Model, candidate: usize) -> Whereabouts {
    if let Some(element) = model.element_places.get(&candidate) {
        return element.clone();
    }
    if let Some(class) = model.class_of(candidate) {
        let mut places: Vec<String> = class.members.iter().map(of_declared).collect();
        places.sort();
        places.dedup();
        return Whereabouts { places, motion: "general", law: "constant", ln_prior: -1.0 };
    }
    let effect = model.effect_of(candidate).expect("elements, declared values or an effect");
    let Expected { places, motion, law, ln_prior, .. } = info(effect).expected;
    Whereabouts { places: places.iter().map(|p| (*p).to_owned()).collect(), motion, law, ln_prior }
}

/// Adds a block for each candidate.
pub fn add(blocks: &mut Blocks<'_>) {
    let declared = blocks.problem.model.declared();
    let x = blocks.problem.fit(&declared, &vec![0.0; declared.len()]).map(|fit| fit.x.as_slice().to_vec());
    let x = x.unwrap_or_else(|| vec![0.0; declared.len()]);
    for candidate in 0..blocks.model.candidates.len() {
        // the places of elements have blocks of their own
        if blocks.model.element_places.contains_key(&candidate) {
            continue;
        }
        let w = place_of(blocks.model, candidate);
        for (terms, ln_prior) in columns(blocks, candidate, &declared, &x) {
            blocks.add_with(&w.places, w.motion, w.law, terms, 0, w.ln_prior + ln_prior);
        }
    }
}

/// Columns of a candidate, for each shape that is tried.
fn columns(blocks: &Blocks<'_>, candidate: usize, declared: &[Unknown], x: &[f64]) -> Vec<(Vec<Term>, f64)> {
    if let Some(class) = blocks.model.class_of(candidate) {
        let all = Declared::all(&blocks.model.declared);
        let of = |f: &Frame| {
            let members = class.members.iter().filter_map(|m| all.iter().position(|d| d == m));
            members.fold(M8::zeros(), |sum, j| sum + f.parts[j])
        };
        return vec![(vec![Term::Elastic(Arc::new(blocks.frames.iter().map(of).collect()))], 0.0)];
    }
    let (problem, own) = (blocks.problem, &blocks.model.candidates[candidate].unknowns);
    let (amplitudes, shapes): (Vec<Unknown>, Vec<Unknown>) =
        own.iter().partition(|u| problem.parameter(**u).is_amplitude());
    let starts = if shapes.is_empty() { &problem.rules.shape_starts[..1] } else { &problem.rules.shape_starts[..] };
    let unknowns: Vec<Unknown> = declared.iter().chain(&amplitudes).chain(&shapes).copied().collect();
    let from = declared.len();
    let at = |start: &f64| {
        let mut x = x.to_vec();
        x.resize(unknowns.len(), 0.0);
        if !shapes.is_empty() {
            x[from + amplitudes.len()] = *start;
        }
        let matrix = problem.jacobian(&unknowns, &x, from..from + amplitudes.len())?;
        let seen = amplitudes.iter().zip(matrix.column_iter()).filter(|(_, c)| c.norm() > 0.0);
        let term = |(amplitude, column): (&Unknown, DVectorView<'_, f64>)| {
            let shapes = shapes.iter().copied().zip(x[from + amplitudes.len()..].iter().copied());
            let exact = compliance(blocks, *amplitude, &shapes.collect::<Vec<_>>());
            exact.map_or_else(|| Term::Fixed(Arc::new(column.clone_owned())), |e| Term::Elastic(Arc::new(e)))
        };
        Some((seen.map(term).collect(), -(starts.len() as f64).ln()))
    };
    starts.iter().filter_map(at).collect()
}

/// What an amplitude of 1 adds to the compliance that the transmitted wrenches meet, at each pose: as it is far from the declared
/// machine too, where a derivative there leaves a rest that would pass for something else. A series compliance S at B or A is
/// HᵀSH. `None` of what is no compliance, such as sizes, or is not linear.
fn compliance(blocks: &Blocks<'_>, amplitude: Unknown, shapes: &[(Unknown, f64)]) -> Option<Vec<M8>> {
    let (others, starts): (Vec<Unknown>, Vec<f64>) = shapes.iter().copied().unzip();
    let unknowns = [vec![amplitude], others].concat();
    let at = |size: f64| -> Option<Vec<M8>> {
        let x = [vec![size], starts.clone()].concat();
        let machine = Machine::<f64>::new(&blocks.model.state(&unknowns, &x, false).machine).ok()?;
        let of = |(f, p): (&Frame, &NamedPose)| {
            let t = machine.transmission(&p.pose).ok()?;
            let d = elastic::full(&t.compliance);
            let in_series = machine.stiffness(&p.pose).ok()?.matrix().cholesky()?.inverse()
                - elastic::solve(&f.wrenches, &d, &M6::zeros())?.compliance;
            let is_same = (t.wrenches - f.wrenches).norm() <= LINEAR_TOLERANCE * f.wrenches.norm();
            is_same.then(|| d + f.wrenches.tr_mul(&(in_series * f.wrenches)))
        };
        blocks.frames.iter().zip(&blocks.readings.poses).map(of).collect()
    };
    let (none, one, two) = (at(0.0)?, at(1.0)?, at(2.0)?);
    let added: Vec<M8> = one.iter().zip(&none).map(|(a, b)| a - b).collect();
    let acts = added.iter().zip(&none).any(|(e, d)| e.norm() > LINEAR_TOLERANCE * d.norm());
    let is_linear =
        |((e, n), t): ((&M8, &M8), &M8)| (t - n - e * 2.0).norm() <= LINEAR_TOLERANCE * (e.norm() + n.norm());
    (acts && added.iter().zip(&none).zip(&two).all(is_linear)).then_some(added)
}

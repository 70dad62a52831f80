//! What became of the findings of one diagnosis in another of the same machine.

use pkm_diagnosis::student;
use serde::Serialize;

use super::ELEMENT;
use super::text::{self, probability};
use super::verify::{Change, MAX_FAMILY_P};
use crate::files::verified::{Declared, Diagnosed, Finding};
use crate::page::p_in_words;

/// What became of a finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fate {
    /// Effect at its place, or key of a declared value.
    pub finding: String,
    /// `gone`, `new`, `stronger`, `weaker` or `unchanged`.
    pub verdict: &'static str,
    /// Of the place, when it was found last; none of a declared value.
    pub probability: Option<f64>,
    /// For people.
    pub text: String,
}

fn name(f: &Finding) -> String {
    match f.place.as_str() {
        "sensor" | "load" | "time" if f.id == ELEMENT => {
            format!("an error of the {}", text::error_of(&f.place, &f.law))
        }
        _ => format!("{} at {} ({})", f.id, f.place, f.law),
    }
}

/// What is said of one thing that goes by two names, as the readings cannot tell its places apart.
fn one_of(before: &str, after: &str) -> String {
    format!("{before} before and {after} after, which the readings cannot tell apart,")
}

/// The parameter that both have and that changed most: its probability, whether it grew, and the change in words.
fn most_changed(before: &Finding, after: &Finding, dof: [Option<f64>; 2]) -> Option<(f64, bool, String)> {
    let parameters = before.parameters.iter().filter_map(|(name, a)| Some((name, a, after.parameters.get(name)?)));
    let changes = parameters.map(|(name, a, b)| {
        let variances = [a.stderr, b.stderr].map(|s| s * s);
        let deviation = (variances[0] + variances[1]).sqrt();
        let dof = student::effective_dof(&[(variances[0], dof[0]), (variances[1], dof[1])]);
        let change = b.value - a.value;
        let p = if change == 0.0 { 1.0 } else { student::two_sided_p(change / deviation, dof) };
        (p, b.value.abs() > a.value.abs(), format!("{name} from {:.3e} to {:.3e}", a.value, b.value))
    });
    changes.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// What became of an effect that both diagnoses found: by the parameter that changed most.
fn both(before: &Finding, after: &Finding, dof: [Option<f64>; 2]) -> Fate {
    let count = before.parameters.len().max(1) as f64;
    let most = most_changed(before, after, dof).filter(|c| c.0 * count <= MAX_FAMILY_P);
    let (named_before, finding) = (name(before), name(after));
    let (what, are) = if named_before == finding {
        (finding.clone(), "is in both")
    } else {
        (one_of(&named_before, &finding), "is as before")
    };
    let (verdict, text) = match most {
        Some((p, grew, change)) => {
            (if grew { "stronger" } else { "weaker" }, format!("{what} has changed: {change}, {}", p_in_words(p)))
        }
        None => ("unchanged", format!("{what} {are}, and no parameter of it changed beyond its uncertainty")),
    };
    Fate { finding, verdict, probability: Some(after.probability), text }
}

/// Whether two effects are one whose place the readings do not tell. What has other parameters cannot be compared by them: then nothing
/// that was compared may have changed.
fn is_one_effect(before: &Finding, after: &Finding, changes: &[Change]) -> bool {
    let are_alike = before.place_class.contains(&after.place) && after.place_class.contains(&before.place);
    let are_compared = before.parameters.keys().any(|name| after.parameters.contains_key(name));
    before.law == after.law && are_alike && (are_compared || changes.iter().all(|c| c.verdict == "unchanged"))
}

fn of_effects(before: &Diagnosed, after: &Diagnosed, changes: &[Change]) -> Vec<Fate> {
    let dof = [before, after].map(|d| d.uncertainty.degrees_of_freedom);
    let mut fates = Vec::new();
    // of the second diagnosis, those that the first has too
    let mut known = vec![false; after.effects.len()];
    let is_same = |f: &Finding| before.effects.iter().any(|o| name(o) == name(f));
    for f in &before.effects {
        let same = after.effects.iter().position(|o| name(o) == name(f));
        let alike = || {
            let is_free = |n: usize, o: &Finding| !known[n] && !is_same(o);
            (after.effects.iter().enumerate()).position(|(n, o)| is_free(n, o) && is_one_effect(f, o, changes))
        };
        if let Some(n) = same.or_else(alike) {
            known[n] = true;
            fates.push(both(f, &after.effects[n], dof));
            continue;
        }
        let text = format!(
            "{} was found before, probability {}, and is found no more",
            name(f),
            probability(f.probability, 2)
        );
        fates.push(Fate { finding: name(f), verdict: "gone", probability: Some(f.probability), text });
    }
    let new = after.effects.iter().zip(known).filter(|(f, known)| !known && !is_same(f));
    fates.extend(new.map(|(f, _)| {
        let text = format!("{} is new, probability {}", name(f), probability(f.probability, 2));
        Fate { finding: name(f), verdict: "new", probability: Some(f.probability), text }
    }));
    fates
}

/// What became of a declared value that goes by two keys, by the stiffness of its limb along its axis; none where something else
/// changed instead, which may be either of the two.
fn both_declared(before: &Declared, after: &Declared, changes: &[Change]) -> Option<Fate> {
    let is_of_limb = |c: &&Change| {
        let limb = c.quantity.strip_suffix("axial");
        limb.is_some_and(|limb| [before, after].iter().any(|f| f.parameter.starts_with(limb)))
    };
    let is_changed = |c: &&Change| c.verdict != "unchanged";
    let is_axial = |c: &Change| c.quantity.ends_with("axial");
    let what = one_of(&before.parameter, &after.parameter);
    let (verdict, text) = match changes.iter().filter(is_of_limb).find(is_changed) {
        Some(c) => {
            let is_farther = (c.verdict == "softer") == (after.estimated < after.declared);
            let text = format!("{what} has changed: {} is {:.1} % {}", c.what, c.change_percent.abs(), c.verdict);
            (if is_farther { "stronger" } else { "weaker" }, text)
        }
        // the platform alone has changed: by a joint across its limb, for all that is known by this one
        None if changes.iter().any(|c| is_changed(&c)) && changes.iter().filter(is_changed).all(|c| !is_axial(c)) => {
            return None;
        }
        None => ("unchanged", format!("{what} differs from its declared value as before ({})", after.inspect)),
    };
    Some(Fate { finding: after.parameter.clone(), verdict, probability: None, text })
}

fn of_declared(before: &Diagnosed, after: &Diagnosed, changes: &[Change]) -> Vec<Fate> {
    let only = |from: &'_ Diagnosed, other: &Diagnosed| -> Vec<usize> {
        let has = |f: &Declared| other.declared_value_findings.iter().any(|o| o.parameter == f.parameter);
        (0..from.declared_value_findings.len()).filter(|n| !has(&from.declared_value_findings[*n])).collect()
    };
    let (gone, mut new) = (only(before, after), only(after, before));
    let fate = |f: &Declared, verdict: &'static str, how: &str| {
        let text = format!("{} {how} ({})", f.parameter, f.inspect);
        Fate { finding: f.parameter.clone(), verdict, probability: None, text }
    };
    let mut fates = Vec::new();
    for f in gone.into_iter().map(|n| &before.declared_value_findings[n]) {
        let one = new.iter().enumerate().find_map(|(at, n)| {
            let other = &after.declared_value_findings[*n];
            let are_alike = f.class.contains(&other.parameter) && other.class.contains(&f.parameter);
            Some((at, both_declared(f, other, changes).filter(|_| are_alike)?))
        });
        fates.push(match one {
            Some((at, one)) => {
                new.remove(at);
                one
            }
            None => fate(f, "gone", "differed from its declared value before, and does no more"),
        });
    }
    let new = new.into_iter().map(|n| &after.declared_value_findings[n]);
    fates.extend(new.map(|f| fate(f, "new", "differs from its declared value, and did not before")));
    fates
}

/// What became of the findings of either diagnosis. One that is gone and one that is new are one and the same where each is among what
/// the other cannot be told from: which of them is named goes with the noise.
pub fn fates(before: &Diagnosed, after: &Diagnosed, changes: &[Change]) -> Vec<Fate> {
    [of_effects(before, after, changes), of_declared(before, after, changes)].concat()
}

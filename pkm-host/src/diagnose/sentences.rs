//! What a diagnosis has found, in sentences: for the terminal and for `report.html`.

use std::collections::BTreeSet;

use super::advice::distinct;
use super::badges::{Badge, Grade, doubted_loads};
use super::checks_of_noise::Coarse;
use super::compare::{Rival, of};
use super::findings::DeclaredFinding;
use super::report::interval;
use super::{Diagnosis, ELEMENT, Effect, Verdict, WarningKind, text};
use crate::error::lines_text;
use crate::page::{Finding, p_in_words};

/// Least probability of something without a place that is said.
const MIN_NONE_OF_THESE: f64 = 0.5;
/// Most readings that stand out with a sentence of their own.
const MAX_SUSPECTS_SHOWN: usize = 10;

/// What a verdict leans on: declared values that had to move far.
fn far_from_declared(findings: &[DeclaredFinding]) -> String {
    let of = |is_body: bool| {
        let ratios =
            findings.iter().filter(|f| f.parameter.contains("body") == is_body).map(|f| f.estimated / f.declared);
        ratios.max_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs()))
    };
    let said = |what: &str, ratio: f64| {
        let (how, size) = if ratio > 1.0 { ("stiff", ratio) } else { ("soft", 1.0 / ratio) };
        let doubt = if what == "bodies" && size > text::MATERIAL_RATIO {
            " (no material is: their form is in doubt)"
        } else {
            ""
        };
        format!("{what} up to {size:.1} times as {how} as declared{doubt}")
    };
    let parts: Vec<String> = [(true, "bodies"), (false, "joints")]
        .into_iter()
        .filter_map(|(is_body, what)| Some(said(what, of(is_body)?)))
        .collect();
    if parts.is_empty() { String::new() } else { format!(", with {}", parts.join(" and ")) }
}

/// The verdict in a sentence.
fn conclusion(d: &Diagnosis, found: &str, far: &str) -> Finding {
    if let Some([declared, identified]) = d.worse() {
        return Finding::bad(format!(
            "Not explained: with {found} the error on readings that had no part in it is {identified:.2} µm rms, by the declared \
             machine {declared:.2} µm. Don't take the names below for the truth."
        ));
    }
    match d.judgement.verdict {
        Verdict::Adequate if d.declared.is_empty() => Finding::good(
            "The model is adequate: with its stiffnesses re-identified within their uncertainty its residuals are noise.",
        ),
        Verdict::Adequate => Finding::warning(format!(
            "The model is adequate, its values are not: no physics is missing, but declared values are wrong by more than \
             their uncertainty{far}."
        )),
        Verdict::Explained => Finding::good(format!("Explained by {found}: the residuals are noise{far}.")),
        Verdict::PartlyExplained if !d.leaves_more_than_noise() => Finding::warning(format!(
            "Partly explained by {found}: the residuals are noise, but what was found may not be all, or its form not right{far}."
        )),
        Verdict::PartlyExplained => Finding::warning(format!(
            "Partly explained by {found}: a significant misfit remains. Don't take the names below for the whole truth."
        )),
        Verdict::Ambiguous => Finding::warning(format!(
            "Ambiguous: {found} has rivals that call for different repairs. {}",
            if d.proposals.is_empty() {
                "No reading that would tell them apart is proposed: look at all that are named."
            } else {
                "Measure what is proposed below."
            }
        )),
        Verdict::Unexplained if d.declared.is_empty() => Finding::bad(
            "Unexplained: the model is wrong by more than noise, and no effect that this program knows accounts for it.",
        ),
        Verdict::Unexplained => Finding::bad(
            "Unexplained beside what is named below: the model is wrong by more than noise, and no effect that this program \
             knows accounts for all of it.",
        ),
    }
}

/// How sure the verdict is, in a sentence.
pub fn certainty(d: &Diagnosis) -> String {
    let (held, p) = (&d.held_out, d.judgement.after.p);
    let noise = if p > 0.05 {
        format!("the residuals cannot be told from noise (p = {p:.2})")
    } else {
        format!("the residuals are more than noise ({})", p_in_words(p))
    };
    let of_places = d.effects.iter().map(|e| e.probability).reduce(f64::min);
    let place = of_places.map_or(String::new(), |p| format!("; probability of the place {}", text::probability(p, 2)));
    let errors = held.nearest();
    let (Some(before), Some(after)) = (of(errors, Rival::Declared), of(errors, Rival::After)) else {
        return format!("{noise}{place}.");
    };
    let others = if held.given { "On readings that had no part in it" } else { "On poses left out in turn" };
    format!(
        "{others} the error goes from {:.2} to {:.2} µm rms (95 %: {}){}; {noise}{place}.",
        before.linear_um_rms,
        after.linear_um_rms,
        interval(after),
        if held.is_as_measured() { " with the error of the measurement that was found" } else { "" }
    )
}

/// What was found, by name.
fn found(d: &Diagnosis) -> String {
    let name = |e: &Effect| match (e.is_located(), e.id) {
        (false, _) => "an effect that the readings do not locate".to_owned(),
        (true, ELEMENT) if e.is_measurement() => format!("an error of the {}", text::error_of(&e.place, e.law)),
        (true, ELEMENT) => format!("an effect on no list at {}", e.place),
        (true, id) => id.to_owned(),
    };
    let found = distinct(d.effects.iter().map(name));
    if found.is_empty() { "the identified model".to_owned() } else { found.join(" and ") }
}

/// What the data cannot tell from something, in parentheses.
fn alike(class: &[String]) -> String {
    if class.is_empty() { String::new() } else { format!(" (the data cannot tell it from {})", class.join(", ")) }
}

/// One of the effects: where it is, its size, where to look.
fn of_effect(e: &Effect) -> String {
    let what = if e.is_measurement() { "an error of the measurement, not of the machine" } else { "physics" };
    let among = if e.place_class.is_empty() { String::new() } else { format!(" or {}", e.place_class.join(", ")) };
    let p = text::probability(e.probability, 2);
    let place = format!("at {}{among} ({}, law: {}, probability {p})", e.place, e.motion, e.law);
    let parameters: Vec<String> = e.parameters.iter().map(|(n, v, s)| text::amplitude(n, *v, Some(*s))).collect();
    // a finding without a formula has none
    let parameters = match parameters.as_slice() {
        [] => String::new(),
        all => format!("; {} (± one standard error)", all.join(", ")),
    };
    format!("{}: {what} {place}{parameters}{}. Look at {}.", e.id, alike(&e.class), e.inspect())
}

/// Stiffnesses that are not what was declared: of limbs, and of the machine file.
fn of_values(d: &Diagnosis) -> Vec<Finding> {
    let limbs = d.estimates.notable();
    if d.leaves_more_than_noise() && limbs.len() + d.declared.len() > 0 {
        return vec![Finding::warning(format!(
            "{} of 3 limbs and {} declared values come out farther off than was declared: while more than noise is left they may only make up \
             for what the model lacks, and sound parts pass for worn. They are in diagnosis.json.",
            limbs.len(),
            d.declared.len()
        ))];
    }
    let mut all: Vec<Finding> = limbs.into_iter().map(|sentence| Finding::warning(format!("{sentence}."))).collect();
    for f in &d.declared {
        let axis = f.axis.map_or(String::new(), |a| text::axis(&f.parameter, a));
        all.push(Finding::warning(format!(
            "{}{axis}: declared {:.4e}, estimated {:.4e}, {:+.1} standard deviations{}. Look at {}.",
            f.parameter,
            f.declared,
            f.estimated,
            f.pull_sd,
            alike(&f.class),
            f.inspect
        )));
    }
    all
}

/// What readings that had no part say of the models.
fn on_others(d: &Diagnosis) -> Vec<Finding> {
    let mut all = Vec::new();
    let held = &d.held_out;
    let how = if held.given { "the held-out readings" } else { "whole poses left out in turn" };
    let nearest = |rival| of(held.nearest(), rival).map(|e| e.linear_um_rms);
    if let (Some(before), Some(retuned), Some(after), Some(alone)) =
        (nearest(Rival::Declared), nearest(Rival::Reidentified), nearest(Rival::After), of(&held.all, Rival::After))
    {
        let with =
            format!(" and the error of the measurement that was found ({:.2} µm without it)", alone.linear_um_rms);
        all.push(Finding::good(format!(
            "On {how}, rms translation error: {before:.2} µm as declared, {retuned:.2} µm with re-identified stiffnesses, \
             {after:.2} µm with the identified model{}.",
            if held.is_as_measured() { &with } else { "" }
        )));
    }
    let unsaid = d.effects.iter().filter(|e| e.is_measurement() && e.parameters.is_empty());
    let unsaid = distinct(unsaid.map(|e| text::error_of(&e.place, e.law)));
    if !unsaid.is_empty() {
        all.push(Finding::good(format!(
            "An error of the {} has no formula and is in no prediction of the identified model: readings that have it differ from that by it, \
             while models that are fitted to such readings may take up a part of it.",
            unsaid.join(", of the ")
        )));
    }
    if let (false, Some(last)) = (held.given, d.steps.last()) {
        let sorted = |names: &[String]| names.iter().cloned().collect::<BTreeSet<_>>();
        let again = held.folds.iter().filter(|names| sorted(names) == sorted(&last.found)).count();
        all.push(Finding::good(format!(
            "Searched again {} times, each time without some of the poses: the same was found in {again}.",
            held.folds.len(),
        )));
    }
    if let (Some(here), Some(there), Some(after)) =
        (of(&d.errors, Rival::Table), of(held.nearest(), Rival::Table), of(held.nearest(), Rival::After))
        && there.linear_um_rms > 1.5 * after.linear_um_rms
        && there.chi2_per_dof > 1.5 * here.chi2_per_dof.min(after.chi2_per_dof)
    {
        all.push(Finding::bad(format!(
            "A table refitted to these readings HIDES what is wrong: {:.1} times the noise where it was fitted, but {:.2} µm on \
             {how}, {:.1} times the error of the model above.",
            here.chi2_per_dof.sqrt(),
            there.linear_um_rms,
            there.linear_um_rms / after.linear_um_rms
        )));
    }
    all
}

/// What these readings do not show.
fn unseen(d: &Diagnosis) -> Vec<Finding> {
    let mut all = Vec::new();
    let hidden: Vec<&str> = d.detectable.iter().filter(|d| d.is_hidden()).map(|d| d.id.as_str()).collect();
    if !hidden.is_empty() {
        let hidden = hidden.join(", ");
        all.push(Finding::good(format!("Not identifiable with these readings at any plausible size: {hidden}.")));
    }
    // what never differs does not say what its noise is
    let is_noise_unknown = d.warnings.iter().any(|w| w.kind == WarningKind::EqualRepeats);
    if !d.coarse.is_empty() && !is_noise_unknown {
        let of = |c: &Coarse| {
            let unit = if c.column.ends_with("_um") { "µm" } else { "µrad" };
            format!("{} by {} {unit}, noise {:.1}", c.column, c.step, c.noise)
        };
        let columns: Vec<String> = d.coarse.iter().map(of).collect();
        all.push(Finding::good(format!(
            "Read in steps that are coarse beside the noise: {}. Such a number is taken for any within its step, and what is less than \
             a step may stay unseen: a finer instrument shows more.",
            columns.join("; ")
        )));
    }
    if !d.single_poses {
        all.push(Finding::good(format!("Not looked for: {}.", text::SINGLE_POSES)));
    }
    all
}

/// The findings in sentences, the most important first.
pub(crate) fn findings(d: &Diagnosis) -> Vec<Finding> {
    let (left_out, others): (Vec<_>, Vec<_>) = d.warnings.iter().partition(|w| w.left_out);
    // where the readings themselves are in doubt nothing else counts
    let mut all: Vec<Finding> = others.iter().map(|w| Finding::bad(format!("Check first: {}", w.sentence()))).collect();
    if Badge::measurement(d).grade == Grade::Bad {
        all.push(Finding::bad(
            "What diagnosis.json says of the machine is left out here: it is what makes up for readings that are not what they are \
             taken for.",
        ));
        return all;
    }
    all.push(conclusion(d, &found(d), &far_from_declared(&d.declared)));
    if let Some(p) = d.none_of_these.filter(|p| *p > MIN_NONE_OF_THESE && !d.effects.is_empty()) {
        all.push(Finding::warning(format!(
            "Something with no place in the model acts on the readings as well (probability {}): what is named below may partly make up \
             for it.",
            text::probability(p, 2)
        )));
    }
    if let Some(message) = doubted_loads(d) {
        all.push(Finding::warning(format!(
            "Check the loads: {message}; `uncertainty.load_gain` and `load_direction_mrad` declare it."
        )));
    }
    all.extend(left_out.iter().map(|w| Finding::warning(format!("Check what was left out: {}", w.sentence()))));
    all.extend(of_suspects(d));
    all.extend(d.effects.iter().map(|e| Finding::good(of_effect(e))));
    all.extend(of_values(d));
    all.extend(d.estimates.not_determined().map(Finding::good));
    all.extend(on_others(d));
    all.extend(unseen(d));
    all
}

/// Of readings that stand out, the first in full.
fn of_suspects(d: &Diagnosis) -> impl Iterator<Item = Finding> {
    let (first, rest) = d.suspects.split_at(d.suspects.len().min(MAX_SUSPECTS_SHOWN));
    let lines: Vec<u64> = rest.iter().map(|s| s.line).collect();
    let more = (!lines.is_empty()).then(|| {
        format!("Check {} more such numbers, in {}: residuals.csv has them all.", lines.len(), lines_text(&lines))
    });
    let texts = first.iter().map(|s| format!("Check this reading: {}.", s.text())).chain(more);
    texts.map(Finding::warning)
}

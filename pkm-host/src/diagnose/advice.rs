//! What to do first after a diagnosis.

use super::compare::{Rival, of};
use super::{Diagnosis, Effect, Verdict};

/// Places that are named to be inspected first; the others are among the findings.
const MOST_TO_INSPECT: usize = 3;

/// Each once, in the order of the first.
pub fn distinct(texts: impl Iterator<Item = String>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for text in texts {
        if !all.contains(&text) {
            all.push(text);
        }
    }
    all
}

/// Whether something was found in the machine that makes no prediction better than re-identified stiffnesses alone.
fn is_no_remedy(d: &Diagnosis) -> bool {
    let error = |rival: Rival| of(d.held_out.nearest(), rival).map(|e| e.linear_um_rms);
    let errors = error(Rival::After).zip(error(Rival::Reidentified));
    d.effects.iter().any(|e| !e.is_measurement()) && errors.is_some_and(|(after, reidentified)| after >= reidentified)
}

/// What to do first.
pub fn next_step(d: &Diagnosis) -> String {
    let step = of_what_was_found(d);
    if d.warnings.iter().any(|w| w.left_out) {
        format!("mend the readings that were left out, or take them again, and diagnose anew. Until then: {step}")
    } else {
        step
    }
}

fn of_what_was_found(d: &Diagnosis) -> String {
    if !d.warnings.iter().all(|w| w.left_out) {
        return "check the readings as said below; the rest counts after that.".to_owned();
    }
    if d.worse().is_some() {
        return "keep the declared machine: the identified one predicts worse; look at the residuals below for what they go with."
            .to_owned();
    }
    if d.judgement.verdict == Verdict::Ambiguous {
        let todo = if d.proposals.is_empty() {
            "look at all that is named below: no reading that would tell the rivals apart is proposed."
        } else {
            "measure what is proposed below, and diagnose again with these readings too."
        };
        return todo.to_owned();
    }
    let located = |of_measurement: bool| {
        d.effects.iter().filter(move |e| e.is_located() && e.is_measurement() == of_measurement).map(Effect::inspect)
    };
    let values = d.declared.iter().filter(|_| !d.leaves_more_than_noise()).map(|f| f.inspect.clone());
    let [mut machine, mut measurement] = [distinct(located(false).chain(values)), distinct(located(true))];
    machine.truncate(MOST_TO_INSPECT);
    measurement.truncate(MOST_TO_INSPECT);
    let look = [machine.as_slice(), &measurement].concat().join("; and at ");
    match (d.judgement.verdict, machine.is_empty(), measurement.is_empty()) {
        (_, false, _) if is_no_remedy(d) => format!(
            "look at {look}; with what was found machine.toml predicts readings that had no part in it no better than with \
             re-identified stiffnesses alone, so that it is no remedy."
        ),
        (_, false, true) => {
            format!("look at {look}; until that is repaired use machine.toml, which has what was found.")
        }
        (_, false, false) => format!(
            "look at {look}; until the machine is repaired use machine.toml, which has what was found of it and not the error of \
             the measurement."
        ),
        (_, true, false) => format!(
            "look at {look}; the error of the measurement is not in machine.toml, whose stiffnesses are identified beside it."
        ),
        (Verdict::Adequate | Verdict::Explained, true, true) => {
            "nothing on the machine; machine.toml has the re-identified stiffnesses.".to_owned()
        }
        _ => "do not compensate with this model; look at the residuals below for what they go with.".to_owned(),
    }
}

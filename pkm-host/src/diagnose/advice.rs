//! What to do first after a diagnosis.

use super::compare::{Rival, of};
use super::{Diagnosis, Effect, Verdict, text};

/// Places that are named to be inspected first; the others are among the findings.
const MAX_INSPECTED: usize = 3;

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

/// Places in the machine at which something was found that no formula and no element says, for people.
fn unwritten(d: &Diagnosis) -> String {
    let places = d.effects.iter().filter(|e| !e.is_measurement() && e.parameters.is_empty());
    let places = distinct(places.map(|e| text::place(&e.place)));
    if places.is_empty() { String::new() } else { format!(" but for what no element fits at {}", places.join(" and ")) }
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
    machine.truncate(MAX_INSPECTED);
    measurement.truncate(MAX_INSPECTED);
    let look = [machine.as_slice(), &measurement].concat().join("; and at ");
    match (d.judgement.verdict, machine.is_empty(), measurement.is_empty()) {
        (_, false, _) if is_no_remedy(d) => format!(
            "look at {look}; with what was found machine.toml predicts readings that had no part in it no better than with \
             re-identified stiffnesses alone, so that it is no remedy."
        ),
        (_, false, true) => {
            format!(
                "look at {look}; until that is repaired use machine.toml, which has what was found{}.",
                unwritten(d)
            )
        }
        (_, false, false) => format!(
            "look at {look}; until the machine is repaired use machine.toml, which has what was found of it{} and not the error of \
             the measurement.",
            unwritten(d)
        ),
        (_, true, false) => format!(
            "look at {look}; the error of the measurement is not in machine.toml, whose stiffnesses are identified beside it."
        ),
        (Verdict::Adequate | Verdict::Explained, true, true) => of_limbs(
            ["softer", "stiffer"]
                .map(|state| if d.leaves_more_than_noise() { Vec::new() } else { d.estimates.limbs_that_are(state) }),
        ),
        _ => "do not compensate with this model; look at the residuals below for what they go with.".to_owned(),
    }
}

/// Where no effect and no declared value was found: what to do about limbs that are softer or stiffer than declared, which are numbered.
fn of_limbs([softer, stiffer]: [Vec<usize>; 2]) -> String {
    let named = |limbs: &[usize]| {
        let numbers = limbs.iter().map(usize::to_string).collect::<Vec<_>>().join(" and ");
        format!("limb{} {numbers}", if limbs.len() > 1 { "s" } else { "" })
    };
    let first = match softer.as_slice() {
        [] => "nothing on the machine".to_owned(),
        limbs => format!("look at nut, bearings, screw and joints of {}", named(limbs)),
    };
    let then = match stiffer.as_slice() {
        [] => String::new(),
        limbs => format!(
            "; check the scale of the loads and of the sensor, and where these are right correct the declared stiffness of {}",
            named(limbs)
        ),
    };
    format!("{first}{then}; machine.toml has the re-identified stiffnesses.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_to_do_goes_with_what_is_said_of_the_limbs() {
        let nothing = of_limbs([vec![], vec![]]);
        assert_eq!(nothing, "nothing on the machine; machine.toml has the re-identified stiffnesses.");
        let stiffer = of_limbs([vec![], vec![2]]);
        assert!(stiffer.starts_with("nothing on the machine; check the scale of the loads"), "{stiffer}");
        assert!(stiffer.contains("correct the declared stiffness of limb 2;"), "{stiffer}");
        let softer = of_limbs([vec![1, 3], vec![]]);
        assert!(softer.starts_with("look at nut, bearings, screw and joints of limbs 1 and 3;"), "{softer}");
    }
}

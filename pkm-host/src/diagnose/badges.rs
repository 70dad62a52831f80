//! Two judgements kept apart, each with its reasons: is the measurement sound, is the model good enough. What the machine is like is a
//! third thing ([`super::estimates`]).

use pkm_diagnosis::verdict::Verdict;
use serde::Serialize;

use super::{Diagnosis, ELEMENT, Warning, text};
use crate::page::p_in_words;

/// How far a judgement goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    /// Nothing speaks against it.
    Good,
    /// Something does.
    Doubtful,
    /// Don't rely on it.
    Bad,
}

/// What is said of the loads, where they are doubted.
pub fn doubted_loads(d: &Diagnosis) -> Option<String> {
    let message = || {
        format!(
            "the loads seem to be wrong by some {:.1} % and {:.1} mrad beyond what is declared",
            100.0 * d.load_error,
            1e3 * d.load_error
        )
    };
    d.judgement.doubts_loads.then(message)
}

/// A judgement with its reasons, the gravest first.
#[derive(Clone, Debug, Serialize)]
pub struct Badge {
    /// `sound`, `doubtful`, `unsound`; `good_enough`, `in_doubt`, `not_good_enough`.
    pub verdict: &'static str,
    /// For people.
    pub reasons: Vec<String>,
    /// The same as `verdict`, to be compared.
    #[serde(skip)]
    pub grade: Grade,
}

impl Badge {
    fn new(words: [&'static str; 3], mut reasons: Vec<(Grade, String)>) -> Self {
        reasons.sort_by_key(|r| std::cmp::Reverse(r.0));
        let grade = reasons.first().map_or(Grade::Good, |r| r.0);
        Self { verdict: words[grade as usize], reasons: reasons.into_iter().map(|r| r.1).collect(), grade }
    }

    /// Of the readings.
    pub fn measurement(d: &Diagnosis) -> Self {
        let grade = |w: &Warning| if w.makes_unsound { Grade::Bad } else { Grade::Doubtful };
        let mut reasons: Vec<(Grade, String)> = d.warnings.iter().map(|w| (grade(w), w.message.clone())).collect();
        if let [first, rest @ ..] = d.suspects.as_slice() {
            let others = if rest.is_empty() { String::new() } else { format!(", and {} more", rest.len()) };
            reasons.push((Grade::Doubtful, format!("a reading stands out: {}{others}", first.text())));
        }
        for e in d.effects.iter().filter(|e| e.is_measurement()) {
            let what = if e.id == ELEMENT { text::error_of(&e.place, e.law) } else { e.id.to_owned() };
            reasons.push((Grade::Doubtful, format!("an error of the measurement was found: {what}")));
        }
        reasons.extend(doubted_loads(d).map(|message| (Grade::Doubtful, message)));
        Self::new(["sound", "doubtful", "unsound"], reasons)
    }

    /// Of the identified model.
    pub fn model(d: &Diagnosis) -> Self {
        let rest = format!("more than noise is left ({})", p_in_words(d.judgement.after.p));
        let mut reasons = match d.judgement.verdict {
            Verdict::Adequate | Verdict::Explained => Vec::new(),
            Verdict::Ambiguous => {
                vec![(Grade::Doubtful, "what was found has rivals that call for different repairs".to_owned())]
            }
            Verdict::PartlyExplained if d.leaves_more_than_noise() => vec![(Grade::Doubtful, rest)],
            Verdict::PartlyExplained => {
                vec![(
                    Grade::Doubtful,
                    "the residuals are noise, but what was found may not be all or its form not right".to_owned(),
                )]
            }
            Verdict::Unexplained if d.leaves_more_than_noise() => vec![(Grade::Bad, rest)],
            Verdict::Unexplained => Vec::new(),
        };
        if let Some([declared, identified]) = d.worse() {
            let message = format!(
                "on readings that had no part it errs by {identified:.2} µm rms, the declared model by {declared:.2} µm"
            );
            reasons.push((Grade::Bad, message));
        }
        Self::new(["good_enough", "in_doubt", "not_good_enough"], reasons)
    }
}

//! The poses that a table is judged by.

use std::collections::BTreeSet;

use super::Sample;
use crate::pose::file_units;

/// What was given to judge a table by.
pub struct Verification {
    /// Poses that had no part in the fit; where all had one, these.
    pub samples: Vec<Sample>,
    /// How many poses were given.
    pub given: usize,
    /// How many of them were fitted as well.
    pub fitted_too: usize,
}

impl Verification {
    /// Leaves out what was fitted as well: a table is as good there as its fit, whatever it is elsewhere.
    pub(super) fn new(all: Vec<Sample>, training: &[Sample]) -> Self {
        let key = |s: &Sample| file_units(&s.pose.pose).map(|v| (v * 1e6).round() as i64);
        let fitted: BTreeSet<_> = training.iter().map(key).collect();
        let given = all.len();
        let (shared, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|s| fitted.contains(&key(s)));
        let fitted_too = shared.len();
        Self { samples: if others.is_empty() { shared } else { others }, given, fitted_too }
    }

    /// Whether the samples had no part in the fit.
    pub fn is_of_others(&self) -> bool {
        self.fitted_too < self.given
    }

    /// What is doubtful about the choice of the poses.
    pub(super) fn warning(&self) -> Option<String> {
        let end = if self.is_of_others() {
            ": they say nothing of others and are left out of the judgement"
        } else {
            ", and say nothing of others"
        };
        (self.fitted_too > 0)
            .then(|| format!("{} of {} verification poses are training poses too{end}", self.fitted_too, self.given))
    }
}

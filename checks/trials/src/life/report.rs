//! What came of lives, and in words.

use super::{LAST, Loose, STRETCH};

/// The stretch of a life in which what was learned was worst beside the frozen table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Worst {
    /// Error of the tip over that of the frozen table.
    pub of_frozen: f64,
    /// What that of the frozen table was, rms over loads and days, m.
    pub frozen_m: f64,
    /// Its last day.
    pub until: usize,
    /// Whether nothing but wear and season had changed by then.
    pub is_before_loose: bool,
}

/// What came of a life.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// All of it follows from this.
    pub seed: u64,
    /// What came loose.
    pub loose: Loose,
    /// Error of the tip with what was learned, over that of the frozen table, of the whole life.
    pub of_frozen: f64,
    /// The same of the first stretch, in which next to nothing has changed.
    pub first: f64,
    /// The worst stretch after the first.
    pub worst: Worst,
    /// The same over that of a fit of the last 200 readings.
    pub of_batch: f64,
    /// Readings from when the drive has changed by what is worth an alarm until there is one; none where there is none.
    pub worn_after: Option<i64>,
    /// Readings from the day when the tool's holder comes loose until there is an alarm of it; none where there is none.
    pub loose_after: Option<i64>,
    /// Readings with an alarm of an amplitude that has changed by less than half of what is worth one: before the probe was replaced, and
    /// after.
    pub false_alarms: [usize; 2],
    /// Readings of the failing probe that were taken in, and all of them.
    pub failed_taken: [usize; 2],
    /// Healthy readings that were refused.
    pub refused: usize,
}

impl Outcome {
    /// A line for people.
    pub fn line(&self) -> String {
        let Worst { of_frozen: worst, frozen_m, until, is_before_loose } = self.worst;
        let (frozen_um, when) = (frozen_m * 1e6, if is_before_loose { "before" } else { "after" });
        let after = |found: Option<i64>| found.map_or("never".to_owned(), |n| format!("after {n} readings"));
        format!(
            "{}: {:?}: error {:.2} of the frozen table's, first stretch {:.2}, worst stretch after it {worst:.2} (of {frozen_um:.2} µm, until day {until}, {when} \
             the part came loose), {:.2} of a fit of the last {LAST}; worn drive found {}, \
             loose part {}, readings with a false alarm {:?}; of the failing probe {} of {} taken in, {} healthy readings refused",
            self.seed,
            self.loose,
            self.of_frozen,
            self.first,
            self.of_batch,
            after(self.worn_after),
            after(self.loose_after),
            self.false_alarms,
            self.failed_taken[0],
            self.failed_taken[1],
            self.refused
        )
    }
}

/// Over all lives.
pub fn report(outcomes: &[Outcome]) -> String {
    let sorted = |of: &dyn Fn(&Outcome) -> f64| {
        let mut all: Vec<f64> = outcomes.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        let at = |share: f64| all.get((share * (all.len() - 1) as f64).round() as usize).copied().unwrap_or(f64::NAN);
        format!("median {:.2}, greatest {:.2}", at(0.5), at(1.0))
    };
    let count = |is: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).count();
    let sum = |of: &dyn Fn(&Outcome) -> usize| outcomes.iter().map(of).sum::<usize>();
    format!(
        "error over the frozen table's, whole life: {}\nerror over the frozen table's, first {STRETCH} days: {}\n\
         error over the frozen table's, worst {STRETCH} days after them: {}; lives in which it is above 1.02: {}, before the part came loose in {}\n\
         error over that of a fit of the last {LAST} readings: {}\nlives with an alarm of the worn drive: {} of {}; readings until then: {}\n\
         lives with an alarm of the loose tool: {} of {}; readings until then: {}\nlives with a false alarm before the probe was replaced: {}, after: {}\n\
         readings of the failing probe that were taken in: {} of {}; healthy readings refused: {}",
        sorted(&|o| o.of_frozen),
        sorted(&|o| o.first),
        sorted(&|o| o.worst.of_frozen),
        count(&|o| o.worst.of_frozen > 1.02),
        count(&|o| o.worst.of_frozen > 1.02 && o.worst.is_before_loose),
        sorted(&|o| o.of_batch),
        count(&|o| o.worn_after.is_some()),
        outcomes.len(),
        sorted(&|o| o.worn_after.unwrap_or(0) as f64),
        count(&|o| o.loose_after.is_some()),
        count(&|o| matches!(o.loose, Loose::Tool(_))),
        sorted(&|o| o.loose_after.unwrap_or(0) as f64),
        count(&|o| o.false_alarms[0] > 0),
        count(&|o| o.false_alarms[1] > 0),
        sum(&|o| o.failed_taken[0]),
        sum(&|o| o.failed_taken[1]),
        sum(&|o| o.refused),
    )
}

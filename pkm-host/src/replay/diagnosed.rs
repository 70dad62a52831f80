//! What a diagnosis says of the readings that an estimator has taken in last.

use std::collections::HashSet;

use super::{BATCH, Replay};
use crate::diagnose::{self, Diagnosis, Method, Rules};
use crate::error::Result;
use crate::files::csv::Sheet;
use crate::files::log::Log;
use crate::files::machine::MachineFile;
use crate::progress::Progress;

/// A diagnosis of the last readings of a log.
pub struct LogDiagnosis {
    /// Line of the first.
    pub from_line: u64,
    /// How many had been taken in.
    pub readings: usize,
    /// What was found, or why nothing can be.
    pub outcome: Result<Diagnosis>,
}

impl Replay {
    /// Lines of the last readings that were taken in, from the last change that came at once on and at most [`BATCH`]: of one machine,
    /// as far as the estimator knows.
    fn of_one_machine(&self) -> Vec<u64> {
        let since = self.steps.iter().rposition(|step| step.changed).unwrap_or(0);
        let taken = self.steps[since..].iter().filter(|step| step.outcome.is_ok()).map(|step| step.line);
        let taken: Vec<u64> = taken.collect();
        taken[taken.len().saturating_sub(BATCH)..].to_vec()
    }

    /// Diagnoses them, against the machine file alone; gives them as measured data. `None` where nothing was taken in.
    ///
    /// # Errors
    /// A cell of the log that is no number.
    pub fn diagnose(&mut self, file: &MachineFile, log: Log, progress: &Progress<'_>) -> Result<Option<Sheet>> {
        let lines = self.of_one_machine();
        let Some(from_line) = lines.first().copied() else { return Ok(None) };
        let kept: HashSet<u64> = lines.iter().copied().collect();
        let (sheet, readings) = log.measured(file.uncertainty.load_random, |line| kept.contains(&line))?;
        let outcome = diagnose::diagnose(file, &readings, None, Method::Places, &Rules::DEFAULT, progress);
        self.diagnosed = Some(LogDiagnosis { from_line, readings: lines.len(), outcome });
        Ok(Some(sheet))
    }
}

//! What a diagnosis leaves out of the readings before it begins, and names.

use pkm_diagnosis::Rules;
use pkm_diagnosis::residuals::Outlier;

use super::checks;
use super::model::Model;
use super::single_poses::{self, TakenOtherwise};
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Readings};

/// What is left out.
pub struct LeftOut {
    /// Single numbers.
    pub gross: Vec<Outlier>,
    /// Whole poses.
    pub poses: Vec<TakenOtherwise>,
    /// The numbers of these: reading and channel.
    pub of_poses: Vec<(usize, usize)>,
}

impl LeftOut {
    /// Of readings.
    pub fn new(file: &MachineFile, readings: &Readings, model: &Model, rules: &Rules) -> Self {
        let mut gross = checks::gross(readings, model, rules);
        let numbers: Vec<(usize, usize)> = gross.iter().map(|o| (o.reading, o.channel)).collect();
        let rest = readings.without_numbers(&numbers);
        let poses = single_poses::taken_otherwise(&rest, model, rules, file.wrist_parameters.tip_at_zero_m());
        let rows = |pose: &TakenOtherwise| pose.rows(readings).map(|(n, _)| n).collect::<Vec<usize>>();
        let rows: Vec<usize> = poses.iter().flat_map(rows).collect();
        let is_read = |n: &usize, c: &usize| readings.readings[*n].observed[*c].is_some();
        let of_poses = rows.iter().flat_map(|n| (0..CHANNELS).filter(|c| is_read(n, c)).map(|c| (*n, c))).collect();
        gross.retain(|o| !rows.contains(&o.reading));
        Self { gross, poses, of_poses }
    }

    /// All numbers: reading and channel.
    pub fn numbers(&self) -> Vec<(usize, usize)> {
        self.gross.iter().map(|o| (o.reading, o.channel)).chain(self.of_poses.iter().copied()).collect()
    }
}

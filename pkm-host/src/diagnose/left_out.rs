//! What a diagnosis leaves out of the readings before it begins, and names.

use pkm_diagnosis::Rules;
use pkm_diagnosis::residuals::Outlier;

use super::checks;
use super::model::Model;
use super::odd_rows::{OddRows, odd_rows};
use super::reading_rules::MAX_SHARE_OF_ROWS;
use super::single_poses::{self, TakenOtherwise};
use super::warning::Warning;
use crate::error::Failure;
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Readings};

/// Of the end of a message.
pub const LEFT_OUT: &str = " A diagnosis leaves this out";

/// What is left out.
pub struct LeftOut {
    /// Single numbers.
    pub gross: Vec<Outlier>,
    /// Whole poses.
    pub poses: Vec<TakenOtherwise>,
    /// Whole rows, at other poses.
    pub rows: Vec<OddRows>,
    /// Rows that are odd as well, so many that something else is wrong: they are not left out, and some are refused.
    pub doubted: Vec<OddRows>,
    /// The numbers of poses and rows: reading and channel.
    whole: Vec<(usize, usize)>,
}

/// Reading and channel of each.
fn places(outliers: &[Outlier]) -> Vec<(usize, usize)> {
    outliers.iter().map(|o| (o.reading, o.channel)).collect()
}

impl LeftOut {
    /// Of readings.
    pub fn new(file: &MachineFile, readings: &Readings, model: &Model, rules: &Rules) -> Self {
        let tip_m = file.wrist_parameters.tip_at_zero_m();
        let poses_of = |readings: &Readings| single_poses::taken_otherwise(readings, model, rules, tip_m);
        let gross_of = |readings: &Readings| checks::gross(readings, model, rules);
        // one gross number hides what its pose has in common, and what a pose has in common may pass for gross numbers
        let mut poses = poses_of(readings);
        let numbers = places(&gross_of(readings));
        if poses.is_empty() && !numbers.is_empty() {
            poses = poses_of(&readings.without_numbers(&numbers));
        }
        let numbers = |rows: &[usize]| -> Vec<(usize, usize)> {
            let is_read = |n: &usize, c: &usize| readings.readings[*n].observed[*c].is_some();
            rows.iter().flat_map(|n| (0..CHANNELS).filter(|c| is_read(n, c)).map(|c| (*n, c))).collect()
        };
        let mut whole_rows: Vec<usize> = poses.iter().flat_map(|pose| pose.rows(readings).map(|(n, _)| n)).collect();
        let odd = odd_rows(&readings.without_numbers(&numbers(&whole_rows)), model, rules);
        let most = (MAX_SHARE_OF_ROWS * readings.readings.len() as f64).max(1.0);
        let (rows, doubted): (Vec<OddRows>, Vec<OddRows>) = odd.into_iter().partition(|o| o.rows.len() as f64 <= most);
        whole_rows.extend(rows.iter().flat_map(|odd| odd.rows.iter().copied()));
        let whole = numbers(&whole_rows);
        Self { gross: gross_of(&readings.without_numbers(&whole)), poses, rows, doubted, whole }
    }

    /// What a diagnosis says of poses and rows.
    pub fn warnings(&self, readings: &Readings) -> Vec<Warning> {
        let of_row = |odd: &OddRows| {
            let lines = odd.lines(readings);
            let line = lines.first().map_or(String::new(), |line| format!("line {line}: "));
            Warning { lines, ..Warning::new(odd.kind, format!("{line}{}", odd.text(readings))) }
        };
        let of_poses = self.poses.iter().map(|pose| pose.warning(readings));
        let left_out = of_poses.chain(self.rows.iter().map(of_row)).map(|w| Warning {
            left_out: true,
            message: w.message + LEFT_OUT,
            ..w
        });
        left_out.chain(self.doubted.iter().map(of_row)).collect()
    }

    /// Why there is nothing to diagnose.
    pub fn refusal(&self, readings: &Readings) -> Option<Failure> {
        let odd = self.doubted.iter().find(|odd| odd.is_refused())?;
        let failure = Failure::input(odd.text(readings)).in_file(&readings.source.name);
        Some(Failure { line: odd.lines(readings).first().copied(), ..failure })
    }

    /// All numbers: reading and channel.
    pub fn numbers(&self) -> Vec<(usize, usize)> {
        places(&self.gross).into_iter().chain(self.whole.iter().copied()).collect()
    }
}

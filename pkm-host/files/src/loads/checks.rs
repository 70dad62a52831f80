//! What may be wrong with a join and yet is read.

use super::meant::Meant;
use super::window::{Window, jitter};
use super::{MIN_SAMPLES, Options, by_lever, overlap, size, spacing_s};
use crate::clock::Times;
use crate::csv::Sheet;
use crate::error::{lines_text, printable};
use crate::load_log::LoadLog;

/// Share of the load by which parts of a window may differ: loads that differ by less are repeats.
const AT_REST: f64 = 0.02;
/// The same in usual standard deviations of a sample in a window, and in those that follow from one sample to the next: smaller where
/// samples go together, but known where no window is at rest.
const AT_REST_SD: [f64; 2] = [4.0, 10.0];
/// Share of the greatest load by which one may differ from what was meant.
const AS_MEANT: f64 = 0.2;

/// Readings and log side by side.
pub(super) struct Joint<'a> {
    pub sheet: &'a Sheet,
    pub log: &'a LoadLog,
    pub times: &'a Times,
    /// Times of the readings by the log's clock.
    pub at_s: &'a [f64],
    pub windows: &'a [Window],
    pub zeros: &'a [Window],
    pub meant: &'a [Meant],
    /// Means of the windows less the zero.
    pub read: &'a [[f64; 6]],
}

impl Joint<'_> {
    /// Something doubtful about some rows, or about the file.
    pub fn text(&self, rows: &[usize], column: &str, what: &str) -> String {
        let lines: Vec<u64> = rows.iter().map(|n| self.sheet.rows[*n].line).collect();
        let line = lines.first().copied().unwrap_or(self.sheet.header_line());
        let more = if lines.len() > 1 { format!(" (the same in {})", lines_text(&lines[1..])) } else { String::new() };
        format!("{}:{line}: {column}: {what}{more}", printable(&self.sheet.source.name))
    }

    /// All that is doubtful.
    pub fn warnings(&self, wrenches: &[[f64; 6]], flipped: &[usize], options: &Options) -> Vec<String> {
        let log = self.log.cell.columns();
        let column = log.first().map_or("", |(name, _)| name);
        let mut all: Vec<String> = self.of_times(options);
        all.extend(self.of_zero(column));
        all.extend(self.not_at_rest(column));
        if !flipped.is_empty() {
            let what = "the sign differs from that of most readings under the same nominal load: taken as it was read";
            all.push(self.text(flipped, column, what));
        }
        all.extend(self.not_as_meant(wrenches, column));
        all
    }

    fn rows(&self, is_one: impl Fn(usize) -> bool) -> Vec<usize> {
        (0..self.windows.len()).filter(|n| is_one(*n)).collect()
    }

    /// Greatest load that was read.
    fn greatest(&self) -> f64 {
        self.read.iter().map(size).fold(0.0, f64::max)
    }

    /// Of the windows: what they hold.
    fn of_times(&self, options: &Options) -> Vec<String> {
        let column = self.times.column;
        let mut all = Vec::new();
        let mut say = |rows: Vec<usize>, what: &str| {
            if !rows.is_empty() {
                all.push(self.text(&rows, column, what));
            }
        };
        if self.times.to_the_minute {
            say(vec![0], "times without seconds: the load may have been another half a minute before or after");
        }
        let few = format!("fewer than {MIN_SAMPLES} samples in the window: the scatter is that of the other readings");
        say(self.rows(|n| self.windows[n].samples.len() < MIN_SAMPLES), &few);
        let ([from_s, to_s], samples) = (options.window_s, &self.log.samples);
        let spacing_s = spacing_s(samples);
        let (first, last) = (samples.first().map_or(0.0, |s| s.time_s), samples.last().map_or(0.0, |s| s.time_s));
        let is_cut = |n: usize| self.at_s[n] + from_s < first - spacing_s || self.at_s[n] + to_s > last + spacing_s;
        say(self.rows(is_cut), "the window reaches beyond the log: its load is that of the part that the log has");
        let mut order: Vec<usize> = (0..self.windows.len()).collect();
        order.sort_by(|a, b| self.at_s[*a].total_cmp(&self.at_s[*b]).then(a.cmp(b)));
        let shares = |pair: &&[usize]| overlap(&self.windows[pair[0]].samples, &self.windows[pair[1]].samples);
        let mut shared: Vec<usize> = order.windows(2).filter(shares).map(|pair| pair[1]).collect();
        shared.sort_unstable();
        let what = "the window shares samples with that of another reading: errors of their loads go together, and a diagnosis takes \
                    each for another one";
        say(shared, what);
        all
    }

    /// Of the cell's zero.
    fn of_zero(&self, column: &str) -> Option<String> {
        let file = printable(&self.log.name);
        let line = self.log.samples.first().map_or(1, |s| s.line);
        if self.zeros.is_empty() {
            let what = "no zero of the cell: no reading is marked as unloaded, and no --load-zero-s says where nothing pulled. The log is \
                        taken as it is";
            return Some(format!("{file}:{line}: {column}: {what}"));
        }
        let of = |n: usize, c: usize| by_lever(&self.zeros[n].mean)[c];
        let spread = |c: usize| {
            let all = (0..self.zeros.len()).map(|n| of(n, c));
            all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
        };
        let (moved, greatest) = ((0..6).map(spread).fold(0.0, f64::max), self.greatest());
        (moved > AT_REST * greatest).then(|| {
            let share = 100.0 * moved / greatest;
            format!(
                "{file}:{line}: {column}: the zero moves by {share:.1} % of the greatest load between unloaded readings: each reading has \
                 that of the nearest one"
            )
        })
    }

    /// Windows in which the load changes.
    fn not_at_rest(&self, column: &str) -> Vec<String> {
        let in_windows = |c: usize| super::median(self.windows.iter().map(|w| w.sd[c]).collect());
        let next = jitter(&self.log.samples);
        let noise: [f64; 6] = std::array::from_fn(|c| (AT_REST_SD[0] * in_windows(c)).min(AT_REST_SD[1] * next[c]));
        let (noise, greatest) = (by_lever(&noise), self.greatest());
        let jump = |n: usize| {
            let own = if matches!(self.meant[n], Meant::Unloaded) { greatest } else { size(&self.read[n]) };
            let drift = by_lever(&self.windows[n].drift);
            let beyond = |c: usize| drift[c] > (AT_REST * own).max(noise[c]);
            (0..6).any(beyond).then(|| drift.iter().copied().fold(0.0, f64::max))
        };
        let rows = self.rows(|n| jump(n).is_some());
        let Some(first) = rows.first() else { return Vec::new() };
        let by = jump(*first).unwrap_or(0.0);
        let what = format!(
            "the load is not at rest in the window: parts of it differ by {by:.1} N. Its scatter counts as noise; if that is so in many \
             readings, the clocks may differ (--load-clock-s), or the window is too wide (--load-window-s)"
        );
        vec![self.text(&rows, column, &what)]
    }

    /// Loads that are not those that were meant.
    fn not_as_meant(&self, wrenches: &[[f64; 6]], column: &str) -> Option<String> {
        let nominal = |n: usize| match self.meant[n] {
            Meant::Nominal(nominal) => Some(nominal),
            _ => None,
        };
        let greatest = (0..wrenches.len()).filter_map(nominal).map(|load| size(&load)).fold(0.0, f64::max);
        let off = |n: usize| {
            let nominal = nominal(n)?;
            let off: [f64; 6] = std::array::from_fn(|c| wrenches[n][c] - nominal[c]);
            (size(&off) > AS_MEANT * greatest).then_some(nominal)
        };
        let rows = self.rows(|n| off(n).is_some());
        let first = *rows.first()?;
        let (read, meant) = (size(&wrenches[first]), size(&off(first)?));
        let what = format!(
            "the log says {read:.1} N where {meant:.1} N was meant, or another direction: unit, sign, or the clocks (--load-clock-s)?"
        );
        Some(self.text(&rows, column, &what))
    }
}

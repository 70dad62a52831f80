//! What a program leaves to the control or to its operator, and how it is read here: said once each.

use super::loads::is_nearly_load;
use super::modal::{Modal, Motion};
use super::words::Line;
use crate::error::printable;
use crate::path::FeedMode;

/// A line, and how many there are.
#[derive(Default)]
struct First(Option<(u64, usize)>);

impl First {
    fn add(&mut self, line: u64) {
        self.0.get_or_insert((line, 0)).1 += 1;
    }
}

/// What was taken for granted so far.
#[derive(Default)]
pub(super) struct Assumptions {
    /// Lines with `/` that are carried out.
    deletable: First,
    /// Comments that nearly set a load, and the first of them.
    nearly_loads: First,
    nearly_load: String,
    /// G61 or G61.1 is in force.
    is_exact: bool,
    exact_cuts: First,
    cuts_without_feed: First,
    holes_without_g98: First,
}

impl Assumptions {
    /// A line that is carried out, before its moves.
    pub fn take(&mut self, number: u64, line: &Line<'_>) {
        if line.deletable {
            self.keep_deletable(number);
        }
        for word in line.words.iter().filter(|w| w.letter == 'G') {
            self.is_exact = (self.is_exact || word.is('G', &[61.0, 61.1])) && !word.is('G', &[64.0]);
        }
        if let Some(comment) = line.comments.iter().find(|comment| is_nearly_load(comment)) {
            if self.nearly_loads.0.is_none() {
                self.nearly_load = printable(comment);
            }
            self.nearly_loads.add(number);
        }
    }

    /// A line with `/` is carried out.
    pub fn keep_deletable(&mut self, number: u64) {
        self.deletable.add(number);
    }

    /// A line has cuts.
    pub fn cuts(&mut self, number: u64, modal: &Modal<'_>) {
        if self.is_exact {
            self.exact_cuts.add(number);
        }
        if modal.assumes_g98 && matches!(modal.motion, Some(Motion::Drill(_))) {
            self.holes_without_g98.add(number);
        }
        let has_feed = match modal.feed_mode {
            FeedMode::OfAMinute => modal.feed_per_min.is_some(),
            FeedMode::OfATurn => modal.feed_per_turn.is_some(),
            FeedMode::InverseTime => true,
        };
        if !has_feed {
            self.cuts_without_feed.add(number);
        }
    }

    /// How many lines with `/` are carried out.
    pub fn deletable(&self) -> usize {
        self.deletable.0.map_or(0, |(_, count)| count)
    }

    /// For the user, of a program by its name.
    pub fn warnings(&self, name: &str) -> Vec<String> {
        let name = printable(name);
        let said = |first: &First, what: &dyn Fn(&str) -> String| {
            let (line, count) = first.0?;
            let more = if count > 1 { format!(" (first of {count} such lines)") } else { String::new() };
            Some(format!("{name}:{line}: {}", what(&more)))
        };
        let all = [
            said(&self.deletable, &|more| {
                format!(
                    "begins with `/`{more}: carried out, and written without it, whatever the control's switch for block delete says; \
                     --block-delete leaves such lines out"
                )
            }),
            said(&self.nearly_loads, &|more| {
                format!(
                    "`{}`{more} sets no load: expected (F x y z) or (F x y z mx my mz) with spaces, or (wrench fx,fy,fz,mx,my,mz)",
                    self.nearly_load
                )
            }),
            said(&self.exact_cuts, &|more| {
                format!(
                    "a cut in G61 (exact stop){more}: it is written in parts, and the control stops at the end of each: write G64 where the tool \
                     may not dwell"
                )
            }),
            said(&self.holes_without_g98, &|more| {
                format!(
                    "a drilling cycle without G98 or G99{more}: read as G98, back to the height before the cycle (Fanuc, Haas); LinuxCNC goes back \
                     to R: write the one that you mean"
                )
            }),
            said(&self.cuts_without_feed, &|more| {
                format!("a cut without F in force{more}: the control takes the feed that it has from before, or stops")
            }),
        ];
        all.into_iter().flatten().collect()
    }
}

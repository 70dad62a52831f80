//! What loads the tool on a program's cuts: a constant until a comment sets another, or the cut that the tool makes.

use pkm_core::Wrench;

use super::modal::Modal;
use super::words::Line;
use super::{Refusal, Setup};
use crate::cutting::{Cut, Cutter, Side};
use crate::dataset::MAX_LOAD;
use crate::path::Load;
use crate::tools::{Called, Tools};

/// Deepest cut, mm: far beyond any.
const MAX_DEPTH_MM: f64 = 1e3;

/// Where the load comes from.
#[derive(Clone, Copy)]
enum Origin {
    /// `--wrench`.
    Option(Wrench<f64>),
    /// `(wrench …)` or `(F …)`.
    Given(Wrench<f64>),
    /// Material and tool.
    Estimated,
}

/// How the spindle turns.
#[derive(Clone, Copy, PartialEq)]
enum Spindle {
    /// As it should, or nothing says how.
    Forward,
    /// M4.
    Reversed,
    /// M5.
    Stopped,
}

/// The load in force.
pub(super) struct Loads {
    origin: Option<Origin>,
    /// `--wrench` or a comment has set the load: a tool change does not.
    is_said: bool,
    /// The last T, and the tool that M6 has put in.
    called: Option<Called>,
    in_hand: Option<Called>,
    /// The tool in hand, with what `(cut …)` says of its engagement.
    cutter: Option<Cutter>,
    /// What M3, M4 or M5 said last.
    spindle: Spindle,
    /// A tool that came without a load of its own.
    pub unloaded_tool: Option<f64>,
    /// `--wrench` is given, and no cut has had it so far.
    pub is_option_idle: bool,
}

/// A comment's text without what makes it one.
fn inner(comment: &str) -> &str {
    comment.trim_start_matches([';', '(', ' ', '\t']).trim_end_matches(')').trim()
}

/// The load that a comment sets, if it is one that does: `(wrench fx,fy,fz,mx,my,mz)`, `(F x y z)`, `(F x y z mx my mz)`.
fn given(comment: &str) -> Result<Option<Wrench<f64>>, Refusal> {
    let text = inner(comment);
    let numbers = |rest: &str| -> Vec<Option<f64>> {
        rest.split(|c: char| c == ',' || c.is_whitespace()).filter(|v| !v.is_empty()).map(|v| v.parse().ok()).collect()
    };
    let (values, expected) = match text.split_at_checked(6) {
        Some((word, rest)) if word.eq_ignore_ascii_case("wrench") && !rest.starts_with(char::is_alphanumeric) => {
            (numbers(rest), "`(wrench fx,fy,fz,mx,my,mz)`, six numbers")
        }
        _ => match text.strip_prefix(['F', 'f']).map(|rest| (rest.starts_with(char::is_whitespace), numbers(rest))) {
            // `(F 200)` is a note on the feed
            Some((true, values)) if values.len() > 1 && values.iter().all(Option::is_some) => {
                (values, "`(F x y z)` or `(F x y z mx my mz)`, three or six numbers")
            }
            _ => return Ok(None),
        },
    };
    let is_force = !text[..1].eq_ignore_ascii_case("w");
    let mut wrench = [0.0; 6];
    let counts = values.len() == 6 || (is_force && values.len() == 3);
    for (to, value) in wrench.iter_mut().zip(&values).filter(|_| counts) {
        match value.filter(|v| v.abs() <= MAX_LOAD) {
            Some(value) => *to = value,
            None => return Err(format!("expected {expected} in N and N·m within ±{MAX_LOAD:e}, found `{text}`")),
        }
    }
    if !counts {
        return Err(format!("expected {expected} in N and N·m within ±{MAX_LOAD:e}, found `{text}`"));
    }
    Ok(Some(Wrench::from_vector(wrench.into())))
}

/// Whether a comment looks like a force and is none as [`given`] reads it: `(F100 -50 -200)`, `(F=10,0,-20)`, `(F 10 0 -20 N)`.
pub(super) fn is_nearly_load(comment: &str) -> bool {
    let separators = |c: char| c.is_whitespace() || ",;=:".contains(c);
    let rest = inner(comment).strip_prefix(['F', 'f']).map(|rest| rest.trim_start_matches(separators));
    // a word, such as (FACE MILL 50 4), is a note
    let begins = |rest: &&str| rest.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    let Some(rest) = rest.filter(begins) else { return false };
    let numbers = rest.split(separators).filter(|word| word.parse::<f64>().is_ok()).count();
    numbers > 1 && given(comment).is_ok_and(|load| load.is_none())
}

impl Loads {
    pub fn new(given: Option<Wrench<f64>>) -> Self {
        Self {
            origin: given.map(Origin::Option),
            is_said: given.is_some(),
            called: None,
            in_hand: None,
            cutter: None,
            spindle: Spindle::Forward,
            unloaded_tool: None,
            is_option_idle: given.is_some(),
        }
    }

    /// The tool in hand: without M6 a T changes it.
    pub fn tool(&self) -> Option<f64> {
        self.called_in_hand().map(|called| called.number)
    }

    /// Whether M6 has put in the tool in hand.
    pub fn has_changed_tool(&self) -> bool {
        self.in_hand.is_some()
    }

    /// The same, and where it was called.
    pub fn called_in_hand(&self) -> Option<Called> {
        self.in_hand.or(self.called)
    }

    /// Takes what a line says of tools and loads, and its number.
    pub fn take(&mut self, line: &Line<'_>, number: u64, setup: &Setup) -> Result<(), Refusal> {
        let before = self.tool();
        // a control obeys T before M6, wherever it stands in the line
        let word = line.words.iter().find(|w| w.letter == 'T');
        self.called = word.map(|w| Called { number: w.value, line: number }).or(self.called);
        for word in line.words.iter().filter(|w| w.letter == 'M') {
            match word.value {
                6.0 => self.in_hand = self.called,
                3.0 => self.spindle = Spindle::Forward,
                4.0 => self.spindle = Spindle::Reversed,
                5.0 => self.spindle = Spindle::Stopped,
                _ => {}
            }
        }
        if self.tool() != before {
            self.cutter = self.tool().and_then(|number| setup.tools.cutter(number));
            if self.cutter.is_some() && setup.tools.material.is_some() && !self.is_said {
                (self.origin, self.unloaded_tool) = (Some(Origin::Estimated), None);
            } else if before.is_some() {
                self.unloaded_tool = self.tool();
            }
        }
        let mut before: Option<(&str, Origin)> = None;
        for comment in &line.comments {
            let origin = match given(comment)? {
                Some(wrench) => Origin::Given(wrench),
                None if self.engage(comment, setup)? => Origin::Estimated,
                None => continue,
            };
            // two that say how the tool is engaged go together
            let is_second =
                |(_, other): &(&str, Origin)| [*other, origin].iter().any(|o| matches!(o, Origin::Given(_)));
            if let Some((first, _)) = before.filter(is_second) {
                return Err(format!(
                    "`{first}` and `{comment}`: a line can set one load only, that of its cut: delete one, or give it a line of its own"
                ));
            }
            before = Some((comment, origin));
            (self.origin, self.is_said, self.unloaded_tool) = (Some(origin), true, None);
        }
        Ok(())
    }

    /// `(cut ap 2 ae 6 climb)`: how the tool in hand is engaged from here on, each if it is said. `(cut model)`: as the tool table has it.
    fn engage(&mut self, comment: &str, setup: &Setup) -> Result<bool, Refusal> {
        let text = inner(comment).to_ascii_lowercase().replace('=', " ");
        let mut words = text.split_whitespace();
        let known = ["ap", "ae", "climb", "conventional", "centre", "model"];
        // any other comment that begins so is a note
        if words.next() != Some("cut") || !words.clone().next().is_some_and(|word| known.contains(&word)) {
            return Ok(false);
        }
        let of_table = self.tool().and_then(|number| setup.tools.cutter(number));
        let missing = || {
            let why = match setup.tools.is_given() {
                true => setup.tools.no_cutter(self.called_in_hand()),
                false => "give --tools with the tool's `kind` and `teeth`, and a [material]".to_owned(),
            };
            format!("(cut …): {why}")
        };
        let mut cutter = self.cutter.or(of_table).ok_or_else(missing)?;
        while let Some(word) = words.next() {
            if word == "model" {
                cutter = of_table.ok_or_else(missing)?;
                continue;
            }
            let Some(engagement) = &mut cutter.engagement else {
                return Err("(cut …): a drill has no ap, no ae and no side".into());
            };
            let mut length = |most: f64| {
                let value = words.next().and_then(|v| v.parse::<f64>().ok()).filter(|v| *v > 0.0 && *v <= most);
                value.ok_or_else(|| format!("(cut {word} …): expected a length in mm above 0, at most {most}"))
            };
            match word {
                "ap" => engagement.depth_mm = length(MAX_DEPTH_MM)?,
                "ae" => engagement.width_mm = length(cutter.diameter_mm)?,
                "climb" => engagement.side = Side::Climb,
                "conventional" => engagement.side = Side::Conventional,
                "centre" => engagement.side = Side::Centre,
                other => return Err(format!("(cut …): expected {}, found `{other}`", known.join(", "))),
            }
        }
        self.cutter = Some(cutter);
        Ok(true)
    }

    /// Why a cut has no load, and what to do.
    fn no_load(&self, tools: &Tools) -> Refusal {
        let todo = "give --wrench, a line (wrench fx,fy,fz,mx,my,mz) before it, or";
        if tools.material.is_none() {
            return format!("a cut without a load: {todo} tools with `kind` and a [material] in --tools");
        }
        let why = tools.no_cutter(self.called_in_hand());
        format!("a cut without a load: {why}; {todo} the tool with `kind` there")
    }

    /// The load of a cut.
    pub fn load(&mut self, modal: &Modal<'_>) -> Result<Load, Refusal> {
        match self.origin {
            Some(Origin::Option(wrench)) => {
                self.is_option_idle = false;
                return Ok(Load::Given([wrench; 2]));
            }
            Some(Origin::Given(wrench)) => return Ok(Load::Given([wrench; 2])),
            Some(Origin::Estimated) => {}
            None => return Err(self.no_load(&modal.setup.tools)),
        }
        let missing = |what: &str| format!("a cutting force is to be estimated, and {what}");
        let material = modal.setup.tools.material.ok_or_else(|| missing("--tools has no [material]"))?;
        let cutter = self.cutter.ok_or_else(|| missing(&modal.setup.tools.no_cutter(self.called_in_hand())))?;
        match self.spindle {
            Spindle::Forward => {}
            Spindle::Reversed => {
                return Err(missing("the spindle turns backwards (M4): give the load with (wrench …)"));
            }
            Spindle::Stopped => return Err(missing("the spindle stands (M5)")),
        }
        let per_turn = modal.feed_per_turn.map(|[mm, _]| mm).or_else(|| {
            let [feed, _] = modal.feed_per_min?;
            Some(feed / modal.spindle_per_min?)
        });
        let feed_per_turn_mm =
            per_turn.ok_or_else(|| missing("feed or speed is not known: give S, and F in G94 or G95"))?;
        Ok(Load::Cut(Cut { material, cutter, feed_per_tooth_mm: feed_per_turn_mm / f64::from(cutter.teeth) }))
    }
}

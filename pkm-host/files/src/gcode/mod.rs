//! G-code (RS-274) as controls of the Fanuc family and LinuxCNC read it: read into straight moves of the tool, and written again
//! with other places. `docs/formats.md`, G-code, has the table of words.
//!
//! A program is read in the order in which a control carries it out. Expressions become numbers, loops all of their passes, arcs, cycles and
//! subprograms straight moves; all that
//! does not move the tool is passed on as it stands. A cut is divided, and each part ends with all of its words. Where the load
//! changes between two moves, the second begins with a small move to where the tool has to be commanded under its own load.
//!
//! `X Y Z` are the tip of the tool in the work frame in force, whose axes are those of B or those that the job says. The tool's axis is given by `A B`, the
//! wrist's joints; by `I J K` on straight moves; or by the angles of a head or a fixed direction, as the job says. A comment
//! `(wrench fx,fy,fz,mx,my,mz)` or `(F x y z)` sets the cutting load from there on: on the tool at its tip in the axes of T_h, N and N·m. Without
//! one it is estimated, where the tool table has the tool's edges and a material.

mod arcs;
mod assumptions;
mod canonical;
mod codes;
mod cycles;
mod expressions;
mod flow;
mod lengths;
mod linuxcnc;
mod loads;
mod modal;
mod motions;
mod offsets;
mod outline;
mod parameters;
mod words;
mod writer;

pub use writer::Writer;

use std::path::Path;

use pkm_core::Wrench;

use self::assumptions::Assumptions;
use self::codes::LOADS_GIVEN_TWICE;
use self::expressions::{expand, has_expressions};
use self::flow::{Flow, Order};
use self::lengths::Lengths;
use self::loads::Loads;
use self::modal::{Effect, Form, Modal, Stop, Style};
use self::words::Line;
use crate::error::{Failure, Result, printable};
use crate::head::{Head, ProgramAxes};
use crate::job_program::ProgramOffsets;
use crate::path::{Load, Move, Place, Toward};
use crate::source::Source;
use crate::tools::Tools;

/// Why a line is refused.
type Refusal = String;

/// How far a straight move of a divided arc may be from it, mm.
pub const CHORD_MM: f64 = 1e-3;

/// Most moves of a program.
const MAX_MOVES: usize = 5_000_000;

/// What a program does not say of the machine that it is for.
pub struct Setup {
    /// Work frames and reference points.
    pub offsets: ProgramOffsets,
    /// Lengths of tools, their edges, and the material.
    pub tools: Tools,
    /// How the program's axes lie in B.
    pub axes: ProgramAxes,
    /// The head whose angles the program gives; `None`: the wrist's joints as A and B, or vectors I J K.
    pub head: Option<Head>,
    /// How far a straight move of a divided arc may be from it, mm.
    pub chord_mm: f64,
    /// Whether lines that begin with `/` are left out.
    pub block_delete: bool,
    /// Whether the program is only to be played by `view`, which takes neither a job nor a tool table.
    pub is_only_played: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            offsets: ProgramOffsets::default(),
            tools: Tools::default(),
            axes: ProgramAxes::default(),
            head: None,
            chord_mm: CHORD_MM,
            block_delete: false,
            is_only_played: false,
        }
    }
}

impl Setup {
    /// What to do about something that a job or a tool table would say.
    fn todo(&self, todo: &str) -> Refusal {
        let instead = "view takes no job and no tool table: it plays a CSV, or G-code whose X Y Z are those of B, without tool lengths, with \
                       A B of the wrist or I J K";
        if self.is_only_played { instead } else { todo }.to_owned()
    }

    /// The length of a tool over the machine file's flange.
    fn length_mm(&self, number: f64) -> std::result::Result<f64, Refusal> {
        self.tools.length_mm(number).ok_or_else(|| {
            let todo = match self.tools.is_given() {
                true => "the tool table (--tools) has no such tool",
                false => "give a tool table with --tools (TOML, or LinuxCNC's .tbl)",
            };
            format!("the length of tool {number} is not known: {}", self.todo(todo))
        })
    }
}

/// A program: its lines in the order in which they are carried out, and the moves among them.
pub struct Program {
    source: Source,
    /// Lines with numbers in place of their expressions.
    expanded: Vec<Box<str>>,
    blocks: Vec<Block>,
    styles: Vec<Style>,
    axes: ProgramAxes,
    head: Option<Head>,
    /// In the order in which they are made.
    pub moves: Vec<Move>,
    /// Names the lines that may not mean what they say.
    pub warnings: Vec<String>,
    /// How many lines with `/` were carried out.
    pub deletable: usize,
}

/// A line that was carried out.
struct Block {
    text: TextAt,
    content: Content,
}

/// Where a line's text stands.
#[derive(Clone, Copy, PartialEq)]
enum TextAt {
    /// In the file.
    Line(u32),
    /// Among those with numbers in place of their expressions.
    Expanded(u32),
}

/// What a line becomes.
#[derive(Clone, Copy)]
enum Content {
    /// The same.
    Text,
    /// A comment: it only set parameters, or said which line is next, or stands beside itself with numbers in place of expressions.
    Note,
    /// The same but for the words that called a subprogram or ended one: its lines follow.
    Call,
    /// So many moves.
    Moves { count: u32, style: u32 },
}

/// A program that is being read.
struct Reader<'a> {
    flow: Flow<'a>,
    modal: Modal<'a>,
    program: Program,
    loads: Loads,
    lengths: Lengths,
    assumptions: Assumptions,
    /// The first line that was passed on unchecked, why, and how many are.
    unchecked: Option<(u64, String, usize)>,
    /// Lines behind a `%` in the middle.
    unread: usize,
}

impl Program {
    /// Reads a program that needs no word on the machine. `wrench` is the cutting load until a comment sets another.
    ///
    /// # Errors
    /// Those of [`parse_with`](Self::parse_with).
    pub fn parse(source: &Source, wrench: Option<Wrench<f64>>) -> Result<Self> {
        Self::parse_with(source, wrench, &Setup::default())
    }

    /// Reads a program.
    ///
    /// # Errors
    /// The line that is not supported; a cut without a load; no move at all.
    pub fn parse_with(source: &Source, wrench: Option<Wrench<f64>>, setup: &Setup) -> Result<Self> {
        Self::parse_lines(source, wrench, setup, None)
    }

    /// Reads a program as LinuxCNC's interpreter `rs274` understands it: it is written without loops, subroutines and radius compensation.
    /// Subroutines in files are looked for in `folder`.
    ///
    /// # Errors
    /// `rs274` cannot be run; what it refuses; those of [`parse_with`](Self::parse_with).
    pub fn parse_by(
        rs274: &Path,
        source: &Source,
        folder: &Path,
        wrench: Option<Wrench<f64>>,
        setup: &Setup,
    ) -> Result<Self> {
        let expanded = linuxcnc::expand(rs274, source, folder, setup)?;
        let plain = Source::from_text(&source.name, expanded.text);
        Self::parse_lines(&plain, wrench, setup, Some(&expanded.lines))
    }

    /// `lines`: the number of each line in the file of the user, if it is another.
    fn parse_lines(source: &Source, wrench: Option<Wrench<f64>>, setup: &Setup, lines: Option<&[u64]>) -> Result<Self> {
        let number = |index: usize| lines.and_then(|l| l.get(index).copied()).unwrap_or(index as u64 + 1);
        let program = Self {
            source: source.clone(),
            expanded: Vec::new(),
            blocks: Vec::new(),
            styles: Vec::new(),
            axes: setup.axes,
            head: setup.head,
            moves: Vec::new(),
            warnings: Vec::new(),
            deletable: 0,
        };
        let failed =
            |(index, message): (usize, String)| Failure::input(message).in_file(&source.name).at_line(number(index));
        let mut reader = Reader {
            flow: Flow::new(source.text()?).map_err(failed)?,
            modal: Modal::new(setup),
            program,
            loads: Loads::new(wrench),
            lengths: Lengths::default(),
            assumptions: Assumptions::default(),
            unchecked: None,
            unread: 0,
        };
        let mut stops = Vec::new();
        while let Some((index, text)) = reader.flow.next() {
            reader.step(index, number(index), text, &mut stops).map_err(|message| failed((index, message)))?;
        }
        reader.finish()
    }
}

/// A place with other axes of reference; joints and a head's angles are what they are.
fn turned(place: &Place, turn: impl Fn([f64; 3]) -> [f64; 3]) -> Place {
    let toward = match place.toward {
        Toward::Axis(axis) => Toward::Axis(turn(axis)),
        angles => angles,
    };
    Place { tip_m: turn(place.tip_m), toward }
}

impl Reader<'_> {
    /// A line of the file.
    fn step(
        &mut self,
        index: usize,
        number: u64,
        text: &str,
        stops: &mut Vec<Stop>,
    ) -> std::result::Result<(), Refusal> {
        let place = TextAt::Line(index as u32);
        if self.flow.has_ended() {
            // whatever it is, the control does not read it
            if Line::parse(text).is_ok_and(|line| line.is_silent()) {
                self.put(place, Content::Text);
            } else {
                self.unread += 1;
            }
            return Ok(());
        }
        if has_expressions(text) {
            let (deletable, body) = words::without_switch(text);
            let (code, comments) = words::apart(body)?;
            if has_expressions(&code) && !code.starts_with(['O', 'o']) {
                if self.flow.leaves_out(deletable, self.modal.setup.block_delete) {
                    return Ok(());
                }
                if deletable {
                    self.assumptions.keep_deletable(number);
                }
                let words = expand(&code, &mut self.flow.parameters)?;
                self.put(place, Content::Note);
                return self.take_rest(number, words, &comments, stops);
            }
        }
        self.take(place, number, &Line::parse(text)?, stops)
    }

    /// What of a line is more than a note.
    fn take_rest(
        &mut self,
        number: u64,
        mut words: String,
        comments: &[&str],
        stops: &mut Vec<Stop>,
    ) -> std::result::Result<(), Refusal> {
        for comment in comments {
            words = format!("{words} {comment}");
        }
        let text = words.trim_start();
        if text.is_empty() {
            return Ok(());
        }
        let place = TextAt::Expanded(self.program.expanded.len() as u32);
        self.program.expanded.push(text.into());
        self.take(place, number, &Line::parse(text)?, stops)
    }

    /// A line without expressions.
    fn take(
        &mut self,
        text: TextAt,
        number: u64,
        line: &Line<'_>,
        stops: &mut Vec<Stop>,
    ) -> std::result::Result<(), Refusal> {
        match self.flow.order(line, self.modal.setup.block_delete)? {
            Order::Drop => return Ok(()),
            Order::Pass => {
                self.put(text, Content::Text);
                return Ok(());
            }
            Order::Note => {
                self.put(text, Content::Note);
                return self.take_rest(number, String::new(), &line.comments, stops);
            }
            Order::Do => {}
        }
        self.assumptions.take(number, line);
        self.loads.take(line, number, self.modal.setup)?;
        (self.modal.tool, self.modal.line) = (self.loads.tool(), number);
        let refused = |numbers: &[f64], why: &str| match line.words.iter().find(|w| w.is('M', numbers)) {
            Some(word) => Err(format!("`{}` is not supported: {why}", word.shown())),
            None => Ok(()),
        };
        refused(&[72.0, 73.0, 97.0, 198.0], "which words are in force after it is not followed")?;
        refused(&[66.0], "what an input says is not known before")?;
        refused(&[67.0, 68.0], LOADS_GIVEN_TWICE)?;
        stops.clear();
        let loaded = self.program.moves.last().is_some_and(Move::is_loaded);
        let content = match self.modal.take(line, loaded, stops)? {
            Effect::Nothing => Content::Text,
            Effect::Unchecked(why) => {
                self.unchecked.get_or_insert((number, why, 0)).2 += 1;
                Content::Text
            }
            Effect::Moves { form, fresh } => {
                self.flow.moves();
                let has_cuts = stops.iter().any(|stop| !stop.rapid);
                if has_cuts {
                    self.assumptions.cuts(number, &self.modal);
                }
                // coordinates of the machine are those without a tool's length
                if has_cuts && !line.words.iter().any(|w| w.is('G', &[53.0])) {
                    self.check_length(number);
                }
                for (n, stop) in stops.iter().enumerate() {
                    self.go(number, stop, fresh && n == 0)?;
                }
                let style = self.style(form, line);
                Content::Moves { count: stops.len() as u32, style }
            }
        };
        self.take_m(text, line, content)
    }

    fn check_length(&mut self, line: u64) {
        let place = format!("{}:{line}", printable(&self.program.source.name));
        self.lengths.check(&self.loads, &self.modal, &place);
    }

    /// M words that say which line is next.
    fn take_m(&mut self, text: TextAt, line: &Line<'_>, content: Content) -> std::result::Result<(), Refusal> {
        let has = |number: f64| line.words.iter().any(|w| w.is('M', &[number]));
        let value = |letter: char| line.words.iter().find(|w| w.letter == letter).map(|w| w.value);
        if [2.0, 30.0, 98.0, 99.0].into_iter().filter(|m| has(*m)).count() > 1 {
            return Err("of M2, M30, M98 and M99 more than one: which line is next is not clear".into());
        }
        let calls = has(98.0) || has(99.0);
        if calls && self.is_reference(content) {
            return Err("G28 or G30 with M98 or M99: give them lines of their own".into());
        }
        self.put(text, if calls && matches!(content, Content::Text) { Content::Call } else { content });
        if has(98.0) {
            self.flow.m98(value('P'), value('L'))?;
        } else if has(99.0) {
            self.flow.m99()?;
        } else if has(2.0) || has(30.0) {
            self.flow.end();
        }
        Ok(())
    }

    fn is_reference(&self, content: Content) -> bool {
        let Content::Moves { style, .. } = content else { return false };
        matches!(self.program.styles[style as usize].form, Form::Reference { .. })
    }

    fn put(&mut self, text: TextAt, content: Content) {
        self.program.blocks.push(Block { text, content });
    }

    /// A move with its load.
    fn go(&mut self, line: u64, stop: &Stop, is_fresh: bool) -> std::result::Result<(), Refusal> {
        let load = if stop.rapid { Load::NONE } else { self.loads.load(&self.modal)? };
        if self.program.moves.len() >= MAX_MOVES {
            return Err(format!("more than {MAX_MOVES} moves: give a greater --chord-mm, or divide the program"));
        }
        if is_fresh && !stop.rapid && !self.program.moves.is_empty() {
            return Err("a cut from a place that is not known: begin with G0 and X Y Z".into());
        }
        if let Some(number) = self.loads.unloaded_tool.take_if(|_| load != Load::NONE) {
            self.program.warnings.push(format!(
                "{}:{line}: T{number} cuts with the load of the tool before: a line (wrench …) gives another",
                printable(&self.program.source.name)
            ));
        }
        let to = turned(&stop.place, |v| self.modal.setup.axes.to_base(v));
        let before = self.program.moves.last().filter(|_| !is_fresh && load != Load::NONE);
        if before.is_some_and(|before| before.to.turned_alone_deg(&to).is_some()) {
            self.modal.check_turn()?;
        }
        self.program.moves.push(Move {
            line,
            to,
            load,
            longer_m: self.modal.length_mm / 1e3,
            is_fresh,
            continues: stop.continues,
            is_rapid: stop.rapid,
            feed_per_min: self.modal.feed_a_minute().filter(|_| !stop.rapid),
            feed_mode: self.modal.feed_mode,
        });
        Ok(())
    }

    /// The number of the style that is in force.
    fn style(&mut self, form: Form, line: &Line<'_>) -> u32 {
        let style = self.modal.style(form, line.words.iter().any(|w| w.is('G', &[53.0])));
        let styles = &mut self.program.styles;
        if styles.last() != Some(&style) {
            styles.push(style);
        }
        styles.len() as u32 - 1
    }

    /// The line of a `%` in the middle, and what is said of the lines behind it. Behind M2 and M30 subprograms are as usual.
    fn cut_off(&self) -> Option<(usize, &'static str, String)> {
        let line = self.flow.percent().filter(|_| self.unread > 0)?;
        let lines = if self.unread == 1 { "line".to_owned() } else { format!("{} lines", self.unread) };
        Some((line, if self.unread == 1 { "is" } else { "are" }, lines))
    }

    fn finish(mut self) -> Result<Program> {
        let cut_off = self.cut_off();
        let name = &self.program.source.name;
        if let Some(message) = self.flow.unfinished() {
            return Err(Failure::input(message).in_file(name));
        }
        match self.unchecked {
            Some((line, why, _)) if self.program.moves.is_empty() => {
                return Err(Failure::input(why).in_file(name).at_line(line));
            }
            None if self.program.moves.is_empty() => {
                let why = cut_off.map_or(String::new(), |(line, are, lines)| {
                    format!(": the {lines} behind the % of line {line} {are} not read")
                });
                let message = format!("expected moves (G0 or G1 with X Y Z), found none{why}");
                return Err(Failure::input(message).in_file(name));
            }
            Some((line, why, count)) => {
                let more = if count > 1 { format!(" (first of {count} such lines)") } else { String::new() };
                let warning = format!("{}:{line}: passed on unchecked{more}: {why}", printable(name));
                self.program.warnings.push(warning);
            }
            None => {}
        }
        if let Some((line, are, lines)) = cut_off {
            let warning = format!("{}:{line}: the {lines} behind % {are} not read", printable(name));
            self.program.warnings.push(warning);
        }
        // what is only played has a load that nobody gave, and goes to no control
        let is_only_played = self.modal.setup.is_only_played;
        if !is_only_played {
            self.program.warnings.extend(self.assumptions.warnings(name));
        }
        self.program.deletable = self.assumptions.deletable();
        let has_cuts = self.program.moves.iter().any(|m| !m.is_rapid) && !is_only_played;
        if self.loads.is_option_idle && has_cuts {
            let warning = format!("{}: --wrench acts on no cut: the program sets the load of each", printable(name));
            self.program.warnings.push(warning);
        }
        self.program.warnings.extend(self.lengths.warnings(&self.loads));
        Ok(self.program)
    }
}

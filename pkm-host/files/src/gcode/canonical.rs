//! What LinuxCNC's interpreter makes of a program, as a program in plain words: loops and subroutines written out, no expressions, no
//! radius compensation, no cycles.
//!
//! The interpreter prints what a machine would be told, a call a line: `STRAIGHT_FEED(10.000000000, …)`. Before each line of the program it is
//! given a [comment](mark) that names the line.

use super::codes::{COUPLED, LOADS_GIVEN_TWICE};
use super::offsets::{name, unknown};
use super::words::{apart, without_switch};
use super::{Refusal, Setup};
use crate::job_program::ProgramOffsets;

/// Where an axis stands that the program has not moved yet, and an offset that is not known, mm and °.
pub(super) const UNKNOWN: f64 = 1e8;
/// What is beyond this is [`UNKNOWN`] and some offsets.
const KNOWN_WITHIN: f64 = 0.5 * UNKNOWN;
/// How far a length may be from that of a tool of the table, mm.
const LENGTH_TOLERANCE_MM: f64 = 1e-5;
/// How far an origin may be from the one that is known, mm.
const ORIGIN_TOLERANCE_MM: f64 = 1e-6;
/// Longest note of a line of the program; LinuxCNC takes lines of 255 characters.
const NOTE_LENGTH: usize = 200;
const MARK: &str = "pkm-host line";

/// The comment that names a line of a file, both from 0.
pub(super) fn mark(file: usize, line: usize) -> String {
    format!("({MARK} {file} {line})")
}

/// A program of the user or one of its subroutines.
pub(super) struct File<'a> {
    pub name: String,
    pub lines: Vec<&'a str>,
}

/// A program in plain words.
#[derive(Default)]
pub(super) struct Expanded {
    pub text: String,
    /// Which line of the program made each, from 1.
    pub lines: Vec<u64>,
}

/// What the interpreter has said so far.
pub(super) struct Canonical<'a> {
    setup: &'a Setup,
    files: &'a [File<'a>],
    /// File and index of the line that is carried out.
    at: Option<(usize, usize)>,
    /// Its words without blanks, in upper case.
    code: String,
    /// The line of the program that it is, or that called it, from 1.
    pub line: u64,
    unit_mm: f64,
    plane: [usize; 3],
    frames_mm: [Option<[f64; 3]>; 9],
    frame: usize,
    /// G92 and G52.
    shift_mm: [f64; 3],
    /// Turn of the work frame about Z.
    turn_rad: f64,
    tool: f64,
    /// Of the tool, mm.
    length_mm: f64,
    /// Where LinuxCNC has the tip's Z after another tool length, mm: not given by the program, and otherwise where the tool points up.
    implied_z_mm: Option<f64>,
    of_a_turn: bool,
    feed: Option<f64>,
    /// P of G64.
    deviation: f64,
    motion: &'static str,
    /// X Y Z in mm and A B C in degrees, with the work frame's origin.
    last: [f64; 6],
    expanded: Expanded,
    /// How much of it stays when the program ends here: up to the last move.
    until_move: [usize; 2],
    has_ended: bool,
}

fn number<const N: usize>(numbers: &[f64]) -> Result<[f64; N], Refusal> {
    let found = numbers.get(..N).and_then(|n| n.try_into().ok());
    found.filter(|n: &[f64; N]| n.iter().all(|v| v.is_finite())).ok_or_else(|| format!("expected {N} numbers"))
}

fn is_known(value: f64) -> bool {
    value.abs() < KNOWN_WITHIN
}

impl<'a> Canonical<'a> {
    pub fn new(setup: &'a Setup, files: &'a [File<'a>]) -> Self {
        let ProgramOffsets { frames_mm, .. } = setup.offsets;
        Self {
            setup,
            files,
            at: None,
            code: String::new(),
            line: 1,
            unit_mm: 1.0,
            plane: [0, 1, 2],
            frames_mm,
            frame: 0,
            shift_mm: [0.0; 3],
            turn_rad: 0.0,
            tool: 0.0,
            length_mm: 0.0,
            implied_z_mm: None,
            of_a_turn: false,
            feed: None,
            deviation: 0.0,
            motion: "",
            last: [UNKNOWN; 6],
            expanded: Expanded::default(),
            until_move: [0; 2],
            has_ended: false,
        }
    }

    /// Where the interpreter is, for a message: empty in the program itself.
    pub fn place(&self) -> String {
        match self.at {
            Some((file, line)) if file > 0 => format!("{}, line {}: ", self.files[file].name, line + 1),
            _ => String::new(),
        }
    }

    pub fn finish(self) -> Expanded {
        self.expanded
    }

    fn put(&mut self, line: &str) {
        // before the first line the interpreter tells what it begins with
        if self.at.is_some() {
            self.expanded.text.push_str(line);
            self.expanded.text.push('\n');
            self.expanded.lines.push(self.line);
        }
    }

    /// Takes a line that the interpreter has printed.
    pub fn take(&mut self, printed: &str) -> Result<(), Refusal> {
        let Some((head, rest)) = printed.split_once('(').filter(|_| !self.has_ended) else { return Ok(()) };
        let name = head.split_whitespace().last().unwrap_or_default();
        let text = rest.strip_suffix(')').unwrap_or(rest);
        let unquoted = text.trim_matches('"');
        let numbers: Vec<f64> = text.split([',', ' ']).filter_map(|v| v.parse().ok()).collect();
        match name {
            "COMMENT" => self.comment(unquoted)?,
            "MESSAGE" => self.put(&format!("(MSG,{unquoted})")),
            "LOG" | "LOGOPEN" | "LOGAPPEND" => self.put(&format!("({name},{unquoted})")),
            "LOGCLOSE" => self.put("(LOGCLOSE)"),
            "STRAIGHT_TRAVERSE" => self.straight("G0", &number(&numbers)?)?,
            "STRAIGHT_FEED" => self.straight("G1", &number(&numbers)?)?,
            "ARC_FEED" => self.arc(&number(&numbers)?)?,
            "USE_LENGTH_UNITS" => {
                let is_inch = text.contains("INCH");
                self.unit_mm = if is_inch { 25.4 } else { 1.0 };
                self.put(if is_inch { "G20" } else { "G21" });
            }
            "SELECT_PLANE" => {
                let (plane, word) = match text {
                    "CANON_PLANE_XY" => ([0, 1, 2], "G17"),
                    "CANON_PLANE_XZ" => ([2, 0, 1], "G18"),
                    "CANON_PLANE_YZ" => ([1, 2, 0], "G19"),
                    _ => return Err(format!("the plane {text} is not supported: G17, G18 and G19 are")),
                };
                self.plane = plane;
                self.put(word);
            }
            "SET_G5X_OFFSET" => self.origin(number(&numbers)?)?,
            "SET_G92_OFFSET" => self.shift_mm = number::<3>(&numbers)?.map(|v| v * self.unit_mm),
            "SET_XY_ROTATION" => self.turn_rad = number::<1>(&numbers)?[0].to_radians(),
            "USE_TOOL_LENGTH_OFFSET" => self.length(number(&numbers)?)?,
            "SET_FEED_MODE" => {
                let of_a_turn = number::<2>(&numbers)?[1] == 1.0;
                if of_a_turn != self.of_a_turn {
                    self.put(if of_a_turn { "G95" } else { "G94" });
                }
                self.of_a_turn = of_a_turn;
            }
            "SET_FEED_RATE" => self.feed = Some(number::<1>(&numbers)?[0]).filter(|feed| *feed > 0.0),
            "PROGRAM_END" => self.end(),
            _ => self.other(name, &numbers)?,
        }
        Ok(())
    }

    /// Calls that move nothing.
    fn other(&mut self, name: &str, numbers: &[f64]) -> Result<(), Refusal> {
        let first = numbers.first().copied().unwrap_or(0.0);
        let second = numbers.get(1).copied().unwrap_or(0.0);
        let refused = |why: &str| Err(format!("{why} ({name} of LinuxCNC's interpreter)"));
        if name.contains("SPINDLE") && first != 0.0 && !name.contains("ORIENT") {
            return refused("other spindles than the first are not supported");
        }
        let word = match name {
            // what M2, M6 and M9 do beside, and what stays as it was
            "SET_FEED_REFERENCE" | "ON_RESET" | "START_CHANGE" | "MIST_OFF" | "FINISH" => return Ok(()),
            "PALLET_SHUTTLE" if self.code.contains("M30") => return Ok(()),
            "SET_SPINDLE_MODE" if second == 0.0 => return Ok(()),
            "SET_SPINDLE_MODE" => {
                return refused("a constant surface speed is for lathes: write the speed a minute (G97)");
            }
            "SET_SPINDLE_SPEED" => format!("S{second}"),
            "START_SPINDLE_CLOCKWISE" => "M3".to_owned(),
            "START_SPINDLE_COUNTERCLOCKWISE" => "M4".to_owned(),
            "STOP_SPINDLE_TURNING" => "M5".to_owned(),
            "SELECT_TOOL" => {
                self.tool = first;
                format!("T{first}")
            }
            "CHANGE_TOOL" => "M6".to_owned(),
            "MIST_ON" => "M7".to_owned(),
            "FLOOD_ON" => "M8".to_owned(),
            "FLOOD_OFF" => "M9".to_owned(),
            "DWELL" => format!("G4 P{first}"),
            "PROGRAM_STOP" => "M0".to_owned(),
            "OPTIONAL_PROGRAM_STOP" => "M1".to_owned(),
            "ENABLE_FEED_OVERRIDE" => "M50 P1".to_owned(),
            "DISABLE_FEED_OVERRIDE" => "M50 P0".to_owned(),
            "ENABLE_SPEED_OVERRIDE" => "M51 P1".to_owned(),
            "DISABLE_SPEED_OVERRIDE" => "M51 P0".to_owned(),
            "SET_MOTION_OUTPUT_BIT" => format!("M62 P{first}"),
            "CLEAR_MOTION_OUTPUT_BIT" => format!("M63 P{first}"),
            "SET_AUX_OUTPUT_BIT" => format!("M64 P{first}"),
            "CLEAR_AUX_OUTPUT_BIT" => format!("M65 P{first}"),
            "SET_MOTION_CONTROL_MODE" | "SET_NAIVECAM_TOLERANCE" => return self.path_mode(name, numbers),
            "NURBS_FEED" => {
                return refused("splines are not supported: let the CAM system write short straight lines (G1)");
            }
            "STRAIGHT_PROBE" | "TURN_PROBE_ON" => {
                return refused("where a probe stops is not known before: run this part of the program by itself");
            }
            "SET_MOTION_OUTPUT_VALUE" | "SET_AUX_OUTPUT_VALUE" => {
                return refused(&format!("M67, M68: {LOADS_GIVEN_TWICE}"));
            }
            "SET_TOOL_TABLE_ENTRY" => return refused("G10 of tools is not supported: give their lengths with --tools"),
            "RIGID_TAP" | "START_SPEED_FEED_SYNCH" | "START_SPEED_FEED_SYNC" | "SPINDLE_RETRACT_TRAVERSE" => {
                return refused(COUPLED);
            }
            _ => return refused("not supported"),
        };
        self.put(&word);
        Ok(())
    }

    /// G61 and G64; cycles switch between them by themselves, and a straight move ends where it ends in both.
    fn path_mode(&mut self, name: &str, numbers: &[f64]) -> Result<(), Refusal> {
        if !self.says("G61") && !self.says("G61.1") && !self.says("G64") {
            return Ok(());
        }
        let word = |letter, value: f64| if value > 0.0 { format!(" {letter}{value}") } else { String::new() };
        match (name, numbers) {
            ("SET_MOTION_CONTROL_MODE", []) => {
                let word = if self.says("G61.1") { "G61.1" } else { "G61" };
                self.put(word);
            }
            ("SET_MOTION_CONTROL_MODE", [deviation, ..]) => self.deviation = *deviation,
            (_, numbers) => {
                let [tolerance] = number(numbers)?;
                self.put(&format!("G64{}{}", word('P', self.deviation), word('Q', tolerance)));
            }
        }
        Ok(())
    }

    /// A comment of ours, of the interpreter, or of the program, whose comments are taken from its lines.
    fn comment(&mut self, text: &str) -> Result<(), Refusal> {
        if text == "interpreter: continuing to use same coordinate system" {
            self.put(&name(self.frame));
        }
        let of_table = ["G41", "G42"].iter().any(|word| self.says(word));
        if text.starts_with("interpreter: cutter radius compensation on")
            && of_table
            && !self.setup.tools.have_diameters()
        {
            return Err("G41, G42: the diameter of every tool has to be in the tool table, --tools".into());
        }
        let Some(rest) = text.strip_prefix(MARK) else { return Ok(()) };
        let mut numbers = rest.split_whitespace().map(|v| v.parse::<usize>());
        let (Some(Ok(file)), Some(Ok(line))) = (numbers.next(), numbers.next()) else { return Ok(()) };
        if let Some(text) = self.files.get(file).and_then(|f| f.lines.get(line).copied()) {
            self.begin(file, line, text);
        }
        Ok(())
    }

    /// A line of the program is carried out: it stands as a comment, and so do its own.
    fn begin(&mut self, file: usize, line: usize, text: &str) {
        if self.at.replace((file, line)).is_none() {
            self.put("G17 G21 G40 G49 G80 G90 G91.1 G94");
        }
        if file == 0 {
            self.line = line as u64 + 1;
        }
        let Ok((code, comments)) = apart(without_switch(text).1) else { return };
        self.code = code.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_ascii_uppercase();
        if !code.is_empty() {
            let shown: String = code.chars().take(NOTE_LENGTH).collect();
            let of_file = if file == 0 { String::new() } else { format!("{} ", self.files[file].name) };
            self.put(&format!("({of_file}{}: {shown})", line + 1));
        }
        // what these do is printed by the interpreter
        let is_active = |comment: &str| {
            let text = comment.trim_start_matches(['(', ';']).trim_start().to_ascii_lowercase();
            ["msg,", "debug,", "print,", "log", "probe"].iter().any(|word| text.starts_with(word))
        };
        let own: Vec<&str> = comments.into_iter().filter(|comment| !is_active(comment)).collect();
        if !own.is_empty() {
            self.put(&own.join(" "));
        }
        self.until_move = [self.expanded.text.len(), self.expanded.lines.len()];
    }

    fn has_word(&self, word: &str) -> bool {
        let ends = |rest: &str| !rest.starts_with(|c: char| c.is_ascii_digit() || c == '.');
        self.code.match_indices(word).any(|(at, _)| ends(&self.code[at + word.len()..]))
    }

    /// Whether the line has this word, or one of G whose number is computed.
    fn says(&self, word: &str) -> bool {
        self.has_word(word) || self.code.contains("G[") || self.code.contains("G#")
    }

    /// A work frame that is in force from here on.
    fn origin(&mut self, [number, x, y, z, a, b, c]: [f64; 7]) -> Result<(), Refusal> {
        let frame = number as usize;
        if !(1..=9).contains(&frame) || [a, b, c] != [0.0; 3] {
            return Err("work frames that turn the rotary axes are not supported".into());
        }
        self.frame = frame - 1;
        let origin_mm = [x, y, z].map(|v| v * self.unit_mm);
        if self.at.is_none() {
            return Ok(());
        }
        let before = self.frames_mm[self.frame];
        let is_same = before.is_some_and(|b| (0..3).all(|i| (b[i] - origin_mm[i]).abs() <= ORIGIN_TOLERANCE_MM));
        if !origin_mm.iter().all(|v| is_known(*v)) {
            return Err(unknown(self.frame, self.setup));
        }
        // G54 without a job lies nowhere yet, and is refused where the new program is read
        let is_nowhere = before.is_none() && origin_mm == [0.0; 3];
        if !is_same && !is_nowhere {
            self.frames_mm[self.frame] = Some(origin_mm);
            self.put(&format!("G10 L2 P{frame} X{x} Y{y} Z{z}"));
        }
        self.put(&name(self.frame));
        Ok(())
    }

    fn length(&mut self, numbers: [f64; 9]) -> Result<(), Refusal> {
        let length_mm = numbers[2] * self.unit_mm;
        if numbers.iter().enumerate().any(|(i, v)| i != 2 && *v != 0.0) {
            return Err("only tool offsets along Z are supported".into());
        }
        if length_mm != self.length_mm {
            let z_mm = self.implied_z_mm.unwrap_or(self.last[2]);
            (self.implied_z_mm, self.last[2]) = (Some(z_mm + self.length_mm - length_mm), UNKNOWN);
            self.length_mm = length_mm;
        }
        if length_mm == 0.0 && !(self.says("G43") && self.setup.tools.with_length(self.tool, 0.0, 0.0).is_some()) {
            self.put("G49");
            return Ok(());
        }
        let tool = self.setup.tools.with_length(self.tool, length_mm, LENGTH_TOLERANCE_MM).ok_or_else(|| {
            format!("a tool length of {length_mm:.6} mm is that of no tool of --tools: of tool lengths G43 H and G49 are supported")
        })?;
        self.put(&format!("G43 H{tool}"));
        Ok(())
    }

    /// A place without offsets but the work frame's, in the program's unit.
    fn in_frame(&self, [x, y, z, a, b, c]: [f64; 6]) -> [f64; 6] {
        let mut point = [x, y, z];
        for (v, shift) in point.iter_mut().zip(self.shift_mm) {
            *v += shift / self.unit_mm;
        }
        if self.turn_rad != 0.0 {
            let ((s, co), [x, y, _]) = (self.turn_rad.sin_cos(), point);
            (point[0], point[1]) = (x * co - y * s, x * s + y * co);
        }
        [point[0], point[1], point[2], a, b, c]
    }

    fn in_machine(&self, place: [f64; 6]) -> [f64; 6] {
        let origin = self.frames_mm[self.frame].unwrap_or_default();
        std::array::from_fn(|i| if i < 3 { place[i] * self.unit_mm + origin[i] } else { place[i] })
    }

    fn straight(&mut self, motion: &'static str, to: &[f64; 6]) -> Result<(), Refusal> {
        self.check_reference()?;
        if self.has_word("G74") || self.has_word("G84") {
            return Err(COUPLED.into());
        }
        let to = self.in_frame(*to);
        let there = self.in_machine(to);
        let stays = (0..6).all(|i| there[i] == self.last[i] || !is_known(there[i]) && !is_known(self.last[i]));
        let mut words = Vec::new();
        if stays || !self.reach(there, &to, &mut words)? {
            return Ok(());
        }
        self.go(motion, words, String::new());
        Ok(())
    }

    fn arc(&mut self, numbers: &[f64; 9]) -> Result<(), Refusal> {
        let [first_end, second_end, first_center, second_center, turns, along, a, b, c] = *numbers;
        let [first, second, third] = self.plane;
        let (mut end, mut center) = ([0.0, 0.0, 0.0, a, b, c], [0.0; 6]);
        (end[first], end[second], end[third]) = (first_end, second_end, along);
        (center[first], center[second], center[third]) = (first_center, second_center, along);
        let (to, center) = (self.in_frame(end), self.in_machine(self.in_frame(center)));
        let from = self.last;
        let mut words = Vec::new();
        self.reach(self.in_machine(to), &to, &mut words)?;
        let offset = |i: usize| format!("{}{}", ['I', 'J', 'K'][i], (center[i] - from[i]) / self.unit_mm);
        let more = format!(" {} {} P{}", offset(first), offset(second), turns.abs());
        self.go(if turns < 0.0 { "G2" } else { "G3" }, words, more);
        Ok(())
    }

    /// The words of a place, and whether there are any.
    fn reach(&mut self, mut there: [f64; 6], to: &[f64; 6], words: &mut Vec<String>) -> Result<bool, Refusal> {
        match self.implied_z_mm {
            Some(z_mm) if (there[2] - z_mm).abs() < ORIGIN_TOLERANCE_MM => there[2] = UNKNOWN,
            _ => self.implied_z_mm = None,
        }
        for (i, letter) in "XYZABC".chars().enumerate() {
            if is_known(there[i]) {
                words.push(format!("{letter}{}", to[i]));
            } else if is_known(self.last[i]) {
                return Err(format!("{letter} goes to a place that is not known here"));
            }
        }
        self.last = there;
        Ok(!words.is_empty())
    }

    fn go(&mut self, motion: &'static str, words: Vec<String>, more: String) {
        let is_cut = motion != "G0";
        let feed = self.feed.filter(|_| is_cut).map(|feed| format!(" F{feed}")).unwrap_or_default();
        if is_cut {
            self.feed = None;
        }
        let motion = if std::mem::replace(&mut self.motion, motion) == motion { "" } else { motion };
        self.put(format!("{motion} {}{more}{feed}", words.join(" ")).trim_start());
        self.until_move = [self.expanded.text.len(), self.expanded.lines.len()];
    }

    /// Refuses what moves to places of the machine that are not known.
    fn check_reference(&self) -> Result<(), Refusal> {
        let all_axes = !self.code.contains(['X', 'Y', 'Z']);
        let is_head = self.setup.head.is_some_and(|head| !head.letters().is_empty());
        for (word, reference) in ["G28", "G30"].into_iter().zip(self.setup.offsets.references) {
            if self.says(word) && self.code.contains(word) && (reference.is_none() || (all_axes && is_head)) {
                return Err(format!(
                    "{word} goes to a place that is not known here: give `{word} = [x, y, z, a, b]` under [offsets] of a --job, and name the axes"
                ));
            }
        }
        if self.length_mm != 0.0 && ["G28", "G30", "G53"].iter().any(|word| self.says(word)) {
            return Err(
                "G28, G30 and G53 with a tool length in force: whether they move the tip or the flange differs from control to control; \
                 cancel it with G49 before this line"
                    .into(),
            );
        }
        Ok(())
    }

    /// M2, M30: what they reset needs no words.
    fn end(&mut self) {
        let [text, lines] = self.until_move;
        self.expanded.text.truncate(text);
        self.expanded.lines.truncate(lines);
        self.put(if self.code.contains("M30") { "M30" } else { "M2" });
        self.has_ended = true;
    }
}

#[cfg(test)]
#[path = "canonical_tests.rs"]
mod tests;

//! A program written with other places, line by line beside the original.

use super::modal::{Form, Style};
use super::motions::TurnFeed;
use super::words::{Line, Word, apart, without_switch};
use super::{Content, Program, TextAt, turned};
use crate::path::{NO_WAY_M, Place, Toward};

/// What stops program, spindle or coolant on the line of a move: it comes behind the move.
const STOPS: [f64; 7] = [0.0, 1.0, 2.0, 5.0, 9.0, 30.0, 60.0];
/// A turn of 1° counts as at least this way of the tip, m: the edge of a tool of 11 mm goes as far.
const WAY_OF_TURN_M_PER_DEG: f64 = 1e-4;

/// A move's new places.
struct Written {
    places: Vec<Place>,
    /// The first is where it begins, see [`Point::is_begin`](crate::tool_path::Point::is_begin).
    begins: bool,
}

/// F of a line in G93, as it was given or as the feed of a turn asks for.
#[derive(Clone, Copy)]
struct InverseTime {
    /// Of the whole line, 1/min.
    per_min: f64,
    /// What comes back into force after the line.
    then: Option<TurnFeed>,
}

/// A program that is written with other places, move by move, in the order in which they are made.
pub struct Writer<'a> {
    text: String,
    lines: Vec<&'a str>,
    program: &'a Program,
    /// The block that comes next, and its first move.
    block: usize,
    first: usize,
    /// Places of that block's moves so far.
    places: Vec<Written>,
    /// The last line of a `%` and a program's number at the beginning, and where in the text the notes go: behind it.
    head_line: Option<usize>,
    head: usize,
    /// Whether the motion in force is rapid, if it is one of G0 and G1.
    rapid: Option<bool>,
    /// Where the tool was sent last, in the program's axes.
    last: Option<Place>,
}

impl Program {
    /// The program to be written with other places.
    pub fn writer(&self) -> Writer<'_> {
        let source = self.source.text().unwrap_or_default();
        let lines: Vec<&str> = source.lines().collect();
        let is_head = |l: &str| {
            l.trim() == "%"
                || Line::parse(l).is_ok_and(|l| l.words.is_empty() && l.label.is_some_and(|o| o.keyword.is_empty()))
        };
        let said = || lines.iter().enumerate().filter(|(_, l)| !l.trim().is_empty());
        let mut writer = Writer {
            text: String::with_capacity(2 * source.len()),
            head_line: said().take_while(|(_, l)| is_head(l)).map(|(n, _)| n).last(),
            lines,
            program: self,
            block: 0,
            first: 0,
            places: Vec::new(),
            head: 0,
            rapid: None,
            last: None,
        };
        writer.write_complete();
        writer
    }
}

/// Whether a G word is a motion that is written as G0 and G1 instead.
fn is_replaced(word: &Word<'_>) -> bool {
    word.is('G', &[2.0, 3.0, 73.0, 81.0, 82.0, 83.0])
}

/// Words that call a subprogram or end one.
fn calls(line: &Line<'_>, word: &Word<'_>) -> bool {
    let called = line.words.iter().any(|w| w.is('M', &[98.0]));
    word.is('M', &[98.0, 99.0]) || (called && "PL".contains(word.letter))
}

impl Writer<'_> {
    /// The next move's places, several where it was divided. `begins`: the first is where it begins.
    pub fn push(&mut self, places: Vec<Place>, begins: bool) {
        self.places.push(Written { places, begins });
        self.write_complete();
    }

    /// The new program, with notes at its head.
    pub fn finish(self, notes: &[String]) -> String {
        let head: String = notes.iter().map(|note| format!("({})\n", note.replace(['(', ')'], ""))).collect();
        let mut text = self.text;
        text.insert_str(self.head, &head);
        // with the line ends of the program
        if self.program.source.text().is_ok_and(|own| own.contains("\r\n")) { text.replace('\n', "\r\n") } else { text }
    }

    /// Writes the blocks that have all of their places.
    fn write_complete(&mut self) {
        while let Some(block) = self.program.blocks.get(self.block) {
            let count = if let Content::Moves { count, .. } = block.content { count as usize } else { 0 };
            if self.places.len() < count {
                return;
            }
            let program = self.program;
            let text: &str = match block.text {
                TextAt::Line(index) => self.lines[index as usize],
                TextAt::Expanded(index) => &program.expanded[index as usize],
            };
            // it was read before, and so it is readable
            match (block.content, Line::parse(text)) {
                (Content::Note, _) => self.note(text),
                (Content::Text, Ok(line)) => self.pass(&line),
                (Content::Call, Ok(line)) => self.call(&line),
                (Content::Moves { style, .. }, Ok(line)) => {
                    let places = std::mem::take(&mut self.places);
                    self.moves(&line, &self.program.styles[style as usize], self.first, &places);
                    self.first += count;
                }
                (_, Err(_)) => {}
            }
            if self.head_line.is_some_and(|line| block.text == TextAt::Line(line as u32)) {
                self.head = self.text.len();
            }
            self.block += 1;
        }
    }

    /// The line as a comment.
    fn note(&mut self, text: &str) {
        if let Ok((code, _)) = apart(without_switch(text).1) {
            self.put(&format!("({})", code.replace(['(', ')'], "")));
        }
    }

    fn put(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn pass(&mut self, line: &Line<'_>) {
        self.note_motion(line);
        self.put(line.text);
    }

    /// What the motion in force is after a line that is written as it stands.
    fn note_motion(&mut self, line: &Line<'_>) {
        for word in line.words.iter().filter(|w| w.letter == 'G') {
            match word.value {
                0.0 => self.rapid = Some(true),
                1.0 => self.rapid = Some(false),
                80.0 => self.rapid = None,
                _ if is_replaced(word) => self.rapid = None,
                _ => {}
            }
        }
    }

    fn call(&mut self, line: &Line<'_>) {
        self.note_motion(line);
        let (gone, kept): (Vec<_>, Vec<_>) = line.words.iter().partition(|w| calls(line, w));
        let shown = |words: &[&Word<'_>]| words.iter().map(|w| w.shown()).collect::<Vec<_>>().join(" ");
        let mut parts = vec![shown(&kept), format!("({})", shown(&gone))];
        parts.extend(line.comments.iter().map(|c| (*c).to_owned()));
        self.put(parts.join(" ").trim_start());
    }

    /// F of a line whose parts need one each. Where the tool only turned, and F is ° a minute or a turn, the compensated tip also moves a
    /// little, so that a control would take F as mm.
    fn inverse_time(&self, line: &Line<'_>, style: &Style, first: usize) -> Option<InverseTime> {
        if style.inverse_time {
            let per_min = line.words.iter().find(|w| w.letter == 'F')?.value;
            return Some(InverseTime { per_min, then: None });
        }
        let moves = self.program.moves.get(first.checked_sub(1)?..=first).filter(|_| style.form == Form::Straight)?;
        let [before, mv] = moves else { return None };
        let feed = style.turn_feed.filter(|_| mv.is_loaded() && !mv.is_fresh)?;
        let turn_deg = before.to.turned_alone_deg(&mv.to)?;
        Some(InverseTime { per_min: feed.deg_per_min / turn_deg, then: Some(feed) })
    }

    /// F of a place in G93, where each of a line's parts has a share of its time. `next`: the first part's end, where the place is where the
    /// cut begins. The small move there goes as fast as that part. The tip hardly moves where this turns the tool, so that its edges' way
    /// counts as well; and there the move takes no longer than the whole cut.
    fn part_per_min(&self, whole: f64, parts: f64, place: &Place, next: Option<&Place>) -> f64 {
        let part = whole * parts;
        let Some((last, next)) = self.last.zip(next) else { return part };
        let last = turned(&last, |v| self.program.axes.to_base(v));
        let counted_m =
            |[path_length_m, turn_rad]: [f64; 2]| path_length_m.max(turn_rad.to_degrees() * WAY_OF_TURN_M_PER_DEG);
        let ahead = place.apart(next);
        let [to_m, ahead_m] = [last.apart(place), ahead].map(counted_m);
        if to_m <= NO_WAY_M || ahead_m <= NO_WAY_M {
            return part;
        }
        let per_min = part * ahead_m / to_m;
        if ahead_m > ahead[0] { per_min.max(whole) } else { per_min }
    }

    fn moves(&mut self, line: &Line<'_>, style: &Style, first: usize, moves: &[Written]) {
        let form = style.form;
        if let Form::Reference { named } = form {
            self.pass(line);
            self.reach_reference(moves, named);
            return;
        }
        let motion_words = match form {
            Form::Straight | Form::Reference { .. } => "",
            Form::Arc => "RP",
            Form::Drill { .. } => "RPQLK",
        };
        let inverse_time = self.inverse_time(line, style, first);
        let returns = inverse_time.is_some_and(|f| f.then.is_some());
        let rotary = self.program.head.map_or("AB", |h| h.letters());
        let goes = |w: &Word<'_>| {
            "XYZIJK".contains(w.letter)
                || rotary.contains(w.letter)
                || motion_words.contains(w.letter)
                || is_replaced(w)
                || (form != Form::Straight && w.is('G', &[80.0]))
                || calls(line, w)
                || (inverse_time.is_some() && w.letter == 'F')
                || (returns && w.is('G', &[94.0, 95.0]))
        };
        let kept: Vec<&Word<'_>> = line.words.iter().filter(|w| !goes(w)).collect();
        let (stops, kept): (Vec<&Word<'_>>, Vec<&Word<'_>>) = kept.into_iter().partition(|w| w.is('M', &STOPS));
        let mut words: Vec<String> = kept.iter().map(|w| w.shown()).collect();
        for word in kept.iter().filter(|w| w.is('G', &[0.0, 1.0])) {
            self.rapid = Some(word.value == 0.0);
        }
        let comments = line.comments.join(" ");
        if returns {
            words.push("G93".to_owned());
        }
        let (mut is_first, points) = (true, moves.iter().map(|m| m.places.len()).sum::<usize>());
        let parts = points - moves.iter().filter(|m| m.begins).count();
        let mut left = points;
        for (n, Written { places, begins }) in moves.iter().enumerate() {
            let rapid = self.program.moves[first + n].is_rapid;
            for (k, place) in places.iter().enumerate() {
                let is_begin = *begins && k == 0;
                let next = places.get(k + 1).filter(|_| is_begin);
                let part_per_min = inverse_time
                    .filter(|_| !rapid)
                    .map(|feed| self.part_per_min(feed.per_min, parts as f64, place, next));
                if style.in_machine && !is_first {
                    words.push("G53".to_owned());
                }
                if self.rapid.replace(rapid) != Some(rapid) {
                    words.push(if rapid { "G0" } else { "G1" }.to_owned());
                }
                self.push_place(place, style, &mut words);
                words.extend(part_per_min.map(|f| format!("F{}", number(f, 6))));
                left -= 1;
                if left == 0 {
                    words.extend(stops.iter().map(|w| w.shown()));
                }
                if is_first && !comments.is_empty() {
                    words.push(comments.clone());
                }
                is_first = false;
                self.put(&words.join(" "));
                words.clear();
            }
            if let Form::Drill { dwell: Some(dwell) } = form
                && !rapid
            {
                self.put(&format!("G4 P{}", number(dwell, 6)));
            }
        }
        if let Some(TurnFeed { mode, word, .. }) = inverse_time.and_then(|f| f.then) {
            self.put(&format!("{mode} F{}", number(word, 6)));
        }
        // a cycle that is only named, L0
        if points == 0 && !(words.is_empty() && comments.is_empty()) {
            words.push(comments);
            self.put(words.join(" ").trim_end());
        }
    }

    /// A line that goes to a reference point has moved the named axes there, and left the others.
    fn reach_reference(&mut self, moves: &[Written], named: [bool; 5]) {
        let Some(there) = moves.last().and_then(|m| m.places.last()).map(|p| self.in_program(p)) else { return };
        let last = self.last.get_or_insert(there);
        for i in (0..3).filter(|i| named[*i]) {
            last.tip_m[i] = there.tip_m[i];
        }
        match (&mut last.toward, &there.toward) {
            (Toward::Wrist(last), Toward::Wrist(there)) | (Toward::Head(_, last), Toward::Head(_, there)) => {
                for i in (0..2).filter(|i| named[3 + i]) {
                    last[i] = there[i];
                }
            }
            (last, there) => *last = *there,
        }
    }

    fn in_program(&self, place: &Place) -> Place {
        turned(place, |v| self.program.axes.of_base(v))
    }

    /// The words of a place.
    fn push_place(&mut self, place: &Place, style: &Style, words: &mut Vec<String>) {
        let place = self.in_program(place);
        let before = self.last.replace(place).filter(|_| style.incremental);
        let length_decimals = if style.unit_mm == 1.0 { 6 } else { 7 };
        let coordinate = |place: &Place, i: usize| (place.tip_m[i] * 1e3 - style.origin_mm[i]) / style.unit_mm;
        // both rounded, so that increments do not add up to an error
        let since = |now: f64, before: Option<f64>, decimals: usize| match before {
            Some(before) => round(now, decimals) - round(before, decimals),
            None => now,
        };
        for (i, letter) in "XYZ".chars().enumerate() {
            let value = since(coordinate(&place, i), before.map(|b| coordinate(&b, i)), length_decimals);
            words.push(format!("{letter}{}", number(value, length_decimals)));
        }
        let (letters, angles, before) = match (place.toward, before.map(|b| b.toward)) {
            (Toward::Axis(axis), _) => {
                words.extend("IJK".chars().zip(axis).map(|(letter, v)| format!("{letter}{}", number(v, 9))));
                return;
            }
            (Toward::Wrist(now), Some(Toward::Wrist(before))) => ("AB", now, Some(before)),
            (Toward::Wrist(now), _) => ("AB", now, None),
            (Toward::Head(head, now), Some(Toward::Head(_, before))) => (head.letters(), now, Some(before)),
            (Toward::Head(head, now), _) => (head.letters(), now, None),
        };
        for (i, letter) in letters.chars().enumerate() {
            let value = since(angles[i].to_degrees(), before.map(|b| b[i].to_degrees()), 8);
            words.push(format!("{letter}{}", number(value, 8)));
        }
    }
}

fn round(value: f64, decimals: usize) -> f64 {
    let unit = 10_f64.powi(decimals as i32);
    (value * unit).round() / unit
}

/// A number as it stands in a program, and without trailing zeros.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

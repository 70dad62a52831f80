//! The order in which a control takes a program's lines: subprograms, repeats, block delete, the end.

use std::collections::HashMap;

use super::Refusal;
use super::words::{Label, Line, same_number};

/// Most subprograms inside each other, as Fanuc and LinuxCNC have it.
const MAX_DEPTH: usize = 10;
/// Most lines that a program may have when its subprograms are written out.
const MAX_LINES: usize = 5_000_000;

/// Where the reader is, and where it came from.
pub(super) struct Flow<'a> {
    lines: Vec<&'a str>,
    /// First line of each subprogram, after `O100` or `o100 sub`.
    starts: HashMap<&'a str, usize>,
    stack: Vec<Frame<'a>>,
    next: usize,
    taken: usize,
    /// M2 or M30 was read: nothing moves any more.
    ended: bool,
    /// Some words were read already.
    begun: bool,
}

/// A subprogram or a repeat that is being gone through.
struct Frame<'a> {
    name: &'a str,
    kind: Kind,
    start: usize,
    /// Times to come after this one.
    left: u32,
    /// Where to go on.
    back: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// `O100` … `M99`
    Numbered,
    /// `o100 sub` … `o100 endsub`
    Named,
    /// `o100 repeat [n]` … `o100 endrepeat`
    Repeat,
}

/// What is done with a line.
#[derive(PartialEq)]
pub(super) enum Order {
    /// Its words are carried out.
    Do,
    /// Goes unchanged into the new program.
    Pass,
    /// Is not written: it only said which line is next.
    Drop,
}

impl<'a> Flow<'a> {
    pub fn new(text: &'a str) -> Self {
        let lines: Vec<&str> = text.lines().collect();
        let mut starts = HashMap::new();
        for (index, line) in lines.iter().enumerate().filter(|(_, l)| l.trim_start().starts_with(['O', 'o'])) {
            if let Ok(Line { label: Some(label), .. }) = Line::parse(line)
                && (label.keyword.is_empty() || label.keyword == "sub")
            {
                starts.entry(label.name).or_insert(index + 1);
            }
        }
        Self { lines, starts, stack: Vec::new(), next: 0, taken: 0, ended: false, begun: false }
    }

    /// The next line's index and text.
    pub fn next(&mut self) -> Option<(usize, &'a str)> {
        let text = self.lines.get(self.next)?;
        self.next += 1;
        self.taken += 1;
        Some((self.next - 1, text))
    }

    /// What is done with a line; O words take their effect.
    pub fn order(&mut self, line: &Line<'a>, leave_out_deletable: bool) -> Result<Order, Refusal> {
        if self.taken > MAX_LINES {
            return Err(format!("more than {MAX_LINES} lines with subprograms and repeats written out"));
        }
        if self.ended {
            return Ok(if line.is_silent() { Order::Pass } else { Order::Drop });
        }
        if line.deletable && leave_out_deletable {
            return Ok(Order::Drop);
        }
        match &line.label {
            None => {
                self.begun |= !line.words.is_empty();
                Ok(Order::Do)
            }
            Some(label) if line.words.is_empty() => self.label(label),
            Some(label) => Err(format!("O{}: expected nothing but a comment behind it", label.name)),
        }
    }

    fn label(&mut self, label: &Label<'a>) -> Result<Order, Refusal> {
        let name = label.name;
        let innermost = self.stack.last().filter(|f| f.name == name).map(|f| f.kind);
        match label.keyword.as_str() {
            "" if !self.begun && self.stack.is_empty() => return Ok(Order::Pass),
            "" => {
                let message = format!(
                    "O{name}: another program begins, and the one before has not ended: M30 ends a main program, M99 a \
                     subprogram"
                );
                return Err(message);
            }
            // a definition is passed over until it is called
            "sub" => self.next = self.after(label, "endsub")?,
            "call" if label.argument.is_empty() => self.call(name, Kind::Named, 1)?,
            "call" => {
                return Err(format!(
                    "O{name}: a call with arguments is not supported: write the subprogram's moves out"
                ));
            }
            "endsub" if innermost == Some(Kind::Named) => self.close(),
            "return" if self.stack.iter().any(|f| f.kind == Kind::Named) => {
                self.stack.truncate(self.stack.iter().rposition(|f| f.kind == Kind::Named).map_or(0, |i| i + 1));
                self.close();
            }
            "repeat" => {
                let count = label.argument.strip_prefix('[').and_then(|a| a.strip_suffix(']'));
                let Some(count) = count.and_then(|count| count.trim().parse::<u32>().ok()) else {
                    let message = format!(
                        "O{name} repeat: expected a whole number, such as [3]: parameters and expressions are not supported"
                    );
                    return Err(message);
                };
                let back = self.after(label, "endrepeat")?;
                match count.checked_sub(1) {
                    None => self.next = back,
                    Some(left) => self.open(Frame { name, kind: Kind::Repeat, start: self.next, left, back })?,
                }
            }
            "endrepeat" if innermost == Some(Kind::Repeat) => self.close(),
            keyword => {
                let known = "known are sub, endsub, call, return, repeat and endrepeat";
                return Err(format!("O{name} {keyword} is not supported here: {known}; write the moves out"));
            }
        }
        self.begun = true;
        Ok(Order::Drop)
    }

    /// The line behind the one that closes what a label opens.
    fn after(&self, label: &Label<'_>, keyword: &str) -> Result<usize, Refusal> {
        let closes = |text: &str| {
            text.trim_start().starts_with(['O', 'o'])
                && Line::parse(text)
                    .is_ok_and(|l| l.label.is_some_and(|l| l.name == label.name && l.keyword == keyword))
        };
        let found = self.lines[self.next..].iter().position(|text| closes(text));
        let missing = || format!("O{} {}: `O{} {keyword}` is missing", label.name, label.keyword, label.name);
        found.map(|n| self.next + n + 1).ok_or_else(missing)
    }

    fn open(&mut self, frame: Frame<'a>) -> Result<(), Refusal> {
        if self.stack.len() >= MAX_DEPTH {
            return Err(format!("more than {MAX_DEPTH} subprograms and repeats inside each other"));
        }
        self.next = frame.start;
        self.stack.push(frame);
        Ok(())
    }

    fn call(&mut self, name: &str, kind: Kind, times: u32) -> Result<(), Refusal> {
        let Some((name, start)) = self.starts.get_key_value(name).map(|(name, start)| (*name, *start)) else {
            return Err(format!("O{name} is not in this file: put the subprogram's lines behind the main program"));
        };
        match times.checked_sub(1) {
            None => Ok(()),
            Some(left) => self.open(Frame { name, kind, start, left, back: self.next }),
        }
    }

    /// The end of the innermost subprogram or repeat: once more, or back.
    fn close(&mut self) {
        let Some(frame) = self.stack.last_mut() else { return };
        match frame.left.checked_sub(1) {
            Some(left) => (frame.left, self.next) = (left, frame.start),
            None => {
                self.next = frame.back;
                self.stack.pop();
            }
        }
    }

    /// `M98 P L`. Fanuc also writes the number of times before four digits of the program's number: `P31000`.
    pub fn m98(&mut self, program: Option<f64>, times: Option<f64>) -> Result<(), Refusal> {
        let whole = |v: f64| (v.fract() == 0.0 && (0.0..1e8).contains(&v)).then_some(v as u32);
        let Some(program) = program.and_then(whole) else {
            return Err("M98: expected P with a subprogram's number".into());
        };
        let Some(times) = times.map_or(Some(1), whole) else {
            return Err("M98: expected L with a whole number of times".into());
        };
        let known = |number: u32| self.starts.contains_key(number.to_string().as_str());
        let (program, times) = match program {
            p if p > 9999 && times == 1 && !known(p) => (p % 10_000, p / 10_000),
            p => (p, times),
        };
        self.call(same_number(&program.to_string()), Kind::Numbered, times)
    }

    /// `M99`: the end of a numbered subprogram.
    pub fn m99(&mut self) -> Result<(), Refusal> {
        match self.stack.last().map(|f| f.kind) {
            Some(Kind::Numbered) => {
                self.close();
                Ok(())
            }
            Some(_) => Err("M99 inside a repeat or an `O… sub`".into()),
            None => Err("M99 in the main program repeats it without end: end it with M30".into()),
        }
    }

    /// `M2`, `M30`: the lines behind it are never reached.
    pub fn end(&mut self, index: usize) {
        let main = self.stack.first().map_or(index + 1, |f| f.back);
        self.stack.clear();
        (self.ended, self.next) = (true, main);
    }

    /// The end of the file inside of a subprogram.
    pub fn unfinished(&self) -> Option<String> {
        self.stack.last().map(|f| format!("O{}: the file ends inside this subprogram", f.name))
    }
}

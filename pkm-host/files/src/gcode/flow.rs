//! The order in which a control takes a program's lines: subprograms, conditions, loops, block delete, the end.

use super::Refusal;
use super::expressions::Values;
use super::outline::{self, Outline, Part};
use super::parameters::{ARGUMENTS, Parameters};
use super::words::{Label, Line, iso_number, same_number};

/// Most subprograms inside each other, as Fanuc and LinuxCNC have it.
const MAX_DEPTH: usize = 10;
/// Most lines that a program may have when its subprograms and loops are written out.
const MAX_LINES: usize = 5_000_000;
/// Most lines without a move, beyond those of the file: what computes for longer goes on for ever.
const MAX_IDLE: usize = 200_000;

/// Where the reader is, where it came from, and what the parameters hold.
pub(super) struct Flow<'a> {
    lines: Vec<&'a str>,
    outline: Outline,
    stack: Vec<Frame>,
    pub parameters: Parameters,
    next: usize,
    taken: usize,
    /// How many were taken when the last move was made.
    moved: usize,
    /// M2, M30 or a second `%` was read: nothing moves any more.
    ended: bool,
    /// The line, from 1, of the `%` that ended the program where no M2 or M30 did.
    percent: Option<usize>,
    /// Some words were read already.
    begun: bool,
    /// No branch has held of the `if` that is gone through: the next one is tried.
    seeks: bool,
}

/// A subprogram or a repeat that is being gone through.
struct Frame {
    kind: Kind,
    /// Its first line.
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
    /// Is not written: the control never comes to it.
    Drop,
    /// Becomes a comment: it only said which line is next.
    Note,
}

impl<'a> Flow<'a> {
    /// The program from its beginning, or a line that belongs to no other.
    pub fn new(text: &'a str) -> Result<Self, (usize, Refusal)> {
        let lines: Vec<&str> = text.lines().collect();
        let outline = Outline::of(&lines)?;
        let (stack, parameters) = (Vec::new(), Parameters::default());
        Ok(Self {
            lines,
            outline,
            stack,
            parameters,
            next: 0,
            taken: 0,
            moved: 0,
            ended: false,
            percent: None,
            begun: false,
            seeks: false,
        })
    }

    /// The next line's index and text.
    pub fn next(&mut self) -> Option<(usize, &'a str)> {
        let text = self.lines.get(self.next)?;
        self.next += 1;
        self.taken += 1;
        Some((self.next - 1, text))
    }

    /// The line that was taken moves the tool.
    pub fn moves(&mut self) {
        self.moved = self.taken;
    }

    /// Whether the program has ended: the control reads no further.
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// The line, from 1, of a `%` that ended the program before M2 or M30 did.
    pub fn percent(&self) -> Option<usize> {
        self.percent
    }

    /// Whether a line with words is left out.
    pub fn leaves_out(&self, deletable: bool, leave_out_deletable: bool) -> bool {
        deletable && leave_out_deletable
    }

    /// What is done with a line; O words take their effect.
    pub fn order(&mut self, line: &Line<'_>, leave_out_deletable: bool) -> Result<Order, Refusal> {
        if self.taken > MAX_LINES {
            return Err(format!(
                "more than {MAX_LINES} lines with subprograms and loops written out: does a loop end? Else divide the program"
            ));
        }
        if self.taken - self.moved >= self.lines.len() + MAX_IDLE {
            return Err(format!(
                "nothing moves in {MAX_IDLE} lines with subprograms and loops written out: does a loop end?"
            ));
        }
        if line.text.trim() == "%" && self.begun && self.stack.is_empty() {
            self.percent = Some(self.next);
            self.end();
        }
        if self.leaves_out(line.deletable, leave_out_deletable) {
            return Ok(Order::Drop);
        }
        match &line.label {
            None => {
                self.begun |= !line.words.is_empty();
                Ok(Order::Do)
            }
            // no keyword is a single letter
            Some(label) if label.keyword.len() == 1 => {
                Err(format!("O{}: words behind a program's number: put it on a line of its own", label.name))
            }
            Some(label) if line.words.is_empty() => {
                let order = self.label(label).map_err(|why| {
                    let space = if label.keyword.is_empty() { "" } else { " " };
                    format!("O{}{space}{}: {why}", label.name, label.keyword)
                });
                self.begun |= !matches!(order, Ok(Order::Pass));
                order
            }
            Some(label) => Err(format!("O{}: expected nothing but a comment behind it", label.name)),
        }
    }

    /// Carries an O word out.
    fn label(&mut self, label: &Label<'_>) -> Result<Order, Refusal> {
        match label.keyword.as_str() {
            "" if !self.begun && self.stack.is_empty() => {
                nothing_behind(label.argument)?;
                return Ok(Order::Pass);
            }
            "" => {
                return Err("another program begins, and the one before has not ended: M30 ends a main program, M99 a subprogram"
                    .into());
            }
            "call" => {
                let arguments = self.arguments(label.argument)?;
                self.call(&label.name, Kind::Named, 1)?;
                self.parameters.enter(&arguments);
                return Ok(Order::Note);
            }
            "return" => {
                let Some(of) = self.stack.iter().rposition(|f| f.kind == Kind::Named) else {
                    return Err("no `sub` around it".into());
                };
                let value = self.returned(label.argument)?;
                self.stack.truncate(of + 1);
                self.close(value);
                return Ok(Order::Note);
            }
            _ => {}
        }
        let Some(part) = self.outline.part(self.next - 1) else {
            return Err("not supported here; known are sub, endsub, call, return, if, elseif, else, endif, while, endwhile, do, break, \
                        continue, repeat and endrepeat, without `/`"
                .into());
        };
        self.part(label, part)
    }

    /// Carries out the O word of a block.
    fn part(&mut self, label: &Label<'_>, part: Part) -> Result<Order, Refusal> {
        let innermost = self.stack.last().filter(|f| f.start == part.opens + 1).map(|f| f.kind);
        let argument = label.argument;
        match (label.keyword.as_str(), part.kind) {
            // a definition is passed over until it is called
            ("sub", _) => {
                self.next = part.closes + 1;
                return Ok(Order::Drop);
            }
            ("endsub", _) if innermost == Some(Kind::Named) => {
                let value = self.returned(argument)?;
                self.close(value);
            }
            ("repeat", _) => {
                let count = self.condition(argument)?.round();
                let back = part.closes + 1;
                if count < 1.0 {
                    self.next = back;
                } else {
                    let left = count.min(f64::from(u32::MAX)) as u32 - 1;
                    self.open(Frame { kind: Kind::Repeat, start: self.next, left, back })?;
                }
            }
            ("endrepeat", _) if innermost == Some(Kind::Repeat) => self.close(None),
            ("if", _) => self.branch(argument, part)?,
            ("elseif", _) if self.seeks => self.branch(argument, part)?,
            // the end of a branch that was taken
            ("elseif", _) => self.next = part.closes + 1,
            ("while", outline::Kind::Do) => {
                if self.condition(argument)? != 0.0 {
                    self.next = part.opens + 1;
                }
            }
            ("while", _) => {
                if self.condition(argument)? == 0.0 {
                    self.next = part.closes + 1;
                }
            }
            (keyword, kind) => {
                nothing_behind(argument)?;
                let seeks = std::mem::take(&mut self.seeks);
                match keyword {
                    "else" if !seeks => self.next = part.closes + 1,
                    "endwhile" => self.next = part.opens,
                    "break" => self.leap(part, part.closes + 1),
                    "continue" if kind == outline::Kind::Do => self.leap(part, part.closes),
                    "continue" => self.leap(part, part.opens),
                    "else" | "endif" | "do" => {}
                    _ => return Err("the program comes here without its beginning".into()),
                }
            }
        }
        Ok(Order::Note)
    }

    /// `if` or `elseif`: on, or to the block's next O word.
    fn branch(&mut self, condition: &str, part: Part) -> Result<(), Refusal> {
        self.seeks = self.condition(condition)? == 0.0;
        if self.seeks {
            self.next = part.next;
        }
        Ok(())
    }

    /// Out of the middle of a loop: repeats inside of it end.
    fn leap(&mut self, part: Part, to: usize) {
        let inside = |f: &Frame| f.kind == Kind::Repeat && (part.opens..part.closes).contains(&f.start);
        while self.stack.last().is_some_and(inside) {
            self.stack.pop();
        }
        self.next = to;
    }

    /// `[#1 LT 5]`, and nothing behind it.
    fn condition(&self, text: &str) -> Result<f64, Refusal> {
        let mut values = Values::new(text, &self.parameters);
        let value = values.bracketed()?;
        nothing_behind(values.rest)?;
        Ok(value)
    }

    /// What a subroutine returns.
    fn returned(&self, text: &str) -> Result<Option<f64>, Refusal> {
        if text.is_empty() { Ok(None) } else { self.condition(text).map(Some) }
    }

    /// `[1] [#2]` …
    fn arguments(&self, text: &str) -> Result<Vec<f64>, Refusal> {
        let mut values = Values::new(text, &self.parameters);
        let mut arguments = Vec::new();
        while values.first().is_some() {
            arguments.push(values.bracketed()?);
        }
        if arguments.len() > ARGUMENTS {
            return Err(format!("more than {ARGUMENTS} arguments"));
        }
        Ok(arguments)
    }

    fn open(&mut self, frame: Frame) -> Result<(), Refusal> {
        if self.stack.len() >= MAX_DEPTH {
            return Err(format!(
                "more than {MAX_DEPTH} subprograms and repeats inside each other: does one call itself without end?"
            ));
        }
        self.next = frame.start;
        self.stack.push(frame);
        Ok(())
    }

    fn call(&mut self, name: &str, kind: Kind, times: u32) -> Result<(), Refusal> {
        let Some(start) = self.outline.starts.get(name).copied() else {
            let iso = self.lines.iter().map(|line| iso_number(line));
            if let Some((line, Some(digits))) = (1..).zip(iso).find(|(_, n)| n.is_some_and(|n| same_number(n) == name))
            {
                return Err(format!("O{name} is not in this file: line {line} has it as `:{digits}`: write O{digits}"));
            }
            return Err(format!(
                "O{name} is not in this file: put the subprogram's lines behind the main program, or have LinuxCNC's interpreter find \
                 its file (--interpreter rs274)"
            ));
        };
        match times.checked_sub(1) {
            None => Ok(()),
            Some(left) => self.open(Frame { kind, start, left, back: self.next }),
        }
    }

    /// The end of the innermost subprogram or repeat: once more, or back, from a subroutine with what it returns.
    fn close(&mut self, value: Option<f64>) {
        let Some(frame) = self.stack.last_mut() else { return };
        match frame.left.checked_sub(1) {
            Some(left) => (frame.left, self.next) = (left, frame.start),
            None => {
                self.next = frame.back;
                if frame.kind == Kind::Named {
                    self.parameters.leave(value);
                }
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
        let known = |number: u32| self.outline.starts.contains_key(number.to_string().as_str());
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
                self.close(None);
                Ok(())
            }
            Some(_) => Err("M99 inside a repeat or an `O… sub`".into()),
            None => Err("M99 in the main program repeats it without end: end it with M30".into()),
        }
    }

    /// `M2`, `M30`, the second `%`: the lines behind it are never reached.
    pub fn end(&mut self) {
        let main = self.stack.first().map_or(self.next, |f| f.back);
        self.stack.clear();
        (self.ended, self.next) = (true, main);
    }

    /// The end of the file inside of a subprogram.
    pub fn unfinished(&self) -> Option<String> {
        let line = self.stack.last()?.start;
        Some(format!("the file ends inside the subprogram of line {line}: M99 or `endsub` is missing"))
    }
}

fn nothing_behind(text: &str) -> Result<(), Refusal> {
    if text.trim().is_empty() {
        Ok(())
    } else {
        Err(format!("expected nothing but a comment behind it, found `{}`", text.trim()))
    }
}

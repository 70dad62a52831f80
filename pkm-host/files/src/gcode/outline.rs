//! Which O words of a program belong together.

use std::collections::HashMap;

use super::Refusal;
use super::words::Line;

/// O words that are one block: their lines.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub kind: Kind,
    pub opens: usize,
    /// The block's next O word, `elseif`, `else` or its end.
    pub next: usize,
    pub closes: usize,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Sub,
    If,
    While,
    /// `do` … `while [ ]`
    Do,
    Repeat,
}

impl Kind {
    fn opened_by(keyword: &str) -> Option<Self> {
        match keyword {
            "sub" => Some(Self::Sub),
            "if" => Some(Self::If),
            "while" => Some(Self::While),
            "do" => Some(Self::Do),
            "repeat" => Some(Self::Repeat),
            _ => None,
        }
    }

    fn closed_by(keyword: &str) -> Option<Self> {
        match keyword {
            "endsub" => Some(Self::Sub),
            "endif" => Some(Self::If),
            "endwhile" => Some(Self::While),
            "endrepeat" => Some(Self::Repeat),
            _ => None,
        }
    }

    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Sub => ["sub", "endsub"],
            Self::If => ["if", "endif"],
            Self::While => ["while", "endwhile"],
            Self::Do => ["do", "while"],
            Self::Repeat => ["repeat", "endrepeat"],
        }
    }
}

/// A block whose end has not come yet.
struct Open {
    name: String,
    kind: Kind,
    /// Its O words so far, the first of which opens it.
    lines: Vec<usize>,
    /// `break` and `continue` in it.
    leaps: Vec<usize>,
    has_else: bool,
    has_continue: bool,
}

/// The O words of a program.
#[derive(Default)]
pub(super) struct Outline {
    /// The first line of each subprogram, after `O100` or `o100 sub`.
    pub starts: HashMap<String, usize>,
    /// What each O word of a block belongs to; of `break` and `continue` the loop.
    parts: HashMap<usize, Part>,
}

impl Outline {
    /// Finds what belongs together, or the line that belongs to nothing.
    pub fn of(lines: &[&str]) -> Result<Self, (usize, Refusal)> {
        let mut outline = Self::default();
        let mut open: Vec<Open> = Vec::new();
        for (at, text) in lines.iter().enumerate().filter(|(_, l)| l.trim_start().starts_with(['O', 'o'])) {
            // what cannot be read is refused where it is carried out
            let Ok(Line { label: Some(label), .. }) = Line::parse(text) else { continue };
            if matches!(label.keyword.as_str(), "" | "sub") {
                // which of the two a control calls depends on it
                if let Some(line) = outline.starts.insert(label.name.clone(), at + 1) {
                    let name = label.name;
                    let why =
                        format!("duplicate O{name}: it begins at line {line} already: give one of them another number");
                    return Err((at, why));
                }
            }
            outline.take(&mut open, at, &label.name, &label.keyword).map_err(|why| (at, why))?;
        }
        match open.last() {
            Some(block) => Err((block.lines[0], block.unclosed())),
            None => Ok(outline),
        }
    }

    fn take(&mut self, open: &mut Vec<Open>, at: usize, name: &str, keyword: &str) -> Result<(), Refusal> {
        let inner = open.last_mut();
        let closes_do = keyword == "while" && inner.as_ref().is_some_and(|b| b.kind == Kind::Do && b.name == name);
        let closed = if closes_do { Some(Kind::Do) } else { Kind::closed_by(keyword) };
        if let Some(kind) = closed {
            return match open.pop() {
                Some(block) if block.name == name && block.kind == kind => {
                    self.close(block, at);
                    Ok(())
                }
                Some(block) => Err(format!("O{name} {keyword}: {}", block.unclosed())),
                None => Err(format!("O{name} {keyword}: no `O{name} {}` before it", kind.names()[0])),
            };
        }
        if let Some(kind) = Kind::opened_by(keyword) {
            let (name, lines) = (name.to_owned(), vec![at]);
            open.push(Open { name, kind, lines, leaps: Vec::new(), has_else: false, has_continue: false });
            return Ok(());
        }
        match (keyword, inner) {
            ("elseif" | "else", Some(block)) if block.name == name && block.kind == Kind::If && !block.has_else => {
                block.lines.push(at);
                block.has_else = keyword == "else";
                Ok(())
            }
            ("elseif" | "else", _) => Err(format!("O{name} {keyword}: no `O{name} if` that it could belong to")),
            ("break" | "continue", _) => {
                let is_loop = |b: &&mut Open| b.name == name && matches!(b.kind, Kind::While | Kind::Do);
                let Some(block) = open.iter_mut().rev().find(is_loop) else {
                    return Err(format!("O{name} {keyword}: no `O{name} while` or `O{name} do` around it"));
                };
                if keyword == "break" && block.kind == Kind::Do && block.has_continue {
                    return Err(format!(
                        "O{name} break: behind a `continue` of the same `do`, where LinuxCNC 2.9 stops: write it before that, or a `while` loop"
                    ));
                }
                block.has_continue |= keyword == "continue";
                block.leaps.push(at);
                Ok(())
            }
            ("", Some(block)) => Err(format!("O{name} begins, and {}", block.unclosed())),
            _ => Ok(()),
        }
    }

    fn close(&mut self, block: Open, closes: usize) {
        let opens = block.lines[0];
        let next = block.lines.iter().skip(1).chain([&closes]);
        let parts = block.lines.iter().zip(next).map(|(line, next)| (*line, *next));
        for (line, next) in parts.chain([(closes, closes)]).chain(block.leaps.iter().map(|line| (*line, closes))) {
            self.parts.insert(line, Part { kind: block.kind, opens, next, closes });
        }
    }

    /// What an O word belongs to.
    pub fn part(&self, line: usize) -> Option<Part> {
        self.parts.get(&line).copied()
    }
}

impl Open {
    fn unclosed(&self) -> Refusal {
        let [opens, closes] = self.kind.names();
        let name = &self.name;
        format!("`O{name} {closes}` is missing, which ends the `O{name} {opens}` of line {}", self.lines[0] + 1)
    }
}

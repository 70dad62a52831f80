//! A line of G-code as letters with numbers, comments, and O words.

use super::Refusal;

/// For another control's own language.
const ISO: &str = "is this G-code (DIN/ISO)?";

/// A letter and its number, and how that was written.
#[derive(Clone, Copy)]
pub(super) struct Word<'a> {
    pub letter: char,
    pub value: f64,
    pub written: &'a str,
}

impl Word<'_> {
    pub fn is(&self, letter: char, numbers: &[f64]) -> bool {
        self.letter == letter && numbers.contains(&self.value)
    }

    /// As it stands in the program, without spaces.
    pub fn shown(&self) -> String {
        format!("{}{}", self.letter, self.written)
    }

    /// Ten times the number of a G word, so that `G59.3` is 593; `None` of no such number.
    pub fn tenths(&self) -> Option<u16> {
        let tenths = 10.0 * self.value;
        ((0.0..10_000.0).contains(&tenths) && (tenths - tenths.round()).abs() < 1e-6).then(|| tenths.round() as u16)
    }
}

/// A subprogram's number or name, and what is done with it: `O100`, `o100 sub`, `o<drill> call`.
pub(super) struct Label<'a> {
    pub name: &'a str,
    /// In lower case; empty where the number stands alone.
    pub keyword: String,
    pub argument: &'a str,
}

/// What a line says.
#[derive(Default)]
pub(super) struct Line<'a> {
    /// The text without a leading `/`.
    pub text: &'a str,
    /// Begins with `/`: left out if the control's switch for it is on.
    pub deletable: bool,
    pub label: Option<Label<'a>>,
    pub words: Vec<Word<'a>>,
    pub comments: Vec<&'a str>,
}

impl<'a> Line<'a> {
    /// Reads a line.
    pub fn parse(text: &'a str) -> Result<Self, Refusal> {
        let mut line = Line { text: text.trim_end(), ..Line::default() };
        if text.trim() == "%" {
            return Ok(line);
        }
        if let Some(rest) = text.trim_start().strip_prefix('/') {
            // Fanuc numbers its switches: /1 to /9
            let rest = rest.strip_prefix(|c: char| c.is_ascii_digit()).unwrap_or(rest);
            (line.deletable, line.text) = (true, rest.trim());
        }
        let mut rest = line.text.trim_start();
        if rest.starts_with(['O', 'o']) {
            rest = line.take_label(rest)?;
        }
        while let Some(first) = rest.chars().next() {
            rest = match first {
                ';' => {
                    line.comments.push(rest);
                    break;
                }
                '(' => line.take_comment(rest)?,
                '#' | '[' | '=' => {
                    return Err("parameters and expressions are not supported: write numbers".into());
                }
                'O' | 'o' => return Err("an O word has to begin its line".into()),
                c if c.is_ascii_alphabetic() => line.take_word(rest, c)?,
                c => return Err(format!("expected a letter with a number, found `{c}`: {ISO}")),
            };
        }
        Ok(line)
    }

    fn take_comment(&mut self, rest: &'a str) -> Result<&'a str, Refusal> {
        let end = rest.find(')').ok_or("the comment is not closed: `)` is missing")?;
        self.comments.push(&rest[..=end]);
        Ok(rest[end + 1..].trim_start())
    }

    fn take_word(&mut self, rest: &'a str, first: char) -> Result<&'a str, Refusal> {
        let letter = first.to_ascii_uppercase();
        let after = rest[1..].trim_start();
        let digits = after.find(|c: char| !c.is_ascii_digit() && !"+-.".contains(c)).unwrap_or(after.len());
        let written = &after[..digits];
        match written.parse::<f64>() {
            Ok(value) if value.is_finite() => self.words.push(Word { letter, value, written }),
            _ if after.starts_with(['#', '[']) => {
                return Err(format!("{letter}: parameters and expressions are not supported: write a number"));
            }
            _ => {
                let found: String = after.chars().take_while(|c| !c.is_whitespace()).take(20).collect();
                let hint = if found.starts_with(char::is_alphabetic) { format!(": {ISO}") } else { String::new() };
                return Err(format!("{letter}: expected a number, found `{found}`{hint}"));
            }
        }
        Ok(after[digits..].trim_start())
    }

    fn take_label(&mut self, rest: &'a str) -> Result<&'a str, Refusal> {
        let end = rest.find(['(', ';']).unwrap_or(rest.len());
        let (head, tail) = rest.split_at(end);
        let head = head[1..].trim();
        let after_name = if head.starts_with('<') {
            head.find('>').map(|end| end + 1)
        } else {
            Some(head.find(|c: char| !c.is_ascii_digit()).unwrap_or(head.len()))
        };
        let Some(end) = after_name.filter(|end| *end > 0) else {
            return Err("O: expected a subprogram's number, or its name in < >".into());
        };
        let (name, rest) = head.split_at(end);
        let rest = rest.trim();
        let letters = rest.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(rest.len());
        let name = if name.starts_with('<') { name } else { same_number(name) };
        let (keyword, argument) = (rest[..letters].to_ascii_lowercase(), rest[letters..].trim());
        self.label = Some(Label { name, keyword, argument });
        Ok(tail)
    }

    /// Whether there is a word with this letter.
    pub fn has(&self, letter: char) -> bool {
        self.words.iter().any(|w| w.letter == letter)
    }

    /// Neither words nor an O word: blank, a comment, `%`.
    pub fn is_silent(&self) -> bool {
        self.words.is_empty() && self.label.is_none()
    }
}

/// `0100` and `100` are one number.
pub(super) fn same_number(digits: &str) -> &str {
    let without = digits.trim_start_matches('0');
    if without.is_empty() { "0" } else { without }
}

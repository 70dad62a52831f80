//! A line of G-code as letters with numbers, comments, and O words.

use super::Refusal;

/// Greatest number of a word but N, S and T.
const MAX_NUMBER: f64 = 1e9;
/// For another control's own language.
const ISO: &str = "is this G-code (DIN/ISO)? Siemens' own language and Heidenhain's Klartext are not read: have the CAM system write DIN/ISO";

/// What to do about `X1e1`, whose E would be a word.
pub(super) const EXPONENT: &str = "a number with an exponent has to be written out (200, not 2e2)";

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

/// A block's number or name, and what is done with it: `O100`, `o100 sub`, `o<drill> call`, `o1 while [#1 LT 5]`.
pub(super) struct Label<'a> {
    /// In lower case.
    pub name: String,
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
    /// Reads a line without expressions.
    pub fn parse(text: &'a str) -> Result<Self, Refusal> {
        let (deletable, text) = without_switch(text);
        let mut line = Line { text, deletable, ..Line::default() };
        if text.trim() == "%" {
            return Ok(line);
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
                _ => line.take_word(rest)?,
            };
        }
        Ok(line)
    }

    fn take_comment(&mut self, rest: &'a str) -> Result<&'a str, Refusal> {
        let (comment, rest) = comment(rest)?;
        self.comments.push(comment);
        Ok(rest.trim_start())
    }

    fn take_word(&mut self, rest: &'a str) -> Result<&'a str, Refusal> {
        let letter = letter(rest)?.to_ascii_uppercase();
        let after = rest[1..].trim_start();
        let digits = after.find(|c: char| !c.is_ascii_digit() && !"+-.".contains(c)).unwrap_or(after.len());
        let written = &after[..digits];
        match written.parse::<f64>() {
            Ok(value) if value.is_finite() => self.words.push(Word { letter, value, written }),
            _ => return Err(statement(rest).unwrap_or_else(|| format!("{letter}: {}", not_a_number(after)))),
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
            return Err("O: expected a number, or a name in < >".into());
        };
        let (name, rest) = head.split_at(end);
        let rest = rest.trim();
        let letters = rest.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(rest.len());
        let name = if name.starts_with('<') {
            name.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_ascii_lowercase()
        } else {
            same_number(name).to_owned()
        };
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

/// The numbers of a line that nothing has used yet.
pub(super) struct Numbers([Option<f64>; 26]);

impl Numbers {
    pub fn of(line: &Line<'_>) -> Result<Self, Refusal> {
        let mut numbers = Self([None; 26]);
        for word in line.words.iter().filter(|w| !"GM".contains(w.letter)) {
            let place = &mut numbers.0[(word.letter as u8 - b'A') as usize];
            if place.replace(word.value).is_some() {
                let hint = if word.letter == 'E' { format!(": {EXPONENT}") } else { String::new() };
                return Err(format!("`{}`: duplicate {} in the line{hint}", word.shown(), word.letter));
            }
            if word.value.abs() > MAX_NUMBER && !"NST".contains(word.letter) {
                return Err(format!("`{}`: expected a number within ±{MAX_NUMBER:e}", word.shown()));
            }
        }
        Ok(numbers)
    }

    pub fn take(&mut self, letter: char) -> Option<f64> {
        self.0[(letter as u8 - b'A') as usize].take()
    }

    pub fn take_three(&mut self, letters: [char; 3]) -> [Option<f64>; 3] {
        letters.map(|letter| self.take(letter))
    }

    pub fn has_any(&self, letters: &str) -> bool {
        letters.bytes().any(|letter| self.0[(letter - b'A') as usize].is_some())
    }
}

/// Whether a line begins with `/`, and what is behind that. Fanuc numbers its switches: `/1` to `/9`.
pub(super) fn without_switch(text: &str) -> (bool, &str) {
    match text.trim_start().strip_prefix('/') {
        Some(rest) => (true, rest.strip_prefix(|c: char| c.is_ascii_digit()).unwrap_or(rest).trim()),
        None => (false, text.trim_end()),
    }
}

/// A line's code, and its comments.
pub(super) fn apart(mut rest: &str) -> Result<(String, Vec<&str>), Refusal> {
    let (mut code, mut comments) = (String::new(), Vec::new());
    while let Some(start) = rest.find(['(', ';']) {
        code.push_str(&rest[..start]);
        let (found, after) = comment(&rest[start..])?;
        comments.push(found);
        rest = after;
    }
    code.push_str(rest);
    Ok((code.trim().to_owned(), comments))
}

/// The comment that a text begins with, and what is behind it.
fn comment(text: &str) -> Result<(&str, &str), Refusal> {
    if text.starts_with(';') {
        return Ok((text, ""));
    }
    let end = text.find(')').ok_or("the comment is not closed: `)` is missing")?;
    Ok(text.split_at(end + 1))
}

/// Statements of Fanuc's macros.
const STATEMENTS: [&str; 7] = ["GOTO", "IF", "WHILE", "THEN", "ELSE", "END", "DO"];

/// Roundings and chamfers of Siemens' own language: a move's words with `=`.
const ROUNDINGS: [&str; 4] = ["RND", "RNDM", "CHR", "CHF"];

/// Why a word is refused that begins one of Fanuc's statements, or one of Siemens' language.
pub(super) fn statement(word: &str) -> Option<Refusal> {
    let letters = word.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(word.len());
    let rounding = ROUNDINGS.iter().find(|r| r.eq_ignore_ascii_case(&word[..letters]));
    if let Some(found) = rounding.filter(|_| word[letters..].trim_start().starts_with('=')) {
        return Some(format!(
            "`{found}=` of Siemens' language is not supported, roundings and chamfers: let the CAM system write the moves (G1, G2, G3)"
        ));
    }
    let found = STATEMENTS.iter().find(|s| s.eq_ignore_ascii_case(&word[..letters]))?;
    Some(format!(
        "`{found}` of Fanuc's macros is not supported: write LinuxCNC's O words, such as `o1 while [#1 LT 5]` and `o1 endwhile`, or \
         let the CAM system write the moves out"
    ))
}

/// The letter that a word begins with.
pub(super) fn letter(rest: &str) -> Result<char, Refusal> {
    match rest.chars().next() {
        Some('O' | 'o') => Err("an O word has to begin its line".into()),
        Some(c) if c.is_ascii_alphabetic() => Ok(c),
        Some(':') if iso_number(rest).is_some() => {
            let digits = iso_number(rest).unwrap_or_default();
            Err(format!("`:{digits}` is a program's number as ISO writes it: write O{digits}"))
        }
        Some(c @ ('+' | '-' | '*')) => Err(format!(
            "expected a letter with a number, found `{c}`: what is computed stands in brackets, such as #1=[#2+3]"
        )),
        Some('/') => Err("expected a letter with a number, found `/`: block delete has to begin its line".into()),
        Some(',') => Err(match rest[1..].trim_start().chars().next() {
            Some('C' | 'c' | 'R' | 'r') => {
                "`,C` and `,R`, Fanuc's chamfers and roundings, are not supported: let the CAM system write \
                                            the moves (G1, G2, G3)"
                    .into()
            }
            Some('0'..='9') => "expected a letter with a number, found `,`: write a decimal point".into(),
            _ => format!("expected a letter with a number, found `,`: {ISO}"),
        }),
        Some(')') => Err("`)` closes no comment: comments do not nest".into()),
        Some(']') => Err("`]` closes no bracket".into()),
        c => Err(format!("expected a letter with a number, found `{}`: {ISO}", c.unwrap_or(' '))),
    }
}

/// The digits of `:0100`, a program's number as ISO writes it.
pub(super) fn iso_number(text: &str) -> Option<&str> {
    let rest = text.trim_start().strip_prefix(':')?.trim_start();
    let digits = &rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len())];
    (!digits.is_empty()).then_some(digits)
}

/// What stands where a number is expected.
pub(super) fn not_a_number(rest: &str) -> Refusal {
    let found: String = rest.chars().take_while(|c| !c.is_whitespace()).take(20).collect();
    let hint = if found.starts_with(char::is_alphabetic) { format!(": {ISO}") } else { String::new() };
    format!("expected a number, found `{found}`{hint}")
}

/// `0100` and `100` are one number.
pub(super) fn same_number(digits: &str) -> &str {
    let without = digits.trim_start_matches('0');
    if without.is_empty() { "0" } else { without }
}

//! A small dialect of G-code (RS-274): straight moves of a five-axis tool. With `A B` it is LinuxCNC's; `I J K` on a straight
//! move is for CAM systems and controls that speak of tool vectors.
//!
//! | word | meaning |
//! |---|---|
//! | `G0`, `G1` | move straight, fast or cutting; modal. `G0` has no cutting load |
//! | `X Y Z` | the tool's tip in B, mm, absolute; modal |
//! | `I J K` | the tool's axis in B, from the flange toward the tip, of any length; modal |
//! | `A B` | in place of `I J K` all through a program: the wrist's joints β1 and β2 in degrees, axes A and B of a machine whose kinematics keep the tip at X Y Z; modal |
//! | `F S T`, `M…`, `N…` | passed on; a program may stop (`M0 M1 M2 M30 M60`) on the line of a move, behind it |
//! | `G4 P…`, `G64 P… Q…` | passed on |
//! | `O…` | a program's number, alone on the first line: passed on |
//! | `G17 G18 G19 G21 G40 G49 G61 G80 G90 G91.1 G94` | passed on |
//! | `( … )`, `; …` | comments, passed on |
//! | `(wrench fx,fy,fz,mx,my,mz)` | from here on: the cutting load on the tool at its tip in the axes of T_h, N and N·m |
//!
//! A cut is divided, and each part ends with all of its words. Where the load changes between two moves, the second begins with a
//! small move to where the tool has to be commanded under its own load.
//!
//! Everything else is refused with its line: arcs (`G2 G3`), inches, increments, inverse time, offsets of any kind, canned cycles,
//! parameters, expressions, subroutines, block delete.

use pkm_core::Wrench;

use crate::error::{Failure, Result, printable};
use crate::files::dataset::MOST_LOAD;
use crate::files::path::{Move, Place, Toward};
use crate::files::source::Source;

/// A program: its lines and the moves among them.
pub struct Program {
    blocks: Vec<Block>,
    /// In the program's order.
    pub moves: Vec<Move>,
    /// Names the lines that may not mean what they say.
    pub warnings: Vec<String>,
}

/// A line.
struct Block {
    text: String,
    /// What a line with a move carries besides.
    words: Vec<Word>,
    comments: Vec<String>,
    moves: bool,
}

/// A letter and its number, and how that was written.
struct Word {
    letter: char,
    value: f64,
    written: String,
}

impl Word {
    fn is(&self, letter: char, numbers: &[f64]) -> bool {
        self.letter == letter && numbers.contains(&self.value)
    }
}

/// What holds until it is said anew.
#[derive(Default)]
struct Modal {
    /// Of `G0` and `G1`, whether it cuts.
    cuts: Option<bool>,
    tip_mm: [Option<f64>; 3],
    axis: [Option<f64>; 3],
    wrist_deg: [Option<f64>; 2],
}

const PASSED: [f64; 12] = [4.0, 17.0, 18.0, 19.0, 21.0, 40.0, 49.0, 61.0, 64.0, 90.0, 91.1, 94.0];
/// For another control's own language.
const ISO: &str = "is this G-code (DIN/ISO)?";
const STOPS: [f64; 5] = [0.0, 1.0, 2.0, 30.0, 60.0];

/// Why a G word is not supported, and what to do.
fn advice(g: f64) -> &'static str {
    match g {
        2.0 | 3.0 => "arcs are not supported: let the CAM system write them as short straight lines (G1)",
        20.0 => "inches are not supported: write the program in mm (G21)",
        91.0 => "increments are not supported: write absolute coordinates (G90)",
        93.0 | 95.0 => "this feed mode is not supported, since moves are divided: write the feed a minute (G94)",
        28.0 | 30.0 => "reference points are not supported: write the move with G0 and coordinates",
        41.0..=43.9 => {
            "compensation is not supported: X Y Z are the tip, with the tool as long as the machine file says"
        }
        10.0 | 52.0..=59.9 | 92.0..=92.9 => {
            "offsets are not supported: write the coordinates in B, the base's frame, and delete this word"
        }
        73.0..=89.9 => "canned cycles are not supported: let the CAM system write their moves (G0, G1)",
        _ => "not supported; known are G0 G1 G4 G17 G18 G19 G21 G40 G49 G61 G64 G80 G90 G91.1 G94",
    }
}

/// Words and comments of a line.
fn words(text: &str) -> std::result::Result<(Vec<Word>, Vec<String>), String> {
    let (mut words, mut comments) = (Vec::new(), Vec::new());
    let mut rest = text.trim();
    while let Some(first) = rest.chars().next() {
        if first == ';' {
            comments.push(rest.to_owned());
            break;
        }
        if first == '(' {
            let end = rest.find(')').ok_or("the comment is not closed: `)` is missing")?;
            comments.push(rest[..=end].to_owned());
            rest = rest[end + 1..].trim_start();
            continue;
        }
        match first {
            '/' => {
                return Err("block delete (`/`) is not supported: whether the move is made is not known".into());
            }
            '#' | '[' | '=' => return Err("parameters and expressions are not supported: write numbers".into()),
            'O' | 'o' => return Err("subroutines are not supported: write the moves out".into()),
            c if c.is_ascii_alphabetic() => {}
            c => return Err(format!("expected a letter with a number, found `{c}`: {ISO}")),
        }
        let letter = first.to_ascii_uppercase();
        let after = rest[1..].trim_start();
        let digits = after.find(|c: char| !c.is_ascii_digit() && !"+-.".contains(c)).unwrap_or(after.len());
        let written = &after[..digits];
        match written.parse::<f64>() {
            Ok(value) if value.is_finite() => words.push(Word { letter, value, written: written.to_owned() }),
            _ if after.starts_with(['#', '[']) => {
                return Err(format!("{letter}: parameters and expressions are not supported: write a number"));
            }
            _ => {
                let found: String = after.chars().take_while(|c| !c.is_whitespace()).take(20).collect();
                let hint = if found.starts_with(char::is_alphabetic) { format!(": {ISO}") } else { String::new() };
                return Err(format!("{letter}: expected a number, found `{found}`{hint}"));
            }
        }
        rest = after[digits..].trim_start();
    }
    Ok((words, comments))
}

/// The load that a comment sets, if it is one that does.
fn load(comment: &str) -> std::result::Result<Option<Wrench<f64>>, String> {
    let inner = comment.trim_start_matches([';', '(']).trim_end_matches(')').trim();
    let Some((word, rest)) = inner.split_at_checked(6) else { return Ok(None) };
    if !word.eq_ignore_ascii_case("wrench") || rest.starts_with(|c: char| c.is_alphanumeric()) {
        return Ok(None);
    }
    let values: Vec<Option<f64>> =
        rest.split(',').map(|v| v.trim().parse::<f64>().ok().filter(|v| v.abs() <= MOST_LOAD)).collect();
    match values.into_iter().collect::<Option<Vec<_>>>().and_then(|v| <[f64; 6]>::try_from(v).ok()) {
        Some(values) => Ok(Some(Wrench::from_array(values))),
        None => Err(format!(
            "expected `(wrench fx,fy,fz,mx,my,mz)`, six numbers in N and N·m within ±{MOST_LOAD:e}, found `{inner}`"
        )),
    }
}

impl Program {
    /// Reads a program. `wrench` is the cutting load until a comment sets another.
    ///
    /// # Errors
    /// The line that is not supported; a cut without a load; no move at all.
    pub fn parse(source: &Source, wrench: Option<Wrench<f64>>) -> Result<Self> {
        let (mut modal, mut wrench) = (Modal::default(), wrench);
        // the tool in hand, and one that came without a load of its own
        let (mut tool, mut other_tool) = (None, None);
        let mut program = Self { blocks: Vec::new(), moves: Vec::new(), warnings: Vec::new() };
        for (index, text) in source.text()?.lines().enumerate() {
            let line = index as u64 + 1;
            let fail = |message: String| Failure::input(message).in_file(&source.name).at_line(line);
            let begun = program.blocks.iter().any(|b| !b.words.is_empty());
            let is_name = |t: &str| t.strip_prefix(['O', 'o']).is_some_and(|n| n.parse::<u32>().is_ok());
            let code = if text.trim() == "%" || (!begun && is_name(text.split('(').next().unwrap_or("").trim())) {
                ""
            } else {
                text
            };
            let (words, comments) = words(code).map_err(fail)?;
            for comment in &comments {
                if let Some(set) = load(comment).map_err(fail)? {
                    (wrench, other_tool) = (Some(set), None);
                }
            }
            let moves = modal.take(&words).map_err(fail)?;
            for word in words.iter().filter(|w| w.letter == 'T') {
                if tool.replace(word.value).is_some_and(|before| before != word.value) {
                    other_tool = Some(word.written.clone());
                }
            }
            if moves {
                let to = modal.place().map_err(fail)?;
                let load = match (modal.cuts, wrench) {
                    (None, _) => return Err(fail("a move before any G0 or G1".into())),
                    (Some(false), _) => Wrench::ZERO,
                    (_, Some(wrench)) => wrench,
                    (_, None) => {
                        let message =
                            "a cut without a load: give --wrench, or a line (wrench fx,fy,fz,mx,my,mz) before it";
                        return Err(fail(message.into()));
                    }
                };
                if let Some(number) = other_tool.take_if(|_| load != Wrench::ZERO) {
                    program.warnings.push(format!(
                        "{}:{line}: T{number} cuts with the load of the tool before: a line (wrench …) gives another",
                        printable(&source.name)
                    ));
                }
                program.moves.push(Move { line, to, wrench: [load; 2] });
            }
            program.blocks.push(Block { text: text.to_owned(), words, comments, moves });
        }
        if program.moves.is_empty() {
            return Err(Failure::input("expected moves (G0 or G1 with X Y Z), found none").in_file(&source.name));
        }
        Ok(program)
    }

    /// The program with other places for its moves, several where one was divided, and notes at its head.
    pub fn written(&self, places: &[Vec<Place>], notes: &[String]) -> String {
        let mut places = places.iter();
        let mut text = String::new();
        let head: String = notes.iter().map(|note| format!("({})\n", note.replace(['(', ')'], ""))).collect();
        let first = self.blocks.iter().position(|b| !b.text.trim().is_empty());
        let percent = first.filter(|i| self.blocks[*i].text.trim() == "%");
        if percent.is_none() {
            text.push_str(&head);
        }
        for (index, block) in self.blocks.iter().enumerate() {
            let places = if block.moves { places.next().map_or(&[][..], Vec::as_slice) } else { &[] };
            for (n, place) in places.iter().enumerate() {
                let stops = |w: &&Word| w.is('M', &STOPS);
                let kept = block.words.iter().filter(|w| !"XYZIJKAB".contains(w.letter));
                let written = |w: &Word| format!("{}{}", w.letter, w.written);
                let mut line: Vec<String> = Vec::new();
                if n == 0 {
                    line.extend(kept.clone().filter(|w| !stops(w)).map(written));
                }
                line.extend(place_words(place));
                if n + 1 == places.len() {
                    line.extend(kept.filter(stops).map(written));
                }
                if n == 0 {
                    line.extend(block.comments.iter().cloned());
                }
                text.push_str(&line.join(" "));
                text.push('\n');
            }
            if !block.moves {
                text.push_str(block.text.trim_end());
                text.push('\n');
            }
            if percent == Some(index) {
                text.push_str(&head);
            }
        }
        text
    }
}

impl Modal {
    /// Takes a line's words in; whether it moves.
    fn take(&mut self, words: &[Word]) -> std::result::Result<bool, String> {
        let has = |letter: char| words.iter().any(|w| w.letter == letter);
        let dwells = words.iter().any(|w| w.is('G', &[4.0]));
        let pauses = dwells || words.iter().any(|w| w.is('G', &[64.0]));
        for (i, word) in words.iter().enumerate() {
            let shown = format!("{}{}", word.letter, word.written);
            if !"GM".contains(word.letter) && words[..i].iter().any(|w| w.letter == word.letter) {
                return Err(format!("`{shown}`: duplicate {} in the line", word.letter));
            }
            let value = Some(word.value);
            match word.letter {
                'G' if word.is('G', &[0.0, 1.0]) => {
                    if words[..i].iter().any(|w| w.is('G', &[0.0, 1.0])) {
                        return Err(format!("`{shown}`: a second motion in the line"));
                    }
                    self.cuts = Some(word.value == 1.0);
                }
                'G' if word.value == 80.0 => self.cuts = None,
                'G' if PASSED.contains(&word.value) => {}
                'G' => return Err(format!("`{shown}`: {}", advice(word.value))),
                'X' => self.tip_mm[0] = value,
                'Y' => self.tip_mm[1] = value,
                'Z' => self.tip_mm[2] = value,
                'I' => self.axis[0] = value,
                'J' => self.axis[1] = value,
                'K' => self.axis[2] = value,
                'A' => self.wrist_deg[0] = value,
                'B' => self.wrist_deg[1] = value,
                'F' | 'S' | 'T' | 'M' => {}
                'N' if i == 0 => {}
                'P' | 'Q' if pauses => {}
                _ => {
                    let known = "known are G M, X Y Z, I J K or A B, F S T, N first, P with G4 or G64";
                    return Err(format!("`{shown}` is not supported: {known}"));
                }
            }
        }
        let moves = "XYZIJKAB".chars().any(has);
        if moves && dwells {
            return Err("G4 with a move in one line".into());
        }
        if self.axis.iter().any(Option::is_some) && self.wrist_deg.iter().any(Option::is_some) {
            return Err("I J K and A B in one program: give the tool's direction in one of these ways".into());
        }
        Ok(moves)
    }

    /// Where the tool is to be.
    fn place(&self) -> std::result::Result<Place, String> {
        let [Some(x), Some(y), Some(z)] = self.tip_mm else {
            return Err(
                "the first move has to give all of X Y Z on one line: where the tool comes from is not known".into()
            );
        };
        let toward = match (self.axis, self.wrist_deg) {
            ([Some(i), Some(j), Some(k)], _) if [i, j, k] == [0.0; 3] => {
                return Err("I J K are all 0 and give the tool no direction".into());
            }
            ([Some(i), Some(j), Some(k)], _) => Toward::Axis([i, j, k]),
            (_, [Some(a), Some(b)]) => Toward::Wrist([a.to_radians(), b.to_radians()]),
            _ => {
                let message = "the first move has to say where the tool points: all of I J K (its axis in B, such as I0 J0 \
                               K1), or A and B (the wrist's joints in degrees)";
                return Err(message.into());
            }
        };
        Ok(Place { tip_m: [x, y, z].map(|v| v / 1e3), toward })
    }
}

/// A number as it stands in a program, and without trailing zeros.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn place_words(place: &Place) -> Vec<String> {
    let tip = place.tip_m.map(|v| number(v * 1e3, 6));
    let (letters, toward) = match place.toward {
        Toward::Axis(axis) => ("XYZIJK", axis.map(|v| number(v, 9)).to_vec()),
        Toward::Wrist(beta) => ("XYZAB", beta.map(|v| number(v.to_degrees(), 8)).to_vec()),
    };
    letters.chars().zip(tip.into_iter().chain(toward)).map(|(letter, number)| format!("{letter}{number}")).collect()
}

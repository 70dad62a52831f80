//! Tool tables: lengths of tools by number, in TOML or as LinuxCNC keeps them (`tool.tbl`).

use serde::Deserialize;
use toml::Spanned;

use crate::error::{Failure, Result};
use crate::files::source::Source;
use crate::files::toml_error::{line_at, parsed};

/// Longest tool, mm: far beyond any.
const MAX_LENGTH_MM: f64 = 1e4;

/// Lengths by number, over the flange of the machine file.
#[derive(Clone, Debug, Default)]
pub struct Tools(Vec<(u32, f64)>);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTools {
    format: Spanned<i64>,
    tool: Vec<RawTool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTool {
    number: Spanned<u32>,
    length_mm: Spanned<f64>,
    diameter_mm: Option<Spanned<f64>>,
}

impl Tools {
    /// Reads a tool table, LinuxCNC's if the file's name ends in .tbl.
    ///
    /// # Errors
    /// One message with file and line: a tool twice, a length that is none, an offset other than along Z.
    pub fn parse(source: &Source) -> Result<Self> {
        if source.name.to_lowercase().ends_with(".tbl") { Self::of_table(source) } else { Self::of_toml(source) }
    }

    /// The length of a tool, mm.
    pub fn length_mm(&self, number: f64) -> Option<f64> {
        self.0.iter().find(|(n, _)| f64::from(*n) == number).map(|(_, length)| *length)
    }

    fn add(&mut self, number: u32, length_mm: f64) -> std::result::Result<(), String> {
        if !(length_mm.abs() <= MAX_LENGTH_MM) {
            return Err(format!("expected a length within ±{MAX_LENGTH_MM} mm, found {length_mm}"));
        }
        if self.length_mm(f64::from(number)).is_some() {
            return Err(format!("duplicate tool {number}"));
        }
        self.0.push((number, length_mm));
        Ok(())
    }

    fn of_toml(source: &Source) -> Result<Self> {
        let raw: RawTools = parsed(source)?;
        let text = source.text()?;
        let fail = |start: usize, key: &str, message: String| {
            Failure::input(message).in_file(&source.name).at_line(line_at(text, start) as u64).at_column(key)
        };
        let format = *raw.format.get_ref();
        if format != 1 {
            return Err(fail(raw.format.span().start, "format", format!("expected 1, found {format}")));
        }
        let mut tools = Self::default();
        for tool in &raw.tool {
            if let Some(diameter) = tool.diameter_mm.as_ref().filter(|d| !(0.0..=MAX_LENGTH_MM).contains(d.get_ref())) {
                let message = format!("expected a diameter from 0 to {MAX_LENGTH_MM} mm, found {}", diameter.get_ref());
                return Err(fail(diameter.span().start, "tool.diameter_mm", message));
            }
            let failed = |message| fail(tool.length_mm.span().start, "tool.length_mm", message);
            tools.add(*tool.number.get_ref(), *tool.length_mm.get_ref()).map_err(failed)?;
        }
        Ok(tools)
    }

    /// `T1 P1 Z+51.2 D10 ;end mill`, a tool a line, in mm; Z is the length.
    fn of_table(source: &Source) -> Result<Self> {
        let mut tools = Self::default();
        for (n, line) in source.text()?.lines().enumerate() {
            let fail = |message: String| Failure::input(message).in_file(&source.name).at_line(n as u64 + 1);
            let (mut number, mut length_mm) = (None, 0.0);
            for word in line.split(';').next().unwrap_or_default().split_whitespace() {
                let (letter, value) = word.split_at_checked(1).unwrap_or((word, ""));
                let expected =
                    || fail(format!("expected a letter with a number, as in `T1 P1 Z51.2 D10`, found `{word}`"));
                let value: f64 = value.parse().map_err(|_| expected())?;
                match letter.to_ascii_uppercase().as_str() {
                    "T" if value.fract() == 0.0 && (0.0..1e9).contains(&value) => number = Some(value as u32),
                    "Z" => length_mm = value,
                    "P" | "D" | "I" | "J" | "Q" => {}
                    "X" | "Y" | "A" | "B" | "C" | "U" | "V" | "W" if value == 0.0 => {}
                    "X" | "Y" | "A" | "B" | "C" | "U" | "V" | "W" => {
                        return Err(fail(format!("`{word}`: only offsets along Z are supported")));
                    }
                    _ => return Err(expected()),
                }
            }
            if let Some(number) = number {
                tools.add(number, length_mm).map_err(fail)?;
            }
        }
        Ok(tools)
    }
}

//! TOML: what its reader does not like, in words for who wrote the file.

use std::ops::Range;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Failure, MAX_TYPO_BYTES, Result, advice, clipped};
use crate::source::Source;

/// An array of just so many numbers: serde's own would leave out what is too much.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Vec<f64>")]
pub(crate) struct Numbers<const N: usize>(pub(crate) [f64; N]);

impl<const N: usize> TryFrom<Vec<f64>> for Numbers<N> {
    type Error = String;

    fn try_from(values: Vec<f64>) -> std::result::Result<Self, String> {
        values.try_into().map(Self).map_err(|v: Vec<f64>| format!("expected {N} numbers, found {}", v.len()))
    }
}

/// What a TOML file says.
///
/// # Errors
/// One message with file, line and key.
pub(crate) fn parsed<T: DeserializeOwned>(source: &Source) -> Result<T> {
    let text = source.text()?;
    toml::from_str(text).map_err(|e| unread(source, text, &e))
}

/// What the TOML reader does not like of a file.
fn unread(source: &Source, text: &str, error: &toml::de::Error) -> Failure {
    let (span, key) = located(text, error);
    let line = span.as_ref().map_or("", |range| line_of(text, range.start));
    let mut message = plain(error.message());
    if DeTable::parse(text).is_err() {
        message.push_str(typing_error(line));
    } else if line.starts_with('[') && message.starts_with("expected an array, found a table") {
        message.push_str(&format!(": write [{line}]"));
    }
    if !line.is_empty() {
        message.push_str(&format!(" (in `{}`)", clipped(line)));
    }
    let failure = Failure::input(message).in_file(&source.name);
    let failure = match span {
        Some(span) => failure.at_line(line_at(text, span.start) as u64),
        None => failure,
    };
    if key.is_empty() { failure } else { failure.at_column(clipped(&key)) }
}

/// What to do about a line that is no TOML but looks like a key and numbers.
fn typing_error(line: &str) -> &'static str {
    let Some((_, value)) = line.split_once('=') else { return "" };
    let digit = |c: Option<&char>| c.is_some_and(char::is_ascii_digit);
    let letters: Vec<char> = value.chars().collect();
    if letters.windows(3).any(|w| digit(w.first()) && w[1] == ',' && digit(w.last())) {
        return ": write a decimal point, and no comma for thousands";
    }
    let parts = value.split([',', '[', ']', '{', '}', '=']).map(str::trim);
    parts.map(advice).find(|advice| !advice.is_empty()).unwrap_or("")
}

/// Whether a name is probably a typing error for a known one.
pub(crate) fn is_near(name: &str, known: &str) -> bool {
    name.len() <= MAX_TYPO_BYTES && strsim::osa_distance(name, known) <= 2
}

/// A message of serde's in words that don't need the program's source code.
pub(crate) fn plain(message: &str) -> String {
    let message = message.replace('\n', " ").replace("field", "key").replace("variant", "value");
    if let Some((found, expected)) = message.strip_prefix("invalid type: ").and_then(|m| m.split_once(", expected ")) {
        let expected = match expected {
            "f64" => "a number",
            "i64" | "u32" | "u8" => "a whole number",
            "a string" => "text in quotes",
            "a sequence" | "an array" => "an array",
            // names of the program's own
            table if table.starts_with("struct ") => "a table",
            other => other,
        };
        let found = match found {
            "map" if expected == "a number" => "a table or a date",
            "map" => "a table",
            "sequence" => "an array",
            other => other,
        };
        return format!("expected {expected}, found {}", clipped(found));
    }
    if let Some((found, expected)) = message.strip_prefix("invalid length ").and_then(|m| m.split_once(", expected ")) {
        let expected = if expected.starts_with("struct ") { "a table" } else { expected };
        return format!("expected {expected}, found {found} values");
    }
    if let Some((unknown, known)) = message.strip_prefix("unknown key `").and_then(|m| m.split_once("`, ")) {
        let meant = known.split('`').skip(1).step_by(2).find(|known| is_near(unknown, known));
        let meant = meant.map_or(String::new(), |meant| format!(", did you mean `{meant}`?"));
        return format!("unknown key `{}`{meant}; {known}", clipped(unknown));
    }
    if let Some(key) = message.strip_prefix("duplicate key") {
        return format!("duplicate key{key}");
    }
    let words = [
        ("string values must be quoted, expected literal string", "neither a number nor text in quotes"),
        ("cannot recurse further; max recursion depth met", "nested too deeply"),
        ("recursion limit exceeded", "nested too deeply"),
    ];
    words.into_iter().fold(message, |text, (from, to)| text.replace(from, to))
}

/// Line, from 1, of a byte.
pub(crate) fn line_at(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count()
}

/// That line.
fn line_of(text: &str, byte: usize) -> &str {
    text.lines().nth(line_at(text, byte) - 1).unwrap_or("").trim()
}

/// Where a failure of the TOML reader is, unless nothing is written there, and its key from the outermost on.
fn located(text: &str, error: &toml::de::Error) -> (Option<Range<usize>>, String) {
    let span = error.span().unwrap_or(0..0);
    let Ok(document) = DeTable::parse(text) else {
        // no TOML: the key is what the line starts with
        let line = line_of(text, span.start);
        let section = line.strip_prefix('[').and_then(|l| l.strip_suffix(']'));
        let key = section.or(line.split_once('=').map(|(key, _)| key.trim())).unwrap_or("");
        return (Some(span), key.to_owned());
    };
    let table = key_at(document.get_ref(), &span);
    match (error.message().strip_prefix("missing field `").and_then(|m| m.split('`').next()), table) {
        // the span is that of the table that lacks it
        (Some(missing), Some(table)) => (Some(span), format!("{table}.{missing}")),
        (Some(missing), None) => (None, missing.to_owned()),
        (None, key) => (Some(span), key.unwrap_or_default()),
    }
}

/// The key that a span is written for. Tables of an array count from 1, values from 0.
fn key_at(table: &DeTable<'_>, span: &Range<usize>) -> Option<String> {
    fn below(value: &Spanned<DeValue<'_>>, span: &Range<usize>, path: String) -> Option<String> {
        let inner = match value.get_ref() {
            DeValue::Table(table) => key_at(table, span).map(|key| format!("{path}.{key}")),
            DeValue::Array(array) => array.iter().enumerate().find_map(|(i, value)| {
                let place = if value.get_ref().is_table() { format!(".{}", i + 1) } else { format!("[{i}]") };
                below(value, span, format!("{path}{place}"))
            }),
            _ => None,
        };
        inner.or_else(|| (value.span() == *span).then_some(path))
    }
    table.iter().find_map(|(key, value)| {
        let name = key.get_ref().to_string();
        if key.span() == *span { Some(name) } else { below(value, span, name) }
    })
}

/// A TOML number, whole or not.
pub(crate) fn float(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

/// Where a key of an `[[effect]]` or `[[element]]` is written: the parameters' own spans are lost with their names free to
/// choose.
pub(crate) fn place_of(text: &str, table: Range<usize>, name: &str) -> Range<usize> {
    let start = table.start;
    let mut at = start;
    for line in text.get(start..).unwrap_or("").split_inclusive('\n') {
        if line.split('=').next().is_some_and(|key| key.trim() == name) {
            return at..at + line.len();
        }
        at += line.len();
    }
    table
}

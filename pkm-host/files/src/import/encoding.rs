//! Bytes of an export → text.

use std::borrow::Cow;

use crate::error::{Failure, Result};
use crate::source::Source;

/// What Windows-1252 has at 0x80 to 0x9F; U+FFFD where it has nothing. The other bytes are the code points of Unicode.
const WINDOWS_1252: &str = "€\u{fffd}‚ƒ„…†‡ˆ‰Š‹Œ\u{fffd}Ž\u{fffd}\u{fffd}‘’“”•–—˜™š›œ\u{fffd}žŸ";

/// The text of a file, and the name of its encoding unless that is UTF-8.
///
/// # Errors
/// A file that is no text: see [`Source::text`].
pub fn text(source: &Source) -> Result<(Cow<'_, str>, Option<&'static str>)> {
    let bytes = source.bytes();
    let utf16 = match bytes {
        [0xff, 0xfe, rest @ ..] => Some((rest, u16::from_le_bytes as fn([u8; 2]) -> u16)),
        [0xfe, 0xff, rest @ ..] => Some((rest, u16::from_be_bytes as fn([u8; 2]) -> u16)),
        _ => None,
    };
    if let Some((rest, unit)) = utf16 {
        return Ok((Cow::Owned(from_utf16(source, rest, unit)?), Some("UTF-16")));
    }
    match source.text() {
        Ok(text) => Ok((Cow::Borrowed(text), None)),
        Err(failure) => {
            let text = from_windows_1252(bytes).ok_or(failure)?;
            Ok((Cow::Owned(text), Some("Windows-1252")))
        }
    }
}

fn from_utf16(source: &Source, bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String> {
    let fail = |line: usize, message: &str| {
        Failure::input(format!("{message}: save the file as UTF-8, a sheet as `CSV UTF-8`"))
            .in_file(&source.name)
            .at_line(line as u64 + 1)
    };
    let (pairs, odd) = bytes.as_chunks::<2>();
    let mut text = String::with_capacity(bytes.len() / 2);
    for character in char::decode_utf16(pairs.iter().map(|pair| unit(*pair))) {
        match character {
            Ok('\0') | Err(_) => return Err(fail(text.matches('\n').count(), "damaged text in UTF-16")),
            Ok(character) => text.push(character),
        }
    }
    if !odd.is_empty() {
        return Err(fail(text.matches('\n').count(), "text in UTF-16 that ends within a character"));
    }
    // line ends of CR alone, see `Source`
    Ok(if text.contains('\n') { text } else { text.replace('\r', "\n") })
}

/// `None` for what is no text in it: control characters, and bytes that it does not define.
pub fn from_windows_1252(bytes: &[u8]) -> Option<String> {
    let high: Vec<char> = WINDOWS_1252.chars().collect();
    let character = |byte: u8| match byte {
        b'\t' | b'\n' | b'\r' | 0x20..=0x7e | 0xa0..=0xff => Some(char::from(byte)),
        0x80..=0x9f => high.get(usize::from(byte - 0x80)).copied().filter(|c| *c != '\u{fffd}'),
        _ => None,
    };
    bytes.iter().map(|byte| character(*byte)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<String> {
        let source = Source::from_bytes("d.csv", bytes.to_vec());
        text(&source).map(|(text, _)| text.into_owned())
    }

    #[test]
    fn encodings_of_spreadsheets_give_the_same_text() {
        let expected = "dx [µm];°\r\n€;–\r\n";
        let utf16 = |unit: fn(u16) -> [u8; 2]| format!("\u{feff}{expected}").encode_utf16().flat_map(unit).collect();
        let (little, big): (Vec<u8>, Vec<u8>) = (utf16(u16::to_le_bytes), utf16(u16::to_be_bytes));
        let marked = format!("\u{feff}{expected}");
        let windows = b"dx [\xb5m];\xb0\r\n\x80;\x96\r\n";
        for bytes in [expected.as_bytes(), marked.as_bytes(), &little, &big, windows] {
            assert_eq!(read(bytes).unwrap(), expected);
        }
    }

    #[test]
    fn what_is_no_text_is_refused() {
        for bytes in [&b"\x89PNG\r\n\x1a\n\0\0"[..], b"\xff\xfea", b"\xff\xfe\0\xd8a\0", b"a\x81b", b"PK\x03\x04"] {
            assert!(read(bytes).is_err(), "{bytes:?}");
        }
    }
}

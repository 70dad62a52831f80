//! JSON: what of it a line may have.

use serde::Serialize;

use crate::line::sealed;

/// JSON, its CRC and a line feed.
pub(crate) fn write_line<'b>(value: &impl Serialize, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let length = serde_json_core::to_slice(value, buffer).ok()?;
    sealed(buffer, length)
}

/// How many objects a line holds; `None` if there is anything in it but strings without escapes and outside of them JSON's numbers,
/// brackets, commas, colons, and these words. serde-json-core lets more pass: `[,1]`, `[,1 2]`, `+1`, `01`, `1.`, `.5`, null for a
/// number, an object for a name, line feeds in a string.
pub(crate) fn objects(mut rest: &[u8], words: &[&[u8]]) -> Option<usize> {
    let mut objects = 0;
    let mut after_bracket = false;
    while let [first, tail @ ..] = rest {
        let length = match first {
            b' ' | b'\t' | b'\r' => {
                rest = tail;
                continue;
            }
            b'"' => {
                let end = tail.iter().position(|b| matches!(b, b'"' | b'\\') || b.is_ascii_control())?;
                tail.get(end).filter(|b| **b == b'"').map(|_| end + 2)?
            }
            b',' if after_bracket => return None,
            b'{' | b'}' | b'[' | b']' | b':' | b',' => 1,
            _ => match words.iter().find(|word| rest.starts_with(word)) {
                Some(word) => word.len(),
                None => {
                    let in_number = |b: &&u8| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E');
                    let length = rest.iter().take_while(in_number).count();
                    rest.get(..length).filter(|text| is_number(text))?;
                    length
                }
            },
        };
        objects += usize::from(*first == b'{');
        after_bracket = *first == b'[';
        rest = rest.get(length..)?;
    }
    Some(objects)
}

/// A number of JSON's grammar.
fn is_number(text: &[u8]) -> bool {
    let text = text.strip_prefix(b"-").unwrap_or(text);
    let (whole, after) = digits(text);
    if whole == 0 || whole > 1 && text.starts_with(b"0") {
        return false;
    }
    let after = match after {
        [b'.', fraction @ ..] => match digits(fraction) {
            (0, _) => return false,
            (_, after) => after,
        },
        after => after,
    };
    match after {
        [] => true,
        [b'e' | b'E', b'+' | b'-', exponent @ ..] | [b'e' | b'E', exponent @ ..] => {
            matches!(digits(exponent), (1.., []))
        }
        _ => false,
    }
}

/// How many digits a text starts with, and what follows them.
fn digits(text: &[u8]) -> (usize, &[u8]) {
    let count = text.iter().take_while(|b| b.is_ascii_digit()).count();
    (count, text.get(count..).unwrap_or_default())
}

//! What the core says, as bytes that a page can read.

use core::fmt::{self, Display, Write};

/// Most bytes of a text.
const MAX_BYTES: usize = 112;

/// A text of at most 112 bytes; what is longer is cut between two characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; MAX_BYTES],
    length: usize,
}

impl Text {
    /// None.
    pub const EMPTY: Self = Self { bytes: [0; MAX_BYTES], length: 0 };

    /// What something says of itself.
    pub fn of(said: &impl Display) -> Self {
        let mut text = Self::EMPTY;
        // what does not fit is left out
        let _ = write!(text, "{said}");
        text
    }

    /// In UTF-8.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

impl Write for Text {
    fn write_str(&mut self, part: &str) -> fmt::Result {
        for c in part.chars() {
            let mut utf8 = [0; 4];
            let utf8 = c.encode_utf8(&mut utf8).as_bytes();
            let room = self.bytes.get_mut(self.length..self.length + utf8.len()).ok_or(fmt::Error)?;
            room.copy_from_slice(utf8);
            self.length += utf8.len();
        }
        Ok(())
    }
}

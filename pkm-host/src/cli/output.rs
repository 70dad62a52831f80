//! What a command prints.

use serde::Serialize;

use crate::error::{Failure, Result};

/// What a command prints: text for people, or a document for programs.
pub struct Output {
    /// Without `--json`.
    pub text: String,
    /// With `--json`: one line.
    pub json: String,
}

impl Output {
    /// Written at once: a tree of a document takes many times what its line takes.
    ///
    /// # Errors
    /// A document that is no JSON.
    pub fn new(text: String, document: &impl Serialize) -> Result<Self> {
        let json = serde_json::to_string(document).map_err(|e| Failure::other(e.to_string()))?;
        Ok(Self { text, json })
    }
}

//! What a command prints.

use serde_json::Value;

/// What a command prints: text for people, or a document for programs.
pub struct Output {
    /// Without `--json`.
    pub text: String,
    /// With `--json`.
    pub json: Value,
}

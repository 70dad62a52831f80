//! What a reader does with a page that is open, whatever the browser.

use serde_json::Value;

use crate::Outcome;

/// Keys that write nothing.
#[derive(Clone, Copy)]
pub enum Key {
    Tab,
    Enter,
}

/// A browser with a page that is open.
pub trait User {
    /// What an expression gives, or the promise that it is.
    fn evaluate(&mut self, expression: &str) -> Result<Value, String>;

    /// Drags from a point of the window to another.
    fn drag(&mut self, from: [f64; 2], to: [f64; 2]) -> Outcome;

    /// Writes where the focus is.
    fn write(&mut self, text: &str) -> Outcome;

    /// Presses a key and lets it go.
    fn press(&mut self, key: Key) -> Outcome;

    /// The sentences that a function in the page gives.
    fn sentences(&mut self, function: &str, arguments: &str) -> Result<Vec<String>, String> {
        let found = self.evaluate(&format!("({function})({arguments})"))?;
        let list = found.as_array().ok_or_else(|| format!("no sentences: {found}"))?;
        Ok(list.iter().filter_map(Value::as_str).map(str::to_owned).collect())
    }
}

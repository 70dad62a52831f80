//! One kind of failure for the whole program: a message, where it applies, and the exit code.

use std::fmt;
use std::path::Path;

use pkm_core::{KinematicsError, ToolError};

/// Whose fault it is; sets the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Bad options. Exit 2.
    Usage,
    /// Bad file. Exit 2.
    Input,
    /// A pose that the machine cannot take; carries the status. Exit 2.
    Refused(&'static str),
    /// Anything else, such as an unwritable folder. Exit 1.
    Other,
}

impl Kind {
    /// As `error.kind` in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Usage => "usage",
            Self::Input => "input",
            Self::Refused(status) => status,
            Self::Other => "other",
        }
    }
}

/// A failed command: one message that says what to mend, and where.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Whose fault.
    pub kind: Kind,
    /// What happened and what was expected.
    pub message: String,
    /// File, as the user named it.
    pub file: Option<String>,
    /// Line, from 1.
    pub line: Option<u64>,
    /// Column name of a CSV, key of a TOML or JSON.
    pub column: Option<String>,
    /// Of a check, which does not end at the first.
    pub others: Option<Box<Others>>,
}

/// What a check says beside its first failure.
#[derive(Clone, Debug)]
pub struct Others {
    /// The other failures.
    pub failures: Vec<Failure>,
    /// What `--json` has beside the error.
    pub document: serde_json::Value,
}

/// What every function here returns.
pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    fn new(kind: Kind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), file: None, line: None, column: None, others: None }
    }

    /// Bad options.
    pub fn usage(message: impl Into<String>) -> Self {
        Self::new(Kind::Usage, message)
    }

    /// Bad file.
    pub fn input(message: impl Into<String>) -> Self {
        Self::new(Kind::Input, message)
    }

    /// A pose that the machine cannot take.
    pub fn refused(status: &'static str, message: impl Into<String>) -> Self {
        Self::new(Kind::Refused(status), message)
    }

    /// Anything else.
    pub fn other(message: impl Into<String>) -> Self {
        Self::new(Kind::Other, message)
    }

    /// Names the file.
    pub fn in_file(mut self, file: impl Into<String>) -> Self {
        self.file = Some(file.into());
        self
    }

    /// Names the line.
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Names the column or key.
    pub fn at_column(mut self, column: impl Into<String>) -> Self {
        self.column = Some(column.into());
        self
    }

    /// Adds what else a check has found.
    pub fn with_others(mut self, failures: Vec<Self>, document: serde_json::Value) -> Self {
        self.others = Some(Box::new(Others { failures, document }));
        self
    }

    /// An operating system's error on a path.
    pub fn io(action: &str, path: &Path, error: &std::io::Error) -> Self {
        Self::other(format!("cannot {action}: {error}")).in_file(path.display().to_string())
    }

    /// 2 for what the user can mend in the call or its files, else 1.
    pub fn exit_code(&self) -> u8 {
        if self.kind == Kind::Other { 1 } else { 2 }
    }

    /// The document of `--json`.
    pub fn to_json(&self) -> serde_json::Value {
        let mut document = self.others.as_ref().map_or(serde_json::json!({}), |others| others.document.clone());
        document["error"] = serde_json::json!({
            "kind": self.kind.name(), "message": self.to_string(),
            "file": self.file, "line": self.line, "column": self.column,
        });
        if let Kind::Refused(status) = self.kind {
            document["status"] = status.into();
        }
        document
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", printable(file))?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            f.write_str(" ")?;
        }
        if let Some(column) = &self.column {
            write!(f, "{}: ", printable(column))?;
        }
        f.write_str(&printable(&self.message))
    }
}

/// The status of a refusal by the kinematics, as JSON has it.
pub fn status(error: KinematicsError) -> &'static str {
    match error {
        KinematicsError::Unreachable => "unreachable",
        KinematicsError::Singular => "singular",
        KinematicsError::OutOfTravel { .. } => "out_of_travel",
        _ => "not_finite",
    }
}

/// The status as JSON has it: a wrist's limits count as travel.
pub fn tool_status(error: ToolError) -> &'static str {
    match error {
        ToolError::WristLimit { .. } => "out_of_travel",
        ToolError::Singular => "singular",
        ToolError::Kinematics(e) => status(e),
        _ => "unreachable",
    }
}

/// Text from a file, cut where it is too long for a message.
pub(crate) fn clipped(text: &str) -> String {
    const MAX_LENGTH: usize = 120;
    let end = text.char_indices().nth(MAX_LENGTH).map(|(end, _)| end);
    end.map_or_else(|| text.to_owned(), |end| format!("{}…", &text[..end]))
}

/// What to do about a cell that looks like a number and is none.
pub(crate) fn advice(cell: &str) -> &'static str {
    const MONTHS: [&str; 13] =
        ["jan", "feb", "mar", "mär", "apr", "may", "mai", "jun", "jul", "aug", "sep", "okt", "oct"];
    let lower = cell.to_lowercase();
    let begins_with_number = cell.trim_start_matches(['-', '+', '.']).starts_with(|c: char| c.is_ascii_digit());
    let is_number_without =
        |marks: &[char]| cell.contains(marks) && cell.replace(marks, "").parse::<f64>().is_ok_and(f64::is_finite);
    if cell.starts_with(['\u{2212}', '\u{2013}', '\u{2014}']) {
        ": write the minus as -"
    } else if lower.contains('d') && lower.replacen('d', "e", 1).parse::<f64>().is_ok() {
        ": write the exponent with E"
    } else if is_number_without(&['\'', '=', '"']) {
        ": a spreadsheet's text; save the numbers as numbers"
    } else if is_number_without(&['(', ')'])
        || is_number_without(&[' '])
        || cell.ends_with('-') && is_number_without(&['-'])
    {
        ": write a minus in front of the digits, and no space or bracket"
    } else if begins_with_number && MONTHS.iter().any(|month| lower.contains(month)) {
        ": the spreadsheet has made a date of a number; make the column numbers or text and save it again"
    } else if begins_with_number && cell.contains(',') && !cell.contains('.') {
        ": write a decimal point, or semicolons between cells"
    } else if begins_with_number && cell.ends_with(|c: char| c.is_alphabetic() || "°%'\"".contains(c)) {
        ": write it without unit"
    } else {
        ""
    }
}

/// Most bytes of a name that is compared with those that are known: a longer one is no typing error, and would take its time.
pub(crate) const MAX_TYPO_BYTES: usize = 64;

/// Lines for a message: the first of them, and how many more.
pub fn lines_text(lines: &[u64]) -> String {
    const SHOWN: usize = 6;
    let first: Vec<String> = lines.iter().take(SHOWN).map(u64::to_string).collect();
    let more = if lines.len() > SHOWN { format!(" and {} more", lines.len() - SHOWN) } else { String::new() };
    format!("line{} {}{more}", if lines.len() == 1 { "" } else { "s" }, first.join(", "))
}

/// Text from a file, fit for a terminal or a comment: no control or direction marks, not endless.
pub fn printable(text: &str) -> String {
    const MAX_LENGTH: usize = 600;
    let is_mark =
        |c: char| matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let safe = |c: char| if c.is_control() || is_mark(c) { '\u{fffd}' } else { c };
    let mut shown: String = text.chars().take(MAX_LENGTH).map(safe).collect();
    if text.chars().nth(MAX_LENGTH).is_some() {
        shown.push('…');
    }
    shown
}

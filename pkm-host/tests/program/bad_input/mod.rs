//! Bad input of the kinds that people and programs make: one message that says what to mend and where, exit status 2, nothing
//! written, whatever was wrong. What a kind is, and what has to be said of it, stands in tables, a file for each reader.

mod arguments;
mod job;
mod machine;
mod measured;
mod path;
mod poses;
mod stiffness;
mod table;

use std::path::Path;
use std::process::Output;

use rayon::prelude::*;
use serde_json::Value;

use crate::common::{Folder, run};

/// What is wrong, how it is made of a good file, where the message must say that it is (what follows the file's name: `:`, the
/// line, `: `, the key), and other words of it, with `|` between.
pub type Kind = (&'static str, Spoil, &'static str, &'static str);

/// How a good file is spoilt.
pub enum Spoil {
    /// This text, which is there, becomes that.
    Put(&'static str, &'static str),
    /// Any change.
    Make(fn(&str) -> Vec<u8>),
    /// Something at the path that is no ordinary file.
    Node(fn(&Path)),
}
pub use Spoil::{Make, Node, Put};

/// No text at all, the same for every reader.
const ANY: [Kind; 8] = [
    ("no such file", Node(|_| ()), ": ", "cannot read|No such file"),
    ("a folder", Node(|path| std::fs::create_dir(path).unwrap()), ": ", "cannot read|directory"),
    #[cfg(unix)]
    ("a link to itself", Node(|path| std::os::unix::fs::symlink(path, path).unwrap()), ": ", "cannot read|links"),
    #[cfg(unix)]
    (
        "a link to nothing",
        Node(|path| std::os::unix::fs::symlink("gone", path).unwrap()),
        ": ",
        "cannot read|No such file",
    ),
    ("UTF-16 without", Make(utf16), ":1: ", "UTF-16|save the file as UTF-8"),
    ("a NUL byte", Make(|text| format!("{text}\0").into_bytes()), "", "NUL"),
    (
        "a spreadsheet's own file",
        Make(|_| b"PK\x03\x04\x14\0\x06\0\x08\0\0\0!\0".to_vec()),
        ": ",
        "spreadsheet|CSV UTF-8",
    ),
    ("a picture", Make(|_| b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec()), ":1: ", "UTF-8"),
];

/// Other encodings, refused by every reader but those of measured data and of points.
const ENCODINGS: [Kind; 2] = [
    ("UTF-16 with its mark", Make(|text| utf16(&format!("\u{feff}{text}"))), ":1: ", "UTF-16|save the file as UTF-8"),
    ("a byte of Latin-1", Make(|text| [b"# \xb0\n", text.as_bytes()].concat()), ":1: ", "UTF-8"),
];

fn utf16(text: &str) -> Vec<u8> {
    text.encode_utf16().flat_map(u16::to_le_bytes).collect()
}

/// What reads a file, with `BAD` and `OUT` for the paths in its call.
pub struct Reader<'a> {
    /// The good file.
    pub good: &'a str,
    /// Name of the bad one.
    pub name: &'a str,
    /// The arguments.
    pub call: &'a [&'a str],
    /// Something that such a call writes over: `out` or in the folder `out`.
    pub old: &'a str,
}

impl Reader<'_> {
    /// Tries all kinds, and those of [`ANY`] file in any encoding.
    pub fn refuses(&self, kinds: &[Kind], at_least: usize) {
        self.refuses_text(&kinds.iter().chain(&ENCODINGS).collect::<Vec<_>>(), at_least);
    }

    /// Tries all kinds, and those of [`ANY`] file.
    pub fn refuses_text(&self, kinds: &[&Kind], at_least: usize) {
        let all: Vec<&Kind> = kinds.iter().copied().chain(&ANY).collect();
        assert!(all.len() >= at_least, "{} kinds", all.len());
        let wrong: Vec<String> = all.par_iter().filter_map(|kind| self.refuses_one(kind).err()).collect();
        assert!(wrong.is_empty(), "{} of {} kinds:\n{}", wrong.len(), all.len(), wrong.join("\n"));
    }

    fn refuses_one(&self, (what, spoil, at, words): &Kind) -> Result<(), String> {
        let folder = Folder::new();
        let bad = folder.path(self.name);
        match spoil {
            Put(from, to) if !self.good.contains(from) => return Err(format!("{what}: no `{from}` in the good file")),
            Put(from, to) => drop(folder.write(self.name, &self.good.replacen(from, to, 1))),
            Make(change) => std::fs::write(&bad, change(self.good)).unwrap(),
            Node(make) => make(Path::new(&bad)),
        }
        self.calls(&folder, &format!("{bad}{at}"), words).map_err(|wrong| format!("{what}: {wrong}"))
    }

    /// Calls the program for text with nothing at `OUT`, and for JSON with old files there.
    fn calls(&self, folder: &Folder, at: &str, words: &str) -> Result<(), String> {
        let out = folder.path("out");
        // at the beginning alone: a temporary folder may have these letters in its name
        let of = |a: &&str| match (a.strip_prefix("BAD"), a.strip_prefix("OUT")) {
            (Some(rest), _) => folder.path(self.name) + rest,
            (_, Some(rest)) => out.clone() + rest,
            _ => (*a).to_owned(),
        };
        let args: Vec<String> = self.call.iter().map(of).collect();
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        let before = folder.contents();
        let output = run(&args);
        let message = one_message(&output)?;
        require(output.stdout.is_empty(), "something on standard output", &message)?;
        require(message.starts_with(at), &format!("expected to begin with `{at}`"), &message)?;
        for word in words.split('|') {
            require(message.contains(word), &format!("no `{word}` in it"), &message)?;
        }
        require(!Path::new(&out).exists() && folder.contents() == before, "something was written", &message)?;

        let old = folder.path(self.old);
        std::fs::create_dir_all(Path::new(&old).parent().unwrap()).unwrap();
        folder.write(self.old, "old");
        let before = folder.contents();
        let output = run(&[&args, &["--json"][..]].concat());
        require(one_message(&output)? == message, "not the same message with --json", &message)?;
        let document: Value =
            serde_json::from_slice(&output.stdout).map_err(|e| format!("no JSON ({e}): {message}"))?;
        let error = &document["error"];
        require(error["message"] == *message, "another message in the document", &message)?;
        let part = |name: &str| error[name].as_str().map(str::to_owned).or(error[name].as_u64().map(|n| n.to_string()));
        let line = part("line").map_or(String::new(), |line| format!("{line}:"));
        let column = part("column").map_or(String::new(), |column| format!("{column}: "));
        let place = format!("{}:{line} {column}", part("file").unwrap_or_default());
        require(message.starts_with(&place), &format!("the document's place is `{place}`"), &message)?;
        require(folder.contents() == before, "an old file was changed", &message)?;
        Ok(())
    }
}

/// The message, when there is but one, of one line.
fn one_message(output: &Output) -> Result<String, String> {
    let text = readable(output)?;
    require(text.lines().count() == 1, "more than a line", &text)?;
    Ok(text.trim_end().trim_start_matches("error: ").to_owned())
}

/// What a refused call says, when it is one message fit to be read.
fn readable(output: &Output) -> Result<String, String> {
    let text = String::from_utf8_lossy(&output.stderr);
    // a column that is not used may be the one that is missing
    let text: String = text.split_inclusive('\n').skip_while(|line| line.starts_with("warning: ")).collect();
    require(output.status.code() == Some(2), &format!("{}", output.status), &text)?;
    require(text.starts_with("error: ") && text.matches("error: ").count() == 1, "not one message", &text)?;
    require(text.len() < 1500, "endless", &text)?;
    // of the program's inside
    for word in ["panicked", "struct ", "enum ", "variant", "serde::", ".rs:", "Some(", "expected f64"] {
        require(!text.contains(word), &format!("`{word}` in it"), &text)?;
    }
    Ok(text)
}

fn require(good: bool, wrong: &str, message: &str) -> Result<(), String> {
    let shown: String = message.chars().take(700).collect();
    if good { Ok(()) } else { Err(format!("{wrong}: {shown}")) }
}

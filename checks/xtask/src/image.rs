//! What is in a library or an image, by the toolchain's own LLVM tools.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use crate::output;

/// A tool of the component `llvm-tools`.
pub fn llvm(tool: &str) -> Result<Command, String> {
    let libraries = output(Command::new("rustc").args(["--print", "target-libdir"]))?;
    let path = Path::new(libraries.trim()).with_file_name("bin").join(tool);
    if path.exists() { Ok(Command::new(path)) } else { Err(format!("no {tool}: rustup component add llvm-tools")) }
}

/// A symbol of an image or of the objects of a library.
pub struct Symbol {
    /// As nm prints it: `T` code, `R` constants, `D` and `B` memory, `U` undefined; small letters for local ones.
    pub kind: char,
    pub name: String,
}

pub fn symbols(file: &Path) -> Result<Vec<Symbol>, String> {
    let text = output(llvm("llvm-nm")?.args(["--demangle", "--quiet"]).arg(file))?;
    let symbol = |line: &str| {
        // address (absent when undefined), kind, name
        let words = line.trim_start();
        let words = if line.starts_with(' ') { words } else { words.split_once(' ')?.1 };
        let (kind, name) = words.split_once(' ')?;
        Some(Symbol { kind: kind.chars().next()?, name: name.to_owned() })
    };
    Ok(text.lines().filter_map(symbol).collect())
}

/// Sizes of the sections by name.
pub fn sections(image: &Path) -> Result<BTreeMap<String, u64>, String> {
    let text = output(llvm("llvm-size")?.arg("-A").arg(image))?;
    let section = |line: &str| {
        let mut words = line.split_whitespace();
        Some((words.next()?.to_owned(), words.next()?.parse().ok()?))
    };
    Ok(text.lines().filter_map(section).collect())
}

/// Address and length of the first symbol of an image whose name begins so.
pub fn place(image: &Path, name: &str) -> Result<(u32, usize), String> {
    let text = output(llvm("llvm-nm")?.args(["--demangle", "--print-size"]).arg(image))?;
    let place = |line: &str| {
        let mut words = line.splitn(4, ' ');
        let mut number = || u32::from_str_radix(words.next()?, 16).ok();
        let (address, length) = (number()?, number()?);
        words.nth(1)?.starts_with(name).then_some((address, length as usize))
    };
    text.lines().find_map(place).ok_or_else(|| format!("{} has no {name}", image.display()))
}

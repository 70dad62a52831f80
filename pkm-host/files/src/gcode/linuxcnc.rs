//! LinuxCNC's stand-alone interpreter, `rs274`, as an outside program that reads what ours does not.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use super::canonical::{Canonical, Expanded, File, UNKNOWN, mark};
use super::words::Line;
use super::{MAX_MOVES, Setup};
use crate::error::{Failure, Result};
use crate::source::Source;
use crate::tool_path::refuse_compensated;

const MAIN: &str = "pkm-host.ngc";
const TOOLS: &str = "tool.tbl";
const PARAMETERS: &str = "rs274.var";
const SAID: &str = "said.txt";
/// The interpreter's own unit, in which it takes tools and reference points.
const INCH_MM: f64 = 25.4;
/// Most lines one after another that do nothing.
const MAX_IDLE_LINES: u32 = 1_000_000;
/// So often a start is tried while another thread holds the copy open, with 10 ms between.
const START_TRIES: u32 = 500;
/// Most files of subroutines.
const MAX_FILES: usize = 1000;

/// The program in plain words, as `rs274` understands it. Subroutines that the program does not have are looked for in its folder.
///
/// # Errors
/// `rs274` is not there; what it refuses, with the line; what has no part in a compensated program.
pub(super) fn expand(rs274: &Path, source: &Source, folder: &Path, setup: &Setup) -> Result<Expanded> {
    let sources = with_subroutines(source, folder)?;
    let mut files = Vec::new();
    for (name, source) in &sources {
        files.push(File { name: name.clone(), lines: source.text()?.lines().collect() });
    }
    let work = tempfile::Builder::new().prefix("pkm-host-").tempdir();
    let work = work.map_err(|e| Failure::other(format!("cannot make a folder for rs274: {e}")))?;
    for (file, File { name, lines }) in files.iter().enumerate() {
        let text = if file == 0 { preamble(setup) + &marked(file, lines) } else { marked(file, lines) };
        write(&work.path().join(if file == 0 { MAIN } else { name }), text.as_bytes())?;
    }
    write(&work.path().join(TOOLS), setup.tools.to_table(INCH_MM).as_bytes())?;
    write(&work.path().join(PARAMETERS), parameters(setup).as_bytes())?;
    let rs274 = with_more_decimals(rs274, work.path())?;
    let mut child = start(&rs274, work.path(), setup.block_delete)?;
    let mut canonical = Canonical::new(setup, &files);
    let refused = follow(&mut child, &mut canonical);
    // after a refusal it may be in a loop without end
    _ = if refused.is_err() { child.kill() } else { Ok(()) };
    let status = child.wait().map_err(|e| Failure::io("run", &rs274, &e))?;
    let refused = refused.and_then(|()| if status.success() { Ok(()) } else { Err(complaint(work.path(), status)) });
    match refused {
        Ok(()) => Ok(canonical.finish()),
        Err(why) => {
            let failure = Failure::input(format!("{}{why}", canonical.place())).in_file(&source.name);
            Err(failure.at_line(canonical.line))
        }
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|e| Failure::io("write", path, &e))
}

/// The program, and the files of its folder that it or they call.
fn with_subroutines(source: &Source, folder: &Path) -> Result<Vec<(String, Source)>> {
    let mut sources = vec![(source.file_name(), source.clone())];
    let mut next = 0;
    while let Some((_, source)) = sources.get(next) {
        let mut called = Vec::new();
        for line in source.text()?.lines().filter(|l| l.contains(['O', 'o', 'M', 'm'])) {
            let Ok(line) = Line::parse(line) else { continue };
            let program = line.words.iter().find(|w| w.letter == 'P' && line.words.iter().any(|w| w.is('M', &[98.0])));
            called.extend(program.map(|p| p.value.to_string()));
            called.extend(line.label.filter(|l| l.keyword == "call").map(|l| l.name));
        }
        for name in called {
            let name = format!("{}.ngc", name.trim_matches(['<', '>']));
            let path = folder.join(&name);
            let is_new = !name.contains(['/', '\\']) && sources.iter().skip(1).all(|(n, _)| *n != name);
            if is_new && sources.len() <= MAX_FILES && path.is_file() {
                let subroutine = Source::read(&path)?;
                refuse_compensated(&subroutine)?;
                sources.push((name, subroutine));
            }
        }
        next += 1;
    }
    Ok(sources)
}

/// Before the program: work frames, and each axis at a place that nobody can mean.
fn preamble(setup: &Setup) -> String {
    let mut text = "G21 G90\n".to_owned();
    for (frame, origin_mm) in setup.offsets.frames_mm.iter().enumerate() {
        // without a job coordinates are those of B
        let [x, y, z] = origin_mm.unwrap_or([if frame == 0 { 0.0 } else { UNKNOWN }; 3]);
        text += &format!("G10 L2 P{} X{x} Y{y} Z{z}\n", frame + 1);
    }
    let axes: String = "XYZABC".chars().map(|letter| format!(" {letter}{UNKNOWN}")).collect();
    text + &format!("G53 G0{axes}\nG80\n")
}

/// The lines, each behind a comment that names it.
fn marked(file: usize, lines: &[&str]) -> String {
    let mut text = String::new();
    let mut has_words = false;
    for (n, line) in lines.iter().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        if line.trim() == "%" {
            // at the end of a program the same as M2
            text += if has_words && file == 0 { "M2\n" } else { "" };
            continue;
        }
        has_words = true;
        let switch = if line.trim_start().starts_with('/') { "/" } else { "" };
        text += &format!("{switch}{}\n{line}\n", mark(file, n));
    }
    text
}

/// What the control is taken to keep. A parameter that the program has not set is no number, so that the interpreter refuses it; but #1 to #30,
/// which are a subroutine's own, and which the interpreter looks at where it passes over one.
fn parameters(setup: &Setup) -> String {
    let mut values = vec![0.0; 5601];
    values[31..5061].fill(f64::NAN);
    let has_head = setup.head.is_some();
    for (from, reference) in [5161, 5181].into_iter().zip(setup.offsets.references) {
        let reference = reference.unwrap_or([UNKNOWN; 5]);
        for (i, value) in values[from..from + 6].iter_mut().enumerate() {
            *value = match reference.get(i) {
                Some(mm) if i < 3 => mm / INCH_MM,
                Some(deg) if !has_head => *deg,
                _ => UNKNOWN,
            };
        }
    }
    values.iter().enumerate().skip(1).map(|(n, value)| format!("{n} {value}\n")).collect()
}

fn missing(rs274: &Path, why: &str) -> Failure {
    let message = format!(
        "--interpreter: {why}. Install LinuxCNC (Debian: apt-get install linuxcnc-uspace) or name its stand-alone interpreter, rs274"
    );
    Failure::usage(message).in_file(rs274.display().to_string())
}

/// A copy of the interpreter that prints nine decimals. Its own four are 5e-5 mm or, in inches, 1.3 µm, and no option gives more; how many they
/// are stands in it as text, which is as long for nine.
fn with_more_decimals(rs274: &Path, folder: &Path) -> Result<PathBuf> {
    let found = if rs274.components().count() > 1 {
        Some(rs274.to_owned())
    } else {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&folders).map(|folder| folder.join(rs274)).find(|path| path.is_file())
    };
    let found = found.ok_or_else(|| missing(rs274, "there is no such program"))?;
    let mut bytes = std::fs::read(&found).map_err(|e| missing(rs274, &e.to_string()))?;
    let (few, many) = (b"%.4f", b"%.9f");
    let places: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at..].starts_with(few)).collect();
    for at in &places {
        bytes[*at..at + few.len()].copy_from_slice(many);
    }
    if places.is_empty() {
        return Err(missing(rs274, "it is another program"));
    }
    let copy = folder.join("rs274");
    write(&copy, &bytes)?;
    let permissions = std::fs::metadata(&found).map_err(|e| Failure::io("read", &found, &e))?.permissions();
    std::fs::set_permissions(&copy, permissions).map_err(|e| Failure::io("write", &copy, &e))?;
    Ok(copy)
}

fn start(rs274: &Path, folder: &Path, block_delete: bool) -> Result<Child> {
    let failed = |e: std::io::Error| {
        let message = format!("cannot start a copy of rs274: {e}; TMPDIR names a folder for it");
        Failure::other(message).in_file(rs274.display().to_string())
    };
    for _ in 0..START_TRIES {
        let said = std::fs::File::create(folder.join(SAID)).map_err(failed)?;
        let child = Command::new(rs274)
            .args(["-g", "-t", TOOLS, "-v", PARAMETERS])
            .args(block_delete.then_some("-b"))
            .arg(MAIN)
            .current_dir(folder)
            .env("LC_ALL", "C")
            // of a LinuxCNC that runs here: its settings, and its tool table, which rs274 would write over in the user's folder
            .env_remove("INI_FILE_NAME")
            .env("HOME", folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(said)
            .spawn();
        match child {
            // another thread was starting a program while the copy was written
            Err(e) if e.kind() == std::io::ErrorKind::ExecutableFileBusy => {
                std::thread::sleep(std::time::Duration::from_millis(10));
            }
            child => return child.map_err(failed),
        }
    }
    Err(failed(std::io::ErrorKind::ExecutableFileBusy.into()))
}

/// Takes what the interpreter prints, to its end or to what is refused.
fn follow(child: &mut Child, canonical: &mut Canonical<'_>) -> std::result::Result<(), String> {
    let Some(printed) = child.stdout.take() else { return Ok(()) };
    let mut printed = BufReader::new(printed);
    let (mut line, mut comments) = (Vec::new(), 0);
    for _ in 0..2 * MAX_MOVES {
        line.clear();
        match printed.read_until(b'\n', &mut line) {
            Ok(0) => return Ok(()),
            Ok(_) => canonical.take(String::from_utf8_lossy(&line).trim_end())?,
            Err(e) => return Err(format!("cannot read what rs274 prints: {e}")),
        }
        comments = if line.windows(8).any(|w| w == b"COMMENT(") { comments + 1 } else { 0 };
        if comments > MAX_IDLE_LINES {
            break;
        }
    }
    Err("LinuxCNC's interpreter comes to no end: does a loop end? Else divide the program".into())
}

/// What the interpreter has said last: a message, and the line.
fn complaint(folder: &Path, status: ExitStatus) -> String {
    let said = std::fs::read(folder.join(SAID)).unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    let last: Vec<&str> = said.lines().rev().take(2).collect();
    let [line, message] = last[..] else { return format!("LinuxCNC's interpreter ends without a reason ({status})") };
    // the file that it names is a copy
    if let Some((_, name)) = message.split_once("seeking o-word: ") {
        let name = name.split(" from line").next().unwrap_or(name);
        return format!("`{name}` is neither in the program nor in a file of its folder, or has no end");
    }
    let hint = match message {
        m if m.contains("not found in the tool table") => ": give it with --tools",
        m if m.contains("not a number") => ": does a parameter have no value? Set it in the program before this line",
        m if m.contains("zero spindle speed") => ": give S before it, or F in G94",
        m if m.contains("no percent sign or program end") => ": end it with M2 or M30",
        _ => "",
    };
    let line: String = line.trim().chars().take(80).collect();
    format!("LinuxCNC's interpreter says of `{line}`: {message}{hint}")
}

//! Text that came from a file or from the embedded fixtures, and files that are written whole or not at all.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use pkm_fixtures::Fixture;
use serde::Serialize;

use crate::error::{Failure, Result, printable};

/// Most bytes that a file may have: a million poses, and no endless device.
const MAX_BYTES: u64 = 500_000_000;

/// A named text.
#[derive(Clone, Debug)]
pub struct Source {
    /// Path as the user gave it, or the fixture's path in the repository.
    pub name: String,
    /// Lines end with LF or CR LF.
    bytes: Arc<[u8]>,
    sha256: String,
}

impl Source {
    fn new(name: String, mut bytes: Vec<u8>) -> Self {
        let sha256 = sha256(&bytes);
        // some spreadsheets end lines with CR alone, which nobody counts as lines; in UTF-16 the byte may be half a character
        let is_utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        if !is_utf16 && !bytes.contains(&b'\n') {
            bytes.iter_mut().filter(|b| **b == b'\r').for_each(|b| *b = b'\n');
        }
        Self { name, bytes: bytes.into(), sha256 }
    }

    /// A fixture.
    pub fn embedded(fixture: Fixture) -> Self {
        Self::from_text(fixture.path, fixture.text.to_owned())
    }

    /// A text that is about to become a file.
    pub fn from_text(name: &str, text: String) -> Self {
        Self::new(name.to_owned(), text.into_bytes())
    }

    /// The bytes of a file, which may be in any encoding.
    pub fn from_bytes(name: &str, bytes: Vec<u8>) -> Self {
        Self::new(name.to_owned(), bytes)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// An input failure when it can't be read.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let mut bytes = Vec::new();
        match File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes)) {
            Ok(length) if length as u64 > MAX_BYTES => {
                Err(Failure::input(format!("too large: more than {} MB", MAX_BYTES / 1_000_000)).in_file(name))
            }
            Ok(_) => Ok(Self::new(name, bytes)),
            Err(e) => Err(Failure::input(format!("cannot read: {e}")).in_file(name)),
        }
    }

    /// A file, or a fixture when none is named.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_or(path: Option<&Path>, fixture: Fixture) -> Result<Self> {
        path.map_or_else(|| Ok(Self::embedded(fixture)), Self::read)
    }

    /// As they were read, but for line ends of CR alone.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The text without byte-order mark.
    ///
    /// # Errors
    /// The line that is not UTF-8; a spreadsheet that was not saved as text.
    pub fn text(&self) -> Result<&str> {
        let fail = |message: &str| Failure::input(message).in_file(&self.name);
        let line = |byte: usize| 1 + self.bytes[..byte].iter().filter(|b| **b == b'\n').count() as u64;
        if let [b'P', b'K', 3, 4, ..] | [0xd0, 0xcf, 0x11, 0xe0, ..] = self.bytes[..] {
            return Err(fail("not text, but a spreadsheet's own file or an archive: save a sheet as `CSV UTF-8`"));
        }
        if let [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [0, _, ..] | [_, 0, ..] = self.bytes[..] {
            return Err(fail("text in UTF-16, as it seems: save the file as UTF-8, a sheet as `CSV UTF-8`").at_line(1));
        }
        let text = std::str::from_utf8(&self.bytes).map_err(|e| {
            fail("not UTF-8 text: save the file as UTF-8, a sheet as `CSV UTF-8`").at_line(line(e.valid_up_to()))
        })?;
        if let Some(byte) = text.find('\0') {
            return Err(fail("a NUL byte: not text, or a damaged file").at_line(line(byte)));
        }
        Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
    }

    /// SHA-256 of the file, hexadecimal.
    pub fn sha256(&self) -> String {
        self.sha256.clone()
    }

    /// The last part of the name, fit for a comment: what a table records, the same wherever the file lies.
    pub fn file_name(&self) -> String {
        printable(self.name.rsplit(['/', '\\']).next().unwrap_or(&self.name))
    }
}

/// SHA-256, hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hmac_sha256::Hash::hash(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// A document as a file has it.
pub fn json(document: &impl Serialize) -> String {
    serde_json::to_string_pretty(document).expect("keys are text") + "\n"
}

/// The folder that a file is in.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The name of a file, unless the path is that of a folder.
pub fn name_of(path: &Path) -> Option<&OsStr> {
    path.file_name().filter(|_| !path.as_os_str().as_encoded_bytes().ends_with(b"/"))
}

/// Makes a folder, with those that it is in, where there is none.
///
/// # Errors
/// What the operating system says, with the path, or that a file is in the way.
pub fn make_folder(folder: &Path) -> Result<()> {
    use std::io::{Error, ErrorKind};
    std::fs::create_dir_all(folder).map_err(|e| {
        let in_the_way = matches!(e.kind(), ErrorKind::AlreadyExists | ErrorKind::NotADirectory);
        let e = if in_the_way { Error::other("a file is in the way") } else { e };
        Failure::io("create the folder", folder, &e)
    })
}

/// Refuses to write over what is read.
///
/// # Errors
/// The file that would be lost, by whatever way its path or a link leads there.
pub fn keep_inputs(outputs: &[impl AsRef<Path>], inputs: &[Option<&Path>]) -> Result<()> {
    // nothing is lost where there is no file yet, nor in a device or a pipe
    let real = |path: &Path| path.canonicalize().ok().filter(|p| p.is_file());
    for input in inputs.iter().flatten() {
        let kept = real(input);
        if kept.is_some() && outputs.iter().any(|output| real(output.as_ref()) == kept) {
            let message =
                format!("--out would overwrite {}, which is read: give another name or folder", input.display());
            return Err(Failure::usage(message));
        }
    }
    Ok(())
}

/// Writes files so that each is there whole or not at all, none before all could be written, and none over an input: they are
/// written beside the old ones, and take their places, one after the other, when nothing but a name has to change. Who stops the
/// program at that very moment finds some files old and some new, none in part; what it has written beside them is cleared away
/// by a later run. Says what it wrote, as a line for the user.
///
/// # Errors
/// What the operating system says, with the path; see [`keep_inputs`].
pub fn write_all(
    folder: &Path,
    files: &[(impl AsRef<Path>, impl AsRef<[u8]>)],
    inputs: &[Option<&Path>],
) -> Result<String> {
    let paths: Vec<_> = files.iter().map(|(name, _)| folder.join(name)).collect();
    keep_inputs(&paths, inputs)?;
    make_folder(folder)?;
    let mut ready = Vec::new();
    for (path, (_, content)) in paths.into_iter().zip(files) {
        // a link keeps pointing, a device or a pipe is written to and not replaced
        let path = std::fs::canonicalize(&path).unwrap_or(path);
        let written = match std::fs::metadata(&path) {
            Ok(there) if there.is_dir() => Err(std::io::Error::other("a folder of this name is in the way")),
            Ok(there) if !there.is_file() => std::fs::write(&path, content.as_ref()).map(|()| None),
            Ok(there) if there.permissions().readonly() => Err(std::io::Error::other("the file is write-protected")),
            _ => temporary_in(path.parent().unwrap_or(folder)).and_then(|mut file| {
                file.write_all(content.as_ref())?;
                file.as_file().sync_all()?;
                Ok(Some(file))
            }),
        };
        match written {
            Ok(file) => ready.extend(file.map(|f| (f, path))),
            Err(e) => return Err(Failure::io("write", &path, &e)),
        }
    }
    for (file, path) in ready {
        file.persist(&path).map_err(|e| Failure::io("write", &path, &e.error))?;
    }
    let names: Vec<_> = files.iter().map(|(name, _)| name.as_ref().display().to_string()).collect();
    let names = match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    };
    Ok(format!("wrote {names} to {}\n", folder.display()))
}

/// Writes one file, see [`write_all`].
///
/// # Errors
/// What the operating system says, with the path.
pub fn write(path: &Path, content: String, inputs: &[Option<&Path>]) -> Result<()> {
    let name =
        name_of(path).ok_or_else(|| Failure::usage("expected a file name").in_file(path.display().to_string()))?;
    write_all(folder_of(path), &[(name, content)], inputs).map(drop)
}

/// Whether a file of this name can be written, before a long computation.
///
/// # Errors
/// What the operating system says, with the path.
pub fn check_writable(path: &Path) -> Result<()> {
    let folder = folder_of(path);
    make_folder(folder)?;
    if path.is_dir() {
        let error = std::io::Error::other("a folder of this name is in the way");
        return Err(Failure::io("write", path, &error));
    }
    // a device or a pipe is written to as it is
    if path.exists() && !path.is_file() {
        return Ok(());
    }
    temporary_in(folder).map(drop).map_err(|e| Failure::io("write", path, &e))
}

/// How the names of files begin that are not yet whole.
const UNFINISHED: &str = ".pkm-host-";

/// A temporary file with the permissions of an ordinary one.
fn temporary_in(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    clear_unfinished(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Removes what runs left that were killed while they wrote, if it can: no file takes an hour to write.
fn clear_unfinished(folder: &Path) {
    for entry in folder.read_dir().into_iter().flatten().flatten() {
        let age = || entry.metadata().and_then(|m| m.modified()).ok().and_then(|written| written.elapsed().ok());
        if entry.file_name().as_encoded_bytes().starts_with(UNFINISHED.as_bytes())
            && age().is_some_and(|age| age > Duration::from_secs(3600))
        {
            drop(std::fs::remove_file(entry.path()));
        }
    }
}

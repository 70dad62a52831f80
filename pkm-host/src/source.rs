//! Text that came from a file or from the embedded fixtures, and files that are written whole or not at all.

use std::ffi::OsStr;
use std::io::Write;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{Failure, Result, printable};

/// A named text.
#[derive(Clone, Debug)]
pub struct Source {
    /// Path as the user gave it, or the fixture's path in the repository.
    pub name: String,
    /// Lines end with LF or CR LF.
    bytes: Vec<u8>,
    sha256: String,
}

/// The fixtures that stand in where a command is not given a file.
pub mod fixtures {
    use super::Source;

    fn embedded(name: &str, text: &str) -> Source {
        Source::new(name.to_owned(), text.as_bytes().to_vec())
    }

    /// The reference machine.
    pub fn machine() -> Source {
        embedded("fixtures/machines/reference.toml", include_str!("../../fixtures/machines/reference.toml"))
    }

    /// Its stiffness by finite elements at the 49 poses of L49.
    pub fn training() -> Source {
        embedded("fixtures/stiffness/fe-l49.csv", include_str!("../../fixtures/stiffness/fe-l49.csv"))
    }

    /// Readings under load, without any effect but scatter of the declared stiffnesses.
    pub fn measured() -> Source {
        embedded("fixtures/measured/p01/measured.csv", include_str!("../../fixtures/measured/p01/measured.csv"))
    }

    /// Plate with two series of holes.
    pub fn job() -> Source {
        embedded("fixtures/jobs/plate.toml", include_str!("../../fixtures/jobs/plate.toml"))
    }

    /// The same at 25 other poses.
    pub fn verification() -> Source {
        embedded("fixtures/stiffness/fe-verify.csv", include_str!("../../fixtures/stiffness/fe-verify.csv"))
    }
}

impl Source {
    fn new(name: String, mut bytes: Vec<u8>) -> Self {
        let sha256 = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
        // some spreadsheets end lines with CR alone, which nobody counts as lines
        if !bytes.contains(&b'\n') {
            bytes.iter_mut().filter(|b| **b == b'\r').for_each(|b| *b = b'\n');
        }
        Self { name, bytes, sha256 }
    }

    /// A text that is about to become a file.
    pub fn from_text(name: &str, text: String) -> Self {
        Self::new(name.to_owned(), text.into_bytes())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// An input failure when it can't be read.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        match std::fs::read(path) {
            Ok(bytes) => Ok(Self::new(name, bytes)),
            Err(e) => Err(Failure::input(format!("cannot read: {e}")).in_file(name)),
        }
    }

    /// A file, or a fixture when none is named.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_or(path: Option<&Path>, fixture: fn() -> Self) -> Result<Self> {
        path.map_or_else(|| Ok(fixture()), Self::read)
    }

    /// The text without byte-order mark.
    ///
    /// # Errors
    /// The line that is not UTF-8.
    pub fn text(&self) -> Result<&str> {
        let text = std::str::from_utf8(&self.bytes).map_err(|e| {
            let line = 1 + self.bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() as u64;
            Failure::input("not UTF-8 text: save the file as UTF-8").in_file(&self.name).at_line(line)
        })?;
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

/// Writes files so that each is there whole or not at all, and none before all could be written.
///
/// # Errors
/// What the operating system says, with the path.
pub fn write_all(folder: &Path, files: &[(&OsStr, impl AsRef<[u8]>)]) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::io("create the folder", folder, &e))?;
    let mut ready = Vec::new();
    for (name, content) in files {
        let path = folder.join(name);
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
    Ok(())
}

/// Writes one file, see [`write_all`].
///
/// # Errors
/// What the operating system says, with the path.
pub fn write(path: &Path, content: String) -> Result<()> {
    let name = path.file_name().filter(|_| !path.as_os_str().as_encoded_bytes().ends_with(b"/"));
    let name = name.ok_or_else(|| Failure::usage("expected a file name").in_file(path.display().to_string()))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    write_all(folder, &[(name, content)])
}

/// Whether a file of this name can be written, before a long computation.
///
/// # Errors
/// What the operating system says, with the path.
pub fn check_writable(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|e| Failure::io("create the folder", folder, &e))?;
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

/// A temporary file with the permissions of an ordinary one.
fn temporary_in(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

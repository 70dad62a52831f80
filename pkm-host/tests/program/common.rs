//! What the tests of the program share.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use pkm_core::FiveAxis;
use pkm_core::tables::reference::{MACHINE_F64, WRIST_F64};
use serde_json::Value;

/// The reference machine with its wrist.
pub const FIVE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };

/// Path of a fixture.
pub fn fixture(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures").join(path).display().to_string()
}

/// The reference machine's file.
pub fn reference_machine() -> String {
    std::fs::read_to_string(fixture("machines/reference.toml")).unwrap()
}

/// Runs the program.
pub fn run(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pkm-host")).args(args).output().unwrap()
}

/// The document of a call that must succeed.
pub fn json(args: &[&str]) -> Value {
    called(args, 0)
}

/// The failure of a call that must exit with 2.
pub fn refused(args: &[&str]) -> Value {
    called(args, 2)["error"].take()
}

fn called(args: &[&str], code: i32) -> Value {
    let output = run(&[args, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(code), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Numbers of a JSON array.
pub fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().unwrap_or_else(|| panic!("{value}")))
}

/// A folder with files, and their paths as text.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    pub fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn has(&self, name: &str) -> bool {
        Path::new(&self.path(name)).exists()
    }

    /// The reference machine's table.
    pub fn table(&self) -> String {
        json(&["fit", "--out", &self.path("fit")]);
        self.path("fit/coefficients.json")
    }

    /// Names and contents of everything in it.
    pub fn contents(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut files = Vec::new();
        let mut folders = vec![self.0.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in folder.read_dir().unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    // a link that leads nowhere has no contents
                    files.push((path.clone(), std::fs::read(path).unwrap_or_default()));
                }
            }
        }
        files.sort();
        files
    }
}

//! What all commands share: the machine file, warnings, and what is printed.

use std::path::{Path, PathBuf};

use pkm_core::tables::reference;
use pkm_fixtures::Fixture;
use serde::Serialize;

use super::arguments::TableArgs;
use super::say;
use crate::error::{Failure, Kind, Result, printable};
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::plan::model::{Form, Model};

/// What a command prints: text for people, or a document for programs.
pub struct Output {
    /// Without `--json`.
    pub text: String,
    /// With `--json`: one line.
    pub json: String,
}

/// A number of things in words.
pub(crate) fn counted(number: usize, one: &str) -> String {
    format!("{number} {one}{}", if number == 1 { "" } else { "s" })
}

/// A call of the program.
pub(crate) struct Session {
    /// `--machine`.
    pub(crate) machine_path: Option<PathBuf>,
    /// Said so far.
    pub(crate) warnings: Vec<String>,
    /// Whether warnings go to standard error too: not where a program calls, which finds them in the document.
    pub(crate) prints: bool,
}

impl Session {
    /// Says warnings on standard error, and keeps them for documents and reports.
    pub(crate) fn warn(&mut self, warnings: impl IntoIterator<Item = String>) {
        for warning in warnings {
            if self.prints {
                say(&format!("warning: {}\n", printable(&warning)));
            }
            self.warnings.push(warning);
        }
    }

    /// `--machine`.
    pub(crate) fn machine_path(&self) -> Option<&Path> {
        self.machine_path.as_deref()
    }

    /// The machine file, or the reference machine's.
    pub(crate) fn machine(&mut self) -> Result<MachineFile> {
        let file = MachineFile::read(self.machine_path())?;
        self.warn(file.warnings.clone());
        Ok(file)
    }

    /// A pose that the reference machine cannot take may be one of another machine.
    pub(crate) fn or_of_another_machine(&self, mut failure: Failure) -> Failure {
        if self.machine_path.is_none() && matches!(failure.kind, Kind::Refused(_)) {
            failure.message.push_str(" (the reference machine: give --machine for another)");
        }
        failure
    }

    /// The machine with a table, if one is given.
    pub(crate) fn model(&mut self, TableArgs { table, form }: &TableArgs) -> Result<Model> {
        let machine = self.machine()?;
        if table.is_none() && *form != Form::Auto {
            return Err(Failure::usage("--form says how a table is applied: give --table as well"));
        }
        let table = table.as_deref().map(Source::read).transpose()?;
        let (model, warning) = Model::new(machine, table, *form)?;
        self.warn(warning);
        Ok(model)
    }

    /// A file, or the fixture, which is the reference machine's: a machine of another size has no use for it.
    pub(crate) fn read_or_fixture(
        &mut self,
        path: Option<&Path>,
        fixture: Fixture,
        option: &str,
        machine: &MachineFile,
    ) -> Result<Source> {
        if path.is_none() {
            let (own, name) = (&machine.parameters, &machine.source.name);
            if (own.geometry, own.travel) != (reference::PARAMETERS.geometry, reference::PARAMETERS.travel) {
                let message = format!(
                    "{option} is missing: what comes with the program is the reference machine's, not that of {name}"
                );
                return Err(Failure::usage(message));
            }
            if own.limbs != reference::PARAMETERS.limbs {
                self.warn([format!("no {option}: {name} gets the reference machine's, {}", fixture.path)]);
            }
        }
        Source::read_or(path, fixture)
    }

    /// What is printed. The document is written at once: a tree of it takes many times what its line takes.
    pub(crate) fn output(&self, text: String, document: &impl Serialize) -> Result<Output> {
        #[derive(Serialize)]
        struct Document<'a, T> {
            #[serde(flatten)]
            document: &'a T,
            warnings: &'a [String],
        }
        let document = Document { document, warnings: &self.warnings };
        let json = serde_json::to_string(&document).map_err(|e| Failure::other(e.to_string()))?;
        Ok(Output { text, json })
    }
}

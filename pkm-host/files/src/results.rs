//! `diagnosis.json` and `placement.json`: what `view` shows of them, checked for shape and for the machine that they are of.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result, printable};
use crate::machine::MachineFile;
use crate::source::Source;

/// What is shown of a `diagnosis.json`.
#[derive(Serialize, Deserialize)]
pub struct DiagnosisResult {
    machine: String,
    machine_sha256: String,
    /// Of the identified model's `machine.toml`.
    identified_sha256: String,
    data: String,
    verdict: String,
    effects: Vec<FoundEffect>,
    declared_value_findings: serde_json::Value,
    error_before: serde_json::Value,
    error_after: serde_json::Value,
    readings: Vec<ShownReading>,
}

#[derive(Serialize, Deserialize)]
struct FoundEffect {
    id: String,
    #[serde(rename = "where")]
    place: String,
    where_class: Vec<String>,
    motion: String,
    law: String,
    probability: f64,
    confidence: f64,
    parameters: serde_json::Map<String, serde_json::Value>,
    of: String,
    inspect: String,
}

/// A reading with what the models say of it, at its point in A-uvw.
#[derive(Serialize, Deserialize)]
pub struct ShownReading {
    /// Line of the data, from 1.
    pub line: u64,
    /// Commanded pose.
    pub theta_deg: f64,
    /// See `theta_deg`.
    pub sigma_deg: f64,
    /// See `theta_deg`.
    pub z0_mm: f64,
    /// Where load and deflection are given.
    pub point_mm: [f64; 3],
    /// N and N·m.
    pub wrench: [f64; 6],
    /// Direction in which a gauge reads, if one does.
    pub gauge: Option<[f64; 3]>,
    /// Translation in µm and rotation in µrad; a gauge's number is the first.
    pub read: [Option<f64>; 6],
    /// The same by the model as declared.
    pub before: [f64; 6],
    /// The same by the identified model.
    pub after: [f64; 6],
    /// Whether a number of it was left out as a gross error.
    pub excluded: bool,
}

/// What is shown of a `placement.json`.
#[derive(Serialize, Deserialize)]
pub struct PlacementResult {
    machine: String,
    machine_sha256: String,
    series: Vec<PlacedSeries>,
}

#[derive(Serialize, Deserialize)]
struct PlacedSeries {
    name: String,
    objective: String,
    dx_mm: f64,
    dy_mm: f64,
    rotary_deg: f64,
    value: f64,
    unit: String,
    holes: Vec<PlacedHole>,
}

#[derive(Serialize, Deserialize)]
struct PlacedHole {
    theta_deg: f64,
    sigma_deg: f64,
    z0_mm: f64,
    beta1_deg: f64,
    beta2_deg: f64,
    deflection_um: Option<f64>,
    status: String,
}

pub(super) fn parsed<T: DeserializeOwned>(source: &Source, command: &str) -> Result<T> {
    let mut reader = serde_json::Deserializer::from_str(source.text()?);
    serde_path_to_error::deserialize(&mut reader).map_err(|e| {
        let (key, e) = (e.path().to_string(), e.into_inner());
        let what = if e.is_eof() || e.is_syntax() {
            "not JSON, or not all of it".to_owned()
        } else {
            format!("not what `{command}` of this version writes")
        };
        let message = format!("{what}: {}", printable(&e.to_string()));
        let failure = Failure::input(message).in_file(&source.name).at_line(e.line() as u64);
        if key == "." { failure } else { failure.at_column(key) }
    })
}

fn check_machine(source: &Source, file: &MachineFile, name: &str, sums: &[&str]) -> Result<()> {
    if sums.contains(&file.source.sha256().as_str()) {
        return Ok(());
    }
    let own = &file.source.name;
    let message = format!(
        "is of machine `{}` from another machine file than {own}: give the one that it was made from with --machine. A \
         comment or a line end that was changed since makes another file of it",
        printable(name)
    );
    Err(Failure::input(message).in_file(&source.name).at_column("machine_sha256"))
}

impl DiagnosisResult {
    /// Reads a `diagnosis.json` of a machine.
    ///
    /// # Errors
    /// Another document, or another machine.
    pub fn parse(source: &Source, file: &MachineFile) -> Result<Self> {
        let found: Self = parsed(source, "diagnose")?;
        check_machine(source, file, &found.machine, &[&found.machine_sha256, &found.identified_sha256])?;
        Ok(found)
    }
}

impl PlacementResult {
    /// Reads a `placement.json` of a machine.
    ///
    /// # Errors
    /// Another document, or another machine.
    pub fn parse(source: &Source, file: &MachineFile) -> Result<Self> {
        let found: Self = parsed(source, "place")?;
        check_machine(source, file, &found.machine, &[&found.machine_sha256])?;
        Ok(found)
    }
}

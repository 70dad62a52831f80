//! `diagnosis.json` as `verify` reads it: what two diagnoses of one machine are compared by.

use serde::{Deserialize, Serialize};

use super::results::parsed;
use crate::error::{Failure, Result};
use crate::source::Source;

/// What is compared of a `diagnosis.json`.
#[derive(Deserialize)]
pub struct Diagnosed {
    /// Name of the machine.
    pub machine: String,
    /// Of the file that declares it.
    pub machine_sha256: String,
    /// Of the readings.
    pub data_sha256: String,
    /// Of the model.
    pub verdict: String,
    /// Of measurement and model.
    pub measurement: Judged,
    /// See `measurement`.
    pub model: Judged,
    /// Findings.
    pub effects: Vec<Finding>,
    /// Wrong declared values.
    pub declared_value_findings: Vec<Declared>,
    /// Stiffnesses of the machine.
    pub condition: Condition,
    /// Of all uncertainties.
    pub uncertainty: Uncertainty,
}

/// A badge.
#[derive(Deserialize)]
pub struct Judged {
    /// What to think of it.
    pub verdict: String,
    /// Why, the gravest first.
    pub reasons: Vec<String>,
}

/// One of `effects`.
#[derive(Deserialize)]
pub struct Finding {
    /// Id of the effect.
    pub id: String,
    /// Place.
    #[serde(rename = "where")]
    pub place: String,
    /// Places that the readings cannot tell apart from it.
    #[serde(rename = "where_class")]
    pub place_class: Vec<String>,
    /// What it depends on.
    pub law: String,
    /// Of the place.
    pub probability: f64,
    /// Values by name.
    pub parameters: std::collections::BTreeMap<String, Value>,
}

/// A value with its standard deviation.
#[derive(Deserialize)]
pub struct Value {
    /// Most likely.
    pub value: f64,
    /// One standard deviation.
    pub stderr: f64,
}

/// One of `declared_value_findings`.
#[derive(Deserialize)]
pub struct Declared {
    /// Key of the machine file.
    pub parameter: String,
    /// Keys of what the readings cannot tell from it.
    pub class: Vec<String>,
    /// As declared.
    pub declared: f64,
    /// As estimated, in the same unit.
    pub estimated: f64,
    /// Where to look.
    pub inspect: String,
}

/// `condition`.
#[derive(Deserialize)]
pub struct Condition {
    /// Each with the uncertainty that two diagnoses have in common.
    pub quantities: Vec<Quantity>,
    /// Names of what these share.
    pub shared_with: Vec<String>,
    /// How far each is from what was declared, in units of its prior.
    pub deviations: Vec<f64>,
    /// Covariance of these.
    pub deviation_covariance: Vec<Vec<f64>>,
}

/// `uncertainty`.
#[derive(Deserialize)]
pub struct Uncertainty {
    /// Of the noise; none where it counts as known.
    pub degrees_of_freedom: Option<f64>,
}

/// A stiffness of the machine, as declared and as identified.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// `limb.N.axial` or `k11` … `k66`.
    pub quantity: String,
    /// For people.
    pub what: String,
    /// `N/m` or `N·m/rad`.
    pub unit: String,
    /// By the machine file.
    pub declared: f64,
    /// By the identified model.
    pub identified: f64,
    /// Of ln of the identified value: relative.
    pub standard_uncertainty: f64,
    /// The same times the coverage factor.
    pub expanded_uncertainty: f64,
    /// Of ln of the declared value, as far as it follows from what is declared of joints and bodies.
    pub declared_uncertainty: f64,
    /// How far it differs from the declared value: `as_declared` within its expanded uncertainty, `within_declared_uncertainty`, else
    /// `softer` or `stiffer`; `not_determined` where it is neither of these and the readings hardly tell more than what is declared.
    pub state: String,
    /// Covariance of ln of it with the declared values, by the order of `shared_with` and in units of their priors: two
    /// diagnoses of one machine have these errors in common.
    pub shared: Vec<f64>,
}

impl Quantity {
    /// ln of identified over declared.
    pub fn change(&self) -> f64 {
        (self.identified / self.declared).ln()
    }

    /// Whether the readings tell more of it than what is declared.
    pub fn is_determined(&self) -> bool {
        self.state != "not_determined"
    }

    /// As `limb 1 along its axis, drive, joints and body: 8.1 % softer than declared (± 1.2 %)`.
    pub fn text(&self) -> String {
        let percent = |ln: f64| 100.0 * ln.exp_m1();
        let change = percent(self.change());
        let how = if change < 0.0 { "softer" } else { "stiffer" };
        let (size, uncertainty) = (change.abs(), 100.0 * self.expanded_uncertainty);
        format!("{}: {size:.1} % {how} than declared (± {uncertainty:.1} %)", self.what)
    }
}

impl Diagnosed {
    /// Reads a `diagnosis.json`.
    ///
    /// # Errors
    /// Another document, or numbers that `diagnose` does not write.
    pub fn parse(source: &Source) -> Result<Self> {
        let found: Self = parsed(source, "diagnose")?;
        let shared = found.condition.shared_with.len();
        let is_unsound = |q: &Quantity| {
            let numbers = [q.identified, q.declared, q.standard_uncertainty];
            !(numbers.iter().all(|v| v.is_finite() && *v > 0.0) && q.shared.len() == shared)
        };
        let (deviations, covariance) = (&found.condition.deviations, &found.condition.deviation_covariance);
        let all = || covariance.iter().chain([deviations]);
        if covariance.len() != shared || all().any(|row| row.len() != shared || row.iter().any(|v| !v.is_finite())) {
            return Err(Failure::input("expected a deviation and a row of covariances for each name of shared_with")
                .in_file(&source.name)
                .at_column("condition.deviation_covariance"));
        }
        match found.condition.quantities.iter().position(is_unsound) {
            None => Ok(found),
            Some(n) => Err(Failure::input("expected numbers above 0, and a covariance for each name of shared_with")
                .in_file(&source.name)
                .at_column(format!("condition.quantities[{n}]"))),
        }
    }
}

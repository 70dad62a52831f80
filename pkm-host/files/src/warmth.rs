//! What the temperatures of measured rows say of the machine.

use std::collections::HashMap;

use pkm_core::Wrench;
use pkm_core::thermal::DECLARED_TEMPERATURE_C;

use crate::csv::{Row, Sheet};
use crate::error::Result;

/// How warm the machine is at a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warmth {
    /// °C.
    pub temperature_c: f64,
    /// Since the zero reading of its series, K.
    pub rise_k: f64,
}

/// Temperatures of the zero readings: of each series its first row's where that has no load, else [`DECLARED_TEMPERATURE_C`].
#[derive(Default)]
pub(crate) struct Zeros {
    of_series_c: HashMap<String, f64>,
}

impl Zeros {
    /// The next row, in time order; without the name of a series it is one of its own. One that says no temperature has the reference's.
    pub(crate) fn step(&mut self, sheet: &Sheet, row: &Row, load: &Wrench<f64>) -> Result<Warmth> {
        let temperature_c = sheet.optional(row, "temperature_c")?.unwrap_or(DECLARED_TEMPERATURE_C);
        let is_unloaded = load.to_vector().iter().all(|part| *part == 0.0);
        let first_c = if is_unloaded { temperature_c } else { DECLARED_TEMPERATURE_C };
        let series = if sheet.has("series") { sheet.cell(row, "series")? } else { "" };
        let zero_c = match series {
            "" => first_c,
            name => *self.of_series_c.entry(name.to_owned()).or_insert(first_c),
        };
        Ok(Warmth { temperature_c, rise_k: temperature_c - zero_c })
    }
}

//! How fast joints may be: a file for `compensate --limits`.

use std::ops::Range;

use pkm_core::nalgebra::Vector5;
use serde::Deserialize;
use toml::Spanned;

use crate::error::{Failure, Result};
use crate::source::Source;
use crate::toml_error::{Numbers, line_at, parsed};

/// Greatest velocities and accelerations of the five joints, SI, screws first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// m/s and rad/s.
    pub velocity: Vector5<f64>,
    /// m/s² and rad/s².
    pub acceleration: Vector5<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    format: Spanned<i64>,
    screw_velocity_mm_per_min: Spanned<Numbers<3>>,
    screw_acceleration_mm_per_s2: Spanned<Numbers<3>>,
    wrist_velocity_deg_per_min: Spanned<Numbers<2>>,
    wrist_acceleration_deg_per_s2: Spanned<Numbers<2>>,
}

/// Above this it is a typing error.
const MAX_LIMIT: f64 = 1e9;

impl JointLimits {
    /// Reads a file of limits.
    ///
    /// # Errors
    /// One message with file, line and key.
    pub fn parse(source: &Source) -> Result<Self> {
        let raw: Raw = parsed(source)?;
        let text = source.text()?;
        let fail = |span: Range<usize>, key: &str, message: String| {
            Failure::input(message).in_file(&source.name).at_line(line_at(text, span.start) as u64).at_column(key)
        };
        if *raw.format.get_ref() != 1 {
            return Err(fail(raw.format.span(), "format", format!("expected 1, found {}", raw.format.get_ref())));
        }
        let within = |key: &str, span: Range<usize>, values: &[f64]| {
            let is_limit = |v: &f64| *v > 0.0 && *v <= MAX_LIMIT;
            if values.iter().all(is_limit) {
                return Ok(());
            }
            Err(fail(span, key, format!("expected numbers above 0 and at most {MAX_LIMIT:e}, found {values:?}")))
        };
        let three =
            |key: &str, raw: &Spanned<Numbers<3>>| within(key, raw.span(), &raw.get_ref().0).map(|()| raw.get_ref().0);
        let two =
            |key: &str, raw: &Spanned<Numbers<2>>| within(key, raw.span(), &raw.get_ref().0).map(|()| raw.get_ref().0);
        let [v1, v2, v3] = three("screw_velocity_mm_per_min", &raw.screw_velocity_mm_per_min)?.map(|v| v / 6e4);
        let [a1, a2, a3] = three("screw_acceleration_mm_per_s2", &raw.screw_acceleration_mm_per_s2)?.map(|a| a / 1e3);
        let [v4, v5] =
            two("wrist_velocity_deg_per_min", &raw.wrist_velocity_deg_per_min)?.map(|v| v.to_radians() / 60.0);
        let [a4, a5] = two("wrist_acceleration_deg_per_s2", &raw.wrist_acceleration_deg_per_s2)?.map(f64::to_radians);
        Ok(Self { velocity: [v1, v2, v3, v4, v5].into(), acceleration: [a1, a2, a3, a4, a5].into() })
    }
}

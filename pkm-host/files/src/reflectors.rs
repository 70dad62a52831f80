//! Reflectors of a tracker: where they sit on the moving platform and on the base.

use serde::Deserialize;
use toml::Spanned;

use crate::error::{Failure, Result};
use crate::source::Source;
use crate::toml_error::{Numbers, line_at, parsed};

/// Farthest reflector, mm: far beyond any machine.
const MAX_MM: f64 = 1e5;

/// What a reflector sits on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum On {
    /// The moving platform, or what is fixed to it.
    Platform,
    /// The base.
    Base,
}

/// One reflector.
#[derive(Clone, Debug)]
pub struct Reflector {
    /// As in the list of points.
    pub name: String,
    /// What it sits on.
    pub on: On,
    /// In A-uvw on the platform, in B on the base; `None` where the tracker has to tell.
    pub at_m: Option<[f64; 3]>,
    /// Line of the file, from 1.
    pub line: u64,
}

/// All reflectors of a campaign.
#[derive(Debug)]
pub struct Reflectors {
    /// The file.
    pub source: Source,
    /// In its order, names differ.
    pub all: Vec<Reflector>,
    /// Expanded uncertainty (k = 2) of each coordinate of a point that has none of its own.
    pub u95_m: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawReflectors {
    format: Spanned<i64>,
    u95_um: Option<Spanned<f64>>,
    reflector: Vec<RawReflector>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawReflector {
    name: Spanned<String>,
    on: On,
    uvw_mm: Option<Spanned<Numbers<3>>>,
    xyz_mm: Option<Spanned<Numbers<3>>>,
}

impl Reflectors {
    /// Reads a file of reflectors.
    ///
    /// # Errors
    /// One message with file, line and key: a name twice, coordinates of the other body, an uncertainty that is not above 0, no
    /// reflector on the platform.
    pub fn parse(source: Source) -> Result<Self> {
        let raw: RawReflectors = parsed(&source)?;
        let text = source.text()?;
        let line = |start: usize| line_at(text, start) as u64;
        let fail = |start: usize, key: &str, message: String| {
            Failure::input(message).in_file(&source.name).at_line(line(start)).at_column(key)
        };
        let format = *raw.format.get_ref();
        if format != 1 {
            return Err(fail(raw.format.span().start, "format", format!("expected 1, found {format}")));
        }
        if let Some(u95) = raw.u95_um.as_ref().filter(|u| !(*u.get_ref() > 0.0 && u.get_ref().is_finite())) {
            let message = format!("expected an expanded uncertainty above 0 (k = 2), found {}", u95.get_ref());
            return Err(fail(u95.span().start, "u95_um", message));
        }
        let mut all: Vec<Reflector> = Vec::new();
        for r in &raw.reflector {
            let (name, start) = (r.name.get_ref(), r.name.span().start);
            if name.is_empty() {
                return Err(fail(start, "reflector.name", "expected a name, found none".into()));
            }
            if all.iter().any(|o| o.name == *name) {
                return Err(fail(start, "reflector.name", format!("duplicate reflector `{name}`")));
            }
            let (own, other) = match r.on {
                On::Platform => (("uvw_mm", &r.uvw_mm), ("xyz_mm", &r.xyz_mm)),
                On::Base => (("xyz_mm", &r.xyz_mm), ("uvw_mm", &r.uvw_mm)),
            };
            if let (key, Some(at)) = other {
                let message = format!("expected {}: uvw_mm are coordinates on the platform, xyz_mm on the base", own.0);
                return Err(fail(at.span().start, &format!("reflector.{key}"), message));
            }
            if let (key, Some(at)) = own
                && let Some(wrong) = at.get_ref().0.iter().find(|v| !(v.abs() <= MAX_MM))
            {
                let message = format!("expected coordinates within ±{MAX_MM} mm, found {wrong}");
                return Err(fail(at.span().start, &format!("reflector.{key}"), message));
            }
            let at_m = own.1.as_ref().map(|at| at.get_ref().0.map(|mm| mm / 1e3));
            all.push(Reflector { name: name.clone(), on: r.on, at_m, line: line(start) });
        }
        if !all.iter().any(|r| r.on == On::Platform) {
            let message = "expected at least one reflector on = \"platform\": they show the deflection, and six components need three";
            return Err(Failure::input(message).in_file(&source.name).at_column("reflector"));
        }
        Ok(Self { u95_m: raw.u95_um.map(|u| *u.get_ref() / 1e6), all, source })
    }
}

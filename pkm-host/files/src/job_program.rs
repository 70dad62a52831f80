//! What a job says of the programs that are run on it: work frames, reference points, and what gives the tool's direction.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use crate::error::{Failure, Result};
use crate::head::{Head, ProgramAxes};
use crate::job::Job;
use crate::source::Source;
use crate::toml_error::{Numbers, line_at, parsed};

/// Greatest offset, mm or °: far beyond any machine.
const MAX_OFFSET: f64 = 1e6;

/// Work frames and reference points from the origin of B, along the program's axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramOffsets {
    /// Origins of G54 to G59.3, mm.
    pub frames_mm: [Option<[f64; 3]>; 9],
    /// G28 and G30: the tip in mm without a tool of the table, and the wrist's joints in degrees.
    pub references: [Option<[f64; 5]>; 2],
}

/// What a job says of programs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramJob {
    /// `[offsets]`
    pub offsets: ProgramOffsets,
    /// `axes`
    pub axes: ProgramAxes,
    /// `head` or `tool_axis`; `None`: the wrist's own joints, or vectors.
    pub head: Option<Head>,
}

/// A job file that speaks of programs alone.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawProgramJob {
    format: Spanned<i64>,
    offsets: Option<RawOffsets>,
    axes: Option<Spanned<[String; 3]>>,
    head: Option<Spanned<String>>,
    tool_axis: Option<Spanned<Numbers<3>>>,
}

/// `[offsets]`
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOffsets {
    #[serde(rename = "G54")]
    g54: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G55")]
    g55: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G56")]
    g56: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G57")]
    g57: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G58")]
    g58: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G59")]
    g59: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G59.1")]
    g59_1: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G59.2")]
    g59_2: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G59.3")]
    g59_3: Option<Spanned<Numbers<3>>>,
    #[serde(rename = "G28")]
    g28: Option<Spanned<Numbers<5>>>,
    #[serde(rename = "G30")]
    g30: Option<Spanned<Numbers<5>>>,
}

/// What is wrong: where, which key, and why.
type Checked<T> = std::result::Result<T, (Range<usize>, &'static str, String)>;

fn numbers<const N: usize>(key: &'static str, raw: Option<&Spanned<Numbers<N>>>) -> Checked<Option<[f64; N]>> {
    let Some(raw) = raw else { return Ok(None) };
    let values = raw.get_ref().0;
    if !values.iter().all(|v| v.abs() <= MAX_OFFSET) {
        return Err((raw.span(), key, format!("expected numbers within ±{MAX_OFFSET:e}, found {values:?}")));
    }
    Ok(Some(values))
}

impl RawOffsets {
    fn checked(&self) -> Checked<ProgramOffsets> {
        let frames = [
            ("offsets.G54", &self.g54),
            ("offsets.G55", &self.g55),
            ("offsets.G56", &self.g56),
            ("offsets.G57", &self.g57),
            ("offsets.G58", &self.g58),
            ("offsets.G59", &self.g59),
            ("offsets.G59.1", &self.g59_1),
            ("offsets.G59.2", &self.g59_2),
            ("offsets.G59.3", &self.g59_3),
        ];
        let mut offsets = ProgramOffsets::default();
        for (origin_mm, (key, raw)) in offsets.frames_mm.iter_mut().zip(frames) {
            *origin_mm = numbers(key, raw.as_ref())?;
        }
        offsets.references = [numbers("offsets.G28", self.g28.as_ref())?, numbers("offsets.G30", self.g30.as_ref())?];
        Ok(offsets)
    }
}

/// The keys of a job file that speak of programs.
pub(super) fn checked(
    offsets: Option<&RawOffsets>,
    axes: Option<&Spanned<[String; 3]>>,
    head: Option<&Spanned<String>>,
    tool_axis: Option<&Spanned<Numbers<3>>>,
) -> Checked<ProgramJob> {
    let offsets = offsets.map(RawOffsets::checked).transpose()?.unwrap_or_default();
    let axes = match axes.map(|raw| (raw, ProgramAxes::of(raw.get_ref()))) {
        None => ProgramAxes::default(),
        Some((_, Some(axes))) => axes,
        Some((raw, None)) => {
            let message = "expected where X, Y and Z of programs point in B, such as [\"x\", \"-y\", \"-z\"]: right-handed, Z \
                           along z or -z";
            return Err((raw.span(), "axes", message.to_owned()));
        }
    };
    let head = match (head, numbers("tool_axis", tool_axis)?) {
        (None, None) => None,
        (None, Some(axis)) if axis.iter().all(|v| v.abs() < 1e-6) => {
            let range = tool_axis.map_or(0..0, Spanned::span);
            return Err((range, "tool_axis", format!("expected a direction, found {axis:?}")));
        }
        (None, Some(axis)) => Some(Head::Fixed(axis)),
        (Some(head), Some(_)) => {
            return Err((head.span(), "head", "head and tool_axis: give one of them".to_owned()));
        }
        (Some(head), None) => match head.get_ref().as_str() {
            "AB" => None,
            "AC" => Some(Head::Ac(axes)),
            "BC" => Some(Head::Bc(axes)),
            other => {
                let message = format!("expected \"AB\" (the wrist's joints), \"AC\" or \"BC\", found \"{other}\"");
                return Err((head.span(), "head", message));
            }
        },
    };
    Ok(ProgramJob { offsets, axes, head })
}

impl ProgramJob {
    /// Reads what a job file says of programs: one of `place` with these keys, or one that has no others.
    ///
    /// # Errors
    /// One message with file, line and key.
    pub fn parse(source: &Source) -> Result<Self> {
        let text = source.text()?;
        let of_place = ["base_in_world", "table_in_world", "cross_slide_in_world", "series"];
        let table = text.parse::<toml::Table>().unwrap_or_default();
        if of_place.iter().any(|key| table.contains_key(*key)) {
            return Ok(Job::parse(source)?.program);
        }
        let raw: RawProgramJob = parsed(source)?;
        let fail = |(span, key, message): (Range<usize>, &str, String)| {
            Failure::input(message).in_file(&source.name).at_line(line_at(text, span.start) as u64).at_column(key)
        };
        if *raw.format.get_ref() != 1 {
            return Err(fail((raw.format.span(), "format", format!("expected 1, found {}", raw.format.get_ref()))));
        }
        checked(raw.offsets.as_ref(), raw.axes.as_ref(), raw.head.as_ref(), raw.tool_axis.as_ref()).map_err(fail)
    }
}

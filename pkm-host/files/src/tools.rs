//! Tool tables: lengths of tools by number, and what cutting forces are estimated from, in TOML; or as LinuxCNC keeps them (`tool.tbl`).

use serde::Deserialize;
use toml::Spanned;

use crate::cutting::{Cutter, Engagement, Material, Side};
use crate::error::{Failure, Result, printable};
use crate::source::Source;
use crate::toml_error::{line_at, parsed};

/// Longest tool, mm: far beyond any.
const MAX_LENGTH_MM: f64 = 1e4;

/// Radial over tangential force where the table does not say it: a usual value for steel.
const RADIAL_RATIO: f64 = 0.3;

/// Tools by number, and the material that they cut.
#[derive(Clone, Debug, Default)]
pub struct Tools {
    /// Name of the file, for messages.
    pub file: String,
    tools: Vec<Tool>,
    /// Of the workpiece.
    pub material: Option<Material>,
}

/// A tool as a program calls it, or its length.
#[derive(Clone, Copy, Debug)]
pub struct Called {
    /// Behind T or H.
    pub number: f64,
    /// Of the program, from 1.
    pub line: u64,
}

#[derive(Clone, Copy, Debug)]
struct Tool {
    number: u32,
    /// Over the flange of the machine file.
    length_mm: f64,
    diameter_mm: Option<f64>,
    cutter: Option<Cutter>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTools {
    format: Spanned<i64>,
    material: Option<RawMaterial>,
    tool: Vec<RawTool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMaterial {
    kc1_1_n_per_mm2: Spanned<f64>,
    mc: Spanned<f64>,
    u_rel: Spanned<f64>,
    radial_ratio: Option<Spanned<f64>>,
    axial_ratio: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTool {
    number: Spanned<u32>,
    length_mm: Spanned<f64>,
    diameter_mm: Option<Spanned<f64>>,
    kind: Option<Spanned<Kind>>,
    teeth: Option<Spanned<u32>>,
    lead_deg: Option<Spanned<f64>>,
    depth_mm: Option<Spanned<f64>>,
    width_mm: Option<Spanned<f64>>,
    side: Option<Spanned<RawSide>>,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Mill,
    Drill,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RawSide {
    Climb,
    Conventional,
    Centre,
}

/// What is wrong: where, which key, and why.
type Checked<T> = std::result::Result<T, (usize, &'static str, String)>;

/// A number within bounds, the lower one excluded.
fn within(key: &'static str, raw: &Spanned<f64>, low: f64, high: f64) -> Checked<f64> {
    let value = *raw.get_ref();
    if value > low && value <= high {
        return Ok(value);
    }
    Err((raw.span().start, key, format!("expected a number above {low}, at most {high}, found {value}")))
}

impl RawMaterial {
    fn checked(&self) -> Checked<Material> {
        let ratio = |key, raw: &Option<Spanned<f64>>, default| match raw {
            Some(raw) => within(key, raw, -2.0, 2.0),
            None => Ok(default),
        };
        Ok(Material {
            kc1_1_n_per_mm2: within("material.kc1_1_n_per_mm2", &self.kc1_1_n_per_mm2, 0.0, 1e5)?,
            mc: within("material.mc", &self.mc, 0.0, 0.9)?,
            u_rel: within("material.u_rel", &self.u_rel, 0.0, 1.0)?,
            radial_ratio: ratio("material.radial_ratio", &self.radial_ratio, RADIAL_RATIO)?,
            axial_ratio: ratio("material.axial_ratio", &self.axial_ratio, 0.0)?,
        })
    }
}

impl RawTool {
    /// The edges, where a kind is given.
    fn cutter(&self) -> Checked<Option<Cutter>> {
        let Some(kind) = &self.kind else {
            let others = [&self.lead_deg, &self.depth_mm, &self.width_mm].map(|v| v.as_ref().map(|v| v.span().start));
            let others = others.into_iter().flatten().chain(self.teeth.as_ref().map(|v| v.span().start));
            return match others.chain(self.side.as_ref().map(|v| v.span().start)).next() {
                Some(at) => Err((at, "tool.kind", "missing key: expected kind = \"mill\" or \"drill\"".into())),
                None => Ok(None),
            };
        };
        let (at, is_mill) = (kind.span().start, *kind.get_ref() == Kind::Mill);
        fn needed<'a, T>(at: usize, key: &'static str, raw: &'a Option<T>) -> Checked<&'a T> {
            raw.as_ref().ok_or_else(|| (at, key, "missing key: an estimate of the cutting force needs it".to_owned()))
        }
        let diameter_mm =
            within("tool.diameter_mm", needed(at, "tool.diameter_mm", &self.diameter_mm)?, 0.0, MAX_LENGTH_MM)?;
        let teeth = needed(at, "tool.teeth", &self.teeth)?;
        if !(1..=100).contains(teeth.get_ref()) {
            let message = format!("expected 1 to 100 edges, found {}", teeth.get_ref());
            return Err((teeth.span().start, "tool.teeth", message));
        }
        let lead_deg = match &self.lead_deg {
            Some(raw) => within("tool.lead_deg", raw, 0.0, 90.0)?,
            None if is_mill => 90.0,
            // half of 118°
            None => 59.0,
        };
        let engagement = if is_mill {
            Some(Engagement {
                depth_mm: within("tool.depth_mm", needed(at, "tool.depth_mm", &self.depth_mm)?, 0.0, 1e3)?,
                width_mm: within("tool.width_mm", needed(at, "tool.width_mm", &self.width_mm)?, 0.0, diameter_mm)?,
                side: match self.side.as_ref().map(|side| *side.get_ref()) {
                    None | Some(RawSide::Climb) => Side::Climb,
                    Some(RawSide::Conventional) => Side::Conventional,
                    Some(RawSide::Centre) => Side::Centre,
                },
            })
        } else {
            None
        };
        Ok(Some(Cutter { diameter_mm, teeth: *teeth.get_ref(), lead_deg, engagement }))
    }
}

impl Tools {
    /// Whether there is a table.
    pub fn is_given(&self) -> bool {
        !self.tools.is_empty()
    }

    /// Reads a tool table, LinuxCNC's if the file's name ends in .tbl.
    ///
    /// # Errors
    /// One message with file and line: a tool twice, a length that is none, an offset other than along Z.
    pub fn parse(source: &Source) -> Result<Self> {
        if source.name.to_lowercase().ends_with(".tbl") { Self::of_table(source) } else { Self::of_toml(source) }
    }

    /// The same for a flange at such a distance from the wrist's second axis.
    ///
    /// # Errors
    /// Those of [`parse`](Self::parse); a tool whose tip would not be beyond that axis.
    pub fn over_flange(source: &Source, flange_mm: f64) -> Result<Self> {
        let this = Self::parse(source)?;
        let Some(tool) = this.tools.iter().find(|tool| tool.length_mm + flange_mm <= 0.0) else { return Ok(this) };
        let message = format!(
            "tool {}: with a length of {} mm over a flange of {flange_mm} mm (wrist.flange_mm) its tip is not beyond the wrist's second axis",
            tool.number, tool.length_mm
        );
        Err(Failure::input(message).in_file(&source.name))
    }

    /// The length of a tool, mm.
    pub fn length_mm(&self, number: f64) -> Option<f64> {
        self.tool(number).map(|tool| tool.length_mm)
    }

    /// The edges of a tool, where the table has them.
    pub fn cutter(&self, number: f64) -> Option<Cutter> {
        self.tool(number).and_then(|tool| tool.cutter)
    }

    /// Why a force cannot be estimated of a tool that a line has called.
    pub fn no_cutter(&self, called: Option<Called>) -> String {
        let file = &self.file;
        match called {
            None => format!("no T says which tool of {file} is in hand"),
            Some(Called { number, line }) if self.tool(number).is_none() => {
                format!("T{number} (line {line}) is not in {file}")
            }
            Some(Called { number, line }) => format!("T{number} (line {line}) has no `kind` and `teeth` in {file}"),
        }
    }

    /// The number of a tool that is so long, of the one in hand if it is.
    pub fn with_length(&self, in_hand: f64, length_mm: f64, tolerance_mm: f64) -> Option<u32> {
        let mut tools = self.tool(in_hand).into_iter().chain(&self.tools);
        tools.find(|tool| (tool.length_mm - length_mm).abs() <= tolerance_mm).map(|tool| tool.number)
    }

    /// Whether all tools have a diameter.
    pub fn have_diameters(&self) -> bool {
        self.tools.iter().all(|tool| tool.diameter_mm.is_some())
    }

    /// As LinuxCNC keeps them, in a unit of so many mm.
    pub fn to_table(&self, unit_mm: f64) -> String {
        let line = |(n, tool): (usize, &Tool)| {
            let [length, diameter] = [tool.length_mm, tool.diameter_mm.unwrap_or(0.0)].map(|mm| mm / unit_mm);
            format!("T{} P{} Z{length} D{diameter}\n", tool.number, n + 1)
        };
        self.tools.iter().enumerate().map(line).collect()
    }

    fn tool(&self, number: f64) -> Option<&Tool> {
        self.tools.iter().find(|tool| f64::from(tool.number) == number)
    }

    fn add(&mut self, tool: Tool) -> std::result::Result<(), String> {
        let Tool { number, length_mm, .. } = tool;
        if !(length_mm.abs() <= MAX_LENGTH_MM) {
            return Err(format!("expected a length within ±{MAX_LENGTH_MM} mm, found {length_mm}"));
        }
        if self.length_mm(f64::from(number)).is_some() {
            return Err(format!("duplicate tool {number}"));
        }
        self.tools.push(tool);
        Ok(())
    }

    fn of_toml(source: &Source) -> Result<Self> {
        let raw: RawTools = parsed(source)?;
        let text = source.text()?;
        let fail = |start: usize, key: &str, message: String| {
            Failure::input(message).in_file(&source.name).at_line(line_at(text, start) as u64).at_column(key)
        };
        let format = *raw.format.get_ref();
        if format != 1 {
            return Err(fail(raw.format.span().start, "format", format!("expected 1, found {format}")));
        }
        let checked = |(start, key, message): (usize, &str, String)| fail(start, key, message);
        let material = raw.material.as_ref().map(RawMaterial::checked).transpose().map_err(checked)?;
        let mut tools = Self { file: printable(&source.name), tools: Vec::new(), material };
        for tool in &raw.tool {
            if let Some(diameter) = tool.diameter_mm.as_ref().filter(|d| !(0.0..=MAX_LENGTH_MM).contains(d.get_ref())) {
                let message = format!("expected a diameter from 0 to {MAX_LENGTH_MM} mm, found {}", diameter.get_ref());
                return Err(fail(diameter.span().start, "tool.diameter_mm", message));
            }
            let failed = |message| fail(tool.length_mm.span().start, "tool.length_mm", message);
            let cutter = tool.cutter().map_err(checked)?;
            let (number, length_mm) = (*tool.number.get_ref(), *tool.length_mm.get_ref());
            let diameter_mm = tool.diameter_mm.as_ref().map(|d| *d.get_ref());
            tools.add(Tool { number, length_mm, diameter_mm, cutter }).map_err(failed)?;
        }
        Ok(tools)
    }

    /// `T1 P1 Z+51.2 D10 ;end mill`, a tool a line, in mm; Z is the length.
    fn of_table(source: &Source) -> Result<Self> {
        let mut tools = Self { file: printable(&source.name), ..Self::default() };
        for (n, line) in source.text()?.lines().enumerate() {
            let fail = |message: String| Failure::input(message).in_file(&source.name).at_line(n as u64 + 1);
            let (mut number, mut length_mm, mut diameter_mm) = (None, 0.0, None);
            for word in line.split(';').next().unwrap_or_default().split_whitespace() {
                let (letter, value) = word.split_at_checked(1).unwrap_or((word, ""));
                let expected =
                    || fail(format!("expected a letter with a number, as in `T1 P1 Z51.2 D10`, found `{word}`"));
                let value: f64 = value.parse().map_err(|_| expected())?;
                match letter.to_ascii_uppercase().as_str() {
                    "T" if value.fract() == 0.0 && (0.0..1e9).contains(&value) => number = Some(value as u32),
                    "Z" => length_mm = value,
                    "D" => diameter_mm = Some(value),
                    "P" | "I" | "J" | "Q" => {}
                    "X" | "Y" | "A" | "B" | "C" | "U" | "V" | "W" if value == 0.0 => {}
                    "X" | "Y" | "A" | "B" | "C" | "U" | "V" | "W" => {
                        return Err(fail(format!("`{word}`: only offsets along Z are supported")));
                    }
                    _ => return Err(expected()),
                }
            }
            if let Some(number) = number {
                tools.add(Tool { number, length_mm, diameter_mm, cutter: None }).map_err(fail)?;
            }
        }
        Ok(tools)
    }
}

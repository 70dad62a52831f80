//! Commands: lines from bytes, commands from lines.

use pkm_core::correction::{TableHeader, TransferError};
use pkm_core::nalgebra::Vector3;
use pkm_core::{CorrectionTable, Cycle, CycleError, Machine, Pose, Scalar, Wrench};
use serde::{Deserialize, Serialize};
use serde_json_core::de;

use crate::line::{opened, sealed};
use crate::piece::{Piece, TableNumbers};
use crate::reply::Checksum;
use crate::{MAX_COMMAND, MAX_STEPS, VERSION};

/// Why a line was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// More than [`MAX_COMMAND`] bytes.
    TooLong,
    /// The line does not end with the CRC of what comes before: damaged on its way.
    Checksum,
    /// Not one JSON object of names, numbers and lists of numbers.
    Syntax,
    /// A field is missing, doubled, unknown, or no field of this command.
    Field,
    /// Another version of the protocol.
    Version,
    /// No such command.
    Command,
    /// A number is beyond the range of its field, `f64` or `u32`.
    Range,
    /// Given up: the byte [`ABORT`](crate::ABORT) came while it was worked on.
    Aborted,
    /// The table was fitted for another machine.
    OtherMachine,
    /// The numbers are no table, or not the one that was announced; or there is no room for it.
    Table,
    /// No table was begun, or a number is missing, or comes twice.
    Order,
}

impl From<TransferError> for Code {
    fn from(e: TransferError) -> Self {
        match e {
            TransferError::OtherMachine => Self::OtherMachine,
            TransferError::NumberCount => Self::Order,
            _ => Self::Table,
        }
    }
}

/// A refused line, with its `id` if that could be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused {
    /// Of the command.
    pub id: Option<u32>,
    /// What is wrong.
    pub code: Code,
}

/// A command with the number that its reply repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// The sender's choice.
    pub id: u32,
    /// What to do.
    pub command: Command,
}

/// What a host may ask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Who are you?
    Hello,
    /// How are you?
    Status,
    /// Work with this from the next period on, and tell the result.
    Cycle(Demand),
    /// Go from pose to pose, a step a period, and sum up the results.
    Sweep(Sweep),
    /// Expect the numbers of a table.
    Table(TableHeader),
    /// The next of them.
    Numbers(Piece),
    /// Check the table that has come, and work with it from the next period on.
    Swap,
}

/// What the cyclic task works on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Number type to compute in. The inputs are rounded to it first.
    pub arithmetic: Arithmetic,
    /// Where the platform should stand, finite.
    pub pose: Pose<f64>,
    /// Load on the tip, its moment about the tip, in the axes of A-uvw, finite.
    pub wrench_at_tip: Wrench<f64>,
    /// The tip in A-uvw, finite.
    pub tip_m: Vector3<f64>,
}

/// A straight line of demands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// The first.
    pub from: Demand,
    /// The pose after the last, finite.
    pub to: Pose<f64>,
    /// From 1 to [`MAX_STEPS`].
    pub steps: u32,
}

impl Sweep {
    /// All of them.
    pub fn demands(self) -> impl Iterator<Item = Demand> {
        let Self { from, to, steps } = self;
        (0..steps).map(move |step| {
            let share = f64::from(step) / f64::from(steps);
            let along = |a: f64, b: f64| a + share * (b - a);
            let pose = Pose {
                theta_rad: along(from.pose.theta_rad, to.theta_rad),
                sigma_rad: along(from.pose.sigma_rad, to.sigma_rad),
                z0_m: along(from.pose.z0_m, to.z0_m),
            };
            Demand { pose, ..from }
        })
    }
}

/// Number type of a computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// A command as it stands on the line.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wire<'a> {
    v: u32,
    id: u32,
    cmd: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    arithmetic: Option<Arithmetic>,
    #[serde(skip_serializing_if = "Option::is_none")]
    theta_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sigma_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    z0_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    force_n: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    moment_nm: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tip_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    to: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    steps: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    machine: Option<Checksum>,
    #[serde(skip_serializing_if = "Option::is_none")]
    table: Option<Checksum>,
    #[serde(skip_serializing_if = "Option::is_none")]
    terms: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    factor_form: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    numbers: Option<TableNumbers>,
}

impl Wire<'_> {
    fn demand(&self) -> Option<Demand> {
        Some(Demand {
            arithmetic: self.arithmetic?,
            pose: Pose { theta_rad: self.theta_rad?, sigma_rad: self.sigma_rad?, z0_m: self.z0_m? },
            wrench_at_tip: Wrench { force_n: self.force_n?.into(), moment_nm: self.moment_nm?.into() },
            tip_m: self.tip_m?.into(),
        })
    }

    fn has_demand(&self) -> bool {
        let Self { v: _, id: _, cmd: _, arithmetic, theta_rad, sigma_rad, z0_m, force_n, moment_nm, tip_m, .. } = self;
        arithmetic.is_some()
            || [theta_rad, sigma_rad, z0_m].into_iter().any(Option::is_some)
            || [force_n, moment_nm, tip_m].into_iter().any(Option::is_some)
    }

    fn has_way(&self) -> bool {
        self.to.is_some() || self.steps.is_some()
    }

    fn header(&self) -> Option<TableHeader> {
        let (Checksum(machine), Checksum(table)) = (self.machine?, self.table?);
        Some(TableHeader { machine, table, terms: self.terms?, factor_form: self.factor_form? })
    }

    fn has_header(&self) -> bool {
        self.machine.is_some() || self.table.is_some() || self.terms.is_some() || self.factor_form.is_some()
    }

    fn has_piece(&self) -> bool {
        self.first.is_some() || self.numbers.is_some()
    }

    /// Whether a field is there that the command does not have.
    fn has_others(&self) -> bool {
        let (demand, way, header, piece) = match self.cmd {
            "cycle" => (true, false, false, false),
            "sweep" => (true, true, false, false),
            "table" => (false, false, true, false),
            "numbers" => (false, false, false, true),
            _ => (false, false, false, false),
        };
        !demand && self.has_demand()
            || !way && self.has_way()
            || !header && self.has_header()
            || !piece && self.has_piece()
    }

    fn command(&self) -> Result<Command, Code> {
        let demand = || {
            let demand = self.demand().ok_or(Code::Field)?;
            if demand.is_finite() { Ok(demand) } else { Err(Code::Range) }
        };
        match self.cmd {
            "hello" | "status" | "cycle" | "sweep" | "table" | "numbers" | "swap" if self.has_others() => {
                Err(Code::Field)
            }
            "hello" => Ok(Command::Hello),
            "status" => Ok(Command::Status),
            "swap" => Ok(Command::Swap),
            "table" => self.header().map(Command::Table).ok_or(Code::Field),
            "numbers" => {
                let (Some(first), Some(numbers)) = (self.first, self.numbers) else { return Err(Code::Field) };
                if numbers.are_finite() { Ok(Command::Numbers(Piece { first, numbers })) } else { Err(Code::Range) }
            }
            "cycle" => Ok(Command::Cycle(demand()?)),
            "sweep" => {
                let (Some([theta_rad, sigma_rad, z0_m]), Some(steps)) = (self.to, self.steps) else {
                    return Err(Code::Field);
                };
                let to = Pose { theta_rad, sigma_rad, z0_m };
                let sweep = Sweep { from: demand()?, to, steps };
                let finite = [theta_rad, sigma_rad, z0_m].iter().all(|v| v.is_finite());
                if finite && (1..=MAX_STEPS).contains(&steps) { Ok(Command::Sweep(sweep)) } else { Err(Code::Range) }
            }
            _ => Err(Code::Command),
        }
    }
}

impl Request {
    /// Reads the JSON of a line.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn parse(line: &[u8]) -> Result<Self, Refused> {
        let refused = |id, code| Err(Refused { id, code });
        if objects(line, &[b"true", b"false"]) != Some(1) {
            return refused(None, Code::Syntax);
        }
        let wire: Wire<'_> = match de::from_slice(line) {
            Ok((wire, length)) if length == line.len() => wire,
            Err(de::Error::CustomError | de::Error::InvalidType) => return refused(None, Code::Field),
            Err(de::Error::InvalidNumber) => return refused(None, Code::Range),
            _ => return refused(None, Code::Syntax),
        };
        if wire.v != VERSION {
            return refused(Some(wire.id), Code::Version);
        }
        match wire.command() {
            Ok(command) => Ok(Self { id: wire.id, command }),
            Err(code) => refused(Some(wire.id), code),
        }
    }

    /// Writes the line with its CRC and line feed; `None` when `buffer` is too short ([`MAX_COMMAND`] + 1 always do).
    pub fn write<'b>(&self, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        let (mut demand, mut sweep, mut header, mut piece) = (None, None, None, None);
        let cmd = match self.command {
            Command::Hello => "hello",
            Command::Status => "status",
            Command::Swap => "swap",
            Command::Cycle(asked) => {
                demand = Some(asked);
                "cycle"
            }
            Command::Sweep(asked) => {
                (demand, sweep) = (Some(asked.from), Some(asked));
                "sweep"
            }
            Command::Table(announced) => {
                header = Some(announced);
                "table"
            }
            Command::Numbers(next) => {
                piece = Some(next);
                "numbers"
            }
        };
        let wire = Wire {
            v: VERSION,
            id: self.id,
            cmd,
            arithmetic: demand.map(|d| d.arithmetic),
            theta_rad: demand.map(|d| d.pose.theta_rad),
            sigma_rad: demand.map(|d| d.pose.sigma_rad),
            z0_m: demand.map(|d| d.pose.z0_m),
            force_n: demand.map(|d| d.wrench_at_tip.force_n.into()),
            moment_nm: demand.map(|d| d.wrench_at_tip.moment_nm.into()),
            tip_m: demand.map(|d| d.tip_m.into()),
            to: sweep.map(|s| [s.to.theta_rad, s.to.sigma_rad, s.to.z0_m]),
            steps: sweep.map(|s| s.steps),
            machine: header.map(|h| Checksum(h.machine)),
            table: header.map(|h| Checksum(h.table)),
            terms: header.map(|h| h.terms),
            factor_form: header.map(|h| h.factor_form),
            first: piece.map(|p| p.first),
            numbers: piece.map(|p| p.numbers),
        };
        write_line(&wire, buffer)
    }
}

impl Demand {
    /// Computes it. The inputs are rounded to `T` first.
    ///
    /// # Errors
    /// Those of [`CorrectionTable::cycle`].
    pub fn cycle<T: Scalar>(
        &self,
        machine: &Machine<T>,
        table: &CorrectionTable<'_, T>,
    ) -> Result<Cycle<T>, CycleError> {
        let Self { arithmetic: _, pose, wrench_at_tip: w, tip_m } = self;
        let [theta_rad, sigma_rad, z0_m] = [pose.theta_rad, pose.sigma_rad, pose.z0_m].map(T::from_f64);
        let wrench = Wrench { force_n: w.force_n.map(T::from_f64), moment_nm: w.moment_nm.map(T::from_f64) };
        table.cycle(machine, &Pose { theta_rad, sigma_rad, z0_m }, &wrench, tip_m.map(T::from_f64))
    }

    fn is_finite(&self) -> bool {
        let Self { arithmetic: _, pose, wrench_at_tip: w, tip_m } = self;
        let pose = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
        pose.iter().chain(&w.force_n).chain(&w.moment_nm).chain(tip_m).all(|v| v.is_finite())
    }
}

/// JSON, its CRC and a line feed.
pub(crate) fn write_line<'b>(value: &impl Serialize, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let length = serde_json_core::to_slice(value, buffer).ok()?;
    sealed(buffer, length)
}

/// How many objects a line holds; `None` if there is anything in it but strings without escapes and outside of them JSON's numbers,
/// brackets, commas, colons, and these words. serde-json-core lets more pass: `[,1]`, `[,1 2]`, `+1`, `01`, `1.`, `.5`, null for a
/// number, an object for a name, line feeds in a string.
pub(crate) fn objects(mut rest: &[u8], words: &[&[u8]]) -> Option<usize> {
    let mut objects = 0;
    let mut after_bracket = false;
    while let [first, tail @ ..] = rest {
        let length = match first {
            b' ' | b'\t' | b'\r' => {
                rest = tail;
                continue;
            }
            b'"' => {
                let end = tail.iter().position(|b| matches!(b, b'"' | b'\\') || b.is_ascii_control())?;
                tail.get(end).filter(|b| **b == b'"').map(|_| end + 2)?
            }
            b',' if after_bracket => return None,
            b'{' | b'}' | b'[' | b']' | b':' | b',' => 1,
            _ => match words.iter().find(|word| rest.starts_with(word)) {
                Some(word) => word.len(),
                None => {
                    let in_number = |b: &&u8| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E');
                    let length = rest.iter().take_while(in_number).count();
                    rest.get(..length).filter(|text| is_number(text))?;
                    length
                }
            },
        };
        objects += usize::from(*first == b'{');
        after_bracket = *first == b'[';
        rest = rest.get(length..)?;
    }
    Some(objects)
}

/// A number of JSON's grammar.
fn is_number(text: &[u8]) -> bool {
    let text = text.strip_prefix(b"-").unwrap_or(text);
    let (whole, after) = digits(text);
    if whole == 0 || whole > 1 && text.starts_with(b"0") {
        return false;
    }
    let after = match after {
        [b'.', fraction @ ..] => match digits(fraction) {
            (0, _) => return false,
            (_, after) => after,
        },
        after => after,
    };
    match after {
        [] => true,
        [b'e' | b'E', b'+' | b'-', exponent @ ..] | [b'e' | b'E', exponent @ ..] => {
            matches!(digits(exponent), (1.., []))
        }
        _ => false,
    }
}

/// How many digits a text starts with, and what follows them.
fn digits(text: &[u8]) -> (usize, &[u8]) {
    let count = text.iter().take_while(|b| b.is_ascii_digit()).count();
    (count, text.get(count..).unwrap_or_default())
}

/// Finds lines in a stream of bytes, whatever comes.
#[derive(Clone, Debug)]
pub struct Lines {
    bytes: [u8; MAX_COMMAND],
    /// Above [`MAX_COMMAND`]: the line is too long and its rest is passed over.
    length: usize,
}

impl Default for Lines {
    fn default() -> Self {
        Self::new()
    }
}

impl Lines {
    /// Before the first byte.
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_COMMAND], length: 0 }
    }

    /// Takes a byte; with a line feed, gives what the line holds. Blank lines give nothing.
    pub fn push(&mut self, byte: u8) -> Option<Result<Request, Refused>> {
        if byte != b'\n' {
            if let Some(place) = self.bytes.get_mut(self.length) {
                *place = byte;
            }
            self.length = (self.length + 1).min(MAX_COMMAND + 1);
            return None;
        }
        let line = self.bytes.get(..core::mem::take(&mut self.length));
        match line {
            None => Some(Err(Refused { id: None, code: Code::TooLong })),
            Some(line) if line.trim_ascii().is_empty() => None,
            Some(line) => Some(match opened(line) {
                Some(json) => Request::parse(json),
                None => Err(Refused { id: None, code: Code::Checksum }),
            }),
        }
    }
}

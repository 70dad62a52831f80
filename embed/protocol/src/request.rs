//! Commands: lines from bytes, commands from lines.

use pkm_core::compensator::{Weight, WeightError};
use pkm_core::correction::{TableHeader, TransferError};
use pkm_core::estimation::Touch;
use pkm_core::nalgebra::Vector3;
use pkm_core::{Pose, Wrench};
use serde::{Deserialize, Serialize};
use serde_json_core::de;

use crate::demand::{Arithmetic, Carried, Demand, Sweep};
use crate::json::{objects, write_line};
use crate::learned::Probe;
use crate::line::opened;
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
    /// A demand is worked on.
    Busy,
    /// The state could not be written where it stays.
    NotSaved,
    /// A weight beyond [`MAX_WEIGHT_N`](pkm_core::compensator::MAX_WEIGHT_N).
    TooHeavy,
    /// A centre of mass farther than [`MAX_CENTRE_M`](pkm_core::compensator::MAX_CENTRE_M).
    TooFar,
    /// The table, or the one that was to come, has no deflection under the weight where the machine was zeroed.
    NoReference,
}

impl From<WeightError> for Code {
    fn from(e: WeightError) -> Self {
        match e {
            WeightError::TooHeavy => Self::TooHeavy,
            WeightError::TooFar => Self::TooFar,
            WeightError::NoReference(_) => Self::NoReference,
            _ => Self::Range,
        }
    }
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
    /// Compensate this weight, too, from the next period on.
    Weight(Carried),
    /// Learn from this.
    Probe(Probe),
    /// What do you know?
    Learned,
    /// Write what you know where it stays.
    Save,
}

/// Pose, load and tip.
#[derive(Clone, Copy)]
struct Place {
    pose: Pose<f64>,
    wrench_at_tip: Wrench<f64>,
    tip_m: Vector3<f64>,
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
    limb_1_rise_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    limb_2_rise_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    limb_3_rise_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    platforms_rise_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    centre_m: Option<[f64; 3]>,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    time_s: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rise_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    read_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    deviation_m: Option<[f64; 3]>,
}

impl Wire<'_> {
    fn pose(&self) -> Option<Pose<f64>> {
        Some(Pose { theta_rad: self.theta_rad?, sigma_rad: self.sigma_rad?, z0_m: self.z0_m? })
    }

    fn place(&self) -> Option<Place> {
        Some(Place {
            pose: self.pose()?,
            wrench_at_tip: Wrench { force_n: self.force_n?.into(), moment_nm: self.moment_nm?.into() },
            tip_m: self.tip_m?.into(),
        })
    }

    fn demand(&self) -> Option<Demand> {
        let Place { pose, wrench_at_tip, tip_m } = self.place()?;
        Some(Demand { arithmetic: self.arithmetic?, pose, wrench_at_tip, tip_m, rises_k: self.rises_k() })
    }

    fn rises_k(&self) -> [Option<f64>; 4] {
        [self.limb_1_rise_k, self.limb_2_rise_k, self.limb_3_rise_k, self.platforms_rise_k]
    }

    fn carried(&self) -> Option<Carried> {
        let weight = Weight { force_n: self.force_n?.into(), centre_m: self.centre_m?.into() };
        Some(Carried { weight, zeroed_at: self.pose()?, tip_m: self.tip_m?.into() })
    }

    fn probe(&self) -> Option<Probe> {
        let Place { pose, wrench_at_tip: wrench, tip_m } = self.place()?;
        let touch = Touch { time_s: self.time_s?, pose, tip_m, wrench, rise_k: self.rise_k? };
        Some(Probe { touch, read_m: self.read_m?, deviation_m: self.deviation_m? })
    }

    fn has_place(&self) -> bool {
        let Self { theta_rad, sigma_rad, z0_m, force_n, tip_m, .. } = self;
        [theta_rad, sigma_rad, z0_m].into_iter().any(Option::is_some) || force_n.is_some() || tip_m.is_some()
    }

    fn has_reading(&self) -> bool {
        let Self { time_s, rise_k, read_m, deviation_m, .. } = self;
        time_s.is_some() || rise_k.is_some() || read_m.is_some() || deviation_m.is_some()
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
        let is = |commands: &[&str]| commands.contains(&self.cmd);
        let has_rise = self.rises_k().iter().any(Option::is_some);
        !is(&["cycle", "sweep"]) && (self.arithmetic.is_some() || has_rise)
            || !is(&["cycle", "sweep", "probe"]) && self.moment_nm.is_some()
            || !is(&["cycle", "sweep", "probe", "weight"]) && self.has_place()
            || !is(&["weight"]) && self.centre_m.is_some()
            || !is(&["sweep"]) && self.has_way()
            || !is(&["table"]) && self.has_header()
            || !is(&["numbers"]) && self.has_piece()
            || !is(&["probe"]) && self.has_reading()
    }

    fn command(&self) -> Result<Command, Code> {
        let demand = || {
            let demand = self.demand().ok_or(Code::Field)?;
            if demand.is_finite() { Ok(demand) } else { Err(Code::Range) }
        };
        match self.cmd {
            "hello" | "status" | "cycle" | "sweep" | "table" | "numbers" | "swap" | "weight" | "probe" | "learned"
            | "save"
                if self.has_others() =>
            {
                Err(Code::Field)
            }
            "hello" => Ok(Command::Hello),
            "status" => Ok(Command::Status),
            "swap" => Ok(Command::Swap),
            "learned" => Ok(Command::Learned),
            "save" => Ok(Command::Save),
            "weight" => {
                let carried = self.carried().ok_or(Code::Field)?;
                if carried.is_finite() { Ok(Command::Weight(carried)) } else { Err(Code::Range) }
            }
            "probe" => {
                let probe = self.probe().ok_or(Code::Field)?;
                if probe.is_finite() { Ok(Command::Probe(probe)) } else { Err(Code::Range) }
            }
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
        let (mut place, mut moment_nm, mut demand, mut sweep) = (None, None, None, None);
        let (mut header, mut piece, mut weight, mut probe) = (None, None, None, None);
        let mut work_on = |asked: Demand| {
            let Wrench { force_n, moment_nm: moment } = asked.wrench_at_tip;
            (place, moment_nm, demand) = (Some((asked.pose, force_n, asked.tip_m)), Some(moment), Some(asked));
        };
        let cmd = match self.command {
            Command::Hello => "hello",
            Command::Status => "status",
            Command::Swap => "swap",
            Command::Learned => "learned",
            Command::Save => "save",
            Command::Cycle(asked) => {
                work_on(asked);
                "cycle"
            }
            Command::Sweep(asked) => {
                work_on(asked.from);
                sweep = Some(asked);
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
            Command::Weight(carried) => {
                place = Some((carried.zeroed_at, carried.weight.force_n, carried.tip_m));
                weight = Some(carried.weight);
                "weight"
            }
            Command::Probe(read) => {
                let Touch { pose, wrench, tip_m, .. } = read.touch;
                (place, moment_nm, probe) = (Some((pose, wrench.force_n, tip_m)), Some(wrench.moment_nm), Some(read));
                "probe"
            }
        };
        let [limb_1_rise_k, limb_2_rise_k, limb_3_rise_k, platforms_rise_k] = demand.map_or([None; 4], |d| d.rises_k);
        let wire = Wire {
            v: VERSION,
            id: self.id,
            cmd,
            arithmetic: demand.map(|d| d.arithmetic),
            theta_rad: place.map(|(pose, ..)| pose.theta_rad),
            sigma_rad: place.map(|(pose, ..)| pose.sigma_rad),
            z0_m: place.map(|(pose, ..)| pose.z0_m),
            force_n: place.map(|(_, force_n, _)| force_n.into()),
            moment_nm: moment_nm.map(Into::into),
            tip_m: place.map(|(.., tip_m)| tip_m.into()),
            limb_1_rise_k,
            limb_2_rise_k,
            limb_3_rise_k,
            platforms_rise_k,
            centre_m: weight.map(|w| w.centre_m.into()),
            to: sweep.map(|s| [s.to.theta_rad, s.to.sigma_rad, s.to.z0_m]),
            steps: sweep.map(|s| s.steps),
            machine: header.map(|h| Checksum(h.machine)),
            table: header.map(|h| Checksum(h.table)),
            terms: header.map(|h| h.terms),
            factor_form: header.map(|h| h.factor_form),
            first: piece.map(|p| p.first),
            numbers: piece.map(|p| p.numbers),
            time_s: probe.map(|p| p.touch.time_s),
            rise_k: probe.map(|p| p.touch.rise_k),
            read_m: probe.map(|p| p.read_m),
            deviation_m: probe.map(|p| p.deviation_m),
        };
        write_line(&wire, buffer)
    }
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

//! Replies.

use core::fmt;

use pkm_core::checksum::{START, over_byte, over_numbers};
use pkm_core::{
    CompensationError, CorrectionError, Cycle, CycleError, Domain, KinematicsError, Pose, Scalar, StiffnessError,
};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::json::{objects, write_line};
use crate::learned::Learned;
use crate::line::opened;
use crate::{Code, VERSION};

/// A line from the controller. `T` is the arithmetic of a cycle's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reply<'a, T> {
    /// [`VERSION`].
    pub v: u32,
    /// Of the command; none when it could not be read.
    pub id: Option<u32>,
    /// What the command gave.
    #[serde(borrow)]
    pub answer: Answer<'a, T>,
}

/// What a command gave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
// one at a time, on the stack
#[allow(clippy::large_enum_variant)]
pub enum Answer<'a, T> {
    /// To `hello`.
    #[serde(borrow)]
    Hello(Hello<'a>),
    /// To `status`.
    Status(Counters),
    /// To `cycle`.
    Cycle(CycleReply<T>),
    /// To `sweep`.
    Sweep(SweepReply),
    /// To `table` and `numbers`.
    Received(Received),
    /// To `swap`: the checksum of the table that is in service now.
    Swapped(Checksum),
    /// To `weight`: the checksum of the table that its reference is of.
    Carried(Checksum),
    /// To `probe`, `learned` and `save`.
    Learned(Learned),
    /// To a bad line.
    Error(Code),
}

/// Who the controller is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hello<'a> {
    /// Name and version.
    pub firmware: &'a str,
    /// What it runs on.
    pub board: &'a str,
    /// `MachineParameters::checksum`.
    pub machine: Checksum,
    /// `CorrectionTable::checksum` of the table in service.
    pub table: Checksum,
    /// Period of the cyclic task in s.
    pub period_s: f64,
    /// Ticks of its clock in a second.
    pub ticks_hz: u32,
    /// Least screw lengths.
    pub travel_min_m: [f64; 3],
    /// Greatest screw lengths.
    pub travel_max_m: [f64; 3],
    /// Longest command, without its line feed.
    pub max_command_bytes: u32,
    /// Commands that may wait unanswered, in bytes. What comes beyond is lost, and its line refused.
    pub input_bytes: u32,
    /// Memory between the statics and the end of RAM.
    pub stack_bytes: u32,
}

/// What has come of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Received {
    /// So many numbers.
    pub numbers: u32,
    /// Of so many.
    pub of: u32,
}

/// What has happened since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counters {
    /// Runs of the cyclic task.
    pub cycles: u32,
    /// Periods that began while a run still went on or had not begun; that run kept its period from having one of its own.
    pub overruns: u32,
    /// Ticks of the longest run.
    pub worst_ticks: u32,
    /// Most stack in use so far, interrupts included.
    pub stack_used_bytes: u32,
    /// Lines that got an error.
    pub bad_lines: u32,
    /// Replies that the line did not take in time, and that were cut off.
    pub lost_replies: u32,
    /// Times that the task gave a demand up: no other came in time, or the byte [`ABORT`](crate::ABORT).
    pub dropped_demands: u32,
    /// Why the firmware started again; none after power-up.
    pub last_fault: Option<Fault>,
}

/// Why a firmware stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// The watchdog or the reset button: the firmware itself noticed nothing.
    Restart,
    /// A panic.
    Panic,
    /// An exception of the processor.
    Exception,
    /// The stack met its guard.
    Stack,
    /// A self-test failed, or machine, wrist or table are not in memory as they were built; or the table in service no longer is as it came.
    SelfTest,
}

/// What the cyclic task made of a demand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CycleReply<T> {
    /// Whether there are numbers and whether the table vouches for them.
    pub status: Status,
    /// Duration of the run in ticks.
    pub ticks: u32,
    /// The run did not end within its period.
    pub overrun: bool,
    /// Present with [`Status::Ok`] and [`Status::OutsideBox`].
    pub numbers: Option<Numbers<T>>,
}

/// What the cyclic task made of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepReply {
    /// Steps with [`Status::Ok`].
    pub ok: u32,
    /// Steps with [`Status::OutsideBox`].
    pub outside_box: u32,
    /// All other steps.
    pub refused: u32,
    /// Runs that did not end within their period.
    pub overruns: u32,
    /// Ticks of the longest run.
    pub worst_ticks: u32,
    /// [`pkm_core::checksum`] over each step's [`Status`] (one byte, its place in the list there) and numbers, if any, as `f64`.
    pub results: Checksum,
}

impl Default for SweepReply {
    fn default() -> Self {
        Self { ok: 0, outside_box: 0, refused: 0, overruns: 0, worst_ticks: 0, results: Checksum(START) }
    }
}

impl SweepReply {
    /// Takes in the next step.
    pub fn add<T: Scalar>(&mut self, step: &CycleReply<T>) {
        let count = match step.status {
            Status::Ok => &mut self.ok,
            Status::OutsideBox => &mut self.outside_box,
            _ => &mut self.refused,
        };
        *count = count.wrapping_add(1);
        self.overruns = self.overruns.wrapping_add(step.overrun.into());
        self.worst_ticks = self.worst_ticks.max(step.ticks);
        let mut hash = over_byte(self.results.0, step.status as u8);
        for number in step.numbers.iter().flat_map(Numbers::all) {
            hash = over_numbers(hash, &[number.to_f64()]);
        }
        self.results = Checksum(hash);
    }
}

/// How a cycle ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// In the table's box.
    Ok,
    /// Outside of it: an extrapolation.
    OutsideBox,
    /// A screw would leave its travel, at the pose or at the one to command.
    OutOfTravel,
    /// No assembly.
    Unreachable,
    /// Too near to a singularity, or a tip that the screws cannot move in every direction.
    Singular,
    /// A number overflows in this arithmetic.
    NotFinite,
    /// The correction or the stiffness is not positive at this pose.
    NotPositive,
    /// The table has no factor form.
    NoFactorForm,
    /// Another error of the core.
    Failed,
}

/// What a cycle computes, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Numbers<T> {
    /// Screw lengths of the pose without load.
    pub q_m: [T; 3],
    /// K_m at A in A-uvw, k11, k12, …, k66: the upper triangle row by row. N/m, N/rad, N·m/rad.
    pub k: [T; 21],
    /// Displacement of A under the load along u, v, w.
    pub translation_m: [T; 3],
    /// Rotation about u, v, w.
    pub rotation_rad: [T; 3],
    /// What to command under the load.
    pub compensated: Compensated<T>,
}

/// Pose and screw lengths that put the loaded tip where the unloaded one should be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compensated<T> {
    /// θ.
    pub theta_rad: T,
    /// σ.
    pub sigma_rad: T,
    /// Z0.
    pub z0_m: T,
    /// Screw lengths.
    pub q_m: [T; 3],
}

impl<T: Scalar + Serialize> Reply<'_, T> {
    /// Writes the line with its CRC and line feed; `None` when `buffer` is too short ([`MAX_REPLY`](crate::MAX_REPLY) always does).
    pub fn write<'b>(&self, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        write_line(self, buffer)
    }
}

impl<'a, T: Scalar + Deserialize<'a>> Reply<'a, T> {
    /// Reads a line with or without its line feed. `None` when it is no reply, a damaged one, or one of another version.
    pub fn parse(line: &'a [u8]) -> Option<Self> {
        let line = opened(line)?;
        objects(line, &[b"true", b"false", b"null"])?;
        let (reply, length): (Self, _) = serde_json_core::from_slice(line).ok()?;
        // null is read as a number that is none
        let finite = match &reply.answer {
            Answer::Hello(h) => {
                h.travel_min_m.iter().chain(&h.travel_max_m).chain([&h.period_s]).all(|v| v.is_finite())
            }
            Answer::Cycle(cycle) => cycle.numbers.as_ref().is_none_or(Numbers::are_finite),
            Answer::Learned(learned) => learned.is_finite(),
            Answer::Status(_) | Answer::Sweep(_) | Answer::Received(_) => true,
            Answer::Swapped(_) | Answer::Carried(_) | Answer::Error(_) => true,
        };
        (length == line.len() && reply.v == VERSION && finite).then_some(reply)
    }
}

impl<T: Scalar> CycleReply<T> {
    /// From what the core gave.
    pub fn new(result: &Result<Cycle<T>, CycleError>, ticks: u32, overrun: bool) -> Self {
        let (status, numbers) = match result {
            Ok(cycle) => {
                let numbers = Numbers::new(cycle);
                match cycle.corrected.domain {
                    _ if !numbers.are_finite() => (Status::NotFinite, None),
                    Domain::Inside => (Status::Ok, Some(numbers)),
                    Domain::Outside => (Status::OutsideBox, Some(numbers)),
                }
            }
            Err(e) => (Status::of(*e), None),
        };
        Self { status, ticks, overrun, numbers }
    }
}

impl Status {
    fn of(error: CycleError) -> Self {
        match error {
            CycleError::Correction(CorrectionError::Stiffness(StiffnessError::Kinematics(e)))
            | CycleError::Compensation(CompensationError::Kinematics(e)) => match e {
                KinematicsError::OutOfTravel { .. } => Self::OutOfTravel,
                KinematicsError::Unreachable => Self::Unreachable,
                KinematicsError::Singular => Self::Singular,
                KinematicsError::NotFinite => Self::NotFinite,
                _ => Self::Failed,
            },
            CycleError::Compensation(CompensationError::Singular) => Self::Singular,
            CycleError::Compensation(CompensationError::NotFinite)
            | CycleError::Correction(CorrectionError::Stiffness(StiffnessError::NotFinite)) => Self::NotFinite,
            CycleError::Correction(
                CorrectionError::NotPositive { .. } | CorrectionError::Stiffness(StiffnessError::NotPositiveDefinite),
            ) => Self::NotPositive,
            CycleError::Correction(CorrectionError::NoFactorForm) => Self::NoFactorForm,
            _ => Self::Failed,
        }
    }
}

impl<T: Scalar> Numbers<T> {
    fn new(cycle: &Cycle<T>) -> Self {
        // symmetric: its columns are its rows
        let rows: [[T; 6]; 6] = cycle.corrected.factor.stiffness().matrix().into();
        let upper = rows.iter().enumerate().flat_map(|(i, row)| row.iter().skip(i));
        let mut k = [T::ZERO; 21];
        for (entry, value) in k.iter_mut().zip(upper) {
            *entry = *value;
        }
        let Pose { theta_rad, sigma_rad, z0_m } = cycle.compensated.pose;
        Self {
            q_m: cycle.lengths.q_m.into(),
            k,
            translation_m: cycle.deflection.translation_m.into(),
            rotation_rad: cycle.deflection.rotation_rad.into(),
            compensated: Compensated { theta_rad, sigma_rad, z0_m, q_m: cycle.compensated.lengths.q_m.into() },
        }
    }

    /// All of them in the order of the line.
    pub fn all(&self) -> impl Iterator<Item = T> {
        let Compensated { theta_rad, sigma_rad, z0_m, q_m } = self.compensated;
        let parts = self.q_m.into_iter().chain(self.k).chain(self.translation_m).chain(self.rotation_rad);
        parts.chain([theta_rad, sigma_rad, z0_m]).chain(q_m)
    }

    fn are_finite(&self) -> bool {
        self.all().all(Scalar::is_finite)
    }
}

/// 64 bits, in JSON as 16 hexadecimal digits: many readers take numbers for `f64`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Checksum(pub u64);

impl Checksum {
    /// [`pkm_core::checksum`] over bytes.
    pub fn over(bytes: &[u8]) -> Self {
        Self(bytes.iter().fold(START, |hash, byte| over_byte(hash, *byte)))
    }
}

impl fmt::Display for Checksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl fmt::Debug for Checksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Serialize for Checksum {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut digits = [0; 16];
        for (place, digit) in digits.iter_mut().enumerate() {
            let nibble = (self.0 >> (60 - 4 * place)) as u8 & 15;
            *digit = nibble + if nibble < 10 { b'0' } else { b'a' - 10 };
        }
        serializer.serialize_str(core::str::from_utf8(&digits).unwrap_or_default())
    }
}

impl<'de> Deserialize<'de> for Checksum {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <&str>::deserialize(deserializer)?;
        let value = u64::from_str_radix(text, 16).ok().filter(|_| text.len() == 16);
        value.map(Self).ok_or_else(|| D::Error::custom("expected 16 hexadecimal digits"))
    }
}

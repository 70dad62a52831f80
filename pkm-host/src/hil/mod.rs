//! Hardware in the loop: drives firmware that runs the core (`cyclic`) and compares every reply with the host.
//!
//! Commands are sent ahead as far as the firmware's input goes. In between come lines that it has to refuse.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::Instant;

use pkm_core::{CorrectionTable, Machine};
use pkm_protocol::{Arithmetic, Checksum, Hello};
use serde_json::Value;

pub use self::check::{CycleCounts, Findings};
use self::lines::{Drawn, Sent};
use self::link::Link;
use crate::error::{Failure, Result};
use crate::pose::PoseBox;
use crate::progress::Progress;

mod check;
mod lines;
mod link;
mod transfer;

/// Virtual time of an instruction in QEMU is 2 to this in ns: 62.5 million a second.
const ICOUNT_SHIFT: u32 = 4;

/// f32 against f64 in the table's box: screw lengths in m; K relative to √(k_ii k_jj); deflection relative to its norm with
/// rotations times 0.2 m. More fails the run.
pub const F32_BOUNDS: [f64; 3] = [5e-7, 2e-6, 1e-4];

/// Where `pkm-fw` builds the firmware, seen from the top of the repository.
pub const DEFAULT_ELF: &str = "embed/firmware/target/thumbv7em-none-eabihf/release/cyclic";

/// Where the firmware is.
pub enum Target {
    /// Behind a serial port.
    Port {
        /// As the system names it.
        name: String,
        /// Bits a second.
        baud: u32,
    },
    /// In QEMU, which is started for it.
    Qemu {
        /// QEMU's name of the machine.
        board: String,
        /// The firmware.
        elf: PathBuf,
    },
}

/// What to send.
pub struct Campaign {
    /// Of all that is drawn.
    pub seed: u64,
    /// Half of them in f32, half in f64.
    pub poses: u64,
    /// More than one: each command is a sweep of so many poses between two drawn ones, answered by counts and a checksum.
    pub steps: u32,
    /// Most are drawn from here.
    pub pose_box: PoseBox,
    /// Put the host's table into service on firmware that has another.
    pub send_table: bool,
}

/// Machine and table that the host computes with, as the firmware should.
pub struct HostModel<'a> {
    /// Checksums of machine and table.
    pub checksums: [u64; 2],
    /// In f64.
    pub double: (Machine<f64>, CorrectionTable<'a, f64>),
    /// In f32.
    pub single: (Machine<f32>, CorrectionTable<'a, f32>),
}

/// What came of a campaign.
pub struct Outcome {
    /// The port, or QEMU with its board.
    pub name: String,
    /// What the firmware said of itself, with the table in service.
    pub hello: Value,
    /// Whether the host's table was put into service.
    pub table_sent: bool,
    /// Instructions in a tick; `None` on a board, of which that is not known.
    pub instructions_in_tick: Option<f64>,
    /// Ticks a second.
    pub ticks_hz: u32,
    /// Replies.
    pub replies: u64,
    /// Of the campaign.
    pub seconds: f64,
    /// Stack that the firmware used.
    pub stack_used_bytes: u32,
    /// Replies compared.
    pub findings: Findings,
}

impl Outcome {
    /// Any difference, and an f32 that is too far from f64.
    pub fn failure(&self) -> Option<Failure> {
        let findings = &self.findings;
        if let Some(first) = &findings.first {
            let by = match findings.worst_deviation {
                0.0 => String::new(),
                worst => format!(", numbers by up to {worst:.1e}"),
            };
            let message = format!("{} replies differ from the host's{by}; the first: {first}", findings.differing);
            return Some(Failure::other(message).in_file(&self.name));
        }
        let too_far = findings.precision.iter().zip(F32_BOUNDS).any(|(found, bound)| !(*found <= bound));
        let message = || format!("f32 is further from f64 than {F32_BOUNDS:?}");
        too_far.then(|| Failure::other(message()).in_file(&self.name))
    }
}

/// Refuses firmware with another machine or table.
fn same_model(hello: &Hello<'_>, host: [Checksum; 2], name: &str) -> Result<Value> {
    if [hello.machine, hello.table] != host {
        let message = format!(
            "the firmware has machine {} and table {}, the host {} and {}: build it with the coefficients.rs of this \
             table (PKM_COEFFICIENTS), give its --machine and --table, or change its table with --send-table",
            hello.machine, hello.table, host[0], host[1]
        );
        return Err(Failure::input(message).in_file(name));
    }
    serde_json::to_value(hello).map_err(|e| Failure::other(e.to_string()))
}

/// Runs a campaign.
///
/// # Errors
/// No firmware there, another machine or table in it, a line that is no reply, silence.
pub fn run(target: &Target, campaign: &Campaign, host: &HostModel<'_>, progress: &Progress<'_>) -> Result<Outcome> {
    let mut link = Link::open(target)?;
    let name = link.name.clone();
    let checksums = host.checksums.map(Checksum);
    let mut table_sent = false;
    if campaign.send_table {
        let (has_it, ..) = link.hello(|hello| Ok((hello.table == checksums[1]).into()))?;
        table_sent = has_it == Value::Bool(false);
        if table_sent {
            transfer::send(&mut link, host.checksums[0], &host.double.1)?;
        }
    }
    let (hello, ticks_hz, input_bytes) = link.hello(|hello| same_model(hello, checksums, &name))?;
    let before = link.status()?;
    let mut findings = Findings::default();
    let mut drawn = Drawn::new(campaign);
    let begun = Instant::now();
    let mut status = before;
    let (mut overruns, mut done) = (before.overruns, 0);
    progress("poses", done, campaign.poses);
    for (arithmetic, poses) in [(Arithmetic::F32, campaign.poses.div_ceil(2)), (Arithmetic::F64, campaign.poses / 2)] {
        let mut left = poses;
        let mut waiting: VecDeque<Sent> = VecDeque::new();
        let mut bytes = 0;
        let mut next: Option<Sent> = None;
        loop {
            if next.is_none() && left > 0 {
                next = Some(drawn.next(arithmetic, &mut left));
            }
            if let Some(sent) = next.take_if(|sent| bytes + sent.line.len() < input_bytes) {
                bytes += sent.line.len();
                link.send(&sent.line)?;
                waiting.push_back(sent);
                continue;
            }
            let Some(sent) = waiting.pop_front() else {
                let Some(sent) = next else { break };
                let bytes = sent.line.len();
                let message = format!("its input of {input_bytes} bytes does not hold a line of {bytes}");
                return Err(Failure::other(message).in_file(&name));
            };
            let reply = link.reply(&sent.line)?;
            bytes -= sent.line.len();
            findings.check(&link, host, &sent, &reply)?;
            done += sent.expected.poses();
            let differ =
                if findings.differing > 0 { format!(", {} differ", findings.differing) } else { String::new() };
            progress(&format!("poses{differ}"), done, campaign.poses);
        }
        status = link.status()?;
        findings.of[usize::from(arithmetic == Arithmetic::F64)].overruns = status.overruns.wrapping_sub(overruns);
        overruns = status.overruns;
    }
    let seconds = begun.elapsed().as_secs_f64();
    let refused = status.bad_lines.wrapping_sub(before.bad_lines);
    if u64::from(refused) != findings.bad_lines {
        findings.differing += 1;
        let first = format!("the firmware counts {refused} bad lines, sent were {}", findings.bad_lines);
        findings.first.get_or_insert(first);
    }
    findings.of.iter_mut().for_each(|of| of.ticks.sort_unstable());
    // a tick is 1e9/ticks_hz ns, an instruction 2^shift ns
    let instructions_in_tick = match target {
        Target::Qemu { .. } => Some(1e9 / f64::from(ticks_hz) / f64::from(1_u32 << ICOUNT_SHIFT)),
        Target::Port { .. } => None,
    };
    let (replies, stack_used_bytes) = (link.replies, status.stack_used_bytes);
    Ok(Outcome {
        name,
        hello,
        table_sent,
        instructions_in_tick,
        ticks_hz,
        replies,
        seconds,
        stack_used_bytes,
        findings,
    })
}

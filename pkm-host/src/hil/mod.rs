//! Hardware in the loop: drives firmware that runs the core (`pkm-fw`'s `cyclic`) and holds every reply against the host.
//!
//! Commands are sent ahead as far as the firmware's input goes. In between come lines that it has to refuse.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command as Program, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use fastrand::Rng;
use pkm_core::{CorrectionTable, Machine, Pose, Scalar, Wrench};
use pkm_protocol::{
    Answer, Arithmetic, Checksum, Code, Command, Counters, CycleReply, Demand, Hello, Lines, MAX_COMMAND, Numbers,
    Reply, Request, Status, Sweep, SweepReply,
};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::error::{Failure, Result, printable};
use crate::pose::{PoseBox, ROTATION_ARM_M, core_units};
use crate::progress::Progress;

/// Virtual time of an instruction in QEMU is 2 to this in ns: 62.5 million a second.
const ICOUNT_SHIFT: u32 = 4;
const ATTEMPTS: u32 = 3;
const HELLO_WAIT: Duration = Duration::from_secs(3);
const REPLY_WAIT: Duration = Duration::from_secs(20);
/// One line in so many is bad.
const BAD_EVERY: u8 = 50;

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
}

/// What the firmware is held against.
pub struct Twin<'a> {
    /// Checksums of machine and table.
    pub checksums: [u64; 2],
    /// In f64.
    pub double: (Machine<f64>, CorrectionTable<'a, f64>),
    /// In f32.
    pub single: (Machine<f32>, CorrectionTable<'a, f32>),
}

/// A line to the firmware, and what it must answer.
struct Sent {
    line: Vec<u8>,
    due: Due,
}

enum Due {
    Cycle { id: u32, demand: Demand },
    Sweep { id: u32, sweep: Sweep },
    Error { id: Option<u32>, code: Code },
}

struct Link {
    name: String,
    writer: Box<dyn Write>,
    lines: Receiver<Vec<u8>>,
    child: Option<Child>,
    replies: u64,
}

impl Drop for Link {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // it may have ended by itself
            drop(child.kill());
            drop(child.wait());
        }
    }
}

impl Link {
    fn open(target: &Target) -> Result<Self> {
        let (name, reader, writer, child): (String, Box<dyn Read + Send>, Box<dyn Write>, _) = match target {
            Target::Port { name, baud } => {
                let refused = |e: serialport::Error| Failure::input(format!("cannot open the port: {e}")).in_file(name);
                let port = serialport::new(name, *baud).timeout(Duration::from_millis(200)).open().map_err(refused)?;
                (name.clone(), Box::new(port.try_clone().map_err(refused)?), Box::new(port), None)
            }
            Target::Qemu { board, elf } => {
                if !elf.is_file() {
                    let message = "no firmware there: build it with `cargo build --release --bin cyclic` in embed/firmware, or \
                                   name another with --elf";
                    return Err(Failure::input(message).in_file(elf.display().to_string()));
                }
                let mut child = Program::new("qemu-system-arm")
                    .args(["-M", board, "-nographic", "-monitor", "none", "-serial", "stdio"])
                    .args(["-icount", &format!("shift={ICOUNT_SHIFT},sleep=off"), "-kernel"])
                    .arg(elf)
                    .stdin(Stdio::piped())
                    .stdout(Stdio::piped())
                    .spawn()
                    .map_err(|e| {
                        Failure::other(format!("qemu-system-arm: {e} (Debian: apt-get install qemu-system-arm)"))
                    })?;
                let (Some(reader), Some(writer)) = (child.stdout.take(), child.stdin.take()) else {
                    return Err(Failure::other("qemu-system-arm has no standard input and output"));
                };
                (format!("QEMU ({board})"), Box::new(reader), Box::new(writer), Some(child))
            }
        };
        let (sender, lines) = sync_channel(1024);
        std::thread::spawn(move || {
            let mut reader = reader;
            let (mut buffer, mut line) = ([0; 4096], Vec::new());
            loop {
                let count = match reader.read(&mut buffer) {
                    Ok(0) => return,
                    Ok(count) => count,
                    Err(e) if matches!(e.kind(), std::io::ErrorKind::TimedOut | std::io::ErrorKind::Interrupted) => 0,
                    Err(_) => return,
                };
                for byte in &buffer[..count] {
                    line.push(*byte);
                    // garbage may have no line feeds
                    if (*byte == b'\n' || line.len() > 1 << 16) && sender.send(std::mem::take(&mut line)).is_err() {
                        return;
                    }
                }
            }
        });
        Ok(Self { name, writer, lines, child, replies: 0 })
    }

    fn failed(&self, message: impl std::fmt::Display) -> Failure {
        Failure::other(format!("{message}, after {} replies", self.replies)).in_file(&self.name)
    }

    fn send(&mut self, line: &[u8]) -> Result<()> {
        self.writer.write_all(line).and_then(|()| self.writer.flush()).map_err(|e| self.failed(self.gone(&e)))
    }

    fn gone(&self, why: &dyn std::fmt::Display) -> String {
        match self.child {
            Some(_) => format!("QEMU ended ({why})"),
            None => format!("the port is gone ({why}): unplugged, or opened by another program?"),
        }
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>> {
        match self.lines.recv_timeout(wait) {
            Ok(line) => Ok(Some(line)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(self.failed(self.gone(&"no more data"))),
        }
    }

    fn reply(&mut self, to: &[u8]) -> Result<Vec<u8>> {
        let line = self
            .receive(REPLY_WAIT)?
            .ok_or_else(|| self.failed(format!("no reply within {} s to {}", REPLY_WAIT.as_secs(), shown(to))))?;
        self.replies += 1;
        Ok(line)
    }

    fn parsed<'a, T: Scalar + Deserialize<'a>>(&self, line: &'a [u8]) -> Result<Reply<'a, T>> {
        let baud = if self.child.is_none() { ": another firmware or baud rate?" } else { "" };
        Reply::parse(line).ok_or_else(|| self.failed(format!("not a reply of this protocol: {}{baud}", shown(line))))
    }

    /// Passes over what is left from earlier, and hears who is there.
    fn hello(&mut self, seen: impl Fn(&Hello<'_>) -> Result<Value>) -> Result<(Value, u32, usize)> {
        let mut noise = None;
        for id in 1..=ATTEMPTS {
            self.send(b"\n")?;
            self.send(&written(&Request { id, command: Command::Hello }))?;
            let until = Instant::now() + HELLO_WAIT;
            while let Some(line) = self.receive(until.saturating_duration_since(Instant::now()))? {
                match Reply::<f64>::parse(&line) {
                    Some(Reply { id: Some(i), answer: Answer::Hello(hello), .. }) if i == id => {
                        self.replies += 1;
                        return Ok((seen(&hello)?, hello.ticks_hz, hello.input_bytes as usize));
                    }
                    _ => noise = Some(line),
                }
            }
        }
        let heard = noise.map_or("nothing".into(), |line| shown(&line));
        let hint = if self.child.is_some() {
            "is the firmware `cyclic`, built for this board?"
        } else {
            "is the firmware running, and --baud its rate?"
        };
        Err(self.failed(format!("no answer to hello, heard {heard}; {hint}")))
    }

    fn status(&mut self) -> Result<Counters> {
        let line = written(&Request { id: 0, command: Command::Status });
        self.send(&line)?;
        let reply = self.reply(&line)?;
        match self.parsed::<f64>(&reply)?.answer {
            Answer::Status(counters) => Ok(counters),
            _ => Err(self.failed(format!("not the status: {}", shown(&reply)))),
        }
    }
}

fn written(request: &Request) -> Vec<u8> {
    request.write(&mut [0; MAX_COMMAND + 1]).map(<[u8]>::to_vec).unwrap_or_default()
}

fn shown(line: &[u8]) -> String {
    format!("`{}`", printable(String::from_utf8_lossy(line).trim_end()).chars().take(200).collect::<String>())
}

fn demand(rng: &mut Rng, pose_box: &PoseBox, arithmetic: Arithmetic) -> Demand {
    let kind = rng.u8(0..100);
    let [theta, sigma, z0] = pose_box.ranges();
    let mut within = |[low, high]: [f64; 2], by: f64| {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        middle + by * half * (2.0 * rng.f64() - 1.0)
    };
    // in the box; around it; anywhere
    let [theta_rad, sigma_rad, z0_m] = match kind {
        0..90 => core_units([within(theta, 1.0), within(sigma, 1.0), within(z0, 1.0)]),
        90..97 => core_units([within(theta, 2.0), within(sigma, 2.0), within(z0, 2.0)]),
        _ => [within([-2.0, 2.0], 1.0), within([-2.0, 2.0], 1.0), within([-1.0, 2.0], 1.0)],
    };
    // few digits keep the lines short
    let mut three = |size: f64, digit: f64| [0; 3].map(|_| (within([-size, size], 1.0) / digit).round() * digit);
    let (force_n, moment_nm, [u, v, w]) = (three(2000.0, 1.0), three(200.0, 1.0), three(0.125, 0.0078125));
    let tip_m = [u, v, 0.375 + w];
    Demand {
        arithmetic,
        pose: Pose { theta_rad, sigma_rad, z0_m },
        wrench_at_tip: Wrench { force_n, moment_nm },
        tip_m,
    }
}

/// A line that no firmware may accept.
fn bad_line(rng: &mut Rng, good: &[u8]) -> Option<Sent> {
    let text = String::from_utf8_lossy(good.trim_ascii_end()).into_owned();
    let mut line = match rng.u8(0..9) {
        0 => text[..rng.usize(1..text.len())].to_owned().into_bytes(),
        1 => (0..rng.usize(1..300)).map(|_| rng.u8(..)).filter(|b| *b != b'\n').collect(),
        2 => vec![b'['; rng.usize(1..2 * MAX_COMMAND)],
        3 => text.replacen(",\"force_n\"", "e999,\"force_n\"", 1).into(),
        4 => text.replacen("\"v\":1", "\"v\":2", 1).into(),
        5 => text.replacen("cycle", "reboot", 1).into(),
        6 => text.replacen("\"v\":1", "\"v\":1,\"v\":1", 1).into(),
        7 => text.replacen("[", "[,", 1).into(),
        _ => text.replacen("\"z0_m\":", "\"z0_m\":NaN", 1).into(),
    };
    line.push(b'\n');
    let mut lines = Lines::new();
    match line.iter().filter_map(|b| lines.push(*b)).next() {
        Some(Err(refused)) => Some(Sent { line, due: Due::Error { id: refused.id, code: refused.code } }),
        _ => None,
    }
}

/// What was found so far.
#[derive(Default)]
struct Findings {
    differing: u64,
    first: Option<String>,
    worst_deviation: f64,
    bad_lines: u64,
    /// f32, f64.
    of: [Found; 2],
    /// f32 against f64.
    precision: [f64; 3],
}

#[derive(Default)]
struct Found {
    cycles: u64,
    /// Of each cycle, or the greatest of each sweep.
    ticks: Vec<u32>,
    outside_box: u64,
    refused: u64,
    overruns: u32,
}

impl Findings {
    fn check(&mut self, link: &Link, twin: &Twin<'_>, sent: &Sent, reply: &[u8]) -> Result<()> {
        match &sent.due {
            Due::Error { id, code } => {
                self.bad_lines += 1;
                let expected = Reply { v: pkm_protocol::VERSION, id: *id, answer: Answer::Error(*code) };
                if link.parsed::<f64>(reply)? != expected {
                    self.differs(&sent.line, reply, &format!("{expected:?}"));
                }
            }
            Due::Cycle { id, demand } => match demand.arithmetic {
                Arithmetic::F32 => {
                    if let Some(single) = self.cycle(link, &twin.single, (*id, demand), sent, reply)? {
                        self.keep_precision(&single, demand, &twin.double);
                    }
                }
                Arithmetic::F64 => drop(self.cycle(link, &twin.double, (*id, demand), sent, reply)?),
            },
            Due::Sweep { id, sweep } => {
                let parsed = link.parsed::<f64>(reply)?;
                let mut expected = SweepReply::default();
                for demand in sweep.demands() {
                    match demand.arithmetic {
                        Arithmetic::F32 => {
                            let single = CycleReply::new(&demand.cycle(&twin.single.0, &twin.single.1), 0, false);
                            if let Some(numbers) = &single.numbers {
                                self.keep_precision(numbers, &demand, &twin.double);
                            }
                            expected.add(&single);
                        }
                        Arithmetic::F64 => {
                            expected.add(&CycleReply::new(&demand.cycle(&twin.double.0, &twin.double.1), 0, false));
                        }
                    }
                }
                if let Answer::Sweep(found) = parsed.answer {
                    (expected.overruns, expected.worst_ticks) = (found.overruns, found.worst_ticks);
                }
                if parsed != (Reply { v: pkm_protocol::VERSION, id: Some(*id), answer: Answer::Sweep(expected) }) {
                    self.differs(&sent.line, reply, &format!("{expected:?}"));
                }
                let of = &mut self.of[usize::from(sweep.from.arithmetic == Arithmetic::F64)];
                of.cycles += u64::from(sweep.steps);
                of.ticks.push(expected.worst_ticks);
                of.refused += u64::from(expected.refused);
                of.outside_box += u64::from(expected.outside_box);
            }
        }
        Ok(())
    }

    fn cycle<T: Scalar + for<'a> Deserialize<'a>>(
        &mut self,
        link: &Link,
        (machine, table): &(Machine<T>, CorrectionTable<'_, T>),
        (id, demand): (u32, &Demand),
        sent: &Sent,
        reply: &[u8],
    ) -> Result<Option<Numbers<T>>> {
        let parsed = link.parsed::<T>(reply)?;
        let Answer::Cycle(found) = parsed.answer else {
            self.differs(&sent.line, reply, "a cycle");
            return Ok(None);
        };
        let expected = CycleReply::new(&demand.cycle(machine, table), found.ticks, found.overrun);
        let bits = |v: &T| v.to_f64().to_bits();
        let same = match (&found.numbers, &expected.numbers) {
            (Some(f), Some(e)) => {
                for (f, e) in f.all().zip(e.all()) {
                    let (f, e) = (f.to_f64(), e.to_f64());
                    if f != e {
                        self.worst_deviation = self.worst_deviation.max((f - e).abs() / e.abs());
                    }
                }
                f.all().map(|v| bits(&v)).eq(e.all().map(|v| bits(&v)))
            }
            (None, None) => true,
            _ => false,
        };
        if !same || found.status != expected.status || parsed.id != Some(id) {
            self.differs(&sent.line, reply, &format!("{expected:?}"));
        }
        let of = &mut self.of[usize::from(demand.arithmetic == Arithmetic::F64)];
        of.cycles += 1;
        of.ticks.push(found.ticks);
        of.refused += u64::from(expected.numbers.is_none());
        of.outside_box += u64::from(expected.status == Status::OutsideBox);
        Ok(found.numbers)
    }

    fn differs(&mut self, sent: &[u8], reply: &[u8], expected: &str) {
        self.differing += 1;
        self.first.get_or_insert_with(|| format!("to {} came {}, expected {expected}", shown(sent), shown(reply)));
    }

    /// In the box only.
    fn keep_precision(
        &mut self,
        single: &Numbers<f32>,
        demand: &Demand,
        (machine, table): &(Machine<f64>, CorrectionTable<'_, f64>),
    ) {
        let double = CycleReply::new(&demand.cycle(machine, table), 0, false);
        let (Status::Ok, Some(double)) = (double.status, double.numbers) else { return };
        let lengths = |a: [f32; 3], b: [f64; 3]| (0..3).map(|i| (f64::from(a[i]) - b[i]).abs()).fold(0.0, f64::max);
        let turned = |v: [f64; 3]| v.map(|v| ROTATION_ARM_M * v);
        let six = |t: [f64; 3], r: [f64; 3]| t.into_iter().chain(turned(r));
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
        let mut deflection = six(double.translation_m, double.rotation_rad);
        let narrow = six(single.translation_m.map(f64::from), single.rotation_rad.map(f64::from));
        let mut off = narrow.zip(deflection.clone()).map(|(a, b)| a - b);
        let diagonal = [0, 6, 11, 15, 18, 20].map(|i| double.k[i]);
        let pairs = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
        let k = pairs
            .zip(single.k.iter().zip(&double.k))
            .map(|((i, j), (a, b))| (f64::from(*a) - b).abs() / (diagonal[i] * diagonal[j]).sqrt());
        let found = [
            lengths(single.q_m, double.q_m).max(lengths(single.compensated.q_m, double.compensated.q_m)),
            k.fold(0.0, f64::max),
            norm(&mut off) / norm(&mut deflection),
        ];
        for (worst, found) in self.precision.iter_mut().zip(found) {
            *worst = worst.max(found);
        }
    }
}

/// Runs a campaign: text and document of what was found.
///
/// # Errors
/// No firmware there, another machine or table in it, a line that is no reply, silence; and any difference.
pub fn run(target: &Target, campaign: &Campaign, twin: &Twin<'_>, progress: &Progress<'_>) -> Result<(String, Value)> {
    let mut link = Link::open(target)?;
    let name = link.name.clone();
    let (mut document, ticks_hz, input_bytes) = link.hello(|hello| {
        let host = twin.checksums.map(Checksum);
        if [hello.machine, hello.table] != host {
            let message = format!(
                "the firmware has machine {} and table {}, the host {} and {}: build it with the coefficients.rs of this \
                 table (PKM_COEFFICIENTS), or give its --machine and --table",
                hello.machine, hello.table, host[0], host[1]
            );
            return Err(Failure::input(message).in_file(&name));
        }
        serde_json::to_value(hello).map_err(|e| Failure::other(e.to_string()))
    })?;
    let before = link.status()?;
    let mut findings = Findings::default();
    let mut rng = Rng::with_seed(campaign.seed);
    let mut done = 0;
    progress("poses", done, campaign.poses);
    let begun = Instant::now();
    let mut overruns = before.overruns;
    let mut id = 0_u32;
    let mut status = before;
    for (arithmetic, poses) in [(Arithmetic::F32, campaign.poses.div_ceil(2)), (Arithmetic::F64, campaign.poses / 2)] {
        let mut left = poses;
        let mut waiting: VecDeque<Sent> = VecDeque::new();
        let mut bytes = 0;
        let mut next: Option<Sent> = None;
        loop {
            if next.is_none() && left > 0 {
                id = id.wrapping_add(1);
                let mut demand = || demand(&mut rng, &campaign.pose_box, arithmetic);
                let from = demand();
                let steps = left.min(campaign.steps.into()) as u32;
                let (due, command) = if steps > 1 {
                    let sweep = Sweep { from, to: demand().pose, steps };
                    (Due::Sweep { id, sweep }, Command::Sweep(sweep))
                } else {
                    (Due::Cycle { id, demand: from }, Command::Cycle(from))
                };
                let line = written(&Request { id, command });
                next = (rng.u8(0..BAD_EVERY) == 0).then(|| bad_line(&mut rng, &line)).flatten();
                if next.is_none() {
                    next = Some(Sent { line, due });
                    left -= u64::from(steps);
                }
            }
            if let Some(sent) = next.take_if(|sent| bytes + sent.line.len() < input_bytes) {
                bytes += sent.line.len();
                link.send(&sent.line)?;
                waiting.push_back(sent);
                continue;
            }
            let Some(sent) = waiting.pop_front() else { break };
            let reply = link.reply(&sent.line)?;
            bytes -= sent.line.len();
            findings.check(&link, twin, &sent, &reply)?;
            done += match sent.due {
                Due::Cycle { .. } => 1,
                Due::Sweep { sweep, .. } => sweep.steps.into(),
                Due::Error { .. } => 0,
            };
            let differ =
                if findings.differing > 0 { format!("poses, {} differ", findings.differing) } else { "poses".into() };
            progress(&differ, done, campaign.poses);
        }
        status = link.status()?;
        let of = &mut findings.of[usize::from(arithmetic == Arithmetic::F64)];
        of.overruns = status.overruns.wrapping_sub(overruns);
        overruns = status.overruns;
    }
    let seconds = begun.elapsed().as_secs_f64();

    let refused = status.bad_lines.wrapping_sub(before.bad_lines);
    if u64::from(refused) != findings.bad_lines {
        findings.differing += 1;
        let first = format!("the firmware counts {refused} bad lines, sent were {}", findings.bad_lines);
        findings.first.get_or_insert(first);
    }
    // a tick is 1e9/ticks_hz ns, an instruction 2^shift ns
    let in_tick = match target {
        Target::Qemu { .. } => Some(1e9 / f64::from(ticks_hz) / f64::from(1_u32 << ICOUNT_SHIFT)),
        Target::Port { .. } => None,
    };
    let mut text = format!(
        "{}: {} poses (seed {}), {} bad lines sent on purpose, {:.0} replies/s\n",
        link.name,
        campaign.poses,
        campaign.seed,
        findings.bad_lines,
        link.replies as f64 / seconds
    );
    for (name, of) in ["f32", "f64"].into_iter().zip(&mut findings.of) {
        of.ticks.sort_unstable();
        let Some((&worst, &median)) = of.ticks.last().zip(of.ticks.get(of.ticks.len() / 2)) else { continue };
        let instructions = in_tick.map(|i| [median, worst].map(|t| (f64::from(t) * i).round()));
        let mut cost = match instructions {
            Some([median, worst]) => format!("{median} instructions (worst {worst}) a cycle"),
            None => {
                let us = |t: u32| f64::from(t) / f64::from(ticks_hz) * 1e6;
                format!("{:.1} µs (worst {:.1}) a cycle", us(median), us(worst))
            }
        };
        if campaign.steps > 1 {
            cost.push_str(" at a sweep's worst");
        }
        text.push_str(&format!(
            "{name}: {} cycles, {} outside the box, {} refused; {cost}; {} overruns\n",
            of.cycles, of.outside_box, of.refused, of.overruns
        ));
        document[name] = json!({
            "cycles": of.cycles, "outside_box": of.outside_box, "refused": of.refused, "overruns": of.overruns,
            "ticks": { "median": median, "worst": worst },
            "instructions": instructions.map(|[median, worst]| json!({ "median": median, "worst": worst })),
        });
    }
    if findings.of.iter().any(|of| of.overruns > 0) {
        text.push_str("overruns: cycles that took longer than the firmware's period; reported, no failure\n");
    }
    let [q, k, d] = findings.precision;
    text.push_str(&format!("f32 against f64 in the box: screws {q:.1e} m, K_m {k:.1e}, deflection {d:.1e}\n"));
    text.push_str(&format!("stack: {} bytes used\n", status.stack_used_bytes));
    for (key, value) in [
        ("seed", json!(campaign.seed)),
        ("poses", json!(campaign.poses)),
        ("steps", json!(campaign.steps)),
        ("bad_lines", json!(findings.bad_lines)),
        ("differing", json!(findings.differing)),
        ("worst_deviation", json!(findings.worst_deviation)),
        ("f32_against_f64", json!({ "q_m": q, "k_relative": k, "deflection_relative": d })),
        ("stack_used_bytes", json!(status.stack_used_bytes)),
        ("seconds", json!(seconds)),
    ] {
        document[key] = value;
    }
    if let Some(first) = findings.first {
        eprint!("{text}");
        let by = match findings.worst_deviation {
            0.0 => String::new(),
            worst => format!(", numbers by up to {worst:.1e}"),
        };
        let message = format!("{} replies differ from the host's{by}; the first: {first}", findings.differing);
        return Err(Failure::other(message).in_file(&link.name));
    }
    if findings.precision.iter().zip(F32_BOUNDS).any(|(found, bound)| !(*found <= bound)) {
        eprint!("{text}");
        return Err(Failure::other(format!("f32 is further from f64 than {F32_BOUNDS:?}")).in_file(&link.name));
    }
    text.push_str("every reply as on the host, to the last bit\n");
    Ok((text, document))
}

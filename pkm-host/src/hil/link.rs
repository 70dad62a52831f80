//! The line to the firmware: a serial port, or QEMU.

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command as Program, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use pkm_core::Scalar;
use pkm_protocol::{Answer, Command, Counters, Hello, MAX_COMMAND, Reply, Request};
use serde::Deserialize;
use serde_json::Value;

use super::{ICOUNT_SHIFT, Target};
use crate::error::{Failure, Result, printable};

const ATTEMPTS: u32 = 3;
const HELLO_WAIT: Duration = Duration::from_secs(3);
const REPLY_WAIT: Duration = Duration::from_secs(20);

/// The firmware at the other end.
pub(super) struct Link {
    pub(super) name: String,
    writer: Box<dyn Write>,
    lines: Receiver<Vec<u8>>,
    child: Option<Child>,
    pub(super) replies: u64,
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
    pub(super) fn open(target: &Target) -> Result<Self> {
        let (name, reader, writer, child): (String, Box<dyn Read + Send>, Box<dyn Write>, _) = match target {
            Target::Port { name, baud } => {
                let refused = |e: serialport::Error| Failure::input(format!("cannot open the port: {e}")).in_file(name);
                let port = serialport::new(name, *baud).timeout(Duration::from_millis(200)).open().map_err(refused)?;
                (name.clone(), Box::new(port.try_clone().map_err(refused)?), Box::new(port), None)
            }
            Target::Qemu { board, elf } => {
                let (reader, writer, child) = qemu(board, elf)?;
                (format!("QEMU ({board})"), Box::new(reader), Box::new(writer), Some(child))
            }
        };
        let lines = lines_of(reader);
        Ok(Self { name, writer, lines, child, replies: 0 })
    }

    pub(super) fn failed(&self, message: impl std::fmt::Display) -> Failure {
        Failure::other(format!("{message}, after {} replies", self.replies)).in_file(&self.name)
    }

    pub(super) fn send(&mut self, line: &[u8]) -> Result<()> {
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

    pub(super) fn reply(&mut self, to: &[u8]) -> Result<Vec<u8>> {
        let line = self
            .receive(REPLY_WAIT)?
            .ok_or_else(|| self.failed(format!("no reply within {} s to {}", REPLY_WAIT.as_secs(), shown(to))))?;
        self.replies += 1;
        Ok(line)
    }

    pub(super) fn parsed<'a, T: Scalar + Deserialize<'a>>(&self, line: &'a [u8]) -> Result<Reply<'a, T>> {
        let baud = if self.child.is_none() { ": another firmware or baud rate?" } else { "" };
        Reply::parse(line).ok_or_else(|| self.failed(format!("not a reply of this protocol: {}{baud}", shown(line))))
    }

    /// Discards bytes of earlier replies, and asks who is there.
    pub(super) fn hello(&mut self, seen: impl Fn(&Hello<'_>) -> Result<Value>) -> Result<(Value, u32, usize)> {
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

    pub(super) fn status(&mut self) -> Result<Counters> {
        let line = written(&Request { id: 0, command: Command::Status });
        self.send(&line)?;
        let reply = self.reply(&line)?;
        match self.parsed::<f64>(&reply)?.answer {
            Answer::Status(counters) => Ok(counters),
            _ => Err(self.failed(format!("not the status: {}", shown(&reply)))),
        }
    }
}

pub(super) fn written(request: &Request) -> Vec<u8> {
    request.write(&mut [0; MAX_COMMAND + 1]).map(<[u8]>::to_vec).unwrap_or_default()
}

pub(super) fn shown(line: &[u8]) -> String {
    format!("`{}`", printable(String::from_utf8_lossy(line).trim_end()).chars().take(200).collect::<String>())
}

/// QEMU with the firmware: its standard output, its standard input, itself.
fn qemu(board: &str, elf: &Path) -> Result<(ChildStdout, ChildStdin, Child)> {
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
        .map_err(|e| Failure::other(format!("qemu-system-arm: {e} (Debian: apt-get install qemu-system-arm)")))?;
    match (child.stdout.take(), child.stdin.take()) {
        (Some(reader), Some(writer)) => Ok((reader, writer, child)),
        _ => Err(Failure::other("qemu-system-arm has no standard input and output")),
    }
}

/// Lines as they come, read by a thread that ends with its input.
fn lines_of(mut reader: Box<dyn Read + Send>) -> Receiver<Vec<u8>> {
    let (sender, lines) = sync_channel(1024);
    std::thread::spawn(move || {
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
    lines
}

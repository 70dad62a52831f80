//! The serial line of a board in QEMU, as QEMU's own input and output.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use pkm_protocol::{Command, MAX_COMMAND, Request, crc32, opened};

use crate::Outcome;

/// A command.
pub const HELLO: &str = r#"{"v":2,"id":0,"cmd":"hello"}"#;

/// How long a reply may take: a sweep takes seconds, and a board that is lost would be waited for without end.
const REPLY_WAIT: Duration = Duration::from_secs(120);

/// A board of QEMU at the other end of its own input and output.
pub struct Line {
    child: Child,
    replies: Receiver<String>,
}

impl Drop for Line {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Line {
    pub fn start(board: &str, elf: &Path, options: &[String]) -> Result<Self, String> {
        let mut child = std::process::Command::new("qemu-system-arm")
            .args(["-M", board, "-nographic", "-monitor", "none", "-serial", "stdio"])
            .args(["-icount", "shift=4,sleep=off"])
            .args(options)
            .arg("-kernel")
            .arg(elf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| format!("qemu-system-arm: {e}"))?;
        let output = BufReader::new(child.stdout.take().ok_or("QEMU has no output")?);
        let (heard, replies) = channel();
        // ends with QEMU, or when nobody listens any more
        std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| heard.send(line)));
        Ok(Self { child, replies })
    }

    pub fn write(&mut self, bytes: &[u8]) -> Outcome {
        let input = self.child.stdin.as_mut().ok_or("QEMU has no input")?;
        input.write_all(bytes).and_then(|()| input.flush()).map_err(|e| e.to_string())
    }

    pub fn send(&mut self, json: &str, crc: u32) -> Outcome {
        self.write(format!("{json}*{crc:08x}\n").as_bytes())
    }

    pub fn receive(&mut self) -> Result<String, String> {
        let waited = || format!("no reply within {} s, or QEMU has ended", REPLY_WAIT.as_secs());
        let line = self.replies.recv_timeout(REPLY_WAIT).map_err(|_| waited())? + "\n";
        if opened(line.as_bytes()).is_some() { Ok(line) } else { Err(format!("a damaged reply: {line}")) }
    }

    /// Sends a command as the protocol writes it, and gives its reply.
    pub fn request(&mut self, command: Command) -> Result<String, String> {
        self.send_all(&[command])?;
        self.receive()
    }

    /// Sends commands, one behind the other.
    pub fn send_all(&mut self, commands: &[Command]) -> Outcome {
        let mut lines = Vec::new();
        for command in commands {
            let mut buffer = [0; MAX_COMMAND + 1];
            let request = Request { id: 7, command: *command };
            lines.extend_from_slice(request.write(&mut buffer).ok_or("a command that does not fit")?);
        }
        self.write(&lines)
    }

    /// Says hello to a board that has just begun, when its serial line is on: what comes before is lost.
    pub fn greet(&mut self) -> Outcome {
        std::thread::sleep(Duration::from_secs(1));
        self.write(b"\n")?;
        self.ask("hello", HELLO, r#""hello""#).map(drop)
    }

    /// Sends a command and gives its reply, which has to have something in it.
    pub fn ask(&mut self, what: &str, json: &str, expected: &str) -> Result<String, String> {
        self.asks(what, json.to_owned(), crc32(json.as_bytes()), expected)
    }

    pub fn asks(&mut self, what: &str, json: String, crc: u32, expected: &str) -> Result<String, String> {
        self.send(&json, crc)?;
        self.hears(what, expected)
    }

    pub fn hears(&mut self, what: &str, expected: &str) -> Result<String, String> {
        let reply = self.receive()?;
        if reply.contains(expected) { Ok(reply) } else { Err(format!("{what}: {reply}expected {expected}")) }
    }
}

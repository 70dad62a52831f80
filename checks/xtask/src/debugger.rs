//! QEMU's side for a debugger (the GDB remote protocol): memory and registers of a board, without anything in its firmware.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::Outcome;

/// Number of the register xPSR.
pub const STATUS: u32 = 25;
/// Number of the register PC.
pub const PROGRAM_COUNTER: u32 = 15;

/// Options of QEMU for [`Debugger::connect`].
pub fn options(socket: &Path) -> Vec<String> {
    let chardev = format!("socket,path={},server=on,wait=off,id=debugger", socket.display());
    ["-chardev", &chardev, "-gdb", "chardev:debugger"].map(str::to_owned).into()
}

/// A debugger of a board that QEMU has started with [`options`].
pub struct Debugger {
    stream: UnixStream,
    unread: Vec<u8>,
}

impl Debugger {
    /// Connects and stops the processor.
    pub fn connect(socket: &PathBuf) -> Result<Self, String> {
        for _ in 0..500 {
            if let Ok(stream) = UnixStream::connect(socket) {
                stream.set_read_timeout(Some(Duration::from_secs(20))).map_err(|e| e.to_string())?;
                let mut debugger = Self { stream, unread: Vec::new() };
                // connecting stops the processor; QEMU reads single registers only after it was asked for its description of the target
                debugger.ask("qXfer:features:read:target.xml:0,10")?;
                return Ok(debugger);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Err("QEMU has no debugger's socket".into())
    }

    fn write(&mut self, bytes: &[u8]) -> Outcome {
        self.stream.write_all(bytes).map_err(|e| format!("QEMU's debugger: {e}"))
    }

    fn send(&mut self, packet: &str) -> Outcome {
        let sum = packet.bytes().fold(0_u8, u8::wrapping_add);
        self.write(format!("${packet}#{sum:02x}").as_bytes())
    }

    /// The next packet that comes.
    fn receive(&mut self) -> Result<String, String> {
        let mut buffer = [0; 4096];
        loop {
            let begin = self.unread.iter().position(|byte| *byte == b'$');
            let end = self.unread.iter().position(|byte| *byte == b'#');
            if let (Some(begin), Some(end)) = (begin, end)
                && self.unread.len() >= end + 3
            {
                let packet = String::from_utf8_lossy(&self.unread[begin + 1..end]).into_owned();
                self.unread.drain(..end + 3);
                self.write(b"+")?;
                return Ok(packet);
            }
            match self.stream.read(&mut buffer) {
                Ok(count) if count > 0 => self.unread.extend(&buffer[..count]),
                other => return Err(format!("QEMU's debugger says nothing: {other:?}")),
            }
        }
    }

    fn ask(&mut self, packet: &str) -> Result<String, String> {
        self.send(packet)?;
        loop {
            let answer = self.receive()?;
            // tells that the processor has stopped
            if !answer.starts_with('T') {
                return Ok(answer);
            }
        }
    }

    fn order(&mut self, packet: &str) -> Outcome {
        match self.ask(packet)?.as_str() {
            "OK" => Ok(()),
            other => Err(format!("QEMU's debugger answers {packet} with {other}")),
        }
    }

    /// Lets the processor go on for some time of this computer, and stops it again.
    pub fn run_for(&mut self, time: Duration) -> Outcome {
        self.go()?;
        std::thread::sleep(time);
        self.stop()
    }

    /// Stops the processor.
    pub fn stop(&mut self) -> Outcome {
        self.write(&[3])?;
        self.receive().map(drop)
    }

    /// Lets the processor go on.
    pub fn go(&mut self) -> Outcome {
        self.send("c")
    }

    /// Starts a stopped board anew; its flash is as it was built again, and it stays stopped.
    pub fn reset(&mut self) -> Outcome {
        let command: String = "system_reset".bytes().map(|byte| format!("{byte:02x}")).collect();
        self.send(&format!("qRcmd,{command}"))?;
        while self.receive()? != "OK" {}
        Ok(())
    }

    pub fn read(&mut self, address: u32, length: usize) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        while bytes.len() < length {
            let (from, count) = (address + bytes.len() as u32, (length - bytes.len()).min(1024));
            let digits = self.ask(&format!("m{from:x},{count:x}"))?;
            for pair in digits.as_bytes().chunks(2) {
                let byte = std::str::from_utf8(pair).ok().and_then(|pair| u8::from_str_radix(pair, 16).ok());
                bytes.push(byte.ok_or_else(|| format!("no memory at {from:#x}: {digits}"))?);
            }
        }
        Ok(bytes)
    }

    pub fn word(&mut self, address: u32) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.read(address, 4)?.try_into().map_err(|_| "no word")?))
    }

    pub fn put(&mut self, address: u32, bytes: &[u8]) -> Outcome {
        let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        self.order(&format!("M{address:x},{:x}:{digits}", bytes.len()))
    }

    pub fn register(&mut self, number: u32) -> Result<u32, String> {
        let digits = self.ask(&format!("p{number:x}"))?;
        let value = u32::from_str_radix(&digits, 16).map_err(|e| format!("register {number}: {digits}: {e}"))?;
        Ok(value.swap_bytes())
    }

    pub fn set_register(&mut self, number: u32, value: u32) -> Outcome {
        self.order(&format!("P{number:x}={:08x}", value.swap_bytes()))
    }
}

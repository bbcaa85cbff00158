//! Client of QEMU's debugger port (gdb remote protocol), for simulating registers that QEMU lacks:
//! watchpoints, core registers, memory.

use anyhow::{Context, Result, bail, ensure};
use std::io::{Read, Write};
use std::process::{Child, ChildStdin};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Timeout of an answer.
const ANSWER: Duration = Duration::from_secs(10);

/// Why the core has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// Before an access to this watched word.
    Access(u32),
    /// The debugger asked the core to stop.
    Asked,
}

/// The debugger's connection.
pub(super) struct Debugger {
    to: ChildStdin,
    from: Receiver<u8>,
}

impl Debugger {
    /// A connection over the standard input and output of `qemu … -gdb stdio`.
    pub(super) fn over(qemu: &mut Child) -> Result<Self> {
        let to = qemu.stdin.take().context("QEMU has no input")?;
        let mut from = qemu.stdout.take().context("QEMU has no output")?;
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 512];
            while let Ok(count @ 1..) = from.read(&mut buffer) {
                for byte in buffer.iter().take(count) {
                    if sender.send(*byte).is_err() {
                        return;
                    }
                }
            }
        });
        let mut debugger = Self { to, from: receiver };
        // QEMU provides single registers only after the target description was requested.
        debugger.ask("qXfer:features:read:target.xml:0,800")?;
        Ok(debugger)
    }

    fn send(&mut self, text: &str) -> Result<()> {
        let sum = text.bytes().fold(0_u8, u8::wrapping_add);
        write!(self.to, "${text}#{sum:02x}")?;
        Ok(self.to.flush()?)
    }

    /// The next packet's text; `None` after a timeout of `patience`.
    fn packet(&mut self, patience: Duration) -> Result<Option<String>> {
        let mut text = String::new();
        // Acknowledgements are skipped.
        loop {
            match self.from.recv_timeout(patience) {
                Ok(b'$') => break,
                Ok(_) => {}
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => return Ok(None),
                Err(_) => bail!("QEMU has ended"),
            }
        }
        loop {
            match self.from.recv_timeout(ANSWER)? {
                b'#' => break,
                byte => text.push(char::from(byte)),
            }
        }
        for _ in 0..2 {
            self.from.recv_timeout(ANSWER)?;
        }
        self.to.write_all(b"+")?;
        self.to.flush()?;
        Ok(Some(text))
    }

    fn ask(&mut self, text: &str) -> Result<String> {
        self.send(text)?;
        self.packet(ANSWER)?
            .with_context(|| format!("the debugger does not answer `{text}`"))
    }

    /// Stops the core before every access to the word at `address`.
    pub(super) fn watch(&mut self, address: u32) -> Result<()> {
        let answer = self.ask(&format!("Z4,{address:x},4"))?;
        ensure!(answer == "OK", "no watchpoint at {address:#x}: {answer}");
        Ok(())
    }

    /// Executes the access at which the core was stopped.
    pub(super) fn step_over(&mut self, address: u32) -> Result<()> {
        let answer = self.ask(&format!("z4,{address:x},4"))?;
        ensure!(answer == "OK", "the watchpoint at {address:#x} stays");
        let stop = self.ask("s")?;
        ensure!(stop.starts_with('T'), "the step ends with `{stop}`");
        self.watch(address)
    }

    /// Resumes the core.
    pub(super) fn resume(&mut self) -> Result<()> {
        self.send("c")
    }

    /// Waits for the core to stop; `None` if it still runs.
    pub(super) fn stopped(&mut self, patience: Duration) -> Result<Option<Stop>> {
        let Some(text) = self.packet(patience)? else {
            return Ok(None);
        };
        let access = text.split(';').find_map(|part| {
            let address = part.split_once("watch:")?.1;
            u32::from_str_radix(address, 16).ok()
        });
        match access {
            Some(address) => Ok(Some(Stop::Access(address))),
            None if text.starts_with('T') || text.starts_with('S') => Ok(Some(Stop::Asked)),
            None => bail!("the debugger says `{text}`"),
        }
    }

    /// Requests the core to stop.
    pub(super) fn interrupt(&mut self) -> Result<()> {
        self.to.write_all(&[3])?;
        Ok(self.to.flush()?)
    }

    /// A core register, 0 to 15.
    pub(super) fn register(&mut self, number: u8) -> Result<u32> {
        let text = self.ask(&format!("p{number:x}"))?;
        let bytes = bytes(&text)?;
        word(&bytes).with_context(|| format!("register {number} is `{text}`"))
    }

    /// Sets a core register.
    pub(super) fn set_register(&mut self, number: u8, value: u32) -> Result<()> {
        let [a, b, c, d] = value.to_le_bytes();
        let answer = self.ask(&format!("P{number:x}={a:02x}{b:02x}{c:02x}{d:02x}"))?;
        ensure!(answer == "OK", "register {number} cannot be set: {answer}");
        Ok(())
    }

    /// Reads memory from `address` on.
    pub(super) fn memory(&mut self, address: u32, length: usize) -> Result<Vec<u8>> {
        let text = self.ask(&format!("m{address:x},{length:x}"))?;
        let read = bytes(&text)?;
        ensure!(read.len() == length, "no memory at {address:#x}: `{text}`");
        Ok(read)
    }
}

fn bytes(text: &str) -> Result<Vec<u8>> {
    let digits: Option<Vec<u32>> = text.chars().map(|c| c.to_digit(16)).collect();
    let digits = digits.with_context(|| format!("`{text}` is not hexadecimal"))?;
    Ok(digits
        .chunks_exact(2)
        .map(|pair| pair.iter().fold(0, |byte, digit| byte << 4 | *digit as u8))
        .collect())
}

/// The first four bytes, little-endian.
pub(super) fn word(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.first_chunk()?))
}

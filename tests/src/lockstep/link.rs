//! The host's end of the serial line in lockstep runs: requests with retries, and deliberately lost bytes.

use anyhow::{Context, Result, bail};
use firmware::link::lockstep::DAMAGED;
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver as Channel, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use wire::frame::{Frame, Receiver};

/// Number of attempts per request.
const ATTEMPTS: u32 = 5;

/// The host's end of the serial line.
pub struct Link {
    process: Option<Child>,
    to: Box<dyn Write>,
    from: Channel<u8>,
    receiver: Receiver,
    number: u16,
    /// Drop one byte in this many, to test error detection; 0 for none.
    lose: usize,
    sent: usize,
    /// Number of dropped bytes.
    pub lost: usize,
    /// Number of repeated requests.
    pub repeated: usize,
}

impl Link {
    /// A program under QEMU: `command` starts it with its serial line on standard
    /// input and output.
    ///
    /// # Errors
    /// QEMU cannot be started.
    pub fn qemu(command: &[String], lose: usize) -> Result<Self> {
        let (program, arguments) = command.split_first().context("no command for QEMU")?;
        let mut process = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("could not start {program}; run `cargo xtask setup`"))?;
        let to = process.stdin.take().context("QEMU has no input")?;
        let from = process.stdout.take().context("QEMU has no output")?;
        Ok(Self::over(Some(process), Box::new(to), from, lose))
    }

    /// A board at a serial `device`.
    ///
    /// # Errors
    /// The device cannot be opened.
    pub fn serial(device: &str, lose: usize) -> Result<Self> {
        // The line has 115 200 baud and is raw, as the boards set up their UART.
        let set = Command::new("stty")
            .args(["-F", device, "115200", "raw", "-echo"])
            .status()
            .context("could not start stty")?;
        if !set.success() {
            bail!("stty cannot set up {device}");
        }
        let open = || {
            std::fs::OpenOptions::new()
                .read(true)
                .write(true)
                .open(device)
                .with_context(|| format!("could not open {device}"))
        };
        Ok(Self::over(None, Box::new(open()?), open()?, lose))
    }

    fn over(
        process: Option<Child>,
        to: Box<dyn Write>,
        mut from: impl Read + Send + 'static,
        lose: usize,
    ) -> Self {
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
        Self {
            process,
            to,
            from: receiver,
            receiver: Receiver::new(),
            number: 0,
            lose,
            sent: 0,
            lost: 0,
            repeated: 0,
        }
    }

    /// Repeats a request until its reply arrives.
    ///
    /// # Errors
    /// A board that does not answer.
    pub fn ask(&mut self, kind: u8, content: &[u8]) -> Result<Vec<u8>> {
        self.number = self.number.wrapping_add(1);
        let [low, high] = self.number.to_le_bytes();
        let request: Vec<u8> = [kind, low, high].iter().chain(content).copied().collect();
        let frame = Frame::new(&request);
        for attempt in 0..ATTEMPTS {
            self.repeated += usize::from(attempt > 0);
            let mut bytes = Vec::with_capacity(frame.bytes().len() + 1);
            // A leading zero terminates any truncated frame.
            for byte in std::iter::once(&0).chain(frame.bytes()) {
                self.sent += 1;
                if self.lose > 0 && self.sent.is_multiple_of(self.lose) {
                    self.lost += 1;
                } else {
                    bytes.push(*byte);
                }
            }
            self.to.write_all(&bytes).context("the board hung up")?;
            self.to.flush()?;
            let until = Instant::now() + Duration::from_secs(2);
            while let Some(reply) = self.reply(until)? {
                match reply.split_first_chunk::<3>() {
                    Some(([DAMAGED, ..], _)) => break,
                    Some((head, rest)) if *head == [kind, low, high] => return Ok(rest.to_vec()),
                    // This is a reply to an earlier attempt.
                    _ => {}
                }
            }
        }
        bail!("no reply after {ATTEMPTS} requests; is the right firmware running?");
    }

    /// The next valid frame; `None` after the timeout.
    fn reply(&mut self, until: Instant) -> Result<Option<Vec<u8>>> {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.from.recv_timeout(left) {
                // A damaged reply is ignored: the request is repeated.
                Ok(byte) => {
                    if let Some(Ok(content)) = self.receiver.receive(byte) {
                        return Ok(Some(content.to_vec()));
                    }
                }
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Err(RecvTimeoutError::Disconnected) => bail!("the board hung up"),
            }
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        if let Some(process) = &mut self.process {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

//! A serial line: a device, or any pair of byte streams.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use crate::error::LineError;

/// The host's end of a serial line.
pub struct Port {
    to: Box<dyn Write + Send>,
    from: Receiver<Vec<u8>>,
    /// Lock against other hosts while the line is open.
    _lock: Option<File>,
    bad: Option<Bad>,
    reads: Arc<AtomicBool>,
}

/// A line with lost and changed bytes, for tests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bad {
    /// Fraction of bytes lost or changed, in millionths, in both directions.
    pub millionths: u32,
    /// State of the random generator.
    pub seed: u64,
}

impl Bad {
    /// The byte after transmission; `None` if it is lost.
    fn pass(&mut self, byte: u8) -> Option<u8> {
        // SplitMix64.
        self.seed = self.seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        if z % 1_000_000 >= u64::from(self.millionths) {
            return Some(byte);
        }
        let mask = (z >> 32) as u8;
        (mask > 0x40).then_some(byte ^ mask)
    }
}

impl Port {
    /// A device at 115 200 baud, 8N1, as the boards set their UART up.
    ///
    /// # Errors
    /// [`LineError`] if it cannot be opened or another host uses it.
    pub fn serial(device: &Path) -> Result<Self, LineError> {
        let failed = |cause| LineError::Open {
            port: device.display().to_string(),
            cause,
        };
        let open = || OpenOptions::new().read(true).write(true).open(device);
        let lock = open().map_err(failed)?;
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(LineError::InUse(device.display().to_string()));
            }
            // A device without locks is used unlocked.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let set = Command::new("stty")
            .arg("-F")
            .arg(device)
            .args(["115200", "raw", "-echo"])
            .output()
            .map_err(failed)?;
        if !set.status.success() {
            let said = String::from_utf8_lossy(&set.stderr).trim().to_owned();
            return Err(failed(std::io::Error::other(said)));
        }
        let to = open().map_err(failed)?;
        let from = open().map_err(failed)?;
        Ok(Self {
            _lock: Some(lock),
            ..Self::over(to, from)
        })
    }

    /// A line over any two streams.
    #[must_use]
    pub fn over(to: impl Write + Send + 'static, mut from: impl Read + Send + 'static) -> Self {
        let (sender, receiver) = channel();
        let reads = Arc::new(AtomicBool::new(true));
        let may_read = reads.clone();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(count @ 1..) = from.read(&mut buffer) {
                while !may_read.load(Ordering::Relaxed) {
                    std::thread::sleep(Duration::from_millis(1));
                }
                let bytes = buffer.iter().copied().take(count).collect();
                if sender.send(bytes).is_err() {
                    return;
                }
            }
        });
        Self {
            to: Box::new(to),
            from: receiver,
            _lock: None,
            bad: None,
            reads,
        }
    }

    /// The line with transmission errors.
    #[must_use]
    pub fn with_faults(self, bad: Bad) -> Self {
        Self {
            bad: Some(bad),
            ..self
        }
    }

    /// Whether this end reads. Without reading the line fills up, which tests the board.
    pub fn reads(&self, reads: bool) {
        self.reads.store(reads, Ordering::Relaxed);
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// [`LineError::Gone`].
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), LineError> {
        let bytes = self.pass(bytes.to_vec());
        self.to
            .write_all(&bytes)
            .and_then(|()| self.to.flush())
            .map_err(|cause| LineError::Gone(cause.to_string()))
    }

    /// Bytes received within `patience`; empty if none.
    ///
    /// # Errors
    /// [`LineError::Gone`].
    pub fn receive(&mut self, patience: Duration) -> Result<Vec<u8>, LineError> {
        match self.from.recv_timeout(patience) {
            Ok(bytes) => Ok(self.pass(bytes)),
            Err(RecvTimeoutError::Timeout) => Ok(Vec::new()),
            Err(RecvTimeoutError::Disconnected) => {
                Err(LineError::Gone("nothing comes any more".into()))
            }
        }
    }

    fn pass(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        match &mut self.bad {
            None => bytes,
            Some(bad) => bytes.into_iter().filter_map(|b| bad.pass(b)).collect(),
        }
    }
}

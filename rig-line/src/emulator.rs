//! A board under QEMU with a simulated rig, so that the whole workflow runs without hardware.
//!
//! The first serial line of QEMU connects the board to the host. The second carries the readings and the state of
//! the valve (`qemu-rig` of the firmware). The rig is the sample clock. It samples as fast as the board and the
//! host permit, but it is never further ahead of the host than a real board would be, unless the host has stopped.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex};

use wire::reply::lost_after_samples;

use crate::error::LineError;
use crate::port::Port;

/// Samples that the rig may run ahead of its host: well below the number after which a board drops its host.
fn ahead(period_us: u32) -> u64 {
    u64::from(lost_after_samples(period_us) * 3 / 10)
}

/// A simulated rig: sensor and valve.
pub trait Rig: Send {
    /// Holds the valve for a sample period, then returns the counts of sensor and channel, 12 bits each.
    fn sample(&mut self, open: bool) -> [u16; 2];
}

/// Synchronisation of host and rig.
#[derive(Clone, Debug, Default)]
pub struct Pace(Arc<(Mutex<Ahead>, Condvar)>);

#[derive(Clone, Copy, Debug, Default)]
struct Ahead {
    /// Samples until the host must respond.
    left: u64,
    /// Number of active hosts.
    hosts: u32,
    /// Samples so far.
    samples: u64,
}

/// Registration of an active host: the simulated time waits for it.
#[derive(Debug)]
pub struct Presence(Pace);

impl Pace {
    /// Registers a host.
    #[must_use]
    pub fn enter(&self) -> Presence {
        self.change(|ahead| ahead.hosts += 1);
        Presence(self.clone())
    }

    fn change(&self, change: impl FnOnce(&mut Ahead)) {
        let (ahead, changed) = &*self.0;
        if let Ok(mut ahead) = ahead.lock() {
            change(&mut ahead);
            changed.notify_one();
        }
    }

    /// Waits until the host permits another sample.
    pub fn wait(&self) {
        let (ahead, changed) = &*self.0;
        let Ok(ahead) = ahead.lock() else { return };
        if let Ok(mut ahead) = changed.wait_while(ahead, |a| a.hosts > 0 && a.left == 0) {
            ahead.left = ahead.left.saturating_sub(1);
            ahead.samples += 1;
        }
    }
}

impl Presence {
    /// Records activity of the host of a board that samples every `period_us`.
    pub fn touch(&self, period_us: u32) {
        self.0.change(|now| now.left = ahead(period_us));
    }

    /// Samples that the board has taken.
    pub(crate) fn samples(&self) -> u64 {
        self.0.0.0.lock().map_or(u64::MAX, |ahead| ahead.samples)
    }
}

impl Drop for Presence {
    fn drop(&mut self) {
        self.0.change(|ahead| ahead.hosts -= 1);
    }
}

/// A board under QEMU with its rig.
pub struct Emulator {
    process: Child,
    /// Synchronisation of host and rig.
    pub pace: Pace,
    reset: Arc<AtomicBool>,
    samples: Arc<AtomicU64>,
    open: Arc<AtomicBool>,
    lines: Option<Port>,
}

impl Emulator {
    /// Starts `elf` with `rig` behind it.
    ///
    /// # Errors
    /// [`LineError`] when QEMU cannot be started.
    pub fn start(elf: &Path, mut rig: Box<dyn Rig>) -> Result<Self, LineError> {
        let failed = |cause| LineError::Open {
            port: format!("qemu-system-arm with {}", elf.display()),
            cause,
        };
        if !elf.is_file() {
            return Err(failed(std::io::Error::other(
                "there is no such program; `cargo xtask firmware --board qemu-rig` builds it, and `cargo xtask \
                 setup` installs the requirements",
            )));
        }
        let listener = TcpListener::bind("127.0.0.1:0").map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let mut process = Command::new("qemu-system-arm")
            .args(["-machine", "mps2-an386", "-cpu", "cortex-m4"])
            .args(["-icount", "shift=5,sleep=off"])
            .args(["-display", "none", "-monitor", "none", "-serial", "stdio"])
            .arg("-serial")
            .arg(format!("tcp:{address},nodelay=on"))
            .arg("-kernel")
            .arg(elf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(failed)?;
        let ends = process.stdin.take().zip(process.stdout.take());
        let Some((to, from)) = ends else {
            return Err(failed(std::io::Error::other("QEMU has no serial line")));
        };
        let (pace, reset) = (Pace::default(), Arc::<AtomicBool>::default());
        let (samples, open) = (Arc::<AtomicU64>::default(), Arc::<AtomicBool>::default());
        let behind = Behind {
            pace: pace.clone(),
            reset: reset.clone(),
            samples: samples.clone(),
            open: open.clone(),
        };
        std::thread::spawn(move || {
            if let Ok((line, _)) = listener.accept() {
                let _ = line.set_nodelay(true);
                // QEMU ends when the serial line closes.
                let _ = behind.run(&line, &mut *rig);
            }
        });
        Ok(Self {
            process,
            pace,
            reset,
            samples,
            open,
            lines: Some(Port::over(to, from)),
        })
    }

    /// Takes the serial line.
    pub fn port(&mut self) -> Option<Port> {
        self.lines.take()
    }

    /// Returns the serial line for another host.
    pub fn put_back(&mut self, port: Port) {
        self.lines = Some(port);
    }

    /// Presses the board's reset button.
    pub fn press_reset(&self) {
        self.reset.store(true, Ordering::Relaxed);
    }

    /// Samples of the rig so far.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Whether the rig's valve is open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.open.load(Ordering::Relaxed)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The rig's end of the second serial line.
struct Behind {
    pace: Pace,
    reset: Arc<AtomicBool>,
    samples: Arc<AtomicU64>,
    open: Arc<AtomicBool>,
}

impl Behind {
    fn run(&self, mut line: impl Read + Write + Copy, rig: &mut dyn Rig) -> std::io::Result<()> {
        let mut valve = [0];
        loop {
            line.read_exact(&mut valve)?;
            let open = valve[0] != 0;
            self.open.store(open, Ordering::Relaxed);
            self.pace.wait();
            let [counts, channel] = rig.sample(open).map(|counts| counts.min(0xFFF));
            self.samples.fetch_add(1, Ordering::Relaxed);
            let button = u8::from(self.reset.swap(false, Ordering::Relaxed));
            let [c0, c1] = counts.to_le_bytes();
            let [d0, d1] = channel.to_le_bytes();
            line.write_all(&[button, c0, c1 | (d0 << 4), (d0 >> 4) | (d1 << 4)])?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rig_waits_for_its_host_before_the_board_gives_it_up() {
        assert_eq!([200, 1000, 10_000, 100_000].map(ahead), [750, 150, 15, 3]);
    }
}

//! A board at a serial port, or one under QEMU with a simulated rig behind it.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};

use crate::commands::threads;
use anyhow::Context;
use firmware_sim::hidden_set::HiddenSetPlan;
use firmware_sim::instrument::{Converter, Noise, NoiseSignal};
use firmware_sim::plant::{FreeStream, Rig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rig_line::emulator::{self, Emulator, Pace};
use rig_line::{Host, LineError, Port};

/// Which board.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct PortArgs {
    /// Serial port of the board, or `qemu`: a board under QEMU with a simulated rig. If the board's period is
    /// longer than 1 ms, the rig is slower by the same factor.
    #[arg(long, value_name = "PATH|qemu")]
    port: PathBuf,
    /// With `--port qemu`: the board's program, as `cargo xtask firmware --board qemu-rig` builds it.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// With `--port qemu`: an effect of the simulated rig; repeatable.
    #[arg(long, value_name = "EFFECT")]
    rig_effect: Vec<String>,
    /// Seed of the simulated rig, for `--port qemu`.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    rig_seed: u64,
    /// Seed of the noise, for `--port qemu`.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    noise_seed: u64,
}

/// A board on the line; dropping it ends the emulator.
pub(crate) struct Connected {
    /// The host's end.
    pub(crate) host: Host,
    port: PathBuf,
    _emulator: Option<Emulator>,
}

impl PortArgs {
    /// Opens the port, or starts the board.
    pub(crate) fn connect(&self) -> anyhow::Result<Connected> {
        threads::needed("the line to a board")?;
        if self.port != Path::new("qemu") {
            return Ok(Connected {
                host: open(&self.port, None)?,
                port: self.port.clone(),
                _emulator: None,
            });
        }
        let elf = self.firmware.clone().unwrap_or_else(|| {
            let target =
                std::env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
            target.join("firmware/thumbv7em-none-eabihf/release/qemu-rig")
        });
        let rig = Simulated::new(&self.rig_effect, self.rig_seed, self.noise_seed)
            .context("no simulated rig")?;
        let mut emulator = Emulator::start(&elf, Box::new(rig))?;
        let port = emulator.port().context("QEMU has no serial line")?;
        Ok(Connected {
            host: Host::new(port, session(), Some(emulator.pace.clone())),
            port: self.port.clone(),
            _emulator: Some(emulator),
        })
    }
}

impl Connected {
    /// The host, and the data to reconnect to the board after the line broke.
    pub(crate) fn ends(&mut self) -> (&mut Host, impl FnMut() -> Result<Host, LineError> + use<>) {
        let port = self.port.clone();
        (&mut self.host, move || open(&port, None))
    }
}

fn open(device: &Path, pace: Option<Pace>) -> Result<Host, LineError> {
    Ok(Host::new(Port::serial(device)?, session(), pace))
}

/// A random number for this host; 0 means no host.
fn session() -> u32 {
    // The standard library seeds its hash keys at random.
    (RandomState::new().build_hasher().finish() as u32).max(1)
}

/// A simulated rig as the board's converter sees it: y from −1 to 3 over the
/// range of the sensor's input, the free stream from 0 to 20 m/s over the channel's.
///
/// One millisecond of the simulator is one sample of the board: for a board at 10 ms the rig is ten times slower.
struct Simulated {
    rig: Rig,
    noise: NoiseSignal,
    stream: FreeStream,
    converter: Converter,
    channel: Converter,
}

impl Simulated {
    fn new(effects: &[String], seed: u64, noise_seed: u64) -> anyhow::Result<Self> {
        let names: Vec<&str> = effects.iter().map(String::as_str).collect();
        let plan = HiddenSetPlan::draw(&names, &[], seed)?;
        // The record is as long as a day, so its mean does not depend on the length of the observation.
        let stream = FreeStream::draw(&mut ChaCha8Rng::seed_from_u64(seed), 1_000_000);
        let wanders = plan.plant.effects.iter().any(|e| e.channel().is_some());
        let mut rng = ChaCha8Rng::seed_from_u64(noise_seed);
        rng.set_stream(seed);
        Ok(Self {
            rig: Rig::new(&plan.plant, wanders.then(|| stream.clone()))?,
            noise: NoiseSignal::new(Noise::HOT_FILM, rng),
            stream,
            converter: Converter::TWELVE_BIT,
            channel: Converter {
                bits: 12,
                low: 0.0,
                high: 20.0,
            },
        })
    }
}

impl emulator::Rig for Simulated {
    fn sample(&mut self, open: bool) -> [u16; 2] {
        self.rig.command(f64::from(u8::from(open)));
        self.rig.advance_sample();
        let y = self.rig.read() + self.noise.sample();
        let u_inf = self.stream.velocity(self.rig.time());
        [self.converter.code(y), self.channel.code(u_inf)].map(|code| code as u16)
    }
}

//! The firmware's own desk, controller and law in a thread, with a simple rig.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU16, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use firmware::controller::Reading;
use firmware::link::desk::Desk;
use firmware::on_board;
use identified::on_board as model;
use model_core::{Input, step};
use rig_line::emulator::Pace;
use rig_line::{Bad, Host, LineError, Port};
use wire::Outbox;

/// How long the board's line waits for a host that does not read.
const PATIENCE: Duration = Duration::from_secs(5);

/// Interventions on the running board.
#[derive(Clone, Default)]
pub(crate) struct Hands {
    /// Pulled for good.
    pub(crate) plug: Arc<AtomicBool>,
    pub(crate) reset: Arc<AtomicBool>,
    /// Samples so far.
    pub(crate) samples: Arc<AtomicU64>,
    /// Samples with an open valve so far.
    pub(crate) open: Arc<AtomicU64>,
    pub(crate) is_open: Arc<AtomicBool>,
    /// A reading instead of the sensor's, if it is not 0.
    pub(crate) reading: Arc<AtomicU16>,
    /// Air shut off by hand.
    pub(crate) no_air: Arc<AtomicBool>,
    pub(crate) pace: Pace,
    /// Whether the flow is that of the board's model.
    pub(crate) as_modelled: Arc<AtomicBool>,
    /// Added to the reading, counts.
    pub(crate) shift: Arc<AtomicU16>,
}

/// A board, and its line.
pub(crate) fn board() -> (Hands, UnixStream) {
    let (ours, theirs) = UnixStream::pair().expect("a pair");
    let hands = Hands::default();
    let board = hands.clone();
    std::thread::spawn(move || run(&board, theirs));
    (hands, ours)
}

/// A host on that line.
pub(crate) fn host(line: &UnixStream, hands: &Hands, bad: Option<Bad>, session: u32) -> Host {
    let end = || line.try_clone().expect("an end");
    let port = Port::over(end(), end());
    let port = match bad {
        Some(bad) => port.with_faults(bad),
        None => port,
    };
    Host::new(port, session, Some(hands.pace.clone()))
}

/// A line that cannot be reopened.
pub(crate) fn gone() -> Result<Host, LineError> {
    Err(LineError::Gone("pulled".into()))
}

/// The rig's sensor: 900 counts in natural flow, 1800 more under steady blowing, and noise of ±20. The channel
/// contains the sample's number, so that a shift is detected.
fn shown(k: u64, friction: f32) -> [u16; 2] {
    let noise = (k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) % 41;
    let counts = 880.0 + 1800.0 * friction + noise as f32;
    [counts as u16, (k % 4096) as u16]
}

/// A valve that opens and shuts in 6 samples, with its flow.
struct Valve {
    asked: bool,
    since: u32,
    open: bool,
}

impl Valve {
    fn follow(&mut self, asked: bool) -> bool {
        self.since = if asked == self.asked {
            self.since + 1
        } else {
            1
        };
        self.asked = asked;
        if self.since > 6 {
            self.open = asked;
        }
        self.open
    }
}

fn run(hands: &Hands, mut line: UnixStream) {
    line.set_nonblocking(true).expect("a line");
    let flow = model::model();
    let mut state = model::state(&flow);
    let mut friction = 0.0_f32;
    let mut valve = Valve {
        asked: false,
        since: 0,
        open: false,
    };
    let mut k = 0_u64;
    let mut told = Told::default();
    'start: loop {
        let mut controller = on_board::controller();
        let mut desk = Desk::new(on_board::BOARD);
        let mut outbox = Outbox::new();
        let mut tenths = 0;
        let mut open = false;
        loop {
            if hands.plug.load(Ordering::Relaxed) {
                return;
            }
            if hands.reset.swap(false, Ordering::Relaxed) {
                continue 'start;
            }
            hands.pace.wait();
            friction += (f32::from(u8::from(
                valve.follow(open) && !hands.no_air.load(Ordering::Relaxed),
            )) - friction)
                / 40.0;
            let [mut counts, channel] = if hands.as_modelled.load(Ordering::Relaxed) {
                let input = Input {
                    command: f32::from(u8::from(open)),
                    channels: &model::REFERENCES,
                };
                let y = step(&flow, &mut state, &input).measured;
                // The friction for which `shown` gives the board's counts: 800 counts for y = 0,
                // and 2000 more for y = 1.
                shown(
                    k,
                    (on_board::SETTINGS.calibration.counts(y) - 900.0) / 1800.0,
                )
            } else {
                shown(k, friction)
            };
            counts += hands.shift.load(Ordering::Relaxed);
            let reading = hands.reading.load(Ordering::Relaxed);
            if reading > 0 {
                counts = reading;
            }
            k += 1;
            desk.before(&mut controller, &mut outbox);
            let tick = controller.tick(Reading {
                counts: f32::from(counts),
                channel: f32::from(channel),
                periods: 1,
            });
            open = tick.open;
            hands.samples.store(k, Ordering::Relaxed);
            hands.is_open.store(open, Ordering::Relaxed);
            hands.open.fetch_add(u64::from(open), Ordering::Relaxed);
            desk.after(&tick, &mut controller, &mut outbox);
            let mut bytes = [0; 64];
            match line.read(&mut bytes) {
                Ok(0) => return,
                Ok(count) => {
                    for byte in bytes.iter().take(count) {
                        desk.receive(*byte, &mut controller, &mut outbox);
                    }
                }
                Err(_) => {}
            }
            // The line transmits 11.52 bytes in a sample. A host that does not read takes none.
            tenths = (tenths + 115).min(230);
            let mut out = Vec::new();
            while tenths >= 10 {
                let Some(byte) = outbox.pop() else { break };
                out.push(byte);
                tenths -= 10;
            }
            told.write(&mut line, &out);
        }
    }
}

/// The board's end of the line. A host that waits for a processor has not stopped reading. The line waits for
/// such a host, because a real line would not overflow in this time.
#[derive(Default)]
struct Told {
    /// Whether the host has stopped reading. Determined once, so that the board's time continues.
    in_vain: bool,
}

impl Told {
    fn write(&mut self, line: &mut UnixStream, mut bytes: &[u8]) {
        let asked = Instant::now();
        while !bytes.is_empty() {
            match line.write(bytes) {
                Ok(count) => {
                    bytes = &bytes[count..];
                    self.in_vain = false;
                }
                Err(error) if error.kind() != ErrorKind::WouldBlock => return,
                Err(_) if self.in_vain => return,
                Err(_) => {
                    self.in_vain = asked.elapsed() > PATIENCE;
                    std::thread::sleep(Duration::from_micros(200));
                }
            }
        }
    }
}

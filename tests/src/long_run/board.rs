//! The board without hardware: the loop with its pins, clock and line, and the simulated flow with its sensor.

use anyhow::Result;
use embedded_hal::digital::{ErrorType, OutputPin};
use firmware::controller::{Controller, Mode, Reading, Tick};
use firmware::link::desk::Desk;
use firmware::on_board::{self, OnBoard, SETTINGS};
use firmware::rig::{Clock, Rig, Sensor};
use firmware::start;
use host_fit::model::{Model, Prepared};
use host_fit::simulate::HostState;
use model_core::model::{Input, step};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use std::cell::Cell;
use std::convert::Infallible;
use std::rc::Rc;
use wire::Outbox;

/// Bytes that the line carries in a sample of 1 ms at 115 200 baud.
pub(super) const BYTES: usize = 11;
/// Samples from [`Board::near_wrap`] to the wrap.
const BEFORE_WRAP: u32 = 20_000;
/// Counts of the measured channel, which the bundled model does not use.
const CHANNEL: f32 = 2048.0;

struct Counts(Rc<Cell<f32>>);

impl Sensor for Counts {
    fn counts(&mut self) -> f32 {
        self.0.get()
    }
    fn channel(&mut self) -> f32 {
        CHANNEL
    }
}

struct Periods(Rc<Cell<u32>>);

impl Clock for Periods {
    fn periods(&self) -> u32 {
        self.0.get()
    }
}

struct Pin(Rc<Cell<bool>>);

impl ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }
}

/// A reading of the sensor in time.
pub(super) fn reading(counts: f32) -> Reading {
    Reading {
        counts,
        channel: CHANNEL,
        periods: 1,
    }
}

/// The loop as a board runs it.
pub(super) struct Board {
    rig: std::cell::RefCell<Rig<OnBoard, Counts, Periods, Pin, Pin>>,
    desk: Desk,
    outbox: Outbox,
    counts: Rc<Cell<f32>>,
    clock: Rc<Cell<u32>>,
    valve: Rc<Cell<bool>>,
}

impl Board {
    /// A board after a start, with its clock at `clock`.
    pub(super) fn new(clock: u32, by_watchdog: bool) -> Self {
        let (counts, clock) = (Rc::new(Cell::new(0.0)), Rc::new(Cell::new(clock)));
        let (valve, lamp) = (Rc::new(Cell::new(true)), Rc::new(Cell::new(true)));
        let mut controller = on_board::controller();
        start::latch(&mut controller, on_board::self_test(), by_watchdog);
        let rig = Rig::new(
            controller,
            Counts(counts.clone()),
            Periods(clock.clone()),
            Pin(valve.clone()),
            Pin(lamp),
        );
        Self {
            rig: rig.into(),
            desk: Desk::new(on_board::BOARD),
            outbox: Outbox::new(),
            counts,
            clock,
            valve,
        }
    }

    /// One sample, in the order of the boards' loops; the bytes arrive after it.
    pub(super) fn sample(&mut self, counts: f32, periods: u32, bytes: &[u8]) -> Tick {
        let rig = self.rig.get_mut();
        self.counts.set(counts);
        self.clock.set(self.clock.get().wrapping_add(periods));
        self.desk.before(rig.controller(), &mut self.outbox);
        let tick = rig.sample();
        self.desk.after(&tick, rig.controller(), &mut self.outbox);
        for _ in 0..BYTES {
            let _ = self.outbox.pop();
        }
        for byte in bytes {
            self.desk.receive(*byte, rig.controller(), &mut self.outbox);
        }
        tick
    }

    /// A board after a start and a gap of 49 days: its clock and its sample number wrap after [`BEFORE_WRAP`] samples.
    pub(super) fn near_wrap(by_watchdog: bool) -> Self {
        let mut board = Self::new(0, by_watchdog);
        // With the valve closed, a gap is no fault.
        board.sample(SETTINGS.calibration.zero, u32::MAX - BEFORE_WRAP, &[]);
        board
    }

    pub(super) fn is_open(&self) -> bool {
        self.valve.get()
    }

    pub(super) fn clock(&self) -> u32 {
        self.clock.get()
    }

    pub(super) fn mode(&self) -> Mode {
        self.rig.borrow_mut().controller().mode()
    }

    /// A copy of the loop.
    pub(super) fn controller(&self) -> Controller<OnBoard> {
        self.rig.borrow_mut().controller().clone()
    }

    /// Samples since the start, and whether the loop wants the valve open.
    pub(super) fn state(&self) -> (u64, bool) {
        let mut rig = self.rig.borrow_mut();
        (rig.controller().samples(), rig.controller().is_open())
    }
}

/// The model of the boards, as the host runs it.
const MODEL: &str = include_str!("../../../firmware/identified/models/full.toml");

/// The flow, which is the model in double precision: without a fault, the residual is noise.
pub(super) struct Plant {
    model: Prepared<f64>,
    state: HostState<f64>,
}

impl Plant {
    pub(super) fn new() -> Result<Self> {
        let model = Model::from_toml(MODEL, "full.toml")?;
        let memory = model.memory();
        let model = model.prepare::<f64>();
        Ok(Self {
            state: memory.at_rest(&model),
            model,
        })
    }

    /// Counts after a sample with the valve in this position.
    pub(super) fn reading(&mut self, open: bool, random: &mut ChaCha8Rng) -> f32 {
        let input = Input {
            command: f64::from(u8::from(open)),
            channels: &[],
        };
        let y = step(&self.model, &mut self.state, &input).measured;
        let noise = random.random_range(0..41_u16);
        SETTINGS.calibration.counts(y as f32).round() + f32::from(noise) - 20.0
    }
}

/// A fault of sensor or loop, with the samples that it still lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sickness {
    None,
    NotFinite(f32),
    Rail(f32),
    /// Equal readings.
    Stuck(f32, u32),
    /// Readings that are too high by this, counts.
    Off(f32, u32),
    /// Missed samples.
    Overrun(u32),
    Watchdog,
}

impl Sickness {
    pub(super) fn draw(random: &mut ChaCha8Rng) -> Self {
        let range = &SETTINGS.range;
        let long = |random: &mut ChaCha8Rng| random.random_range(1..2 * range.stuck_after);
        match random.random_range(0..20) {
            0 => Self::NotFinite(f32::NAN),
            1 => Self::NotFinite(f32::INFINITY),
            2 => Self::NotFinite(f32::NEG_INFINITY),
            3 => Self::NotFinite(f32::from_bits(0x7F80_0001)),
            4 | 5 => Self::Rail(range.lower_rail - random.random_range(0..9) as f32),
            6 => Self::Rail(range.upper_rail),
            7 => Self::Rail(f32::MAX),
            8 => Self::Rail(f32::MIN),
            9..=12 => Self::Stuck(random.random_range(500..3000) as f32, long(random)),
            13..=15 => Self::Off(random.random_range(-400..1200) as f32, long(random)),
            16 | 17 => Self::Overrun(2),
            18 => Self::Overrun(random.random_range(3..100_000)),
            _ => Self::Watchdog,
        }
    }

    /// Counts and periods of a sample, from the healthy reading.
    pub(super) fn apply(self, healthy: f32) -> (f32, u32) {
        match self {
            Self::None | Self::Watchdog => (healthy, 1),
            Self::NotFinite(counts) | Self::Rail(counts) | Self::Stuck(counts, _) => (counts, 1),
            Self::Off(by, _) => (healthy + by, 1),
            Self::Overrun(periods) => (healthy, periods),
        }
    }

    /// The state at the next sample.
    pub(super) fn after(self) -> Self {
        match self {
            Self::Stuck(counts, left @ 1..) => Self::Stuck(counts, left - 1),
            Self::Off(by, left @ 1..) => Self::Off(by, left - 1),
            _ => Self::None,
        }
    }
}

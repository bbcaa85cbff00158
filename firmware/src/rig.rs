//! The loop on a board: sensor in, valve out.

use crate::controller::{Controller, Mode, Reading, Tick};
use crate::law::Law;
use embedded_hal::digital::OutputPin;

/// A sensor with its sample clock.
pub trait Sensor {
    /// The newest reading in counts; not finite where there is none.
    fn counts(&mut self) -> f32;
}

/// The board's clock.
pub trait Clock {
    /// Sample periods since the start, wrapping.
    fn periods(&self) -> u32;
}

/// Controller, sensor and outputs.
pub struct Rig<L, S, C, V, A> {
    controller: Controller<L>,
    sensor: S,
    clock: C,
    /// Opens the valves when high.
    valve: V,
    /// Lit while armed.
    lamp: A,
    last: u32,
}

impl<L, S, C, V, A> Rig<L, S, C, V, A>
where
    L: Law,
    S: Sensor,
    C: Clock,
    V: OutputPin,
    A: OutputPin,
{
    /// Shuts the valves and waits for the operator.
    pub fn new(controller: Controller<L>, sensor: S, clock: C, mut valve: V, mut lamp: A) -> Self {
        // Pins of a microcontroller do not fail; others are tried again each sample.
        let _ = valve.set_low();
        let _ = lamp.set_low();
        let last = clock.periods();
        Self {
            controller,
            sensor,
            clock,
            valve,
            lamp,
            last,
        }
    }

    /// The controller, to arm or disarm.
    pub fn controller(&mut self) -> &mut Controller<L> {
        &mut self.controller
    }

    /// The sensor, to inject faults.
    pub fn sensor(&mut self) -> &mut S {
        &mut self.sensor
    }

    /// One sample; call it when the sample clock ticked.
    #[inline]
    pub fn sample(&mut self) -> Tick {
        let now = self.clock.periods();
        // The difference is right also where the count wraps.
        let periods = now.wrapping_sub(self.last).max(1);
        self.last = now;
        let counts = self.sensor.counts();
        let tick = self.controller.tick(Reading { counts, periods });
        let _ = if tick.open {
            self.valve.set_high()
        } else {
            self.valve.set_low()
        };
        let _ = if matches!(tick.mode, Mode::Armed) {
            self.lamp.set_high()
        } else {
            self.lamp.set_low()
        };
        tick
    }
}

//! The loop on a board: sensor in, valve out.

use crate::controller::{Controller, Mode, Reading, Tick};
use crate::law::Law;
use embedded_hal::digital::OutputPin;

/// A sensor with its sample clock.
pub trait Sensor {
    /// The newest reading in counts; not finite if there is no reading.
    fn counts(&mut self) -> f32;
    /// The newest reading of the measured channel in counts; not finite if there is no reading.
    fn channel(&mut self) -> f32;
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
    /// A lamp: on while law or command controls the valve.
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
    /// Closes the valves and waits for the operator.
    pub fn new(controller: Controller<L>, sensor: S, clock: C, mut valve: V, mut lamp: A) -> Self {
        // Pins of a microcontroller do not fail, and each pin is set again at the next sample.
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

    /// Processes one sample; called at every tick of the sample clock.
    #[inline]
    pub fn sample(&mut self) -> Tick {
        let now = self.clock.periods();
        // The difference is correct also when the count wraps.
        let periods = now.wrapping_sub(self.last).max(1);
        self.last = now;
        let counts = self.sensor.counts();
        let tick = self.controller.tick(Reading {
            counts,
            channel: self.sensor.channel(),
            periods,
        });
        let _ = if tick.open {
            self.valve.set_high()
        } else {
            self.valve.set_low()
        };
        let _ = if matches!(tick.mode, Mode::Armed | Mode::Playing | Mode::Paused) {
            self.lamp.set_high()
        } else {
            self.lamp.set_low()
        };
        tick
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::{RELAY, SETTINGS};
    use crate::fault::Fault;
    use crate::law::{Driven, driven};
    use crate::relay::Relay;
    use core::cell::Cell;
    use core::convert::Infallible;
    use embedded_hal::digital::ErrorType;
    use identified::full;
    use model_core::average::MovingAverage;

    struct Flicker(bool);
    impl Sensor for Flicker {
        fn counts(&mut self) -> f32 {
            self.0 = !self.0;
            SETTINGS.calibration.zero + if self.0 { 1.0 } else { 0.0 }
        }
        fn channel(&mut self) -> f32 {
            f32::NAN
        }
    }

    impl Clock for &Cell<u32> {
        fn periods(&self) -> u32 {
            self.get()
        }
    }

    struct Pin<'a>(&'a Cell<bool>);
    impl ErrorType for Pin<'_> {
        type Error = Infallible;
    }
    impl OutputPin for Pin<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.set(false);
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.set(true);
            Ok(())
        }
    }

    /// The board's clock has 32 bits: 49 days at 1 kHz.
    #[test]
    fn the_clock_wraps_and_a_missed_sample_is_seen_across_it() {
        for (missed, expected) in [(0, Mode::Armed), (1, Mode::Faulted(Fault::Overrun))] {
            let clock = Cell::new(u32::MAX - 100);
            let (valve, lamp) = (Cell::new(true), Cell::new(true));
            let model = full::model();
            let relay: driven!(Relay, full) =
                Driven::new(RELAY, model, full::state(&model), MovingAverage::new());
            let controller = Controller::new(SETTINGS, relay);
            let mut rig = Rig::new(controller, Flicker(false), &clock, Pin(&valve), Pin(&lamp));
            assert_eq!((valve.get(), lamp.get()), (false, false));
            rig.controller().arm();
            for _ in 0..100 {
                clock.set(clock.get().wrapping_add(1));
                assert!(rig.sample().open);
                assert_eq!((valve.get(), lamp.get()), (true, true));
            }
            clock.set(clock.get().wrapping_add(1 + missed));
            let tick = rig.sample();
            assert_eq!(clock.get(), missed);
            assert_eq!((tick.mode, tick.open), (expected, missed == 0));
            assert_eq!((valve.get(), lamp.get()), (tick.open, tick.open));
            assert_eq!(rig.controller().samples(), 101 + u64::from(missed));
        }
    }
}

//! A two-position relay with hysteresis.

use crate::run::Controller;
use model_core::control::{Hold, HoldTimes};

/// On below the reference, off above it, with a dead band and hold times; without prediction.
#[derive(Clone, Copy, Debug)]
pub struct Relay {
    times: HoldTimes,
    /// Half of the dead band, y.
    half_band: f64,
    /// The reading without friction, y.
    zero: f64,
    reference: f64,
    hold: Hold,
    wanted: bool,
}

impl Relay {
    /// A relay that switches on at `half_band` (y, ≥ 0) below the reference and off at `half_band` above it.
    #[must_use]
    pub fn new(times: HoldTimes, half_band: f64) -> Self {
        Self {
            times,
            half_band,
            zero: 0.0,
            reference: 0.0,
            hold: Hold::closed(),
            wanted: false,
        }
    }

    /// The relay with a sensor that reads `zero` (y) without friction.
    #[must_use]
    pub fn with_zero(self, zero: f64) -> Self {
        Self { zero, ..self }
    }
}

impl Controller for Relay {
    fn set_reference(&mut self, reference: f64) {
        self.reference = reference;
    }
    fn command(&mut self, reading: Option<f64>) -> bool {
        if let Some(y) = reading.map(|y| y - self.zero) {
            if y < self.reference - self.half_band {
                self.wanted = true;
            } else if y > self.reference + self.half_band {
                self.wanted = false;
            }
        }
        self.hold.pass(&self.times, self.wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_that_is_off_is_read_from_its_zero() {
        let times = HoldTimes { on: 1, off: 1 };
        let opens = |zero: f64, reading: f64| {
            let mut relay = Relay::new(times, 0.0).with_zero(zero);
            relay.set_reference(0.4);
            (0..4).any(|_| relay.command(Some(reading)))
        };
        assert!(opens(0.0, 0.3) && !opens(0.0, 0.5));
        assert!(opens(1.8, 2.1) && !opens(1.8, 2.3));
    }
}

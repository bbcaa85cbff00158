//! A sensor that loses sensitivity at one time late in the record.

use super::{Port, Truth};
use crate::plant::effects::physics;
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// The reading is multiplied by 1 − loss from the time `at` on.
    LateSlip = "late-slip" at Film
    parameters(_, rng) {
        /// Loss.
        loss ["-", FINITE] = rng.random_range(0.12..0.35);
        /// Time of the loss (s from the record's start).
        at ["s", TIME] = rng.random_range(5.5..7.2);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
    truth(law) { Truth::new(Port::Sensor, &["time in record × reading"]).above(law.at) }
}

impl SensorPart for LateSlip {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        if at.t > self.at {
            signal * (1.0 - self.loss)
        } else {
            signal
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn until_then_it_is_right() {
        let law = LateSlip { loss: 0.5, at: 6.0 };
        let mut sensor = sensor([law.at_rest()]);
        sensor.advance(5e-5, 0.5);
        assert_eq!(read(&mut sensor, 6.0, 1.0), 0.5);
        assert_eq!(read(&mut sensor, 6.001, 1.0), 0.25);
    }
}

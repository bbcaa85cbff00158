//! A sensor that loses sensitivity at one time late in the record.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// Reading times 1 − loss from `at` on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateSlip {
    /// Loss (-).
    pub loss: f64,
    /// Time of the loss (s from the record's start).
    pub at: f64,
}

impl Physics for LateSlip {
    const NAME: &'static str = "late-slip";
    const PLACE: Place = Place::Film;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("loss", "-", Limits::FINITE, |e| &mut e.loss),
        Card::new("at", "s", Limits::TIME, |e| &mut e.at),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            loss: rng.random_range(0.12..0.35),
            at: rng.random_range(5.5..7.2),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl Hidden for LateSlip {
    fn truth(&self) -> Truth {
        Truth::new(Port::Sensor, &["time in record × reading"]).above(self.at)
    }
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

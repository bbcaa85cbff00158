//! Sensor fouling: sensitivity decreases with time.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// Reading times 1 − loss·(1 − exp(−t/time)), t the time in the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FadingSensitivity {
    /// Final loss (-).
    pub loss: f64,
    /// Time constant of the fouling (s).
    pub time: f64,
}

impl Physics for FadingSensitivity {
    const NAME: &'static str = "fading-sensitivity";
    const PLACE: Place = Place::Film;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("loss", "-", Limits::FINITE, |e| &mut e.loss),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            loss: rng.random_range(0.20..0.50),
            time: log_uniform(rng, 2.0, 8.0),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl Hidden for FadingSensitivity {
    fn truth(&self) -> Truth {
        Truth::new(Port::Sensor, &["time in record × reading"])
    }
}

impl SensorPart for FadingSensitivity {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        signal * (1.0 - self.loss * (1.0 - (-at.t / self.time).exp()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn it_shows_less_the_later_it_is() {
        let law = FadingSensitivity {
            loss: 0.3,
            time: 2.0,
        };
        let mut sensor = sensor([law.at_rest()]);
        sensor.advance(5e-5, 0.5);
        assert_eq!(read(&mut sensor, 0.0, 1.0), 0.5);
        let expected = 0.5 * (1.0 - 0.3 * (1.0 - (-1.0_f64).exp()));
        assert!((read(&mut sensor, 2.0, 1.0) - expected).abs() < 1e-12);
    }
}

//! Sensor drift while the film's support warms up.

use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics, signed};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// amplitude·(1 − e^(−t/τ)) is added to the reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalDrift {
    /// Final offset (y).
    pub amplitude: f64,
    /// Time constant of the drift (s).
    pub time_constant: f64,
}

impl Physics for ThermalDrift {
    const NAME: &'static str = "thermal-drift";
    const PLACE: Place = Place::Zero;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("amplitude", "y", Limits::FINITE, |e| &mut e.amplitude),
        Card::new("time_constant", "s", Limits::TIME, |e| &mut e.time_constant),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            amplitude: signed(rng, 0.08, 0.25),
            time_constant: log_uniform(rng, 1.0, 6.0),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl SensorPart for ThermalDrift {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        signal + self.amplitude * (1.0 - (-at.t / self.time_constant).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn the_zero_creeps_with_its_time_constant() {
        let drift = ThermalDrift {
            amplitude: -0.1,
            time_constant: 2.0,
        };
        let mut drifting = sensor([drift.at_rest()]);
        assert_eq!(read(&mut drifting, 0.0, 1.0), 0.0);
        let expected = -0.1 * (1.0 - (-1.0_f64).exp());
        assert!((read(&mut drifting, 2.0, 0.0) - expected).abs() < 1e-12);
    }
}

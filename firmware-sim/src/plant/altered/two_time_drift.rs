//! Sensor drift with a fast and a slow time constant.

use rand_chacha::ChaCha8Rng;

use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics, ThermalDrift, signed};
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// Half the amplitude with each of two time constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoTimeDrift {
    /// Final offset (y).
    pub amplitude: f64,
    /// Time constant of the film's support (s).
    pub fast_time: f64,
    /// Time constant of the body (s).
    pub slow_time: f64,
}

impl Physics for TwoTimeDrift {
    const NAME: &'static str = "two-time-drift";
    const RESEMBLES: &'static str = ThermalDrift::NAME;
    const PLACE: Place = Place::Zero;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("amplitude", "y", Limits::FINITE, |e| &mut e.amplitude),
        Card::new("fast_time", "s", Limits::TIME, |e| &mut e.fast_time),
        Card::new("slow_time", "s", Limits::TIME, |e| &mut e.slow_time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            amplitude: signed(rng, 0.10, 0.25),
            fast_time: log_uniform(rng, 0.5, 1.2),
            slow_time: log_uniform(rng, 3.0, 9.0),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl SensorPart for TwoTimeDrift {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        let crept = |time: f64| 0.5 * (1.0 - (-at.t / time).exp());
        signal + self.amplitude * (crept(self.fast_time) + crept(self.slow_time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn it_starts_at_zero_and_ends_at_the_amplitude() {
        let law = TwoTimeDrift {
            amplitude: 0.2,
            fast_time: 0.5,
            slow_time: 5.0,
        };
        let mut drifting = sensor([law.at_rest()]);
        assert_eq!(read(&mut drifting, 0.0, 0.0), 0.0);
        let e = (-1.0_f64).exp();
        let expected = 0.1 * (2.0 - (-10.0_f64).exp() - e);
        assert!((read(&mut drifting, 5.0, 0.0) - expected).abs() < 1e-12);
        assert!((read(&mut drifting, 100.0, 0.0) - 0.2).abs() < 1e-9);
    }
}

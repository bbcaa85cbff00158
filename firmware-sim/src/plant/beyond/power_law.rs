//! A sensor with a power-law characteristic.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, SensorPart, Surroundings};

/// full·(s/full)^exponent, odd in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    /// The power (-).
    pub exponent: f64,
    /// Friction at which reading and friction are equal (y).
    pub full: f64,
}

impl Physics for PowerLaw {
    const NAME: &'static str = "power-law";
    const PLACE: Place = Place::Film;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("exponent", "-", Limits::POSITIVE, |e| &mut e.exponent),
        Card::new("full", "y", Limits::POSITIVE, |e| &mut e.full),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            exponent: if rng.random_bool(0.5) {
                rng.random_range(0.50..0.75)
            } else {
                rng.random_range(1.4..2.0)
            },
            full: base.gain,
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl Hidden for PowerLaw {
    fn truth(&self) -> Truth {
        Truth::new(Port::Sensor, &["reading", "y"])
    }
}

impl SensorPart for PowerLaw {
    fn jump(&mut self, to: f64) -> f64 {
        self.full * (to.abs() / self.full).powf(self.exponent).copysign(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn it_is_right_at_rest_and_at_full_friction_only() {
        let law = PowerLaw {
            exponent: 2.0,
            full: 0.8,
        };
        let mut sensor = sensor([law.at_rest()]);
        let expected = [(0.0, 0.0), (0.4, 0.2), (0.8, 0.8), (-0.4, -0.2)];
        for (s, y) in expected {
            assert!((reading(&mut sensor, s) - y).abs() < 1e-12, "{s}");
        }
    }
}

//! King's law with another exponent than one third.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, HotFilmNonlinearity, Limits, Physics};
use crate::plant::part::{Part, Place, SensorPart, Surroundings};

/// E = √(1 + κ·(s + s0)ⁿ), normalised to keep 0 and 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KingExponent {
    /// κ (-).
    pub king_ratio: f64,
    /// s0 (y).
    pub king_offset: f64,
    /// n (-).
    pub exponent: f64,
}

impl Physics for KingExponent {
    const NAME: &'static str = "king-exponent";
    const RESEMBLES: &'static str = HotFilmNonlinearity::NAME;
    const PLACE: Place = Place::Film;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("king_ratio", "-", Limits::POSITIVE, |e| &mut e.king_ratio),
        Card::new("king_offset", "y", Limits::NOT_NEGATIVE, |e| {
            &mut e.king_offset
        }),
        Card::new("exponent", "-", Limits::POSITIVE, |e| &mut e.exponent),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            king_ratio: log_uniform(rng, 0.4, 4.0),
            king_offset: log_uniform(rng, 0.02, 0.15),
            exponent: rng.random_range(0.28..0.50),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl KingExponent {
    fn voltage(&self, s: f64) -> f64 {
        (1.0 + self.king_ratio * (s + self.king_offset).max(0.0).powf(self.exponent)).sqrt()
    }
}

impl SensorPart for KingExponent {
    fn jump(&mut self, to: f64) -> f64 {
        let (zero, one) = (self.voltage(0.0), self.voltage(1.0));
        (self.voltage(to) - zero) / (one - zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::HotFilmNonlinearity;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn with_one_third_it_is_kings_law() {
        let altered = KingExponent {
            king_ratio: 1.5,
            king_offset: 0.05,
            exponent: 1.0 / 3.0,
        };
        let king = HotFilmNonlinearity {
            king_ratio: 1.5,
            king_offset: 0.05,
        };
        let mut films = [sensor([altered.at_rest()]), sensor([king.at_rest()])];
        for s in [-0.2, 0.0, 0.3, 1.0, 1.2] {
            let [a, b] = films.each_mut().map(|film| reading(film, s));
            assert!((a - b).abs() < 1e-12);
        }
    }
}

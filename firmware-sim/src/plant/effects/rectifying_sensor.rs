//! A sensor that loses the sign.

use rand_chacha::ChaCha8Rng;

use super::{Card, Physics, ShowsWith};
use crate::plant::base::BasePlant;
use crate::plant::part::{Part, Place, SensorPart, Surroundings};

/// The film measures the magnitude of the friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RectifyingSensor;

impl Physics for RectifyingSensor {
    const NAME: &'static str = "rectifying-sensor";
    const PLACE: Place = Place::Sense;
    const PARAMETERS: &'static [Card<Self>] = &[];
    /// It only changes negative friction.
    const SHOWS_WITH: ShowsWith = ShowsWith::SignedLevels;

    fn draw(_base: &BasePlant, _rng: &mut ChaCha8Rng) -> Self {
        Self
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl SensorPart for RectifyingSensor {
    fn jump(&mut self, to: f64) -> f64 {
        to.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn what_is_below_zero_is_folded_up() {
        let mut folded = sensor([RectifyingSensor.at_rest()]);
        assert_eq!(reading(&mut folded, -0.3), 0.3);
        assert_eq!(reading(&mut folded, 0.3), 0.3);
    }
}

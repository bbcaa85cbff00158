//! Saturation of the sensor.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::BasePlant;
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// The reading is limited at both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorSaturation {
    /// Lower limit (y).
    pub lower_limit: f64,
    /// Upper limit (y).
    pub upper_limit: f64,
}

impl Physics for SensorSaturation {
    const NAME: &'static str = "sensor-saturation";
    const PLACE: Place = Place::Rails;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("lower_limit", "y", Limits::FINITE, |e| &mut e.lower_limit),
        Card::new("upper_limit", "y", Limits::FINITE, |e| &mut e.upper_limit),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            lower_limit: rng.random_range(0.04..0.12),
            upper_limit: rng.random_range(0.65..0.85) * base.gain,
        }
    }

    fn conflict(&self) -> Option<(&'static str, &'static str)> {
        (self.lower_limit >= self.upper_limit).then_some(("lower_limit", "below upper_limit"))
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl SensorPart for SensorSaturation {
    fn read(&self, signal: f64, _at: &Moment) -> f64 {
        signal.max(self.lower_limit).min(self.upper_limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::Effect;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn the_rails_hold_and_leave_what_is_between_alone() {
        let rails = SensorSaturation {
            lower_limit: 0.1,
            upper_limit: 0.8,
        };
        let mut railed = sensor([rails.at_rest()]);
        assert_eq!(reading(&mut railed, 0.0), 0.1);
        assert_eq!(reading(&mut railed, 1.0), 0.8);
        assert_eq!(reading(&mut railed, 0.5), 0.5);
        let crossed = Effect::from(rails).with("lower_limit", 0.9).unwrap();
        assert!(crossed.validate().is_err());
    }
}

//! An amplifier with soft saturation below its upper limit.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics, SensorSaturation};
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// Above the knee the reading is knee + room·tanh((x − knee)/room).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftRails {
    /// Start of the saturation (y).
    pub knee: f64,
    /// Remaining range above the knee (y).
    pub room: f64,
}

impl Physics for SoftRails {
    const NAME: &'static str = "soft-rails";
    const RESEMBLES: &'static str = SensorSaturation::NAME;
    const PLACE: Place = Place::Rails;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("knee", "y", Limits::FINITE, |e| &mut e.knee),
        Card::new("room", "y", Limits::POSITIVE, |e| &mut e.room),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            knee: rng.random_range(0.62..0.78) * base.gain,
            room: rng.random_range(0.04..0.10) * base.gain,
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl SensorPart for SoftRails {
    fn read(&self, signal: f64, _at: &Moment) -> f64 {
        let over = (signal - self.knee).max(0.0);
        signal.min(self.knee) + self.room * (over / self.room).tanh()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn below_the_knee_it_is_exact_and_above_it_never_passes_the_rail() {
        let law = SoftRails {
            knee: 0.7,
            room: 0.1,
        };
        let mut railed = sensor([law.at_rest()]);
        assert_eq!(reading(&mut railed, 0.5), 0.5);
        let bent = reading(&mut railed, 0.75);
        assert!(bent > 0.74 && bent < 0.75);
        assert!((reading(&mut railed, 3.0) - 0.8).abs() < 1e-9);
    }
}

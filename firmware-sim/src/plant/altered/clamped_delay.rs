//! A delay that decreases linearly with the mean friction, down to a minimum.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::{BasePlant, FlowDelay};
use crate::plant::effects::{Card, Limits, Physics, StateDependentDelay};
use crate::plant::part::{Part, Place, Surroundings};

/// h = floor + rise·max(1 − ỹ/level, 0); replaces the base plant's delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClampedDelay {
    /// Delay of the attached flow (s).
    pub floor: f64,
    /// Extra delay of the separated flow (s).
    pub rise: f64,
    /// Mean friction above which the delay is constant (y).
    pub level: f64,
}

impl Physics for ClampedDelay {
    const NAME: &'static str = "clamped-delay";
    const RESEMBLES: &'static str = StateDependentDelay::NAME;
    const PLACE: Place = Place::Transport;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("floor", "s", Limits::TRAVEL, |e| &mut e.floor),
        Card::new("rise", "s", Limits::TRAVEL, |e| &mut e.rise),
        Card::new("level", "y", Limits::POSITIVE, |e| &mut e.level),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            floor: rng.random_range(0.020..0.040),
            rise: rng.random_range(0.010..0.020),
            level: rng.random_range(0.3..0.8) * base.gain,
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Delay(FlowDelay::Clamped {
            floor_s: self.floor,
            rise_s: self.rise,
            level: self.level,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::transport::ArrivalClock;

    #[test]
    fn the_delay_is_a_line_and_then_a_floor() {
        let law = ClampedDelay {
            floor: 0.03,
            rise: 0.02,
            level: 0.5,
        };
        let Part::Delay(law) = law.at_rest() else {
            panic!("it sets the delay");
        };
        let clock = ArrivalClock::new(law);
        let expected = [
            (-0.2, 0.05),
            (0.0, 0.05),
            (0.25, 0.04),
            (0.5, 0.03),
            (2.0, 0.03),
        ];
        for (mean, delay) in expected {
            assert!((clock.delay(mean) - delay).abs() < 1e-12, "{mean}");
        }
    }
}

//! State-dependent delay: h = floor + rise·exp(−rate·ỹ).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::SAMPLE_PERIOD_S;
use crate::plant::base::{BasePlant, FlowDelay};
use crate::plant::part::{Part, Place, Surroundings};

/// h = floor + rise·exp(−rate·ỹ); replaces the base plant's delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateDependentDelay {
    /// Delay of the attached flow (samples).
    pub delay_floor: f64,
    /// Extra delay of the separated flow (samples).
    pub delay_rise: f64,
    /// Rate at which the extra delay decreases with the mean friction (1/y).
    pub delay_rate: f64,
}

const TRAVEL: Limits = Limits::new(0.0, 500.0, "between 0 and 500 samples");

impl Physics for StateDependentDelay {
    const NAME: &'static str = "state-dependent-delay";
    const PLACE: Place = Place::Transport;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("delay_floor", "samples", TRAVEL, |e| &mut e.delay_floor),
        Card::new("delay_rise", "samples", TRAVEL, |e| &mut e.delay_rise),
        Card::new("delay_rate", "1/y", Limits::NOT_NEGATIVE, |e| {
            &mut e.delay_rate
        }),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        let delay_rise = rng.random_range(10.0..20.0);
        Self {
            delay_floor: rng.random_range(20.0..40.0),
            delay_rise,
            delay_rate: rng.random_range(2.0..10.0_f64.min(200.0 / delay_rise)),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Delay(FlowDelay::StateDependent {
            floor_s: self.delay_floor * SAMPLE_PERIOD_S,
            rise_s: self.delay_rise * SAMPLE_PERIOD_S,
            rate: self.delay_rate,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_become_seconds() {
        let effect = StateDependentDelay {
            delay_floor: 30.0,
            delay_rise: 12.0,
            delay_rate: 8.0,
        };
        let Part::Delay(FlowDelay::StateDependent {
            floor_s,
            rise_s,
            rate,
        }) = effect.part(&Surroundings::default())
        else {
            panic!("it sets the delay");
        };
        assert_eq!((floor_s, rise_s, rate), (0.030, 0.012, 8.0));
    }
}

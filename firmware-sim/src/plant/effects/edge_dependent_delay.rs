//! Different delays of rising and falling edges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::{BasePlant, FlowDelay};
use crate::plant::part::{Part, Place, Surroundings};

/// Rising and falling edges travel for different times; replaces the base plant's delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeDependentDelay {
    /// Delay of a rising edge (s).
    pub rise_delay: f64,
    /// Delay of a falling edge (s).
    pub fall_delay: f64,
}

impl Physics for EdgeDependentDelay {
    const NAME: &'static str = "edge-dependent-delay";
    const PLACE: Place = Place::Transport;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("rise_delay", "s", Limits::TRAVEL, |e| &mut e.rise_delay),
        Card::new("fall_delay", "s", Limits::TRAVEL, |e| &mut e.fall_delay),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        loop {
            let rise_delay: f64 = rng.random_range(0.020..0.060);
            let fall_delay: f64 = rng.random_range(0.020..0.060);
            if (rise_delay - fall_delay).abs() > 0.008 {
                break Self {
                    rise_delay,
                    fall_delay,
                };
            }
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Delay(FlowDelay::EdgeDependent {
            rise_s: self.rise_delay,
            fall_s: self.fall_delay,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::rig::bench::rig;

    #[test]
    fn edges_with_delays_of_their_own_lengthen_the_pulse_by_the_difference() {
        let effect = EdgeDependentDelay {
            rise_delay: 0.025,
            fall_delay: 0.0405,
        };
        let mut rig = rig(FlowDelay::Fixed { delay_s: 0.05 }, &[effect.into()]);
        let mut command = vec![1.0; 50];
        command.resize(200, 0.0);
        let y = rig.play(&command);
        let peak = 1.0 - (-(0.050 + 0.0155) / 0.04_f64).exp();
        assert!(y[25] == 0.0 && y[26] > 0.0);
        assert!((y[150] - peak * (-(0.150 - 0.0905) / 0.1_f64).exp()).abs() < 1e-8);
    }
}

//! A vortex after switching off, opposed to the jet.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::vortex::Vortex;
use super::{Card, Limits, Physics};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::part::{Part, Place, Surroundings};

/// ẇ = −w/τ + max(−dj/dt, 0); the flow receives j − gain·w.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoppingVortex {
    /// Strength (-).
    pub gain: f64,
    /// Time constant of its decay (s).
    pub decay_time: f64,
}

impl Physics for StoppingVortex {
    const NAME: &'static str = "stopping-vortex";
    const PLACE: Place = Place::Shedding;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("gain", "-", Limits::FINITE, |e| &mut e.gain),
        Card::new("decay_time", "s", Limits::TIME, |e| &mut e.decay_time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: rng.random_range(0.4..1.0),
            decay_time: log_uniform(rng, 0.020, 0.080),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Vortex::stopping(self.gain, self.decay_time)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn switching_off_leaves_a_decaying_suction_and_switching_on_nothing() {
        let vortex = StoppingVortex {
            gain: 0.5,
            decay_time: 0.04,
        };
        let mut jet = jet([vortex.at_rest()]);
        jet.command(1.0);
        assert_eq!(run(&mut jet, 0.3), 1.0);
        jet.command(0.0);
        assert!((run(&mut jet, 0.34) + 0.5 * (-1.0_f64).exp()).abs() < 1e-9);
    }
}

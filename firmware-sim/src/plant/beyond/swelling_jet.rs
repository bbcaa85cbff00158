//! A jet whose strength builds up within the pulse.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, Surroundings};

/// Strength 1 − deficit·exp(−t/time), t since the pulse began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwellingJet {
    /// Initial deficit (-).
    pub deficit: f64,
    /// Build-up time constant (s).
    pub time: f64,
}

impl Physics for SwellingJet {
    const NAME: &'static str = "swelling-jet";
    const PLACE: Place = Place::Plenum;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("deficit", "-", Limits::FINITE, |e| &mut e.deficit),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            deficit: rng.random_range(0.30..0.60),
            time: log_uniform(rng, 0.08, 0.35),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        jet(*self)
    }
}

impl Hidden for SwellingJet {
    fn truth(&self) -> Truth {
        // A jet exists only during the pulse, in which both coordinates are equal.
        Truth::new(Port::Jet, &["since rising edge", "pulse length"])
    }
}

impl StrengthLaw for SwellingJet {
    fn strength(&self, pulses: &Pulses, t: f64) -> f64 {
        1.0 - self.deficit * (-pulses.since_rise(t) / self.time).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::strength::bench::strengths;

    #[test]
    fn every_pulse_begins_weak() {
        let law = SwellingJet {
            deficit: 0.4,
            time: 0.1,
        };
        let seen = strengths(law.at_rest(), &[0.1, 0.3, 0.5], &[0.2, 0.4, 0.6]);
        let strong = 1.0 - 0.4 * (-1.0_f64).exp();
        assert!((seen[0] - strong).abs() < 1e-9 && (seen[2] - strong).abs() < 1e-9);
        assert_eq!(seen[1], 0.0);
    }
}

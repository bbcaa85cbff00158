//! A jet that weakens with every pulse.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, Surroundings};

/// Strength 1 − loss·(1 − exp(−(n − 1)/pulses)), n the number of the pulse in the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TiringJet {
    /// Final loss (-).
    pub loss: f64,
    /// Number of pulses after which 63 % of the loss has occurred (-).
    pub pulses: f64,
}

impl Physics for TiringJet {
    const NAME: &'static str = "tiring-jet";
    const PLACE: Place = Place::Plenum;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("loss", "-", Limits::FINITE, |e| &mut e.loss),
        Card::new("pulses", "-", Limits::POSITIVE, |e| &mut e.pulses),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            loss: rng.random_range(0.25..0.50),
            pulses: log_uniform(rng, 5.0, 20.0),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        jet(*self)
    }
}

impl Hidden for TiringJet {
    fn truth(&self) -> Truth {
        Truth::new(Port::Jet, &["pulse number"])
    }
}

impl StrengthLaw for TiringJet {
    fn strength(&self, pulses: &Pulses, _t: f64) -> f64 {
        let before = f64::from(pulses.number().saturating_sub(1));
        1.0 - self.loss * (1.0 - (-before / self.pulses).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::strength::bench::strengths;

    #[test]
    fn every_pulse_is_weaker_than_the_one_before() {
        let law = TiringJet {
            loss: 0.4,
            pulses: 2.0,
        };
        let seen = strengths(
            law.at_rest(),
            &[0.1, 0.2, 0.3, 0.4, 0.5],
            &[0.15, 0.25, 0.35, 0.55],
        );
        let second = 1.0 - 0.4 * (1.0 - (-0.5_f64).exp());
        let third = 1.0 - 0.4 * (1.0 - (-1.0_f64).exp());
        assert_eq!(seen, [1.0, 0.0, second, third]);
    }
}

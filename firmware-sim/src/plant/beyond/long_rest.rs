//! A jet that is weaker after a long rest.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Hidden, Port, Truth};
use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, Surroundings};

/// Strength 1 − loss for the whole pulse after a rest longer than `rest`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LongRest {
    /// Loss (-).
    pub loss: f64,
    /// Longest rest without loss (s).
    pub rest: f64,
}

impl Physics for LongRest {
    const NAME: &'static str = "long-rest";
    const PLACE: Place = Place::Plenum;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("loss", "-", Limits::FINITE, |e| &mut e.loss),
        Card::new("rest", "s", Limits::TIME, |e| &mut e.rest),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            loss: rng.random_range(0.25..0.50),
            rest: rng.random_range(0.22..0.36),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        jet(*self)
    }
}

impl Hidden for LongRest {
    fn truth(&self) -> Truth {
        Truth::new(Port::Jet, &["rest before"]).above(self.rest)
    }
}

impl StrengthLaw for LongRest {
    fn strength(&self, pulses: &Pulses, _t: f64) -> f64 {
        if pulses.rest_before() > self.rest {
            1.0 - self.loss
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::strength::bench::strengths;

    #[test]
    fn only_the_pulse_after_a_long_rest_is_weak() {
        let law = LongRest {
            loss: 0.3,
            rest: 0.3,
        };
        let seen = strengths(
            law.at_rest(),
            &[0.1, 0.2, 0.4, 0.5, 0.9],
            &[0.15, 0.45, 0.95],
        );
        assert_eq!(seen, [0.7, 1.0, 0.7]);
    }
}

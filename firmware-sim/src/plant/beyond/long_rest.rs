//! A jet that is weaker after a long rest.

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Port, Truth};
use crate::plant::effects::physics;

physics! {
    /// The jet has the strength 1 − loss for the whole pulse after a rest longer than `rest`.
    LongRest = "long-rest" at Plenum
    parameters(_, rng) {
        /// Loss.
        loss ["-", FINITE] = rng.random_range(0.25..0.50);
        /// Longest rest without loss.
        rest ["s", TIME] = rng.random_range(0.22..0.36);
    }
    part(law, _) { jet(*law) }
    truth(law) { Truth::new(Port::Jet, &["rest before"]).above(law.rest) }
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

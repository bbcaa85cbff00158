//! A jet that weakens with every pulse.

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;

physics! {
    /// The jet has the strength 1 − loss·(1 − exp(−(n − 1)/pulses)), with the number n of the pulse
    /// in the record.
    TiringJet = "tiring-jet" at Plenum
    parameters(_, rng) {
        /// Final loss.
        loss ["-", FINITE] = rng.random_range(0.25..0.50);
        /// Number of pulses after which 63 % of the loss has occurred.
        pulses ["-", POSITIVE] = log_uniform(rng, 5.0, 20.0);
    }
    part(law, _) { jet(*law) }
    truth(_) { Truth::new(Port::Jet, &["pulse number"]) }
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

//! A jet that is weaker after a short rest.

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;

physics! {
    /// The jet has the strength 1 − loss·exp(−rest/recovery), with the pause `rest` before the
    /// pulse.
    ShortRest = "short-rest" at Plenum
    parameters(_, rng) {
        /// Loss without any rest.
        loss ["-", FINITE] = rng.random_range(0.35..0.65);
        /// Rest after which 63 % of the loss have recovered.
        recovery ["s", TIME] = log_uniform(rng, 0.06, 0.20);
    }
    part(law, _) { jet(*law) }
    truth(_) { Truth::new(Port::Jet, &["rest before"]) }
}

impl StrengthLaw for ShortRest {
    fn strength(&self, pulses: &Pulses, _t: f64) -> f64 {
        1.0 - self.loss * (-pulses.rest_before() / self.recovery).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::strength::bench::strengths;

    #[test]
    fn the_rest_before_decides_for_the_whole_pulse() {
        let law = ShortRest {
            loss: 0.5,
            recovery: 0.1,
        };
        let seen = strengths(law.at_rest(), &[0.1, 0.2, 0.25, 0.9], &[0.15, 0.26, 0.85]);
        let short = 1.0 - 0.5 * (-0.5_f64).exp();
        assert_eq!(seen[0], 1.0);
        assert!((seen[1] - short).abs() < 1e-9 && (seen[2] - short).abs() < 1e-9);
    }
}

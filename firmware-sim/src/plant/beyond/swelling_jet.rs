//! A jet whose strength builds up within the pulse.

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;

physics! {
    /// The jet has the strength 1 − deficit·exp(−t/time), with the time t since the pulse began.
    SwellingJet = "swelling-jet" at Plenum
    parameters(_, rng) {
        /// Initial deficit.
        deficit ["-", FINITE] = rng.random_range(0.30..0.60);
        /// Build-up time constant.
        time ["s", TIME] = log_uniform(rng, 0.08, 0.35);
    }
    part(law, _) { jet(*law) }
    truth(_) {
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

//! A supply line that empties at rest and has to be refilled.

use super::line::{LineLaw, line};
use super::pulses::Pulses;
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;

physics! {
    /// more·(1 − exp(−rest/time)) on top of the transport delay, for the whole pulse after that rest.
    RestLine = "rest-line" at Line
    parameters(_, rng) {
        /// Additional delay after an infinitely long rest.
        more ["s", TRAVEL] = rng.random_range(0.012..0.030);
        /// Time constant of emptying.
        time ["s", TIME] = log_uniform(rng, 0.06, 0.25);
    }
    part(law, _) { line(*law) }
    truth(_) { Truth::new(Port::Delay, &["rest before"]) }
}

impl LineLaw for RestLine {
    fn takes(&self, pulses: &Pulses, _t: f64) -> f64 {
        self.more * (1.0 - (-pulses.rest_before() / self.time).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::line::bench::arrivals;

    #[test]
    fn a_pulse_after_a_long_rest_comes_later() {
        let law = RestLine {
            more: 0.02,
            time: 0.1,
        };
        let arrived = arrivals(law.at_rest(), &[0.1, 0.2, 0.25, 0.4]);
        let short = 0.02 * (1.0 - (-0.5_f64).exp());
        let expected = [0.12, 0.22, 0.25 + short, 0.4 + short];
        assert_eq!(arrived.len(), 4);
        for (a, e) in arrived.iter().zip(expected) {
            assert!((a - e).abs() < 1e-9, "{arrived:?}");
        }
    }
}

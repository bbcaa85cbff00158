//! Faster separation after a long pulse.

use super::pulses::Pulses;
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Piece};

physics! {
    /// Without a jet the rate is multiplied by 1 + gain·(1 − exp(−length/time)), with length that of the last
    /// pulse.
    FasterSeparation = "faster-separation" at Flow
    parameters(_, rng) {
        /// Relative increase of the rate after an infinitely long pulse.
        gain ["-", NOT_NEGATIVE] = rng.random_range(0.8..2.5);
        /// Time constant with which the increase grows with the pulse length.
        time ["s", TIME] = log_uniform(rng, 0.10, 0.40);
    }
    part(law, _) {
        Part::Flow(Box::new(Blown {
            law: *law,
            time: 0.0,
            pulses: Pulses::default(),
        }))
    }
    truth(_) { Truth::new(Port::Flow, &["pulse length × y"]) }
}

#[derive(Debug, Clone)]
struct Blown {
    law: FasterSeparation,
    time: f64,
    pulses: Pulses,
}

impl FlowPart for Blown {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        if self.pulses.is_on() {
            return 0.0;
        }
        let length = self.pulses.length(self.time);
        -self.law.gain * (1.0 - (-length / self.law.time).exp()) * s
    }

    fn arrives(&mut self, jet: f64) {
        self.pulses.see(self.time, jet);
    }

    fn passed(&mut self, jet: &Piece, _s: f64) {
        self.time += jet.dt;
        self.pulses.see(self.time, jet.to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_length_of_the_blow_sets_the_rate() {
        let law = FasterSeparation {
            gain: 1.0,
            time: 0.2,
        };
        for length in [0.1_f64, 0.8] {
            let mut flow = flow([law.at_rest()]);
            flow.jump(1.0);
            let s = hold(&mut flow, 1.0, length);
            assert!((s - (1.0 - (-length / 0.04).exp())).abs() < 1e-9);
            flow.jump(0.0);
            let rate = 10.0 * (2.0 - (-length / 0.2).exp());
            let left = hold(&mut flow, 0.0, 0.1);
            assert!((left - s * (-0.1 * rate).exp()).abs() < 1e-9);
        }
    }
}

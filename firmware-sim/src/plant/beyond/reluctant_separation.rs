//! Delayed separation after a pulse.

use super::pulses::Pulses;
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Piece};

physics! {
    /// Without a jet the rate is multiplied by 1 − reluctance·exp(−t/time), t since the jet ended.
    ReluctantSeparation = "reluctant-separation" at Flow
    parameters(_, rng) {
        /// Initial relative reduction of the rate.
        reluctance ["-", FINITE] = rng.random_range(0.5..0.95);
        /// Time constant of the recovery.
        time ["s", TIME] = log_uniform(rng, 0.03, 0.12);
    }
    part(law, _) {
        Part::Flow(Box::new(Left {
            law: *law,
            time: 0.0,
            pulses: Pulses::default(),
        }))
    }
    truth(_) { Truth::new(Port::Flow, &["since falling edge × y"]) }
}

#[derive(Debug, Clone)]
struct Left {
    law: ReluctantSeparation,
    time: f64,
    pulses: Pulses,
}

impl FlowPart for Left {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        if self.pulses.is_on() {
            return 0.0;
        }
        let since = self.pulses.since_fall(self.time);
        self.law.reluctance * (-since / self.law.time).exp() * s
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

    /// ṡ = −r·(1 − q·exp(−t/τ))·s: ln(s/s₀) = −r·(t − q·τ·(1 − exp(−t/τ))).
    #[test]
    fn the_rate_comes_back_with_time() {
        let law = ReluctantSeparation {
            reluctance: 0.8,
            time: 0.05,
        };
        let mut flow = flow([law.at_rest()]);
        flow.jump(1.0);
        let s = hold(&mut flow, 1.0, 0.5);
        flow.jump(0.0);
        let t = 0.1_f64;
        let expected = s * (-10.0 * (t - 0.04 * (1.0 - (-t / 0.05).exp()))).exp();
        // The part's clock is constant within a sub-step.
        assert!((hold(&mut flow, 0.0, t) - expected).abs() < 1e-3);
    }
}

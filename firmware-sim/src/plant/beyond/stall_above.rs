//! Saturation of the flow above a level only.

use super::{Port, Truth};
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// −slope·(s − level) in the level of the flow where s exceeds it.
    StallAbove = "stall-above" at Flow
    parameters(base, rng) {
        /// Strength.
        slope ["-", NOT_NEGATIVE] = rng.random_range(0.8..3.0);
        /// Threshold friction.
        level ["y", FINITE] = rng.random_range(0.55..0.80) * base.gain;
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
    truth(law) { Truth::new(Port::Flow, &["y"]).above(law.level) }
}

impl FlowPart for StallAbove {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        -self.slope * (s - self.level).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn below_the_level_nothing_happens() {
        let law = StallAbove {
            slope: 1.0,
            level: 0.6,
        };
        let mut flow = flow([law.at_rest()]);
        let s = hold(&mut flow, 1.0, 0.03);
        assert!((s - (1.0 - (-0.75_f64).exp())).abs() < 1e-9);
        assert!((hold(&mut flow, 1.0, 3.0) - 0.8).abs() < 1e-9);
    }
}

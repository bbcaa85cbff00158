//! A separation bubble that reduces the jet's effect after long filling.

use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// −square·b² in the level of the flow, time·ḃ = s − b.
    BubbleMemory = "bubble-memory" at Flow
    parameters(base, rng) {
        /// Coefficient.
        square ["1/y", FINITE] = rng.random_range(0.30..0.80) / base.gain;
        /// Time constant of filling and emptying.
        time ["s", TIME] = log_uniform(rng, 0.25, 1.2);
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
    truth(law) { Truth::new(Port::Flow, &[&format!("memory of y ({} s)", law.time)]) }
}

impl FlowPart for BubbleMemory {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        -self.square * z * z
    }

    fn memory_rate(&self, s: f64, _s_dot: f64, z: f64) -> f64 {
        (s - z) / self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_level_sinks_as_the_bubble_fills() {
        let law = BubbleMemory {
            square: 0.5,
            time: 1.0,
        };
        let mut flow = flow([law.at_rest()]);
        assert!(hold(&mut flow, 1.0, 0.2) > 0.95);
        let s = hold(&mut flow, 1.0, 20.0);
        assert!((s + 0.5 * s * s - 1.0).abs() < 1e-6, "{s}");
    }
}

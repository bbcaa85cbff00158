//! Motion of the flow reduces its attachment.

use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// −loss·m in the level of the flow, time·ṁ = |ṡ| − m.
    Unrest = "unrest" at Flow
    parameters(_, rng) {
        /// Strength.
        loss ["s", FINITE] = rng.random_range(0.03..0.08);
        /// Decay time constant.
        time ["s", TIME] = log_uniform(rng, 0.10, 0.60);
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
    truth(law) { Truth::new(Port::Flow, &[&format!("memory of rate ({} s)", law.time)]) }
}

impl FlowPart for Unrest {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        -self.loss * z
    }

    fn memory_rate(&self, _s: f64, s_dot: f64, z: f64) -> f64 {
        (s_dot.abs() - z) / self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn it_slows_the_rise_and_calms_down() {
        let law = Unrest {
            loss: 0.05,
            time: 0.2,
        };
        let mut flow = flow([law.at_rest()]);
        let s = hold(&mut flow, 1.0, 0.08);
        assert!(s < 0.85 && s > 0.5, "{s}");
        assert!((hold(&mut flow, 1.0, 5.0) - 1.0).abs() < 1e-6);
    }
}

//! Bouc–Wen hysteresis in the drive.

use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|, −α·z in the drive.
    BoucWenHysteresis = "bouc-wen-hysteresis" at Flow
    parameters(_, rng) {
        /// A, the initial slope of the loop (1 by convention, because only α·A is identifiable).
        stiffness ["-", FINITE] = 1.0;
        /// β, saturation rate of the loop.
        beta ["1/y", FINITE] = rng.random_range(2.0..6.0);
        /// γ, shape of the loop.
        gamma ["1/y", FINITE] = rng.random_range(0.0..2.0);
        /// α, weight of the loop in the drive.
        alpha ["-", FINITE] = rng.random_range(0.5..1.2);
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
}

impl FlowPart for BoucWenHysteresis {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        -(self.alpha * z)
    }

    fn memory_rate(&self, _s: f64, s_dot: f64, z: f64) -> f64 {
        self.stiffness * s_dot - self.beta * s_dot.abs() * z - self.gamma * s_dot * z.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn bouc_wen_remembers_the_direction_of_travel() {
        let effect = BoucWenHysteresis {
            stiffness: 1.0,
            beta: 3.0,
            gamma: 1.0,
            alpha: 0.5,
        };
        let mut flow = flow([effect.at_rest()]);
        let s = hold(&mut flow, 1.0, 3.0);
        // During loading from rest, z = (1 − exp(−(β+γ)·s))/(β+γ).
        let z = (1.0 - (-4.0 * s).exp()) / 4.0;
        assert!((s + 0.5 * z - 1.0).abs() < 1e-6);
        assert!(
            hold(&mut flow, 0.0, 5.0) > 0.01,
            "it does not come back to 0"
        );
    }
}

//! Saturation by the fifth power of the friction.

use crate::plant::effects::AmplitudeSaturation;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// −γ·s⁵ in the drive.
    FifthPower = "fifth-power" at Flow, like AmplitudeSaturation
    parameters(_, rng) {
        /// γ.
        coefficient ["1/y⁴", FINITE] = rng.random_range(0.3..2.0);
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
}

impl FlowPart for FifthPower {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        -self.coefficient * s.powi(5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_fifth_power_sets_the_saturated_level() {
        let law = FifthPower { coefficient: 0.4 };
        let mut flow = flow([law.at_rest()]);
        let s = hold(&mut flow, 1.0, 3.0);
        assert!((s + 0.4 * s.powi(5) - 1.0).abs() < 1e-9 && s < 0.9);
    }
}

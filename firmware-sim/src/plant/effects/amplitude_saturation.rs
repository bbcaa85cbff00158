//! Saturation by a cubic of the friction.

use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// −γ·s³ in the drive.
    AmplitudeSaturation = "amplitude-saturation" at Flow
    parameters(_, rng) {
        /// γ.
        cubic ["1/y²", FINITE] = rng.random_range(0.2..0.8);
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
}

impl FlowPart for AmplitudeSaturation {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        -self.cubic * s * s * s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_cubic_sets_the_saturated_level() {
        let mut flow = flow([AmplitudeSaturation { cubic: 0.3 }.at_rest()]);
        let s = hold(&mut flow, 1.0, 3.0);
        assert!((s + 0.3 * s * s * s - 1.0).abs() < 1e-9 && s < 0.9);
    }
}

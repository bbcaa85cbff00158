//! A drive with a term quadratic in the friction.

use super::{Port, Truth};
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// square·s² in the level of the flow.
    QuadraticDrive = "quadratic-drive" at Flow
    parameters(base, rng) {
        /// Coefficient of s².
        square ["1/y", FINITE] = size / base.gain;
    }
    where {
        // The flow would diverge from a coefficient of about a quarter of 1/gain on.
        let size = if rng.random_bool(0.5) {
            rng.random_range(0.10..0.18)
        } else {
            -rng.random_range(0.20..0.50)
        };
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
    truth(_) { Truth::new(Port::Flow, &["y"]) }
}

impl FlowPart for QuadraticDrive {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        self.square * s * s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_square_sets_the_level() {
        let law = QuadraticDrive { square: -0.3 };
        let s = hold(&mut flow([law.at_rest()]), 1.0, 3.0);
        assert!((s - (1.0 - 0.3 * s * s)).abs() < 1e-9);
    }
}

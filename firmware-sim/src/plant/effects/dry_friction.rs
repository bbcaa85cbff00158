//! Dry friction with stick-slip.

use crate::plant::SAMPLE_PERIOD_S;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Resistance};

physics! {
    /// −F·sign(ṡ) opposes every motion.
    DryFriction = "dry-friction" at Flow
    parameters(base, rng) {
        /// F.
        // The value is the range of sticking around the equilibrium of the slower motion.
        level ["y per sample", NOT_NEGATIVE] = rng.random_range(0.10..0.25) * SAMPLE_PERIOD_S / slow;
    }
    where { let slow = base.attach_s.max(base.separate_s); }
    part(law, _) { Part::Flow(Box::new(*law)) }
}

impl FlowPart for DryFriction {
    fn resistance(&self) -> Resistance {
        Resistance {
            dry: self.level / SAMPLE_PERIOD_S,
            drag: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn dry_friction_stops_the_flow_short_of_its_equilibrium_on_both_sides() {
        // The flow sticks where rate·|drive − s| = F per sample.
        let level = 0.002;
        let mut flow = flow([DryFriction { level }.at_rest()]);
        let band_on = level / 0.001 * 0.04;
        assert!((hold(&mut flow, 1.0, 3.0) - (1.0 - band_on)).abs() < 1e-3);
        let band_off = level / 0.001 * 0.1;
        assert!((hold(&mut flow, 0.0, 3.0) - band_off).abs() < 1e-3);
    }
}

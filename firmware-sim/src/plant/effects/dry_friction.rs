//! Dry friction with stick-slip.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::SAMPLE_PERIOD_S;
use crate::plant::base::BasePlant;
use crate::plant::part::{FlowPart, Part, Place, Resistance, Surroundings};

/// −F·sign(ṡ) opposes every motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DryFriction {
    /// F (y per sample).
    pub level: f64,
}

impl Physics for DryFriction {
    const NAME: &'static str = "dry-friction";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[Card::new(
        "level",
        "y per sample",
        Limits::NOT_NEGATIVE,
        |e| &mut e.level,
    )];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        let slow = base.attach_s.max(base.separate_s);
        Self {
            // Sticking range around the equilibrium of the slower motion.
            level: rng.random_range(0.10..0.25) * SAMPLE_PERIOD_S / slow,
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
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
        // Sticks where rate·|drive − s| = F per sample.
        let level = 0.002;
        let mut flow = flow([DryFriction { level }.at_rest()]);
        let band_on = level / 0.001 * 0.04;
        assert!((hold(&mut flow, 1.0, 3.0) - (1.0 - band_on)).abs() < 1e-3);
        let band_off = level / 0.001 * 0.1;
        assert!((hold(&mut flow, 0.0, 3.0) - band_off).abs() < 1e-3);
    }
}

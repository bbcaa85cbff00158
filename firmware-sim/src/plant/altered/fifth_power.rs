//! Saturation by the fifth power of the friction.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::BasePlant;
use crate::plant::effects::{AmplitudeSaturation, Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// −γ·s⁵ in the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FifthPower {
    /// γ (1/y⁴).
    pub coefficient: f64,
}

impl Physics for FifthPower {
    const NAME: &'static str = "fifth-power";
    const RESEMBLES: &'static str = AmplitudeSaturation::NAME;
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] =
        &[Card::new("coefficient", "1/y⁴", Limits::FINITE, |e| {
            &mut e.coefficient
        })];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            coefficient: rng.random_range(0.3..2.0),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
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

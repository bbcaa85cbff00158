//! Saturation by a cubic of the friction.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::BasePlant;
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// −γ·s³ in the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmplitudeSaturation {
    /// γ (1/y²).
    pub cubic: f64,
}

impl Physics for AmplitudeSaturation {
    const NAME: &'static str = "amplitude-saturation";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[Card::new("cubic", "1/y²", Limits::FINITE, |e| {
        &mut e.cubic
    })];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            cubic: rng.random_range(0.2..0.8),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
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

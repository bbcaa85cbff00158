//! Saturation of the flow above a level only.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// −slope·(s − level) in the level of the flow where s exceeds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StallAbove {
    /// Strength (-).
    pub slope: f64,
    /// Threshold friction (y).
    pub level: f64,
}

impl Physics for StallAbove {
    const NAME: &'static str = "stall-above";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("slope", "-", Limits::NOT_NEGATIVE, |e| &mut e.slope),
        Card::new("level", "y", Limits::FINITE, |e| &mut e.level),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            slope: rng.random_range(0.8..3.0),
            level: rng.random_range(0.55..0.80) * base.gain,
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
}

impl Hidden for StallAbove {
    fn truth(&self) -> Truth {
        Truth::new(Port::Flow, &["y"]).above(self.level)
    }
}

impl FlowPart for StallAbove {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        -self.slope * (s - self.level).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn below_the_level_nothing_happens() {
        let law = StallAbove {
            slope: 1.0,
            level: 0.6,
        };
        let mut flow = flow([law.at_rest()]);
        let s = hold(&mut flow, 1.0, 0.03);
        assert!((s - (1.0 - (-0.75_f64).exp())).abs() < 1e-9);
        assert!((hold(&mut flow, 1.0, 3.0) - 0.8).abs() < 1e-9);
    }
}

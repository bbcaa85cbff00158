//! A drive with a term quadratic in the friction.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// square·s² in the level of the flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadraticDrive {
    /// Its coefficient (1/y).
    pub square: f64,
}

impl Physics for QuadraticDrive {
    const NAME: &'static str = "quadratic-drive";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[Card::new("square", "1/y", Limits::FINITE, |e| {
        &mut e.square
    })];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        // From about a quarter of 1/gain the flow would diverge.
        let size = if rng.random_bool(0.5) {
            rng.random_range(0.10..0.18)
        } else {
            -rng.random_range(0.20..0.50)
        };
        Self {
            square: size / base.gain,
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
}

impl Hidden for QuadraticDrive {
    fn truth(&self) -> Truth {
        Truth::new(Port::Flow, &["y"])
    }
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

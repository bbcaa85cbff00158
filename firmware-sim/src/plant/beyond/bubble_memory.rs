//! A separation bubble that reduces the jet's effect after long filling.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// −square·b² in the level of the flow, time·ḃ = s − b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BubbleMemory {
    /// Coefficient (1/y).
    pub square: f64,
    /// Time constant of filling and emptying (s).
    pub time: f64,
}

impl Physics for BubbleMemory {
    const NAME: &'static str = "bubble-memory";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("square", "1/y", Limits::FINITE, |e| &mut e.square),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            square: rng.random_range(0.30..0.80) / base.gain,
            time: log_uniform(rng, 0.25, 1.2),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
}

impl Hidden for BubbleMemory {
    fn truth(&self) -> Truth {
        Truth::new(Port::Flow, &[&format!("memory of y ({} s)", self.time)])
    }
}

impl FlowPart for BubbleMemory {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        -self.square * z * z
    }

    fn memory_rate(&self, s: f64, _s_dot: f64, z: f64) -> f64 {
        (s - z) / self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_level_sinks_as_the_bubble_fills() {
        let law = BubbleMemory {
            square: 0.5,
            time: 1.0,
        };
        let mut flow = flow([law.at_rest()]);
        assert!(hold(&mut flow, 1.0, 0.2) > 0.95);
        let s = hold(&mut flow, 1.0, 20.0);
        assert!((s + 0.5 * s * s - 1.0).abs() < 1e-6, "{s}");
    }
}

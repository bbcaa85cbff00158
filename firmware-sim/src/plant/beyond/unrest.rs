//! Motion of the flow reduces its attachment.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// −loss·m in the level of the flow, time·ṁ = |ṡ| − m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unrest {
    /// Strength (s).
    pub loss: f64,
    /// Decay time constant (s).
    pub time: f64,
}

impl Physics for Unrest {
    const NAME: &'static str = "unrest";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("loss", "s", Limits::FINITE, |e| &mut e.loss),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            loss: rng.random_range(0.03..0.08),
            time: log_uniform(rng, 0.10, 0.60),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
}

impl Hidden for Unrest {
    fn truth(&self) -> Truth {
        Truth::new(Port::Flow, &[&format!("memory of rate ({} s)", self.time)])
    }
}

impl FlowPart for Unrest {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        -self.loss * z
    }

    fn memory_rate(&self, _s: f64, s_dot: f64, z: f64) -> f64 {
        (s_dot.abs() - z) / self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn it_slows_the_rise_and_calms_down() {
        let law = Unrest {
            loss: 0.05,
            time: 0.2,
        };
        let mut flow = flow([law.at_rest()]);
        let s = hold(&mut flow, 1.0, 0.08);
        assert!(s < 0.85 && s > 0.5, "{s}");
        assert!((hold(&mut flow, 1.0, 5.0) - 1.0).abs() < 1e-6);
    }
}

//! Bouc–Wen hysteresis in the drive.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::BasePlant;
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// ż = A·ṡ − β·|ṡ|·z − γ·ṡ·|z|, −α·z in the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoucWenHysteresis {
    /// A, the initial slope of the loop (1 by convention, because only α·A is identifiable) (-).
    pub stiffness: f64,
    /// β, saturation rate of the loop (1/y).
    pub beta: f64,
    /// γ, shape of the loop (1/y).
    pub gamma: f64,
    /// α, weight of the loop in the drive (-).
    pub alpha: f64,
}

impl Physics for BoucWenHysteresis {
    const NAME: &'static str = "bouc-wen-hysteresis";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("stiffness", "-", Limits::FINITE, |e| &mut e.stiffness),
        Card::new("beta", "1/y", Limits::FINITE, |e| &mut e.beta),
        Card::new("gamma", "1/y", Limits::FINITE, |e| &mut e.gamma),
        Card::new("alpha", "-", Limits::FINITE, |e| &mut e.alpha),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            stiffness: 1.0,
            beta: rng.random_range(2.0..6.0),
            gamma: rng.random_range(0.0..2.0),
            alpha: rng.random_range(0.5..1.2),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
}

impl FlowPart for BoucWenHysteresis {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        -(self.alpha * z)
    }

    fn memory_rate(&self, _s: f64, s_dot: f64, z: f64) -> f64 {
        self.stiffness * s_dot - self.beta * s_dot.abs() * z - self.gamma * s_dot * z.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn bouc_wen_remembers_the_direction_of_travel() {
        let effect = BoucWenHysteresis {
            stiffness: 1.0,
            beta: 3.0,
            gamma: 1.0,
            alpha: 0.5,
        };
        let mut flow = flow([effect.at_rest()]);
        let s = hold(&mut flow, 1.0, 3.0);
        // Loading from rest: z = (1 − exp(−(β+γ)·s))/(β+γ).
        let z = (1.0 - (-4.0 * s).exp()) / 4.0;
        assert!((s + 0.5 * z - 1.0).abs() < 1e-6);
        assert!(
            hold(&mut flow, 0.0, 5.0) > 0.01,
            "it does not come back to 0"
        );
    }
}

//! The mass balance of a reattaching separation bubble.
//!
//! J. K. Eaton and J. P. Johnston, Low frequency unsteadyness of a reattaching turbulent shear layer, Turbulent
//! Shear Flows 3, Springer 1982, 162–170: the shear layer takes mass out of the bubble by entrainment, the backflow
//! at reattachment brings it back, and an imbalance of the two fills or empties the bubble. F. Stella, N. Mazellier,
//! P. Joseph and A. Kourta, arXiv 1807.10742 (2018): entrainment scales with the recirculation length, and jets
//! raise it. With ℓ the length of the bubble over its length without jets:
//!
//! τ·ℓ̇ = 1 − ℓ·(1 + k·j)
//!
//! From the publication: M. Kiya and K. Sasaki, Structure of a turbulent separation bubble, Journal of Fluid
//! Mechanics 137 (1983), 83–113, put the slow unsteadiness of the bubble at f·x_R/U = 0.12: τ = x_R/(2π·0.12·U).
//! Our choice: jets that raise entrainment by 0.4 to 0.8, x_R/U of 50–90 ms, and the reading: a film at 0.82 of the
//! bubble's length, whose friction turns from backflow to attached over a tenth of x_R as the reattachment passes.
//! The jets travel from the slot with the shear layer, at half of U.

use super::{Flow, Published, STEP_S};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::f64::consts::TAU;

pub(super) const PUBLISHED: Published = Published {
    name: "reattaching-bubble",
    reference: "Kiya & Sasaki 1983, J. Fluid Mech. 137, 83; Stella et al. 2018",
    also_right: &["hot-film-nonlinearity"],
    draw: |rng| Box::new(ReattachingBubble::draw(rng)),
};

/// f·x_R/U of the slow unsteadiness.
const STROUHAL: f64 = 0.12;
const FILM: f64 = 0.82;
const WIDTH: f64 = 0.10;

/// The length of the bubble.
#[derive(Clone, Debug)]
pub struct ReattachingBubble {
    passage_s: f64,
    entrained: f64,
    delay_s: f64,
    delayed: VecDeque<f64>,
    length: f64,
}

/// Friction at the film for a reattachment length `length`.
fn friction(length: f64) -> f64 {
    ((FILM - length) / WIDTH).tanh()
}

impl ReattachingBubble {
    fn new(passage_s: f64, entrained: f64, delay_s: f64) -> Self {
        Self {
            passage_s,
            entrained,
            delay_s,
            delayed: VecDeque::from(vec![0.0; (delay_s / STEP_S).round() as usize]),
            length: 1.0,
        }
    }

    fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self::new(
            rng.random_range(0.050..0.090),
            rng.random_range(0.4..0.8),
            rng.random_range(0.030..0.060),
        )
    }

    fn balance_s(&self) -> f64 {
        self.passage_s / (TAU * STROUHAL)
    }
}

impl Flow for ReattachingBubble {
    fn step(&mut self, jet: f64) {
        self.delayed.push_back(jet);
        let j = self.delayed.pop_front().unwrap_or(jet);
        let filling = 1.0 - self.length * (1.0 + self.entrained * j);
        self.length += STEP_S / self.balance_s() * filling;
    }

    fn reading(&self) -> f64 {
        let (rest, blown) = (friction(1.0), friction(1.0 / (1.0 + self.entrained)));
        (friction(self.length) - rest) / (blown - rest)
    }

    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("passage_s", self.passage_s),
            ("entrained_by_jets", self.entrained),
            ("delay_s", self.delay_s),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weak forcing at f·x_R/U = 0.12 gives 1/√2 of the static amplitude with a phase lag of 45°.
    #[test]
    fn the_bubble_follows_slow_forcing_up_to_the_published_strouhal_number() {
        let (passage, weak) = (0.06, 1e-3);
        let mut flow = ReattachingBubble::new(passage, weak, 0.0);
        let frequency = STROUHAL / passage;
        let steps = (20.0 / frequency / STEP_S) as usize;
        let (mut sine, mut cosine) = (0.0, 0.0);
        for k in 0..steps {
            let phase = TAU * frequency * k as f64 * STEP_S;
            flow.step(phase.sin());
            if k >= steps / 2 {
                sine += (1.0 - flow.length) * phase.sin();
                cosine += (1.0 - flow.length) * phase.cos();
            }
        }
        let size = 2.0 * sine.hypot(cosine) / (steps / 2) as f64;
        assert!((size / weak - 0.5_f64.sqrt()).abs() < 0.01, "{size}");
        assert!((cosine / sine + 1.0).abs() < 0.02, "{cosine} {sine}");
    }
}

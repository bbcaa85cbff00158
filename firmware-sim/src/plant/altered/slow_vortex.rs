//! A starting vortex with a finite roll-up time.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics, StartingVortex};
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};

/// Each rise of the jet adds gain·(e^(−t/τ) − e^(−t/τ_r)) per rise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowVortex {
    /// Strength (-).
    pub gain: f64,
    /// Time constant of its decay, τ (s).
    pub decay_time: f64,
    /// Roll-up time constant, τ_r (s).
    pub rise_time: f64,
}

impl Physics for SlowVortex {
    const NAME: &'static str = "slow-vortex";
    const RESEMBLES: &'static str = StartingVortex::NAME;
    const PLACE: Place = Place::Shedding;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("gain", "-", Limits::FINITE, |e| &mut e.gain),
        Card::new("decay_time", "s", Limits::TIME, |e| &mut e.decay_time),
        Card::new("rise_time", "s", Limits::TIME, |e| &mut e.rise_time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: rng.random_range(0.6..1.2),
            decay_time: log_uniform(rng, 0.035, 0.080),
            rise_time: log_uniform(rng, 0.003, 0.008),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Vortex {
            law: *self,
            decaying: 0.0,
            rising: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Vortex {
    law: SlowVortex,
    decaying: f64,
    rising: f64,
}

impl Vortex {
    fn fed(&mut self, rise: f64) {
        self.decaying += rise.max(0.0);
        self.rising += rise.max(0.0);
    }
}

impl JetPart for Vortex {
    fn jump(&mut self, _t: f64, from: f64, to: f64) -> f64 {
        self.fed(to - from);
        to
    }

    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        self.decaying *= (-piece.dt / self.law.decay_time).exp();
        self.rising *= (-piece.dt / self.law.rise_time).exp();
        self.fed(piece.to - piece.from);
        piece.to
    }

    fn shed(&self) -> f64 {
        self.law.gain * (self.decaying - self.rising)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn it_rolls_up_and_decays_after_switching_on_only() {
        let law = SlowVortex {
            gain: 0.8,
            decay_time: 0.05,
            rise_time: 0.005,
        };
        let mut jet = jet([law.at_rest()]);
        jet.command(1.0);
        let expected = |t: f64| 1.0 + 0.8 * ((-t / 0.05).exp() - (-t / 0.005).exp());
        for t in [0.002, 0.01, 0.1] {
            assert!((run(&mut jet, t) - expected(t)).abs() < 1e-9);
        }
        run(&mut jet, 2.0);
        jet.command(0.0);
        assert!(run(&mut jet, 2.01).abs() < 1e-9);
    }
}

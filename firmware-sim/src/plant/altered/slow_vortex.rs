//! A starting vortex with a finite roll-up time.

use crate::plant::base::log_uniform;
use crate::plant::effects::StartingVortex;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// Each rise of the jet adds gain·(e^(−t/τ) − e^(−t/τ_r)) times the height of the rise.
    SlowVortex = "slow-vortex" at Shedding, like StartingVortex
    parameters(_, rng) {
        /// Strength.
        gain ["-", FINITE] = rng.random_range(0.6..1.2);
        /// Time constant of the vortex's decay, τ.
        decay_time ["s", TIME] = log_uniform(rng, 0.035, 0.080);
        /// Roll-up time constant, τ_r.
        rise_time ["s", TIME] = log_uniform(rng, 0.003, 0.008);
    }
    part(law, _) {
        Part::Jet(Box::new(Vortex {
            law: *law,
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

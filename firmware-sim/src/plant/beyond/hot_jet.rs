//! Valve heating: blowing heats the valve, whose strength decreases and recovers over seconds.

use super::{MEMORY_PER_WINDOW, Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// The jet has the strength 1 − loss·h²/(h² + knee²), with the heat h of the valve: time·ḣ = u
    /// − h.
    HotJet = "hot-jet" at Plenum
    parameters(_, rng) {
        /// Largest loss.
        loss ["-", FINITE] = rng.random_range(0.35..0.65);
        /// Time constant of heating and cooling.
        time ["s", TIME] = log_uniform(rng, 0.5, 2.0);
        /// Heat at which half of the loss occurs. Under steady blowing the heat becomes 1.
        knee ["-", POSITIVE] = rng.random_range(0.3..0.6);
    }
    part(law, _) {
        Part::Jet(Box::new(Valve {
            law: *law,
            heat: 0.0,
        }))
    }
    truth(law) {
        let memory = format!("memory of u ({} s)", law.time);
        let window = format!("blowing in the last {} s", law.time / MEMORY_PER_WINDOW);
        Truth::new(Port::Jet, &[&memory, &window])
    }
}

#[derive(Debug, Clone)]
struct Valve {
    law: HotJet,
    heat: f64,
}

impl JetPart for Valve {
    fn jump(&mut self, _t: f64, _from: f64, to: f64) -> f64 {
        let square = self.heat * self.heat;
        to * (1.0 - self.law.loss * square / (square + self.law.knee * self.law.knee))
    }

    /// Exact for a jet that is constant over the piece.
    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        let mean = 0.5 * (piece.from + piece.to);
        self.heat = mean + (self.heat - mean) * (-piece.dt / self.law.time).exp();
        self.jump(t, piece.from, piece.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::strength::bench::strengths;

    #[test]
    fn it_weakens_under_blowing_and_recovers_at_rest() {
        let law = HotJet {
            loss: 0.4,
            time: 0.5,
            knee: 0.5,
        };
        let seen = strengths(law.at_rest(), &[0.1, 5.1, 5.6], &[0.101, 5.0, 5.6]);
        assert!(seen[0] > 0.999, "{seen:?}");
        assert!((seen[1] - (1.0 - 0.4 / 1.25)).abs() < 1e-3, "{seen:?}");
        let square = (-2.0_f64).exp();
        let recovered = 1.0 - 0.4 * square / (square + 0.25);
        assert!((seen[2] - recovered).abs() < 1e-3, "{seen:?}");
    }
}

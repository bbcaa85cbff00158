//! A jet whose strength depends on the history of pulses.

use std::fmt::Debug;

use super::pulses::Pulses;
use crate::plant::part::{JetPart, Part, Piece};

/// The law of the jet's strength.
pub(super) trait StrengthLaw: Copy + Debug + Send + Sync + 'static {
    /// Strength of the jet at `t`, relative to the nominal jet.
    fn strength(&self, pulses: &Pulses, t: f64) -> f64;
}

/// A part of the jet path with this law.
pub(super) fn jet(law: impl StrengthLaw) -> Part {
    Part::Jet(Box::new(Pulsing {
        law,
        pulses: Pulses::default(),
    }))
}

#[derive(Debug, Clone)]
struct Pulsing<L> {
    law: L,
    pulses: Pulses,
}

impl<L: StrengthLaw> JetPart for Pulsing<L> {
    fn jump(&mut self, t: f64, _from: f64, to: f64) -> f64 {
        self.pulses.see(t, to);
        to * self.law.strength(&self.pulses, t)
    }

    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        piece.to * self.law.strength(&self.pulses, t)
    }
}

/// For tests: jet strengths during a switching sequence.
#[cfg(test)]
pub(super) mod bench {
    use super::Part;
    use crate::plant::jet::bench::{jet, run};

    /// The jet's strength at the times `at`; the coil is switched on and off in turn at the times `on`.
    pub(in super::super) fn strengths(part: Part, switching: &[f64], at: &[f64]) -> Vec<f64> {
        let mut jet = jet([part]);
        let mut switching = switching.iter().copied().peekable();
        let mut level = 0.0;
        let mut seen = Vec::new();
        for &t in at {
            while let Some(edge) = switching.next_if(|edge| *edge <= t) {
                run(&mut jet, edge);
                level = 1.0 - level;
                jet.command(level);
            }
            seen.push(run(&mut jet, t));
        }
        seen
    }
}

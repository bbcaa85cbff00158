//! Common part of starting and stopping vortices: driven by one kind of edge, decaying, added to the jet.

use crate::plant::part::{JetPart, Piece};

#[derive(Debug, Clone)]
pub(super) struct Vortex {
    gain: f64,
    decay_s: f64,
    /// +1 for a vortex of an increasing jet, −1 for a vortex of a decreasing jet: the sign of its contribution.
    sign: f64,
    strength: f64,
}

impl Vortex {
    /// A vortex of an increasing jet, which adds to the jet.
    pub(super) fn starting(gain: f64, decay_s: f64) -> Self {
        Self {
            gain,
            decay_s,
            sign: 1.0,
            strength: 0.0,
        }
    }

    /// A vortex of a decreasing jet, which is subtracted from the jet.
    pub(super) fn stopping(gain: f64, decay_s: f64) -> Self {
        Self {
            sign: -1.0,
            ..Self::starting(gain, decay_s)
        }
    }
}

impl JetPart for Vortex {
    fn jump(&mut self, _t: f64, from: f64, to: f64) -> f64 {
        self.strength += (self.sign * (to - from)).max(0.0);
        to
    }

    /// ẇ = −w/τ + max(±dj/dt, 0), exact for a linear jet.
    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        let left = (-piece.dt / self.decay_s).exp();
        let feed = (self.sign * (piece.to - piece.from) / piece.dt).max(0.0);
        self.strength = self.strength * left + feed * self.decay_s * (1.0 - left);
        piece.to
    }

    fn shed(&self) -> f64 {
        self.sign * self.gain * self.strength
    }
}

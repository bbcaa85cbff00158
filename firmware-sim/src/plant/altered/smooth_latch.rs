//! Self-sustained attachment without a sharp threshold.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::BasePlant;
use crate::plant::effects::{AttachmentHysteresis, Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Place, Surroundings};

/// settling·λ̇ = ½ + ½·tanh((s − centre + half·(2λ − 1))/width) − λ; gain·λ is added to the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothLatch {
    /// Centre of the hysteresis (y).
    pub centre: f64,
    /// Half width of the hysteresis (y).
    pub half_width: f64,
    /// Width of the transition (y).
    pub softness: f64,
    /// Contribution of the closed latch to the drive (y).
    pub gain: f64,
    /// Time constant of the latch (s).
    pub settling_time: f64,
}

impl Physics for SmoothLatch {
    const NAME: &'static str = "smooth-latch";
    const RESEMBLES: &'static str = AttachmentHysteresis::NAME;
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("centre", "y", Limits::FINITE, |e| &mut e.centre),
        Card::new("half_width", "y", Limits::FINITE, |e| &mut e.half_width),
        Card::new("softness", "y", Limits::POSITIVE, |e| &mut e.softness),
        Card::new("gain", "y", Limits::FINITE, |e| &mut e.gain),
        Card::new("settling_time", "s", Limits::TIME, |e| &mut e.settling_time),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        let lower = rng.random_range(0.25..0.40) * base.gain;
        let upper = rng.random_range(0.55..0.75) * base.gain;
        Self {
            centre: 0.5 * (lower + upper),
            half_width: 0.5 * (upper - lower),
            softness: rng.random_range(0.04..0.08) * base.gain,
            // The latch must release without a jet.
            gain: rng.random_range(0.5..0.75) * lower,
            settling_time: rng.random_range(0.002..0.008),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(*self))
    }
}

impl FlowPart for SmoothLatch {
    fn drive(&self, _s: f64, z: f64) -> f64 {
        self.gain * z
    }

    fn memory_rate(&self, s: f64, _s_dot: f64, z: f64) -> f64 {
        let over = s - self.centre + self.half_width * (2.0 * z - 1.0);
        (0.5 + 0.5 * (over / self.softness).tanh() - z) / self.settling_time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn a_half_open_jet_settles_at_two_levels_and_the_lock_lets_go() {
        let latch = SmoothLatch {
            centre: 0.5,
            half_width: 0.2,
            softness: 0.05,
            gain: 0.2,
            settling_time: 0.005,
        };
        let mut flow = flow([latch.at_rest()]);
        assert!((hold(&mut flow, 0.55, 2.0) - 0.55).abs() < 0.01);
        assert!((hold(&mut flow, 1.0, 2.0) - 1.2).abs() < 1e-3);
        assert!((hold(&mut flow, 0.55, 2.0) - 0.75).abs() < 0.01);
        assert!(hold(&mut flow, 0.0, 3.0).abs() < 1e-3);
    }
}

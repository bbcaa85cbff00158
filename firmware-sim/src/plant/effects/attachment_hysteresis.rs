//! Hysteresis of attachment.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::BasePlant;
use crate::plant::part::{FlowPart, Part, Piece, Place, Surroundings};

/// A relay with two thresholds, added to the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttachmentHysteresis {
    /// Friction above which the flow attaches (y).
    pub upper_threshold: f64,
    /// Friction below which it detaches (y).
    pub lower_threshold: f64,
    /// Contribution of the closed relay to the drive (y).
    pub gain: f64,
}

impl Physics for AttachmentHysteresis {
    const NAME: &'static str = "attachment-hysteresis";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("upper_threshold", "y", Limits::FINITE, |e| {
            &mut e.upper_threshold
        }),
        Card::new("lower_threshold", "y", Limits::FINITE, |e| {
            &mut e.lower_threshold
        }),
        Card::new("gain", "y", Limits::FINITE, |e| &mut e.gain),
    ];

    fn draw(base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        let lower_threshold = rng.random_range(0.25..0.40) * base.gain;
        Self {
            upper_threshold: rng.random_range(0.55..0.75) * base.gain,
            lower_threshold,
            // Without a jet the relay must release: gain below the lower threshold.
            gain: rng.random_range(0.5..0.75) * lower_threshold,
        }
    }

    fn conflict(&self) -> Option<(&'static str, &'static str)> {
        (self.lower_threshold >= self.upper_threshold)
            .then_some(("lower_threshold", "below upper_threshold"))
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(Relay {
            levels: *self,
            attached: false,
        }))
    }
}

#[derive(Debug, Clone)]
struct Relay {
    levels: AttachmentHysteresis,
    attached: bool,
}

impl FlowPart for Relay {
    fn drive(&self, _s: f64, _z: f64) -> f64 {
        if self.attached { self.levels.gain } else { 0.0 }
    }

    fn passed(&mut self, _jet: &Piece, s: f64) {
        if s > self.levels.upper_threshold {
            self.attached = true;
        } else if s < self.levels.lower_threshold {
            self.attached = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::Effect;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_relay_locks_on_and_lets_go_at_different_friction() {
        let relay = AttachmentHysteresis {
            upper_threshold: 0.7,
            lower_threshold: 0.3,
            gain: 0.2,
        };
        let mut flow = flow([relay.at_rest()]);
        // Below the threshold there is no difference; a half-open jet has two steady levels.
        assert!((hold(&mut flow, 0.6, 2.0) - 0.6).abs() < 1e-6);
        assert!((hold(&mut flow, 1.0, 2.0) - 1.2).abs() < 1e-6);
        assert!((hold(&mut flow, 0.6, 2.0) - 0.8).abs() < 1e-6);
        // Without a jet the friction relaxes towards the gain, reaches 0.3 and the relay releases.
        assert!(hold(&mut flow, 0.0, 3.0).abs() < 1e-6);
    }

    #[test]
    fn thresholds_in_the_wrong_order_are_refused() {
        let relay = Effect::from(AttachmentHysteresis {
            upper_threshold: 0.3,
            lower_threshold: 0.4,
            gain: 0.1,
        });
        assert!(relay.validate().is_err());
    }
}

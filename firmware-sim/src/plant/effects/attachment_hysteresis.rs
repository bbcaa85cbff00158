//! Hysteresis of attachment.

use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Piece};

physics! {
    /// A relay with two thresholds, added to the drive.
    AttachmentHysteresis = "attachment-hysteresis" at Flow {
        fn conflict(&self) -> Option<(&'static str, &'static str)> {
            (self.lower_threshold >= self.upper_threshold)
                .then_some(("lower_threshold", "below upper_threshold"))
        }
    }
    parameters(base, rng) {
        /// Friction above which the flow attaches.
        upper_threshold ["y", FINITE] = rng.random_range(0.55..0.75) * base.gain;
        /// Friction below which the flow detaches.
        lower_threshold ["y", FINITE] = lower_threshold;
        /// Contribution of the closed relay to the drive.
        // Without a jet the relay must release, so the gain is below the lower threshold.
        gain ["y", FINITE] = rng.random_range(0.5..0.75) * lower_threshold;
    }
    where { let lower_threshold = rng.random_range(0.25..0.40) * base.gain; }
    part(law, _) {
        Part::Flow(Box::new(Relay {
            levels: *law,
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
        // Below the threshold the effect makes no difference. With a half-open jet the flow has two
        // steady levels.
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

//! Self-sustained attachment without a sharp threshold.

use crate::plant::effects::AttachmentHysteresis;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part};

physics! {
    /// settling·λ̇ = ½ + ½·tanh((s − centre + half·(2λ − 1))/width) − λ; gain·λ is added to the drive.
    SmoothLatch = "smooth-latch" at Flow, like AttachmentHysteresis
    parameters(base, rng) {
        /// Centre of the hysteresis.
        centre ["y", FINITE] = 0.5 * (lower + upper);
        /// Half width of the hysteresis.
        half_width ["y", FINITE] = 0.5 * (upper - lower);
        /// Width of the transition.
        softness ["y", POSITIVE] = rng.random_range(0.04..0.08) * base.gain;
        /// Contribution of the closed latch to the drive.
        // The latch must release without a jet.
        gain ["y", FINITE] = rng.random_range(0.5..0.75) * lower;
        /// Time constant of the latch.
        settling_time ["s", TIME] = rng.random_range(0.002..0.008);
    }
    where {
        let lower = rng.random_range(0.25..0.40) * base.gain;
        let upper = rng.random_range(0.55..0.75) * base.gain;
    }
    part(law, _) { Part::Flow(Box::new(*law)) }
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

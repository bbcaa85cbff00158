//! A damped oscillation excited by the arriving jet and added to the friction.

use std::f64::consts::TAU;

use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Piece};

physics! {
    /// q̈ = ω²·(j − q) − 2ζω·q̇; the film measures s + gain·(q − j).
    VortexShedding = "vortex-shedding" at Flow
    parameters(_, rng) {
        /// Undamped natural frequency.
        frequency ["Hz", FREQUENCY] = log_uniform(rng, 5.0, 30.0);
        /// ζ, below 1 for an oscillation.
        damping_ratio ["-", NOT_NEGATIVE] = rng.random_range(0.06..0.25);
        /// Amplitude of the oscillation.
        gain ["y", FINITE] = rng.random_range(0.12..0.30);
    }
    part(law, _) {
        Part::Flow(Box::new(Ringing {
            omega: TAU * law.frequency,
            damping_ratio: law.damping_ratio,
            gain: law.gain,
            q: 0.0,
            q_dot: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Ringing {
    /// ω (rad/s)
    omega: f64,
    damping_ratio: f64,
    gain: f64,
    q: f64,
    q_dot: f64,
}

impl FlowPart for Ringing {
    /// Runge–Kutta of order 4, independent of the flow.
    fn passed(&mut self, jet: &Piece, _s: f64) {
        let (dt, j0, j1) = (jet.dt, jet.from, jet.to);
        let jm = 0.5 * (j0 + j1);
        let pull = |q: f64, v: f64, j: f64| {
            self.omega * (self.omega * (j - q) - 2.0 * self.damping_ratio * v)
        };
        let (q, v) = (self.q, self.q_dot);
        let k1 = (v, pull(q, v, j0));
        let k2 = (
            v + 0.5 * dt * k1.1,
            pull(q + 0.5 * dt * k1.0, v + 0.5 * dt * k1.1, jm),
        );
        let k3 = (
            v + 0.5 * dt * k2.1,
            pull(q + 0.5 * dt * k2.0, v + 0.5 * dt * k2.1, jm),
        );
        let k4 = (v + dt * k3.1, pull(q + dt * k3.0, v + dt * k3.1, j1));
        self.q = q + dt / 6.0 * (k1.0 + 2.0 * (k2.0 + k3.0) + k4.0);
        self.q_dot = v + dt / 6.0 * (k1.1 + 2.0 * (k2.1 + k3.1) + k4.1);
    }

    fn at_the_film(&self, jet: f64) -> f64 {
        self.gain * (self.q - jet)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn shedding_rings_at_its_frequency_around_the_arriving_jet() {
        let effect = VortexShedding {
            frequency: 12.0,
            damping_ratio: 0.1,
            gain: 0.2,
        };
        let mut flow = flow([effect.at_rest()]);
        let t = 0.053_f64;
        let s = hold(&mut flow, 1.0, t);
        let omega = TAU * 12.0;
        let damped = omega * (1.0_f64 - 0.01).sqrt();
        let error = -(-0.1 * omega * t).exp()
            * ((damped * t).cos() + 0.1 * omega / damped * (damped * t).sin());
        assert!((flow.at_the_film() - s - 0.2 * error).abs() < 1e-6);
    }
}

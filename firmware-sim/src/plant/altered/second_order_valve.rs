//! A valve with mass and spring.

use std::f64::consts::TAU;

use crate::plant::effects::ValveLag;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// v̈ = ω²·(u − v) − 2ζω·v̇.
    SecondOrderValve = "second-order-valve" at Valve, like ValveLag
    parameters(_, rng) {
        /// Undamped natural frequency.
        frequency ["Hz", POSITIVE] = rng.random_range(6.0..16.0);
        /// ζ.
        damping_ratio ["-", NOT_NEGATIVE] = rng.random_range(0.7..1.1);
    }
    part(law, _) {
        Part::Jet(Box::new(Valve {
            omega: TAU * law.frequency,
            damping_ratio: law.damping_ratio,
            opening: 0.0,
            speed: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Valve {
    omega: f64,
    damping_ratio: f64,
    opening: f64,
    speed: f64,
}

impl JetPart for Valve {
    fn jump(&mut self, _t: f64, _from: f64, _to: f64) -> f64 {
        self.opening
    }

    /// Midpoint rule: a sub-step is a thousandth of the period.
    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        let pull = |v: f64, v_dot: f64| {
            self.omega * (self.omega * (piece.to - v) - 2.0 * self.damping_ratio * v_dot)
        };
        let half = 0.5 * piece.dt;
        let v = self.opening + half * self.speed;
        let v_dot = self.speed + half * pull(self.opening, self.speed);
        self.speed += piece.dt * pull(v, v_dot);
        self.opening += piece.dt * v_dot;
        self.opening
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn critically_damped_it_opens_by_its_closed_form() {
        let valve = SecondOrderValve {
            frequency: 10.0,
            damping_ratio: 1.0,
        };
        let mut jet = jet([valve.at_rest()]);
        jet.command(1.0);
        let (t, omega) = (0.03, TAU * 10.0);
        let expected = 1.0 - (1.0 + omega * t) * (-omega * t).exp();
        assert!((run(&mut jet, t) - expected).abs() < 1e-5);
        assert!((run(&mut jet, 2.0) - 1.0).abs() < 1e-9);
    }
}

//! A valve with a dead time and constant travel speed.

use std::collections::VecDeque;

use crate::plant::effects::ValveLag;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// After a dead time the opening moves to the commanded level at constant speed.
    RampValve = "ramp-valve" at Valve, like ValveLag
    parameters(_, rng) {
        /// Dead time.
        dead_time ["s", TRAVEL] = rng.random_range(0.002..0.008);
        /// Time from closed to open.
        opening_time ["s", TIME] = rng.random_range(0.020..0.045);
        /// Time from open to closed.
        closing_time ["s", TIME] = rng.random_range(0.025..0.070);
    }
    part(law, _) {
        Part::Jet(Box::new(Valve {
            law: *law,
            target: 0.0,
            opening: 0.0,
            waiting: VecDeque::new(),
        }))
    }
}

#[derive(Debug, Clone)]
struct Valve {
    law: RampValve,
    target: f64,
    opening: f64,
    /// Delayed command levels with their times.
    waiting: VecDeque<(f64, f64)>,
}

impl JetPart for Valve {
    fn jump(&mut self, t: f64, from: f64, to: f64) -> f64 {
        if to != from {
            self.waiting.push_back((t + self.law.dead_time, to));
        }
        self.opening
    }

    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        let left = self.target - self.opening;
        let travel = if left > 0.0 {
            piece.dt / self.law.opening_time
        } else {
            piece.dt / self.law.closing_time
        };
        self.opening += left.clamp(-travel, travel);
        self.opening
    }

    fn next_event(&self) -> Option<f64> {
        self.waiting.front().map(|(t, _)| *t)
    }

    fn event(&mut self) {
        if let Some((_, level)) = self.waiting.pop_front() {
            self.target = level;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn it_waits_travels_and_stays() {
        let valve = RampValve {
            dead_time: 0.004,
            opening_time: 0.02,
            closing_time: 0.05,
        };
        let mut jet = jet([valve.at_rest()]);
        jet.command(1.0);
        assert_eq!(run(&mut jet, 0.004), 0.0);
        assert!((run(&mut jet, 0.014) - 0.5).abs() < 1e-9);
        assert!((run(&mut jet, 0.1) - 1.0).abs() < 1e-9);
        jet.command(0.0);
        assert!((run(&mut jet, 0.114) - 0.8).abs() < 1e-9);
        assert!(run(&mut jet, 0.3).abs() < 1e-9);
    }
}

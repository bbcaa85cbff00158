//! A valve with a dead time and constant travel speed.

use std::collections::VecDeque;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics, ValveLag};
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};

/// After a dead time the opening moves to the commanded level at constant speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RampValve {
    /// Dead time (s).
    pub dead_time: f64,
    /// Time from closed to open (s).
    pub opening_time: f64,
    /// Time from open to closed (s).
    pub closing_time: f64,
}

impl Physics for RampValve {
    const NAME: &'static str = "ramp-valve";
    const RESEMBLES: &'static str = ValveLag::NAME;
    const PLACE: Place = Place::Valve;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("dead_time", "s", Limits::TRAVEL, |e| &mut e.dead_time),
        Card::new("opening_time", "s", Limits::TIME, |e| &mut e.opening_time),
        Card::new("closing_time", "s", Limits::TIME, |e| &mut e.closing_time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            dead_time: rng.random_range(0.002..0.008),
            opening_time: rng.random_range(0.020..0.045),
            closing_time: rng.random_range(0.025..0.070),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Valve {
            law: *self,
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

//! A supply line that empties at rest and has to be refilled.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::line::{LineLaw, line};
use super::pulses::Pulses;
use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, Surroundings};

/// more·(1 − exp(−rest/time)) on top of the transport delay, for the whole pulse after that rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestLine {
    /// Additional delay after an infinitely long rest (s).
    pub more: f64,
    /// Time constant of emptying (s).
    pub time: f64,
}

impl Physics for RestLine {
    const NAME: &'static str = "rest-line";
    const PLACE: Place = Place::Line;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("more", "s", Limits::TRAVEL, |e| &mut e.more),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            more: rng.random_range(0.012..0.030),
            time: log_uniform(rng, 0.06, 0.25),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        line(*self)
    }
}

impl Hidden for RestLine {
    fn truth(&self) -> Truth {
        Truth::new(Port::Delay, &["rest before"])
    }
}

impl LineLaw for RestLine {
    fn takes(&self, pulses: &Pulses, _t: f64) -> f64 {
        self.more * (1.0 - (-pulses.rest_before() / self.time).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::line::bench::arrivals;

    #[test]
    fn a_pulse_after_a_long_rest_comes_later() {
        let law = RestLine {
            more: 0.02,
            time: 0.1,
        };
        let arrived = arrivals(law.at_rest(), &[0.1, 0.2, 0.25, 0.4]);
        let short = 0.02 * (1.0 - (-0.5_f64).exp());
        let expected = [0.12, 0.22, 0.25 + short, 0.4 + short];
        assert_eq!(arrived.len(), 4);
        for (a, e) in arrived.iter().zip(expected) {
            assert!((a - e).abs() < 1e-9, "{arrived:?}");
        }
    }
}

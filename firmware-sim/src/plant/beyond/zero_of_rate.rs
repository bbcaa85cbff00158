//! A sensor offset caused by rapid changes.

use rand_chacha::ChaCha8Rng;

use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics, signed};
use crate::plant::part::{Part, Piece, Place, SensorPart, Surroundings};

/// gain·m on the reading, time·ṁ = |ṡ| − m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZeroOfRate {
    /// Strength (s).
    pub gain: f64,
    /// Decay time constant (s).
    pub time: f64,
}

impl Physics for ZeroOfRate {
    const NAME: &'static str = "zero-of-rate";
    const PLACE: Place = Place::Zero;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("gain", "s", Limits::FINITE, |e| &mut e.gain),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: signed(rng, 0.02, 0.06),
            time: log_uniform(rng, 0.10, 0.80),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(Shaken {
            law: *self,
            unrest: 0.0,
        }))
    }
}

impl Hidden for ZeroOfRate {
    fn truth(&self) -> Truth {
        Truth::new(
            Port::Sensor,
            &[&format!("memory of rate ({} s)", self.time)],
        )
    }
}

#[derive(Debug, Clone)]
struct Shaken {
    law: ZeroOfRate,
    unrest: f64,
}

impl SensorPart for Shaken {
    fn takes_time(&self) -> bool {
        true
    }

    fn jump(&mut self, to: f64) -> f64 {
        to + self.law.gain * self.unrest
    }

    /// Exact for piecewise linear signals.
    fn advance(&mut self, piece: &Piece) -> f64 {
        let rate = (piece.to - piece.from).abs() / piece.dt;
        self.unrest = rate + (self.unrest - rate) * (-piece.dt / self.law.time).exp();
        self.jump(piece.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn motion_of_either_sign_lifts_the_zero_which_sinks_again() {
        let law = ZeroOfRate {
            gain: 0.1,
            time: 0.2,
        };
        let mut sensor = sensor([law.at_rest()]);
        sensor.advance(0.4, 0.8);
        let lifted = 0.1 * 2.0 * (1.0 - (-2.0_f64).exp());
        assert!((read(&mut sensor, 0.4, 0.0) - 0.8 - lifted).abs() < 1e-12);
        sensor.advance(0.4, 0.8);
        let left = lifted * (-2.0_f64).exp();
        assert!((read(&mut sensor, 0.8, 0.0) - 0.8 - left).abs() < 1e-12);
    }
}

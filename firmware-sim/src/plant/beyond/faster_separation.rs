//! Faster separation after a long pulse.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pulses::Pulses;
use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{FlowPart, Part, Piece, Place, Surroundings};

/// Without a jet the rate is multiplied by 1 + gain·(1 − exp(−length/time)), with length that of the last
/// pulse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FasterSeparation {
    /// Relative increase after an infinitely long pulse (-).
    pub gain: f64,
    /// Time constant of the pulse length (s).
    pub time: f64,
}

impl Physics for FasterSeparation {
    const NAME: &'static str = "faster-separation";
    const PLACE: Place = Place::Flow;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("gain", "-", Limits::NOT_NEGATIVE, |e| &mut e.gain),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: rng.random_range(0.8..2.5),
            time: log_uniform(rng, 0.10, 0.40),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Flow(Box::new(Blown {
            law: *self,
            time: 0.0,
            pulses: Pulses::default(),
        }))
    }
}

impl Hidden for FasterSeparation {
    fn truth(&self) -> Truth {
        Truth::new(Port::Flow, &["pulse length × y"])
    }
}

#[derive(Debug, Clone)]
struct Blown {
    law: FasterSeparation,
    time: f64,
    pulses: Pulses,
}

impl FlowPart for Blown {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        if self.pulses.is_on() {
            return 0.0;
        }
        let length = self.pulses.length(self.time);
        -self.law.gain * (1.0 - (-length / self.law.time).exp()) * s
    }

    fn arrives(&mut self, jet: f64) {
        self.pulses.see(self.time, jet);
    }

    fn passed(&mut self, jet: &Piece, _s: f64) {
        self.time += jet.dt;
        self.pulses.see(self.time, jet.to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn the_length_of_the_blow_sets_the_rate() {
        let law = FasterSeparation {
            gain: 1.0,
            time: 0.2,
        };
        for length in [0.1_f64, 0.8] {
            let mut flow = flow([law.at_rest()]);
            flow.jump(1.0);
            let s = hold(&mut flow, 1.0, length);
            assert!((s - (1.0 - (-length / 0.04).exp())).abs() < 1e-9);
            flow.jump(0.0);
            let rate = 10.0 * (2.0 - (-length / 0.2).exp());
            let left = hold(&mut flow, 0.0, 0.1);
            assert!((left - s * (-0.1 * rate).exp()).abs() < 1e-9);
        }
    }
}

//! A delay of the valve line that increases during the record.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::line::{LineLaw, line};
use super::pulses::Pulses;
use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, Surroundings};

/// more·(1 − exp(−t/time)) on top of the transport delay, t the time in the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftingLine {
    /// Final additional delay (s).
    pub more: f64,
    /// Time constant of the drift (s).
    pub time: f64,
}

impl Physics for DriftingLine {
    const NAME: &'static str = "drifting-line";
    const PLACE: Place = Place::Line;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("more", "s", Limits::TRAVEL, |e| &mut e.more),
        Card::new("time", "s", Limits::TIME, |e| &mut e.time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            more: rng.random_range(0.012..0.030),
            time: log_uniform(rng, 2.0, 8.0),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        line(*self)
    }
}

impl Hidden for DriftingLine {
    fn truth(&self) -> Truth {
        Truth::new(Port::Delay, &["time in record"])
    }
}

impl LineLaw for DriftingLine {
    fn takes(&self, _pulses: &Pulses, t: f64) -> f64 {
        self.more * (1.0 - (-t / self.time).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::line::bench::arrivals;

    #[test]
    fn edges_take_longer_the_later_they_are_sent() {
        let law = DriftingLine {
            more: 0.02,
            time: 1.0,
        };
        let sent = [0.1, 1.0];
        for (arrived, sent) in arrivals(law.at_rest(), &sent).iter().zip(sent) {
            let expected = sent + 0.02 * (1.0 - (-sent).exp());
            assert!((arrived - expected).abs() < 1e-9);
        }
    }
}

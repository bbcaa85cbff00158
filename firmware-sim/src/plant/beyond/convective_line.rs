//! A jet that is partly convected by the free stream.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::line::{LineLaw, line};
use super::pulses::Pulses;
use super::{Hidden, Port, Truth};
use crate::plant::base::BasePlant;
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::free_stream::FreeStream;
use crate::plant::part::{Part, Place, Surroundings};

/// way·(Ū/U)^exponent in addition to the transport delay, U the measured free stream at the start of the transport.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvectiveLine {
    /// Convection time at the mean free stream (s).
    pub way: f64,
    /// Exponent; 1 if everything moves with the stream (-).
    pub exponent: f64,
}

impl Physics for ConvectiveLine {
    const NAME: &'static str = "convective-line";
    const PLACE: Place = Place::Line;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("way", "s", Limits::TRAVEL, |e| &mut e.way),
        Card::new("exponent", "-", Limits::FINITE, |e| &mut e.exponent),
    ];
    const CHANNEL: Option<&'static str> = Some("u_inf");

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            way: rng.random_range(0.030..0.060),
            exponent: rng.random_range(1.0..2.5),
        }
    }

    fn part(&self, surroundings: &Surroundings<'_>) -> Part {
        line(Way {
            law: *self,
            stream: surroundings.free_stream.cloned(),
        })
    }
}

impl Hidden for ConvectiveLine {
    fn truth(&self) -> Truth {
        Truth::new(Port::Delay, &["u_inf"])
    }
}

#[derive(Debug, Clone)]
struct Way {
    law: ConvectiveLine,
    stream: Option<FreeStream>,
}

impl LineLaw for Way {
    fn takes(&self, _pulses: &Pulses, t: f64) -> f64 {
        let relative = self.stream.as_ref().map_or(0.0, |u| u.relative(t));
        self.law.way * (1.0 + relative).powf(-self.law.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::line::bench::arrivals;
    use rand::SeedableRng;

    #[test]
    fn a_fast_stream_carries_fast() {
        let stream = FreeStream::draw(&mut ChaCha8Rng::seed_from_u64(3), 10_000);
        let surroundings = Surroundings {
            free_stream: Some(&stream),
        };
        let law = ConvectiveLine {
            way: 0.05,
            exponent: 1.0,
        };
        let sent = [0.3, 0.9];
        let arrived = arrivals(law.part(&surroundings), &sent);
        for (arrived, sent) in arrived.iter().zip(sent) {
            let expected = sent + 0.05 * 10.0 / stream.velocity(sent);
            assert!((arrived - expected).abs() < 1e-9);
        }
    }
}

//! A jet that is partly convected by the free stream.

use super::line::{LineLaw, line};
use super::pulses::Pulses;
use super::{Port, Truth};
use crate::plant::effects::physics;
use crate::plant::free_stream::FreeStream;

physics! {
    /// way·(Ū/U)^exponent in addition to the transport delay, U the measured free stream at the start of the transport.
    ConvectiveLine = "convective-line" at Line {
        const CHANNEL: Option<&'static str> = Some("u_inf");
    }
    parameters(_, rng) {
        /// Convection time at the mean free stream.
        way ["s", TRAVEL] = rng.random_range(0.030..0.060);
        /// Exponent; 1 if everything in the line moves with the stream.
        exponent ["-", FINITE] = rng.random_range(1.0..2.5);
    }
    part(law, surroundings) {
        line(Way {
            law: *law,
            stream: surroundings.free_stream.cloned(),
        })
    }
    truth(_) { Truth::new(Port::Delay, &["u_inf"]) }
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
    use crate::plant::effects::Physics;
    use crate::plant::part::Surroundings;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

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

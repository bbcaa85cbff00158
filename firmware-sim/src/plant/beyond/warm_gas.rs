//! A jet that is stronger in warm air.

use super::{Beyond, Port, Truth};
use crate::plant::effects::physics;
use crate::plant::effects::signed;
use crate::plant::free_stream::{FreeStream, MEAN_TEMPERATURE};
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// The jet has the strength 1 + gain·(θ − 20 °C), with the measured temperature θ of the air.
    WarmGas = "warm-gas" at FreeStream {
        const CHANNEL: Option<&'static str> = Some(Beyond::TEMPERATURE);
    }
    parameters(_, rng) {
        /// Relative change of the jet per kelvin.
        gain ["1/K", FINITE] = signed(rng, 0.04, 0.10);
    }
    part(law, surroundings) {
        Part::Jet(Box::new(Gas {
            gain: law.gain,
            air: surroundings.free_stream.cloned(),
        }))
    }
    truth(_) { Truth::new(Port::Jet, &[Beyond::TEMPERATURE]) }
}

#[derive(Debug, Clone)]
struct Gas {
    gain: f64,
    air: Option<FreeStream>,
}

impl Gas {
    fn strength(&self, t: f64) -> f64 {
        let warmer = |air: &FreeStream| air.temperature(t) - MEAN_TEMPERATURE;
        1.0 + self.gain * self.air.as_ref().map_or(0.0, warmer)
    }
}

impl JetPart for Gas {
    fn jump(&mut self, t: f64, _from: f64, to: f64) -> f64 {
        to * self.strength(t)
    }

    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        piece.to * self.strength(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::Physics;
    use crate::plant::jet::bench::{jet, run};
    use crate::plant::part::Surroundings;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn it_follows_the_temperature() {
        let air = FreeStream::draw(&mut ChaCha8Rng::seed_from_u64(3), 10_000);
        let surroundings = Surroundings {
            free_stream: Some(&air),
        };
        let mut jet = jet([WarmGas { gain: 0.05 }.part(&surroundings)]);
        jet.command(1.0);
        for t in [0.5, 1.5, 4.0] {
            let expected = 1.0 + 0.05 * (air.temperature(t) - 20.0);
            assert!((run(&mut jet, t) - expected).abs() < 1e-9);
        }
        let swing = (0..100).map(|k| air.temperature(0.1 * f64::from(k)) - 20.0);
        assert!(swing.fold(0.0_f64, |most, k| most.max(k.abs())) > 1.0);
    }
}

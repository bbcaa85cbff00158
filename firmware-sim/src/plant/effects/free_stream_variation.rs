//! Dependence of the jet's influence on the measured free stream.

use super::signed;
use crate::plant::effects::physics;
use crate::plant::free_stream::FreeStream;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// The strength of the jet is multiplied by 1 + gain·(U/Ū − 1).
    FreeStreamVariation = "free-stream-variation" at FreeStream {
        const CHANNEL: Option<&'static str> = Some("u_inf");
    }
    parameters(_, rng) {
        /// Relative change of the jet per relative change of the free stream.
        gain ["-", FINITE] = signed(rng, 1.0, 3.0);
    }
    part(law, surroundings) {
        Part::Jet(Box::new(Stream {
            gain: law.gain,
            free_stream: surroundings.free_stream.cloned(),
        }))
    }
}

#[derive(Debug, Clone)]
struct Stream {
    gain: f64,
    free_stream: Option<FreeStream>,
}

impl Stream {
    fn factor(&self, t: f64) -> f64 {
        let relative = self.free_stream.as_ref().map_or(0.0, |u| u.relative(t));
        1.0 + self.gain * relative
    }
}

impl JetPart for Stream {
    fn jump(&mut self, t: f64, _from: f64, to: f64) -> f64 {
        to * self.factor(t)
    }

    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        piece.to * self.factor(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::base::BasePlant;
    use crate::plant::rig::bench::base;
    use crate::plant::{FlowDelay, PlantSpec, Rig};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn free_stream_changes_the_level_by_its_gain() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let stream = FreeStream::draw(&mut rng, 10_000);
        let spec = PlantSpec::new(
            BasePlant {
                attach_s: 0.002,
                ..base(FlowDelay::Fixed { delay_s: 0.02 })
            },
            &[FreeStreamVariation { gain: -2.0 }.into()],
        );
        let mut rig = Rig::new(&spec, Some(stream.clone())).unwrap();
        let y = rig.play(&vec![1.0; 10_000]);
        for k in (100..10_000).step_by(100) {
            // A flow with a time constant of 2 ms closely follows the jet, which was issued 22 ms
            // before.
            let expected = 1.0 - 2.0 * (stream.velocity(k as f64 * 1e-3 - 0.022) / 10.0 - 1.0);
            assert!((y[k] - expected).abs() < 1e-4);
        }
    }
}

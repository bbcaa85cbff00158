//! A sensor offset caused by rapid changes.

use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::effects::signed;
use crate::plant::part::{Part, Piece, SensorPart};

physics! {
    /// gain·m on the reading, time·ṁ = |ṡ| − m.
    ZeroOfRate = "zero-of-rate" at Zero
    parameters(_, rng) {
        /// Strength.
        gain ["s", FINITE] = signed(rng, 0.02, 0.06);
        /// Decay time constant.
        time ["s", TIME] = log_uniform(rng, 0.10, 0.80);
    }
    part(law, _) {
        Part::Sensor(Box::new(Shaken {
            law: *law,
            unrest: 0.0,
        }))
    }
    truth(law) {
        Truth::new(
            Port::Sensor,
            &[&format!("memory of rate ({} s)", law.time)],
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

//! Sensor drift while the film's support warms up.

use super::signed;
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// amplitude·(1 − e^(−t/τ)) is added to the reading.
    ThermalDrift = "thermal-drift" at Zero
    parameters(_, rng) {
        /// Final offset.
        amplitude ["y", FINITE] = signed(rng, 0.08, 0.25);
        /// Time constant of the drift.
        time_constant ["s", TIME] = log_uniform(rng, 1.0, 6.0);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl SensorPart for ThermalDrift {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        signal + self.amplitude * (1.0 - (-at.t / self.time_constant).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn the_zero_creeps_with_its_time_constant() {
        let drift = ThermalDrift {
            amplitude: -0.1,
            time_constant: 2.0,
        };
        let mut drifting = sensor([drift.at_rest()]);
        assert_eq!(read(&mut drifting, 0.0, 1.0), 0.0);
        let expected = -0.1 * (1.0 - (-1.0_f64).exp());
        assert!((read(&mut drifting, 2.0, 0.0) - expected).abs() < 1e-12);
    }
}

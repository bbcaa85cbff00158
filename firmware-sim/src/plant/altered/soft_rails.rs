//! An amplifier with soft saturation below its upper limit.

use crate::plant::effects::SensorSaturation;
use crate::plant::effects::physics;
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// Above the knee the reading is knee + room·tanh((x − knee)/room).
    SoftRails = "soft-rails" at Rails, like SensorSaturation
    parameters(base, rng) {
        /// Start of the saturation.
        knee ["y", FINITE] = rng.random_range(0.62..0.78) * base.gain;
        /// Remaining range above the knee.
        room ["y", POSITIVE] = rng.random_range(0.04..0.10) * base.gain;
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl SensorPart for SoftRails {
    fn read(&self, signal: f64, _at: &Moment) -> f64 {
        let over = (signal - self.knee).max(0.0);
        signal.min(self.knee) + self.room * (over / self.room).tanh()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn below_the_knee_it_is_exact_and_above_it_never_passes_the_rail() {
        let law = SoftRails {
            knee: 0.7,
            room: 0.1,
        };
        let mut railed = sensor([law.at_rest()]);
        assert_eq!(reading(&mut railed, 0.5), 0.5);
        let bent = reading(&mut railed, 0.75);
        assert!(bent > 0.74 && bent < 0.75);
        assert!((reading(&mut railed, 3.0) - 0.8).abs() < 1e-9);
    }
}

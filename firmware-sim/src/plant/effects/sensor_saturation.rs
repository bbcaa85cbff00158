//! Saturation of the sensor.

use crate::plant::effects::physics;
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// The reading is limited at both ends.
    SensorSaturation = "sensor-saturation" at Rails {
        fn conflict(&self) -> Option<(&'static str, &'static str)> {
            (self.lower_limit >= self.upper_limit).then_some(("lower_limit", "below upper_limit"))
        }
    }
    parameters(base, rng) {
        /// Lower limit.
        lower_limit ["y", FINITE] = rng.random_range(0.04..0.12);
        /// Upper limit.
        upper_limit ["y", FINITE] = rng.random_range(0.65..0.85) * base.gain;
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl SensorPart for SensorSaturation {
    fn read(&self, signal: f64, _at: &Moment) -> f64 {
        signal.max(self.lower_limit).min(self.upper_limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::Effect;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn the_rails_hold_and_leave_what_is_between_alone() {
        let rails = SensorSaturation {
            lower_limit: 0.1,
            upper_limit: 0.8,
        };
        let mut railed = sensor([rails.at_rest()]);
        assert_eq!(reading(&mut railed, 0.0), 0.1);
        assert_eq!(reading(&mut railed, 1.0), 0.8);
        assert_eq!(reading(&mut railed, 0.5), 0.5);
        let crossed = Effect::from(rails).with("lower_limit", 0.9).unwrap();
        assert!(crossed.validate().is_err());
    }
}

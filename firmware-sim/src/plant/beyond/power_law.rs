//! A sensor with a power-law characteristic.

use super::{Port, Truth};
use crate::plant::effects::physics;
use crate::plant::part::{Part, SensorPart};

physics! {
    /// full·(s/full)^exponent, odd in s.
    PowerLaw = "power-law" at Film
    parameters(base, rng) {
        /// The power.
        exponent ["-", POSITIVE] = exponent;
        /// Friction at which reading and friction are equal.
        full ["y", POSITIVE] = base.gain;
    }
    where {
        let exponent = if rng.random_bool(0.5) {
            rng.random_range(0.50..0.75)
        } else {
            rng.random_range(1.4..2.0)
        };
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
    truth(_) { Truth::new(Port::Sensor, &["reading", "y"]) }
}

impl SensorPart for PowerLaw {
    fn jump(&mut self, to: f64) -> f64 {
        self.full * (to.abs() / self.full).powf(self.exponent).copysign(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn it_is_right_at_rest_and_at_full_friction_only() {
        let law = PowerLaw {
            exponent: 2.0,
            full: 0.8,
        };
        let mut sensor = sensor([law.at_rest()]);
        let expected = [(0.0, 0.0), (0.4, 0.2), (0.8, 0.8), (-0.4, -0.2)];
        for (s, y) in expected {
            assert!((reading(&mut sensor, s) - y).abs() < 1e-12, "{s}");
        }
    }
}

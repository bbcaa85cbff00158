//! Sensor fouling: sensitivity decreases with time.

use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// The reading is multiplied by 1 − loss·(1 − exp(−t/time)), with the time in the record t.
    FadingSensitivity = "fading-sensitivity" at Film
    parameters(_, rng) {
        /// Final loss.
        loss ["-", FINITE] = rng.random_range(0.20..0.50);
        /// Time constant of the fouling.
        time ["s", TIME] = log_uniform(rng, 2.0, 8.0);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
    truth(_) { Truth::new(Port::Sensor, &["time in record × reading"]) }
}

impl SensorPart for FadingSensitivity {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        signal * (1.0 - self.loss * (1.0 - (-at.t / self.time).exp()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn it_shows_less_the_later_it_is() {
        let law = FadingSensitivity {
            loss: 0.3,
            time: 2.0,
        };
        let mut sensor = sensor([law.at_rest()]);
        sensor.advance(5e-5, 0.5);
        assert_eq!(read(&mut sensor, 0.0, 1.0), 0.5);
        let expected = 0.5 * (1.0 - 0.3 * (1.0 - (-1.0_f64).exp()));
        assert!((read(&mut sensor, 2.0, 1.0) - expected).abs() < 1e-12);
    }
}

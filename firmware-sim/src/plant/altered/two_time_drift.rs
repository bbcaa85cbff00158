//! Sensor drift with a fast and a slow time constant.

use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::effects::{ThermalDrift, signed};
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// Two exponential drifts with different time constants; each has half the amplitude.
    TwoTimeDrift = "two-time-drift" at Zero, like ThermalDrift
    parameters(_, rng) {
        /// Final offset.
        amplitude ["y", FINITE] = signed(rng, 0.10, 0.25);
        /// Time constant of the film's support.
        fast_time ["s", TIME] = log_uniform(rng, 0.5, 1.2);
        /// Time constant of the body.
        slow_time ["s", TIME] = log_uniform(rng, 3.0, 9.0);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl SensorPart for TwoTimeDrift {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        let crept = |time: f64| 0.5 * (1.0 - (-at.t / time).exp());
        signal + self.amplitude * (crept(self.fast_time) + crept(self.slow_time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn it_starts_at_zero_and_ends_at_the_amplitude() {
        let law = TwoTimeDrift {
            amplitude: 0.2,
            fast_time: 0.5,
            slow_time: 5.0,
        };
        let mut drifting = sensor([law.at_rest()]);
        assert_eq!(read(&mut drifting, 0.0, 0.0), 0.0);
        let e = (-1.0_f64).exp();
        let expected = 0.1 * (2.0 - (-10.0_f64).exp() - e);
        assert!((read(&mut drifting, 5.0, 0.0) - expected).abs() < 1e-12);
        assert!((read(&mut drifting, 100.0, 0.0) - 0.2).abs() < 1e-9);
    }
}

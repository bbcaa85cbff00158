//! Limited range of the sensor or its amplifier.

use crate::effect::{
    Effect, Instant, Parameter, Physics, Place, Setting, Spec, StartValue, Starts, Turn, Unit, take,
};
use crate::real::Real;

/// y = min(max(s, lo), hi).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorSaturation<T> {
    lower: T,
    upper: T,
}

impl<T: Real> Effect<T> for SensorSaturation<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        signal.at_least(self.lower).at_most(self.upper)
    }
}

impl<T: Real> Physics<T> for SensorSaturation<T> {
    const SPEC: Spec = Spec {
        name: "sensor-saturation",
        rust: "sensor_saturation::SensorSaturation",
        place: Place::Sensor,
        // The converter limits what it reads: offset, drift and pickup included.
        turn: Turn::Last,
        summary: "the reading is limited to the sensor's range",
        equation: "y = min(max(s, lo), hi)",
        parameters: &[
            Parameter::new("lower_limit", Unit::Reading, [-10.0, 10.0], &[-0.05]),
            Parameter::new("upper_limit", Unit::Reading, [-10.0, 10.0], &[0.8]),
        ],
        starts: Starts::Rows(&[
            &[StartValue::Quantile(0.05), StartValue::Quantile(0.95)],
            &[StartValue::Quantile(0.0), StartValue::Quantile(0.9)],
            &[StartValue::Quantile(0.1), StartValue::Quantile(0.999)],
            &[StartValue::Quantile(0.2), StartValue::Quantile(0.8)],
        ]),
        source: "amplifier limits",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [lower, upper] = take(parameters);
        Self { lower, upper }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn it_cuts_at_both_limits() {
        let range: SensorSaturation<f64> = prepared(&[-0.05, 0.8]);
        let y = readings(&range, |k| k as f64 / 500.0 - 1.0, |_| 0.0);
        assert_eq!((y[0], y[999]), (-0.05, 0.8));
        assert!((y[600] - 0.2).abs() < 1e-12);
    }
}

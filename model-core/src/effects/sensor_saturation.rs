//! The sensor or its amplifier has a limited range.

use crate::effect::{Effect, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
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
    #[inline]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        signal.at_least(self.lower).at_most(self.upper)
    }
}

impl<T: Real> Physics<T> for SensorSaturation<T> {
    const SPEC: Spec = Spec {
        name: "sensor-saturation",
        rust: "sensor_saturation::SensorSaturation",
        place: Place::Sensor,
        summary: "the sensor has a limited range",
        equation: "y = min(max(s, lo), hi)",
        parameters: &[
            Parameter { name: "lower_limit", unit: "y", low: -10.0, high: 10.0, starts: &[-0.05], influence: Influence::Smooth },
            Parameter { name: "upper_limit", unit: "y", low: -10.0, high: 10.0, starts: &[0.8], influence: Influence::Smooth },
        ],
        channel: None,
        source: "amplifier limits",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [lower, upper] = take(parameters);
        Self { lower, upper }
    }
}

//! The sensor warms up during the record.

use crate::effect::{Effect, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
use crate::real::Real;


/// y = s + A·(1 − exp(−t/τ)), t from the record's start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalDrift<T> {
    amplitude: T,
    share: T,
}

impl<T: Real> Effect<T> for ThermalDrift<T> {
    /// 1 − exp(−t/τ).
    type State = T;
    fn start(&self) -> T {
        T::ZERO
    }
    #[inline]
    fn sense(&self, warmth: &mut T, signal: T, _at: &Instant<'_, T>) -> T {
        let shown = signal + self.amplitude * *warmth;
        *warmth = *warmth + (T::ONE - *warmth) * self.share;
        shown
    }
}

impl<T: Real> Physics<T> for ThermalDrift<T> {
    const SPEC: Spec = Spec {
        name: "thermal-drift",
        rust: "thermal_drift::ThermalDrift",
        place: Place::Sensor,
        summary: "the reading drifts while the sensor warms up",
        equation: "y = s + A·(1 − exp(−t/τ))",
        parameters: &[
            Parameter { name: "amplitude", unit: "y", low: -2.0, high: 2.0, starts: &[0.05], influence: Influence::Smooth },
            Parameter { name: "time_constant", unit: "s", low: 0.5, high: 60.0, starts: &[1.5, 5.0, 20.0], influence: Influence::Smooth },
        ],
        channel: None,
        source: "Bruun, Hot-wire Anemometry (1995), ch. 7",
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [amplitude, time] = take(parameters);
        Self {
            amplitude,
            share: T::ONE - (-setting.period / time).exp(),
        }
    }
}

//! The sensor warms up during the record.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
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
    #[inline(always)]
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
        summary: "the reading drifts towards a final value while the sensor warms up",
        equation: "y = s + A·(1 − exp(−t/τ))",
        parameters: &[
            Parameter::new("amplitude", Unit::Y, [-2.0, 2.0], &[0.05]),
            Parameter::new(
                "time_constant",
                Unit::Second,
                [0.5, 60.0],
                &[1.5, 5.0, 20.0],
            ),
        ],
        amplitude: Some(Amplitude::new("amplitude", "a thermal drift").linear()),
        source: "Bruun, Hot-wire Anemometry (1995), ch. 7",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [amplitude, time] = take(parameters);
        Self {
            amplitude,
            share: T::ONE - (-setting.period / time).exp(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn it_begins_at_nothing_and_takes_its_time() {
        let drift: ThermalDrift<f64> = prepared(&[-0.2, 0.5]);
        let y = readings(&drift, |_| 0.3, |_| 0.0);
        assert_eq!(y[0], 0.3);
        for k in [1_usize, 500, 999] {
            let expected = 0.3 - 0.2 * (1.0 - (-(k as f64) / 500.0).exp());
            assert!((y[k] - expected).abs() < 1e-12, "{k}");
        }
    }
}

//! Turbulence disperses the jets on their way to the sensor.
//!
//! This is not a missing effect but a property of every transport in a turbulent flow or a duct. It belongs to the
//! base model, so that the lag of a valve or a film does not imitate it.

use crate::effect::{Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take};
use crate::real::Real;

/// Three lags in series, σ/√3 each: the delay has the standard deviation σ, and its mean is √3·σ longer. Each stage
/// is exact for a jet that is constant over the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DispersedDelay<T> {
    share: T,
}

impl<T: Real> Effect<T> for DispersedDelay<T> {
    /// The jet after each of the lags.
    type State = [T; 3];
    fn start(&self) -> [T; 3] {
        [T::ZERO; 3]
    }
    #[inline(always)]
    fn jet(&self, [first, second, third]: &mut [T; 3], jet: T, _at: &Instant<'_, T>) -> T {
        *first = *first + (jet - *first) * self.share;
        *second = *second + (*first - *second) * self.share;
        *third = *third + (*second - *third) * self.share;
        *third
    }
}

impl<T: Real> Physics<T> for DispersedDelay<T> {
    const SPEC: Spec = Spec {
        name: "dispersed-delay",
        rust: "dispersed_delay::DispersedDelay",
        place: Place::Jet,
        summary: "turbulence disperses the jets on their way to the sensor",
        equation: "three lags of σ/√3 in series; σ is the standard deviation of the delay",
        parameters: &[Parameter::new(
            "spread",
            Unit::Second,
            [0.001, 0.2],
            &[0.006, 0.015, 0.04],
        )],
        base: true,
        source: "residence times of a flow with dispersion: Levenspiel and Smith, Chem. Eng. Sci. 6 (1957)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [spread] = take(parameters);
        let time = spread / T::from_f64(SQRT_3);
        Self {
            share: T::ONE - (-setting.period / time).exp(),
        }
    }
}

/// Standard deviation of the delay of three equal lags in series, relative to that of one lag.
const SQRT_3: f64 = 1.732_050_807_568_877_2;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    /// Mean and standard deviation of the delay of a short pulse.
    #[test]
    fn a_pulse_arrives_late_by_the_mean_and_spread_by_sigma() {
        let dispersed: DispersedDelay<f64> = prepared(&[0.030]);
        let j = jets(&dispersed, |k| if k == 0 { 1.0 } else { 0.0 });
        let moment = |f: &dyn Fn(f64) -> f64| -> f64 {
            let each = j.iter().enumerate();
            each.map(|(k, j)| j * f(k as f64 * 0.001)).sum()
        };
        assert!((moment(&|_| 1.0) - 1.0).abs() < 1e-9, "nothing is lost");
        let mean = moment(&|t| t);
        let deviation = moment(&|t| (t - mean) * (t - mean)).sqrt();
        // A sampled lag is half a sample early, three lags one and a half samples.
        assert!((mean - (0.030 * SQRT_3 - 0.0015)).abs() < 2e-4, "{mean}");
        assert!((deviation - 0.030).abs() < 2e-4, "{deviation}");
    }

    #[test]
    fn it_is_no_entry_of_the_catalogue_of_missing_effects() {
        let name = DispersedDelay::<f64>::SPEC.name;
        assert!(crate::effects::SPECS.iter().all(|spec| spec.name != name));
        assert_eq!(crate::effects::spec(name).map(|spec| spec.name), Some(name));
    }
}

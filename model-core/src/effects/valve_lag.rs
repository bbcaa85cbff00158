//! The valve takes time to open and to close.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// v̇ = (u − v)/τ_o while u > v, (u − v)/τ_c otherwise; exact for a held command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveLag<T> {
    opening: T,
    closing: T,
}

impl<T: Real> Effect<T> for ValveLag<T> {
    /// v, the opening reached.
    type State = T;
    fn start(&self) -> T {
        T::ZERO
    }
    #[inline(always)]
    fn jet(&self, opening: &mut T, jet: T, _at: &Instant<'_, T>) -> T {
        let share = if jet > *opening {
            self.opening
        } else {
            self.closing
        };
        *opening = *opening + (jet - *opening) * share;
        *opening
    }
}

impl<T: Real> Physics<T> for ValveLag<T> {
    const SPEC: Spec = Spec {
        name: "valve-lag",
        rust: "valve_lag::ValveLag",
        place: Place::Jet,
        summary: "the valve opens and closes with first-order lags",
        equation: "v̇ = (u − v)/τ_o while u > v, (u − v)/τ_c otherwise",
        parameters: &[
            Parameter::new("opening_time", Unit::Second, [0.001, 0.05], &[0.004, 0.015]),
            Parameter::new("closing_time", Unit::Second, [0.001, 0.1], &[0.004, 0.025]),
        ],
        amplitude: Some(Amplitude::new("opening_time", "a lag of the valve").together()),
        source: "first-order valve model; e.g. Topçu et al., Mechatronics 16 (2006)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let share = |time: T| T::ONE - (-setting.period / time).exp();
        let [opening, closing] = take(parameters);
        Self {
            opening: share(opening),
            closing: share(closing),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    #[test]
    fn it_opens_and_closes_with_its_own_times() {
        let lag: ValveLag<f64> = prepared(&[0.010, 0.020]);
        let v = jets(&lag, |k| if k < 500 { 1.0 } else { 0.0 });
        let left = (-1.0_f64).exp();
        assert!((v[9] - (1.0 - left)).abs() < 1e-12);
        assert!((v[499] - 1.0).abs() < 1e-12);
        assert!((v[519] - left).abs() < 1e-12);
    }
}

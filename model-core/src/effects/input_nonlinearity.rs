//! A jet that is not proportional to the command (more than two levels).

use crate::effect::{Effect, Instant, Needs, Parameter, Physics, Place, Setting, Spec, Unit, take};
use crate::real::Real;

/// j = v + g2·v² + g3·v³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputNonlinearity<T> {
    quadratic: T,
    cubic: T,
}

impl<T: Real> Effect<T> for InputNonlinearity<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn jet(&self, _state: &mut (), jet: T, _at: &Instant<'_, T>) -> T {
        jet * (T::ONE + jet * (self.quadratic + jet * self.cubic))
    }
}

impl<T: Real> Physics<T> for InputNonlinearity<T> {
    const SPEC: Spec = Spec {
        name: "input-nonlinearity",
        rust: "input_nonlinearity::InputNonlinearity",
        place: Place::Jet,
        summary: "the effect of the jets is not proportional to the command",
        equation: "j = v + g2·v² + g3·v³",
        parameters: &[
            Parameter::new("quadratic", Unit::PerU, [-10.0, 10.0], &[0.1]),
            Parameter::new("cubic", Unit::PerUSquared, [-10.0, 10.0], &[0.1]),
        ],
        needs: Needs::GradedInput,
        source: "Hammerstein model",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [quadratic, cubic] = take(parameters);
        Self { quadratic, cubic }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    #[test]
    fn the_curve_goes_through_zero_and_scales_with_the_unit_of_u() {
        let curve: InputNonlinearity<f64> = prepared(&[0.2, -0.1]);
        assert_eq!(jets(&curve, |_| 0.0)[0], 0.0);
        assert!((jets(&curve, |_| 1.0)[0] - 1.1).abs() < 1e-12);
        assert!((jets(&curve, |_| -0.5)[0] - (-0.5 + 0.05 + 0.0125)).abs() < 1e-12);
        let percent: InputNonlinearity<f64> = prepared(&[
            0.2 * Unit::PerU.scale(1.0, 1.0, 100.0),
            -0.1 * Unit::PerUSquared.scale(1.0, 1.0, 100.0),
        ]);
        assert!((jets(&percent, |_| 100.0)[0] - 110.0).abs() < 1e-9);
    }
}

//! The jet's effect is not proportional to the command (more than two levels).

use crate::effect::{
    Effect, Instant, Needs, Parameter, Physics, Place, RustType, Setting, Spec, Starts, Unit, take,
};
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
    #[inline]
    fn jet(&self, _state: &mut (), jet: T, _at: &Instant<'_, T>) -> T {
        jet * (T::ONE + jet * (self.quadratic + jet * self.cubic))
    }
}

impl<T: Real> Physics<T> for InputNonlinearity<T> {
    const SPEC: Spec = Spec {
        name: "input-nonlinearity",
        rust: "input_nonlinearity::InputNonlinearity",
        rust_type: RustType::Numbers,
        place: Place::Jet,
        summary: "the response is not proportional to the input",
        equation: "j = v + g2·v² + g3·v³",
        parameters: &[
            Parameter::new("quadratic", Unit::PerU, [-10.0, 10.0], &[0.1]),
            Parameter::new("cubic", Unit::PerUSquared, [-10.0, 10.0], &[0.1]),
        ],
        starts: Starts::Grid,
        amplitude: None,
        channel: None,
        needs: Needs::GradedInput,
        law: None,
        source: "Hammerstein model",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [quadratic, cubic] = take(parameters);
        Self { quadratic, cubic }
    }
}

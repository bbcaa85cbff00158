//! The jet's effect is not proportional to the command (more than two levels).

use crate::effect::{Effect, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
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
        place: Place::Jet,
        summary: "the response is not proportional to the input",
        equation: "j = v + g2·v² + g3·v³",
        parameters: &[
            Parameter { name: "quadratic", unit: "1/u", low: -10.0, high: 10.0, starts: &[0.1], influence: Influence::Smooth },
            Parameter { name: "cubic", unit: "1/u²", low: -10.0, high: 10.0, starts: &[0.1], influence: Influence::Smooth },
        ],
        channel: None,
        source: "Hammerstein model",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [quadratic, cubic] = take(parameters);
        Self { quadratic, cubic }
    }
}

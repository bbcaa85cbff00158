//! Part of the jet arrives a second time, later.

use crate::delay::Tap;
use crate::effect::{Effect, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
use crate::real::Real;
use crate::history::{DelayLine, Memory};


/// j(t) = v(t) + g·v(t − d), with d of at most `LEN` − 2 samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EchoPath<T, const LEN: usize> {
    gain: T,
    delay: Tap<T>,
}

impl<T: Real, const LEN: usize> Effect<T> for EchoPath<T, LEN> {
    type State = DelayLine<T, LEN>;
    fn start(&self) -> Self::State {
        DelayLine::new()
    }
    #[inline]
    fn jet(&self, past: &mut Self::State, jet: T, _at: &Instant<'_, T>) -> T {
        past.push(jet);
        jet + self.gain * self.delay.read(past)
    }
}

impl<T: Real, const LEN: usize> Physics<T> for EchoPath<T, LEN> {
    const SPEC: Spec = Spec {
        name: "echo-path",
        rust: "echo_path::EchoPath",
        place: Place::Jet,
        summary: "the jet arrives a second time, later",
        equation: "j(t) = v(t) + g·v(t − d)",
        parameters: &[
            Parameter { name: "gain", unit: "-", low: -1.0, high: 1.0, starts: &[-0.2, 0.2], influence: Influence::Smooth },
            Parameter { name: "echo_delay", unit: "s", low: 0.02, high: 0.5, starts: &[0.04, 0.08, 0.14, 0.22, 0.35], influence: Influence::Smooth },
        ],
        channel: None,
        source: "a second path of convection or an acoustic reflection",
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [gain, delay] = take(parameters);
        Self {
            gain,
            delay: Tap::between(delay / setting.period),
        }
    }
}

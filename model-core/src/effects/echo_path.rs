//! A delayed second arrival of part of the jet.

use super::LONGEST_BUFFER;
use crate::delay::Tap;
use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, RustType, Setting, Spec, Unit, take,
};
use crate::history::{DelayLine, Reaching};
use crate::real::Real;
use core::marker::PhantomData;

/// [`Echo`] with d of at most `LEN` − 2 samples.
pub type EchoPath<T, const LEN: usize> = Echo<T, DelayLine<T, LEN>>;

/// j(t) = v(t) + g·v(t − d), with v stored in `M`. There is no echo if d exceeds [`LONGEST_BUFFER`] − 2 samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo<T, M> {
    gain: T,
    delay: Tap<T>,
    memory: PhantomData<M>,
}

impl<T: Real, M: Reaching<T>> Effect<T> for Echo<T, M> {
    type State = M;
    fn start(&self) -> M {
        M::reaching(self.delay.whole.saturating_add(1).min(LONGEST_BUFFER - 1))
    }
    #[inline(always)]
    fn jet(&self, past: &mut M, jet: T, _at: &Instant<'_, T>) -> T {
        past.push(jet);
        jet + self.gain * self.delay.read(past)
    }
}

impl<T: Real, M: Reaching<T>> Physics<T> for Echo<T, M> {
    const SPEC: Spec = Spec {
        name: "echo-path",
        rust: "echo_path::EchoPath",
        rust_type: RustType::Buffer(1),
        place: Place::Jet,
        summary: "the jet reaches the flow a second time, by a longer path",
        equation: "j(t) = v(t) + g·v(t − d)",
        parameters: &[
            Parameter::new("gain", Unit::None, [-1.0, 1.0], &[-0.2, 0.2]),
            Parameter::new(
                "echo_delay",
                Unit::Second,
                [0.02, 0.5],
                &[0.04, 0.08, 0.14, 0.22, 0.35],
            ),
        ],
        amplitude: Some(Amplitude::new("gain", "an echo of the jet").linear()),
        source: "a second path of convection, or an acoustic reflection",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [gain, delay] = take(parameters);
        Self {
            gain,
            delay: Tap::between(delay / setting.period),
            memory: PhantomData,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    #[test]
    fn the_echo_comes_later_and_adds_its_gain() {
        let echo: EchoPath<f64, 64> = prepared(&[-0.25, 0.0305]);
        let j = jets(&echo, |k| if k < 10 { 0.0 } else { 1.0 });
        assert_eq!(j[10], 1.0);
        assert_eq!(j[39], 1.0);
        // The echo arrives half way between two samples.
        assert!((j[40] - 0.875).abs() < 1e-9, "{}", j[40]);
        assert!((j[41] - 0.75).abs() < 1e-9 && (j[999] - 0.75).abs() < 1e-9);
    }
}

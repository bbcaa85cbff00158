//! A constant transport delay that need not be whole samples.

use crate::delay::Transport;
use crate::effect::{
    LawCard, Parameter, Physics, Place, Setting, Spec, StartValue, Starts, Unit, take,
};
use crate::real::Real;

/// h, samples, independent of the flow: eq. (3) without rounding. A base term, never reported as missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantDelay<T> {
    /// h, samples.
    pub delay: T,
}

impl<T: Real> Transport<T> for ConstantDelay<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn delay(&self, _output: T) -> T {
        self.delay
    }
    #[inline(always)]
    fn bounds(&self) -> Option<[T; 2]> {
        Some([self.delay; 2])
    }
}

impl<T: Real> Physics<T> for ConstantDelay<T> {
    const SPEC: Spec = Spec {
        name: "constant-delay",
        rust: "constant_delay::ConstantDelay",
        place: Place::Delay,
        summary: "the dead time is constant",
        equation: "h constant",
        parameters: &[Parameter::new(
            "delay",
            Unit::Samples,
            [0.0, 1000.0],
            &[40.0],
        )],
        starts: Starts::Rows(&[&[StartValue::Delay(0.0)]]),
        base: true,
        law: Some(LawCard {
            words: "{} samples",
            fields: Some(&["delay"]),
            ..LawCard::PLAIN
        }),
        source: "Feingesicht et al., ECC 2016, eq. (3)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [delay] = take(parameters);
        Self { delay }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::{DelayLaw, ScaledDelay};

    #[test]
    fn it_is_the_same_at_any_output() {
        let law = ConstantDelay { delay: 31.4_f64 };
        assert_eq!(law.delay(0.0), law.delay(0.9));
        let delays = ScaledDelay::<_, [f64; 1], false> {
            law,
            factors: [1.0],
        };
        let tap = delays.tap(0, delays.evaluate(0.3));
        assert_eq!(tap.whole, 31);
        assert!((tap.fraction - 0.4).abs() < 1e-12);
    }
}

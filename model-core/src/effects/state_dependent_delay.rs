//! The transport delay depends on how far the flow is attached, eq. (2).

use crate::delay::{DelayLaw, Tap};
use crate::effect::{
    Needs, Parameter, Physics, Place, RustType, Setting, Spec, Start, Starts, Unit, take,
};
use crate::real::Real;

/// h_l = round(f_l · (p0 + p1·exp(−p2·ỹ))), samples, eqs. (2) and (4); without
/// the rounding, and with the input interpolated, where `ROUNDED` is false.
///
/// The rounding moves every edge by up to half a sample, which a flow that
/// rings at 20 Hz shows as an error of several per cent of the ringing.
///
/// A negative ỹ counts as 0: the exponential would run away (theory: at
/// ỹ = −0.1 it would be 2.4 times the delay of the natural flow).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateDependentDelay<T, F = [T; 1], const ROUNDED: bool = true> {
    /// p0, samples: the delay of the attached flow.
    pub floor: T,
    /// p1, samples: how much longer the delay of the separated flow is.
    pub rise: T,
    /// p2, 1/y: how quickly the delay shortens as the flow attaches.
    pub rate: T,
    /// f_l, one factor for each input.
    pub factors: F,
}

impl<T: Real, F: AsRef<[T]> + Clone, const ROUNDED: bool> DelayLaw<T>
    for StateDependentDelay<T, F, ROUNDED>
{
    type State = ();
    const INTERPOLATES: bool = !ROUNDED;
    fn start(&self) {}
    #[inline]
    fn evaluate(&self, output: T) -> T {
        self.floor + self.rise * (-self.rate * output).exp()
    }
    /// The exponential lies between 0 and 1, and every operation after it keeps
    /// the order, roundings included: the ends are the bounds.
    #[inline]
    fn range(&self, l: usize) -> Option<(usize, usize)> {
        if !ROUNDED || self.rate < T::ZERO {
            return None;
        }
        let attached = self.tap(l, self.floor).whole;
        let separated = self.tap(l, self.floor + self.rise).whole;
        Some((attached.min(separated), attached.max(separated)))
    }
    #[inline]
    fn tap(&self, l: usize, evaluated: T) -> Tap<T> {
        let factor = self.factors.as_ref().get(l).copied().unwrap_or(T::ONE);
        let delay = factor * evaluated;
        if ROUNDED {
            Tap::on(delay.round().max(0) as usize)
        } else {
            Tap::between(delay)
        }
    }
}

impl<T: Real> Physics<T> for StateDependentDelay<T> {
    const SPEC: Spec = Spec {
        name: "state-dependent-delay",
        rust: "state_dependent_delay::StateDependentDelay",
        rust_type: RustType::Numbers,
        place: Place::Delay,
        summary: "the delay shortens as the flow attaches",
        equation: "h = p0 + p1·exp(−p2·ỹ)",
        parameters: &[
            Parameter::new("delay_floor", Unit::Samples, [0.0, 500.0], &[30.0]),
            Parameter::new("delay_rise", Unit::Samples, [-100.0, 500.0], &[10.0]),
            Parameter::new("delay_rate", Unit::PerY, [0.1, 200.0], &[4.0, 20.0]),
        ],
        starts: Starts::Rows(&[
            &[Start::Delay(-3.0), Start::Value(10.0), Start::Value(4.0)],
            &[Start::Delay(-1.0), Start::Value(10.0), Start::Value(16.0)],
            &[Start::Delay(-6.0), Start::Value(10.0), Start::Value(2.0)],
            &[Start::Delay(3.0), Start::Value(-8.0), Start::Value(4.0)],
        ]),
        amplitude: None,
        channel: None,
        needs: Needs::Nothing,
        source: "Feingesicht et al., ECC 2016, eq. (2)",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [floor, rise, rate] = take(parameters);
        Self {
            floor,
            rise,
            rate,
            factors: [T::ONE],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_rounding_it_taps_between_samples() {
        let law = StateDependentDelay::<f64, [f64; 1], false> {
            floor: 30.25,
            rise: 0.0,
            rate: 1.0,
            factors: [1.0],
        };
        let tap = law.tap(0, law.evaluate(0.3));
        assert_eq!((tap.whole, tap.fraction), (30, 0.25));
    }

    #[test]
    fn its_range_holds_all_its_taps_and_no_more() {
        for (rise, factor) in [(12.69, 1.0), (-12.69, 1.0), (12.69, 0.37), (12.69, 3.1)] {
            let law = StateDependentDelay::<f32> {
                floor: 47.35,
                rise,
                rate: 20.18,
                factors: [factor],
            };
            let (low, high) = law.range(0).unwrap();
            let mut met = (usize::MAX, 0);
            for bits in (0..0x4080_0000_u32).step_by(10_007) {
                let tap = law.tap(0, law.evaluate(f32::from_bits(bits))).whole;
                met = (met.0.min(tap), met.1.max(tap));
            }
            assert_eq!(met, (low, high));
        }
    }

    #[test]
    fn the_papers_law_at_its_ends() {
        let law = StateDependentDelay::<f32> {
            floor: 47.35,
            rise: 12.69,
            rate: 20.18,
            factors: [1.0],
        };
        assert_eq!(law.tap(0, law.evaluate(0.0)).whole, 60);
        assert_eq!(law.tap(0, law.evaluate(1.0)).whole, 47);
        let fast = StateDependentDelay::<f32, [f32; 2]> {
            factors: [1.5513, 106.756],
            floor: 47.35,
            rise: 12.69,
            rate: 20.18,
        };
        assert_eq!(fast.tap(1, fast.evaluate(0.0)).whole, 6410);
        assert_eq!(fast.tap(1, fast.evaluate(1.0)).whole, 5055);
    }
}

//! A transport delay that depends on the attachment of the flow, eq. (2).

use crate::delay::Transport;
use crate::effect::{
    LawCard, Parameter, Physics, Place, Setting, Spec, StartValue, Starts, Unit, take,
};
use crate::real::Real;

/// h = p0 + p1·exp(−p2·ỹ), samples, eq. (2).
///
/// A negative ỹ counts as 0, because the exponential would become very large (theory 1.1: at ỹ = −0.1 it would be
/// 2.4 times the delay of the natural flow).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateDependentDelay<T> {
    /// p0, samples: the delay of the attached flow.
    pub floor: T,
    /// p1, samples: additional delay of the separated flow.
    pub rise: T,
    /// p2, 1/y: rate at which the delay decreases with attachment.
    pub rate: T,
}

impl<T: Real> Transport<T> for StateDependentDelay<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn delay(&self, output: T) -> T {
        self.floor + self.rise * (-self.rate * output).exp()
    }
    /// The exponential lies between 0 and 1.
    #[inline(always)]
    fn bounds(&self) -> Option<[T; 2]> {
        if self.rate < T::ZERO {
            return None;
        }
        let separated = self.floor + self.rise;
        Some([
            self.floor.at_most(separated),
            self.floor.at_least(separated),
        ])
    }
}

impl<T: Real> Physics<T> for StateDependentDelay<T> {
    const SPEC: Spec = Spec {
        name: "state-dependent-delay",
        rust: "state_dependent_delay::StateDependentDelay",
        place: Place::Delay,
        summary: "the dead time shortens as the flow attaches",
        equation: "h = p0 + p1·exp(−p2·ỹ)",
        parameters: &[
            Parameter::new("delay_floor", Unit::Samples, [0.0, 500.0], &[30.0]),
            Parameter::new("delay_rise", Unit::Samples, [-100.0, 500.0], &[10.0]),
            Parameter::new("delay_rate", Unit::PerY, [0.1, 200.0], &[4.0, 20.0]),
        ],
        starts: Starts::Rows(&[
            &[
                StartValue::Delay(-3.0),
                StartValue::Number(10.0),
                StartValue::Number(4.0),
            ],
            &[
                StartValue::Delay(-1.0),
                StartValue::Number(10.0),
                StartValue::Number(16.0),
            ],
            &[
                StartValue::Delay(-6.0),
                StartValue::Number(10.0),
                StartValue::Number(2.0),
            ],
            &[
                StartValue::Delay(3.0),
                StartValue::Number(-8.0),
                StartValue::Number(4.0),
            ],
        ]),
        law: Some(LawCard {
            words: "{} + {}·exp(−{}·ỹ) samples",
            fields: Some(&["floor", "rise", "rate"]),
            ..LawCard::PLAIN
        }),
        source: "Feingesicht et al., ECC 2016, eq. (2)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [floor, rise, rate] = take(parameters);
        Self { floor, rise, rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn papers<T: Real>() -> StateDependentDelay<T> {
        let setting = Setting {
            period: T::from_f64(0.001),
            channel: 0,
            reference: T::ONE,
        };
        StateDependentDelay::new(&[47.35, 12.69, 20.18].map(T::from_f64), &setting)
    }

    #[test]
    fn it_shortens_from_the_separated_to_the_attached_flow() {
        let law = papers::<f64>();
        assert_eq!(law.bounds(), Some([47.35, 47.35 + 12.69]));
        assert_eq!(law.delay(0.0), 47.35 + 12.69);
        assert!((law.delay(2.0) - 47.35).abs() < 1e-9);
        // At ỹ = 1/p2 the delay has completed the fraction 1 − 1/e of its change.
        let there = law.delay(1.0 / 20.18);
        assert!((there - (47.35 + 12.69 / core::f64::consts::E)).abs() < 1e-9);
        let runaway = StateDependentDelay { rate: -1.0, ..law };
        assert_eq!(runaway.bounds(), None);
    }

    #[test]
    fn single_precision_follows_double() {
        let (single, double) = (papers::<f32>(), papers::<f64>());
        for y in (0..40).map(|i| f64::from(i) * 0.05) {
            let found = f64::from(single.delay(y as f32));
            assert!((found - double.delay(y)).abs() < 2e-5, "{y}");
        }
    }
}

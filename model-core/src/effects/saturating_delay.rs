//! A delay that decreases with attachment down to a minimum.

use crate::delay::Transport;
use crate::effect::{
    LawCard, Parameter, Physics, Place, Setting, Spec, StartValue, Starts, Unit, take,
};
use crate::real::Real;

/// h = p0 + p1·(1 − x)·(1 + b·x) samples with x = ỹ/y₁, at most 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaturatingDelay<T> {
    /// p0, samples: the delay of the attached flow.
    pub floor: T,
    /// p1, samples: additional delay of the separated flow.
    pub rise: T,
    /// y₁, y: above it the delay is that of the attached flow.
    pub level: T,
    /// b, −1 to 1: above 0 the delay falls mostly near y₁, below 0 mostly near rest.
    pub bend: T,
}

impl<T: Real> Transport<T> for SaturatingDelay<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn delay(&self, output: T) -> T {
        let x = (output / self.level).at_most(T::ONE);
        // Rounding must not take the delay beyond its bounds.
        let share = ((T::ONE - x) * (T::ONE + self.bend * x)).at_most(T::ONE);
        self.floor + self.rise * share
    }
    /// A bend within ±1 keeps the law monotone.
    #[inline(always)]
    fn bounds(&self) -> Option<[T; 2]> {
        let monotone = self.bend.at_least(-T::ONE).at_most(T::ONE) == self.bend;
        if !monotone || self.level <= T::ZERO {
            return None;
        }
        let separated = self.floor + self.rise;
        Some([
            self.floor.at_most(separated),
            self.floor.at_least(separated),
        ])
    }
}

impl<T: Real> Physics<T> for SaturatingDelay<T> {
    const SPEC: Spec = Spec {
        name: "saturating-delay",
        rust: "saturating_delay::SaturatingDelay",
        place: Place::Delay,
        summary: "the dead time shortens until y reaches a level, and is constant above it",
        equation: "h = p0 + p1·(1 − x)·(1 + b·x), x = min(ỹ/y₁, 1)",
        parameters: &[
            Parameter::new("delay_floor", Unit::Samples, [0.0, 500.0], &[30.0]),
            Parameter::new("delay_rise", Unit::Samples, [-100.0, 500.0], &[10.0]),
            Parameter::new("level", Unit::Y, [0.05, 3.0], &[0.6]),
            Parameter::new("bend", Unit::None, [-1.0, 1.0], &[0.0]),
        ],
        starts: Starts::Rows(&[
            &[
                StartValue::Delay(-3.0),
                StartValue::Number(10.0),
                StartValue::Number(0.6),
                StartValue::Number(0.0),
            ],
            &[
                StartValue::Delay(-1.0),
                StartValue::Number(10.0),
                StartValue::Number(0.3),
                StartValue::Number(0.0),
            ],
            &[
                StartValue::Delay(3.0),
                StartValue::Number(-8.0),
                StartValue::Number(0.6),
                StartValue::Number(0.0),
            ],
        ]),
        base: true,
        law: Some(LawCard {
            words: "{} + {}·(1 − x)·(1 + b·x) samples, with x = ỹ/{} (at most 1) and b = {}",
            fields: Some(&["floor", "rise", "level", "bend"]),
            ..LawCard::PLAIN
        }),
        source: "a form like eq. (2) that is constant above a level; measured edge delays (Fig. 8) do not \
            distinguish the two forms",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [floor, rise, level, bend] = take(parameters);
        Self {
            floor,
            rise,
            level,
            bend,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law<T: Real>(bend: f64) -> SaturatingDelay<T> {
        let setting = Setting {
            period: T::from_f64(0.001),
            channel: 0,
            reference: T::ONE,
        };
        SaturatingDelay::new(&[30.0, 12.0, 0.6, bend].map(T::from_f64), &setting)
    }

    #[test]
    fn it_shortens_to_the_level_and_stays() {
        for bend in [-1.0, 0.0, 1.0] {
            let law = law::<f64>(bend);
            assert_eq!(law.bounds(), Some([30.0, 42.0]));
            assert!((law.delay(0.0) - 42.0).abs() < 1e-12);
            assert!((law.delay(0.6) - 30.0).abs() < 1e-12);
            assert!((law.delay(1.1) - 30.0).abs() < 1e-12);
            let each = (0..60).map(|i| law.delay(f64::from(i) * 0.01));
            assert!(each.is_sorted_by(|a, b| a >= b), "{bend}");
        }
        assert!((law::<f64>(0.0).delay(0.3) - 36.0).abs() < 1e-12);
        assert!(law::<f64>(-1.0).delay(0.3) < 36.0 && law::<f64>(1.0).delay(0.3) > 36.0);
        assert_eq!(law::<f64>(1.5).bounds(), None);
    }

    #[test]
    fn single_precision_follows_double() {
        let (single, double) = (law::<f32>(0.4), law::<f64>(0.4));
        for y in (0..40).map(|i| f64::from(i) * 0.05) {
            let found = f64::from(single.delay(y as f32));
            assert!((found - double.delay(y)).abs() < 2e-5, "{y}");
        }
    }
}

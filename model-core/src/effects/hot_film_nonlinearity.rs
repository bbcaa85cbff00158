//! The hot-film's voltage is not linear in the wall shear stress (King's law).

use crate::effect::{Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take};
use crate::real::Real;

/// E² = 1 + κ·(s + s0)^(1/3); y = (E − E(0))/(E(1) − E(0)). A film cannot tell
/// a reversed flow: s + s0 below 0 counts as 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HotFilmNonlinearity<T> {
    ratio: T,
    offset: T,
    /// E(0).
    natural: T,
    /// E(1) − E(0).
    span: T,
}

impl<T: Real> HotFilmNonlinearity<T> {
    #[inline]
    fn voltage(ratio: T, offset: T, friction: T) -> T {
        (T::ONE + ratio * (friction + offset).at_least(T::ZERO).cbrt()).sqrt()
    }
}

impl<T: Real> Effect<T> for HotFilmNonlinearity<T> {
    type State = ();
    fn start(&self) {}
    #[inline]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        (Self::voltage(self.ratio, self.offset, signal) - self.natural) / self.span
    }
}

impl<T: Real> Physics<T> for HotFilmNonlinearity<T> {
    const SPEC: Spec = Spec {
        name: "hot-film-nonlinearity",
        rust: "hot_film_nonlinearity::HotFilmNonlinearity",
        place: Place::Sensor,
        summary: "the hot-film's voltage follows King's law, not the friction",
        equation: "E² = 1 + κ·(s + s0)^(1/3); y = (E − E(0))/(E(1) − E(0))",
        parameters: &[
            Parameter::new("king_ratio", Unit::None, [0.1, 10.0], &[0.5, 3.0]),
            Parameter::new("king_offset", Unit::Y, [0.01, 1.0], &[0.05, 0.25]),
        ],
        source: "King, Phil. Trans. A 214 (1914); Bellhouse & Schultz, J. Fluid Mech. 24 (1966)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [ratio, offset] = take(parameters);
        let natural = Self::voltage(ratio, offset, T::ZERO);
        Self {
            ratio,
            offset,
            natural,
            span: Self::voltage(ratio, offset, T::ONE) - natural,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn it_is_calibrated_at_its_ends_and_bends_between() {
        let film: HotFilmNonlinearity<f64> = prepared(&[3.0, 0.05]);
        let y = readings(&film, |k| k as f64 / 500.0 - 0.5, |_| 0.0);
        assert!(y[250].abs() < 1e-12 && (y[750] - 1.0).abs() < 1e-12);
        assert!(y[500] > 0.6, "concave: {}", y[500]);
        assert!(y.windows(2).all(|pair| pair[1] >= pair[0]));
        // It cannot tell a reversed flow.
        assert_eq!(y[0], y[200]);
    }

    /// For a weak overheat E is linear in (s + s0)^(1/3).
    #[test]
    fn a_small_ratio_leaves_the_cube_root() {
        let film: HotFilmNonlinearity<f64> = prepared(&[1e-6, 0.1]);
        let root = |s: f64| (s + 0.1).cbrt();
        let expected = (root(0.5) - root(0.0)) / (root(1.0) - root(0.0));
        assert!((readings(&film, |_| 0.5, |_| 0.0)[0] - expected).abs() < 1e-4);
    }
}

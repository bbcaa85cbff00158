//! Nonlinearity of the hot-film's voltage in the wall shear stress (King's law).

use crate::effect::{Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take};
use crate::real::Real;

/// E² = 1 + κ·((s + s0)/r)^(1/3); y = r·(E − E(0))/(E(r) − E(0)), calibrated at 0 and at the reference r. A film
/// does not measure the direction of the flow: s + s0 below 0 counts as 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HotFilmNonlinearity<T> {
    ratio: T,
    offset: T,
    /// 1/r.
    per_reference: T,
    /// E(0).
    natural: T,
    /// (E(r) − E(0))/r.
    span: T,
}

impl<T: Real> HotFilmNonlinearity<T> {
    #[inline(always)]
    fn voltage(&self, friction: T) -> T {
        let cooling = (friction + self.offset).at_least(T::ZERO) * self.per_reference;
        (T::ONE + self.ratio * cooling.cbrt()).sqrt()
    }
}

impl<T: Real> Effect<T> for HotFilmNonlinearity<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        (self.voltage(signal) - self.natural) / self.span
    }
}

impl<T: Real> Physics<T> for HotFilmNonlinearity<T> {
    const SPEC: Spec = Spec {
        name: "hot-film-nonlinearity",
        rust: "hot_film_nonlinearity::HotFilmNonlinearity",
        place: Place::Sensor,
        summary: "the hot film's voltage follows King's law and is not proportional to the friction",
        equation: "E² = 1 + κ·((s + s0)/r)^(1/3); y = r·(E − E(0))/(E(r) − E(0))",
        parameters: &[
            Parameter::new("king_ratio", Unit::None, [0.1, 10.0], &[0.5, 3.0]),
            Parameter::new("king_offset", Unit::Y, [0.01, 1.0], &[0.05, 0.25]),
        ],
        calibrated: true,
        source: "King, Phil. Trans. A 214 (1914); Bellhouse & Schultz, J. Fluid Mech. 24 (1966)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [ratio, offset] = take(parameters);
        let reference = setting.reference;
        let mut film = Self {
            ratio,
            offset,
            per_reference: T::ONE / reference,
            natural: T::ZERO,
            span: T::ONE,
        };
        film.natural = film.voltage(T::ZERO);
        film.span = (film.voltage(reference) - film.natural) / reference;
        film
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::readings;

    fn film(ratio: f64, offset: f64, reference: f64) -> HotFilmNonlinearity<f64> {
        let setting = Setting {
            period: 0.001,
            channel: 0,
            reference,
        };
        HotFilmNonlinearity::new(&[ratio, offset], &setting)
    }

    #[test]
    fn it_is_calibrated_at_its_ends_and_bends_between() {
        let film = film(3.0, 0.05, 1.0);
        let y = readings(&film, |k| k as f64 / 500.0 - 0.5, |_| 0.0);
        assert!(y[250].abs() < 1e-12 && (y[750] - 1.0).abs() < 1e-12);
        assert!(y[500] > 0.6, "concave: {}", y[500]);
        assert!(y.windows(2).all(|pair| pair[1] >= pair[0]));
        // The sign is lost.
        assert_eq!(y[0], y[200]);
    }

    /// In volts it is the same film, if the calibration is scaled too.
    #[test]
    fn its_calibration_goes_with_the_unit() {
        let (plain, volts) = (film(3.0, 0.05, 1.0), film(3.0, 0.25, 5.0));
        let friction = |k: usize| k as f64 / 800.0;
        let one = readings(&plain, friction, |_| 0.0);
        let other = readings(&volts, |k| 5.0 * friction(k), |_| 0.0);
        assert!((readings(&volts, |_| 5.0, |_| 0.0)[0] - 5.0).abs() < 1e-12);
        assert!(
            one.iter()
                .zip(&other)
                .all(|(a, b)| (5.0 * a - b).abs() < 1e-9)
        );
    }

    /// For a small overheat E is linear in (s + s0)^(1/3).
    #[test]
    fn a_small_ratio_leaves_the_cube_root() {
        let film = film(1e-6, 0.1, 1.0);
        let root = |s: f64| (s + 0.1).cbrt();
        let expected = (root(0.5) - root(0.0)) / (root(1.0) - root(0.0));
        assert!((readings(&film, |_| 0.5, |_| 0.0)[0] - expected).abs() < 1e-4);
    }
}

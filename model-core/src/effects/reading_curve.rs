//! A monotone curve between the flow and its reading.
//!
//! This is not a missing effect but a property of the sensor's position. The friction near a moving reattachment
//! line, or a lift that follows the separation point, is an S-shaped function of the state in which the flow is
//! linear. It belongs to the base model, so that hysteresis and lags do not imitate it, and acts in front of all other
//! effects of the sensor.

use crate::effect::{Effect, Instant, Parameter, Physics, Place, Setting, Spec, Turn, Unit, take};
use crate::real::Real;

/// y = w·(tanh((s − c)/w) + tanh(c/w)): 0 at 0, slope 1 at the centre c, almost linear for a large width w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingCurve<T> {
    centre: T,
    width: T,
    /// 2/w.
    per_width: T,
    /// tanh(c/w).
    natural: T,
}

/// Above this x, tanh(x/2) rounds to 1 in double precision, and its slope, below 10⁻¹⁶, is taken as 0.
const SATURATED: f64 = 40.0;

/// tanh(x/2).
#[inline(always)]
fn tanh_of_half<T: Real>(x: T) -> T {
    let two = T::ONE + T::ONE;
    // The slope of the exponential overflows before its quotient vanishes.
    T::ONE - two / (x.at_most(T::from_f64(SATURATED)).exp() + T::ONE)
}

impl<T: Real> Effect<T> for ReadingCurve<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        let steep = tanh_of_half((signal - self.centre) * self.per_width);
        self.width * (steep + self.natural)
    }
}

impl<T: Real> Physics<T> for ReadingCurve<T> {
    const SPEC: Spec = Spec {
        name: "reading-curve",
        rust: "reading_curve::ReadingCurve",
        place: Place::Sensor,
        summary: "the reading is an S-shaped function of the flow's state",
        equation: "y = w·(tanh((s − c)/w) + tanh(c/w))",
        parameters: &[
            Parameter::new("centre", Unit::Y, [-10.0, 10.0], &[0.25, 0.75]),
            Parameter::new("width", Unit::Y, [0.05, 10.0], &[0.4, 1.0]),
        ],
        base: true,
        turn: Turn::First,
        source: "static curves of the separation point: Goman and Khrabrov, J. Aircraft 31 (1994); friction at reattachment: Eaton and Johnston, AIAA J. 19 (1981)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [centre, width] = take(parameters);
        let per_width = (T::ONE + T::ONE) / width;
        Self {
            centre,
            width,
            per_width,
            natural: tanh_of_half(centre * per_width),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn it_is_the_hyperbolic_tangent_and_straight_where_it_is_wide() {
        let curve: ReadingCurve<f64> = prepared(&[0.5, 0.4]);
        let signal = |k: usize| k as f64 / 500.0 - 1.0;
        for (k, y) in readings(&curve, signal, |_| 0.0).iter().enumerate() {
            let wanted = 0.4 * (((signal(k) - 0.5) / 0.4).tanh() + (0.5_f64 / 0.4).tanh());
            assert!((y - wanted).abs() < 1e-14, "{k}: {y} {wanted}");
        }
        let wide: ReadingCurve<f64> = prepared(&[0.5, 10.0]);
        for (k, y) in readings(&wide, signal, |_| 0.0).iter().enumerate() {
            assert!((y - signal(k)).abs() < 0.02, "{k}: {y}");
        }
    }

    /// Far outside, the exponential is 0 or overflows; the curve is then at its ends, in both precisions.
    #[test]
    fn it_ends_at_its_limits() {
        for x in [100.0_f32, 1e6, f32::MAX] {
            assert_eq!((tanh_of_half(x), tanh_of_half(-x)), (1.0, -1.0));
        }
        for x in [SATURATED, 100.0, 1e6, f64::MAX] {
            assert_eq!((tanh_of_half(x), tanh_of_half(-x)), (1.0, -1.0));
        }
    }
}

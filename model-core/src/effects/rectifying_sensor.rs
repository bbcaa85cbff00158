//! A sensor that measures only the magnitude of the friction and loses its sign.

use crate::effect::{Effect, Instant, Physics, Place, RustType, Setting, Spec};
use crate::real::Real;

/// y = |s|.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RectifyingSensor;

impl<T: Real> Effect<T> for RectifyingSensor {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        signal.abs()
    }
}

impl<T: Real> Physics<T> for RectifyingSensor {
    const SPEC: Spec = Spec {
        name: "rectifying-sensor",
        rust: "rectifying_sensor::RectifyingSensor",
        rust_type: RustType::Plain,
        place: Place::Sensor,
        summary: "the sensor does not measure the sign of the friction",
        equation: "y = |s|",
        parameters: &[],
        source: "Bruun, Hot-wire Anemometry (1995)",
        ..Spec::PLAIN
    };

    fn new(_parameters: &[T], _setting: &Setting<T>) -> Self {
        Self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::readings;

    #[test]
    fn it_shows_the_size() {
        let y = readings(&RectifyingSensor, |k| k as f64 - 2.0, |_| 0.0);
        assert_eq!(y[..4], [2.0, 1.0, 0.0, 1.0]);
    }
}

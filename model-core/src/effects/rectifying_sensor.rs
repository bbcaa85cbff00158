//! The sensor cannot tell the sign.

use crate::effect::{Effect, Instant, Physics, Place, Setting, Spec};
use crate::real::Real;


/// y = |s|.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RectifyingSensor;

impl<T: Real> Effect<T> for RectifyingSensor {
    type State = ();
    fn start(&self) {}
    #[inline]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        signal.abs()
    }
}

impl<T: Real> Physics<T> for RectifyingSensor {
    const SPEC: Spec = Spec {
        name: "rectifying-sensor",
        rust: "rectifying_sensor::RectifyingSensor",
        place: Place::Sensor,
        summary: "the sensor cannot tell the sign",
        equation: "y = |s|",
        parameters: &[

        ],
        channel: None,
        source: "Bruun, Hot-wire Anemometry (1995)",
    };

    fn new(_parameters: &[T], _setting: &Setting<T>) -> Self {
        Self
    }
}

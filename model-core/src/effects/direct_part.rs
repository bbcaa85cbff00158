//! A part of the jets that acts on the reading without the flow, such as the jets' thrust on a force balance.
//!
//! This is not a missing effect but a property of the plant: it belongs to the base model, so that neither lags nor
//! vortices imitate it.

use crate::effect::{Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take};
use crate::real::Real;

/// y(t) = s(t) + g·j(t − h): the jets that arrive at the flow also act on the reading, at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectPart<T> {
    gain: T,
}

impl<T: Real> Effect<T> for DirectPart<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, (): &mut (), signal: T, at: &Instant<'_, T>) -> T {
        signal + self.gain * at.present
    }
}

impl<T: Real> Physics<T> for DirectPart<T> {
    const SPEC: Spec = Spec {
        name: "direct-part",
        rust: "direct_part::DirectPart",
        place: Place::Sensor,
        summary: "a part of the jets acts on the reading at once, without the flow",
        equation: "y(t) = s(t) + g·j(t − h)",
        parameters: &[Parameter::new("gain", Unit::Y, [-2.0, 2.0], &[0.2, -0.2])],
        base: true,
        source: "direct feedthrough of a linear system: Ljung, System Identification (1999), ch. 4",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [gain] = take(parameters);
        Self { gain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn the_arriving_jet_shows_at_once_and_leaves_nothing_behind() {
        let direct: DirectPart<f64> = prepared(&[-0.3]);
        let y = readings(&direct, |_| 0.5, |k| if k == 3 { 1.0 } else { 0.0 });
        assert_eq!(y[2..5], [0.5, 0.2, 0.5]);
    }
}

//! Direct coupling of the valve's current into the sensor's cable.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// y = s + g·u, without delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElectricalPickup<T> {
    gain: T,
}

impl<T: Real> Effect<T> for ElectricalPickup<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, _state: &mut (), signal: T, at: &Instant<'_, T>) -> T {
        signal + self.gain * at.command
    }
}

impl<T: Real> Physics<T> for ElectricalPickup<T> {
    const SPEC: Spec = Spec {
        name: "electrical-pickup",
        rust: "electrical_pickup::ElectricalPickup",
        place: Place::Sensor,
        summary: "the command shows in the reading at once",
        equation: "y = s + g·u",
        parameters: &[Parameter::new("gain", Unit::Y, [-0.5, 0.5], &[0.05])],
        amplitude: Some(Amplitude::new("gain", "an electrical pickup").linear()),
        source: "common-impedance coupling",
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
    fn the_command_shows_at_once_and_leaves_nothing_behind() {
        let pickup: ElectricalPickup<f64> = prepared(&[0.07]);
        let y = readings(&pickup, |_| 0.2, |k| if k == 3 { 1.0 } else { 0.0 });
        assert_eq!(y[2..5], [0.2, 0.27, 0.2]);
    }
}

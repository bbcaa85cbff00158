//! The valve's current is seen by the sensor's cable, at once.

use crate::effect::{Effect, Influence, Instant, Parameter, Physics, Place, Setting, Spec, take};
use crate::real::Real;


/// y = s + g·u, without delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElectricalPickup<T> {
    gain: T,
}

impl<T: Real> Effect<T> for ElectricalPickup<T> {
    type State = ();
    fn start(&self) {}
    #[inline]
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
        parameters: &[
            Parameter { name: "gain", unit: "y", low: -0.5, high: 0.5, starts: &[0.05], influence: Influence::Smooth },
        ],
        channel: None,
        source: "common-impedance coupling",
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [gain] = take(parameters);
        Self { gain }
    }
}

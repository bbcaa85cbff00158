//! The sensor reads a constant offset.
//!
//! This is not a missing effect but a disturbance that every rig may have. It belongs to the base model, so that
//! other effects do not imitate it.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// y = s + o.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroOffset<T> {
    level: T,
}

impl<T: Real> Effect<T> for ZeroOffset<T> {
    type State = ();
    fn start(&self) {}
    #[inline(always)]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        signal + self.level
    }
}

impl<T: Real> Physics<T> for ZeroOffset<T> {
    const SPEC: Spec = Spec {
        name: "zero-offset",
        rust: "zero_offset::ZeroOffset",
        place: Place::Sensor,
        summary: "the sensor reads a constant offset when the friction gain is 0",
        equation: "y = s + o",
        parameters: &[Parameter::new("level", Unit::Y, [-1e6, 1e6], &[0.0])],
        amplitude: Some(Amplitude::new("level", "an offset of the sensor").linear()),
        base: true,
        source: "definition: the normalised friction is 0 for the natural, separated flow",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], _setting: &Setting<T>) -> Self {
        let [level] = take(parameters);
        Self { level }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reading_is_off_by_the_level_and_by_nothing_else() {
        let setting = Setting {
            period: 0.001_f64,
            channel: 0,
            reference: 1.0,
        };
        let effect = ZeroOffset::new(&[0.05], &setting);
        let at = Instant {
            command: 1.0,
            flow: 0.3,
            arrived: 1.0,
            present: 1.0,
            channels: &[],
        };
        assert_eq!(effect.sense(&mut (), 0.25, &at), 0.3);
        assert_eq!(effect.sense(&mut (), -1.0, &at), -0.95);
    }

    #[test]
    fn it_is_no_entry_of_the_catalogue_of_missing_effects() {
        let name = ZeroOffset::<f64>::SPEC.name;
        assert!(crate::effects::SPECS.iter().all(|spec| spec.name != name));
        assert_eq!(crate::effects::spec(name).map(|spec| spec.name), Some(name));
    }
}

//! Direct coupling of the valve's current into the sensor's cable.

use crate::effect::{
    Amplitude, Effect, Instant, Needs, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// y = s + g·u(t − d), with u linear between samples. A rig that reads before it sets the command of the same row
/// shows the command one sample later than a rig that reads after it. d of more than two samples counts as two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElectricalPickup<T> {
    gain: T,
    /// Shares of d in the first and in the second sample.
    delay: [T; 2],
}

impl<T: Real> Effect<T> for ElectricalPickup<T> {
    /// The last two commands, the later one first.
    type State = [T; 2];
    fn start(&self) -> [T; 2] {
        [T::ZERO; 2]
    }
    #[inline(always)]
    fn sense(&self, past: &mut [T; 2], signal: T, at: &Instant<'_, T>) -> T {
        let [last, before] = *past;
        *past = [at.command, last];
        let [first, second] = self.delay;
        signal + self.gain * (at.command + first * (last - at.command) + second * (before - last))
    }
}

impl<T: Real> Physics<T> for ElectricalPickup<T> {
    const SPEC: Spec = Spec {
        name: "electrical-pickup",
        rust: "electrical_pickup::ElectricalPickup",
        place: Place::Sensor,
        summary: "the command couples electrically into the reading, without the flow",
        equation: "y(t) = s(t) + g·u(t − d)",
        parameters: &[
            Parameter::new("gain", Unit::Y, [-0.5, 0.5], &[0.05]),
            Parameter::new("delay", Unit::Second, [0.0, 0.002], &[0.0005]).or_else(0.0),
        ],
        amplitude: Some(Amplitude::new("gain", "an electrical pickup").linear()),
        needs: Needs::DeadTime,
        source: "common-impedance coupling",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [gain, delay] = take(parameters);
        let samples = delay / setting.period;
        let share = |from: T| (samples - from).at_least(T::ZERO).at_most(T::ONE);
        Self {
            gain,
            delay: [share(T::ZERO), share(T::ONE)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn the_command_shows_at_once_and_leaves_nothing_behind() {
        let pickup: ElectricalPickup<f64> = prepared(&[0.07, 0.0]);
        let y = readings(&pickup, |_| 0.2, |k| if k == 3 { 1.0 } else { 0.0 });
        assert_eq!(y[2..5], [0.2, 0.27, 0.2]);
    }

    #[test]
    fn a_reading_that_precedes_the_command_shows_it_later() {
        let shown = |delay: f64| {
            let pickup: ElectricalPickup<f64> = prepared(&[0.1, delay]);
            let y = readings(&pickup, |_| 0.0, |k| if k == 3 { 1.0 } else { 0.0 });
            [y[3], y[4], y[5], y[6]]
        };
        assert_eq!(shown(0.001), [0.0, 0.1, 0.0, 0.0]);
        assert_eq!(shown(0.0015), [0.0, 0.05, 0.05, 0.0]);
        assert_eq!(shown(0.002), [0.0, 0.0, 0.1, 0.0]);
        assert_eq!(shown(0.1), shown(0.002));
    }
}

//! The valve current couples into the sensor cable.

use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics, signed};
use crate::plant::base::BasePlant;
use crate::plant::part::{Moment, Part, Place, SensorPart, Surroundings};

/// gain·u is added to the reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElectricalPickup {
    /// Reading added while the valve is energised (y).
    pub gain: f64,
}

impl Physics for ElectricalPickup {
    const NAME: &'static str = "electrical-pickup";
    const PLACE: Place = Place::Cable;
    const PARAMETERS: &'static [Card<Self>] =
        &[Card::new("gain", "y", Limits::FINITE, |e| &mut e.gain)];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: signed(rng, 0.06, 0.25),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(*self))
    }
}

impl SensorPart for ElectricalPickup {
    fn read(&self, signal: f64, at: &Moment) -> f64 {
        signal + self.gain * at.command
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::FlowDelay;
    use crate::plant::rig::bench::rig;

    #[test]
    fn pickup_is_read_with_the_command_before_the_flow_moves() {
        let effect = ElectricalPickup { gain: 0.2 };
        let mut rig = rig(FlowDelay::Fixed { delay_s: 0.03 }, &[effect.into()]);
        let y = rig.play(&[0.0, 1.0, 1.0, 0.0, 0.0]);
        assert_eq!(y, [0.0, 0.2, 0.2, 0.0, 0.0]);
    }
}

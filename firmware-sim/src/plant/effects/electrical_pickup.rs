//! The valve current couples into the sensor cable.

use super::signed;
use crate::plant::effects::physics;
use crate::plant::part::{Moment, Part, SensorPart};

physics! {
    /// gain·u is added to the reading.
    ElectricalPickup = "electrical-pickup" at Cable
    parameters(_, rng) {
        /// Reading added while the valve is energised.
        gain ["y", FINITE] = signed(rng, 0.06, 0.25);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
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

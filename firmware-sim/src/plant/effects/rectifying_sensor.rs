//! A sensor that measures only the magnitude of the friction and loses its sign.

use super::ShowsWith;
use crate::plant::effects::physics;
use crate::plant::part::{Part, SensorPart};

physics! {
    /// The film measures the magnitude of the friction.
    RectifyingSensor = "rectifying-sensor" at Sense {
        /// The effect changes negative friction only.
        const SHOWS_WITH: ShowsWith = ShowsWith::SignedLevels;
    }
    parameters(_, _) {}
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl SensorPart for RectifyingSensor {
    fn jump(&mut self, to: f64) -> f64 {
        to.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn what_is_below_zero_is_folded_up() {
        let mut folded = sensor([RectifyingSensor {}.at_rest()]);
        assert_eq!(reading(&mut folded, -0.3), 0.3);
        assert_eq!(reading(&mut folded, 0.3), 0.3);
    }
}

//! A delay that decreases linearly with the mean friction, down to a minimum.

use crate::plant::base::FlowDelay;
use crate::plant::effects::StateDependentDelay;
use crate::plant::effects::physics;
use crate::plant::part::Part;

physics! {
    /// h = floor + rise·max(1 − ỹ/level, 0); replaces the base plant's delay.
    ClampedDelay = "clamped-delay" at Transport, like StateDependentDelay
    parameters(base, rng) {
        /// Delay of the attached flow.
        floor ["s", TRAVEL] = rng.random_range(0.020..0.040);
        /// Extra delay of the separated flow.
        rise ["s", TRAVEL] = rng.random_range(0.010..0.020);
        /// Mean friction above which the delay is constant.
        level ["y", POSITIVE] = rng.random_range(0.3..0.8) * base.gain;
    }
    part(law, _) {
        Part::Delay(FlowDelay::Clamped {
            floor_s: law.floor,
            rise_s: law.rise,
            level: law.level,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::transport::ArrivalClock;

    #[test]
    fn the_delay_is_a_line_and_then_a_floor() {
        let law = ClampedDelay {
            floor: 0.03,
            rise: 0.02,
            level: 0.5,
        };
        let Part::Delay(law) = law.at_rest() else {
            panic!("it sets the delay");
        };
        let clock = ArrivalClock::new(law);
        let expected = [
            (-0.2, 0.05),
            (0.0, 0.05),
            (0.25, 0.04),
            (0.5, 0.03),
            (2.0, 0.03),
        ];
        for (mean, delay) in expected {
            assert!((clock.delay(mean) - delay).abs() < 1e-12, "{mean}");
        }
    }
}

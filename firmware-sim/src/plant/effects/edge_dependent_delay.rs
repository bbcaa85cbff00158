//! Different delays of rising and falling edges.

use crate::plant::base::FlowDelay;
use crate::plant::effects::physics;
use crate::plant::part::Part;

physics! {
    /// Rising and falling edges travel for different times; replaces the base plant's delay.
    EdgeDependentDelay = "edge-dependent-delay" at Transport
    parameters(_, rng) {
        /// Delay of a rising edge.
        rise_delay ["s", TRAVEL] = rise_delay;
        /// Delay of a falling edge.
        fall_delay ["s", TRAVEL] = fall_delay;
    }
    where {
        let (rise_delay, fall_delay) = loop {
            let rise_delay: f64 = rng.random_range(0.020..0.060);
            let fall_delay: f64 = rng.random_range(0.020..0.060);
            if (rise_delay - fall_delay).abs() > 0.008 {
                break (rise_delay, fall_delay);
            }
        };
    }
    part(law, _) {
        Part::Delay(FlowDelay::EdgeDependent {
            rise_s: law.rise_delay,
            fall_s: law.fall_delay,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::rig::bench::rig;

    #[test]
    fn edges_with_delays_of_their_own_lengthen_the_pulse_by_the_difference() {
        let effect = EdgeDependentDelay {
            rise_delay: 0.025,
            fall_delay: 0.0405,
        };
        let mut rig = rig(FlowDelay::Fixed { delay_s: 0.05 }, &[effect.into()]);
        let mut command = vec![1.0; 50];
        command.resize(200, 0.0);
        let y = rig.play(&command);
        let peak = 1.0 - (-(0.050 + 0.0155) / 0.04_f64).exp();
        assert!(y[25] == 0.0 && y[26] > 0.0);
        assert!((y[150] - peak * (-(0.150 - 0.0905) / 0.1_f64).exp()).abs() < 1e-8);
    }
}

//! State-dependent delay: h = floor + rise·exp(−rate·ỹ).

use crate::plant::SAMPLE_PERIOD_S;
use crate::plant::base::FlowDelay;
use crate::plant::effects::physics;
use crate::plant::part::Part;

physics! {
    /// h = floor + rise·exp(−rate·ỹ); replaces the base plant's delay.
    StateDependentDelay = "state-dependent-delay" at Transport
    parameters(_, rng) {
        /// Delay of the attached flow.
        delay_floor ["samples", SAMPLES] = rng.random_range(20.0..40.0);
        /// Extra delay of the separated flow.
        delay_rise ["samples", SAMPLES] = delay_rise;
        /// Rate at which the extra delay decreases with the mean friction.
        delay_rate ["1/y", NOT_NEGATIVE] =
            rng.random_range(2.0..10.0_f64.min(200.0 / delay_rise));
    }
    where { let delay_rise = rng.random_range(10.0..20.0); }
    part(law, _) {
        Part::Delay(FlowDelay::StateDependent {
            floor_s: law.delay_floor * SAMPLE_PERIOD_S,
            rise_s: law.delay_rise * SAMPLE_PERIOD_S,
            rate: law.delay_rate,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_become_seconds() {
        let effect = StateDependentDelay {
            delay_floor: 30.0,
            delay_rise: 12.0,
            delay_rate: 8.0,
        };
        let Part::Delay(FlowDelay::StateDependent {
            floor_s,
            rise_s,
            rate,
        }) = effect.at_rest()
        else {
            panic!("it sets the delay");
        };
        assert_eq!((floor_s, rise_s, rate), (0.030, 0.012, 8.0));
    }
}

//! Effects with other equations than the catalogue's, as on real rigs.
//!
//! Each resembles an effect of the catalogue, whose name is then a correct diagnosis.

mod clamped_delay;
mod fifth_power;
mod king_exponent;
mod ramp_valve;
mod second_order_valve;
mod slow_vortex;
mod smeared_echo;
mod smooth_latch;
mod soft_rails;
mod two_film_lags;
mod two_reservoirs;
mod two_time_drift;

use rand_chacha::ChaCha8Rng;

use super::base::BasePlant;
use super::effects::{
    EffectError, Parameter, Physics, ShowsWith, catalogue, parameters, validate, with,
};
use super::part::{Part, Place, Surroundings};

catalogue! {
    /// An effect with another equation than the catalogue's.
    Altered {
        clamped_delay::ClampedDelay,
        second_order_valve::SecondOrderValve,
        ramp_valve::RampValve,
        two_reservoirs::TwoReservoirs,
        smeared_echo::SmearedEcho,
        slow_vortex::SlowVortex,
        smooth_latch::SmoothLatch,
        fifth_power::FifthPower,
        king_exponent::KingExponent,
        two_film_lags::TwoFilmLags,
        two_time_drift::TwoTimeDrift,
        soft_rails::SoftRails,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::Effect;
    use rand::SeedableRng;

    #[test]
    fn every_law_resembles_an_effect_of_the_catalogue_and_draws_valid_values() {
        for name in Altered::NAMES {
            for seed in 0..200 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let base = BasePlant::draw(&mut rng);
                let altered = Altered::draw(name, &base, &mut rng).unwrap();
                altered.validate().unwrap();
                assert!(Effect::NAMES.contains(&altered.resembles()), "{name}");
                assert!(!Effect::NAMES.contains(name));
                assert!(!altered.parameters().is_empty());
            }
        }
    }
}

//! King's law with another exponent than one third.

use crate::plant::base::log_uniform;
use crate::plant::effects::HotFilmNonlinearity;
use crate::plant::effects::physics;
use crate::plant::part::{Part, SensorPart};

physics! {
    /// E = √(1 + κ·(s + s0)ⁿ), normalised to keep 0 and 1.
    KingExponent = "king-exponent" at Film, like HotFilmNonlinearity
    parameters(_, rng) {
        /// κ.
        king_ratio ["-", POSITIVE] = log_uniform(rng, 0.4, 4.0);
        /// s0.
        king_offset ["y", NOT_NEGATIVE] = log_uniform(rng, 0.02, 0.15);
        /// n.
        exponent ["-", POSITIVE] = rng.random_range(0.28..0.50);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl KingExponent {
    fn voltage(&self, s: f64) -> f64 {
        (1.0 + self.king_ratio * (s + self.king_offset).max(0.0).powf(self.exponent)).sqrt()
    }
}

impl SensorPart for KingExponent {
    fn jump(&mut self, to: f64) -> f64 {
        let (zero, one) = (self.voltage(0.0), self.voltage(1.0));
        (self.voltage(to) - zero) / (one - zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::HotFilmNonlinearity;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn with_one_third_it_is_kings_law() {
        let altered = KingExponent {
            king_ratio: 1.5,
            king_offset: 0.05,
            exponent: 1.0 / 3.0,
        };
        let king = HotFilmNonlinearity {
            king_ratio: 1.5,
            king_offset: 0.05,
        };
        let mut films = [sensor([altered.at_rest()]), sensor([king.at_rest()])];
        for s in [-0.2, 0.0, 0.3, 1.0, 1.2] {
            let [a, b] = films.each_mut().map(|film| reading(film, s));
            assert!((a - b).abs() < 1e-12);
        }
    }
}

//! King's law of the hot film.

use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{Part, SensorPart};

physics! {
    /// Bridge voltage E = √(1 + κ·(s + s0)^⅓), normalised to keep 0 and 1.
    HotFilmNonlinearity = "hot-film-nonlinearity" at Film
    parameters(_, rng) {
        /// κ, forced against natural convection.
        king_ratio ["-", KING_RATIO] = log_uniform(rng, 0.4, 4.0);
        /// Friction at which the convection would vanish, s0.
        king_offset ["y", NOT_NEGATIVE] = log_uniform(rng, 0.02, 0.2);
    }
    part(law, _) { Part::Sensor(Box::new(*law)) }
}

impl HotFilmNonlinearity {
    /// Negative friction counts as 0.
    fn voltage(&self, s: f64) -> f64 {
        (1.0 + self.king_ratio * (s + self.king_offset).max(0.0).cbrt()).sqrt()
    }
}

impl SensorPart for HotFilmNonlinearity {
    fn jump(&mut self, to: f64) -> f64 {
        let (zero, one) = (self.voltage(0.0), self.voltage(1.0));
        (self.voltage(to) - zero) / (one - zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{reading, sensor};

    #[test]
    fn kings_law_keeps_zero_and_one_and_bulges_between() {
        let (king_ratio, king_offset) = (2.0, 0.1);
        let king = HotFilmNonlinearity {
            king_ratio,
            king_offset,
        };
        let mut film = sensor([king.at_rest()]);
        assert!(reading(&mut film, 0.0).abs() < 1e-12);
        assert!((reading(&mut film, 1.0) - 1.0).abs() < 1e-12);
        let e = |s: f64| (1.0 + king_ratio * (s + king_offset).powf(1.0 / 3.0)).sqrt();
        let expected = (e(0.4) - e(0.0)) / (e(1.0) - e(0.0));
        assert!((reading(&mut film, 0.4) - expected).abs() < 1e-12);
        assert!(expected > 0.5, "steep where the flow is slow: {expected}");
    }
}

//! First-order lag of the film.

use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{Part, Piece, SensorPart};

physics! {
    /// τ·ẏ = x − y.
    HotFilmLag = "hot-film-lag" at FilmLag
    parameters(_, rng) {
        /// Time constant.
        time_constant ["s", TIME] = log_uniform(rng, 0.010, 0.100);
    }
    part(law, _) {
        Part::Sensor(Box::new(Lag {
            time_constant: law.time_constant,
            film: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Lag {
    time_constant: f64,
    film: f64,
}

impl SensorPart for Lag {
    fn takes_time(&self) -> bool {
        true
    }

    fn jump(&mut self, _to: f64) -> f64 {
        self.film
    }

    /// For a straight x: y = x − slope·τ + (y0 − x0 + slope·τ)·e^(−t/τ).
    fn advance(&mut self, piece: &Piece) -> f64 {
        let behind = (piece.to - piece.from) / piece.dt * self.time_constant;
        let left = (-piece.dt / self.time_constant).exp();
        self.film = piece.to - behind + (self.film - piece.from + behind) * left;
        self.film
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn the_film_lags_by_its_time_constant() {
        let lag = HotFilmLag {
            time_constant: 0.02,
        };
        let mut film = sensor([lag.at_rest()]);
        film.jump(1.0);
        for _ in 0..400 {
            film.advance(5e-5, 1.0);
        }
        assert!((read(&mut film, 0.02, 0.0) - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
    }
}

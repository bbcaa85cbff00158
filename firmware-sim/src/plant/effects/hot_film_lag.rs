//! First-order lag of the film.

use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::part::{Part, Piece, Place, SensorPart, Surroundings};

/// τ·ẏ = x − y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HotFilmLag {
    /// Time constant (s).
    pub time_constant: f64,
}

impl Physics for HotFilmLag {
    const NAME: &'static str = "hot-film-lag";
    const PLACE: Place = Place::FilmLag;
    const PARAMETERS: &'static [Card<Self>] =
        &[Card::new("time_constant", "s", Limits::TIME, |e| {
            &mut e.time_constant
        })];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            time_constant: log_uniform(rng, 0.010, 0.100),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Sensor(Box::new(Lag {
            time_constant: self.time_constant,
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

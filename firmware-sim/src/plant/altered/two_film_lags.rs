//! A film with two lags in series: film and substrate.

use crate::plant::base::log_uniform;
use crate::plant::effects::HotFilmLag;
use crate::plant::effects::physics;
use crate::plant::part::{Part, Piece, SensorPart};

physics! {
    /// τ₁·ẋ = felt − x, τ₂·ẏ = x − y.
    TwoFilmLags = "two-film-lags" at FilmLag, like HotFilmLag
    parameters(_, rng) {
        /// Longer time constant.
        first_time ["s", TIME] = log_uniform(rng, 0.015, 0.080);
        /// Shorter time constant.
        second_time ["s", TIME] = log_uniform(rng, 0.004, 0.014);
    }
    part(law, _) {
        Part::Sensor(Box::new(Film {
            law: *law,
            first: 0.0,
            second: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Film {
    law: TwoFilmLags,
    first: f64,
    second: f64,
}

impl SensorPart for Film {
    fn takes_time(&self) -> bool {
        true
    }

    fn jump(&mut self, _to: f64) -> f64 {
        self.second
    }

    /// The input of each lag is averaged over the piece.
    fn advance(&mut self, piece: &Piece) -> f64 {
        let before = self.first;
        let felt = 0.5 * (piece.from + piece.to);
        self.first = felt + (before - felt) * (-piece.dt / self.law.first_time).exp();
        let felt = 0.5 * (before + self.first);
        self.second = felt + (self.second - felt) * (-piece.dt / self.law.second_time).exp();
        self.second
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sensor::bench::{read, sensor};

    #[test]
    fn a_step_is_followed_by_the_closed_form() {
        let (a, b) = (0.03, 0.01);
        let law = TwoFilmLags {
            first_time: a,
            second_time: b,
        };
        let mut film = sensor([law.at_rest()]);
        film.jump(1.0);
        for _ in 0..400 {
            film.advance(5e-5, 1.0);
        }
        let t = 0.02_f64;
        let expected = 1.0 - (a * (-t / a).exp() - b * (-t / b).exp()) / (a - b);
        assert!((read(&mut film, t, 0.0) - expected).abs() < 1e-5);
    }
}

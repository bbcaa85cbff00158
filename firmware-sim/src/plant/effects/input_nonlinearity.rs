//! The jet is a cubic of the valve opening.

use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics, ShowsWith, signed};
use crate::plant::base::BasePlant;
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};

/// j = v·(1 + v·(quadratic + v·cubic)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputNonlinearity {
    /// Coefficient of v² (1/u).
    pub quadratic: f64,
    /// Coefficient of v³ (1/u²).
    pub cubic: f64,
}

impl Physics for InputNonlinearity {
    const NAME: &'static str = "input-nonlinearity";
    const PLACE: Place = Place::Nozzle;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("quadratic", "1/u", Limits::FINITE, |e| &mut e.quadratic),
        Card::new("cubic", "1/u²", Limits::FINITE, |e| &mut e.cubic),
    ];
    const SHOWS_WITH: ShowsWith = ShowsWith::Levels;

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        loop {
            let quadratic = signed(rng, 0.20, 0.50);
            let cubic = signed(rng, 0.08, 0.25);
            // The jet must increase monotonically with the opening.
            let steepness = |v: f64| 1.0 + v * (2.0 * quadratic + 3.0 * v * cubic);
            if steepness(0.5).min(steepness(1.0)) > 0.15 {
                break Self { quadratic, cubic };
            }
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(*self))
    }
}

impl JetPart for InputNonlinearity {
    fn jump(&mut self, _t: f64, _from: f64, v: f64) -> f64 {
        v * (1.0 + v * (self.quadratic + v * self.cubic))
    }

    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        self.jump(t, piece.from, piece.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn levels_go_through_the_cubic() {
        let effect = InputNonlinearity {
            quadratic: 0.4,
            cubic: -0.2,
        };
        let mut jet = jet([effect.at_rest()]);
        jet.command(0.5);
        assert!((run(&mut jet, 0.01) - (0.5 + 0.1 - 0.025)).abs() < 1e-12);
    }
}

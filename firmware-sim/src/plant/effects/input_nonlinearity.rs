//! The jet is a cubic of the valve opening.

use super::{ShowsWith, signed};
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// j = v·(1 + v·(quadratic + v·cubic)).
    InputNonlinearity = "input-nonlinearity" at Nozzle {
        const SHOWS_WITH: ShowsWith = ShowsWith::Levels;
    }
    parameters(_, rng) {
        /// Coefficient of v².
        quadratic ["1/u", FINITE] = quadratic;
        /// Coefficient of v³.
        cubic ["1/u²", FINITE] = cubic;
    }
    where {
        let (quadratic, cubic) = loop {
            let quadratic = signed(rng, 0.20, 0.50);
            let cubic = signed(rng, 0.08, 0.25);
            // The jet must increase monotonically with the opening.
            let steepness = |v: f64| 1.0 + v * (2.0 * quadratic + 3.0 * v * cubic);
            if steepness(0.5).min(steepness(1.0)) > 0.15 {
                break (quadratic, cubic);
            }
        };
    }
    part(law, _) { Part::Jet(Box::new(*law)) }
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

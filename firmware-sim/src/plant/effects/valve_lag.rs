//! First-order valve.

use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};

/// v̇ = (u − v)/τ with one τ while opening, another while closing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveLag {
    /// Time constant while opening (s).
    pub opening_time: f64,
    /// Time constant while closing (s).
    pub closing_time: f64,
}

impl Physics for ValveLag {
    const NAME: &'static str = "valve-lag";
    const PLACE: Place = Place::Valve;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("opening_time", "s", Limits::TIME, |e| &mut e.opening_time),
        Card::new("closing_time", "s", Limits::TIME, |e| &mut e.closing_time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            opening_time: log_uniform(rng, 0.005, 0.025),
            closing_time: log_uniform(rng, 0.008, 0.050),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Valve {
            lag: *self,
            opening: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Valve {
    lag: ValveLag,
    opening: f64,
}

impl JetPart for Valve {
    fn jump(&mut self, _t: f64, _from: f64, _to: f64) -> f64 {
        self.opening
    }

    /// Exact: the target is constant within a piece.
    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        let target = piece.to;
        let tau = if target > self.opening {
            self.lag.opening_time
        } else {
            self.lag.closing_time
        };
        self.opening = target + (self.opening - target) * (-piece.dt / tau).exp();
        self.opening
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn the_valve_opens_and_closes_with_its_own_time_constants() {
        let lag = ValveLag {
            opening_time: 0.01,
            closing_time: 0.03,
        };
        let mut jet = jet([lag.at_rest()]);
        jet.command(1.0);
        assert!((run(&mut jet, 0.01) - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
        let open = run(&mut jet, 0.2);
        jet.command(0.0);
        assert!((run(&mut jet, 0.23) - open * (-1.0_f64).exp()).abs() < 1e-9);
    }
}

//! First-order valve.

use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// v̇ = (u − v)/τ with one τ while opening, another while closing.
    ValveLag = "valve-lag" at Valve
    parameters(_, rng) {
        /// Time constant while opening.
        opening_time ["s", TIME] = log_uniform(rng, 0.005, 0.025);
        /// Time constant while closing.
        closing_time ["s", TIME] = log_uniform(rng, 0.008, 0.050);
    }
    part(law, _) {
        Part::Jet(Box::new(Valve {
            lag: *law,
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

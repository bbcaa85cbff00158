//! Pressure drop of the plenum during blowing.

use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// Ṗ = (1 − P)/τ_r − κ·v·P, j = v·P, P = 1 at the start.
    PlenumDroop = "plenum-droop" at Plenum
    parameters(_, rng) {
        /// Refill time constant τ_r.
        recovery_time ["s", TIME] = recovery_time;
        /// Emptying rate κ at full opening.
        depletion_rate ["1/s", NOT_NEGATIVE] = lost / ((1.0 - lost) * recovery_time);
    }
    where {
        let recovery_time = log_uniform(rng, 0.3, 2.5);
        // Pressure lost under steady blowing.
        let lost = rng.random_range(0.15..0.40);
    }
    part(law, _) {
        Part::Jet(Box::new(Plenum {
            droop: *law,
            pressure: 1.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Plenum {
    droop: PlenumDroop,
    pressure: f64,
}

impl JetPart for Plenum {
    fn jump(&mut self, _t: f64, _from: f64, to: f64) -> f64 {
        to * self.pressure
    }

    /// Exact for an opening that is constant over the piece.
    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        let PlenumDroop {
            recovery_time,
            depletion_rate,
        } = self.droop;
        let v = 0.5 * (piece.from + piece.to);
        let rate = 1.0 / recovery_time + depletion_rate * v;
        let rest = 1.0 / (recovery_time * rate);
        self.pressure = rest + (self.pressure - rest) * (-rate * piece.dt).exp();
        piece.to * self.pressure
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn the_plenum_settles_where_supply_meets_demand_and_recovers() {
        let (recovery_time, depletion_rate) = (0.5, 0.8);
        let droop = PlenumDroop {
            recovery_time,
            depletion_rate,
        };
        let mut jet = jet([droop.at_rest()]);
        jet.command(1.0);
        let rest = 1.0 / (1.0 + recovery_time * depletion_rate);
        assert!((run(&mut jet, 10.0) - rest).abs() < 1e-9);
        jet.command(0.0);
        assert_eq!(run(&mut jet, 10.5), 0.0, "a closed valve blows nothing");
        let recovered = 1.0 - (1.0 - rest) * (-1.0_f64).exp();
        jet.command(1.0);
        assert!((run(&mut jet, 10.5) - recovered).abs() < 1e-9);
    }
}

//! A plenum fed from a tank that empties as well.

use crate::plant::base::log_uniform;
use crate::plant::effects::PlenumDroop;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};

physics! {
    /// Ṗ = (B − P)/τ_p − κ·v·P, Ḃ = (1 − B)/τ_b − ρ·(B − P)/τ_p; j = v·P, both full at the start.
    TwoReservoirs = "two-reservoirs" at Plenum, like PlenumDroop
    parameters(_, rng) {
        /// Time constant with which the tank fills the plenum, τ_p.
        recovery_time ["s", TIME] = recovery_time;
        /// Time constant with which the supply fills the tank, τ_b.
        tank_time ["s", TIME] = log_uniform(rng, 1.5, 5.0);
        /// Volume of the plenum over that of the tank, ρ.
        volume_ratio ["-", NOT_NEGATIVE] = rng.random_range(0.03..0.12);
        /// Emptying rate of the plenum at full opening, κ.
        depletion_rate ["1/s", NOT_NEGATIVE] = lost / ((1.0 - lost) * recovery_time);
    }
    where {
        let recovery_time = log_uniform(rng, 0.15, 0.6);
        let lost = rng.random_range(0.12..0.25);
    }
    part(law, _) {
        Part::Jet(Box::new(Supply {
            law: *law,
            plenum: 1.0,
            tank: 1.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Supply {
    law: TwoReservoirs,
    plenum: f64,
    tank: f64,
}

impl JetPart for Supply {
    fn jump(&mut self, _t: f64, _from: f64, to: f64) -> f64 {
        to * self.plenum
    }

    /// Midpoint rule: the fastest time constant is thousands of sub-steps.
    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        let v = 0.5 * (piece.from + piece.to);
        let speeds = |plenum: f64, tank: f64| {
            let inflow = (tank - plenum) / self.law.recovery_time;
            (
                inflow - self.law.depletion_rate * v * plenum,
                (1.0 - tank) / self.law.tank_time - self.law.volume_ratio * inflow,
            )
        };
        let (p, b) = speeds(self.plenum, self.tank);
        let half = 0.5 * piece.dt;
        let (p, b) = speeds(self.plenum + half * p, self.tank + half * b);
        self.plenum += piece.dt * p;
        self.tank += piece.dt * b;
        piece.to * self.plenum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn it_settles_where_supply_meets_demand_and_slowly_so() {
        let law = TwoReservoirs {
            recovery_time: 0.2,
            tank_time: 3.0,
            volume_ratio: 0.1,
            depletion_rate: 1.0,
        };
        let mut jet = jet([law.at_rest()]);
        jet.command(1.0);
        // The plenum alone would settle at 1/(1 + κτ_p).
        let first = run(&mut jet, 1.5);
        let plenum_alone = 1.0 / 1.2;
        assert!(first < plenum_alone && first > 0.7, "{first}");
        // In equilibrium κ·P = (B − P)/τ_p and (1 − B)/τ_b = ρ·κ·P.
        let rest = 1.0 / (1.0 + 0.2 + 3.0 * 0.1);
        assert!((run(&mut jet, 40.0) - rest).abs() < 1e-6);
    }
}

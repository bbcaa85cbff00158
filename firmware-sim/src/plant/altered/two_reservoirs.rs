//! A plenum fed from a tank that empties as well.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics, PlenumDroop};
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};

/// Ṗ = (B − P)/τ_p − κ·v·P, Ḃ = (1 − B)/τ_b − ρ·(B − P)/τ_p; j = v·P, both full at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoReservoirs {
    /// Time constant with which the tank fills the plenum, τ_p (s).
    pub recovery_time: f64,
    /// Time constant with which the supply fills the tank, τ_b (s).
    pub tank_time: f64,
    /// Volume of the plenum over that of the tank, ρ (-).
    pub volume_ratio: f64,
    /// Emptying rate of the plenum at full opening, κ (1/s).
    pub depletion_rate: f64,
}

impl Physics for TwoReservoirs {
    const NAME: &'static str = "two-reservoirs";
    const RESEMBLES: &'static str = PlenumDroop::NAME;
    const PLACE: Place = Place::Plenum;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("recovery_time", "s", Limits::TIME, |e| &mut e.recovery_time),
        Card::new("tank_time", "s", Limits::TIME, |e| &mut e.tank_time),
        Card::new("volume_ratio", "-", Limits::NOT_NEGATIVE, |e| {
            &mut e.volume_ratio
        }),
        Card::new("depletion_rate", "1/s", Limits::NOT_NEGATIVE, |e| {
            &mut e.depletion_rate
        }),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        let recovery_time = log_uniform(rng, 0.15, 0.6);
        let lost = rng.random_range(0.12..0.25);
        Self {
            recovery_time,
            tank_time: log_uniform(rng, 1.5, 5.0),
            volume_ratio: rng.random_range(0.03..0.12),
            depletion_rate: lost / ((1.0 - lost) * recovery_time),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Supply {
            law: *self,
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
        // κ·P = (B − P)/τ_p and (1 − B)/τ_b = ρ·κ·P.
        let rest = 1.0 / (1.0 + 0.2 + 3.0 * 0.1);
        assert!((run(&mut jet, 40.0) - rest).abs() < 1e-6);
    }
}

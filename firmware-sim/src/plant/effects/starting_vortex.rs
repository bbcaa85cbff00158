//! A vortex after switching on, added to the jet.

use super::vortex::Vortex;
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::Part;

physics! {
    /// ẇ = −w/τ + max(dj/dt, 0); the flow receives j + gain·w.
    StartingVortex = "starting-vortex" at Shedding
    parameters(_, rng) {
        /// Strength.
        gain ["-", FINITE] = rng.random_range(0.4..1.0);
        /// Time constant of the vortex's decay.
        decay_time ["s", TIME] = log_uniform(rng, 0.020, 0.080);
    }
    part(law, _) { Part::Jet(Box::new(Vortex::starting(law.gain, law.decay_time))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::effects::ValveLag;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn switching_on_sheds_a_decaying_vortex_and_switching_off_none() {
        let vortex = StartingVortex {
            gain: 0.8,
            decay_time: 0.02,
        };
        let mut jet = jet([vortex.at_rest()]);
        jet.command(1.0);
        assert!((run(&mut jet, 0.02) - (1.0 + 0.8 * (-1.0_f64).exp())).abs() < 1e-9);
        run(&mut jet, 1.0);
        jet.command(0.0);
        assert!(run(&mut jet, 1.001).abs() < 1e-9);
    }

    #[test]
    fn a_lagging_valve_feeds_it_more_slowly() {
        // ẇ = −w/τ + v̇ with v = 1 − exp(−t/τo): w = τ/(τ − τo)·(exp(−t/τ) − exp(−t/τo)).
        let (tau, opening) = (0.03, 0.01);
        let valve = ValveLag {
            opening_time: opening,
            closing_time: 0.01,
        };
        let vortex = StartingVortex {
            gain: 1.0,
            decay_time: tau,
        };
        let mut jet = jet([valve.at_rest(), vortex.at_rest()]);
        jet.command(1.0);
        let t = 0.025_f64;
        let v = 1.0 - (-t / opening).exp();
        let w = tau / (tau - opening) * ((-t / tau).exp() - (-t / opening).exp());
        assert!((run(&mut jet, t) - v - w).abs() < 1e-5);
    }
}

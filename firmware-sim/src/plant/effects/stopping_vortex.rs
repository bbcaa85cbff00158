//! A vortex after switching off, opposed to the jet.

use super::vortex::Vortex;
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::Part;

physics! {
    /// ẇ = −w/τ + max(−dj/dt, 0); the flow receives j − gain·w.
    StoppingVortex = "stopping-vortex" at Shedding
    parameters(_, rng) {
        /// Strength.
        gain ["-", FINITE] = rng.random_range(0.4..1.0);
        /// Time constant of the vortex's decay.
        decay_time ["s", TIME] = log_uniform(rng, 0.020, 0.080);
    }
    part(law, _) { Part::Jet(Box::new(Vortex::stopping(law.gain, law.decay_time))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn switching_off_leaves_a_decaying_suction_and_switching_on_nothing() {
        let vortex = StoppingVortex {
            gain: 0.5,
            decay_time: 0.04,
        };
        let mut jet = jet([vortex.at_rest()]);
        jet.command(1.0);
        assert_eq!(run(&mut jet, 0.3), 1.0);
        jet.command(0.0);
        assert!((run(&mut jet, 0.34) + 0.5 * (-1.0_f64).exp()).abs() < 1e-9);
    }
}

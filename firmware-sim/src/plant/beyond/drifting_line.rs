//! A delay of the valve line that increases during the record.

use super::line::{LineLaw, line};
use super::pulses::Pulses;
use super::{Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;

physics! {
    /// more·(1 − exp(−t/time)) on top of the transport delay, t the time in the record.
    DriftingLine = "drifting-line" at Line
    parameters(_, rng) {
        /// Final additional delay.
        more ["s", TRAVEL] = rng.random_range(0.012..0.030);
        /// Time constant of the drift.
        time ["s", TIME] = log_uniform(rng, 2.0, 8.0);
    }
    part(law, _) { line(*law) }
    truth(_) { Truth::new(Port::Delay, &["time in record"]) }
}

impl LineLaw for DriftingLine {
    fn takes(&self, _pulses: &Pulses, t: f64) -> f64 {
        self.more * (1.0 - (-t / self.time).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::line::bench::arrivals;

    #[test]
    fn edges_take_longer_the_later_they_are_sent() {
        let law = DriftingLine {
            more: 0.02,
            time: 1.0,
        };
        let sent = [0.1, 1.0];
        for (arrived, sent) in arrivals(law.at_rest(), &sent).iter().zip(sent) {
            let expected = sent + 0.02 * (1.0 - (-sent).exp());
            assert!((arrived - expected).abs() < 1e-9);
        }
    }
}

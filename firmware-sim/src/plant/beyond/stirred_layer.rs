//! Faster separation after much blowing.

use super::pulses::Pulses;
use super::{MEMORY_PER_WINDOW, Port, Truth};
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Piece};
use crate::waveform::{Cursor, Waveform};

physics! {
    /// Without a jet the rate is multiplied by 1 + gain·b, b the fraction of the last `window` seconds with a
    /// jet.
    StirredLayer = "stirred-layer" at Flow
    parameters(_, rng) {
        /// Relative increase of the rate after continuous blowing.
        gain ["-", NOT_NEGATIVE] = rng.random_range(0.8..2.5);
        /// Window length.
        window ["s", TIME] = log_uniform(rng, 0.25, 1.0);
    }
    part(law, _) {
        Part::Flow(Box::new(Stirred {
            law: *law,
            time: 0.0,
            blown: 0.0,
            pulses: Pulses::default(),
            past: Waveform::at_rest(0.0, law.window),
            cursor: Cursor::default(),
        }))
    }
    truth(law) {
        let window = format!("blowing in the last {} s × y", law.window);
        let memory = format!("memory of u ({} s) × y", MEMORY_PER_WINDOW * law.window);
        Truth::new(Port::Flow, &[&window, &memory])
    }
}

#[derive(Debug, Clone)]
struct Stirred {
    law: StirredLayer,
    time: f64,
    /// Blowing time within the window (s).
    blown: f64,
    pulses: Pulses,
    /// Blowing time since the start (s).
    past: Waveform,
    cursor: Cursor,
}

impl FlowPart for Stirred {
    fn drive(&self, s: f64, _z: f64) -> f64 {
        if self.pulses.is_on() {
            return 0.0;
        }
        -self.law.gain * self.blown / self.law.window * s
    }

    fn arrives(&mut self, jet: f64) {
        self.pulses.see(self.time, jet);
    }

    fn passed(&mut self, jet: &Piece, _s: f64) {
        self.time += jet.dt;
        self.pulses.see(self.time, jet.to);
        let now = self.past.before(self.time, &mut self.cursor);
        let now = if self.pulses.is_on() {
            now + jet.dt
        } else {
            now
        };
        self.past.line_to(self.time, now);
        let then = self.time - self.law.window;
        self.blown = now - self.past.before(then, &mut self.cursor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    /// A longer rest reduces the blowing time in the window, but at this time not yet.
    #[test]
    fn recent_blowing_sets_the_rate() {
        let law = StirredLayer {
            gain: 1.5,
            window: 0.5,
        };
        let mut flow = flow([law.at_rest()]);
        flow.jump(1.0);
        let s = hold(&mut flow, 1.0, 0.2);
        assert!((s - (1.0 - (-5.0_f64).exp())).abs() < 1e-9);
        flow.jump(0.0);
        let left = hold(&mut flow, 0.0, 0.1);
        let rate: f64 = 10.0 * (1.0 + 1.5 * 0.2 / 0.5);
        assert!((left - s * (-0.1 * rate).exp()).abs() < 1e-6, "{left}");
        // The window no longer contains blowing.
        let s = hold(&mut flow, 0.0, 0.7);
        let left = hold(&mut flow, 0.0, 0.1);
        assert!((left - s * (-1.0_f64).exp()).abs() < 1e-9 * s);
    }
}

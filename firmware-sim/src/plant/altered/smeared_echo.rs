//! A delayed and smeared second arrival of the jet.

use crate::plant::LONGEST_DELAY_S;
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::effects::{EchoPath, signed};
use crate::plant::part::{JetPart, Part, Piece};
use crate::waveform::{Cursor, Waveform};

physics! {
    /// j(t) = direct(t) + gain·w, smear·ẇ = direct(t − delay) − w.
    SmearedEcho = "smeared-echo" at Path, like EchoPath
    parameters(_, rng) {
        /// Strength of the echo.
        gain ["-", FINITE] = signed(rng, 0.20, 0.45);
        /// Additional delay until the echo starts.
        echo_delay ["s", TRAVEL] = log_uniform(rng, 0.060, 0.300);
        /// Smearing time constant.
        smear_time ["s", TIME] = log_uniform(rng, 0.008, 0.030);
    }
    part(law, _) {
        Part::Jet(Box::new(Echo {
            law: *law,
            direct: Waveform::at_rest(0.0, LONGEST_DELAY_S),
            cursor: Cursor::default(),
            washed: 0.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Echo {
    law: SmearedEcho,
    direct: Waveform,
    cursor: Cursor,
    washed: f64,
}

impl JetPart for Echo {
    fn jump(&mut self, _t: f64, _from: f64, to: f64) -> f64 {
        self.direct.jump_to(to);
        to + self.law.gain * self.washed
    }

    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        self.direct.line_to(t, piece.to);
        let then = t - 0.5 * piece.dt - self.law.echo_delay;
        let arriving = self.direct.at(then, &mut self.cursor);
        let left = (-piece.dt / self.law.smear_time).exp();
        self.washed = arriving + (self.washed - arriving) * left;
        piece.to + self.law.gain * self.washed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn the_echo_comes_back_gradually() {
        let law = SmearedEcho {
            gain: 0.4,
            echo_delay: 0.1,
            smear_time: 0.02,
        };
        let mut jet = jet([law.at_rest()]);
        jet.command(1.0);
        assert_eq!(run(&mut jet, 0.1), 1.0);
        let expected = 1.0 + 0.4 * (1.0 - (-1.0_f64).exp());
        assert!((run(&mut jet, 0.12) - expected).abs() < 1e-3);
        jet.command(0.0);
        assert!((run(&mut jet, 0.2) - 0.4).abs() < 0.01);
        assert!(run(&mut jet, 1.0).abs() < 1e-9);
    }
}

//! A delayed second arrival of the jet.

use std::collections::VecDeque;

use super::signed;
use crate::plant::base::log_uniform;
use crate::plant::effects::physics;
use crate::plant::part::{JetPart, Part, Piece};
use crate::plant::{LONGEST_DELAY_S, SHORTEST_PIECE_S};
use crate::waveform::{Cursor, Waveform};

physics! {
    /// j(t) = direct(t) + gain·direct(t − delay).
    EchoPath = "echo-path" at Path
    parameters(_, rng) {
        /// Strength of the echo.
        gain ["-", FINITE] = signed(rng, 0.15, 0.45);
        /// Additional delay.
        echo_delay ["s", TRAVEL] = log_uniform(rng, 0.060, 0.350);
    }
    part(law, _) {
        Part::Jet(Box::new(Echo {
            gain: law.gain,
            delay_s: law.echo_delay,
            direct: Waveform::at_rest(0.0, LONGEST_DELAY_S),
            cursor: Cursor::default(),
            returning: VecDeque::new(),
        }))
    }
}

/// (t + d) − d may be rounded to either side of t; the echo of a jump must be read on the correct side (s).
const RETURN_SLACK_S: f64 = SHORTEST_PIECE_S;

#[derive(Debug, Clone)]
struct Echo {
    gain: f64,
    delay_s: f64,
    direct: Waveform,
    cursor: Cursor,
    /// Times at which the echoes of the direct jet's jumps arrive.
    returning: VecDeque<f64>,
}

impl JetPart for Echo {
    fn jump(&mut self, t: f64, from: f64, to: f64) -> f64 {
        if to != from {
            self.direct.jump_to(to);
            self.returning.push_back(t + self.delay_s);
        }
        let then = t - self.delay_s + RETURN_SLACK_S;
        to + self.gain * self.direct.at(then, &mut self.cursor)
    }

    fn advance(&mut self, t: f64, piece: &Piece) -> f64 {
        self.direct.line_to(t, piece.to);
        let then = t - self.delay_s - RETURN_SLACK_S;
        piece.to + self.gain * self.direct.before(then, &mut self.cursor)
    }

    fn next_event(&self) -> Option<f64> {
        self.returning.front().copied()
    }

    fn event(&mut self) {
        self.returning.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::jet::bench::{jet, run};

    #[test]
    fn the_echo_returns_after_exactly_its_delay() {
        let echo = EchoPath {
            gain: -0.3,
            echo_delay: 0.080_013,
        };
        let mut jet = jet([echo.at_rest()]);
        jet.command(1.0);
        assert_eq!(run(&mut jet, 0.0800), 1.0);
        assert!((run(&mut jet, 0.0801) - 0.7).abs() < 1e-12);
        let mut c = Cursor::default();
        let (t, before, after) = jet.out.jump_inside(0.0, 1.0, &mut c).unwrap();
        assert!((t - 0.080_013).abs() < 1e-9 && before == 1.0 && (after - 0.7).abs() < 1e-12);
        jet.command(0.0);
        assert!(
            (run(&mut jet, 0.1) + 0.3).abs() < 1e-12,
            "only the echo is left"
        );
        assert!(run(&mut jet, 0.2).abs() < 1e-12);
    }
}

//! A delayed second arrival of the jet.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;

use super::{Card, Limits, Physics, signed};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};
use crate::plant::{LONGEST_DELAY_S, SHORTEST_PIECE_S};
use crate::waveform::{Cursor, Waveform};

/// j(t) = direct(t) + gain·direct(t − delay).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoPath {
    /// Strength of the echo (-).
    pub gain: f64,
    /// Additional delay (s).
    pub echo_delay: f64,
}

impl Physics for EchoPath {
    const NAME: &'static str = "echo-path";
    const PLACE: Place = Place::Path;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("gain", "-", Limits::FINITE, |e| &mut e.gain),
        Card::new("echo_delay", "s", Limits::TRAVEL, |e| &mut e.echo_delay),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: signed(rng, 0.15, 0.45),
            echo_delay: log_uniform(rng, 0.060, 0.350),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Echo {
            gain: self.gain,
            delay_s: self.echo_delay,
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

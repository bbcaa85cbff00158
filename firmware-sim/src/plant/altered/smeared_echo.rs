//! A delayed and smeared second arrival of the jet.

use rand_chacha::ChaCha8Rng;

use crate::plant::LONGEST_DELAY_S;
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, EchoPath, Limits, Physics, signed};
use crate::plant::part::{JetPart, Part, Piece, Place, Surroundings};
use crate::waveform::{Cursor, Waveform};

/// j(t) = direct(t) + gain·w, smear·ẇ = direct(t − delay) − w.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmearedEcho {
    /// Strength of the echo (-).
    pub gain: f64,
    /// Additional delay of its start (s).
    pub echo_delay: f64,
    /// Smearing time constant (s).
    pub smear_time: f64,
}

impl Physics for SmearedEcho {
    const NAME: &'static str = "smeared-echo";
    const RESEMBLES: &'static str = EchoPath::NAME;
    const PLACE: Place = Place::Path;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("gain", "-", Limits::FINITE, |e| &mut e.gain),
        Card::new("echo_delay", "s", Limits::TRAVEL, |e| &mut e.echo_delay),
        Card::new("smear_time", "s", Limits::TIME, |e| &mut e.smear_time),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gain: signed(rng, 0.20, 0.45),
            echo_delay: log_uniform(rng, 0.060, 0.300),
            smear_time: log_uniform(rng, 0.008, 0.030),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        Part::Jet(Box::new(Echo {
            law: *self,
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

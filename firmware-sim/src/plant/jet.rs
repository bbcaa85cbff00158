//! The path from command to jet: every part upstream of the transport delay.

use super::fault::Fault;
use super::part::{JetPart, Piece};
use super::{LONGEST_DELAY_S, SHORTEST_PIECE_S};
use crate::waveform::Waveform;

/// The jet's dynamics, upstream of the transport delay. They do not depend on the flow and may be computed ahead of
/// it.
#[derive(Debug, Clone)]
pub(crate) struct Jet {
    parts: Vec<Box<dyn JetPart>>,
    /// Input of each part, and output of the last one.
    signals: Vec<f64>,
    missing_every: Option<u32>,
    sticking: Option<(f64, f64)>,

    /// The coil's command.
    command: f64,
    pulses: u32,
    opened_at: f64,
    /// End time of a jam at half opening, if any.
    stuck_until: Option<f64>,
    time: f64,
    /// The jet towards the flow.
    pub(crate) out: Waveform,
}

impl Jet {
    /// The parts in the order of the signals.
    pub(crate) fn new(parts: Vec<Box<dyn JetPart>>, faults: &[Fault]) -> Self {
        let mut jet = Self {
            signals: vec![0.0; parts.len() + 1],
            parts,
            missing_every: None,
            sticking: None,
            command: 0.0,
            pulses: 0,
            opened_at: 0.0,
            stuck_until: None,
            time: 0.0,
            out: Waveform::at_rest(0.0, LONGEST_DELAY_S),
        };
        for fault in faults {
            match *fault {
                Fault::MissingPulse { every } => jet.missing_every = Some(every.max(2)),
                Fault::StickingValve {
                    after_open_s,
                    stuck_s,
                } => jet.sticking = Some((after_open_s, stuck_s)),
                Fault::FreezingSensor { .. } => {}
            }
        }
        jet
    }

    /// Sets the coil's command to `level` now.
    pub(crate) fn command(&mut self, level: f64) {
        if level == self.command {
            return;
        }
        let rising = level > self.command;
        self.command = level;
        self.stuck_until = None;
        let mut target = level;
        if rising {
            self.pulses = self.pulses.wrapping_add(1);
            self.opened_at = self.time;
            if self
                .missing_every
                .is_some_and(|n| self.pulses.is_multiple_of(n))
            {
                target = 0.0;
            }
        } else if let Some((after_open_s, stuck_s)) = self.sticking
            && self.time - self.opened_at >= after_open_s
        {
            self.stuck_until = Some(self.time + stuck_s);
            target = 0.5 * (self.signals[0] + level);
        }
        self.jump(0, target);
    }

    /// The input of a part jumps to `level`; its output may jump too.
    fn jump(&mut self, part: usize, level: f64) {
        let mut signal = level;
        for (i, part) in self.parts.iter_mut().enumerate().skip(part) {
            let before = std::mem::replace(&mut self.signals[i], signal);
            signal = part.jump(self.time, before, signal);
            if signal == self.signals[i + 1] {
                return;
            }
        }
        if let Some(last) = self.signals.last_mut() {
            *last = signal;
        }
        self.out.jump_to(self.leaving(signal));
    }

    fn leaving(&self, jet: f64) -> f64 {
        self.parts.iter().fold(jet, |sum, part| sum + part.shed())
    }

    /// Advances to time `to` in pieces no longer than the caller's sub-step.
    pub(crate) fn advance(&mut self, to: f64) {
        while to - self.time > SHORTEST_PIECE_S {
            let events = self.parts.iter().filter_map(|part| part.next_event());
            let stop = events
                .chain(self.stuck_until)
                .fold(to, |stop, event| stop.min(event.max(self.time)));
            if stop - self.time > SHORTEST_PIECE_S {
                self.piece(stop - self.time, stop);
            }
            if self.stuck_until.is_some_and(|t| t <= stop) {
                self.stuck_until = None;
                self.jump(0, self.command);
            }
            for i in 0..self.parts.len() {
                if self.parts[i].next_event().is_some_and(|t| t <= stop) {
                    self.parts[i].event();
                    self.jump(i, self.signals[i]);
                }
            }
        }
    }

    /// A piece of time without jumps.
    fn piece(&mut self, dt: f64, end: f64) {
        self.time = end;
        let mut signal = self.signals[0];
        for (part, before) in self.parts.iter_mut().zip(&mut self.signals) {
            let from = std::mem::replace(before, signal);
            let to = signal;
            signal = part.advance(end, &Piece { dt, from, to });
        }
        if let Some(last) = self.signals.last_mut() {
            *last = signal;
        }
        self.out.line_to(end, self.leaving(signal));
    }
}

/// Access for the tests of parts.
#[cfg(test)]
pub(crate) mod bench {
    use super::*;
    use crate::plant::part::Part;
    use crate::waveform::Cursor;

    pub(crate) fn jet(parts: impl IntoIterator<Item = Part>) -> Jet {
        let parts = parts.into_iter().map(|part| match part {
            Part::Jet(part) => part,
            _ => panic!("it does not act on the jet"),
        });
        Jet::new(parts.collect(), &[])
    }

    /// The jet at time `until`, computed in sub-steps.
    pub(crate) fn run(jet: &mut Jet, until: f64) -> f64 {
        while until - jet.time > SHORTEST_PIECE_S {
            jet.advance((jet.time + 5e-5).min(until));
        }
        jet.out.at(until, &mut Cursor::default())
    }
}

#[cfg(test)]
mod tests {
    use super::bench::run;
    use super::*;

    #[test]
    fn every_third_pulse_is_missing() {
        let mut jet = Jet::new(Vec::new(), &[Fault::MissingPulse { every: 3 }]);
        let mut seen = Vec::new();
        for pulse in 0..6 {
            let t = f64::from(pulse) * 0.1;
            jet.command(1.0);
            seen.push(run(&mut jet, t + 0.05));
            jet.command(0.0);
            run(&mut jet, t + 0.1);
        }
        assert_eq!(seen, [1.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn the_valve_sticks_half_open_after_long_pulses_only() {
        let fault = Fault::StickingValve {
            after_open_s: 0.1,
            stuck_s: 0.06,
        };
        let mut jet = Jet::new(Vec::new(), &[fault]);
        jet.command(1.0);
        run(&mut jet, 0.05);
        jet.command(0.0);
        assert_eq!(run(&mut jet, 0.051), 0.0);
        jet.command(1.0);
        run(&mut jet, 0.2);
        jet.command(0.0);
        assert_eq!(run(&mut jet, 0.259), 0.5);
        assert_eq!(run(&mut jet, 0.261), 0.0);
    }
}

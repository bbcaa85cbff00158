//! A valve line with a variable delay, in addition to the transport delay.

use std::collections::VecDeque;
use std::fmt::Debug;

use super::pulses::Pulses;
use crate::plant::part::{JetPart, Part, Piece};

/// The law of the line's delay.
pub(super) trait LineLaw: Clone + Debug + Send + Sync + 'static {
    /// Delay of a command that is issued at the time `t` (s, ≥ 0), given the `pulses` up to this
    /// time.
    fn takes(&self, pulses: &Pulses, t: f64) -> f64;
}

/// A line in the jet path with this law.
pub(super) fn line(law: impl LineLaw) -> Part {
    Part::Jet(Box::new(Line {
        law,
        pulses: Pulses::default(),
        under_way: VecDeque::new(),
        level: 0.0,
    }))
}

/// Commands are level changes; each travels for the delay at its start. One that would overtake earlier ones
/// cancels them.
#[derive(Debug, Clone)]
struct Line<L> {
    law: L,
    pulses: Pulses,
    /// (arrival time, level)
    under_way: VecDeque<(f64, f64)>,
    level: f64,
}

impl<L: LineLaw> JetPart for Line<L> {
    fn jump(&mut self, t: f64, from: f64, to: f64) -> f64 {
        if to != from {
            self.pulses.see(t, to);
            let arrival = t + self.law.takes(&self.pulses, t);
            while self.under_way.back().is_some_and(|e| e.0 >= arrival) {
                self.under_way.pop_back();
            }
            self.under_way.push_back((arrival, to));
        }
        self.level
    }

    fn advance(&mut self, _t: f64, _piece: &Piece) -> f64 {
        self.level
    }

    fn next_event(&self) -> Option<f64> {
        self.under_way.front().map(|e| e.0)
    }

    fn event(&mut self) {
        if let Some((_, level)) = self.under_way.pop_front() {
            self.level = level;
        }
    }
}

/// Arrival times of edges, for tests.
#[cfg(test)]
pub(super) mod bench {
    use super::Part;
    use crate::plant::jet::bench::{jet, run};
    use crate::waveform::Cursor;

    /// Arrival times of edges sent at these times, alternating on and off.
    pub(in super::super) fn arrivals(part: Part, sent: &[f64]) -> Vec<f64> {
        let mut jet = jet([part]);
        let mut level = 0.0;
        for &t in sent {
            run(&mut jet, t);
            level = 1.0 - level;
            jet.command(level);
        }
        let end = sent.last().map_or(0.0, |t| t + 0.5);
        run(&mut jet, end);
        let (mut cursor, mut at) = (Cursor::default(), -1.0);
        let mut arrived = Vec::new();
        while let Some((t, _, _)) = jet.out.jump_inside(at, end, &mut cursor) {
            arrived.push(t);
            at = t;
        }
        arrived
    }
}

#[cfg(test)]
mod tests {
    use super::bench::arrivals;
    use super::*;

    #[derive(Debug, Clone)]
    struct Shorter;

    impl LineLaw for Shorter {
        fn takes(&self, pulses: &Pulses, _t: f64) -> f64 {
            if pulses.number() > 1 { 0.010 } else { 0.050 }
        }
    }

    #[test]
    fn what_is_overtaken_never_arrives() {
        let arrived = arrivals(line(Shorter), &[0.1, 0.2, 0.220, 0.3]);
        let expected = [0.150, 0.310];
        assert_eq!(arrived.len(), 2, "{arrived:?}");
        for (a, e) in arrived.iter().zip(expected) {
            assert!((a - e).abs() < 1e-9, "{arrived:?}");
        }
    }
}

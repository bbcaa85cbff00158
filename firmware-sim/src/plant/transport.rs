//! Transport from the jet's mouth to the sensor: delays that keep the exact times of edges.

use std::collections::VecDeque;

use super::SUBSTEP_S;
use super::base::FlowDelay;

/// Window of the mean friction that determines the state-dependent delay (s).
pub(crate) const MEAN_WINDOW_S: f64 = 0.250;

/// Sub-steps in the window.
const WINDOW: usize = 5000;

/// Running mean of the friction over the last 250 ms, zero before the record.
///
/// Stored as differences of the running integral, so that nothing drifts however long the plant runs.
#[derive(Debug, Clone)]
pub(crate) struct MeanFriction {
    /// (integral since the start, friction) at the last `WINDOW` + 1 sub-steps
    past: VecDeque<(f64, f64)>,
}

impl MeanFriction {
    pub(crate) fn at_rest() -> Self {
        Self {
            past: VecDeque::from(vec![(0.0, 0.0); WINDOW + 1]),
        }
    }

    /// Adds one sub-step: the integral of the friction over it, and the friction at its end.
    pub(crate) fn push(&mut self, area: f64, friction: f64) {
        let total = self.past.back().map_or(0.0, |b| b.0) + area;
        self.past.pop_front();
        self.past.push_back((total, friction));
    }

    /// The present mean and its slope (1/s).
    pub(crate) fn mean_and_slope(&self) -> (f64, f64) {
        match (self.past.front(), self.past.back()) {
            (Some(old), Some(new)) => (
                (new.0 - old.0) / MEAN_WINDOW_S,
                (new.1 - old.1) / MEAN_WINDOW_S,
            ),
            _ => (0.0, 0.0),
        }
    }
}

/// The time at which the jet that arrives at the sensor now was emitted.
#[derive(Debug, Clone)]
pub(crate) struct ArrivalClock {
    law: FlowDelay,
    read_from: f64,
}

impl ArrivalClock {
    pub(crate) fn new(law: FlowDelay) -> Self {
        let mut clock = Self {
            law,
            read_from: 0.0,
        };
        clock.read_from = -clock.delay(0.0);
        clock
    }

    /// The delay at mean friction `mean` (s).
    pub(crate) fn delay(&self, mean: f64) -> f64 {
        match self.law {
            // An edge-dependent law has already changed the times of the edges, before they reached
            // the valve.
            FlowDelay::EdgeDependent { .. } => 0.0,
            law => law.at(mean),
        }
    }

    /// The interval of the jet's past that arrives during the sub-step ending at `end`.
    ///
    /// Each interval begins exactly where the one before ended, so no edge is lost or counted twice.
    pub(crate) fn stretch(&mut self, end: f64, mean: &MeanFriction) -> (f64, f64) {
        let (now, slope) = mean.mean_and_slope();
        let from = self.read_from;
        self.read_from = end - self.delay(now + slope * SUBSTEP_S);
        (from, self.read_from)
    }
}

/// Changes the times of the command's edges, if rising and falling edges have different delays.
///
/// An edge that would overtake earlier ones cancels them: a pulse shorter than the difference of the two delays
/// never arrives.
#[derive(Debug, Clone)]
pub(crate) struct EdgeTravel {
    rise_s: f64,
    fall_s: f64,
    last_level: f64,
    /// (arrival time, level)
    under_way: VecDeque<(f64, f64)>,
}

impl EdgeTravel {
    /// The transport; `None` for laws that delay the jet as a whole.
    pub(crate) fn new(law: FlowDelay) -> Option<Self> {
        match law {
            FlowDelay::EdgeDependent { rise_s, fall_s } => Some(Self {
                rise_s,
                fall_s,
                last_level: 0.0,
                under_way: VecDeque::new(),
            }),
            _ => None,
        }
    }

    /// The command changes at `t`.
    pub(crate) fn send(&mut self, t: f64, level: f64) {
        if level == self.last_level {
            return;
        }
        let delay = if level > self.last_level {
            self.rise_s
        } else {
            self.fall_s
        };
        self.last_level = level;
        let arrival = t + delay;
        while self.under_way.back().is_some_and(|e| e.0 >= arrival) {
            self.under_way.pop_back();
        }
        self.under_way.push_back((arrival, level));
    }

    /// The next edge that arrives before `end`.
    pub(crate) fn next_before(&mut self, end: f64) -> Option<(f64, f64)> {
        if self.under_way.front().is_some_and(|e| e.0 < end) {
            self.under_way.pop_front()
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_ramp_is_its_value_half_a_window_ago() {
        let mut mean = MeanFriction::at_rest();
        for n in 1..=20_000 {
            let (a, b) = (f64::from(n - 1) * SUBSTEP_S, f64::from(n) * SUBSTEP_S);
            mean.push(0.5 * (a + b) * SUBSTEP_S, b);
        }
        let (m, slope) = mean.mean_and_slope();
        assert!((m - (1.0 - 0.125)).abs() < 1e-9);
        assert!((slope - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_pulse_shorter_than_the_difference_of_the_delays_never_arrives() {
        let law = FlowDelay::EdgeDependent {
            rise_s: 0.050,
            fall_s: 0.030,
        };
        let mut travel = EdgeTravel::new(law).unwrap();
        travel.send(0.000, 1.0);
        travel.send(0.015, 0.0);
        travel.send(0.100, 1.0);
        travel.send(0.130, 0.0);
        let arrived: Vec<_> = std::iter::from_fn(|| travel.next_before(1.0)).collect();
        let expected = [(0.045, 0.0), (0.150, 1.0), (0.160, 0.0)];
        assert_eq!(arrived.len(), expected.len());
        for (a, e) in arrived.iter().zip(expected) {
            assert!((a.0 - e.0).abs() < 1e-12 && a.1 == e.1);
        }
    }
}

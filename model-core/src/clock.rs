//! Time in the record, and time since the command last changed.

use crate::real::Real;

/// Samples since the last edge if there was none: 2²⁴, the largest count up to which `f32` represents every
/// integer; 4.6 hours at 1 kHz.
pub const LONG_AGO: u32 = 1 << 24;

/// Counts samples and detects edges of the command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock<T> {
    lived: u32,
    since_edge: u32,
    command: T,
}

impl<T: Real> Clock<T> {
    /// A clock before the record's first sample: the command has always been 0.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            lived: 0,
            since_edge: LONG_AGO,
            command: T::ZERO,
        }
    }

    /// Adds a sample; called once per sample, before the times are read.
    #[inline]
    pub fn tick(&mut self, command: T) {
        self.lived = self.lived.saturating_add(1);
        let changed = command.partial_cmp(&self.command) != Some(core::cmp::Ordering::Equal);
        self.since_edge = if changed {
            0
        } else {
            self.since_edge.saturating_add(1).min(LONG_AGO)
        };
        self.command = command;
    }

    /// Time from the record's start, in the unit of `period`; constant after 2³² samples.
    #[inline]
    pub fn time(&self, period: T) -> T {
        T::from_count(self.lived.saturating_sub(1)) * period
    }

    /// Time since the command last changed, in the unit of `period`: 0 at the
    /// edge itself, [`LONG_AGO`] samples if there was none.
    #[inline]
    pub fn since_edge(&self, period: T) -> T {
        T::from_count(self.since_edge) * period
    }
}

impl<T: Real> Default for Clock<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_start_the_count_again() {
        let mut clock = Clock::<f32>::new();
        let mut seen = std::vec::Vec::new();
        for u in [0.0, 1.0, 1.0, 0.0, 0.0, 0.0] {
            clock.tick(u);
            seen.push((clock.time(1.0), clock.since_edge(1.0)));
        }
        let never = LONG_AGO as f32;
        let expected = [
            (0.0, never),
            (1.0, 0.0),
            (2.0, 1.0),
            (3.0, 0.0),
            (4.0, 1.0),
            (5.0, 2.0),
        ];
        assert_eq!(seen, expected);
    }

    #[test]
    fn a_record_that_begins_switched_on_begins_with_an_edge() {
        let mut clock = Clock::<f64>::new();
        clock.tick(1.0);
        assert_eq!((clock.time(0.001), clock.since_edge(0.001)), (0.0, 0.0));
    }
}

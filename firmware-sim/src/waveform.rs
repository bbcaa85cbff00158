//! An exact representation of a signal: linear between knots, jumps at knots.
//!
//! Transport delays read this memory at arbitrary past times, so a switching edge arrives at its exact time and not
//! at the next sample.

use std::collections::VecDeque;

/// A stored instant; `left` and `right` differ if the signal jumps.
#[derive(Debug, Clone, Copy)]
struct Knot {
    t: f64,
    left: f64,
    right: f64,
}

/// The past of one signal, long enough for the longest delay.
#[derive(Debug, Clone)]
pub(crate) struct Waveform {
    knots: VecDeque<Knot>,
    /// Number of discarded knots, so that a [`Cursor`] stays valid.
    forgotten: usize,
    keep_s: f64,
}

/// A reader's position in a [`Waveform`]; reading forward then costs one or two steps.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cursor(usize);

impl Waveform {
    /// A signal that has been `value` for all times up to 0 and stores `keep_s` seconds.
    pub(crate) fn at_rest(value: f64, keep_s: f64) -> Self {
        let mut knots = VecDeque::with_capacity(64);
        knots.push_back(Knot {
            t: 0.0,
            left: value,
            right: value,
        });
        Self {
            knots,
            forgotten: 0,
            keep_s,
        }
    }

    /// Continues the signal linearly to `value` at `t`.
    pub(crate) fn line_to(&mut self, t: f64, value: f64) {
        self.knots.push_back(Knot {
            t,
            left: value,
            right: value,
        });
        while self
            .knots
            .get(1)
            .is_some_and(|second| second.t < t - self.keep_s)
        {
            self.knots.pop_front();
            self.forgotten += 1;
        }
    }

    /// Adds a jump of the signal to `value` at the time of the newest knot.
    pub(crate) fn jump_to(&mut self, value: f64) {
        if let Some(last) = self.knots.back_mut() {
            last.right = value;
        }
    }

    /// Index of the last knot at or before `t` (the first one if `t` precedes all).
    fn seek(&self, t: f64, cursor: &mut Cursor) -> usize {
        let last = self.knots.len().saturating_sub(1);
        let mut i = cursor.0.saturating_sub(self.forgotten).min(last);
        while i > 0 && self.knots.get(i).is_some_and(|k| k.t > t) {
            i -= 1;
        }
        while self.knots.get(i + 1).is_some_and(|k| k.t <= t) {
            i += 1;
        }
        cursor.0 = i + self.forgotten;
        i
    }

    fn between(&self, i: usize, t: f64) -> f64 {
        match (self.knots.get(i), self.knots.get(i + 1)) {
            (Some(a), _) if t <= a.t => a.left,
            (Some(a), Some(b)) => a.right + (b.left - a.right) * (t - a.t) / (b.t - a.t),
            (Some(a), None) => a.right,
            (None, _) => 0.0,
        }
    }

    /// The value just before `t`.
    pub(crate) fn before(&self, t: f64, cursor: &mut Cursor) -> f64 {
        let i = self.seek(t, cursor);
        self.between(i, t)
    }

    /// The value at `t` and just after it.
    pub(crate) fn at(&self, t: f64, cursor: &mut Cursor) -> f64 {
        let i = self.seek(t, cursor);
        match self.knots.get(i) {
            Some(k) if k.t == t => k.right,
            _ => self.between(i, t),
        }
    }

    /// The first jump strictly inside (`from`, `to`): its time, the values before and after.
    pub(crate) fn jump_inside(
        &self,
        from: f64,
        to: f64,
        cursor: &mut Cursor,
    ) -> Option<(f64, f64, f64)> {
        let first = self.seek(from, cursor);
        self.knots
            .range(first.min(self.knots.len())..)
            .skip_while(|k| k.t <= from)
            .take_while(|k| k.t < to)
            .find(|k| k.left != k.right)
            .map(|k| (k.t, k.left, k.right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_lines_jumps_and_the_time_before_the_record() {
        let mut wave = Waveform::at_rest(0.0, 10.0);
        wave.line_to(1.0, 2.0);
        wave.jump_to(5.0);
        wave.line_to(2.0, 5.0);
        let mut c = Cursor::default();
        assert_eq!(wave.at(-3.0, &mut c), 0.0);
        assert_eq!(wave.at(0.25, &mut c), 0.5);
        assert_eq!(wave.before(1.0, &mut c), 2.0);
        assert_eq!(wave.at(1.0, &mut c), 5.0);
        assert_eq!(wave.at(9.0, &mut c), 5.0);
        assert_eq!(wave.at(0.5, &mut c), 1.0, "a cursor may go back");
        assert_eq!(wave.jump_inside(0.9, 1.1, &mut c), Some((1.0, 2.0, 5.0)));
        assert_eq!(wave.jump_inside(1.0, 1.1, &mut c), None);
    }

    #[test]
    fn forgets_what_no_delay_can_reach_and_keeps_cursors_valid() {
        let mut wave = Waveform::at_rest(0.0, 1.0);
        let mut c = Cursor::default();
        for i in 1..100_000 {
            let t = f64::from(i) * 0.01;
            wave.line_to(t, t);
            assert!((wave.at(t - 0.555, &mut c) - (t - 0.555).max(0.0)).abs() < 1e-9);
        }
        assert!(wave.knots.len() < 110);
    }
}

//! Periodic on/off commands of the maximising law.

use crate::control::hold::{Hold, HoldTimes};

/// `N` pulses in a period that repeats endlessly.
///
/// ```
/// use model_core::control::PulseTrain;
/// let train = PulseTrain { period: 5, pulses: [(1, 2)] }; // on for samples 1 and 2 of 5
/// let mut at = 0;
/// let command: [bool; 7] = core::array::from_fn(|_| train.next(&mut at));
/// assert_eq!(command, [false, true, true, false, false, false, true]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseTrain<P> {
    /// Length of the period, samples, at least 1.
    pub period: u32,
    /// (first sample, length) of each pulse in samples; a pulse may extend beyond the end of the period.
    pub pulses: P,
}

impl<P: AsRef<[(u32, u32)]>> PulseTrain<P> {
    /// Whether the valve is open at sample `at` of the period.
    #[must_use]
    pub fn is_on(&self, at: u32) -> bool {
        let period = self.period.max(1);
        let at = u64::from(at % period);
        self.pulses.as_ref().iter().any(|&(first, length)| {
            let first = u64::from(first % period);
            let period = u64::from(period);
            (at + period - first) % period < u64::from(length)
        })
    }

    /// The command at sample `at`; advances `at`.
    pub fn next(&self, at: &mut u32) -> bool {
        let on = self.is_on(*at);
        *at = if *at + 1 < self.period { *at + 1 } else { 0 };
        on
    }

    /// Share of the period with the valve open, as (samples open, period).
    #[must_use]
    pub fn open(&self) -> (u32, u32) {
        let period = self.period.max(1);
        (
            (0..period).map(|at| u32::from(self.is_on(at))).sum(),
            period,
        )
    }
}

/// A pulse train with hold times, as played on a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulses<P> {
    /// The requested train.
    pub train: PulseTrain<P>,
    /// Hold times of the valve.
    pub hold: HoldTimes,
}

/// Position of a [`Pulses`] in its period, and state of the valve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Played {
    at: u32,
    hold: Hold,
}

impl Played {
    /// The start of the period, with the valve closed for a long time.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            at: 0,
            hold: Hold::closed(),
        }
    }

    /// Closes the valve for this sample and restarts the period.
    #[inline]
    pub fn shut(&mut self) {
        self.at = 0;
        self.hold.shut();
    }
}

impl Default for Played {
    fn default() -> Self {
        Self::new()
    }
}

impl<P: AsRef<[(u32, u32)]>> Pulses<P> {
    /// The valve's position from now to the next sample.
    #[inline]
    pub fn step(&self, played: &mut Played) -> bool {
        let wanted = self.train.next(&mut played.at);
        played.hold.pass(&self.hold, wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_wrap_and_overlap() {
        let train = PulseTrain {
            period: 10,
            pulses: [(8, 4), (0, 3), (5, 1)],
        };
        let command: [bool; 10] = core::array::from_fn(|at| train.is_on(at as u32));
        assert_eq!(
            command,
            [
                true, true, true, false, false, true, false, false, true, true
            ]
        );
        assert_eq!(train.open(), (6, 10));
    }

    #[test]
    fn the_valve_keeps_its_times_and_a_shut_one_begins_anew() {
        let pulses = Pulses {
            train: PulseTrain {
                period: 6,
                pulses: [(0, 1), (3, 2)],
            },
            hold: HoldTimes { on: 2, off: 1 },
        };
        let mut played = Played::new();
        let play = |n: usize, played: &mut Played| {
            let mut on = 0;
            for _ in 0..n {
                on = on << 1 | u32::from(pulses.step(played));
            }
            on
        };
        // The first pulse is too short for the valve.
        assert_eq!(play(7, &mut played), 0b110_1101);
        played.shut();
        assert_eq!(play(6, &mut played), 0b11_0110);
    }

    #[test]
    fn a_period_of_zero_is_one() {
        let train = PulseTrain {
            period: 0,
            pulses: [(0, 1)],
        };
        let mut at = 7;
        assert!(train.next(&mut at));
        assert_eq!(train.open(), (1, 1));
    }
}

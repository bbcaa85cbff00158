//! The stored past of a signal on the host.

use model_core::Real;
use model_core::history::{Memory, Past, Reaching};

/// A ring buffer with a size chosen at run time: the host's counterpart of `model_core::history::DelayLine`. It
/// stores when its signal last changed. A delay law is not evaluated if the signal is constant over all its
/// possible delays.
#[derive(Clone, Debug)]
pub struct Ring<T> {
    samples: Vec<T>,
    newest: usize,
    /// Samples that were pushed.
    count: i64,
    /// Flags of the samples that differ from the preceding one, newest first.
    changes: [i64; CHANGES],
}

/// Number of stored changes: jets switch only a few times within a delay.
const CHANGES: usize = 4;

impl<T: Real> Reaching<T> for Ring<T> {
    fn reaching(lag: usize) -> Self {
        Self {
            samples: vec![T::ZERO; (lag + 1).next_power_of_two()],
            newest: 0,
            count: 0,
            changes: [i64::MIN; CHANGES],
        }
    }
}

impl<T: Real> Past<T> for Ring<T> {
    #[inline(always)]
    fn back(&self, lag: usize) -> T {
        let mask = self.samples.len() - 1;
        if lag > mask {
            return T::ZERO;
        }
        let at = self.newest.wrapping_sub(lag) & mask;
        self.samples.get(at).copied().unwrap_or(T::ZERO)
    }
}

impl<T: Real> Memory<T> for Ring<T> {
    #[inline(always)]
    fn push(&mut self, value: T) {
        self.count += 1;
        if value != self.samples[self.newest] {
            let [first, second, third, _] = self.changes;
            self.changes = [self.count, first, second, third];
        }
        self.newest = (self.newest + 1) & (self.samples.len() - 1);
        self.samples[self.newest] = value;
    }
    #[inline(always)]
    fn steady(&self, from: usize, to: usize) -> Option<T> {
        let (newest, oldest) = (self.count - from as i64, self.count - to as i64);
        let last = self.changes.iter().find(|change| **change <= newest)?;
        (*last <= oldest).then(|| self.back(from))
    }
    #[inline(always)]
    fn capacity(&self) -> usize {
        self.samples.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_says_steady_only_of_what_is() {
        let mut ring = Ring::<f64>::reaching(40);
        let (mut said, mut switch) = (0, 0u32);
        for k in 0..400_u32 {
            switch = switch.wrapping_mul(1_664_525).wrapping_add(k);
            // The jet has pulses of all lengths, and a valve that opens slowly.
            let value = match k / 100 {
                0 | 1 => f64::from(k / (3 + k / 40) % 2),
                2 => f64::from(switch >> 31),
                _ => f64::from(k % 50).min(20.0) / 20.0,
            };
            ring.push(value);
            for (from, to) in [(0, 5), (3, 3), (10, 18), (25, 40)] {
                if let Some(level) = ring.steady(from, to) {
                    said += 1;
                    assert!(
                        (from..=to).all(|lag| ring.back(lag) == level),
                        "{k} {from} {to}"
                    );
                }
            }
        }
        assert!(said > 300, "{said}");
        assert_eq!(Ring::<f64>::reaching(8).steady(2, 6), Some(0.0));
    }
}

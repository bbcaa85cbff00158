//! What the host remembers of a signal.

use model_core::Real;
use model_core::history::{Memory, Past};

/// A ring buffer with a size chosen at run time: the host's counterpart of
/// `model_core::history::DelayLine`.
#[derive(Clone, Debug)]
pub struct Ring<T> {
    samples: Vec<T>,
    newest: usize,
}

impl<T: Real> Ring<T> {
    /// A ring that reaches back at least `lag` samples.
    #[must_use]
    pub fn reaching(lag: usize) -> Self {
        Self {
            samples: vec![T::ZERO; (lag + 1).next_power_of_two()],
            newest: 0,
        }
    }
}

impl<T: Real> Past<T> for Ring<T> {
    #[inline]
    fn back(&self, lag: usize) -> T {
        let mask = self.samples.len() - 1;
        if lag > mask {
            return T::ZERO;
        }
        self.samples[self.newest.wrapping_sub(lag) & mask]
    }
}

impl<T: Real> Memory<T> for Ring<T> {
    #[inline]
    fn push(&mut self, value: T) {
        self.newest = (self.newest + 1) & (self.samples.len() - 1);
        self.samples[self.newest] = value;
    }
    #[inline]
    fn capacity(&self) -> usize {
        self.samples.len()
    }
}

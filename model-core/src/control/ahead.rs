//! Looking ahead: the model run on from the present, without copying its past.

use crate::history::{Memory, Past};
use crate::model::{Clamps, State};
use crate::real::Real;
use core::cell::Cell;

/// A signal's past with samples that have not happened yet in front of it.
///
/// Reads cost the same as from the past alone; the past is borrowed, not copied.
#[derive(Debug)]
pub struct Ahead<'a, T, P> {
    past: &'a P,
    ahead: &'a mut [T],
    filled: usize,
    consulted: Cell<bool>,
}

impl<'a, T: Real, P: Past<T>> Ahead<'a, T, P> {
    /// Nothing ahead yet; room for as many samples as `ahead` is long. What is
    /// pushed beyond is dropped.
    pub fn new(past: &'a P, ahead: &'a mut [T]) -> Self {
        Self {
            past,
            ahead,
            filled: 0,
            consulted: Cell::new(false),
        }
    }

    /// Whether any sample ahead was read so far.
    #[inline]
    #[must_use]
    pub fn was_consulted(&self) -> bool {
        self.consulted.get()
    }
}

impl<T: Real, P: Past<T>> Past<T> for Ahead<'_, T, P> {
    #[inline]
    fn back(&self, lag: usize) -> T {
        match lag.checked_sub(self.filled) {
            Some(behind) => self.past.back(behind),
            None => {
                self.consulted.set(true);
                // 0 ≤ filled − 1 − lag < filled ≤ length.
                let index = self.filled - 1 - lag;
                self.ahead.get(index).copied().unwrap_or(T::ZERO)
            }
        }
    }
}

impl<T: Real, P: Memory<T>> Memory<T> for Ahead<'_, T, P> {
    #[inline]
    fn push(&mut self, value: T) {
        if let Some(slot) = self.ahead.get_mut(self.filled) {
            *slot = value;
            self.filled += 1;
        }
    }
    #[inline]
    fn capacity(&self) -> usize {
        self.past.capacity()
    }
    fn mean_back(&self, lag: usize, window: u32) -> T {
        // The part ahead sample by sample, the rest as the past does it best.
        let new = self.filled.saturating_sub(lag).min(window as usize);
        let mut sum = T::ZERO;
        for i in 0..new {
            sum = sum + self.back(lag + i);
        }
        let old = window - new as u32;
        if old > 0 {
            let behind = lag.saturating_sub(self.filled);
            sum = sum + self.past.mean_back(behind, old) * T::from_count(old);
        }
        sum / T::from_count(window.max(1))
    }
}

/// The state of a model run ahead of one with memories `Y` and `J`.
pub type AheadOf<'a, T, Y, J, D, E> = State<T, Ahead<'a, T, Y>, Ahead<'a, T, J>, D, E>;

impl<T, Y, J, D, E> State<T, Y, J, D, E>
where
    T: Real,
    Y: Memory<T>,
    J: Memory<T>,
    D: Clone,
    E: Clone,
{
    /// A state to run ahead with [`step`](crate::step) for as many samples as
    /// the two slices are long; this one stays as it is.
    ///
    /// Copies the state of effects and averages, not the past.
    pub fn ahead<'a>(
        &'a self,
        outputs: &'a mut [T],
        jets: &'a mut [T],
    ) -> AheadOf<'a, T, Y, J, D, E> {
        State {
            outputs: Ahead::new(&self.outputs, outputs),
            jets: Ahead::new(&self.jets, jets),
            clamps: Clamps::default(),
            average: self.average,
            delay: self.delay.clone(),
            effects: self.effects.clone(),
        }
    }
}

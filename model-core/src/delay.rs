//! The transport delay between jets and sensor: which past jet strength the
//! flow receives now.

use crate::history::Past;
use crate::real::Real;

/// Where the flow reads the jet history: `whole` samples back, or between that
/// sample and the one before it when `fraction` (0–1) is not 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap<T> {
    /// Whole samples of delay.
    pub whole: usize,
    /// Weight of the next older sample, 0–1.
    pub fraction: T,
}

impl<T: Real> Tap<T> {
    /// A tap on a sample.
    #[inline]
    #[must_use]
    pub fn on(whole: usize) -> Self {
        Self {
            whole,
            fraction: T::ZERO,
        }
    }

    /// A tap at any delay ≥ 0 (negative or NaN counts as 0), in samples.
    #[inline]
    #[must_use]
    pub fn between(delay: T) -> Self {
        let delay = delay.at_least(T::ZERO);
        let whole = delay.floor().max(0);
        Self {
            whole: whole as usize,
            fraction: delay - T::from_count(whole as u32),
        }
    }

    /// The signal that far back: between two samples, straight from one to the other.
    #[inline]
    pub fn read(&self, past: &impl Past<T>) -> T {
        let newer = past.back(self.whole);
        let older = past.back(self.whole.saturating_add(1));
        newer + self.fraction * (older - newer)
    }
}

/// A law for the input delays h_l of eqs. (3) and (4).
pub trait DelayLaw<T: Real> {
    /// What the law remembers of the command.
    type State: Clone;
    /// Whether taps can fall between samples.
    const INTERPOLATES: bool = false;

    /// The state before the first sample.
    fn start(&self) -> Self::State;

    /// The command as the valve will get it; an edge may be held back here.
    #[inline]
    fn command(&self, _state: &mut Self::State, command: T) -> T {
        command
    }

    /// The part of the law that all inputs share, evaluated once a sample at
    /// the averaged output ỹ_k, or y_k for an averaged model.
    #[inline]
    fn evaluate(&self, _output: T) -> T {
        T::ZERO
    }

    /// The shortest and the longest tap of input `l` for outputs that are
    /// numbers ≥ 0, where all its taps are on samples and that is known.
    #[inline]
    fn range(&self, _l: usize) -> Option<(usize, usize)> {
        None
    }

    /// The tap of input `l`, from what [`evaluate`](Self::evaluate) gave.
    fn tap(&self, l: usize, evaluated: T) -> Tap<T>;
}

/// Constant delays h_l in samples, eq. (3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FixedDelay<H> {
    /// h_l, samples.
    pub delays: H,
}

impl<T: Real, H: AsRef<[u16]>> DelayLaw<T> for FixedDelay<H> {
    type State = ();
    fn start(&self) {}
    #[inline]
    fn tap(&self, l: usize, _evaluated: T) -> Tap<T> {
        Tap::on(self.delays.as_ref().get(l).copied().unwrap_or(0).into())
    }
}

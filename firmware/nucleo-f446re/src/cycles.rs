//! The core's cycle counter.

use board::lockstep::Stopwatch;
use cortex_m::peripheral::{DCB, DWT};

/// Counts core cycles.
pub struct Cycles(());

impl Cycles {
    /// Starts the counter.
    #[must_use]
    pub fn new(mut dcb: DCB, mut dwt: DWT) -> Self {
        dcb.enable_trace();
        dwt.enable_cycle_counter();
        Self(())
    }
}

impl Stopwatch for Cycles {
    #[inline(always)]
    fn measure<R>(&mut self, work: impl FnOnce() -> R) -> (R, u32) {
        let before = DWT::cycle_count();
        let result = work();
        (result, DWT::cycle_count().wrapping_sub(before))
    }
}
